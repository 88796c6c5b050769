//! A take as weights of the shapes, as simulated frames, and the one against the other.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Isometry3;

use super::face::{Frame, Placement, Shape, WeightAnimation};
use super::shapes::shape_order;
use super::{ExportError, ExportOptions, LinearError};
use crate::Vector;
use crate::motion::Clip;
use crate::pipeline::{frame_count, recording_rate};
use crate::rig::Rig;
use crate::scene::{Scene, Simulation};

/// Frames one after the other: of a simulation or of a recording.
pub(super) trait FrameSource {
    /// How many there are.
    fn frame_count(&self) -> usize;
    /// Frames a second. (1/s)
    fn fps(&self) -> f64;
    /// The next one; `None` after the last.
    fn next_frame(&mut self) -> Result<Option<Frame>, ExportError>;
}

/// Checked frames a second of a take: those asked for, or else the scene's or the take's.
pub(super) fn rate(clip: &Clip, options: &ExportOptions) -> Result<f64, ExportError> {
    match options.fps.or(options.scene.fps) {
        Some(found) if !(found > 0.0 && found <= 1000.0) => Err(ExportError::Option {
            name: "fps",
            expected: "above 0 and at most 1000",
            found,
        }),
        Some(fps) => Ok(fps),
        None => Ok(recording_rate(clip)),
    }
}

/// The weights of a take, in [`shape_order`].
pub(super) fn weights_of_take(
    rig: &Arc<Rig>,
    clip: &Clip,
    name: &str,
    fps: f64,
    still_head: bool,
    placement: &Placement,
) -> Result<WeightAnimation, ExportError> {
    let order = shape_order(rig);
    let start = clip.times()[0];
    let scene = Scene::without_dynamics();
    let mut simulation = Simulation::new(Arc::clone(rig), scene, Some(clip.clone()))?;
    let mut animation = WeightAnimation {
        name: name.to_owned(),
        times: Vec::new(),
        fps,
        weights: Vec::new(),
        heads: Vec::new(),
    };
    for frame in 0..frame_count(clip.duration(), fps) {
        let time = frame as f64 / fps;
        let pose = simulation.pose_at(start + time);
        let weights = order.iter();
        let weights = weights.map(|(_, index)| index.map_or(0.0, |index| pose.weights[index]));
        animation.times.push(time);
        animation.weights.push(weights.collect());
        animation.heads.push(placement.motion(&pose.head));
    }
    if still_head || clip.tracks().head.is_empty() {
        animation.heads.clear();
    }
    Ok(animation)
}

/// A rig simulated through a take.
pub(super) struct SimulatedTake {
    simulation: Simulation,
    placement: Placement,
    fps: f64,
    frame_count: usize,
    next: usize,
}

impl SimulatedTake {
    pub(super) fn new(
        rig: &Arc<Rig>,
        clip: &Clip,
        scene: &Scene,
        fps: f64,
        placement: Placement,
    ) -> Result<Self, ExportError> {
        let simulation = Simulation::new(Arc::clone(rig), scene.clone(), Some(clip.clone()))?;
        Ok(Self {
            simulation,
            placement,
            fps,
            frame_count: frame_count(clip.duration(), fps) as usize,
            next: 0,
        })
    }
}

impl FrameSource for SimulatedTake {
    fn frame_count(&self) -> usize {
        self.frame_count
    }

    fn fps(&self) -> f64 {
        self.fps
    }

    fn next_frame(&mut self) -> Result<Option<Frame>, ExportError> {
        if self.next == self.frame_count {
            return Ok(None);
        }
        if self.next > 0 {
            self.simulation.advance(1.0 / self.fps)?;
        }
        let pairs = self.simulation.skin().iter();
        let pairs = pairs.zip(self.simulation.rest_skin());
        let frame = Frame {
            time: self.next as f64 / self.fps,
            offsets: pairs
                .map(|(now, rest)| self.placement.offset(&(now - rest).cast()))
                .collect(),
            head: self.placement.motion(self.simulation.head()),
        };
        self.next += 1;
        Ok(Some(frame))
    }
}

/// Longest stretch of a take over which sums are compared with the simulation. (s)
const LONGEST_CHECK: f64 = 20.0;

/// Compares the weighted sum of morph targets with the simulated skin.
pub(super) fn linear_error(
    animation: &WeightAnimation,
    shapes: &[Shape],
    frames: &mut SimulatedTake,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<LinearError, ExportError> {
    let placement = frames.placement;
    let total = frames
        .frame_count
        .min((LONGEST_CHECK * frames.fps) as usize + 1);
    let (mut sum, mut motion, mut count) = (0.0, 0.0, 0usize);
    let (mut largest, mut largest_at) = (0.0f64, 0.0);
    let mut done = 0;
    while done < total {
        let Some(mut frame) = frames.next_frame()? else {
            break;
        };
        let squares = |offsets: &[Vector]| -> f64 {
            let lengths = offsets.iter().map(|offset| placement.length(offset));
            lengths.map(|length| length * length).sum()
        };
        motion += squares(&frame.offsets);
        let weights = shapes.iter().zip(&animation.weights[done]);
        for (shape, &weight) in weights.filter(|(_, weight)| **weight != 0.0) {
            for &(vertex, offset) in &shape.offsets {
                frame.offsets[vertex as usize] -= offset * f64::from(weight);
            }
        }
        sum += squares(&frame.offsets);
        count += frame.offsets.len();
        for offset in &frame.offsets {
            let length = placement.length(offset);
            if length > largest {
                (largest, largest_at) = (length, frame.time);
            }
        }
        done += 1;
        if progress(done as f64 / total as f64).is_break() {
            return Err(ExportError::Stopped);
        }
    }
    let count = count.max(1) as f64;
    Ok(LinearError {
        take: animation.name.clone(),
        frames: done,
        rms_mm: (sum / count).sqrt(),
        max_mm: largest,
        max_at_secs: largest_at,
        motion_rms_mm: (motion / count).sqrt(),
    })
}

/// Where the head is in every frame; empty where it never moves.
pub(super) fn heads_or_none(heads: Vec<Isometry3<f64>>) -> Vec<Isometry3<f64>> {
    if heads.iter().all(|head| *head == Isometry3::identity()) {
        return Vec::new();
    }
    heads
}
