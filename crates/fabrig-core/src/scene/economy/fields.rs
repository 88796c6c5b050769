//! What acts on all patches alike.

use nalgebra::Vector3;

use crate::Vector;
use crate::cloth::{ClothOptions, HeadMotion};

/// Distance from the head's origin within which all nodes are. (mm)
const REACH: f64 = 200.0;

/// Accelerations at the end of a frame, as far as thrift cares.
#[derive(Debug, Clone, Copy)]
pub(in crate::scene) struct ActingFields {
    /// Gravity beyond standing gravity, less the acceleration of the head. (mm/s^2)
    uniform: Vector3<f64>,
    /// Bound of what the head's turning adds over the face. (mm/s^2)
    turning: f64,
    /// Bound of what the wind does to a patch, along it. (mm/s^2)
    air: Vector3<f64>,
}

impl ActingFields {
    /// - `gravity`: and all that accelerates the face from outside [mm/s^2, head frame]
    /// - `wind`: velocity of the air (mm/s)
    pub(in crate::scene) fn new(
        gravity: Vector,
        wind: Vector,
        head: &HeadMotion,
        options: &ClothOptions,
    ) -> Self {
        let [linear, w, dw] = [
            head.linear_acceleration,
            head.angular_velocity,
            head.angular_acceleration,
        ]
        .map(|v| v.cast::<f64>());
        // A sheet that faces the wind feels half its dynamic pressure, times drag and lift.
        let pressure = 0.5 * options.air_density * wind.norm();
        let per_speed = pressure * (options.drag + options.lift) / options.areal_density;
        Self {
            uniform: gravity - options.standing_gravity.cast() - linear,
            turning: REACH * (w.norm_squared() + dw.norm()),
            air: wind * per_speed,
        }
    }

    /// At a place of a head that moves so. (mm/s^2)
    ///
    /// - `place`: from the head's origin (mm)
    pub(in crate::scene) fn at(&self, place: &Vector, head: &HeadMotion) -> Vector {
        let [w, dw] = [head.angular_velocity, head.angular_acceleration].map(|v| v.cast::<f64>());
        self.uniform - dw.cross(place) - w.cross(&w.cross(place))
    }

    /// Bound of how much the acceleration of any node differs. (mm/s^2)
    pub(super) fn difference(&self, other: &Self) -> f64 {
        (self.uniform - other.uniform).norm()
            + (self.turning - other.turning).abs()
            + (self.air - other.air).norm()
    }

    /// What the wind does. (mm/s^2)
    pub(in crate::scene) fn air(&self) -> f64 {
        self.air.norm()
    }
}
