//! Eq. 3 on one patch: where the muscle shapes want its nodes, and how fast that moves.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::machine::vectorized;
use crate::template::{EyeSocket, JawHinge};
use crate::transfer::{JawField, JawMode, JawShapes, LidField, MuscleShape};

/// Weights of the template's shapes, and how fast they change.
#[derive(Debug, Clone, Copy)]
pub struct ShapeWeights<'a> {
    /// Weight of each template shape.
    pub weights: &'a [f32],
    /// Rate of each weight, same length. (1/s)
    pub rates: Option<&'a [f32]>,
}

impl ShapeWeights<'_> {
    fn of(&self, shape: u32) -> (f32, f32) {
        let i = shape as usize;
        (self.weights[i], self.rates.map_or(0.0, |r| r[i]))
    }
}

/// What all patches of a face share.
#[derive(Debug, Clone, Copy)]
pub struct TransferContext<'a> {
    /// The hinge of this face.
    pub hinge: &'a JawHinge,
    /// Which shapes move it.
    pub jaw_shapes: &'a JawShapes,
    /// Straight or hinged.
    pub jaw_mode: JawMode,
    /// The eyes of this face.
    pub eyes: &'a [EyeSocket; 2],
}

/// The muscle shapes of one patch, put on a face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PatchTransfer {
    /// Amplitude of this patch against the template's, alpha_p of Eq. 3.
    pub alpha: f64,
    /// Shapes that move the patch.
    pub shapes: Vec<MuscleShape>,
    /// What it does under the jaw.
    pub jaw: Option<JawField>,
    /// What it does over an eyeball.
    pub lids: Option<LidField>,
    /// Shapes that an edit holds on this patch at a weight of its own, whatever the face
    /// does. Not part of a rig file: edits stand beside it.
    #[serde(skip)]
    pub held: Vec<(u32, f32)>,
}

impl PatchTransfer {
    /// Weight and rate of a shape on this patch.
    fn weight_of(&self, shape: u32, at: ShapeWeights<'_>) -> (f32, f32) {
        match self.held.iter().find(|(held, _)| *held == shape) {
            Some(&(_, weight)) => (weight, 0.0),
            None => at.of(shape),
        }
    }

    /// Evaluates Eq. 3 with the hinge and the lids.
    ///
    /// - `neutral`: b_0 (mm); `positions`: receives X (mm); `velocities`: receives dX/dt
    ///   (mm/s), zero where `at` has no rates. All of one length, the patch's node count.
    ///
    /// With all weights zero and no shape held, X equals b_0 bit for bit.
    pub fn evaluate(
        &self,
        context: &TransferContext<'_>,
        neutral: &[Point3<f32>],
        at: ShapeWeights<'_>,
        positions: &mut [Point3<f32>],
        velocities: &mut [Vector3<f32>],
    ) {
        positions.copy_from_slice(neutral);
        velocities.fill(Vector3::zeros());
        let active: Vec<(usize, f32, f32)> = self
            .shapes
            .iter()
            .enumerate()
            .map(|(i, s)| {
                let (weight, rate) = self.weight_of(s.shape, at);
                (i, weight, rate)
            })
            .filter(|&(_, weight, rate)| weight != 0.0 || rate != 0.0)
            .collect();
        if active.is_empty() {
            return;
        }
        let alpha = self.alpha as f32;
        let jaw = match context.jaw_mode {
            JawMode::Hinge => self.jaw.as_ref(),
            JawMode::Linear => None,
        };
        let is_hinged = |shape: u32| {
            let shape = Some(shape);
            jaw.is_some() && (shape == context.jaw_shapes.open || shape == context.jaw_shapes.close)
        };
        for &(i, weight, rate) in &active {
            let shape = &self.shapes[i];
            if !is_hinged(shape.shape) {
                vectorized(AddShape {
                    deltas: bytemuck::cast_slice(&shape.deltas),
                    by: [alpha * weight, alpha * rate],
                    positions: bytemuck::cast_slice_mut(positions),
                    velocities: bytemuck::cast_slice_mut(velocities),
                });
            }
        }
        if let Some(jaw) = jaw {
            let weight_of =
                |shape: Option<u32>| shape.map_or((0.0, 0.0), |shape| self.weight_of(shape, at));
            let open = weight_of(context.jaw_shapes.open);
            let close = weight_of(context.jaw_shapes.close);
            if open != (0.0, 0.0) || close != (0.0, 0.0) {
                turn_with_jaw(
                    jaw,
                    context.hinge,
                    alpha,
                    open,
                    close,
                    positions,
                    velocities,
                );
            }
        }
        if let Some(lids) = &self.lids {
            for lid in &lids.nodes {
                let (mut change, mut change_rate) = (0.0, 0.0);
                for &(i, weight, rate) in &active {
                    change += weight * lid.radius_changes[i];
                    change_rate += rate * lid.radius_changes[i];
                }
                let center = context.eyes[lid.eye as usize].center.cast::<f32>();
                let n = lid.node as usize;
                lid.slide(
                    &center,
                    &mut positions[n],
                    &mut velocities[n],
                    change,
                    change_rate,
                );
            }
        }
    }
}

