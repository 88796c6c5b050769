//! Simulated skin for learning: an archive a pair, and one a face with what all its pairs share.
//!
//! Lengths are millimetres at true head size in the head frame (+Y up, +Z out of the face, the
//! character's left is +X); head motion is apart, so that faces of all takes lie on each other.
//! The schema is in `docs/batch.md`; [`SCHEMA`] names it in every file.

use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::record::OnFraction;
use crate::atomic_file::write_atomically;
use crate::cloth::Counters;
use crate::export::{Elements, NpzWriter};
use crate::motion::Clip;
use crate::pipeline::{frame_count, recording_rate};
use crate::rig::Rig;
use crate::scene::{Scene, SceneError, Simulation};

/// Name and version of the schema.
pub const SCHEMA: &str = "fabrig-dataset 1";

/// What a pair of a dataset holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PairReport {
    /// Frames.
    pub frames: usize,
    /// Frames a second. (1/s)
    pub fps: f64,
    /// From the first frame to the last. (s)
    pub seconds: f64,
    /// Vertices of the skin.
    pub vertices: usize,
    /// Largest root mean square distance of a frame's nodes from their muscle shapes. (mm)
    pub settle_rms_max: f64,
    /// Guards of the solver that acted.
    pub guards: Counters,
}

/// Whom a pair is of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Names<'a> {
    pub(super) face: &'a str,
    pub(super) take: &'a str,
    pub(super) scene: &'a str,
}

/// Why there is no pair.
pub(super) enum PairError {
    Io(io::Error),
    Scene(SceneError),
    Stopped,
}

impl From<io::Error> for PairError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<SceneError> for PairError {
    fn from(error: SceneError) -> Self {
        Self::Scene(error)
    }
}

fn words(npz: &mut NpzWriter<impl io::Write>, list: &[(&str, &str)]) -> io::Result<()> {
    for (name, text) in list {
        npz.array(name, &[], Elements::Text(&[(*text).to_owned()]))?;
    }
    Ok(())
}

/// Simulates a take and writes its skin frame by frame; the same frames as a recording has.
pub(super) fn write_pair(
    path: &Path,
    rig: Arc<Rig>,
    clip: Clip,
    scene: Scene,
    names: Names<'_>,
    progress: OnFraction<'_>,
) -> Result<PairReport, PairError> {
    let fps = scene.fps.unwrap_or_else(|| recording_rate(&clip));
    let frame_count = frame_count(clip.duration(), fps) as usize;
    let vertex_count = rig.face.vertex_count();
    let mut report = PairReport {
        frames: frame_count,
        fps,
        seconds: (frame_count - 1) as f64 / fps,
        vertices: vertex_count,
        settle_rms_max: 0.0,
        guards: Counters::default(),
    };
    let substeps = scene.cloth.substeps;
    let mut simulation = Simulation::new(Arc::clone(&rig), scene, Some(clip))?;
    write_atomically(path, |out| -> Result<(), PairError> {
        let mut npz = NpzWriter::new(out);
        words(
            &mut npz,
            &[
                ("schema", SCHEMA),
                ("face", names.face),
                ("take", names.take),
                ("scene", names.scene),
                ("unit", "mm"),
            ],
        )?;
        npz.array("fps", &[], Elements::F64(&[fps]))?;
        npz.array("substeps", &[], Elements::U32(&[substeps]))?;
        let shape_names = &rig.shape_names;
        npz.array(
            "shape_names",
            &[shape_names.len()],
            Elements::Text(shape_names),
        )?;
        npz.begin_floats("positions", &[frame_count, vertex_count, 3])?;
        let (mut times, mut weights, mut heads) = (Vec::new(), Vec::new(), Vec::new());
        let mut flat = Vec::with_capacity(3 * vertex_count);
        for frame in 0..frame_count {
            if frame > 0 {
                let step = simulation.advance(1.0 / fps)?;
                report.guards += step.step.counters;
                report.settle_rms_max = report.settle_rms_max.max(step.settle_rms);
            }
            flat.clear();
            flat.extend(simulation.skin().iter().flat_map(|p| [p.x, p.y, p.z]));
            npz.values(&flat)?;
            times.push(frame as f64 / fps);
            weights.extend_from_slice(&simulation.pose().weights);
            let head = simulation.head().to_homogeneous().transpose();
            heads.extend_from_slice(head.as_slice());
            if progress((frame + 1) as f64 / frame_count as f64) == ControlFlow::Break(()) {
                return Err(PairError::Stopped);
            }
        }
        npz.array("times", &[frame_count], Elements::F64(&times))?;
        npz.array(
            "weights",
            &[frame_count, shape_names.len()],
            Elements::F32(&weights),
        )?;
        npz.array("heads", &[frame_count, 4, 4], Elements::F64(&heads))?;
        Ok(npz.finish()?)
    })?;
    Ok(report)
}

