//! One face written in any format: its shapes, or the frames of a source.

use std::io;
use std::path::Path;

use super::face::{ExportFace, Frame, Shape, WeightAnimation};
use super::npz::{self, NpzWriter};
use super::obj_folder::ObjFolder;
use super::run::OnProgress;
use super::take::{FrameSource, heads_or_none};
use super::{
    BasisError, ExportError, ExportFormat, ExportOptions, ExportReport, basis, glb, point_cache,
    usda,
};
use crate::atomic_file::write_atomically;
use crate::registration::Progress;

/// An error inside a file that is being written: of the file or of what goes into it.
enum Inside {
    Io(io::Error),
    Export(ExportError),
}

impl From<io::Error> for Inside {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<ExportError> for Inside {
    fn from(error: ExportError) -> Self {
        Self::Export(error)
    }
}

impl Inside {
    fn at(path: &Path) -> impl Fn(Self) -> ExportError {
        let path = path.to_owned();
        move |error| match error {
            Self::Io(source) => ExportError::Io {
                path: path.clone(),
                source,
            },
            Self::Export(error) => error,
        }
    }
}

/// A file on its way, and what is to be said of it.
pub(super) struct Writer<'a> {
    path: &'a Path,
    face: &'a ExportFace,
    notes: Vec<String>,
    pub(super) report: ExportReport,
}

impl<'a> Writer<'a> {
    pub(super) fn new(
        path: &'a Path,
        format: ExportFormat,
        face: &'a ExportFace,
        notes: Vec<String>,
    ) -> Self {
        let vertices = face.positions.len();
        Self {
            path,
            face,
            notes,
            report: ExportReport {
                format,
                files: 1,
                bytes: 0,
                vertices,
                written_vertices: vertices,
                polygons: face.polygons.len(),
                millimetres_per_unit: face.placement.millimetres_per_unit,
                shapes: Vec::new(),
                still_shapes: Vec::new(),
                materials: face.sections.iter().map(|s| s.name.clone()).collect(),
                frames: 0,
                fps: None,
                seconds: 0.0,
                linear: None,
                basis: None,
                notes: Vec::new(),
                wall_secs: 0.0,
            },
        }
    }

    pub(super) fn finish(mut self) -> ExportReport {
        self.report.notes = self.notes;
        self.report
    }

    /// Writes shapes, and the animation of their weights.
    pub(super) fn write_shapes(
        &mut self,
        shapes: &[Shape],
        animation: Option<&WeightAnimation>,
    ) -> Result<(), ExportError> {
        let (path, face) = (self.path, self.face);
        match self.report.format {
            ExportFormat::Glb => self.take(glb::write(path, face, shapes, animation, true)?),
            ExportFormat::Gltf => self.take(glb::write(path, face, shapes, animation, false)?),
            ExportFormat::Usda => {
                let (pictures, bytes) = usda::write_pictures(path, face)?;
                self.report.files += pictures.len();
                let span = animation.map(|a| (a.times.len() - 1, a.fps));
                self.text(bytes, |out| {
                    usda::begin(out, face, span)?;
                    Ok(usda::write_shapes(out, face, shapes, animation, &pictures)?)
                })?;
            }
            ExportFormat::Npz => self.text(0, |out| {
                let mut archive = NpzWriter::new(out);
                npz::write_face(&mut archive, face)?;
                npz::write_shapes(&mut archive, shapes, face.positions.len())?;
                if let Some(animation) = animation {
                    npz::write_weights(&mut archive, animation)?;
                }
                Ok(archive.finish()?)
            })?,
            ExportFormat::Obj => {
                let mut folder = ObjFolder::new(path, face)?;
                folder.write("neutral", face.positions.clone())?;
                for shape in shapes {
                    let mut moved = face.positions.clone();
                    for (vertex, offset) in &shape.offsets {
                        moved[*vertex as usize] += offset;
                    }
                    folder.write(&shape.name, moved)?;
                }
                (self.report.files, self.report.bytes) = folder.finish()?;
            }
            format @ (ExportFormat::Pc2 | ExportFormat::Mdd) => {
                return Err(ExportError::NoMotion {
                    path: path.to_owned(),
                    format: format.name(),
                });
            }
        }
        self.report.shapes = shapes.iter().map(|s| s.name.clone()).collect();
        let still = shapes.iter().filter(|s| s.offsets.is_empty());
        self.report.still_shapes = still.map(|s| s.name.clone()).collect();
        if let Some(animation) = animation {
            self.report.frames = animation.times.len();
            self.report.fps = Some(animation.fps);
            self.report.seconds = animation.times.last().copied().unwrap_or(0.0);
        }
        Ok(())
    }

    fn take(&mut self, written: glb::Written) {
        self.report.files = written.files;
        self.report.bytes = written.bytes;
        self.report.written_vertices = written.vertices;
    }

