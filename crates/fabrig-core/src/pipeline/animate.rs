//! From a rig and a take to a recording.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Point3;
use serde::Serialize;

use super::TimeStatistics;
use super::contact::{ContactLog, ContactSummary, collider_surfaces, stat_names};
use super::strain::fibre_strain;
use crate::Error;
use crate::Vector;
use crate::cloth::Counters;
use crate::motion::{Clip, ClipNotes};
use crate::recording::{
    ContactFrame, Frame, LogEvent, LogLevel, McapRecorder, RecordingInfo, RecordingOptions,
    RecordingReport, SurfaceInfo, foxglove_layout,
};
use crate::rig::Rig;
use crate::scene::{FrameReport, Scene, Simulation};

/// How a take is recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct AnimateOptions {
    /// Frames a second of the simulation; [`recording_rate`] of the take when `None`. (1/s)
    pub fps: Option<f64>,
    /// Name of the rig in the recording.
    pub rig_name: String,
    /// Name of the take in the recording.
    pub take_name: String,
    /// What is written how often.
    pub recording: RecordingOptions,
}

impl Default for AnimateOptions {
    fn default() -> Self {
        Self {
            fps: None,
            rig_name: "face".to_owned(),
            take_name: "take".to_owned(),
            recording: RecordingOptions::default(),
        }
    }
}

/// How far an animation has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnimateProgress {
    /// Frames recorded.
    pub frame: u64,
    /// Frames there will be.
    pub frame_count: u64,
    /// What the last frame took and did.
    pub last: FrameReport,
}

/// What an animation took and did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnimateReport {
    /// Whether the take was recorded to its end, rather than stopped.
    pub is_complete: bool,
    /// Frames recorded.
    pub frames: u64,
    /// Frames a second of the simulation. (1/s)
    pub fps: f64,
    /// Vertices of the user's mesh.
    pub vertex_count: usize,
    /// Nodes of all patches.
    pub node_count: usize,
    /// Muscle shapes, cloth and skin of a frame. (ms)
    pub simulation_ms: TimeStatistics,
    /// The cloth of a frame. (ms)
    pub cloth_ms: TimeStatistics,
    /// Writing a frame. (ms)
    pub recording_ms: TimeStatistics,
    /// Everything, by the clock on the wall. (s)
    pub wall_secs: f64,
    /// Guards of the solver that acted.
    pub guards: Counters,
    /// Largest root mean square distance of a frame's nodes from their muscle shapes. (mm)
    pub settle_rms_max: f64,
    /// What contact did; none where nothing could touch.
    pub contact: Option<ContactSummary>,
    /// What reading the take had to decide.
    pub take: ClipNotes,
    /// What the recording holds.
    pub recording: RecordingReport,
    /// Layout for Foxglove and Lichtblick, as the recording has it attached.
    #[serde(skip)]
    pub foxglove_layout: String,
}

/// Frame rates that a take's own rate is taken for when it is this near: timecodes are rounded.
const STANDARD_RATES: [f64; 7] = [24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 120.0];
const RATE_TOLERANCE: f64 = 0.005;
const DEFAULT_RATE: f64 = 60.0;
/// Weights that a recording's plots show at first.
const PLOTTED_WEIGHTS: usize = 12;

/// The rate at which a take is simulated unless another is asked for: its own.
pub fn recording_rate(clip: &Clip) -> f64 {
    let Some(own) = clip.frame_rate() else {
        return DEFAULT_RATE;
    };
    let near = |rate: &f64| (own / rate - 1.0).abs() <= RATE_TOLERANCE;
    STANDARD_RATES.into_iter().find(near).unwrap_or(own)
}

