//! From a rig and a take to a recording.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::TimeStatistics;
use super::contact::ContactSummary;
use super::economy::{EconomyLog, EconomySummary};
use super::frames::FrameMaker;
use crate::Error;
use crate::cloth::Counters;
use crate::motion::{Clip, ClipNotes};
use crate::recording::{
    McapRecorder, RecordingInfo, RecordingOptions, RecordingReport, foxglove_layout,
};
use crate::rig::Rig;
use crate::scene::{FrameReport, Scene, Simulation};

/// How a take is recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct AnimateOptions {
    /// Frames a second of the simulation; the scene's, or else [`recording_rate`] of the take,
    /// when `None`. (1/s)
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
    /// What was left out, and by how much the result may be off for it.
    pub economy: EconomySummary,
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
/// Frames a second of what has no rate of its own. (1/s)
pub(super) const DEFAULT_RATE: f64 = 60.0;

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
    let fps = options.fps.or(scene.fps);
    let fps = fps.unwrap_or_else(|| recording_rate(&clip));
    let maker = FrameMaker::new(&rig, options.recording);
    let info = maker.info(&rig, Some(&clip), &scene, fps, options)?;
    let take = clip.notes().clone();
    let duration = scene.duration.unwrap_or_else(|| clip.duration());
    let cast = Cast {
        infos: vec![info],
        takes: vec![take],
        fps,
        duration,
    };
    let start = || {
        let simulation = Simulation::new(rig, scene, Some(clip))?;
        Ok(vec![Run::new(simulation, maker)])
    };
    let mut reports = record_cast(cast, start, output, &options.recording, progress)?;
    // As many reports as there were faces.
    Ok(reports.swap_remove(0))
}

/// Frames of a stretch of time, its first and last among them.
///
/// - `duration` (s), `fps` (1/s)
pub fn frame_count(duration: f64, fps: f64) -> u64 {
    (duration * fps + 1e-6).floor() as u64 + 1
}

/// Faces that are recorded together.
pub(super) struct Cast {
    /// What the recording says of each.
    pub(super) infos: Vec<RecordingInfo>,
    /// What reading the take of each had to decide.
    pub(super) takes: Vec<ClipNotes>,
    /// (1/s)
    pub(super) fps: f64,
    /// (s)
    pub(super) duration: f64,
}

/// Simulates faces side by side and records them to `output`. Returns a report of each.
///
/// - `start`: puts the faces into their scenes, once the recording is open
///
/// # Errors
///
/// As [`animate`].
pub(super) fn record_cast(
    cast: Cast,
    start: impl FnOnce() -> Result<Vec<Run>, Error>,
    output: &Path,
    options: &RecordingOptions,
    progress: &mut dyn FnMut(AnimateProgress) -> ControlFlow<()>,
) -> Result<Vec<AnimateReport>, Error> {
    let wall = Instant::now();
    let Cast {
        infos,
        takes,
        fps,
        duration,
    } = cast;
    let frame_count = frame_count(duration, fps);
    let foxglove_layout = foxglove_layout(&infos.iter().collect::<Vec<_>>(), options);
    // Opened first: it refuses a bad frame rate or folder before anything is computed.
    let mut recorder = McapRecorder::create_with(output, infos, *options)?;
    let recorded = start().and_then(|mut runs| {
        record_all(&mut runs, &mut recorder, fps, frame_count, progress)?;
        Ok(runs)
    });
    let runs = match recorded {
        Ok(runs) => runs,
        Err(error) => {
            recorder.discard();
            return Err(error);
        }
    };
    let whole = Whole {
        fps,
        frame_count,
        recording: recorder.finish()?,
        wall_secs: wall.elapsed().as_secs_f64(),
        foxglove_layout,
    };
    let reports = runs.into_iter().zip(takes);
    Ok(reports
        .map(|(run, take)| run.report(take, &whole))
        .collect())
}

/// What faces that were recorded together share.
struct Whole {
    fps: f64,
    frame_count: u64,
    wall_secs: f64,
    recording: RecordingReport,
    foxglove_layout: String,
}

/// Steps faces side by side and records every frame of each.
fn record_all(
    runs: &mut [Run],
    recorder: &mut McapRecorder,
    fps: f64,
    frame_count: u64,
    progress: &mut dyn FnMut(AnimateProgress) -> ControlFlow<()>,
) -> Result<(), Error> {
    for (face, run) in runs.iter_mut().enumerate() {
        run.maker.watch(&run.simulation);
        run.record(recorder, face, &FrameReport::default())?;
    }
    for frame in 1..frame_count {
        let mut last = FrameReport::default();
        for (face, run) in runs.iter_mut().enumerate() {
            last = run.advance(1.0 / fps)?;
            run.record(recorder, face, &last)?;
        }
        let now = AnimateProgress {
            frame: frame + 1,
            frame_count,
            last,
        };
        if progress(now).is_break() {
            break;
        }
    }
    Ok(())
}

/// What is measured on the way.
#[derive(Default)]
struct Measures {
    simulation_ms: Vec<f64>,
    cloth_ms: Vec<f64>,
    recording_ms: Vec<f64>,
    guards: Counters,
    settle_rms_max: f64,
    economy: EconomyLog,
}

/// A simulation on its way into a recording.
pub(super) struct Run {
    simulation: Simulation,
    maker: FrameMaker,
    measures: Measures,
}

impl Run {
    pub(super) fn new(simulation: Simulation, maker: FrameMaker) -> Self {
        Self {
            simulation,
            maker,
            measures: Measures::default(),
        }
    }

    fn advance(&mut self, dt: f64) -> Result<FrameReport, Error> {
        let clock = Instant::now();
        let report = self.simulation.advance(dt)?;
        let ms = milliseconds(clock);
        self.measures.simulation_ms.push(ms);
        self.measures.economy.take(&report, ms);
        self.measures.cloth_ms.push(report.cloth_ms);
        self.measures.guards += report.step.counters;
        self.measures.settle_rms_max = self.measures.settle_rms_max.max(report.settle_rms);
        Ok(report)
    }

    fn record(
        &mut self,
        recorder: &mut McapRecorder,
        face: usize,
        report: &FrameReport,
    ) -> Result<(), Error> {
        let clock = Instant::now();
        self.maker.give(&self.simulation, report, |frame| {
            recorder.record_face(face, frame)
        })?;
        self.measures.recording_ms.push(milliseconds(clock));
        Ok(())
    }

    /// - `take`: what reading the take had to decide
    fn report(mut self, take: ClipNotes, whole: &Whole) -> AnimateReport {
        let rig = self.simulation.rig();
        let measures = self.measures;
        AnimateReport {
            is_complete: whole.recording.frames == whole.frame_count,
            frames: whole.recording.frames,
            fps: whole.fps,
            vertex_count: rig.face.vertex_count(),
            node_count: rig.patches.iter().map(|p| p.patch.neutral.len()).sum(),
            simulation_ms: TimeStatistics::of(measures.simulation_ms),
            cloth_ms: TimeStatistics::of(measures.cloth_ms),
            recording_ms: TimeStatistics::of(measures.recording_ms),
            wall_secs: whole.wall_secs,
            guards: measures.guards,
            settle_rms_max: measures.settle_rms_max,
            contact: self.maker.contact_summary(),
            economy: measures.economy.summary(self.simulation.tolerance()),
            take,
            recording: whole.recording.clone(),
            foxglove_layout: whole.foxglove_layout.clone(),
        }
    }
}

fn milliseconds(clock: Instant) -> f64 {
    clock.elapsed().as_secs_f64() * 1e3
}
