//! One person out of the base mesh: base + sum of weighted targets, made exactly symmetric.

use std::collections::BTreeMap;
use std::path::Path;

use super::source::{BaseMesh, Target, read_body_target};
use crate::template::TemplateError;
use crate::{Point, Vector};

/// Adds `weights` (target name -> weight) to the base mesh. [dm]
pub(super) fn identity(
    data: &Path,
    base: &BaseMesh,
    weights: &BTreeMap<String, f64>,
) -> Result<Vec<Point>, TemplateError> {
    let mut positions = base.positions.clone();
    for (name, &weight) in weights {
        for (vertex, delta) in read_body_target(data, name)? {
            *positions
                .get_mut(vertex as usize)
                .ok_or_else(|| out_of_range(name, vertex, base))? += weight * delta;
        }
    }
    Ok(positions)
}

/// One vector per vertex of the base mesh. [dm]
pub(super) fn dense(
    name: &str,
    target: &Target,
    base: &BaseMesh,
) -> Result<Vec<Vector>, TemplateError> {
    let mut dense = vec![Vector::zeros(); base.positions.len()];
    for (vertex, delta) in target {
        *dense
            .get_mut(*vertex as usize)
            .ok_or_else(|| out_of_range(name, *vertex, base))? = *delta;
    }
    Ok(dense)
}

fn out_of_range(name: &str, vertex: u32, base: &BaseMesh) -> TemplateError {
    TemplateError::OutOfRange {
        what: format!("target {name:?}"),
        found: vertex as usize,
        count: base.positions.len(),
    }
}

/// The mirror image of a vector through the plane x = 0.
pub(super) fn reflect(v: Vector) -> Vector {
    Vector::new(0.0 - v.x, v.y, v.z)
}

/// Halfway between each point and its partner's mirror image, so that partners become exact
/// mirrors of each other and self-partners come to lie on the mid plane.
pub(super) fn symmetrize(positions: &mut [Point], mirror: &[u32]) {
    let vectors: Vec<Vector> = positions.iter().map(|p| p.coords).collect();
    for (vertex, &image) in mirror.iter().enumerate() {
        positions[vertex] = Point::from((vectors[vertex] + reflect(vectors[image as usize])) / 2.0);
    }
}

/// What `right` would be on the left side, averaged with `left`. For a shape without sides
/// pass it twice.
pub(super) fn symmetric_left(left: &[Vector], right: &[Vector], mirror: &[u32]) -> Vec<Vector> {
    (0..left.len())
        .map(|v| (left[v] + reflect(right[mirror[v] as usize])) / 2.0)
        .collect()
}
