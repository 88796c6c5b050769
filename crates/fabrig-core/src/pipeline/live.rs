//! A face that is simulated for someone who watches, instead of into a file.

use std::sync::Arc;

use super::animate::DEFAULT_RATE;
use super::frames::FrameMaker;
use super::{AnimateOptions, recording_rate};
use crate::Error;
use crate::motion::Clip;
use crate::recording::{FrameEncoder, MessageSink, TopicInfo};
use crate::rig::Rig;
use crate::scene::{FrameReport, Scene, SceneError, Simulation};
use crate::transfer::TransferError;

/// A rig that plays a take over and over, or holds still, and whose weights can be set.
///
/// Each frame becomes the messages of a recording. Log time goes on where the take begins anew.
pub struct LiveFace {
    simulation: Simulation,
    maker: FrameMaker,
    encoder: FrameEncoder,
    report: FrameReport,
    fps: f64,
    /// First and last time of the take; none without one. (s)
    span: Option<(f64, f64)>,
    /// Where in the take it is. (s)
    time: f64,
    /// Weights that are set, instead of the take's.
    set: Vec<Option<f32>>,
}

impl LiveFace {
    /// - `clip`: the take; without one the face is at rest where no weight is set
    ///
    /// # Errors
    ///
    /// [`Error::Scene`], [`Error::Recording`].
    pub fn new(
        rig: Arc<Rig>,
        clip: Option<Clip>,
        scene: Scene,
        options: &AnimateOptions,
    ) -> Result<Self, Error> {
        let own = clip.as_ref().map_or(DEFAULT_RATE, recording_rate);
        let fps = options.fps.or(scene.fps).unwrap_or(own);
        let mut maker = FrameMaker::new(&rig, options.recording);
        let info = maker.info(&rig, clip.as_ref(), &scene, fps, options)?;
        let encoder = FrameEncoder::new(info, options.recording)?;
        let span = clip.as_ref().map(|c| {
            let start = c.times()[0];
            (start, start + c.duration())
        });
        let shape_count = rig.shape_names.len();
        let simulation = Simulation::new(rig, scene, clip)?;
        maker.watch(&simulation);
        Ok(Self {
            simulation,
            maker,
            encoder,
            report: FrameReport::default(),
            fps,
            span,
            time: span.map_or(0.0, |(start, _)| start),
            set: vec![None; shape_count],
        })
    }

    /// Frames a second. (1/s)
    pub fn fps(&self) -> f64 {
        self.fps
    }

    /// The topics that [`Self::encode`] gives messages on.
    pub fn topics(&self) -> Vec<TopicInfo> {
        self.encoder.topics()
    }

    /// The layout for Foxglove and Lichtblick, as JSON.
    pub fn layout(&self) -> String {
        self.encoder.layout()
    }

    /// Names of the shapes whose weights can be set.
    pub fn weight_names(&self) -> &[String] {
        &self.simulation.rig().shape_names
    }

    /// The weights of the present frame, in the order of [`Self::weight_names`].
    pub fn weights(&self) -> &[f32] {
        &self.simulation.pose().weights
    }

    /// Sets the weight of a shape from the next frame on; `None` gives it back to the take.
    /// Weights outside [0, 1] are brought to its ends.
    ///
    /// # Errors
    ///
    /// [`TransferError::WeightNotFinite`]; [`TransferError::WeightCount`] for a shape that is not
    /// there.
    pub fn set_weight(&mut self, shape: usize, weight: Option<f32>) -> Result<(), TransferError> {
        let found = self.set.len();
        let Some(slot) = self.set.get_mut(shape) else {
            return Err(TransferError::WeightCount {
                expected: shape + 1,
                found,
            });
        };
        if let Some(value) = weight.filter(|w| !w.is_finite()) {
            return Err(TransferError::WeightNotFinite { shape, value });
        }
        *slot = weight.map(|w| w.clamp(0.0, 1.0));
        Ok(())
    }

    /// Goes one frame on; past its end the take begins anew, with the face put into its first
    /// pose.
    ///
    /// # Errors
    ///
    /// [`SceneError`] where the solver refuses a frame.
    pub fn step(&mut self) -> Result<(), SceneError> {
        let dt = 1.0 / self.fps;
        self.time += dt;
        let restart = self.span.filter(|(_, end)| self.time > end + 1e-6);
        if let Some((start, _)) = restart {
            self.time = start;
        }
        let mut pose = self.simulation.pose_at(self.time);
        if self.span.is_none() {
            pose.weights.fill(0.0);
            pose.rates.fill(0.0);
        }
        for (shape, set) in self.set.iter().enumerate() {
            if let Some(weight) = set {
                let before = self.simulation.pose().weights[shape];
                pose.weights[shape] = *weight;
                pose.rates[shape] = if restart.is_some() {
                    0.0
                } else {
                    (weight - before) / dt as f32
                };
            }
        }
        if restart.is_some() {
            self.simulation.reset(pose.clone())?;
        }
        self.report = self.simulation.advance_to(pose, dt)?;
        Ok(())
    }

    /// Encodes the present frame.
    ///
    /// # Errors
    ///
    /// As [`FrameEncoder::encode`].
    pub fn encode(&mut self, sink: MessageSink<'_>) -> Result<(), Error> {
        let Self {
            simulation,
            maker,
            encoder,
            report,
            ..
        } = self;
        maker.give(simulation, report, |frame| encoder.encode(frame, sink))?;
        Ok(())
    }
}
