//! Eyeballs, teeth and tongue, and the motions fitted from them.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use super::crop::mirrored_fans;
use super::source::BaseMesh;
use crate::template::{RigidBody, TemplateError};
use crate::{Point, Vector};

/// Parts that come along: name in the pack, group in the source, what it moves with.
pub(super) const PARTS: [(&str, &str, RigidBody); 5] = [
    ("eye_l", "helper-l-eye", RigidBody::EyeLeft),
    ("eye_r", "helper-r-eye", RigidBody::EyeRight),
    ("upper_teeth", "helper-upper-teeth", RigidBody::Skull),
    ("lower_teeth", "helper-lower-teeth", RigidBody::Mandible),
    ("tongue", "helper-tongue", RigidBody::Mandible),
];

/// A group cut out of the base mesh.
#[derive(Debug, Clone)]
pub(super) struct Part {
    /// Source vertex of each vertex, rising; for the right eye in the order of the left one.
    pub(super) source: Vec<u32>,
    /// Faces in the part's own vertices.
    pub(super) faces: Vec<Vec<u32>>,
}

/// Cuts out one group. The right eye is written as the mirror image of the left one.
pub(super) fn part(base: &BaseMesh, name: &str, group: &str) -> Result<Part, TemplateError> {
    if name == "eye_r" {
        let left = part(base, "eye_l", PARTS[0].1)?;
        return Ok(Part {
            source: left
                .source
                .iter()
                .map(|&s| base.mirror[s as usize])
                .collect(),
            faces: left
                .faces
                .iter()
                .map(|f| {
                    std::iter::once(f[0])
                        .chain(f[1..].iter().rev().copied())
                        .collect()
                })
                .collect(),
        });
    }
    let faces = base.group(group)?;
    let mut source: Vec<u32> = faces.iter().flatten().copied().collect();
    source.sort_unstable();
    source.dedup();
    let local = |v: u32| source.binary_search(&v).unwrap_or_default() as u32;
    let faces: Vec<Vec<u32>> = faces
        .iter()
        .map(|f| f.iter().map(|&v| local(v)).collect())
        .collect();
    if name == "eye_l" {
        return Ok(Part { source, faces });
    }
    let mirror: Vec<u32> = source
        .iter()
        .map(|&s| local(base.mirror[s as usize]))
        .collect();
    Ok(Part {
        faces: mirrored_fans(faces, &mirror)?,
        source,
    })
}

/// The sphere nearest to the points in the least-squares sense of
/// |p|^2 = 2 c.p + (r^2 - |c|^2): centre and radius.
pub(super) fn fit_sphere(points: &[Point]) -> Result<(Point, f64), TemplateError> {
    let mut normal = Matrix4::zeros();
    let mut right = Vector4::zeros();
    for p in points {
        let row = Vector4::new(2.0 * p.x, 2.0 * p.y, 2.0 * p.z, 1.0);
        normal += row * row.transpose();
        right += row * p.coords.norm_squared();
    }
    let s = normal
        .cholesky()
        .ok_or_else(|| TemplateError::Source {
            reason: "the points of an eyeball lie on a plane".to_owned(),
        })?
        .solve(&right);
    let center = Point::new(s[0], s[1], s[2]);
    Ok((center, (s[3] + center.coords.norm_squared()).sqrt()))
}

/// The turn about +X nearest to a motion of points in the (y, z) plane: angle (rad) and the
/// point that stays where it is.
pub(super) fn fit_hinge(rest: &[Point], moved: &[Point]) -> Result<(f64, Point), TemplateError> {
    let flat = |p: &Point| Vector2::new(p.y, p.z);
    let mean =
        |points: &[Point]| points.iter().map(flat).sum::<Vector2<f64>>() / points.len() as f64;
    let (rest_mean, moved_mean) = (mean(rest), mean(moved));
    let (mut cross, mut dot) = (0.0, 0.0);
    for (p, q) in rest.iter().zip(moved) {
        let (p, q) = (flat(p) - rest_mean, flat(q) - moved_mean);
        cross += p.perp(&q);
        dot += p.dot(&q);
    }
    let angle = cross.atan2(dot);
    let (sin, cos) = angle.sin_cos();
    let turn = Matrix2::new(cos, -sin, sin, cos);
    let center =
        (Matrix2::identity() - turn)
            .try_inverse()
            .ok_or_else(|| TemplateError::Source {
                reason: "the lower teeth do not turn when the jaw opens".to_owned(),
            })?
            * (moved_mean - turn * rest_mean);
    Ok((angle, Point::new(0.0, center.x, center.y)))
}

/// Mean of displacements.
pub(super) fn mean(deltas: &[Vector]) -> Vector {
    deltas.iter().sum::<Vector>() / deltas.len().max(1) as f64
}
