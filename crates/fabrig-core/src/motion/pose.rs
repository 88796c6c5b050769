//! Where the head is and where the eyes look.

use nalgebra::UnitQuaternion;
use serde::{Deserialize, Serialize};

use crate::Vector;

/// Pose of the head relative to rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeadPose {
    /// About +Y; positive turns the face to the character's left. (rad)
    pub yaw: f64,
    /// About +X; positive looks down. (rad)
    pub pitch: f64,
    /// About +Z; positive leans the top of the head to the character's right. (rad)
    pub roll: f64,
    /// Where the head frame's origin has moved to. (mm)
    pub translation: Vector,
}

impl Default for HeadPose {
    fn default() -> Self {
        Self {
            yaw: 0.0,
            pitch: 0.0,
            roll: 0.0,
            translation: Vector::zeros(),
        }
    }
}

impl HeadPose {
    /// The pose without translation whose [`Self::rotation`] is this one; pitch in
    /// [-pi/2, pi/2].
    pub fn from_rotation(rotation: &UnitQuaternion<f64>) -> Self {
        // R = Ry(yaw) Rx(pitch) Rz(roll), read off its third column and second row.
        let r = rotation.to_rotation_matrix();
        Self {
            yaw: r[(0, 2)].atan2(r[(2, 2)]),
            pitch: (-r[(1, 2)]).clamp(-1.0, 1.0).asin(),
            roll: r[(1, 0)].atan2(r[(1, 1)]),
            translation: Vector::zeros(),
        }
    }

    /// The rotation: roll first, then pitch, then yaw.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Vector::y_axis(), self.yaw)
            * UnitQuaternion::from_axis_angle(&Vector::x_axis(), self.pitch)
            * UnitQuaternion::from_axis_angle(&Vector::z_axis(), self.roll)
    }
}

/// Where one eye looks, relative to straight ahead. Signs as in [`HeadPose`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct EyeAngles {
    /// Positive looks to the character's left. (rad)
    pub yaw: f64,
    /// Positive looks down. (rad)
    pub pitch: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_read_back_from_its_rotation() {
        let pose = HeadPose {
            yaw: 0.7,
            pitch: -0.4,
            roll: 0.2,
            ..HeadPose::default()
        };
        let back = HeadPose::from_rotation(&pose.rotation());
        assert!((back.yaw - pose.yaw).abs() < 1e-12);
        assert!((back.pitch - pose.pitch).abs() < 1e-12);
        assert!((back.roll - pose.roll).abs() < 1e-12);
    }

    #[test]
    fn signs_are_what_the_documentation_says() {
        let turned = |pose: HeadPose, v: Vector| pose.rotation() * v;
        let yaw = HeadPose {
            yaw: 0.5,
            ..HeadPose::default()
        };
        assert!(turned(yaw, Vector::z()).x > 0.4, "to the left is +X");
        let pitch = HeadPose {
            pitch: 0.5,
            ..HeadPose::default()
        };
        assert!(turned(pitch, Vector::z()).y < -0.4, "looks down");
        let roll = HeadPose {
            roll: 0.5,
            ..HeadPose::default()
        };
        assert!(
            turned(roll, Vector::y()).x < -0.4,
            "the top leans to the right"
        );
    }
}