/// Adds a shape to positions and velocities, number by number.
struct AddShape<'a> {
    deltas: &'a [f32],
    by: [f32; 2],
    positions: &'a mut [f32],
    velocities: &'a mut [f32],
}

impl pulp::NullaryFnOnce for AddShape<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let [weight, rate] = self.by;
        let moved = self.positions.iter_mut().zip(self.velocities);
        for ((x, v), delta) in moved.zip(self.deltas) {
            *x += delta * weight;
            *v += delta * rate;
        }
    }
}

/// `x -> c + R(phi)(x - c) + alpha (w_o r_o + w_c r_c + w_o w_c pair)` and its rate, with
/// `phi = theta (w_o m_o - w_c m_c)`.
pub(super) fn turn_with_jaw(
    jaw: &JawField,
    hinge: &JawHinge,
    alpha: f32,
    (open, open_rate): (f32, f32),
    (close, close_rate): (f32, f32),
    positions: &mut [Point3<f32>],
    velocities: &mut [Vector3<f32>],
) {
    let center = hinge.center.cast::<f32>();
    let axis = hinge.axis.normalize().cast::<f32>();
    let theta = hinge.open_angle as f32;
    let pair_rate = open_rate * close + open * close_rate;
    for (n, (x, v)) in positions.iter_mut().zip(velocities).enumerate() {
        let angle = theta * (open * jaw.open[n] - close * jaw.close[n]);
        let angle_rate = theta * (open_rate * jaw.open[n] - close_rate * jaw.close[n]);
        if angle != 0.0 || angle_rate != 0.0 {
            let (sin, cos) = angle.sin_cos();
            let rotate = |a: Vector3<f32>| {
                a * cos + axis.cross(&a) * sin + axis * (axis.dot(&a) * (1.0 - cos))
            };
            let arm = rotate(*x - center);
            *x = center + arm;
            *v = rotate(*v) + axis.cross(&arm) * angle_rate;
        }
        *x += (jaw.open_residual[n] * open
            + jaw.close_residual[n] * close
            + jaw.pair[n] * (open * close))
            * alpha;
        *v += (jaw.open_residual[n] * open_rate
            + jaw.close_residual[n] * close_rate
            + jaw.pair[n] * pair_rate)
            * alpha;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Point, Vector};

    /// A patch of two nodes: a chin and a lid, moved by jaw, closing, blink and a smile.
    struct Fixture {
        hinge: JawHinge,
        jaw_shapes: JawShapes,
        eyes: [EyeSocket; 2],
        nodes: Vec<Point>,
        transfer: PatchTransfer,
    }

    fn fixture() -> Fixture {
        let hinge = JawHinge {
            center: Point::new(0.0, -5.0, -10.0),
            axis: Vector::x(),
            open_angle: 0.45,
            forward: Vector::z(),
            left: Vector::x(),
        };
        let eyes = [32.0, -32.0].map(|x| EyeSocket {
            center: Point::new(x, 10.0, 60.0),
            radius: 12.0,
            look_angles: [0.5; 4],
        });
        let nodes = vec![Point::new(3.0, -80.0, 70.0), Point::new(33.0, 16.0, 71.5)];
        let deltas: [[[f32; 3]; 2]; 4] = [
            [[0.0, -28.0, -38.0], [0.0, 0.2, 0.0]],
            [[0.0, 20.0, 4.0], [0.0, 0.1, 0.0]],
            [[0.0, 0.0, 0.1], [0.5, -11.0, 0.5]],
            [[2.0, 3.0, -1.0], [0.0, 1.0, 0.7]],
        ];
        let shapes: Vec<MuscleShape> = deltas
            .iter()
            .enumerate()
            .map(|(i, d)| MuscleShape {
                name: format!("patch.{i}"),
                shape: i as u32,
                deltas: d.iter().map(|&d| d.into()).collect(),
            })
            .collect();
        let jaw = JawField::split(
            &hinge,
            &nodes,
            Some(&shapes[0].deltas),
            Some(&shapes[1].deltas),
        );
        let lids = LidField::new(&nodes, &eyes, &nodes, &eyes, &shapes, |_, _| 1.0);
        Fixture {
            hinge,
            jaw_shapes: JawShapes {
                open: Some(0),
                close: Some(1),
                ..JawShapes::default()
            },
            eyes,
            nodes,
            transfer: PatchTransfer {
                alpha: 1.0,
                shapes,
                jaw,
                lids,
                held: Vec::new(),
            },
        }
    }

    impl Fixture {
        fn at(&self, weights: &[f32], rates: &[f32]) -> (Vec<Point3<f32>>, Vec<Vector3<f32>>) {
            let context = TransferContext {
                hinge: &self.hinge,
                jaw_shapes: &self.jaw_shapes,
                jaw_mode: JawMode::Hinge,
                eyes: &self.eyes,
            };
            let neutral: Vec<Point3<f32>> = self.nodes.iter().map(|p| p.cast()).collect();
            let mut positions = neutral.clone();
            let mut velocities = vec![Vector3::zeros(); neutral.len()];
            let weights = ShapeWeights {
                weights,
                rates: Some(rates),
            };
            self.transfer
                .evaluate(&context, &neutral, weights, &mut positions, &mut velocities);
            (positions, velocities)
        }
    }

    #[test]
    fn every_shape_is_exact_at_weight_one_on_the_template() {
        let f = fixture();
        for shape in 0..4 {
            let mut weights = [0.0; 4];
            weights[shape] = 1.0;
            let (positions, _) = f.at(&weights, &[0.0; 4]);
            for n in 0..2 {
                let want = f.nodes[n].cast::<f32>() + f.transfer.shapes[shape].deltas[n];
                assert!(
                    (positions[n] - want).norm() < 1e-3,
                    "shape {shape} node {n}"
                );
            }
        }
    }

    #[test]
    fn the_neutral_stays_bit_for_bit() {
        let f = fixture();
        let (positions, velocities) = f.at(&[0.0; 4], &[0.0; 4]);
        for n in 0..2 {
            assert_eq!(positions[n], f.nodes[n].cast::<f32>());
            assert_eq!(velocities[n], Vector3::zeros());
        }
    }

    #[test]
    fn a_half_open_jaw_lies_on_the_arc() {
        let f = fixture();
        let (half, _) = f.at(&[0.5, 0.0, 0.0, 0.0], &[0.0; 4]);
        let straight = f.nodes[0].cast::<f32>() + f.transfer.shapes[0].deltas[0] * 0.5;
        let bulge = (half[0] - straight).norm();
        assert!(
            (1.5..3.5).contains(&bulge),
            "arc leaves the chord by {bulge} mm"
        );
    }

    #[test]
    fn velocities_are_the_derivative_of_positions() {
        let f = fixture();
        let weights = [0.6f32, 0.3, 0.5, 0.4];
        let rates = [2.0f32, -1.0, 3.0, 1.5];
        let (_, velocities) = f.at(&weights, &rates);
        let h = 2e-3f32;
        let step = |sign: f32| {
            let moved: Vec<f32> = weights
                .iter()
                .zip(rates)
                .map(|(w, r)| w + sign * h * r)
                .collect();
            f.at(&moved, &[0.0; 4]).0
        };
        let (ahead, behind) = (step(1.0), step(-1.0));
        for n in 0..2 {
            let numeric = (ahead[n] - behind[n]) / (2.0 * h);
            let error = (numeric - velocities[n]).norm();
            assert!(error < 1e-3 * numeric.norm() + 0.02, "node {n}: {error}");
        }
    }
}
