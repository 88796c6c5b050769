//! From a recording to a file.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Similarity3;

use super::face::{ExportFace, Frame, Placement};
use super::look;
use super::run::OnProgress;
use super::take::FrameSource;
use super::writer::Writer;
use super::{ExportError, ExportFormat, ExportOptions, ExportReport, LengthUnit};
use crate::mesh::{Mesh, Polygons};
use crate::recording::{RecordedFrame, RecordingReader};
use crate::rig::Rig;

/// How a recording is converted.
#[derive(Debug, Clone, Default)]
pub struct ConvertOptions {
    /// The rig that was recorded: then the user's own polygons, texture coordinates, units and
    /// place are written, instead of the recording's triangles in the head frame.
    pub rig: Option<Arc<Rig>>,
    /// Everything else; [`ExportOptions::unit`] `Own` is that of the rig, or millimetres.
    pub export: ExportOptions,
}

/// Writes the skin of a recording, frame by frame, in another format.
///
/// The recording's positions are rounded (7.6 µm by default), and so is what is written.
///
/// # Errors
///
/// [`ExportError`]; then nothing is left at `output` that was not there before.
pub fn convert(
    recording: &Path,
    output: &Path,
    options: &ConvertOptions,
    progress: OnProgress<'_>,
) -> Result<ExportReport, ExportError> {
    let clock = Instant::now();
    let format = ExportFormat::of(output)?;
    let unit = options.export.unit.unwrap_or(match format {
        ExportFormat::Glb | ExportFormat::Gltf => LengthUnit::Metre,
        _ => LengthUnit::Own,
    });
    let times = skin_times(recording)?;
    let (Some((first, vertices)), true) = (times.first().copied(), times.len() > 1) else {
        return Err(ExportError::NoSkin {
            path: recording.to_owned(),
            frames: times.len(),
        });
    };
    if let Some((_, found)) = times.iter().find(|(_, count)| *count != vertices) {
        return Err(ExportError::VertexCount {
            path: recording.to_owned(),
            expected: vertices,
            found: *found,
        });
    }
    let last = times[times.len() - 1].0;
    let mut notes = Vec::new();
    let fps = (times.len() - 1) as f64 / (last - first);
    let mut reader = RecordedFrames {
        reader: RecordingReader::open(recording)?,
        placement: Placement::new(Similarity3::identity(), unit),
        rest: Vec::new(),
        first,
        count: times.len(),
        fps: nearest_rate(fps),
    };
    let face = match &options.rig {
        Some(rig) => {
            if rig.face.vertex_count() != vertices {
                return Err(ExportError::VertexCount {
                    path: recording.to_owned(),
                    expected: rig.face.vertex_count(),
                    found: vertices,
                });
            }
            reader.placement = Placement::new(rig.to_head, unit);
            reader.rest = rig.skin_at_rest().iter().map(|p| p.cast()).collect();
            let source = options.export.source.as_deref();
            let appearance = look::appearance(rig, source, &mut notes)?;
            let name = &options.export.name;
            ExportFace::new(name, &rig.face, reader.placement, appearance)
        }
        None => {
            let frame = first_frame(recording)?;
            let (mesh, surfaces, of_polygon) = mesh_of(&frame, recording)?;
            reader.rest = mesh.positions().to_vec();
            let appearance = look::of_surfaces(&surfaces, of_polygon);
            let name = &options.export.name;
            ExportFace::new(name, &mesh, reader.placement, appearance)
        }
    };
    let mut writer = Writer::new(output, format, &face, notes);
    writer.write_frames(&mut reader, &options.export, progress)?;
    let mut report = writer.finish();
    report.wall_secs = clock.elapsed().as_secs_f64();
    Ok(report)
}

/// Time of every frame with a skin, and how many vertices it has.
fn skin_times(path: &Path) -> Result<Vec<(f64, usize)>, ExportError> {
    let mut reader = RecordingReader::open(path)?;
    let mut times = Vec::new();
    while let Some(frame) = reader.next_frame()? {
        if let Some(skin) = &frame.skin {
            times.push((frame.time_secs, skin.positions.len()));
        }
    }
    Ok(times)
}

fn first_frame(path: &Path) -> Result<RecordedFrame, ExportError> {
    let mut reader = RecordingReader::open(path)?;
    while let Some(frame) = reader.next_frame()? {
        if frame.skin.is_some() {
            return Ok(frame);
        }
    }
    Err(ExportError::NoSkin {
        path: path.to_owned(),
        frames: 0,
    })
}

/// Names and colours of surfaces.
type Surfaces = Vec<(String, [u8; 4])>;

/// The mesh of a frame: the skin's triangles and its parts', whose vertices it has too.
fn mesh_of(frame: &RecordedFrame, path: &Path) -> Result<(Mesh, Surfaces, Vec<u32>), ExportError> {
    let Some(skin) = &frame.skin else {
        return Err(ExportError::NoSkin {
            path: path.to_owned(),
            frames: 0,
        });
    };
    let mut surfaces = vec![(skin.info.name.clone(), skin.info.color)];
    let mut triangles = skin.info.triangles.clone();
    let mut of_polygon = vec![0u32; triangles.len()];
    // A part's vertices stand in the skin's list at the very same places.
    let key = |p: &crate::Point| p.coords.map(f64::to_bits);
    let mut vertex_at = std::collections::HashMap::new();
    for (v, p) in (0u32..).zip(&skin.positions) {
        vertex_at.entry((key(p).x, key(p).y, key(p).z)).or_insert(v);
    }
    for part in &frame.parts {
        let places: Option<Vec<u32>> = part
            .positions
            .iter()
            .map(|p| vertex_at.get(&(key(p).x, key(p).y, key(p).z)).copied())
            .collect();
        let Some(places) = places else { continue };
        let own = part.info.triangles.iter();
        triangles.extend(own.map(|t| t.map(|v| places[v as usize])));
        of_polygon.resize(triangles.len(), surfaces.len() as u32);
        surfaces.push((part.info.name.clone(), part.info.color));
    }
    let mesh = Mesh::new(skin.positions.clone(), Polygons::from_faces(&triangles))?;
    Ok((mesh, surfaces, of_polygon))
}

/// A frame rate without the rounding of nanoseconds.
fn nearest_rate(fps: f64) -> f64 {
    let whole = fps.round();
    if (fps / whole - 1.0).abs() < 1e-4 {
        whole
    } else {
        fps
    }
}

/// Frames of a recording that have a skin.
struct RecordedFrames {
    reader: RecordingReader,
    placement: Placement,
    /// Vertices at rest. [mm, head frame]
    rest: Vec<crate::Point>,
    first: f64,
    count: usize,
    fps: f64,
}

impl FrameSource for RecordedFrames {
    fn frame_count(&self) -> usize {
        self.count
    }

    fn fps(&self) -> f64 {
        self.fps
    }

    fn next_frame(&mut self) -> Result<Option<Frame>, ExportError> {
        while let Some(frame) = self.reader.next_frame()? {
            let Some(skin) = frame.skin else { continue };
            let pairs = skin.positions.iter().zip(&self.rest);
            return Ok(Some(Frame {
                time: frame.time_secs - self.first,
                offsets: pairs
                    .map(|(now, rest)| self.placement.offset(&(now - rest)))
                    .collect(),
                head: self.placement.motion(&frame.head),
            }));
        }
        Ok(None)
    }
}
