//! Closest points and rays on a triangle surface.
//!
//! The hierarchy is parry's (f32 boxes); every triangle that it offers is measured in f64, so
//! results carry the accuracy of the positions given. Coordinates are scaled to a unit box for
//! the hierarchy: units and distance from the origin do not matter.

use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector as BoxVector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use serde::{Deserialize, Serialize};

use crate::{Point, Vector};

/// Why a surface cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// There is no triangle.
    #[error("a surface needs at least one triangle")]
    Empty,
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle} references vertex {vertex}, but the surface has {vertex_count} vertices"
    )]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} has a coordinate that is not a finite number")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
}

/// A place on a surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SurfacePoint {
    /// Triangle it lies on.
    pub triangle: u32,
    /// Barycentric coordinates on it, each in [0, 1], sum 1.
    pub barycentric: [f64; 3],
    /// The place itself.
    pub point: Point,
    /// Distance from the point asked for.
    pub distance: f64,
}

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayHit {
    /// Triangle it meets.
    pub triangle: u32,
    /// Barycentric coordinates on it.
    pub barycentric: [f64; 3],
    /// Distance from the origin of the ray, in units of its direction's length.
    pub distance: f64,
}

/// Triangles with a hierarchy of boxes.
///
/// It keeps its own copy of positions and triangles. Queries take `&self` and may run from
/// several threads.
pub struct Surface {
    positions: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    bvh: Bvh,
    center: Point,
    to_unit: f64,
}

impl std::fmt::Debug for Surface {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Surface")
            .field("vertex_count", &self.positions.len())
            .field("triangle_count", &self.triangles.len())
            .finish_non_exhaustive()
    }
}

/// Boxes are grown by this much of the unit box, so that f32 rounding never hides a triangle.
const BOX_MARGIN: f32 = 1e-6;

