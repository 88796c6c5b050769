//! What examples say of the jaw: how far its hinge opens, and how each patch goes along.

use nalgebra::{Matrix2, Point3, Vector2, Vector3};
use rayon::prelude::*;

use super::evaluate::turn_with_jaw;
use super::{JawField, JawShapes, Observation, PatchEvidence};
use crate::Vector;
use crate::template::JawHinge;

/// The hinge opens by at least and at most these shares of the template's angle.
const ANGLE_LIMITS: [f64; 2] = [0.4, 1.8];
/// Share of the turn from which on a node tells the angle.
const TURNING_SHARE: f32 = 0.5;
/// Shares of turn and straight displacement without examples.
pub const TURN_ALONE: [f64; 2] = [1.0, 0.0];
/// Both lie between these.
const SHARE_LIMITS: [f64; 2] = [-1.0, 2.5];
/// An example opens the jaw that opens it by more than this.
const LEAST_OPEN: f32 = 0.2;

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

/// How each patch goes with the jaw: `a` times the turn of the hinge and `b` times the straight
/// displacement that the template draws, the least squares of the examples that open the jaw and
/// do nothing else, drawn to the turn alone. (1, 0) without such an example.
///
/// A face whose chin is longer than the template's swings it further by the hinge; only examples
/// tell whether it does.
pub(super) fn fit_jaw(
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
        let ridge = patch.ridge();
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
/// - `shares`: of each node, smooth over the skin: [`Amplitudes::jaw`](super::Amplitudes::jaw)
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

/// Displacement of every node by the jaw alone, at the prior amplitude. (mm)
pub(super) fn jaw_motion(
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
    use crate::Point;
    use crate::transfer::fixtures::{hinge, nodes, shape};
    use crate::transfer::jaw::turn;

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
