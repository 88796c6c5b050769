//! Pushes away from a point, or pulls towards it.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use super::noise::Signal;
use super::{Curve, OverTime};
use crate::{Point, Vector};

/// What a place is given in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldFrame {
    /// The world: the head moves away from it.
    #[default]
    World,
    /// The head: it moves with the skull.
    Head,
}

/// How a push weakens with the distance r from its centre; beyond the reach R there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Falloff {
    /// `(1 - r^2/R^2)^2`: no corner at the reach.
    #[default]
    Smooth,
    /// `1 - r/R`.
    Linear,
    /// Not at all, up to the reach.
    None,
}

impl Falloff {
    fn at(self, share: f64) -> f64 {
        match self {
            _ if share >= 1.0 => 0.0,
            Self::Smooth => (1.0 - share * share).powi(2),
            Self::Linear => 1.0 - share,
            Self::None => 1.0,
        }
    }
}

/// A push away from a point; a pull towards it where `strength` is negative.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RadialForce {
    /// Its name, one of its kind in a scene.
    pub name: String,
    /// What `center` is given in.
    #[serde(default)]
    pub frame: FieldFrame,
    /// Where it pushes from. (mm)
    pub center: Point,
    /// Acceleration at the centre. (mm/s^2)
    pub strength: OverTime<f64>,
    /// Distance from which on there is none. (mm)
    pub reach: f64,
    /// How it weakens up to there.
    #[serde(default)]
    pub falloff: Falloff,
    /// Root mean square of a random change of `strength`, relative to it.
    #[serde(default)]
    pub flicker: f64,
    /// Time over which that changes. (s)
    #[serde(default = "default_flicker_time")]
    pub flicker_time: f64,
    /// Seed of the flicker.
    #[serde(default)]
    pub seed: u64,
}

fn default_flicker_time() -> f64 {
    0.1
}

/// A [`RadialForce`] that is ready to be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Push {
    frame: FieldFrame,
    center: Point,
    strength: Curve<1>,
    reach: f64,
    falloff: Falloff,
    flicker: Option<(f64, Signal<1>)>,
}

impl Push {
    pub(super) fn new(force: &RadialForce) -> Self {
        let flickers = force.flicker > 0.0;
        Self {
            frame: force.frame,
            center: force.center,
            strength: force.strength.curve(),
            reach: force.reach,
            falloff: force.falloff,
            flicker: flickers.then(|| (force.flicker, Signal::new(force.seed, force.flicker_time))),
        }
    }

    /// Acceleration in the world of what is at `place` in the world. (mm/s^2)
    pub(super) fn at(&self, place: &Point, time: f64, head: &Isometry3<f64>) -> Vector {
        let center = match self.frame {
            FieldFrame::World => self.center,
            FieldFrame::Head => head * self.center,
        };
        let away = place - center;
        let distance = away.norm();
        // At the very centre it pushes nowhere.
        if distance < 1e-9 * self.reach {
            return Vector::zeros();
        }
        let change = self.flicker.as_ref().map_or(1.0, |(size, signal)| {
            let [noise] = signal.at(time);
            1.0 + size * noise
        });
        let strength = self.strength.at(time)[0] * change * self.falloff.at(distance / self.reach);
        away * (strength / distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn force() -> RadialForce {
        RadialForce {
            name: "fan".to_owned(),
            frame: FieldFrame::Head,
            center: Point::new(10.0, 0.0, 0.0),
            strength: 500.0.into(),
            reach: 40.0,
            falloff: Falloff::Linear,
            flicker: 0.0,
            flicker_time: 0.1,
            seed: 3,
        }
    }

    #[test]
    fn it_pushes_away_and_weakens_up_to_its_reach() {
        let push = Push::new(&force());
        let head = Isometry3::translation(0.0, 5.0, 0.0);
        let at = |x: f64| push.at(&Point::new(x, 5.0, 0.0), 0.0, &head);
        assert!((at(20.0) - Vector::x() * 375.0).norm() < 1e-9);
        assert!((at(0.0) + Vector::x() * 375.0).norm() < 1e-9);
        assert_eq!(at(50.1), Vector::zeros());
        assert_eq!(at(10.0), Vector::zeros());
        let world = Push::new(&RadialForce {
            frame: FieldFrame::World,
            ..force()
        });
        let beside = world.at(&Point::new(10.0, 5.0, 0.0), 0.0, &head);
        assert!((beside.y - 500.0 * (1.0 - 5.0 / 40.0)).abs() < 1e-9);
    }

    #[test]
    fn flicker_changes_the_strength_about_its_mean() {
        let push = Push::new(&RadialForce {
            flicker: 0.2,
            ..force()
        });
        let place = Point::new(30.0, 0.0, 0.0);
        let count = 20_000;
        let still = 250.0;
        let sizes: Vec<f64> = (0..count)
            .map(|k| {
                push.at(&place, f64::from(k) * 0.0137, &Isometry3::identity())
                    .x
            })
            .collect();
        let mean = sizes.iter().sum::<f64>() / f64::from(count);
        let square = sizes.iter().map(|s| (s / still - 1.0).powi(2)).sum::<f64>();
        let size = (square / f64::from(count)).sqrt();
        assert!((mean / still - 1.0).abs() < 0.02, "{mean}");
        assert!((size - 0.2).abs() < 0.02, "{size}");
    }
}
