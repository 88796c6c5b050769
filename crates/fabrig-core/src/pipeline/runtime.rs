//! What a frame costs: faces simple and complex, with and without contact, skin and recording,
//! and the cloth alone from 2,000 to 200,000 nodes.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use super::{AnimateOptions, TimeStatistics, animate};
use crate::Error;
use crate::cloth::ClothOptions;
use crate::cloth::bench::{BenchScene, run};
use crate::collision::PairMask;
use crate::motion::{Clip, ReadOptions, parse};
use crate::recording::RecordingError;
use crate::rig::Rig;
use crate::scene::Scene;

/// Frames per second of the simulation.
const FPS: f64 = 60.0;

/// A take with one shape: the jaw opens and shuts.
const SIMPLE_TAKE: &str = "fabrig-keys 1\n0 jawOpen=0\n0.5 jawOpen=0.8\n1 jawOpen=0\n1.5 jawOpen=0.8\n\
                           2 jawOpen=0\n";

/// Nodes along a grid line against the default's, for about 2,000, 19,380, 50,000 and 200,000
/// nodes.
const SCALES: [f64; 4] = [0.32, 1.0, 1.606, 3.21];

/// Frames a second of the four rows of the paper's Table 1, in its order.
const PAPER_FPS: [f64; 4] = [37.3, 32.9, 35.3, 29.7];

const CONTACTS: [(&str, PairMask); 3] = [
    ("none", PairMask::None),
    ("sphincter", PairMask::Sphincter),
    ("all", PairMask::All),
];

/// One row of the grid of the paper's Table 1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FaceRow {
    /// `simple` or `complex`.
    pub take: &'static str,
    /// Which patches collide.
    pub contact: &'static str,
    /// Threads that took part.
    pub threads: usize,
    /// Nodes of all patches.
    pub nodes: usize,
    /// Vertices of the user's mesh.
    pub vertices: usize,
    /// Muscle shapes and cloth. (ms)
    pub simulation: TimeStatistics,
    /// And the skin. (ms)
    pub with_skin: TimeStatistics,
    /// And what recording takes of the simulating thread. (ms)
    pub with_recording: TimeStatistics,
    /// Median time with skin, against that without contact.
    pub against_none: f64,
    /// Frames a second that the median time with skin is.
    pub fps: f64,
    /// Median pairs of a frame that may touch.
    pub candidates: usize,
    /// Median pairs of a frame that do.
    pub contacts: usize,
}

/// The cloth alone at one size.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SizeRow {
    /// Nodes of all patches.
    pub nodes: usize,
    /// Whether patches are attached to each other. Then all of them are at the same substep, and
    /// the state of all goes through the caches in each; otherwise some of them go through all
    /// substeps of a frame at once.
    pub is_attached: bool,
    /// Threads that took part.
    pub threads: usize,
    /// Time of a frame. (ms)
    pub frame: TimeStatistics,
    /// The quickest frame, which other work on the machine has disturbed least. (ms)
    pub least_ms: f64,
    /// Of the quickest frame.
    pub microseconds_per_node: f64,
}

/// How the cost of the cloth grows with its size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Growth {
    /// As in the rows that it is of.
    pub is_attached: bool,
    /// Threads that took part.
    pub threads: usize,
    /// Largest over least time per node.
    pub ratio: f64,
}

/// What frames cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RuntimeReport {
    /// Whether everything was measured, rather than stopped.
    pub is_complete: bool,
    /// The processor's name and its count of cores that may be used.
    pub processor: String,
    /// Frames a second of the paper's four rows.
    pub paper_fps: [f64; 4],
    /// Faces on takes.
    pub faces: Vec<FaceRow>,
    /// The cloth alone.
    pub sizes: Vec<SizeRow>,
    /// Of the cloth alone, over its sizes.
    pub growth: Vec<Growth>,
}

/// How far a measurement has come.
#[derive(Debug, Clone, PartialEq)]
pub struct RuntimeProgress {
    /// What is measured now.
    pub what: String,
    /// Frames of it that are done.
    pub frame: u64,
    /// Frames of it.
    pub frame_count: u64,
}