impl Surface {
    /// Builds the hierarchy.
    ///
    /// - `positions`: shape [vertex_count, 3], any unit; `triangles`: indices into them
    ///
    /// # Errors
    ///
    /// [`SurfaceError`] when there is no triangle, an index is out of range or a coordinate is
    /// not finite.
    pub fn new(positions: &[Point], triangles: &[[u32; 3]]) -> Result<Self, SurfaceError> {
        if triangles.is_empty() {
            return Err(SurfaceError::Empty);
        }
        for (triangle, t) in triangles.iter().enumerate() {
            if let Some(&vertex) = t.iter().find(|&&v| v as usize >= positions.len()) {
                return Err(SurfaceError::IndexOutOfRange {
                    triangle,
                    vertex,
                    vertex_count: positions.len(),
                });
            }
        }
        if let Some(vertex) = positions
            .iter()
            .position(|p| !p.iter().all(|c| c.is_finite()))
        {
            return Err(SurfaceError::NotFinite { vertex });
        }
        let mut low = positions[triangles[0][0] as usize];
        let mut high = low;
        for &v in triangles.iter().flatten() {
            low = low.inf(&positions[v as usize]);
            high = high.sup(&positions[v as usize]);
        }
        let size = (high - low).amax();
        let mut surface = Self {
            positions: positions.to_vec(),
            triangles: triangles.to_vec(),
            bvh: Bvh::new(),
            center: nalgebra::center(&low, &high),
            to_unit: if size > 0.0 { 1.0 / size } else { 1.0 },
        };
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| surface.to_box(&positions[v as usize]));
                let margin = BoxVector::splat(BOX_MARGIN);
                Aabb::new(a.min(b).min(c) - margin, a.max(b).max(c) + margin)
            })
            .collect();
        surface.bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        Ok(surface)
    }

    /// Vertex positions.
    pub fn positions(&self) -> &[Point] {
        &self.positions
    }

    /// Triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: u32) -> [Point; 3] {
        self.triangles[triangle as usize].map(|v| self.positions[v as usize])
    }

    /// The place with these barycentric coordinates.
    pub fn point_at(&self, triangle: u32, barycentric: [f64; 3]) -> Point {
        let [a, b, c] = self.corners(triangle);
        Point::from(
            a.coords * barycentric[0] + b.coords * barycentric[1] + c.coords * barycentric[2],
        )
    }

    /// Values at vertices (normals, ...) blended at a place.
    pub fn blend(&self, at: &SurfacePoint, values: &[Vector]) -> Vector {
        let t = self.triangles[at.triangle as usize];
        (0..3)
            .map(|k| values[t[k] as usize] * at.barycentric[k])
            .sum()
    }

    /// The place closest to `point`, which must be finite.
    pub fn closest(&self, point: &Point) -> SurfacePoint {
        self.closest_where(point, f64::INFINITY, |_| true)
            .unwrap_or_else(|| self.place(0, point))
    }

    /// The closest place within `max_distance` that `accept` takes.
    ///
    /// `accept` sees the closest place of each triangle that could still be nearest.
    pub fn closest_where(
        &self,
        point: &Point,
        max_distance: f64,
        accept: impl Fn(&SurfacePoint) -> bool,
    ) -> Option<SurfacePoint> {
        let center = self.to_box(point);
        let limit = (max_distance * self.to_unit).min(f64::from(f32::MAX) / 4.0) as f32;
        let box_distance = |node: &BvhNode, _: f32| {
            let outside = (node.mins() - center).max(center - node.maxs());
            outside.max(BoxVector::ZERO).length()
        };
        let (_, (_, best)) = self.bvh.find_best(limit, box_distance, |leaf, _| {
            let place = self.place(leaf, point);
            accept(&place).then_some(((place.distance * self.to_unit) as f32, place))
        })?;
        Some(best)
    }

    /// The first place where a ray from `origin` along `direction` meets the surface from
    /// either side, within `max_distance` (in units of the direction's length).
    pub fn cast_ray(
        &self,
        origin: &Point,
        direction: &Vector,
        max_distance: f64,
    ) -> Option<RayHit> {
        self.cast_ray_where(origin, direction, max_distance, |_| true)
    }

    /// As [`Self::cast_ray`], only where `accept` takes the hit.
    pub fn cast_ray_where(
        &self,
        origin: &Point,
        direction: &Vector,
        max_distance: f64,
        accept: impl Fn(&RayHit) -> bool,
    ) -> Option<RayHit> {
        let length = direction.norm();
        if length <= 0.0 || !length.is_finite() {
            return None;
        }
        let start = self.to_box(origin);
        let d = direction / length;
        let d = BoxVector::new(d.x as f32, d.y as f32, d.z as f32);
        let scale = length * self.to_unit;
        let limit = (max_distance * scale).min(f64::from(f32::MAX) / 4.0) as f32;
        let entry = |node: &BvhNode, best: f32| slab_entry(node, start, d, best);
        let (_, (_, hit)) = self.bvh.find_best(limit, entry, |leaf, _| {
            let hit = self.ray_triangle(leaf, origin, direction)?;
            (hit.distance <= max_distance && accept(&hit))
                .then_some(((hit.distance * scale) as f32, hit))
        })?;
        Some(hit)
    }

    fn place(&self, triangle: u32, point: &Point) -> SurfacePoint {
        let (place, barycentric) = closest_on_triangle(point, self.corners(triangle));
        SurfacePoint {
            triangle,
            barycentric,
            point: place,
            distance: (place - point).norm(),
        }
    }

    /// Möller & Trumbore 1997.
    fn ray_triangle(&self, triangle: u32, origin: &Point, direction: &Vector) -> Option<RayHit> {
        let [a, b, c] = self.corners(triangle);
        let (e1, e2) = (b - a, c - a);
        let p = direction.cross(&e2);
        let determinant = e1.dot(&p);
        if determinant == 0.0 {
            return None;
        }
        let s = origin - a;
        let u = s.dot(&p) / determinant;
        let q = s.cross(&e1);
        let v = direction.dot(&q) / determinant;
        let distance = e2.dot(&q) / determinant;
        // A hair of slack keeps rays through shared edges from slipping between triangles.
        let slack = 1e-10;
        (u >= -slack && v >= -slack && u + v <= 1.0 + slack && distance >= 0.0).then_some(RayHit {
            triangle,
            barycentric: [1.0 - u - v, u, v],
            distance,
        })
    }

    fn to_box(&self, p: &Point) -> BoxVector {
        let q = (p - self.center) * self.to_unit;
        BoxVector::new(q.x as f32, q.y as f32, q.z as f32)
    }
}

