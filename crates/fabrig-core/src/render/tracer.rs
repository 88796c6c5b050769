//! The `parry3d` boundary: rays against triangles and balls.
//!
//! `parry3d` works in single precision and speaks `glam`; everything is moved to the scene's
//! centre before it is rounded, so a head far from the origin loses nothing.

use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector as ParryVector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::Ray;
use parry3d::query::details::local_ray_intersection_with_triangle;

use crate::{Point, Vector};

/// What a ray met first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Index of the primitive: triangles in the order given, then balls.
    pub(super) primitive: u32,
    /// Distance along the ray.
    pub(super) distance: f64,
    /// Weights of the corners; zero for a ball.
    pub(super) barycentric: [f32; 3],
}

/// A searchable set of triangles and balls.
pub(super) struct Tracer {
    bvh: Bvh,
    triangles: Vec<[ParryVector; 3]>,
    balls: Vec<(ParryVector, f32)>,
    center: Point,
    /// Half the diagonal of the bounding box.
    pub(super) radius: f64,
}

impl Tracer {
    /// From triangles and (centre, radius) of balls; all finite.
    pub(super) fn new(triangles: &[[Point; 3]], balls: &[(Point, f64)]) -> Self {
        let mut low = Vector::repeat(f64::INFINITY);
        let mut high = Vector::repeat(f64::NEG_INFINITY);
        let points = triangles.iter().flatten();
        for p in points.chain(balls.iter().map(|(p, _)| p)) {
            low = low.inf(&p.coords);
            high = high.sup(&p.coords);
        }
        let center = Point::from((low + high) / 2.0);
        let local = |p: &Point| {
            let d = p - center;
            ParryVector::new(d.x as f32, d.y as f32, d.z as f32)
        };
        let triangles: Vec<_> = triangles
            .iter()
            .map(|t| [0, 1, 2].map(|k| local(&t[k])))
            .collect();
        let balls: Vec<_> = balls.iter().map(|(p, r)| (local(p), *r as f32)).collect();
        let mut boxes: Vec<Aabb> = triangles
            .iter()
            .map(|[a, b, c]| Aabb::new(a.min(*b).min(*c), a.max(*b).max(*c)))
            .collect();
        boxes.extend(balls.iter().map(|&(p, r)| {
            let r = ParryVector::new(r, r, r);
            Aabb::new(p - r, p + r)
        }));
        Self {
            bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
            triangles,
            balls,
            center,
            radius: ((high - low) / 2.0).norm(),
        }
    }

    /// The nearest primitive beyond `from` and before `to` along a unit direction that
    /// `accept` (primitive, whether its front is seen) does not refuse.
    pub(super) fn cast(
        &self,
        origin: &Point,
        direction: &Vector,
        from: f64,
        to: f64,
        accept: impl Fn(u32, bool) -> bool,
    ) -> Option<Hit> {
        // The ray starts just before the scene: small numbers keep their digits in f32.
        let skip = ((self.center - origin).dot(direction) - 1.01 * self.radius).max(from);
        let start = (origin + direction * skip) - self.center;
        let ray = Ray::new(
            ParryVector::new(start.x as f32, start.y as f32, start.z as f32),
            ParryVector::new(direction.x as f32, direction.y as f32, direction.z as f32),
        );
        let near = (from - skip) as f32;
        let far = ((to - skip) as f32).min(4.0 * self.radius as f32 + near.max(0.0) + 1e-6);
        let (primitive, distance) = self.bvh.cast_ray(&ray, far, |primitive, _| {
            let (t, is_front) = self.intersect(primitive, &ray)?;
            (t > near && accept(primitive, is_front)).then_some(t)
        })?;
        if distance >= far {
            return None;
        }
        let barycentric = match self.triangles.get(primitive as usize) {
            Some(&[a, b, c]) => local_ray_intersection_with_triangle(a, b, c, &ray)
                .map_or([1.0, 0.0, 0.0], |(_, w)| [w.x, w.y, w.z]),
            None => [0.0; 3],
        };
        Some(Hit {
            primitive,
            distance: skip + f64::from(distance),
            barycentric,
        })
    }

    /// Distance along the ray, and whether the primitive's front is seen.
    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<(f32, bool)> {
        if let Some(&[a, b, c]) = self.triangles.get(primitive as usize) {
            let (hit, _) = local_ray_intersection_with_triangle(a, b, c, ray)?;
            let is_front = (b - a).cross(c - a).dot(ray.dir) < 0.0;
            return Some((hit.time_of_impact, is_front));
        }
        let (center, radius) = self.balls[primitive as usize - self.triangles.len()];
        let to_center = center - ray.origin;
        let along = to_center.dot(ray.dir);
        let off = (to_center - ray.dir * along).length_squared();
        let depth = radius * radius - off;
        (depth >= 0.0).then(|| (along - depth.sqrt(), true))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(shift: f64) -> Tracer {
        let z = |z: f64| {
            [
                Point::new(shift, 0.0, z),
                Point::new(shift + 10.0, 0.0, z),
                Point::new(shift, 10.0, z),
            ]
        };
        Tracer::new(
            &[z(0.0), z(-5.0)],
            &[(Point::new(shift + 20.0, 0.0, 0.0), 2.0)],
        )
    }

    #[test]
    fn the_nearest_hit_wins_far_from_the_origin_too() {
        for shift in [0.0, 1e6] {
            let tracer = scene(shift);
            let origin = Point::new(shift + 2.0, 3.0, 100.0);
            let down = -Vector::z();
            let hit = tracer
                .cast(&origin, &down, 0.0, 1e9, |_, _| true)
                .expect("hit");
            assert_eq!(hit.primitive, 0);
            assert!((hit.distance - 100.0).abs() < 1e-4);
            assert!((hit.barycentric[0] - 0.5).abs() < 1e-5);
            assert!((hit.barycentric[1] - 0.2).abs() < 1e-5);
            let behind = tracer
                .cast(&origin, &down, 100.1, 1e9, |_, _| true)
                .expect("hit");
            assert_eq!(behind.primitive, 1);
            let other = tracer
                .cast(&origin, &down, 0.0, 1e9, |p, _| p != 0)
                .expect("hit");
            assert_eq!(other.primitive, 1);
            assert!(
                tracer
                    .cast(&origin, &down, 0.0, 99.0, |_, _| true)
                    .is_none()
            );
            assert!(
                tracer
                    .cast(&origin, &down, 0.0, 1e9, |_, front| !front)
                    .is_none()
            );
        }
    }

    #[test]
    fn a_ball_is_met_at_its_surface() {
        let hit = scene(0.0)
            .cast(
                &Point::new(20.0, 0.0, 50.0),
                &-Vector::z(),
                0.0,
                1e9,
                |_, _| true,
            )
            .expect("hit");
        assert_eq!(hit.primitive, 2);
        assert!((hit.distance - 48.0).abs() < 1e-4);
    }
}
