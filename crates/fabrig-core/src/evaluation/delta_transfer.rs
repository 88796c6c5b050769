//! Whole-face delta transfer, the yardstick: `y = y_0 + s sum_k w_k (b_k - b_0)` at the places
//! where the registration puts the vertices of a mesh, with `s` the ratio of head sizes.

use nalgebra::{DMatrix, DVector};

use crate::mesh::SurfacePoint;
use crate::retarget::{BoxQp, RetargetError, solve_box_qp};
use crate::template::Template;
use crate::{Point, Vector};

/// Prior of fitted weights, as in a fit of one frame: `r = s^2 / (N b^2)` with noise of 0.01 mm
/// and weights of 0.35, times N.
const RIDGE: f64 = 0.01 * 0.01 / (0.35 * 0.35);

/// Delta transfer onto one face.
pub(super) struct DeltaTransfer {
    /// Displacements of the mesh by each shape at weight 1 and scale 1. (mm)
    deltas: Vec<Vec<Vector>>,
    /// s
    pub(super) scale: f64,
}

impl DeltaTransfer {
    /// - `positions`: the face in the template's topology (mm)
    /// - `places`: of the mesh's vertices on the template
    pub(super) fn new(template: &Template, positions: &[Point], places: &[SurfacePoint]) -> Self {
        let triangles = template.skin.triangles();
        let deltas = template
            .shapes
            .iter()
            .map(|shape| {
                let whole = shape.spread(positions.len());
                let at = |place: &SurfacePoint| {
                    let corners = triangles[place.triangle as usize].iter();
                    let shares = corners.zip(place.barycentric);
                    shares.map(|(&v, share)| whole[v as usize] * share).sum()
                };
                places.iter().map(at).collect()
            })
            .collect();
        Self {
            deltas,
            scale: size(positions) / size(template.skin.positions()),
        }
    }

    /// Displacements of the mesh. (mm)
    pub(super) fn displacements(&self, weights: &[f32]) -> Vec<Vector> {
        let mut sum = vec![Vector::zeros(); self.deltas[0].len()];
        for (deltas, &weight) in self.deltas.iter().zip(weights) {
            if weight == 0.0 {
                continue;
            }
            for (sum, delta) in sum.iter_mut().zip(deltas) {
                *sum += delta * (self.scale * f64::from(weight));
            }
        }
        sum
    }

    /// The scale that fits examples best, given as weights and displacements.
    pub(super) fn fitted_scale(&self, examples: &[(&[f32], &[Vector])]) -> f64 {
        let (mut dot, mut norm) = (0.0, 0.0);
        for (weights, wanted) in examples {
            for (own, wanted) in self.displacements(weights).iter().zip(*wanted) {
                dot += own.dot(wanted);
                norm += own.norm_squared();
            }
        }
        if norm > 0.0 {
            self.scale * dot / norm
        } else {
            self.scale
        }
    }

    /// The weights in [0, 1] that come nearest to displacements of some vertices.
    pub(super) fn best_fit(
        &self,
        wanted: &[Vector],
        vertices: &[usize],
    ) -> Result<Vec<f32>, RetargetError> {
        let count = self.deltas.len();
        let column =
            |shape: usize, row: usize| self.scale * self.deltas[shape][vertices[row / 3]][row % 3];
        let basis = DMatrix::from_fn(3 * vertices.len(), count, |row, shape| column(shape, row));
        let target = DVector::from_fn(3 * vertices.len(), |row, _| {
            wanted[vertices[row / 3]][row % 3]
        });
        let problem = BoxQp {
            hessian: basis.tr_mul(&basis) + DMatrix::identity(count, count) * RIDGE,
            linear: basis.tr_mul(&target),
        };
        let solution = solve_box_qp(&problem, &DVector::zeros(count))?;
        Ok(solution.weights.iter().map(|w| *w as f32).collect())
    }
}

/// Root mean square distance from the middle. (mm)
pub(super) fn size(points: &[Point]) -> f64 {
    let count = points.len() as f64;
    let middle = points.iter().map(|p| p.coords).sum::<Vector>() / count;
    let sum: f64 = points
        .iter()
        .map(|p| (p.coords - middle).norm_squared())
        .sum();
    (sum / count).sqrt()
}
