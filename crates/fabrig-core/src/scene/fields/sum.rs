//! All fields of a scene, ready to be evaluated.

use nalgebra::Isometry3;

use super::Curve;
use super::noise::{Signal, SolenoidalNoise};
use super::radial::Push;
use crate::scene::Scene;
use crate::{Point, Vector};

/// What acts on a face from outside, at any place and time of the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Fields {
    gravity: Curve<3>,
    wind: Curve<3>,
    gusts: Option<(f64, SolenoidalNoise)>,
    shake: Option<(f64, Signal<3>)>,
    pushes: Vec<Push>,
}

impl Fields {
    /// The fields that a scene describes.
    pub fn new(scene: &Scene) -> Self {
        let gusts = scene.turbulence.filter(|t| t.intensity > 0.0);
        let shake = scene.shake.filter(|s| s.intensity > 0.0);
        Self {
            gravity: scene.gravity.curve(),
            wind: scene.wind.curve(),
            gusts: gusts.map(|t| (t.intensity, SolenoidalNoise::new(t.seed, t.length, t.time))),
            shake: shake.map(|s| (s.intensity, Signal::new(s.seed, s.time))),
            pushes: scene.forces.iter().map(Push::new).collect(),
        }
    }

    /// Acceleration of what is at `place` in the world: gravity, shaking and pushes. (mm/s^2)
    ///
    /// - `time` (s); `head`: from the head frame to the world (mm)
    pub fn acceleration(&self, place: &Point, time: f64, head: &Isometry3<f64>) -> Vector {
        let mut sum = Vector::from(self.gravity.at(time));
        if let Some((size, signal)) = &self.shake {
            sum += Vector::from(signal.at(time)) * *size;
        }
        for push in &self.pushes {
            sum += push.at(place, time, head);
        }
        sum
    }

    /// Velocity of the air at a place of the world. (mm/s)
    pub fn wind(&self, place: &Point, time: f64) -> Vector {
        let steady = Vector::from(self.wind.at(time));
        let Some((size, noise)) = &self.gusts else {
            return steady;
        };
        let carried = Vector::from(self.wind.integral(time));
        steady + noise.at(&(place - carried), time) * *size
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Shake, Turbulence};
    use super::*;

    #[test]
    fn without_anything_random_fields_are_what_is_written() {
        let scene = Scene {
            wind: [1.0, 2.0, 3.0].into(),
            ..Scene::default()
        };
        let fields = Fields::new(&scene);
        let place = Point::new(5.0, 6.0, 7.0);
        assert_eq!(fields.wind(&place, 9.0), Vector::new(1.0, 2.0, 3.0));
        let down = fields.acceleration(&place, 9.0, &Isometry3::identity());
        assert_eq!(down, Vector::new(0.0, -9810.0, 0.0));
    }

    #[test]
    fn gusts_are_carried_by_the_wind() {
        let scene = Scene {
            wind: [2000.0, 0.0, 0.0].into(),
            turbulence: Some(Turbulence {
                time: 1e6,
                ..Turbulence::default()
            }),
            ..Scene::default()
        };
        let fields = Fields::new(&scene);
        let now = fields.wind(&Point::new(0.0, 10.0, 0.0), 0.0);
        let later = fields.wind(&Point::new(500.0, 10.0, 0.0), 0.25);
        assert!((now - later).norm() < 0.01);
        assert!((now - Vector::new(2000.0, 0.0, 0.0)).norm() > 10.0);
    }

    #[test]
    fn shaking_has_the_size_that_is_asked_for() {
        let scene = Scene {
            shake: Some(Shake {
                intensity: 700.0,
                ..Shake::default()
            }),
            gravity: [0.0; 3].into(),
            ..Scene::default()
        };
        let fields = Fields::new(&scene);
        let count = 20_000;
        let squares: f64 = (0..count)
            .map(|k| {
                let time = f64::from(k) * 0.0113;
                let a = fields.acceleration(&Point::origin(), time, &Isometry3::identity());
                a.norm_squared() / 3.0
            })
            .sum();
        let size = (squares / f64::from(count)).sqrt();
        assert!((size / 700.0 - 1.0).abs() < 0.05, "{size}");
    }
}
