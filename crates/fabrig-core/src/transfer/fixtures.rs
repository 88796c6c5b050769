//! What the tests of fits share.

use super::MuscleShape;
use crate::template::JawHinge;
use crate::{Point, Vector};

/// A jaw that opens by 0.4 rad about an axis behind it.
pub(super) fn hinge() -> JawHinge {
    JawHinge {
        center: Point::new(0.0, 0.0, -20.0),
        axis: Vector::x(),
        open_angle: 0.4,
        forward: Vector::z(),
        left: Vector::x(),
    }
}

/// A shape of a patch from its displacements. (mm)
pub(super) fn shape(index: u32, deltas: &[[f32; 3]]) -> MuscleShape {
    MuscleShape {
        name: format!("p.{index}"),
        shape: index,
        deltas: deltas.iter().map(|d| (*d).into()).collect(),
    }
}

/// Nodes of a patch at the chin. (mm)
pub(super) fn nodes(count: usize) -> Vec<Point> {
    (0..count)
        .map(|i| Point::new(i as f64, -40.0 - (i % 7) as f64, 60.0))
        .collect()
}
