//! A smooth map of space that takes one set of points to another.
//!
//! `x -> A x + b + sum_i c_i |x - p_i|`: the interpolation of least bending energy in three
//! dimensions (Duchon 1977), with an affine part.

use nalgebra::{DMatrix, DVector, Matrix3};

use crate::{Point, Vector};

/// A map of space.
pub(super) struct SpaceMap {
    centers: Vec<Point>,
    coefficients: Vec<Vector>,
    linear: Matrix3<f64>,
    shift: Vector,
}

impl SpaceMap {
    /// Interpolates; `None` where the points are too few to fix an affine map, or coincide.
    pub(super) fn between(from: &[Point], to: &[Point]) -> Option<Self> {
        let n = from.len();
        if n < 4 || to.len() != n {
            return None;
        }
        let mut matrix = DMatrix::zeros(n + 4, n + 4);
        for i in 0..n {
            for j in 0..n {
                matrix[(i, j)] = (from[i] - from[j]).norm();
            }
            for (k, value) in [1.0, from[i].x, from[i].y, from[i].z]
                .into_iter()
                .enumerate()
            {
                matrix[(i, n + k)] = value;
                matrix[(n + k, i)] = value;
            }
        }
        let factor = matrix.lu();
        let mut columns = Vec::new();
        for axis in 0..3 {
            let mut rhs = DVector::zeros(n + 4);
            for (i, p) in to.iter().enumerate() {
                rhs[i] = p[axis];
            }
            columns.push(factor.solve(&rhs)?);
        }
        let row = |i: usize| Vector::new(columns[0][i], columns[1][i], columns[2][i]);
        Some(Self {
            centers: from.to_vec(),
            coefficients: (0..n).map(row).collect(),
            linear: Matrix3::from_columns(&[row(n + 1), row(n + 2), row(n + 3)]),
            shift: row(n),
        })
    }

    pub(super) fn at(&self, p: &Point) -> Point {
        let mut q = self.linear * p.coords + self.shift;
        for (center, coefficient) in self.centers.iter().zip(&self.coefficients) {
            q += coefficient * (p - center).norm();
        }
        Point::from(q)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_arrive_and_affine_maps_stay_affine() {
        let from: Vec<Point> = (0..40)
            .map(|i| {
                let t = f64::from(i);
                Point::new((t * 1.7).sin() * 50.0, t, (t * 0.7).cos() * 30.0)
            })
            .collect();
        let linear = Matrix3::new(1.1, 0.2, 0.0, -0.1, 0.9, 0.1, 0.0, 0.3, 1.2);
        let affine = |p: &Point| Point::from(linear * p.coords + Vector::new(1.0, 2.0, 3.0));
        let to: Vec<Point> = from.iter().map(affine).collect();
        let map = SpaceMap::between(&from, &to).unwrap();
        let elsewhere = Point::new(3.0, -7.0, 90.0);
        assert!((map.at(&elsewhere) - affine(&elsewhere)).norm() < 1e-8);

        let bent: Vec<Point> = from
            .iter()
            .map(|p| p + Vector::y() * (p.x * 0.1).sin() * 5.0)
            .collect();
        let map = SpaceMap::between(&from, &bent).unwrap();
        for (p, q) in from.iter().zip(&bent) {
            assert!((map.at(p) - q).norm() < 1e-8);
        }
        assert!(SpaceMap::between(&from[..3], &to[..3]).is_none());
    }
}
