//! What planes and ways show of the distance of two elements, for less than the distance costs.

use nalgebra::{Point3, Vector3};

use super::certificate::ROUNDING;
use super::distance::PairKind;
use super::tile::{least, most};
use crate::Vector;

/// How far two elements are apart along a unit direction from the second to the first: in the
/// first of two states, and all the way from there to the second. (mm)
#[inline]
pub(super) fn parted(
    kind: PairKind,
    nodes: &[u32; 4],
    normal: &[f32; 3],
    states: [&[Point3<f32>]; 2],
) -> [f32; 2] {
    // Against the first node, so that what they go in common does not count.
    let heights = |state: &[Point3<f32>]| {
        let origin = state[nodes[0] as usize];
        let mut out = [0.0_f32; 4];
        for (h, &n) in out.iter_mut().zip(nodes) {
            let d = state[n as usize] - origin;
            *h = normal[0] * d.x + normal[1] * d.y + normal[2] * d.z;
        }
        out
    };
    let (now, next) = (heights(states[0]), heights(states[1]));
    let gap = |h: &[f32; 4]| match kind {
        PairKind::VertexTriangle => h[0] - most(most(h[1], h[2]), h[3]),
        PairKind::EdgeEdge => least(h[0], h[1]) - most(h[2], h[3]),
    };
    // Heights go straight from one state to the other.
    let mut ever = next;
    for (k, (h, &now)) in ever.iter_mut().zip(&now).enumerate() {
        *h = match k < kind.first_count() {
            true => least(*h, now),
            false => most(*h, now),
        };
    }
    [gap(&now) - ROUNDING, gap(&ever) - ROUNDING]
}

/// The unit direction of a vector of known length; none where that is nothing.
#[inline]
pub(super) fn direction(r: &Vector, length: f64) -> [f32; 3] {
    if length > 0.0 {
        (r / length).cast::<f32>().into()
    } else {
        [0.0; 3]
    }
}

/// Whether everything that two cells own is further apart than `reach`, as their planes show:
/// layers of tissue lie much nearer to each other than their boxes.
#[inline]
pub(super) fn are_apart(
    hulls: [&[u32]; 2],
    normals: [&Vector3<f32>; 2],
    reach: f32,
    positions: &[Point3<f32>],
) -> bool {
    normals.into_iter().any(|n| {
        let [(low_a, high_a), (low_b, high_b)] = hulls.map(|hull| {
            hull.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| {
                let height = positions[v as usize].coords.dot(n);
                (least(low, height), most(high, height))
            })
        });
        low_b - high_a > reach || low_a - high_b > reach
    })
}

/// Whether two elements are further apart than `reach`, as their boxes or the planes of their
/// cells show.
#[inline]
pub(super) fn is_beyond(
    kind: PairKind,
    nodes: &[u32; 4],
    n: [&Vector3<f32>; 2],
    reach: f32,
    positions: &[Point3<f32>],
) -> bool {
    let at = |k: usize| positions[nodes[k] as usize].coords;
    let x = [at(0), at(1), at(2), at(3)];
    let is_far = |h: [f32; 4]| {
        let ([low_a, high_a], [low_b, high_b]) = match kind {
            PairKind::VertexTriangle => (
                [h[0], h[0]],
                [least(least(h[1], h[2]), h[3]), most(most(h[1], h[2]), h[3])],
            ),
            PairKind::EdgeEdge => (
                [least(h[0], h[1]), most(h[0], h[1])],
                [least(h[2], h[3]), most(h[2], h[3])],
            ),
        };
        low_b - high_a > reach || low_a - high_b > reach
    };
    is_far([x[0].x, x[1].x, x[2].x, x[3].x])
        || is_far([x[0].y, x[1].y, x[2].y, x[3].y])
        || is_far([x[0].z, x[1].z, x[2].z, x[3].z])
        || is_far([
            n[0].dot(&x[0]),
            n[0].dot(&x[1]),
            n[0].dot(&x[2]),
            n[0].dot(&x[3]),
        ])
        || is_far([
            n[1].dot(&x[0]),
            n[1].dot(&x[1]),
            n[1].dot(&x[2]),
            n[1].dot(&x[3]),
        ])
}

/// How much nearer two elements can come when their nodes go straight from `at` to `to`: what
/// they move in common does not count. (mm)
pub(super) fn approach(kind: PairKind, at: &[Vector; 4], to: &[Vector; 4]) -> f64 {
    let moves: [Vector; 4] = std::array::from_fn(|i| to[i] - at[i]);
    let mean = (moves[0] + moves[1] + moves[2] + moves[3]) * 0.25;
    let squared = moves.map(|m| (m - mean).norm_squared());
    let first = kind.first_count();
    let largest = |s: &[f64]| s.iter().fold(0.0, |m: f64, &x| m.max(x)).sqrt();
    largest(&squared[..first]) + largest(&squared[first..])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::distance::{closest_weights, weighted, wide};
    use rand::{RngExt, SeedableRng};

    /// Elements that go straight from one place to another, together and against each other.
    #[test]
    fn what_planes_show_is_never_more_than_there_is() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(23);
        let (mut told, mut beyond) = (0, 0);
        for _ in 0..2000 {
            let common = Vector3::from_fn(|_, _| random.random_range(-1.0..1.0_f32));
            let mut place = |size: f32| {
                let mut at = || random.random_range(-size..size);
                Point3::new(at(), at(), at())
            };
            let from: Vec<Point3<f32>> = (0..4).map(|_| place(1.0)).collect();
            let moved = |p: &Point3<f32>| p + common + place(0.1).coords;
            let to: Vec<Point3<f32>> = from.iter().map(moved).collect();
            let nodes = [0, 1, 2, 3];
            for kind in [PairKind::VertexTriangle, PairKind::EdgeEdge] {
                let distance = |t: f32| {
                    let x = nodes.map(|n: u32| {
                        let n = n as usize;
                        wide(&(from[n] + (to[n] - from[n]) * t))
                    });
                    let r = weighted(&closest_weights(kind, &x), &x);
                    (r.norm(), r)
                };
                let (start, r) = distance(0.0);
                let normal = direction(&r, start);
                let [now, ever] = parted(kind, &nodes, &normal, [&from, &to]);
                assert!(f64::from(now) <= start && f64::from(now) > start - 1e-3);
                for k in 0..=20 {
                    assert!(f64::from(ever) <= distance(0.05 * k as f32).0);
                }
                told += usize::from(ever > 0.0);
                let planes = [Vector3::z(), common.normalize()];
                let reach = 0.4;
                if is_beyond(kind, &nodes, [&planes[0], &planes[1]], reach, &from) {
                    assert!(start > f64::from(reach));
                    beyond += 1;
                }
            }
        }
        assert!(told > 1000 && beyond > 200, "{told} {beyond} of 4,000");
    }
}
