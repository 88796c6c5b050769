//! What planes and ways show of the distance of two elements, for less than the distance costs.

use nalgebra::{Point3, Vector3};

use super::distance::PairKind;
use super::tile::{least, most};
use crate::Vector;

/// Whether everything that two cells own is further apart than `reach`, as their planes show:
/// layers of tissue lie much nearer to each other than their boxes.
#[inline]
pub(super) fn are_apart(
    corners: [&[u32; 4]; 2],
    normals: [Vector3<f32>; 2],
    reach: f32,
    positions: &[Point3<f32>],
) -> bool {
    let range = |n: &Vector3<f32>, corners: &[u32; 4]| {
        let at = |k: usize| positions[corners[k] as usize].coords.dot(n);
        let (a, b, c, d) = (at(0), at(1), at(2), at(3));
        (
            least(least(a, b), least(c, d)),
            most(most(a, b), most(c, d)),
        )
    };
    normals.iter().any(|n| {
        let (low_a, high_a) = range(n, corners[0]);
        let (low_b, high_b) = range(n, corners[1]);
        most(low_b - high_a, low_a - high_b) > reach
    })
}

/// How much nearer two elements can come when their nodes go straight from `at` to `to`: what
/// they move in common does not count. (mm)
#[inline]
pub(super) fn approach(kind: PairKind, at: &[Vector; 4], to: &[Vector; 4]) -> f64 {
    let [a, b, c, d] = [to[0] - at[0], to[1] - at[1], to[2] - at[2], to[3] - at[3]];
    let mean = (a + b + c + d) * 0.25;
    let [a, b, c, d] = [
        (a - mean).norm_squared(),
        (b - mean).norm_squared(),
        (c - mean).norm_squared(),
        (d - mean).norm_squared(),
    ];
    match kind {
        PairKind::VertexTriangle => a.sqrt() + b.max(c).max(d).sqrt(),
        PairKind::EdgeEdge => a.max(b).sqrt() + c.max(d).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::distance::{closest_weights, weighted, wide};
    use rand::{RngExt, SeedableRng};

    #[test]
    fn cells_that_planes_part_have_no_near_elements_and_ways_bound_what_they_lose() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(23);
        let (mut parted, mut told) = (0, 0);
        for _ in 0..2000 {
            let mut place = |size: f32| {
                let mut at = || random.random_range(-size..size);
                Vector3::new(at(), at(), at())
            };
            let common = place(1.0);
            let from: Vec<Point3<f32>> = (0..8).map(|_| Point3::from(place(1.0))).collect();
            let to: Vec<Point3<f32>> = from.iter().map(|p| p + common + place(0.1)).collect();
            let normals = [Vector3::z(), common.normalize()];
            let reach = 0.2;
            let are_parted = are_apart([&[0, 1, 2, 3], &[4, 5, 6, 7]], normals, reach, &from);
            parted += usize::from(are_parted);
            for (kind, nodes) in [
                (PairKind::VertexTriangle, [0, 4, 5, 6]),
                (PairKind::EdgeEdge, [0, 1, 6, 7]),
            ] {
                let [at, to] = [&from, &to].map(|x| nodes.map(|n| wide(&x[n as usize])));
                let distance = |x: &[Vector; 4]| weighted(&closest_weights(kind, x), x).norm();
                assert!(!are_parted || distance(&at) > f64::from(reach));
                let left = distance(&at) - approach(kind, &at, &to);
                assert!(left <= distance(&to) + 1e-9);
                told += usize::from(left > 0.0);
            }
        }
        assert!(parted > 20 && told > 1000, "{parted} and {told} of 4,000");
    }
}
