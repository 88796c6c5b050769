//! Amplitudes fitted to a face's own expressions: alpha of Eq. 3 where there are examples.
//!
//! An example is an expression of this face with the weights that make it. On each patch, with
//! `S_k` what the muscle shapes say of example `k` and `Y_k` what it does:
//!
//! `alpha = (sum_k <S_k, Y_k> + r a) / (sum_k <S_k, S_k> + r)`,
//!
//! the closed form of Zhu & Joslin 2024, section 3.3, drawn to the amplitude `a` that there
//! would be without examples: `r` is the variance of an observed node over that of amplitudes.
//! One amplitude a patch and shape solves the same for all shapes of a patch at once, drawn to
//! the amplitude of the patch.
//!
//! What the jaw turns is no matter of amplitude: the angle of its hinge is fitted first, and the
//! turn taken off. Linear maps come with shares of the turn and of the straight displacement.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::fit_jaw::{TURN_ALONE, fit_jaw, jaw_motion};
use super::{ALPHA_LIMITS, JawField, JawShapes, MuscleShape};
use crate::template::JawHinge;
use crate::{Point, Vector};

/// Error of an observed node: registration, and what no amplitude can say. (mm)
const OBSERVATION_ERROR: f64 = 0.3;
/// How far amplitudes of people differ from what their size says (standard deviation).
const ALPHA_SPREAD: f64 = 0.3;
/// Nodes that err together count as one: some 8 mm of a grid.
const NODES_PER_OBSERVATION: f64 = 10.0;

/// How many amplitudes there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlphaMode {
    /// The size of each patch against the template's; examples are not looked at.
    Size,
    /// One a patch (the paper).
    Patch,
    /// One a patch and shape.
    PatchAndShape,
    /// A linear map instead of an amplitude, smooth over the skin.
    Map,
    /// The face's own shapes as they are, and [`AlphaMode::Map`] for those that it lacks.
    #[default]
    Own,
}

/// Amplitudes of all patches.
#[derive(Debug, Clone, PartialEq)]
pub struct Amplitudes {
    /// Alpha of each patch.
    pub by_patch: Vec<f64>,
    /// Alpha of each of its shapes, in the order of its muscle shapes.
    pub by_shape: Vec<Vec<f64>>,
    /// How each patch goes with the jaw: share of the turn of the hinge, and of the straight
    /// displacement that the template draws.
    pub jaw: Vec<[f64; 2]>,
}

impl Amplitudes {
    /// One alpha for all shapes of each patch, and the jaw's turn as it is.
    pub fn even(by_patch: Vec<f64>, shapes: &[Vec<MuscleShape>]) -> Self {
        let pairs = by_patch.iter().zip(shapes);
        let by_shape = pairs.map(|(a, s)| vec![*a; s.len()]).collect();
        let jaw = vec![TURN_ALONE; by_patch.len()];
        Self {
            by_patch,
            by_shape,
            jaw,
        }
    }
}

/// One patch of a face before any amplitude.
#[derive(Debug, Clone, Copy)]
pub struct PatchEvidence<'a> {
    /// Nodes at rest. (mm)
    pub neutral: &'a [Point],
    /// Its muscle shapes. (mm)
    pub shapes: &'a [MuscleShape],
    /// What it does under the jaw.
    pub jaw: Option<&'a JawField>,
    /// Amplitude without examples.
    pub prior: f64,
}

impl PatchEvidence<'_> {
    /// Ridge of a patch. (mm^2)
    pub(super) fn ridge(&self) -> f64 {
        let ratio = OBSERVATION_ERROR / ALPHA_SPREAD;
        self.neutral.len() as f64 / NODES_PER_OBSERVATION * ratio * ratio
    }

    /// Straight displacement of a node by a shape, at the prior amplitude. (mm)
    pub(super) fn straight(&self, shape: Option<u32>) -> impl Fn(usize) -> Vector {
        let drawn = self.shapes.iter().find(|s| Some(s.shape) == shape);
        move |n| drawn.map_or_else(Vector::zeros, |s| s.deltas[n].cast::<f64>() * self.prior)
    }
}

/// What examples do to the nodes of every patch.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Weights of the template's shapes.
    pub weights: Vec<f32>,
    /// Displacements where they are known, shape `[patch_count][node_count]`. (mm)
    pub deltas: Vec<Vec<Option<Vector>>>,
}

