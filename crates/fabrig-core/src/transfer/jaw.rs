//! The jaw as a hinge.
//!
//! A shape that opens the jaw is a straight line per vertex; half of it cuts the chord of the
//! arc by some 2 mm at the chin. Here each node takes part in the turn of the mandible by a
//! participation `m`, read from the template's own shape: the projection of its displacement
//! on the displacement of a rigid turn. What is left over stays a straight line:
//!
//! `X = R(w theta m) (p + sum_others alpha w d) + alpha w r`
//!
//! which is the template's shape exactly at `w = 1` and a true arc in between. A shape that
//! closes the lips while the jaw is open turns them back the same way: its participation is
//! subtracted from the angle, and a product term `w_open w_close c` keeps the pair exact at
//! (1, 1), so that lips which meet there also meet half way.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::template::JawHinge;
use crate::transfer::JawShapes;
use crate::{Point, Vector};

/// How the jaw is modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JawMode {
    /// A straight line, as in the paper.
    Linear,
    /// A turn about the temporomandibular axis.
    #[default]
    Hinge,
}

/// Where a rigid mandible stands: a turn about the hinge, then a slide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JawPose {
    /// Angle about the hinge, positive opens. (rad)
    pub angle: f64,
    /// Slide. (mm)
    pub slide: Vector,
}

impl JawPose {
    /// The pose of the mandible under the given shape weights; `scale` is the size of this
    /// jaw against the template's.
    pub fn at(hinge: &JawHinge, shapes: &JawShapes, scale: f64, weights: &[f32]) -> Self {
        let weight = |shape: Option<u32>| shape.map_or(0.0, |s| f64::from(weights[s as usize]));
        let mirrored = Vector::new(-hinge.left.x, hinge.left.y, hinge.left.z);
        Self {
            angle: hinge.open_angle * weight(shapes.open),
            slide: scale
                * (hinge.forward * weight(shapes.forward)
                    + hinge.left * weight(shapes.left)
                    + mirrored * weight(shapes.right)),
        }
    }

    /// As a rotation matrix and a translation, `x -> R x + t`.
    pub fn affine(&self, hinge: &JawHinge) -> (Matrix3<f64>, Vector) {
        let rotation = turn(hinge, self.angle);
        let center = hinge.center.coords;
        (rotation, center - rotation * center + self.slide)
    }
}

/// Rotation about the hinge's axis.
pub(super) fn turn(hinge: &JawHinge, angle: f64) -> Matrix3<f64> {
    nalgebra::Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(hinge.axis), angle)
        .into_inner()
}

/// What the nodes of one patch do under the jaw; lengths = node count.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JawField {
    /// Share in the turn of the mandible, 0 skull to 1 mandible.
    pub open: Vec<f32>,
    /// What opening does besides turning, at weight 1 on the template. (mm)
    pub open_residual: Vec<Vector3<f32>>,
    /// Share of the turn that closing the lips takes back.
    pub close: Vec<f32>,
    /// What closing does besides turning. (mm)
    pub close_residual: Vec<Vector3<f32>>,
    /// Coefficient of the product of both weights. (mm)
    pub pair: Vec<Vector3<f32>>,
}

/// Displacement below which a rigid turn says nothing about participation. (mm)
const TURN_FLOOR: f64 = 1.5;

impl JawField {
    /// Splits the jaw shapes of a patch on the template.
    ///
    /// - `nodes`: rest positions on the template (mm)
    /// - `open`, `close`: displacements of the two shapes at weight 1 (mm); `None` where the
    ///   patch does not move
    ///
    /// Returns `None` where neither moves the patch.
    pub fn split(
        hinge: &JawHinge,
        nodes: &[Point],
        open: Option<&[Vector3<f32>]>,
        close: Option<&[Vector3<f32>]>,
    ) -> Option<Self> {
        if open.is_none() && close.is_none() {
            return None;
        }
        let count = nodes.len();
        let mut field = Self {
            open: Vec::with_capacity(count),
            open_residual: Vec::with_capacity(count),
            close: Vec::with_capacity(count),
            close_residual: Vec::with_capacity(count),
            pair: Vec::with_capacity(count),
        };
        let delta = |deltas: Option<&[Vector3<f32>]>, i: usize| {
            deltas.map_or_else(Vector::zeros, |d| d[i].cast::<f64>())
        };
        let turned = |p: &Point, share: f64| {
            hinge.center + turn(hinge, hinge.open_angle * share) * (p - hinge.center)
        };
        for (i, p) in nodes.iter().enumerate() {
            let (opened, closed) = (delta(open, i), delta(close, i));
            let rigid = turned(p, 1.0) - p;
            let share = |d: Vector| {
                (d.dot(&rigid) / (rigid.norm_squared() + TURN_FLOOR * TURN_FLOOR)).clamp(0.0, 1.0)
            };
            let m = share(opened);
            let back = m - share(opened + closed);
            let open_residual = p + opened - turned(p, m);
            let close_residual = p + closed - turned(p, -back);
            let pair = p + opened + closed - turned(p, m - back) - open_residual - close_residual;
            field.open.push(m as f32);
            field.open_residual.push(open_residual.cast());
            field.close.push(back as f32);
            field.close_residual.push(close_residual.cast());
            field.pair.push(pair.cast());
        }
        Some(field)
    }