/// Distance at which a ray enters a box, `f32::MAX` when it misses it or enters beyond `best`.
fn slab_entry(node: &BvhNode, start: BoxVector, d: BoxVector, best: f32) -> f32 {
    let (low, high) = (node.mins() - start, node.maxs() - start);
    let (mut near, mut far) = (0.0f32, best);
    for ((l, h), d) in low
        .to_array()
        .into_iter()
        .zip(high.to_array())
        .zip(d.to_array())
    {
        if d.abs() < 1e-12 {
            if l > 0.0 || h < 0.0 {
                return f32::MAX;
            }
        } else {
            let (a, b) = (l / d, h / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
    }
    if near <= far { near } else { f32::MAX }
}

/// Closest place on a triangle and its barycentric coordinates; degenerate triangles are taken
/// as the segment or point that they are.
///
/// Source: Ericson 2005, Real-Time Collision Detection, section 5.1.5 (Voronoi regions).
pub fn closest_on_triangle(p: &Point, [a, b, c]: [Point; 3]) -> (Point, [f64; 3]) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let longest_squared = ab.norm_squared().max(ac.norm_squared());
    // Twice the area below 1e-12 of the square of an edge: no plane to speak of.
    if ab.cross(&ac).norm_squared() <= 1e-24 * longest_squared * longest_squared {
        return closest_on_sides(p, [a, b, c]);
    }
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, [1.0, 0.0, 0.0]);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (b, [0.0, 1.0, 0.0]);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = if d1 - d3 > 0.0 { d1 / (d1 - d3) } else { 0.0 };
        return (a + ab * v, [1.0 - v, v, 0.0]);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (c, [0.0, 0.0, 1.0]);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = if d2 - d6 > 0.0 { d2 / (d2 - d6) } else { 0.0 };
        return (a + ac * w, [1.0 - w, 0.0, w]);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let span = (d4 - d3) + (d5 - d6);
        let w = if span > 0.0 { (d4 - d3) / span } else { 0.0 };
        return (b + (c - b) * w, [0.0, 1.0 - w, w]);
    }
    let sum = va + vb + vc;
    let (v, w) = (vb / sum, vc / sum);
    (a + ab * v + ac * w, [1.0 - v - w, v, w])
}

