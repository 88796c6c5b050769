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
//! What the jaw turns has amplitudes of its own: the angle of its hinge is fitted first, then how
//! far each patch goes along, by the turn and straight; for all other shapes the turn is taken off.

use nalgebra::{DMatrix, DVector, Matrix2, Point3, Vector2, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::evaluate::turn_with_jaw;
use super::{ALPHA_LIMITS, JawField, JawShapes, MuscleShape};
use crate::template::JawHinge;
use crate::{Point, Vector};

/// Error of an observed node: registration, and what no amplitude can say. (mm)
const OBSERVATION_ERROR: f64 = 0.3;
/// How far amplitudes of people differ from what their size says (standard deviation).
const ALPHA_SPREAD: f64 = 0.3;
/// Nodes that err together count as one: some 8 mm of a grid.
const NODES_PER_OBSERVATION: f64 = 10.0;
/// The hinge opens by at least and at most these shares of the template's angle.
const ANGLE_LIMITS: [f64; 2] = [0.4, 1.8];
/// Shares of turn and straight displacement without examples.
pub const TURN_ALONE: [f64; 2] = [1.0, 0.0];
/// Both lie between these.
const SHARE_LIMITS: [f64; 2] = [-1.0, 2.5];
/// An example opens the jaw that opens it by more than this.
const LEAST_OPEN: f32 = 0.2;
/// Share of the turn from which on a node tells the angle.
const TURNING_SHARE: f32 = 0.5;

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
    /// Straight displacement of a node by a shape, at the prior amplitude. (mm)
    fn straight(&self, shape: Option<u32>) -> impl Fn(usize) -> Vector {
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

/// The angle by which the hinge opens at weight 1 so that the patches turn as observed; the
/// hinge's own where no example opens the jaw. (rad)
pub fn fit_open_angle(
    hinge: &JawHinge,
    jaw: &JawShapes,
    patches: &[PatchEvidence<'_>],
    observations: &[Observation],
) -> f64 {
    let weight =
        |o: &Observation, shape: Option<u32>| shape.map_or(0.0, |shape| o.weights[shape as usize]);
    let opened: Vec<&Observation> = observations
        .iter()
        .filter(|o| weight(o, jaw.open) > LEAST_OPEN && weight(o, jaw.close) == 0.0)
        .collect();
    if opened.is_empty() {
        return hinge.open_angle;
    }
    let error = |angle: f64| -> f64 {
        let hinge = JawHinge {
            open_angle: angle,
            ..*hinge
        };
        // Summed in the order of patches, whatever the threads do.
        let by_patch: Vec<f64> = (0..patches.len())
            .into_par_iter()
            .map(|p| {
                let patch = &patches[p];
                let Some(field) = patch.jaw else { return 0.0 };
                let mut sum = 0.0;
                for o in &opened {
                    let turned = jaw_motion(patch, field, &hinge, weight(o, jaw.open), 0.0);
                    let nodes = turned.iter().zip(&o.deltas[p]).zip(&field.open);
                    sum += nodes
                        .filter(|(_, share)| **share > TURNING_SHARE)
                        .filter_map(|((t, y), _)| Some((t - (*y)?).norm_squared()))
                        .sum::<f64>();
                }
                sum
            })
            .collect();
        by_patch.iter().sum()
    };
    golden_section(
        error,
        ANGLE_LIMITS.map(|share| share * hinge.open_angle),
        1e-4,
    )
}

/// Fits the amplitudes of all patches.
///
/// - `hinge`: with the angle of [`fit_open_angle`]
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
        jaw: fit_jaw(hinge, jaw, patches, observations),
    }
}

/// How each patch goes with the jaw: `a` times the turn of the hinge and `b` times the straight
/// displacement that the template draws, the least squares of the examples that open the jaw and
/// do nothing else, drawn to the turn alone. (1, 0) without such an example.
///
/// A face whose chin is longer than the template's swings it further by the hinge; only examples
/// tell whether it does.
fn fit_jaw(
    hinge: &JawHinge,
    jaw: &JawShapes,
    patches: &[PatchEvidence<'_>],
    observations: &[Observation],
) -> Vec<[f64; 2]> {
    let opened: Vec<(&Observation, f32)> = observations
        .iter()
        .filter_map(|o| {
            let open = o.weights[jaw.open? as usize];
            let others = o.weights.iter().filter(|w| **w != 0.0).count();
            (open > LEAST_OPEN && others == 1).then_some((o, open))
        })
        .collect();
    let of_patch = |(p, patch): (usize, &PatchEvidence<'_>)| {
        let Some(field) = patch.jaw.filter(|_| !opened.is_empty()) else {
            return TURN_ALONE;
        };
        let ridge = Normal::ridge(patch);
        let mut normal = Matrix2::identity() * ridge;
        let mut rhs = Vector2::from(TURN_ALONE) * ridge;
        for (o, open) in &opened {
            let turned = jaw_motion(patch, field, hinge, *open, 0.0);
            let straight = patch.straight(jaw.open);
            let seen = o.deltas[p].iter().enumerate();
            for (n, y) in seen.filter_map(|(n, y)| Some((n, (*y)?))) {
                let (turn, line) = (turned[n], straight(n) * f64::from(*open));
                normal += Matrix2::new(
                    turn.norm_squared(),
                    turn.dot(&line),
                    turn.dot(&line),
                    line.norm_squared(),
                );
                rhs += Vector2::new(turn.dot(&y), line.dot(&y));
            }
        }
        let solved = normal.cholesky().map(|factor| factor.solve(&rhs));
        solved.map_or(TURN_ALONE, |x| {
            [0, 1].map(|k| x[k].clamp(SHARE_LIMITS[0], SHARE_LIMITS[1]))
        })
    };
    patches.par_iter().enumerate().map(of_patch).collect()
}

/// What a patch does under the jaw with shares of turn and straight displacement, node by node;
/// `None` where the jaw does not move it.
///
/// - `hinge`: with the angle of [`fit_open_angle`]
/// - `shares`: of each node, smooth over the skin: [`Amplitudes::jaw`]
pub fn jaw_with_shares(
    patch: &PatchEvidence<'_>,
    hinge: &JawHinge,
    jaw: &JawShapes,
    shares: &[[f64; 2]],
) -> Option<JawField> {
    let field = patch.jaw?;
    let mixed = |open: f32, close: f32, shape: Option<u32>| -> Vec<Vector3<f32>> {
        let straight = patch.straight(shape);
        let turned = jaw_motion(patch, field, hinge, open, close);
        let nodes = turned.iter().zip(shares).enumerate();
        nodes
            .map(|(n, (turn, [a, b]))| (turn * *a + straight(n) * *b).cast())
            .collect()
    };
    let opened = mixed(1.0, 0.0, jaw.open);
    let closed = mixed(0.0, 1.0, jaw.close);
    JawField::split(hinge, patch.neutral, Some(&opened), Some(&closed))
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

    /// Ridge of a patch. (mm^2)
    fn ridge(patch: &PatchEvidence<'_>) -> f64 {
        let ratio = OBSERVATION_ERROR / ALPHA_SPREAD;
        patch.neutral.len() as f64 / NODES_PER_OBSERVATION * ratio * ratio
    }

    fn one_alpha(&self, patch: &PatchEvidence<'_>) -> f64 {
        let ridge = Self::ridge(patch);
        limited((self.b.sum() + ridge * patch.prior) / (self.a.sum() + ridge))
    }

    fn alphas(&self, patch: &PatchEvidence<'_>, alpha: f64) -> Vec<f64> {
        let ridge = Self::ridge(patch);
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

/// Displacement of every node by the jaw alone, at the prior amplitude. (mm)
fn jaw_motion(
    patch: &PatchEvidence<'_>,
    field: &JawField,
    hinge: &JawHinge,
    open: f32,
    close: f32,
) -> Vec<Vector> {
    let mut positions: Vec<Point3<f32>> = patch.neutral.iter().map(|p| p.cast()).collect();
    if open != 0.0 || close != 0.0 {
        let mut velocities = vec![Vector3::zeros(); positions.len()];
        turn_with_jaw(
            field,
            hinge,
            patch.prior as f32,
            (open, 0.0),
            (close, 0.0),
            &mut positions,
            &mut velocities,
        );
    }
    let nodes = positions.iter().zip(patch.neutral);
    nodes.map(|(x, p)| x.cast::<f64>() - p).collect()
}

/// The least of a function with one minimum in a range.
fn golden_section(f: impl Fn(f64) -> f64, range: [f64; 2], tolerance: f64) -> f64 {
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    let [mut low, mut high] = range;
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut fa, mut fb) = (f(a), f(b));
    while high - low > tolerance {
        if fa < fb {
            (high, b, fb) = (b, a, fa);
            a = high - ratio * (high - low);
            fa = f(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + ratio * (high - low);
            fb = f(b);
        }
    }
    (low + high) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::jaw::turn;

    fn hinge() -> JawHinge {
        JawHinge {
            center: Point::new(0.0, 0.0, -20.0),
            axis: Vector::x(),
            open_angle: 0.4,
            forward: Vector::z(),
            left: Vector::x(),
        }
    }

    fn shape(index: u32, deltas: &[[f32; 3]]) -> MuscleShape {
        MuscleShape {
            name: format!("p.{index}"),
            shape: index,
            deltas: deltas.iter().map(|d| (*d).into()).collect(),
        }
    }

    fn nodes(count: usize) -> Vec<Point> {
        (0..count)
            .map(|i| Point::new(i as f64, -40.0 - (i % 7) as f64, 60.0))
            .collect()
    }

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
        let open: Vec<Vector3<f32>> = turned(own.open_angle).iter().map(|d| d.cast()).collect();
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

    /// A face whose jaw follows the hinge, and one that goes straight though its chin is longer
    /// than the template's: both are met, where the hinge alone would miss the second.
    #[test]
    fn a_jaw_that_turns_and_one_that_goes_straight_are_both_met() {
        let hinge = hinge();
        let neutral = nodes(40);
        let longer: Vec<Point> = neutral
            .iter()
            .map(|p| p + Vector::new(0.0, -25.0, 10.0))
            .collect();
        let drawn: Vec<[f32; 3]> = neutral
            .iter()
            .map(|p| {
                let turned = turn(&hinge, hinge.open_angle) * (p - hinge.center);
                let d = hinge.center + turned - p;
                [d.x as f32, d.y as f32, d.z as f32]
            })
            .collect();
        let shapes = [shape(0, &drawn)];
        let field = JawField::split(&hinge, &neutral, Some(&shapes[0].deltas), None).unwrap();
        let jaw = JawShapes {
            open: Some(0),
            ..JawShapes::default()
        };
        let patch = PatchEvidence {
            neutral: &longer,
            shapes: &shapes,
            jaw: Some(&field),
            prior: 1.0,
        };
        let hinged = jaw_motion(&patch, &field, &hinge, 1.0, 0.0);
        let straight: Vec<Vector> = shapes[0].deltas.iter().map(|d| d.cast()).collect();
        let apart = hinged.iter().zip(&straight).map(|(a, b)| (a - b).norm());
        assert!(apart.fold(0.0, f64::max) > 5.0, "nothing to tell them by");
        for (truth, expected) in [(&hinged, [1.0, 0.0]), (&straight, [0.0, 1.0])] {
            let observation = Observation {
                weights: vec![1.0],
                deltas: vec![truth.iter().map(|d| Some(*d)).collect()],
            };
            let fitted = fit_jaw(&hinge, &jaw, &[patch], &[observation]);
            for k in [0, 1] {
                assert!((fitted[0][k] - expected[k]).abs() < 0.1, "{fitted:?}");
            }
            let own = jaw_with_shares(&patch, &hinge, &jaw, &vec![fitted[0]; 40]).unwrap();
            let with = PatchEvidence {
                jaw: Some(&own),
                ..patch
            };
            let met = jaw_motion(&with, &own, &hinge, 1.0, 0.0);
            for (m, y) in met.iter().zip(truth) {
                assert!((m - y).norm() < 0.6, "{m} {y}");
            }
        }
        assert_eq!(fit_jaw(&hinge, &jaw, &[patch], &[]), [TURN_ALONE]);
    }
}
