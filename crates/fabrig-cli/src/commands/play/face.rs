//! A rig that is simulated while it is watched.

use std::ops::ControlFlow;
use std::sync::Arc;

use anyhow::Result;
use fabrig_core::pipeline::{AnimateOptions, LiveFace, frame_count};

use super::Source;
use super::parameters::Change;
use super::server::{Announcement, Server, Topic};
use crate::cli::PlayArgs;
use crate::commands::animate::{load_rig_for, read_take, scene};
use crate::commands::stem;

/// The source.
pub(super) struct SimulatedFace {
    name: String,
    face: LiveFace,
    topics: Vec<&'static str>,
    speed: f64,
    has_take: bool,
    /// Frames of one round of the take; none without one.
    round: Option<u64>,
    /// How many of them are left.
    left: Option<u64>,
    is_first: bool,
}

impl SimulatedFace {
    pub(super) fn new(args: &PlayArgs) -> Result<Self> {
        let rig = Arc::new(load_rig_for(&args.input, &args.scene)?);
        let clip = match &args.motion {
            Some(path) => Some(read_take(path, &args.take)?),
            None => None,
        };
        let name = stem(&args.input);
        let scene = scene(&args.scene)?;
        let options = AnimateOptions {
            fps: args.scene.fps,
            rig_name: name.clone(),
            take_name: args.motion.as_deref().map_or_else(String::new, stem),
            recording: args.options(),
        };
        let duration = clip.as_ref().map(|clip| clip.duration());
        let face = LiveFace::new(rig, clip, scene, &options)?;
        let round = duration.map(|secs| frame_count(secs, face.fps()));
        Ok(Self {
            name,
            topics: face.topics().iter().map(|topic| topic.topic).collect(),
            speed: args.speed,
            has_take: duration.is_some(),
            round,
            left: round,
            is_first: true,
            face,
        })
    }
}

impl Source for SimulatedFace {
    fn announcement(&self) -> Announcement {
        let topics = self.face.topics().into_iter().map(|topic| Topic {
            topic: topic.topic.to_owned(),
            schema: topic.schema.to_owned(),
            descriptors: topic.descriptors,
            metadata: topic.metadata,
        });
        Announcement {
            name: format!("fabrig: {}", self.name),
            topics: topics.collect(),
            speed: self.speed,
            weights: self.face.weight_names().to_vec(),
            follows_take: self.has_take.then_some(true),
        }
    }

    fn layout(&self) -> Option<String> {
        Some(self.face.layout())
    }

    fn set(&mut self, change: &Change) {
        // Shapes and weights were checked where they came in.
        match *change {
            Change::Weight(shape, weight) => {
                let _ = self.face.set_weight(shape, Some(weight));
            }
            Change::FollowTake(follows) => {
                let held = self.face.weights().to_vec();
                for (shape, weight) in held.into_iter().enumerate() {
                    let _ = self.face.set_weight(shape, (!follows).then_some(weight));
                }
            }
            Change::Speed(_) => {}
        }
    }

    fn send(&mut self, server: &Server) -> Result<ControlFlow<(), f64>> {
        if self.left == Some(0) {
            return Ok(ControlFlow::Break(()));
        }
        self.left = self.left.map(|left| left - 1);
        if !std::mem::take(&mut self.is_first) {
            self.face.step()?;
        }
        let topics = &self.topics;
        let mut time = 0;
        self.face.encode(&mut |topic, log_time, data| {
            time = log_time;
            if let Some(index) = topics.iter().position(|known| *known == topic) {
                server.send(index, log_time, data);
            }
            Ok(())
        })?;
        server.time(time);
        Ok(ControlFlow::Continue(1.0 / self.face.fps()))
    }

    fn restart(&mut self) -> Result<()> {
        // The take begins anew by itself, and time goes on.
        self.left = self.round;
        Ok(())
    }
}