/// Simulates `rig` through `clip` in `scene` and records it to `output`.
///
/// - `progress`: called after each frame; `ControlFlow::Break` ends the recording there, whole
///   and readable, with `is_complete` false in the report
///
/// # Errors
///
/// [`Error::Scene`] and [`Error::Recording`]; then nothing is left at `output` that was not
/// there before.
pub fn animate(
    rig: Arc<Rig>,
    clip: Clip,
    scene: Scene,
    output: &Path,
    options: &AnimateOptions,
    progress: &mut dyn FnMut(AnimateProgress) -> ControlFlow<()>,
) -> Result<AnimateReport, Error> {
    let wall = Instant::now();
    let fps = options.fps.unwrap_or_else(|| recording_rate(&clip));
    let surfaces = Surfaces::new(&rig);
    let mut info = recording_info(&rig, &surfaces, fps, scene.cloth.seed, options);
    if scene.has_contact() {
        info.colliders = Some(collider_surfaces(&scene)?);
        info.stat_names.extend(stat_names(&scene));
    }
    info.plotted_weights = most_moved(&clip, &info.weight_names);
    let foxglove_layout = foxglove_layout(&info, &options.recording);
    // Opened first: it refuses a bad frame rate or folder before anything is computed.
    let mut recorder = McapRecorder::create(output, info, options.recording)?;
    let take = clip.notes().clone();
    let frame_count = (clip.duration() * fps + 1e-6).floor() as u64 + 1;
    let vertex_count = rig.face.vertex_count();
    let node_count = rig.patches.iter().map(|p| p.patch.neutral.len()).sum();
    let run = Simulation::new(rig, scene, Some(clip))
        .map_err(Error::from)
        .and_then(|simulation| {
            let mut run = Run::new(simulation, &surfaces, fps, frame_count);
            run.has_strain = options.recording.strain_hz > 0.0;
            run.record_all(&mut recorder, progress)
        });
    let measures = match run {
        Ok(measures) => measures,
        Err(error) => {
            recorder.discard();
            return Err(error);
        }
    };
    let recording = recorder.finish()?;
    Ok(AnimateReport {
        is_complete: recording.frames == frame_count,
        frames: recording.frames,
        fps,
        vertex_count,
        node_count,
        simulation_ms: TimeStatistics::of(measures.simulation_ms),
        cloth_ms: TimeStatistics::of(measures.cloth_ms),
        recording_ms: TimeStatistics::of(measures.recording_ms),
        wall_secs: wall.elapsed().as_secs_f64(),
        guards: measures.guards,
        settle_rms_max: measures.settle_rms_max,
        contact: measures.contact,
        take,
        recording,
        foxglove_layout,
    })
}

/// What is measured on the way.
#[derive(Default)]
struct Measures {
    simulation_ms: Vec<f64>,
    cloth_ms: Vec<f64>,
    recording_ms: Vec<f64>,
    guards: Counters,
    settle_rms_max: f64,
    contact: Option<ContactSummary>,
}

/// A simulation on its way into a recording.
struct Run<'a> {
    simulation: Simulation,
    surfaces: &'a Surfaces,
    fps: f64,
    frame_count: u64,
    measures: Measures,
    /// Vertices of each part, gathered anew every frame.
    parts: Vec<Vec<Point3<f32>>>,
    /// Whether the stretch of the patches is recorded.
    has_strain: bool,
    contact: Option<ContactLog>,
}

impl<'a> Run<'a> {
    fn new(simulation: Simulation, surfaces: &'a Surfaces, fps: f64, frame_count: u64) -> Self {
        Self {
            contact: ContactLog::new(&simulation),
            simulation,
            surfaces,
            fps,
            frame_count,
            measures: Measures::default(),
            parts: vec![Vec::new(); surfaces.part_vertices.len()],
            has_strain: false,
        }
    }

    fn record_all(
        mut self,
        recorder: &mut McapRecorder,
        progress: &mut dyn FnMut(AnimateProgress) -> ControlFlow<()>,
    ) -> Result<Measures, Error> {
        self.record(recorder, &FrameReport::default())?;
        for frame in 1..self.frame_count {
            let clock = Instant::now();
            let report = self.simulation.advance(1.0 / self.fps)?;
            self.measures.simulation_ms.push(milliseconds(clock));
            self.measures.cloth_ms.push(report.cloth_ms);
            self.measures.guards += report.step.counters;
            self.measures.settle_rms_max = self.measures.settle_rms_max.max(report.settle_rms);
            self.record(recorder, &report)?;
            let now = AnimateProgress {
                frame: frame + 1,
                frame_count: self.frame_count,
                last: report,
            };
            if progress(now).is_break() {
                break;
            }
        }
        self.measures.contact = self.contact.map(ContactLog::finish);
        Ok(self.measures)
    }

