//! Bodies that are seen whole from one point within: an eyeball with its cornea, a skull.
//!
//! The surface is a radius for every direction, sampled on the faces of a cube and blended
//! between samples. The distance to it is taken along the radius and corrected by the slope of
//! the surface there, which is exact to first order in the distance.

use super::cloth_shape::SurfacePlace;
use crate::Vector;

/// A surface as a radius for every direction from its centre.
#[derive(Debug, Clone, PartialEq)]
pub struct StarSurface {
    /// Samples along an edge of a face of the cube.
    side: usize,
    /// Face after face, row after row; negative infinity where there is no surface. (mm)
    radii: Vec<f32>,
    largest: f64,
}

/// A step that is small against a cell of the cube.
const PROBE: f64 = 1e-3;

impl StarSurface {
    /// Samples a surface.
    ///
    /// - `side`: samples along an edge of a face of the cube, 2 or more
    /// - `radius_of`: radius in a unit direction (mm); `None` where there is no surface
    pub fn sample(side: usize, radius_of: impl Fn(&Vector) -> Option<f64>) -> Self {
        let side = side.max(2);
        let mut radii = Vec::with_capacity(6 * side * side);
        for face in 0..6 {
            for row in 0..side {
                for column in 0..side {
                    let at = |k: usize| 2.0 * k as f64 / (side - 1) as f64 - 1.0;
                    let direction = from_face(face, at(column), at(row)).normalize();
                    radii.push(radius_of(&direction).map_or(f32::NEG_INFINITY, |r| r as f32));
                }
            }
        }
        let largest = radii.iter().fold(0.0_f32, |m, &r| m.max(r));
        Self {
            side,
            radii,
            largest: f64::from(largest),
        }
    }

    /// Largest radius. (mm)
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// Radius in a direction of any length (mm); negative infinity where there is no surface.
    pub fn radius(&self, direction: &Vector) -> f64 {
        let (face, x, y) = to_face(direction);
        let last = (self.side - 1) as f64;
        let split = |c: f64| {
            let place = ((c + 1.0) * 0.5 * last).clamp(0.0, last);
            let cell = (place as usize).min(self.side - 2);
            (cell, place - cell as f64)
        };
        let ((column, s), (row, t)) = (split(x), split(y));
        let first = (face * self.side + row) * self.side + column;
        let [a, b] = [first, first + self.side].map(|i| {
            let (left, right) = (f64::from(self.radii[i]), f64::from(self.radii[i + 1]));
            // Equal ends are not blended: infinities would give no number.
            if left == right {
                left
            } else {
                left + (right - left) * s
            }
        });
        if a == b { a } else { a + (b - a) * t }
    }

    /// Distance of a point from the surface, negative inside; infinite where there is none.
    ///
    /// - `point`: from the centre (mm)
    pub fn distance(&self, point: &Vector) -> f64 {
        self.nearest(point).distance
    }

    /// The surface near a point in the body's own coordinates. (mm)
    pub(crate) fn nearest(&self, point: &Vector) -> SurfacePlace {
        let length = point.norm();
        let Some(out) = point.try_normalize(1e-9) else {
            return SurfacePlace {
                distance: -self.radius(&Vector::z()),
                normal: None,
            };
        };
        let height = length - self.radius(&out);
        if !height.is_finite() {
            return SurfacePlace {
                distance: f64::INFINITY,
                normal: Some(out),
            };
        }
        // Gradient of |x| - r(x / |x|): out, less the slope of the radius across.
        let across = if out.x.abs() < 0.9 {
            Vector::x()
        } else {
            Vector::y()
        };
        let u = out.cross(&across).normalize();
        let v = out.cross(&u);
        let slope = |along: &Vector| {
            let step = along * PROBE;
            let [ahead, behind] = [out + step, out - step].map(|d| self.radius(&d));
            let slope = (ahead - behind) / (2.0 * PROBE * length);
            if slope.is_finite() { slope } else { 0.0 }
        };
        let gradient = out - u * slope(&u) - v * slope(&v);
        let steepness = gradient.norm();
        SurfacePlace {
            distance: height / steepness,
            normal: Some(gradient / steepness),
        }
    }
}

/// A point on a face of the cube from -1 to 1.
fn from_face(face: usize, x: f64, y: f64) -> Vector {
    let sign = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
    let mut v = Vector::zeros();
    let axis = face / 2;
    v[axis] = sign;
    v[(axis + 1) % 3] = x;
    v[(axis + 2) % 3] = y;
    v
}

fn to_face(d: &Vector) -> (usize, f64, f64) {
    let axis = d.iamax();
    let size = d[axis].abs().max(f64::MIN_POSITIVE);
    let face = 2 * axis + usize::from(d[axis] < 0.0);
    (face, d[(axis + 1) % 3] / size, d[(axis + 2) % 3] / size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn directions() -> Vec<Vector> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        (0..500)
            .map(|_| Vector::from_fn(|_, _| random.random_range(-1.0..1.0)).normalize())
            .collect()
    }

    #[test]
    fn a_ball_is_a_ball() {
        let star = StarSurface::sample(12, |_| Some(10.0));
        for d in directions() {
            for length in [7.0, 10.5, 14.0] {
                let place = star.nearest(&(d * length));
                assert!((place.distance - (length - 10.0)).abs() < 1e-6);
                assert!((place.normal.unwrap() - d).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn near_an_ellipsoid_distance_and_normal_are_its_own() {
        let axes = Vector::new(12.0, 10.0, 14.0);
        let star = StarSurface::sample(48, |d| Some(1.0 / d.component_div(&axes).norm()));
        for d in directions() {
            let on = d / d.component_div(&axes).norm();
            let normal = on.component_div(&axes).component_div(&axes).normalize();
            for height in [-0.5, 0.3] {
                let place = star.nearest(&(on + normal * height));
                assert!((place.distance - height).abs() < 0.02, "{}", place.distance);
                assert!(place.normal.unwrap().dot(&normal) > 0.998);
            }
        }
    }

    #[test]
    fn where_there_is_no_surface_nothing_is_near() {
        let star = StarSurface::sample(12, |d| (d.z > 0.0).then_some(10.0));
        assert_eq!(
            star.nearest(&Vector::new(0.0, 1.0, -9.0)).distance,
            f64::INFINITY
        );
        assert!((star.nearest(&Vector::new(0.0, 1.0, 9.0)).distance + 0.945).abs() < 1e-2);
    }
}
