//! The head as a moving frame.

use nalgebra::{Isometry3, Translation3};

use crate::cloth::HeadMotion;
use crate::motion::HeadPose;
use crate::{Point, Vector};

/// From the head frame to the world: a turn about the pivot, then the take's translation.
pub(super) fn head_to_world(pose: &HeadPose, pivot: &Point) -> Isometry3<f64> {
    let rotation = pose.rotation();
    let shift = pivot.coords - rotation * pivot.coords + pose.translation;
    Isometry3::from_parts(Translation3::from(shift), rotation)
}

/// Motion of the head frame between three poses `h` seconds apart, in its own axes at the
/// middle one. Also returns the velocity of its origin there, in the world. (mm/s)
pub(super) fn head_motion(
    before: &Isometry3<f64>,
    now: &Isometry3<f64>,
    after: &Isometry3<f64>,
    h: f64,
) -> (HeadMotion, Vector) {
    let origin = |pose: &Isometry3<f64>| pose.translation.vector;
    let acceleration = (origin(after) - 2.0 * origin(now) + origin(before)) / (h * h);
    let velocity = (origin(after) - origin(before)) / (2.0 * h);
    let first = (now.rotation * before.rotation.inverse()).scaled_axis() / h;
    let second = (after.rotation * now.rotation.inverse()).scaled_axis() / h;
    let to_head = now.rotation.inverse();
    let motion = HeadMotion {
        linear_acceleration: (to_head * acceleration).cast(),
        angular_velocity: (to_head * ((first + second) * 0.5)).cast(),
        angular_acceleration: (to_head * ((second - first) / h)).cast(),
    };
    (motion, velocity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_turn_gives_its_rate_and_the_pull_to_the_axis() {
        let pivot = Point::new(0.0, -50.0, -30.0);
        let rate = 2.0;
        let at = |t: f64| {
            let pose = HeadPose {
                yaw: rate * t,
                ..HeadPose::default()
            };
            head_to_world(&pose, &pivot)
        };
        let h = 1e-3;
        let (motion, _) = head_motion(&at(-h), &at(0.0), &at(h), h);
        assert!((motion.angular_velocity.y - 2.0).abs() < 1e-4);
        assert!(motion.angular_acceleration.norm() < 1e-3);
        // The origin stands 30 mm in front of the axis: r w^2 towards it.
        assert!((motion.linear_acceleration.z + 30.0 * rate as f32 * rate as f32).abs() < 0.1);
    }

    #[test]
    fn the_pivot_stays_where_it_is() {
        let pivot = Point::new(0.0, -50.0, -30.0);
        let pose = HeadPose {
            yaw: 0.3,
            pitch: -0.4,
            roll: 0.2,
            ..HeadPose::default()
        };
        assert!((head_to_world(&pose, &pivot) * pivot - pivot).norm() < 1e-12);
    }
}
