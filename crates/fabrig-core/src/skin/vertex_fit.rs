//! The least squares of one vertex: which nodes move it, and how much.

use nalgebra::{DMatrix, DVector, Point3};

use crate::skin::active_set::{Sign, solve_signed};
use crate::skin::{Candidate, FitOptions, Pose, kernel};

/// Weights below this are taken for zero.
const LEAST_WEIGHT: f64 = 1e-3;
/// A shape that moves a vertex by less leaves it still. (mm)
const STILL: f32 = 0.05;

/// What one vertex may hang on.
pub(super) struct Choice {
    vertex: usize,
    point: Point3<f32>,
    /// Nodes, rising, and the mandible at last.
    pub(super) candidates: Vec<Candidate>,
    /// The kernel's weight of each candidate.
    pub(super) prior: Vec<f64>,
    /// Inner skin may hang on differences between nodes.
    is_inner: bool,
}

impl Choice {
    /// Nodes that a vertex at `point` may hang on, and the `mandible`.
    pub(super) fn new(
        vertex: usize,
        point: Point3<f32>,
        mut candidates: Vec<Candidate>,
        mandible: u32,
        is_inner: bool,
        options: &FitOptions,
    ) -> Self {
        let distances: Vec<f64> = candidates.iter().map(|c| c.distance).collect();
        let mut prior = kernel::weights(&distances, options.reach);
        candidates.push(Candidate {
            node: mandible,
            distance: 0.0,
        });
        prior.push(0.0);
        Self {
            vertex,
            point,
            candidates,
            prior,
            is_inner,
        }
    }

    /// Fits the weights to the poses, pulled towards `prior`.
    ///
    /// - `last`: an answer near to this one, to start from
    pub(super) fn fit(
        &self,
        poses: &[Pose],
        prior: &[f64],
        last: &[(u32, f32)],
        options: &FitOptions,
    ) -> Vec<(u32, f32)> {
        let (mut normal, mut rhs) = self.normal_equations(poses, options.still_factor);
        for (i, prior) in prior.iter().enumerate() {
            normal[(i, i)] += options.ridge;
            rhs[i] += options.ridge * prior;
        }
        let mut start = DVector::zeros(self.candidates.len());
        for &(node, weight) in last {
            if let Ok(i) = self.candidates.binary_search_by_key(&node, |c| c.node) {
                start[i] = f64::from(weight);
            }
        }
        let weights = if self.is_inner {
            let price = options.inner_price;
            solve_signed(&normal, &rhs, Sign::Either { price }, start)
        } else {
            solve_convex(normal, rhs, start)
        };
        self.candidates
            .iter()
            .zip(weights.iter())
            .filter(|(_, w)| w.abs() > LEAST_WEIGHT)
            .map(|(c, w)| (c.node, *w as f32))
            .collect()
    }

    /// Keeps the largest weights; what the others of outer skin held goes to them.
    pub(super) fn keep_largest(&self, weights: &mut Vec<(u32, f32)>, options: &FitOptions) {
        let limit = if self.is_inner {
            options.inner_node_limit
        } else {
            options.node_limit
        };
        if weights.len() <= limit {
            return;
        }
        let before: f32 = weights.iter().map(|w| w.1).sum();
        weights.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
        weights.truncate(limit);
        if !self.is_inner {
            let after: f32 = weights.iter().map(|w| w.1).sum();
            for weight in weights.iter_mut() {
                weight.1 *= before / after;
            }
        }
        weights.sort_by_key(|w| w.0);
    }

    /// `N_jk = sum_i c_i g_ij . g_ik` and `b_j = sum_i c_i g_ij . d_i`, where poses that leave
    /// the vertex still count `still_factor` times.
    fn normal_equations(&self, poses: &[Pose], still_factor: f64) -> (DMatrix<f64>, DVector<f64>) {
        let count = self.candidates.len();
        let mut lower = vec![0.0f64; count * count];
        let mut rhs = DVector::zeros(count);
        let mut motions = vec![[0.0f64; 3]; count];
        let mut row = vec![0.0f64; count];
        for pose in poses {
            let mut moves = false;
            for (motion, candidate) in motions.iter_mut().zip(&self.candidates) {
                let displacement = pose.affines[candidate.node as usize].displacement(&self.point);
                moves |= displacement.norm_squared() > 1e-10;
                *motion = displacement.cast().into();
            }
            if !moves {
                continue;
            }
            let wanted = pose.displacements[self.vertex];
            let factor = if wanted.norm() < STILL {
                still_factor
            } else {
                1.0
            };
            for axis in 0..3 {
                for (entry, motion) in row.iter_mut().zip(&motions) {
                    *entry = motion[axis];
                }
                for i in 0..count {
                    let scaled = factor * row[i];
                    rhs[i] += scaled * f64::from(wanted[axis]);
                    let line = &mut lower[i * count..=i * count + i];
                    for (entry, motion) in line.iter_mut().zip(&row) {
                        *entry += scaled * motion;
                    }
                }
            }
        }
        let normal = DMatrix::from_fn(count, count, |i, j| lower[i.max(j) * count + i.min(j)]);
        (normal, rhs)
    }
}

/// Non-negative weights that sum to one at most.
fn solve_convex(
    mut normal: DMatrix<f64>,
    mut rhs: DVector<f64>,
    start: DVector<f64>,
) -> DVector<f64> {
    let weights = solve_signed(&normal, &rhs, Sign::NonNegative, start);
    let total = weights.sum();
    if total <= 1.0 {
        return weights;
    }
    // Hold the sum at one by a stiff row, then exactly by scaling.
    let stiff = 1e3 * normal.diagonal().max().max(1.0);
    rhs.add_scalar_mut(stiff);
    normal.add_scalar_mut(stiff);
    let mut weights = solve_signed(&normal, &rhs, Sign::NonNegative, weights / total);
    let total = weights.sum();
    if total > 1.0 {
        weights /= total;
    }
    weights
}