/// What has no region or part.
const NONE: u32 = u32::MAX;

/// Writes what all pairs of a face share: rest, polygons, texture coordinates, regions, parts.
pub(super) fn write_topology(path: &Path, rig: &Rig, face: &str) -> io::Result<()> {
    write_atomically(path, |out| -> io::Result<()> {
        let mut npz = NpzWriter::new(out);
        words(
            &mut npz,
            &[
                ("schema", SCHEMA),
                ("face", face),
                ("template", &rig.template),
                ("unit", "mm"),
            ],
        )?;
        let rest: Vec<f32> = rig
            .skin_at_rest()
            .iter()
            .flat_map(|p| [p.x, p.y, p.z])
            .collect();
        let vertex_count = rig.face.vertex_count();
        npz.array("rest", &[vertex_count, 3], Elements::F32(&rest))?;
        let polygons = rig.face.polygons();
        let counts: Vec<u32> = polygons.iter().map(|p| p.len() as u32).collect();
        npz.array(
            "face_vertex_counts",
            &[counts.len()],
            Elements::U32(&counts),
        )?;
        let corners = polygons.corners();
        npz.array(
            "face_vertex_indices",
            &[corners.len()],
            Elements::U32(corners),
        )?;
        let triangles: Vec<u32> = rig.face.triangles().into_iter().flatten().collect();
        let triangle_count = triangles.len() / 3;
        npz.array("triangles", &[triangle_count, 3], Elements::U32(&triangles))?;
        if let Some(uvs) = rig.face.uvs() {
            let flat: Vec<f32> = uvs.coordinates.iter().flatten().copied().collect();
            npz.array("uvs", &[uvs.coordinates.len(), 2], Elements::F32(&flat))?;
            let corners = &uvs.corners;
            npz.array("uv_indices", &[corners.len()], Elements::U32(corners))?;
        }
        npz.array(
            "region_names",
            &[rig.region_names.len()],
            Elements::Text(&rig.region_names),
        )?;
        let region = |region: &Option<_>| region.map_or(NONE, id);
        let regions: Vec<u32> = rig.regions.iter().map(region).collect();
        npz.array("regions", &[regions.len()], Elements::U32(&regions))?;
        let names: Vec<String> = rig.parts.iter().map(|part| part.name.clone()).collect();
        npz.array("part_names", &[names.len()], Elements::Text(&names))?;
        let mut parts = vec![NONE; vertex_count];
        for (index, part) in (0u32..).zip(&rig.parts) {
            for &vertex in &part.vertices {
                parts[vertex as usize] = index;
            }
        }
        npz.array("parts", &[vertex_count], Elements::U32(&parts))?;
        let to_head = rig.to_head.to_homogeneous().transpose();
        npz.array("to_head", &[4, 4], Elements::F64(to_head.as_slice()))?;
        npz.finish()
    })
}

fn id(region: crate::template::RegionId) -> u32 {
    u32::from(region.0)
}