/// Closest place on the three sides of a triangle.
fn closest_on_sides(p: &Point, corners: [Point; 3]) -> (Point, [f64; 3]) {
    let mut best = (corners[0], [1.0, 0.0, 0.0]);
    let mut best_distance = (corners[0] - p).norm_squared();
    for k in 0..3 {
        let next = (k + 1) % 3;
        let side = corners[next] - corners[k];
        let length_squared = side.norm_squared();
        if length_squared <= 0.0 {
            continue;
        }
        let t = ((p - corners[k]).dot(&side) / length_squared).clamp(0.0, 1.0);
        let place = corners[k] + side * t;
        let distance = (place - p).norm_squared();
        if distance < best_distance {
            let mut barycentric = [0.0; 3];
            barycentric[k] = 1.0 - t;
            barycentric[next] = t;
            best = (place, barycentric);
            best_distance = distance;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand::SeedableRng;

    fn soup(seed: u64, scale: f64, offset: f64) -> (Vec<Point>, Vec<[u32; 3]>) {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut p = Vec::new();
        let mut t = Vec::new();
        for k in 0..200u32 {
            let c = Vector::from_fn(|_, _| rng.random_range(-1.0..1.0));
            for _ in 0..3 {
                let d = Vector::from_fn(|_, _| rng.random_range(-0.1..0.1));
                p.push(Point::from((c + d) * scale + Vector::repeat(offset)));
            }
            t.push([3 * k, 3 * k + 1, 3 * k + 2]);
        }
        (p, t)
    }

    #[test]
    fn the_closest_place_is_that_of_brute_force_in_any_unit_and_far_away() {
        for (scale, offset) in [(1.0, 0.0), (1e-3, 0.0), (1e3, 1e6)] {
            let (p, t) = soup(7, scale, offset);
            let surface = Surface::new(&p, &t).expect("surface");
            for k in 0..200 {
                let a = k as f64;
                let q = Point::from(
                    Vector::new((a * 0.7).sin(), (a * 1.3).cos(), (a * 0.31).sin()) * scale
                        + Vector::repeat(offset),
                );
                let found = surface.closest(&q);
                let direct = t
                    .iter()
                    .map(|t| {
                        let (c, _) = closest_on_triangle(&q, t.map(|v| p[v as usize]));
                        (c - q).norm()
                    })
                    .fold(f64::INFINITY, f64::min);
                assert!(
                    (found.distance - direct).abs() <= 1e-6 * scale,
                    "{scale} {k}"
                );
                let back = surface.point_at(found.triangle, found.barycentric);
                assert!((back - found.point).norm() <= 1e-9 * scale.max(offset));
            }
        }
    }

    #[test]
    fn rays_hit_the_first_triangle_from_both_sides_and_respect_the_limit() {
        let p: Vec<Point> = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]
            .iter()
            .flat_map(|c| [0.0, 2.0].map(|z| Point::new(c[0], c[1], z)))
            .collect();
        let surface = Surface::new(&p, &[[0, 2, 4], [1, 3, 5]]).expect("surface");
        let from = Point::new(0.25, 0.25, 5.0);
        let hit = surface.cast_ray(&from, &-Vector::z(), 10.0).expect("hit");
        assert_eq!((hit.triangle, hit.distance), (1, 3.0));
        assert_eq!(hit.barycentric, [0.5, 0.25, 0.25]);
        assert!(surface.cast_ray(&from, &-Vector::z(), 2.9).is_none());
        assert!(surface.cast_ray(&from, &Vector::z(), 10.0).is_none());
        let up = surface
            .cast_ray(&Point::new(0.25, 0.25, -1.0), &(Vector::z() * 2.0), 10.0)
            .expect("hit");
        assert_eq!((up.triangle, up.distance), (0, 0.5));
    }

    #[test]
    fn degenerate_triangles_are_segments_and_points() {
        let a = Point::new(0., 0., 0.);
        let b = Point::new(2., 0., 0.);
        for t in [[a, b, b], [a, a, b], [b, a, a], [a, b, a]] {
            let (c, w) = closest_on_triangle(&Point::new(1., 1., 0.), t);
            assert!((c - Point::new(1., 0., 0.)).norm() < 1e-12, "{t:?} {c}");
            assert!(w.iter().all(|w| (0.0..=1.0).contains(w)));
        }
        let (c, w) = closest_on_triangle(&Point::new(1., 1., 0.), [a, a, a]);
        assert_eq!((c, w), (a, [1.0, 0.0, 0.0]));
    }

    #[test]
    fn what_accept_refuses_is_passed_over() {
        let (p, t) = soup(3, 1.0, 0.0);
        let surface = Surface::new(&p, &t).expect("surface");
        let q = Point::origin();
        let first = surface.closest(&q);
        let second = surface
            .closest_where(&q, 10.0, |s| s.triangle != first.triangle)
            .expect("another");
        assert!(second.triangle != first.triangle && second.distance >= first.distance);
        assert!(
            surface
                .closest_where(&q, first.distance * 0.5, |_| true)
                .is_none()
        );
    }
}
