//! Weights between the template's vertices.
//!
//! Weights that are linear on each triangle bend at its edges, and a fine skin over a coarse
//! template shows these as facets. With the gradient `g_i` of the weights at each vertex,
//!
//! `w(x) = sum_i b_i (w_i + 1/2 g_i . (x - x_i))`
//!
//! meets the weights at the vertices, is continuous across edges (an edge depends on its two
//! ends alone) and exact for weights that are quadratic along the surface. Gradients are least squares over the
//! ring; as they are linear in the ring's weights, so is the result: each place of the skin is
//! a fixed sum over a few vertices around it, and the shares sum to one.

use crate::mesh::{SurfacePoint, Topology};
use crate::template::Template;
use crate::transfer::smoothed_normals;
use crate::{Point, Vector};

/// A ring whose directions span less than this (determinant of the mean of `t t'` in the
/// tangent plane; 1/4 for an even ring) does not tell the gradient.
const LEAST_SPREAD: f64 = 0.03;
/// A ring that bends away from the tangent plane by more than this is a fold, over which
/// nothing is smooth (sine).
const STEEPEST: f64 = 0.8;

/// Smooth interpolation over the skin of a template.
pub struct SmoothInterpolation<'a> {
    positions: &'a [Point],
    triangles: Vec<[u32; 3]>,
    normals: Vec<Vector>,
    /// Per vertex: `g = sum_k c_k (w_k - w_vertex)`; empty where the weights have no gradient.
    gradients: Vec<Vec<(u32, Vector)>>,
}

impl<'a> SmoothInterpolation<'a> {
    /// Prepares the gradients of a template at rest.
    pub fn new(template: &'a Template) -> Self {
        let positions = template.skin.positions();
        let triangles = template.skin.triangles();
        let normals = smoothed_normals(positions, &triangles, 0);
        let topology = Topology::from_mesh(&template.skin);
        let regions = &template.regions;
        let gradients = (0..positions.len())
            .map(|v| {
                let own = regions.vertex_regions[v];
                let ring = topology.neighbours(v as u32);
                let is_parted = ring
                    .iter()
                    .any(|&n| regions.are_apart(own, regions.vertex_regions[n as usize]));
                if is_parted {
                    Vec::new()
                } else {
                    gradient(positions, v, &normals[v], ring).unwrap_or_default()
                }
            })
            .collect();
        Self {
            positions,
            triangles,
            normals,
            gradients,
        }
    }

    /// Triangles of the template's skin.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Shares of the template's vertices in a place of its skin, in no order; a vertex may
    /// come more than once. They sum to one, and some are a little negative.
    ///
    /// - `place`: with a triangle of this template
    pub fn shares(&self, place: &SurfacePoint, out: &mut Vec<(u32, f64)>) {
        out.clear();
        let corners = self.triangles[place.triangle as usize];
        let mut point = Vector::zeros();
        for (&v, b) in corners.iter().zip(place.barycentric) {
            point += b * self.positions[v as usize].coords;
        }
        for (&v, b) in corners.iter().zip(place.barycentric) {
            let arm = point - self.positions[v as usize].coords;
            let arm = unrolled(&arm, &self.normals[v as usize]).unwrap_or_else(Vector::zeros);
            let mut own = b;
            for (n, coefficient) in &self.gradients[v as usize] {
                let share = 0.5 * b * coefficient.dot(&arm);
                out.push((*n, share));
                own -= share;
            }
            out.push((v, own));
        }
    }
}

/// A step along the surface: the part in the tangent plane, at the length of the whole.
fn unrolled(step: &Vector, normal: &Vector) -> Option<Vector> {
    let flat = step - normal * normal.dot(step);
    let (length, flat_length) = (step.norm(), flat.norm());
    (flat_length > 0.2 * length).then(|| flat * (length / flat_length))
}

/// Least squares over the ring, each neighbour weighted by one over its squared distance.
fn gradient(
    positions: &[Point],
    vertex: usize,
    normal: &Vector,
    ring: &[u32],
) -> Option<Vec<(u32, Vector)>> {
    let mut spread = nalgebra::Matrix3::zeros();
    let mut steps = Vec::with_capacity(ring.len());
    for &n in ring {
        let step = positions[n as usize] - positions[vertex];
        if normal.dot(&step).abs() > STEEPEST * step.norm() {
            return None;
        }
        let step = unrolled(&step, normal)?;
        let direction = step.try_normalize(f64::MIN_POSITIVE)?;
        spread += direction * direction.transpose();
        steps.push((n, step / step.norm_squared()));
    }
    let count = ring.len() as f64;
    let full = spread + normal * normal.transpose() * count;
    if full.determinant() < LEAST_SPREAD * count.powi(3) {
        return None;
    }
    let inverse = full.try_inverse()?;
    Some(steps.into_iter().map(|(n, s)| (n, inverse * s)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template::human;

    #[test]
    fn vertices_keep_their_own_and_shares_sum_to_one() {
        let template = human();
        let smooth = SmoothInterpolation::new(template);
        let mut shares = Vec::new();
        for triangle in (0..smooth.triangle_count() as u32).step_by(97) {
            for barycentric in [[1.0, 0.0, 0.0], [0.2, 0.5, 0.3]] {
                let place = SurfacePoint {
                    triangle,
                    barycentric,
                    point: Point::origin(),
                    distance: 0.0,
                };
                smooth.shares(&place, &mut shares);
                let total: f64 = shares.iter().map(|s| s.1).sum();
                assert!((total - 1.0).abs() < 1e-12);
                if barycentric[0] == 1.0 {
                    let corner = smooth.triangles[triangle as usize][0];
                    for (v, share) in &shares {
                        let expected = f64::from(*v == corner && *share != 0.0);
                        assert!(share.abs() < 1e-12 || (share - expected).abs() < 1e-12);
                    }
                }
            }
        }
    }

    #[test]
    fn a_parabola_on_a_plane_comes_back() {
        let positions: Vec<Point> = (0..25)
            .map(|i| Point::new(2.0 * f64::from(i % 5), 2.0 * f64::from(i / 5), 0.0))
            .collect();
        let value = |p: &Point| p.x * p.x - 0.5 * p.y * p.y + p.x;
        // The middle vertex and its ring of four.
        let ring = [11, 13, 7, 17];
        let found = gradient(&positions, 12, &Vector::z(), &ring).unwrap();
        let slope: Vector = found
            .iter()
            .map(|(n, c)| c * (value(&positions[*n as usize]) - value(&positions[12])))
            .sum();
        assert!((slope - Vector::new(9.0, -4.0, 0.0)).norm() < 1e-9);
    }
}
