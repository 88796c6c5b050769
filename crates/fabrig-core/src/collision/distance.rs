//! Distances of pairs: a vertex and a triangle, two edges.
//!
//! Each gives weights `w` so that `r = sum w_i x_i` is the vector between the closest points,
//! from the second element to the first; `|r|` is their distance.
//!
//! Source: Ericson 2004, *Real-Time Collision Detection*, 5.1.5 and 5.1.9.

use nalgebra::Vector3;

use crate::Vector;

/// The kind of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum PairKind {
    /// Node 0 against the triangle of nodes 1, 2, 3.
    VertexTriangle,
    /// The edge of nodes 0, 1 against the edge of nodes 2, 3.
    EdgeEdge,
}

impl PairKind {
    /// How many nodes the first element has.
    pub(crate) fn first_count(self) -> usize {
        match self {
            Self::VertexTriangle => 1,
            Self::EdgeEdge => 2,
        }
    }
}

/// Weights of the vector between closest points.
///
/// - `x`: the four nodes (mm)
#[inline]
pub(crate) fn closest_weights(kind: PairKind, x: &[Vector; 4]) -> [f64; 4] {
    match kind {
        PairKind::VertexTriangle => vertex_triangle(x),
        PairKind::EdgeEdge => edge_edge(x),
    }
}

/// `sum w_i x_i`, taken relative to the first node to keep digits.
#[inline]
pub(crate) fn weighted(w: &[f64; 4], x: &[Vector; 4]) -> Vector {
    // The weights sum to zero.
    (x[1] - x[0]) * w[1] + (x[2] - x[0]) * w[2] + (x[3] - x[0]) * w[3]
}

fn vertex_triangle(&[p, a, b, c]: &[Vector; 4]) -> [f64; 4] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, -1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [1.0, 0.0, -1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return [1.0, v - 1.0, -v, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [1.0, 0.0, 0.0, -1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return [1.0, w - 1.0, 0.0, -w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [1.0, 0.0, w - 1.0, -w];
    }
    let sum = va + vb + vc;
    let (v, w) = (vb / sum, vc / sum);
    [1.0, v + w - 1.0, -v, -w]
}

fn edge_edge(&[p1, q1, p2, q2]: &[Vector; 4]) -> [f64; 4] {
    let (d1, d2, r) = (q1 - p1, q2 - p2, p1 - p2);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    let (s, t);
    if a <= 0.0 && e <= 0.0 {
        (s, t) = (0.0, 0.0);
    } else if a <= 0.0 {
        (s, t) = (0.0, (f / e).clamp(0.0, 1.0));
    } else {
        let c = d1.dot(&r);
        if e <= 0.0 {
            (s, t) = ((-c / a).clamp(0.0, 1.0), 0.0);
        } else {
            let b = d1.dot(&d2);
            let denominator = a * e - b * b;
            // Nearly parallel edges: any place will do, the clamps below find a closest one.
            let s0 = if denominator > 1e-12 * a * e {
                ((b * f - c * e) / denominator).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let t0 = (b * s0 + f) / e;
            if t0 < 0.0 {
                (s, t) = ((-c / a).clamp(0.0, 1.0), 0.0);
            } else if t0 > 1.0 {
                (s, t) = (((b - c) / a).clamp(0.0, 1.0), 1.0);
            } else {
                (s, t) = (s0, t0);
            }
        }
    }
    [1.0 - s, s, t - 1.0, -t]
}

/// Double precision of a stored position.
#[inline]
pub(crate) fn wide(p: &nalgebra::Point3<f32>) -> Vector {
    Vector3::new(f64::from(p.x), f64::from(p.y), f64::from(p.z))
}

/// Double precision of the places of four nodes.
#[inline]
pub(crate) fn places(nodes: &[u32; 4], positions: &[nalgebra::Point3<f32>]) -> [Vector; 4] {
    let [a, b, c, d] = *nodes;
    [
        wide(&positions[a as usize]),
        wide(&positions[b as usize]),
        wide(&positions[c as usize]),
        wide(&positions[d as usize]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// The smallest distance over a fine lattice of places on both elements.
    fn by_search(kind: PairKind, x: &[Vector; 4]) -> f64 {
        let n = 60;
        let mut best = f64::INFINITY;
        for i in 0..=n {
            for j in 0..=n {
                let (s, t) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                let r = match kind {
                    PairKind::VertexTriangle if s + t <= 1.0 => {
                        x[0] - x[1] - (x[2] - x[1]) * s - (x[3] - x[1]) * t
                    }
                    PairKind::VertexTriangle => continue,
                    PairKind::EdgeEdge => x[0] + (x[1] - x[0]) * s - x[2] - (x[3] - x[2]) * t,
                };
                best = best.min(r.norm());
            }
        }
        best
    }

    #[test]
    fn distances_are_the_smallest_there_are() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for round in 0..300 {
            // Every third scene is nearly flat, where pairs are nearly parallel.
            let flat = if round % 3 == 0 { 1e-9 } else { 1.0 };
            let x: [Vector; 4] = std::array::from_fn(|_| {
                Vector::new(
                    random.random_range(-1.0..1.0),
                    random.random_range(-1.0..1.0),
                    flat * random.random_range(-1.0..1.0),
                )
            });
            for kind in [PairKind::VertexTriangle, PairKind::EdgeEdge] {
                let w = closest_weights(kind, &x);
                assert!(w.iter().sum::<f64>().abs() < 1e-12);
                let found = weighted(&w, &x).norm();
                let searched = by_search(kind, &x);
                assert!(found <= searched + 1e-9, "{kind:?} {found} {searched}");
                assert!(found >= searched - 0.06, "{kind:?} {found} {searched}");
            }
        }
    }

    #[test]
    fn degenerate_elements_have_distances_too() {
        let o = Vector::zeros();
        let x = Vector::x();
        for kind in [PairKind::VertexTriangle, PairKind::EdgeEdge] {
            let first = kind.first_count();
            let nodes: [Vector; 4] = std::array::from_fn(|i| if i < first { o } else { x });
            let w = closest_weights(kind, &nodes);
            assert!((weighted(&w, &nodes) + x).norm() < 1e-12, "{kind:?} {w:?}");
        }
    }
}