    /// Scales what the jaw does besides turning, node by node.
    pub fn scale_residuals(&mut self, factors: &[f64]) {
        self.change_residuals(|node, vector| vector * factors[node] as f32);
    }

    /// Takes what the jaw does besides turning through a map, node by node.
    pub fn map_residuals(&mut self, map: impl Fn(usize) -> Matrix3<f64>) {
        self.change_residuals(|node, vector| map(node).cast::<f32>() * vector);
    }

    fn change_residuals(&mut self, change: impl Fn(usize, Vector3<f32>) -> Vector3<f32>) {
        let lists = [
            &mut self.open_residual,
            &mut self.close_residual,
            &mut self.pair,
        ];
        for list in lists {
            for (node, vector) in list.iter_mut().enumerate() {
                *vector = change(node, *vector);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hinge() -> JawHinge {
        JawHinge {
            center: Point::new(0.0, 0.0, -20.0),
            axis: Vector::x(),
            open_angle: 0.4,
            forward: Vector::new(0.0, -1.0, 5.0),
            left: Vector::new(4.0, 0.0, 0.0),
        }
    }

    #[test]
    fn a_node_that_turns_rigidly_takes_part_fully() {
        let hinge = hinge();
        let p = Point::new(5.0, -40.0, 60.0);
        let moved = hinge.center + turn(&hinge, hinge.open_angle) * (p - hinge.center);
        let open = [(moved - p).cast::<f32>()];
        let field = JawField::split(&hinge, &[p], Some(&open), None).unwrap();
        assert!(field.open[0] > 0.99);
        assert!(field.open_residual[0].norm() < 0.1);
    }

    #[test]
    fn split_parts_add_up_to_the_template_at_weight_one() {
        let hinge = hinge();
        let p = Point::new(5.0, -40.0, 60.0);
        let open = Vector3::new(0.5f32, -20.0, -9.0);
        let close = Vector3::new(0.2f32, 18.0, 5.0);
        let field = JawField::split(&hinge, &[p], Some(&[open]), Some(&[close])).unwrap();
        let at = |share: f32, rest: Vector3<f32>| {
            hinge.center
                + turn(&hinge, hinge.open_angle * f64::from(share)) * (p - hinge.center)
                + rest.cast::<f64>()
        };
        let opened = at(field.open[0], field.open_residual[0]);
        assert!((opened - p - open.cast::<f64>()).norm() < 1e-4);
        let both = at(
            field.open[0] - field.close[0],
            field.open_residual[0] + field.close_residual[0] + field.pair[0],
        );
        assert!((both - p - (open + close).cast::<f64>()).norm() < 1e-4);
    }

    #[test]
    fn the_mandible_opens_and_slides() {
        let hinge = hinge();
        let shapes = JawShapes {
            open: Some(0),
            right: Some(1),
            ..JawShapes::default()
        };
        let pose = JawPose::at(&hinge, &shapes, 1.5, &[0.5, 1.0]);
        assert!((pose.angle - 0.2).abs() < 1e-12);
        assert!((pose.slide - Vector::new(-6.0, 0.0, 0.0)).norm() < 1e-12);
        let (rotation, translation) = pose.affine(&hinge);
        let fixed = rotation * hinge.center.coords + translation;
        assert!((fixed - hinge.center.coords - pose.slide).norm() < 1e-9);
    }
}
