//! Deformation transfer: a face repeats how each triangle of a template turns and stretches.
//!
//! With the deformation gradient `S_t` of triangle `t` under a shape of the template (its third
//! direction the normal, which grows as the root of area), the displacements `u` on the face
//! minimize
//!
//! `sum_t sum_edges c_t |(u_i - u_j) - (S_t - I)(x_i - x_j)|^2`,
//!
//! with cotangents `c_t` of the face, and with vertices that no shape of the template moves held
//! still.
//!
//! # Source
//!
//! Sumner & Popovic 2004; as a Poisson problem Botsch, Sumner, Pauly & Gross 2006.

use nalgebra::Matrix3;

use super::TransferError;
use crate::registration::SpdSystem;
use crate::template::Template;
use crate::{Point, Vector};

/// Least cotangent: an edge across from a right or blunt angle still holds.
const LEAST_COTANGENT: f64 = 0.05;
/// Largest cotangent: slivers do not decide.
const LARGEST_COTANGENT: f64 = 10.0;
/// A vertex that no shape moves by more is held. (mm)
const STILL: f64 = 1e-6;
/// Pull of vertices to where they are, against a cotangent of 1: pieces without any vertex to
/// hold them would have no answer.
const REGULARIZATION: f64 = 1e-9;

/// The Poisson problem of one face.
pub(super) struct PoissonTransfer<'a> {
    rest: &'a [Point],
    positions: &'a [Point],
    triangles: Vec<[u32; 3]>,
    /// Cotangent at each corner, for the edge across from it.
    cotangents: Vec<[f64; 3]>,
    /// Unknown of each vertex; `None` where it is held.
    unknowns: Vec<Option<u32>>,
    system: SpdSystem,
    unknown_count: usize,
}

impl<'a> PoissonTransfer<'a> {
    pub(super) fn new(
        template: &'a Template,
        positions: &'a [Point],
    ) -> Result<Self, TransferError> {
        let rest = template.skin.positions();
        let triangles = template.skin.triangles();
        let mut is_free = vec![false; rest.len()];
        for &(v, delta) in template.shapes.iter().flat_map(|shape| &shape.deltas) {
            is_free[v as usize] |= delta.norm() > STILL;
        }
        let mut unknown_count = 0u32;
        let unknowns: Vec<Option<u32>> = is_free
            .iter()
            .map(|free| {
                free.then(|| {
                    unknown_count += 1;
                    unknown_count - 1
                })
            })
            .collect();
        let cotangents: Vec<[f64; 3]> = triangles
            .iter()
            .map(|t| {
                [0, 1, 2].map(|k| {
                    let [a, b, c] = [0, 1, 2].map(|j| positions[t[(k + j) % 3] as usize]);
                    let (u, v) = (b - a, c - a);
                    let cotangent = u.dot(&v) / u.cross(&v).norm().max(f64::MIN_POSITIVE);
                    cotangent.clamp(LEAST_COTANGENT, LARGEST_COTANGENT)
                })
            })
            .collect();
        let edges = || {
            triangles
                .iter()
                .zip(&cotangents)
                .flat_map(|(t, c)| [0, 1, 2].map(|k| (t[(k + 1) % 3], t[(k + 2) % 3], c[k])))
        };
        let unknown = |v: u32| unknowns[v as usize];
        let pairs: Vec<(u32, u32)> = edges()
            .filter_map(|(i, j, _)| Some((unknown(i)?, unknown(j)?)))
            .collect();
        let unsolvable = |_| TransferError::Unsolvable {
            unknowns: unknown_count as usize,
        };
        let mut system = SpdSystem::new(unknown_count as usize, &pairs).map_err(unsolvable)?;
        for u in 0..unknown_count {
            system.add(u, u, REGULARIZATION);
        }
        for (i, j, c) in edges() {
            for v in [i, j] {
                if let Some(u) = unknown(v) {
                    system.add(u, u, c);
                }
            }
            if let (Some(i), Some(j)) = (unknown(i), unknown(j)) {
                system.add(i, j, -c);
            }
        }
        system.factorize().map_err(unsolvable)?;
        Ok(Self {
            rest,
            positions,
            triangles,
            cotangents,
            unknowns,
            system,
            unknown_count: unknown_count as usize,
        })
    }

    /// Displacements of the face that repeat those of the template. (mm)
    pub(super) fn put(&mut self, deltas: &[Vector]) -> Result<Vec<Vector>, TransferError> {
        let n = self.unknown_count;
        // Column-major: all x, all y, all z.
        let mut rhs = vec![0.0; 3 * n];
        for (t, cotangents) in self.triangles.iter().zip(&self.cotangents) {
            let corners = t.map(|v| v as usize);
            if corners.iter().all(|&v| deltas[v] == Vector::zeros()) {
                continue;
            }
            let rest = corners.map(|v| self.rest[v]);
            let moved = corners.map(|v| self.rest[v] + deltas[v]);
            let change = gradient(rest, moved) - Matrix3::identity();
            for k in 0..3 {
                let (i, j) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
                let flow = cotangents[k] * (change * (self.positions[i] - self.positions[j]));
                for (v, sign) in [(i, 1.0), (j, -1.0)] {
                    if let Some(u) = self.unknowns[v] {
                        for axis in 0..3 {
                            rhs[axis * n + u as usize] += sign * flow[axis];
                        }
                    }
                }
            }
        }
        self.system.solve_factorized(&mut rhs);
        Ok(self
            .unknowns
            .iter()
            .map(|unknown| {
                unknown.map_or_else(Vector::zeros, |u| {
                    let u = u as usize;
                    Vector::new(rhs[u], rhs[n + u], rhs[2 * n + u])
                })
            })
            .collect())
    }
}

/// The linear map that takes a triangle with its normal to another; the identity for one
/// without area.
fn gradient(from: [Point; 3], to: [Point; 3]) -> Matrix3<f64> {
    let frame = |[a, b, c]: [Point; 3]| {
        let (u, v) = (b - a, c - a);
        let normal = u.cross(&v);
        let length = normal.norm().sqrt();
        (length > 0.0).then(|| Matrix3::from_columns(&[u, v, normal / length]))
    };
    let Some((from, to)) = frame(from).zip(frame(to)) else {
        return Matrix3::identity();
    };
    from.try_inverse()
        .map_or_else(Matrix3::identity, |inverse| to * inverse)
}