    /// Writes a file in one go; `others` counts the bytes of those beside it.
    fn text(
        &mut self,
        others: u64,
        write: impl FnOnce(&mut dyn io::Write) -> Result<(), Inside>,
    ) -> Result<(), ExportError> {
        write_atomically(self.path, write).map_err(Inside::at(self.path))?;
        let length = std::fs::metadata(self.path).map_err(ExportError::io(self.path))?;
        self.report.bytes = others + length.len();
        Ok(())
    }

    /// Writes the vertices of every frame.
    pub(super) fn write_frames(
        &mut self,
        frames: &mut dyn FrameSource,
        options: &ExportOptions,
        progress: OnProgress<'_>,
    ) -> Result<(), ExportError> {
        let (path, face) = (self.path, self.face);
        let (count, fps) = (frames.frame_count(), frames.fps());
        let with_head = !options.still_head;
        let mut next = |done: usize| -> Result<Option<Frame>, ExportError> {
            let now = Progress {
                stage: "frames",
                fraction: done as f64 / count.max(1) as f64,
            };
            if progress(now).is_break() {
                return Err(ExportError::Stopped);
            }
            frames.next_frame()
        };
        self.report.frames = count;
        self.report.fps = Some(fps);
        self.report.seconds = count.saturating_sub(1) as f64 / fps;
        match self.report.format {
            format @ (ExportFormat::Glb | ExportFormat::Gltf) => {
                let (shapes, animation, error) = self.reduced(options, fps, count, &mut next)?;
                let is_binary = format == ExportFormat::Glb;
                self.take(glb::write(
                    path,
                    face,
                    &shapes,
                    Some(&animation),
                    is_binary,
                )?);
                self.report.basis = Some(error);
            }
            ExportFormat::Usda => {
                let (pictures, bytes) = usda::write_pictures(path, face)?;
                self.report.files += pictures.len();
                self.text(bytes, |out| {
                    usda::begin(out, face, Some((count.saturating_sub(1), fps)))?;
                    usda::begin_frames(out, face)?;
                    let mut done = 0;
                    while let Some(frame) = next(done)? {
                        usda::write_frame(out, face, done, &frame, with_head)?;
                        done += 1;
                    }
                    Ok(usda::end_frames(out, face, &pictures)?)
                })?;
            }
            ExportFormat::Npz => self.text(0, |out| {
                let mut archive = NpzWriter::new(out);
                npz::write_face(&mut archive, face)?;
                let shape = [count, face.positions.len(), 3];
                archive.begin_floats("frames", &shape)?;
                let mut times = Vec::new();
                while let Some(frame) = next(times.len())? {
                    npz::write_frame(&mut archive, face, &frame, with_head)?;
                    times.push(frame.time);
                }
                let array = npz::Elements::F64(&times);
                archive.array("times", &[times.len()], array)?;
                Ok(archive.finish()?)
            })?,
            format @ (ExportFormat::Pc2 | ExportFormat::Mdd) => {
                let is_mdd = format == ExportFormat::Mdd;
                let vertices = face.positions.len();
                self.text(0, |out| {
                    if is_mdd {
                        point_cache::begin_mdd(out, vertices, count, fps)?;
                    } else {
                        point_cache::begin_pc2(out, vertices, count)?;
                    }
                    let mut done = 0;
                    while let Some(frame) = next(done)? {
                        point_cache::write_frame(out, face, &frame, with_head, is_mdd)?;
                        done += 1;
                    }
                    Ok(())
                })?;
            }
            ExportFormat::Obj => {
                let mut folder = ObjFolder::new(path, face)?;
                let mut done = 0;
                while let Some(frame) = next(done)? {
                    done += 1;
                    folder.write(&format!("frame_{done:05}"), face.moved(&frame, with_head))?;
                }
                (self.report.files, self.report.bytes) = folder.finish()?;
            }
        }
        Ok(())
    }

    /// All frames as a few morph targets.
    fn reduced(
        &self,
        options: &ExportOptions,
        fps: f64,
        count: usize,
        next: &mut dyn FnMut(usize) -> Result<Option<Frame>, ExportError>,
    ) -> Result<(Vec<Shape>, WeightAnimation, BasisError), ExportError> {
        let mut offsets = Vec::with_capacity(count);
        let mut animation = WeightAnimation {
            name: options.motion_name.clone(),
            times: Vec::new(),
            fps,
            weights: Vec::new(),
            heads: Vec::new(),
        };
        while let Some(frame) = next(offsets.len())? {
            let numbers = frame.offsets.iter().flat_map(|d| [d.x, d.y, d.z]);
            offsets.push(numbers.map(|x| x as f32).collect());
            animation.times.push(frame.time);
            animation.heads.push(frame.head);
        }
        animation.heads = if options.still_head {
            Vec::new()
        } else {
            heads_or_none(animation.heads)
        };
        let placement = &self.face.placement;
        let basis = basis::reduce(
            &offsets,
            options.components,
            options.basis_tolerance,
            placement,
        );
        animation.weights = basis.weights;
        Ok((basis.shapes, animation, basis.error))
    }
}