/// Measures what a frame of `rig` costs, on a simple take and on `complex`, and what the cloth
/// alone costs, on one thread and on two.
///
/// - `frames`: frames of each measurement of the cloth alone; faces go through their takes
/// - `progress`: `ControlFlow::Break` stops with what there is
///
/// # Errors
///
/// [`Error::Scene`] and [`Error::Recording`]: recordings are written to a folder that is thrown
/// away.
pub fn runtime(
    rig: &Arc<Rig>,
    complex: &Clip,
    frames: usize,
    progress: &mut (dyn FnMut(RuntimeProgress) -> ControlFlow<()> + Send),
) -> Result<RuntimeReport, Error> {
    let simple = parse(SIMPLE_TAKE, "the jaw", &ReadOptions::default())?;
    let takes = [("simple", &simple), ("complex", complex)];
    let mut report = RuntimeReport {
        is_complete: false,
        processor: processor(),
        paper_fps: PAPER_FPS,
        faces: Vec::new(),
        sizes: Vec::new(),
        growth: Vec::new(),
    };
    let io = |source| RecordingError::Io {
        action: "create",
        path: std::env::temp_dir(),
        source,
    };
    let folder = tempfile::tempdir().map_err(io)?;
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| io(std::io::Error::other(e)))?;
        for (name, clip) in takes {
            let mut none = None;
            for contact in CONTACTS {
                let mut is_stopped = false;
                let mut row = pool.install(|| {
                    face(
                        folder.path(),
                        rig,
                        (name, clip),
                        contact,
                        threads,
                        &mut |at| {
                            let flow = progress(at);
                            is_stopped = flow.is_break();
                            flow
                        },
                    )
                })?;
                if is_stopped {
                    return Ok(report);
                }
                row.against_none = row.with_skin.median / *none.get_or_insert(row.with_skin.median);
                report.faces.push(row);
            }
        }
        for is_attached in [true, false] {
            let mut cheapest_and_dearest = (f64::INFINITY, 0.0_f64);
            for scale in SCALES {
                let scene = BenchScene::sized(scale, is_attached, frames);
                let nodes = scene.node_count();
                let now = RuntimeProgress {
                    what: format!("{nodes} nodes, {threads} threads"),
                    frame: 0,
                    frame_count: frames as u64,
                };
                if progress(now).is_break() {
                    return Ok(report);
                }
                let result =
                    pool.install(|| run(&scene, &ClothOptions::default(), scene.frames.len(), 0))?;
                let least_ms = result.quantile_ms(0.0);
                let microseconds_per_node = least_ms * 1e3 / nodes as f64;
                let (cheapest, dearest) = &mut cheapest_and_dearest;
                *cheapest = cheapest.min(microseconds_per_node);
                *dearest = dearest.max(microseconds_per_node);
                report.sizes.push(SizeRow {
                    nodes,
                    is_attached,
                    threads,
                    microseconds_per_node,
                    frame: TimeStatistics::of(result.frame_ms),
                    least_ms,
                });
            }
            let (cheapest, dearest) = cheapest_and_dearest;
            report.growth.push(Growth {
                is_attached,
                threads,
                ratio: dearest / cheapest,
            });
        }
    }
    report.is_complete = true;
    Ok(report)
}

/// Simulates and records a take, into a file that is thrown away.
fn face(
    folder: &Path,
    rig: &Arc<Rig>,
    (take, clip): (&'static str, &Clip),
    (contact, pairs): (&'static str, PairMask),
    threads: usize,
    progress: &mut (dyn FnMut(RuntimeProgress) -> ControlFlow<()> + Send),
) -> Result<FaceRow, Error> {
    let (mut simulation, mut with_skin) = (Vec::new(), Vec::new());
    let options = AnimateOptions {
        fps: Some(FPS),
        ..AnimateOptions::default()
    };
    // What the solver costs, not what a take is spared.
    let mut scene = Scene::default().without_economy();
    scene.contact.pairs = pairs;
    let result = animate(
        Arc::clone(rig),
        clip.clone(),
        scene,
        &folder.join("bench.mcap"),
        &options,
        &mut |at| {
            let cloth = at.last.targets_ms + at.last.cloth_ms;
            simulation.push(cloth);
            with_skin.push(cloth + at.last.skin_ms);
            progress(RuntimeProgress {
                what: format!("{take}, contact {contact}, {threads} threads"),
                frame: at.frame,
                frame_count: at.frame_count,
            })
        },
    )?;
    let skin = TimeStatistics::of(with_skin);
    let recording = &result.recording_ms;
    Ok(FaceRow {
        take,
        contact,
        against_none: 1.0,
        fps: 1e3 / skin.median,
        candidates: result.contact.as_ref().map_or(0, |c| c.candidates_median),
        contacts: result.contact.as_ref().map_or(0, |c| c.contacts_median),
        threads,
        nodes: result.node_count,
        vertices: result.vertex_count,
        simulation: TimeStatistics::of(simulation),
        with_recording: TimeStatistics {
            median: skin.median + recording.median,
            p95: skin.p95 + recording.p95,
            p99: skin.p99 + recording.p99,
            max: skin.max + recording.max,
            total: skin.total + recording.total,
        },
        with_skin: skin,
    })
}

/// The processor's name and its count of cores that may be used.
fn processor() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let name = std::fs::read_to_string("/proc/cpuinfo")
        .ok()
        .and_then(|text| {
            text.lines()
                .find_map(|line| line.strip_prefix("model name"))
                .map(|rest| rest.trim_start_matches([' ', '\t', ':']).to_owned())
        })
        .unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    format!("{name}, {cores} cores")
}
