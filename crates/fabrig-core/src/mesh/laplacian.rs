//! Laplacians of triangle meshes as weights on edges.
//!
//! Convention: positive semi-definite, `(L x)_i = sum_j w_ij (x_i - x_j)`.

use super::Topology;
use crate::{Point, Vector};

/// Edge weights w_ij > 0 and their row sums.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeLaplacian {
    /// Both ends, lower index first, sorted.
    pub edges: Vec<[u32; 2]>,
    /// Weight of each edge.
    pub weights: Vec<f64>,
    /// Sum of the weights at each vertex.
    pub row_sums: Vec<f64>,
}

impl EdgeLaplacian {
    /// Weight 1 on every edge of `topology`.
    pub fn uniform(topology: &Topology) -> Self {
        let edges: Vec<_> = topology.edges().iter().map(|e| e.vertices).collect();
        let weights = vec![1.0; edges.len()];
        Self::from_weights(topology.vertex_count(), edges, weights)
    }

    /// Half the sum of the cotangents of the angles opposite each edge.
    ///
    /// - `topology`: of the same `triangles`
    ///
    /// Weights are kept within [0.02, 50]: obtuse or needle-like triangles would make them
    /// negative or unbounded, and a smoothness term must neither push apart nor lock.
    ///
    /// Source: Pinkall & Polthier 1993, Computing Discrete Minimal Surfaces.
    pub fn cotangent(positions: &[Point], triangles: &[[u32; 3]], topology: &Topology) -> Self {
        let edges: Vec<_> = topology.edges().iter().map(|e| e.vertices).collect();
        let mut weights = vec![0.0; edges.len()];
        for t in triangles {
            for k in 0..3 {
                let [a, b, c] = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
                let Some(edge) = topology.edge_between(b, c) else {
                    continue;
                };
                let u = positions[b as usize] - positions[a as usize];
                let v = positions[c as usize] - positions[a as usize];
                let sine = u.cross(&v).norm();
                if sine > 0.0 {
                    weights[edge] += 0.5 * u.dot(&v) / sine;
                }
            }
        }
        for w in &mut weights {
            *w = w.clamp(0.02, 50.0);
        }
        Self::from_weights(topology.vertex_count(), edges, weights)
    }

    fn from_weights(vertex_count: usize, edges: Vec<[u32; 2]>, weights: Vec<f64>) -> Self {
        let mut row_sums = vec![0.0; vertex_count];
        for (e, w) in edges.iter().zip(&weights) {
            row_sums[e[0] as usize] += w;
            row_sums[e[1] as usize] += w;
        }
        Self {
            edges,
            weights,
            row_sums,
        }
    }

    /// `L x`, shape [vertex_count, 3].
    pub fn apply(&self, x: &[Vector]) -> Vec<Vector> {
        let mut result: Vec<Vector> = x.iter().zip(&self.row_sums).map(|(x, s)| x * *s).collect();
        for (&[a, b], &w) in self.edges.iter().zip(&self.weights) {
            result[a as usize] -= x[b as usize] * w;
            result[b as usize] -= x[a as usize] * w;
        }
        result
    }

    /// `steps` explicit steps of diffusion `x <- x - rate D^-1 L x` with 0 < rate < 1.
    pub fn smooth(&self, x: &[Vector], rate: f64, steps: usize) -> Vec<Vector> {
        let mut x = x.to_vec();
        for _ in 0..steps {
            let l = self.apply(&x);
            for ((x, l), s) in x.iter_mut().zip(&l).zip(&self.row_sums) {
                if *s > 0.0 {
                    *x -= l * (rate / s);
                }
            }
        }
        x
    }
}

/// A third of the area of the triangles around each vertex, shape `[vertex_count]`.
pub fn vertex_areas(positions: &[Point], triangles: &[[u32; 3]]) -> Vec<f64> {
    let mut areas = vec![0.0; positions.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let third = (b - a).cross(&(c - a)).norm() / 6.0;
        for &v in t {
            areas[v as usize] += third;
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cotangent_laplacian_of_a_linear_function_is_zero_inside() {
        // A fan of irregular triangles around vertex 0.
        let mut p = vec![Point::new(0.1, -0.05, 0.0)];
        for k in 0..7 {
            let a = k as f64 / 7.0 * std::f64::consts::TAU;
            p.push(Point::new(a.cos() * 1.1, a.sin(), 0.0));
        }
        let triangles: Vec<[u32; 3]> = (0..7).map(|k| [0, 1 + k, 1 + (k + 1) % 7]).collect();
        let topology = Topology::from_triangles(8, &triangles);
        let l = EdgeLaplacian::cotangent(&p, &triangles, &topology);
        let x: Vec<Vector> = p
            .iter()
            .map(|p| Vector::new(3.0 * p.x - p.y, p.y, 1.0))
            .collect();
        assert!(l.apply(&x)[0].norm() < 1e-12);
        let area: f64 = vertex_areas(&p, &triangles).iter().sum();
        let direct: f64 = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v: u32| p[v as usize]);
                (b - a).cross(&(c - a)).norm() / 2.0
            })
            .sum();
        assert!((area - direct).abs() < 1e-12);
    }
}