    fn record(&mut self, recorder: &mut McapRecorder, report: &FrameReport) -> Result<(), Error> {
        let clock = Instant::now();
        let simulation = &self.simulation;
        let skin = simulation.skin();
        for (positions, vertices) in self.parts.iter_mut().zip(&self.surfaces.part_vertices) {
            positions.clear();
            positions.extend(vertices.iter().map(|&v| skin[v as usize]));
        }
        let parts: Vec<&[Point3<f32>]> = self.parts.iter().map(Vec::as_slice).collect();
        let patches: Vec<&[Point3<f32>]> = (0..self.surfaces.patches.len())
            .map(|patch| simulation.patch_positions(patch))
            .collect();
        let mut strains = Vec::new();
        if self.has_strain {
            let rig = simulation.rig().patches.iter().zip(&patches);
            strains.extend(rig.map(|(patch, nodes)| fibre_strain(&patch.patch, nodes)));
        }
        let strains: Vec<&[f32]> = strains.iter().map(Vec::as_slice).collect();
        let mut stats = stats(report).to_vec();
        let mut events: Vec<LogEvent> = guard_event(&report.step.counters).into_iter().collect();
        if let Some(contact) = &mut self.contact {
            stats.extend(contact.take(simulation, report));
            events.extend(contact.event());
        }
        let placed: Vec<&[Point3<f32>]> = match &self.contact {
            Some(contact) => contact.placed.iter().map(Vec::as_slice).collect(),
            None => Vec::new(),
        };
        recorder.record(&Frame {
            contact: self.contact.as_ref().map(|contact| ContactFrame {
                colliders: &placed,
                arrows: &contact.arrows,
            }),
            strains: &strains,
            skin,
            patches: &patches,
            parts: &parts,
            head: *simulation.head(),
            weights: &simulation.pose().weights,
            stats: &stats,
            events: &events,
        })?;
        self.measures.recording_ms.push(milliseconds(clock));
        Ok(())
    }
}

/// Names of [`stats`]. Times are left out: equal inputs give equal recordings.
const STAT_NAMES: [&str; 9] = [
    "settle_rms_mm",
    "settle_max_mm",
    "kinetic_energy",
    "magnet_energy",
    "stretch_energy",
    "bend_energy",
    "pressure_energy",
    "total_energy",
    "guards",
];

fn stats(report: &FrameReport) -> [f64; STAT_NAMES.len()] {
    let energies = &report.step.energies;
    [
        report.settle_rms,
        report.settle_max,
        energies.kinetic,
        energies.magnet,
        energies.stretch + energies.compression + energies.shear,
        energies.bend,
        energies.pressure,
        energies.total(),
        report.step.counters.total() as f64,
    ]
}

fn guard_event(counters: &Counters) -> Option<LogEvent> {
    (counters.total() > 0).then(|| LogEvent {
        level: LogLevel::Warning,
        message: format!(
            "guards acted: {} displacements clamped, {} patches on backward Euler, {} put back",
            counters.clamped_displacements, counters.euler_fallbacks, counters.frozen_patches
        ),
    })
}

/// What of the rig is drawn: the skin, its loose parts, the patches.
struct Surfaces {
    skin: SurfaceInfo,
    patches: Vec<SurfaceInfo>,
    parts: Vec<SurfaceInfo>,
    /// Vertices of the user's mesh that each part has.
    part_vertices: Vec<Vec<u32>>,
}

const SKIN_COLOR: [u8; 4] = [224, 172, 147, 255];
const PATCH_OPACITY: u8 = 255;

