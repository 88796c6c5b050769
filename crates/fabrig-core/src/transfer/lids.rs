//! Lids slide over the eyeball.
//!
//! A straight line from an open to a closed lid cuts through the eyeball by 1-2 mm half way.
//! Nodes near an eye keep the direction (seen from the eye's centre) that the sum of shapes
//! gives them, but their distance from the centre follows its own straight line:
//!
//! `X = c + (r_0 + alpha sum_i w_i Dr_i) * dir(x - c)`
//!
//! with `Dr_i` the change of distance that shape `i` makes on the template. On the template
//! that is the shape itself at weight 1; on another face lids keep the template's height over
//! the eye, whatever the shape of the eye.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::Point;
use crate::template::EyeSocket;
use crate::transfer::MuscleShape;

/// Height over the eyeball up to which a node slides fully, and from which not at all. (mm)
const SLIDE_HEIGHTS: [f64; 2] = [4.0, 10.0];

/// One node that slides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LidNode {
    /// Index of the node in its patch.
    pub node: u32,
    /// 0 left eye, 1 right eye.
    pub eye: u8,
    /// How much of its motion slides, in (0, 1].
    pub share: f32,
    /// Distance from the eye's centre at rest on this face. (mm)
    pub rest_radius: f32,
    /// Change of that distance at weight 1, one per shape of the patch, as displaced on this
    /// face (alpha included). (mm)
    pub radius_changes: Vec<f32>,
    /// Distance below which no sum of shapes takes it. (mm)
    pub least_radius: f32,
}

/// The sliding nodes of one patch.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct LidField {
    /// Nodes in rising order.
    pub nodes: Vec<LidNode>,
}

impl LidField {
    /// Finds the nodes of a patch that lie over an eyeball.
    ///
    /// - `template_nodes`, `template_eyes`: the patch and eyes at rest on the template (mm)
    /// - `nodes`, `eyes`: the patch and centres of rotation at rest on this face (mm)
    /// - `alpha`: amplitude of a node, by index, under a shape, by its place in `shapes`
    ///
    /// Returns `None` where there are none.
    pub fn new(
        template_nodes: &[Point],
        template_eyes: &[EyeSocket; 2],
        nodes: &[Point],
        eyes: &[EyeSocket; 2],
        shapes: &[MuscleShape],
        alpha: impl Fn(usize, usize) -> f64,
    ) -> Option<Self> {
        let mut found = Vec::new();
        for (i, p) in template_nodes.iter().enumerate() {
            for (e, socket) in template_eyes.iter().enumerate() {
                let height = (p - socket.center).norm() - socket.radius;
                let share = slide_share(height);
                if share == 0.0 || p.z < socket.center.z {
                    continue;
                }
                let rest = (p - socket.center).norm();
                let radius_changes: Vec<f32> = shapes
                    .iter()
                    .enumerate()
                    .map(|(k, s)| {
                        let moved = p + s.deltas[i].cast::<f64>() - socket.center;
                        (alpha(i, k) * (moved.norm() - rest)) as f32
                    })
                    .collect();
                let rest_radius = (nodes[i] - eyes[e].center).norm() as f32;
                let deepest = radius_changes.iter().copied().fold(0.0, f32::min);
                found.push(LidNode {
                    node: i as u32,
                    eye: e as u8,
                    share: share as f32,
                    rest_radius,
                    radius_changes,
                    least_radius: rest_radius + deepest,
                });
            }
        }
        (!found.is_empty()).then_some(Self { nodes: found })
    }
}

impl LidNode {
    /// Puts the node at its distance from the eye.
    ///
    /// - `position`, `velocity`: where the sum of shapes has it (mm), (mm/s)
    /// - `radius_change`, `radius_rate`: `sum_i w_i Dr_i` and its rate (mm), (mm/s)
    pub(super) fn slide(
        &self,
        center: &Point3<f32>,
        position: &mut Point3<f32>,
        velocity: &mut Vector3<f32>,
        radius_change: f32,
        radius_rate: f32,
    ) {
        let arm = *position - center;
        let distance = arm.norm();
        if distance < 1.0 {
            return;
        }
        let direction = arm / distance;
        let wanted = self.rest_radius + radius_change;
        let (radius, rate) = if wanted > self.least_radius {
            (wanted, radius_rate)
        } else {
            (self.least_radius, 0.0)
        };
        let along = velocity.dot(&direction);
        let turning = (*velocity - direction * along) / distance;
        *position += direction * (self.share * (radius - distance));
        *velocity += (turning * (radius - distance) + direction * (rate - along)) * self.share;
    }
}

/// 1 at and below the first height, 0 at and above the second, smooth between.
fn slide_share(height: f64) -> f64 {
    let [low, high] = SLIDE_HEIGHTS;
    let t = ((height - low) / (high - low)).clamp(0.0, 1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn eyes() -> [EyeSocket; 2] {
        [30.0, -30.0].map(|x| EyeSocket {
            center: Point::new(x, 0.0, 0.0),
            radius: 12.0,
            look_angles: [0.5; 4],
        })
    }

    #[test]
    fn half_a_blink_stays_over_the_eyeball() {
        let eyes = eyes();
        let at = |angle: f64| {
            eyes[0].center + nalgebra::Vector3::new(0.0, angle.sin(), angle.cos()) * 13.0
        };
        let (open, closed) = (at(0.6), at(-0.6));
        let shape = MuscleShape {
            name: "lid.blink".into(),
            shape: 0,
            deltas: vec![(closed - open).cast()],
        };
        let field = LidField::new(
            &[open],
            &eyes,
            &[open],
            &eyes,
            std::slice::from_ref(&shape),
            |_, _| 1.0,
        )
        .unwrap();
        let node = &field.nodes[0];
        let center = eyes[0].center.cast::<f32>();
        let mut half = open.cast::<f32>() + shape.deltas[0] * 0.5;
        assert!((half - center).norm() < 11.5);
        node.slide(
            &center,
            &mut half,
            &mut Vector3::zeros(),
            0.5 * node.radius_changes[0],
            0.0,
        );
        assert!(((half - center).norm() - 13.0).abs() < 1e-4);
    }

    #[test]
    fn nodes_far_from_the_eyes_do_not_slide() {
        let eyes = eyes();
        let p = Point::new(30.0, 30.0, 10.0);
        assert_eq!(
            LidField::new(&[p], &eyes, &[p], &eyes, &[], |_, _| 1.0),
            None
        );
    }
}
