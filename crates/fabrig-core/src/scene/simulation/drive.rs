//! What clip and scene say at a time: weights, head, air, and what accelerates the face.

use nalgebra::Isometry3;

use super::{FacePose, Simulation};
use crate::Vector;
use crate::scene::SceneError;
use crate::scene::fields::{HeadDrive, keyed_head};
use crate::scene::head::{head_motion, head_to_world};

/// Distance in time over which the motion of the head is differentiated. (s)
const HEAD_STEP: f64 = 1.0 / 60.0;
/// Further than this from its ends a take is over, and its weights are held. (s)
const AT_THE_END: f64 = 1e-6;

impl Simulation {
    /// Begins at another time: the face is put into its pose there at once.
    ///
    /// # Errors
    ///
    /// As [`Self::reset`].
    pub fn start_at(&mut self, time: f64) -> Result<(), SceneError> {
        self.time = time;
        let pose = self.pose_at(time);
        self.reset(pose)
    }

    /// What the clip and the scene say at a time. Without a clip weights and eyes are those held
    /// last, and so is the head where no keys move it.
    pub fn pose_at(&mut self, time: f64) -> FacePose {
        let (mut pose, take_wind, take_moves_head) = match &self.clip {
            None => (self.pose.clone(), Vector::zeros(), false),
            Some(clip) => {
                clip.sample_into(time, &mut self.sample);
                let sample = &self.sample;
                let pick = |of: &[f32]| -> Vec<f32> {
                    self.channels
                        .iter()
                        .map(|c| c.map_or(0.0, |c| of[c]))
                        .collect()
                };
                let mut pose = FacePose {
                    weights: pick(&sample.weights),
                    rates: pick(&sample.rates),
                    eyes: sample.eyes,
                    ..FacePose::neutral(0)
                };
                let (first, last) = (clip.times()[0], clip.times()[0] + clip.duration());
                if !(first - AT_THE_END..=last + AT_THE_END).contains(&time) {
                    pose.rates.fill(0.0);
                }
                (pose, sample.wind, !clip.tracks().head.is_empty())
            }
        };
        if self.head_keys.is_some()
            || take_moves_head && self.scene.head_motion == HeadDrive::Take(true)
        {
            let now = self.head_at(time);
            let (before, after) = (
                self.head_at(time - HEAD_STEP),
                self.head_at(time + HEAD_STEP),
            );
            let (motion, velocity) = head_motion(&before, &now, &after, HEAD_STEP);
            pose.head = now;
            pose.head_motion = motion;
            pose.wind = take_wind + self.air(&now, time) - velocity;
        } else {
            pose.wind = take_wind + self.air(&pose.head, time);
        }
        pose
    }

    /// Where the head is, by its keys or the clip. (mm)
    fn head_at(&mut self, time: f64) -> Isometry3<f64> {
        let pivot = self.scene.neck_pivot;
        match (&self.head_keys, &self.clip) {
            (Some(keys), _) => keyed_head(keys, time, &pivot),
            (None, Some(clip)) => {
                clip.sample_into(time, &mut self.sample);
                head_to_world(&self.sample.head, &pivot)
            }
            (None, None) => self.pose.head,
        }
    }

    /// Velocity of the scene's air at the face, in the axes of [`FacePose::wind`]: those of the
    /// world, turned back by where the face stands. (mm/s)
    ///
    /// - `head`: as [`FacePose::head`]
    pub fn air(&self, head: &Isometry3<f64>, time: f64) -> Vector {
        let place = self.scene.place.to_world();
        let at = place.map_or(*head, |place| place * head) * self.middle;
        let wind = self.fields.wind(&at, time);
        place.map_or(wind, |place| place.rotation.inverse() * wind)
    }

    /// Gravity and all that accelerates the face from outside at a time, in the head frame.
    /// (mm/s^2)
    pub(super) fn acceleration(&self, time: f64) -> Vector {
        self.acceleration_in(&self.world, time)
    }

    /// The same, where the head is elsewhere.
    ///
    /// - `world`: from the head frame to the world (mm)
    pub(super) fn acceleration_in(&self, world: &Isometry3<f64>, time: f64) -> Vector {
        let at = world * self.middle;
        world.rotation.inverse() * self.fields.acceleration(&at, time, world)
    }

    /// From the head frame to the world, with where the face stands in it. (mm)
    pub(super) fn world_of(&self, pose: &FacePose) -> Isometry3<f64> {
        match self.scene.place.to_world() {
            Some(place) => place * pose.head,
            None => pose.head,
        }
    }
}