/// Fits the amplitudes of all patches.
///
/// - `hinge`: with the angle of [`fit_open_angle`](super::fit_open_angle)
pub fn fit_alphas(
    hinge: &JawHinge,
    jaw: &JawShapes,
    patches: &[PatchEvidence<'_>],
    observations: &[Observation],
    mode: AlphaMode,
) -> Amplitudes {
    let fitted: Vec<(f64, Vec<f64>)> = patches
        .par_iter()
        .enumerate()
        .map(|(p, patch)| match mode {
            AlphaMode::Size | AlphaMode::Map | AlphaMode::Own => {
                (patch.prior, vec![patch.prior; patch.shapes.len()])
            }
            AlphaMode::Patch => {
                let alpha = Normal::of(patch, p, hinge, jaw, observations).one_alpha(patch);
                (alpha, vec![alpha; patch.shapes.len()])
            }
            AlphaMode::PatchAndShape => {
                let normal = Normal::of(patch, p, hinge, jaw, observations);
                let alpha = normal.one_alpha(patch);
                (alpha, normal.alphas(patch, alpha))
            }
        })
        .collect();
    let (by_patch, by_shape) = fitted.into_iter().unzip();
    Amplitudes {
        by_patch,
        by_shape,
        // Amplitudes leave the turn to the hinge: with them, neighbours that share it otherwise
        // pull the chin too far.
        jaw: if mode == AlphaMode::Map {
            fit_jaw(hinge, jaw, patches, observations)
        } else {
            vec![TURN_ALONE; patches.len()]
        },
    }
}

/// The normal equations of one patch: `A_ij = sum_k w_ki w_kj <Db_i, Db_j>`,
/// `b_i = sum_k w_ki <Db_i, Y_k>`.
struct Normal {
    a: DMatrix<f64>,
    b: DVector<f64>,
}

impl Normal {
    fn of(
        patch: &PatchEvidence<'_>,
        place: usize,
        hinge: &JawHinge,
        jaw: &JawShapes,
        observations: &[Observation],
    ) -> Self {
        let count = patch.shapes.len();
        let is_hinged = |shape: u32| {
            patch.jaw.is_some() && (Some(shape) == jaw.open || Some(shape) == jaw.close)
        };
        let mut normal = Self {
            a: DMatrix::zeros(count, count),
            b: DVector::zeros(count),
        };
        for o in observations {
            let weight = |shape: Option<u32>| shape.map_or(0.0, |s| o.weights[s as usize]);
            let active: Vec<(usize, f64)> = (0..count)
                .filter(|&i| !is_hinged(patch.shapes[i].shape))
                .map(|i| (i, f64::from(o.weights[patch.shapes[i].shape as usize])))
                .filter(|(_, w)| *w != 0.0)
                .collect();
            if active.is_empty() {
                continue;
            }
            let turned = patch
                .jaw
                .map(|field| jaw_motion(patch, field, hinge, weight(jaw.open), weight(jaw.close)));
            let seen = &o.deltas[place];
            let left = |n: usize| {
                let turned = turned.as_ref().map_or_else(Vector::zeros, |t| t[n]);
                seen[n].map_or_else(Vector::zeros, |y| y - turned)
            };
            let dot = |i: usize, with: &dyn Fn(usize) -> Vector| -> f64 {
                let deltas = patch.shapes[i].deltas.iter().enumerate();
                let known = deltas.filter(|(n, _)| seen[*n].is_some());
                known.map(|(n, d)| d.cast::<f64>().dot(&with(n))).sum()
            };
            for &(i, wi) in &active {
                normal.b[i] += wi * dot(i, &left);
                for &(j, wj) in &active {
                    let other = |n: usize| patch.shapes[j].deltas[n].cast::<f64>();
                    normal.a[(i, j)] += wi * wj * dot(i, &other);
                }
            }
        }
        normal
    }

    fn one_alpha(&self, patch: &PatchEvidence<'_>) -> f64 {
        let ridge = patch.ridge();
        limited((self.b.sum() + ridge * patch.prior) / (self.a.sum() + ridge))
    }

    fn alphas(&self, patch: &PatchEvidence<'_>, alpha: f64) -> Vec<f64> {
        let ridge = patch.ridge();
        let count = self.b.len();
        let a = &self.a + DMatrix::identity(count, count) * ridge;
        let b = &self.b + DVector::repeat(count, ridge * alpha);
        match a.cholesky() {
            Some(factor) => factor.solve(&b).iter().map(|x| limited(*x)).collect(),
            None => vec![alpha; count],
        }
    }
}

fn limited(alpha: f64) -> f64 {
    if alpha.is_finite() {
        alpha.clamp(ALPHA_LIMITS[0], ALPHA_LIMITS[1])
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::fit_open_angle;
    use crate::transfer::fixtures::{hinge, nodes, shape};

    #[test]
    fn amplitudes_are_found_again_shape_by_shape_and_without_examples_stay() {
        let neutral = nodes(40);
        let wave = |phase: f32| -> Vec<[f32; 3]> {
            (0..40)
                .map(|i| [3.0 * (i as f32 * 0.3 + phase).sin(), 2.0, -1.0])
                .collect()
        };
        let shapes = [
            shape(0, &wave(0.0)),
            shape(1, &wave(1.5)),
            shape(2, &wave(3.0)),
        ];
        let patch = PatchEvidence {
            neutral: &neutral,
            shapes: &shapes,
            jaw: None,
            prior: 1.0,
        };
        let truth = [1.4, 0.7];
        // Two mixed examples of two shapes; the third is never seen.
        let observations: Vec<Observation> = [[1.0f32, 0.5, 0.0], [0.2, 1.0, 0.0]]
            .map(|weights| Observation {
                weights: weights.to_vec(),
                deltas: vec![
                    (0..40)
                        .map(|n| {
                            let parts = (0..2).map(|i| {
                                shapes[i].deltas[n].cast::<f64>()
                                    * (truth[i] * f64::from(weights[i]))
                            });
                            (n % 5 != 0).then(|| parts.sum())
                        })
                        .collect(),
                ],
            })
            .to_vec();
        let fit = |observations: &[Observation], mode| {
            fit_alphas(
                &hinge(),
                &JawShapes::default(),
                &[patch],
                observations,
                mode,
            )
        };
        let found = fit(&observations, AlphaMode::PatchAndShape);
        for (found, truth) in found.by_shape[0].iter().zip(truth) {
            assert!((found - truth).abs() < 0.03, "{found} is not {truth}");
        }
        assert!((found.by_shape[0][2] - found.by_patch[0]).abs() < 1e-9);
        let one = fit(&observations, AlphaMode::Patch).by_patch[0];
        assert!((0.7..1.4).contains(&one));
        for mode in [AlphaMode::Size, AlphaMode::Patch, AlphaMode::PatchAndShape] {
            let still = fit(&[], mode);
            assert_eq!(still.by_patch, [1.0]);
            assert_eq!(still.by_shape, [[1.0; 3]]);
        }
    }

    #[test]
    fn the_hinge_opens_as_far_as_the_example_does() {
        let neutral = nodes(30);
        let own = hinge();
        let jaw = JawShapes {
            open: Some(0),
            ..JawShapes::default()
        };
        let turned = |angle: f64| -> Vec<Vector> {
            let turn = nalgebra::Rotation3::from_axis_angle(
                &nalgebra::Unit::new_normalize(own.axis),
                angle,
            );
            neutral
                .iter()
                .map(|p| own.center + turn * (p - own.center) - p)
                .collect()
        };
        let open: Vec<nalgebra::Vector3<f32>> =
            turned(own.open_angle).iter().map(|d| d.cast()).collect();
        let field = JawField::split(&own, &neutral, Some(&open), None).unwrap();
        let shapes = [MuscleShape {
            name: "p.0".into(),
            shape: 0,
            deltas: open,
        }];
        let patch = PatchEvidence {
            neutral: &neutral,
            shapes: &shapes,
            jaw: Some(&field),
            prior: 1.0,
        };
        let seen = Observation {
            weights: vec![1.0],
            deltas: vec![turned(0.3).into_iter().map(Some).collect()],
        };
        let angle = fit_open_angle(&own, &jaw, &[patch], &[seen]);
        assert!((angle - 0.3).abs() < 2e-3, "{angle}");
        assert_eq!(fit_open_angle(&own, &jaw, &[patch], &[]), own.open_angle);
    }
}