impl Surfaces {
    fn new(rig: &Rig) -> Self {
        let vertex_count = rig.face.vertex_count();
        // Which part each vertex belongs to, and where in it.
        let mut owner = vec![None; vertex_count];
        for (part, piece) in rig.parts.iter().enumerate() {
            for (k, &vertex) in piece.vertices.iter().enumerate() {
                owner[vertex as usize] = Some((part, k as u32));
            }
        }
        let mut skin_triangles = Vec::new();
        let mut part_triangles = vec![Vec::new(); rig.parts.len()];
        for triangle in rig.face.triangles() {
            match triangle.map(|v| owner[v as usize]) {
                [Some((part, a)), Some((_, b)), Some((_, c))] => {
                    part_triangles[part].push([a, b, c]);
                }
                _ => skin_triangles.push(triangle),
            }
        }
        let parts = rig.parts.iter().zip(part_triangles);
        let rest = rig.skin_at_rest();
        Self {
            skin: SurfaceInfo {
                name: "skin".to_owned(),
                color: SKIN_COLOR,
                vertex_count,
                triangles: skin_triangles,
                vertex_colors: Vec::new(),
            },
            patches: rig
                .patches
                .iter()
                .map(|p| {
                    let chart = &p.patch.chart;
                    let [r, g, b] = chart.color;
                    let quads = chart.quads();
                    SurfaceInfo {
                        name: chart.name.clone(),
                        color: [r, g, b, PATCH_OPACITY],
                        vertex_count: chart.grid.node_count(),
                        triangles: quads
                            .iter()
                            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
                            .collect(),
                        vertex_colors: Vec::new(),
                    }
                })
                .collect(),
            parts: parts
                .map(|(part, triangles)| SurfaceInfo {
                    name: part.name.clone(),
                    color: part_color(&part.name),
                    vertex_count: part.vertices.len(),
                    triangles,
                    vertex_colors: if part.name.starts_with("eye") {
                        eye_colors(rig, &rest, &part.vertices)
                    } else {
                        Vec::new()
                    },
                })
                .collect(),
            part_vertices: rig.parts.iter().map(|p| p.vertices.clone()).collect(),
        }
    }
}

fn part_color(name: &str) -> [u8; 4] {
    if name.contains("eye") {
        [240, 238, 232, 255]
    } else if name.contains("teeth") {
        [236, 228, 210, 255]
    } else if name.contains("tongue") {
        [190, 96, 92, 255]
    } else {
        [150, 140, 132, 255]
    }
}

/// White, iris and pupil of an eyeball that looks straight ahead at rest. The iris of an adult
/// spans about 29 degrees to each side of the line of sight, the pupil about 10.
fn eye_colors(rig: &Rig, rest: &[Point3<f32>], vertices: &[u32]) -> Vec<[u8; 4]> {
    let rest = |v: &u32| rest[*v as usize].cast::<f64>();
    let mean = vertices.iter().map(|v| rest(v).coords).sum::<Vector>() / vertices.len() as f64;
    let [a, b] = rig.eyes.each_ref().map(|eye| eye.center);
    let is_first = (a.coords - mean).norm() < (b.coords - mean).norm();
    let center = if is_first { a } else { b };
    let color = |v: &u32| {
        let angle = (rest(v) - center).angle(&Vector::z()).to_degrees();
        match angle {
            ..10.0 => [14, 14, 16, 255],
            ..29.0 => [86, 116, 128, 255],
            _ => part_color("eye"),
        }
    };
    vertices.iter().map(color).collect()
}

fn recording_info(
    rig: &Rig,
    surfaces: &Surfaces,
    fps: f64,
    seed: u64,
    options: &AnimateOptions,
) -> RecordingInfo {
    RecordingInfo {
        rig: options.rig_name.clone(),
        template: rig.template.clone(),
        fps,
        seed,
        skin: surfaces.skin.clone(),
        patches: surfaces.patches.clone(),
        parts: surfaces.parts.clone(),
        colliders: None,
        weight_names: rig.shape_names.clone(),
        plotted_weights: Vec::new(),
        stat_names: STAT_NAMES.map(str::to_owned).to_vec(),
        extra: vec![("take".to_owned(), options.take_name.clone())],
    }
}

/// The weights that a take moves most, in the order of `names`.
fn most_moved(clip: &Clip, names: &[String]) -> Vec<String> {
    let channel_count = clip.channels().len();
    let span = |channel: usize| {
        let values = clip.weights().iter().skip(channel).step_by(channel_count);
        let (low, high) = values.fold((1.0f32, 0.0f32), |(low, high), &w| {
            (low.min(w), high.max(w))
        });
        high - low
    };
    let listed: Vec<&str> = names.iter().map(String::as_str).collect();
    let channels = clip.channel_indices(&listed);
    let mut moved: Vec<(usize, f32)> = channels
        .iter()
        .enumerate()
        .filter_map(|(name, &channel)| Some((name, span(channel?))))
        .filter(|&(_, span)| span > 0.0)
        .collect();
    moved.sort_by(|a, b| b.1.total_cmp(&a.1));
    moved.truncate(PLOTTED_WEIGHTS);
    moved.sort_unstable_by_key(|&(name, _)| name);
    moved.iter().map(|&(name, _)| names[name].clone()).collect()
}

fn milliseconds(clock: Instant) -> f64 {
    clock.elapsed().as_secs_f64() * 1e3
}
