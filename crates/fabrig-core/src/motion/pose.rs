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
