//! Smooth displacements: near to given ones where those count, bent as little as possible.
//!
//! Finds the displacements u that minimize
//!
//! `sum_v A_v w_v |u_v - d_v|^2 + l^4 sum_v |(L u)_v|^2 / A_v`
//!
//! with the cotangent Laplacian L and the vertex areas A of the skin at rest. Where w is 1,
//! what is finer than about the length l is smoothed away; where w is large, u keeps to d and
//! its surroundings run smoothly into it; where w is small, u is a smooth filling.
//!
//! # Source
//!
//! The discrete thin-plate energy as in Botsch & Kobbelt 2004, An Intuitive Framework for
//! Real-Time Freeform Modeling; conjugate gradients with the matrix's diagonal as
//! preconditioner, in one fixed order, so that the same input gives the same bits.

use crate::mesh::{EdgeLaplacian, Topology, vertex_areas};
use crate::{Point, Vector};

/// Residual at which a solution counts as found, relative to the right-hand side.
const TOLERANCE: f64 = 1e-9;
/// Rounds at most; a few hundred are usual.
const ROUNDS: usize = 6000;

/// The skin at rest, ready to fair displacements of it.
pub(super) struct Fairing {
    laplacian: EdgeLaplacian,
    areas: Vec<f64>,
    /// Diagonal of `L A^-1 L`.
    bending: Vec<f64>,
}

impl Fairing {
    pub(super) fn new(rest: &[Point], triangles: &[[u32; 3]]) -> Self {
        let topology = Topology::from_triangles(rest.len(), triangles);
        let laplacian = EdgeLaplacian::cotangent(rest, triangles, &topology);
        let mean = {
            let areas = vertex_areas(rest, triangles);
            areas.iter().sum::<f64>() / areas.len().max(1) as f64
        };
        // Slivers of area would make the bending term of their vertices stiff beyond reason.
        let areas: Vec<f64> = vertex_areas(rest, triangles)
            .into_iter()
            .map(|a| a.max(0.01 * mean))
            .collect();
        let mut bending: Vec<f64> = laplacian
            .row_sums
            .iter()
            .zip(&areas)
            .map(|(s, a)| s * s / a)
            .collect();
        for (&[a, b], &w) in laplacian.edges.iter().zip(&laplacian.weights) {
            bending[a as usize] += w * w / areas[b as usize];
            bending[b as usize] += w * w / areas[a as usize];
        }
        Self {
            laplacian,
            areas,
            bending,
        }
    }

    /// The smooth displacements.
    ///
    /// - `given`: d (mm)
    /// - `weights`: w, positive
    /// - `length`: l (mm)
    pub(super) fn solve(&self, given: &[Vector], weights: &[f64], length: f64) -> Vec<Vector> {
        let stiffness = length.powi(4);
        let hold: Vec<f64> = weights
            .iter()
            .zip(&self.areas)
            .map(|(w, a)| w * a)
            .collect();
        let apply = |x: &[Vector]| -> Vec<Vector> {
            let mut bent = self.laplacian.apply(x);
            for (b, a) in bent.iter_mut().zip(&self.areas) {
                *b *= stiffness / a;
            }
            let mut y = self.laplacian.apply(&bent);
            for ((y, x), h) in y.iter_mut().zip(x).zip(&hold) {
                *y += *h * x;
            }
            y
        };
        let scale: Vec<f64> = hold
            .iter()
            .zip(&self.bending)
            .map(|(h, b)| 1.0 / (h + stiffness * b))
            .collect();
        let right: Vec<Vector> = given.iter().zip(&hold).map(|(d, h)| *h * d).collect();
        let mut x = given.to_vec();
        let mut residual: Vec<Vector> = right.iter().zip(apply(&x)).map(|(b, ax)| b - ax).collect();
        let precondition =
            |r: &[Vector]| -> Vec<Vector> { r.iter().zip(&scale).map(|(r, s)| *s * r).collect() };
        let mut z = precondition(&residual);
        let mut direction = z.clone();
        let mut rho = dot(&residual, &z);
        let enough = TOLERANCE * TOLERANCE * dot(&right, &precondition(&right));
        for _ in 0..ROUNDS {
            if rho <= enough {
                break;
            }
            let image = apply(&direction);
            let step = rho / dot(&direction, &image);
            for (x, d) in x.iter_mut().zip(&direction) {
                *x += step * d;
            }
            for (r, i) in residual.iter_mut().zip(&image) {
                *r -= step * i;
            }
            z = precondition(&residual);
            let next = dot(&residual, &z);
            let turn = next / rho;
            for (d, z) in direction.iter_mut().zip(&z) {
                *d = z + turn * *d;
            }
            rho = next;
        }
        x
    }
}

fn dot(a: &[Vector], b: &[Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

/// 0 at and below 0, 1 at and above 1, no slope at either end.
pub(super) fn smooth_step(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Distance from each vertex to the nearest of `points`. (mm)
pub(super) fn distances(rest: &[Point], points: &[Point]) -> Vec<f64> {
    rest.iter()
        .map(|p| {
            points
                .iter()
                .map(|q| (q - p).norm())
                .fold(f64::INFINITY, f64::min)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square sheet of `n` x `n` vertices, 1 mm apart.
    fn sheet(n: u32) -> (Vec<Point>, Vec<[u32; 3]>) {
        let points = (0..n * n)
            .map(|i| Point::new(f64::from(i % n), f64::from(i / n), 0.0))
            .collect();
        let triangles = (0..(n - 1) * (n - 1))
            .flat_map(|i| {
                let a = i / (n - 1) * n + i % (n - 1);
                [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]
            })
            .collect();
        (points, triangles)
    }

    #[test]
    fn slow_waves_stay_and_fast_ones_go() {
        let n = 41;
        let (points, triangles) = sheet(n);
        let fairing = Fairing::new(&points, &triangles);
        // A wave of length L is damped to 1 / (1 + (2 pi l / L)^4).
        for (wave, length) in [(10.0, 1.0), (10.0, 3.0), (20.0, 3.0)] {
            let k = std::f64::consts::TAU / wave;
            let given: Vec<Vector> = points
                .iter()
                .map(|p| Vector::z() * (k * (p.x - 20.0)).cos())
                .collect();
            let faired = fairing.solve(&given, &vec![1.0; points.len()], length);
            let middle = (n * n / 2) as usize;
            let expected = 1.0 / (1.0 + (k * length).powi(4));
            assert!(
                (faired[middle].z - expected).abs() < 0.03,
                "{wave} {length}: {} {expected}",
                faired[middle].z
            );
        }
    }

    #[test]
    fn held_vertices_stay_and_a_plane_is_no_bend() {
        let (points, triangles) = sheet(15);
        let fairing = Fairing::new(&points, &triangles);
        let plane: Vec<Vector> = points
            .iter()
            .map(|p| Vector::new(0.0, 0.2 * p.x, 0.3))
            .collect();
        let mut given = plane.clone();
        let mut weights = vec![1e6; given.len()];
        for v in 0..given.len() {
            let inside = (4.0..=10.0).contains(&points[v].x) && (4.0..=10.0).contains(&points[v].y);
            if inside {
                given[v] = Vector::new(5.0, -3.0, 9.0);
                weights[v] = 1e-9;
            }
        }
        let filled = fairing.solve(&given, &weights, 1.0);
        for (f, p) in filled.iter().zip(&plane) {
            assert!((f - p).norm() < 1e-4, "{f} {p}");
        }
    }
}
