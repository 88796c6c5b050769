//! A face's own expressions, carried onto the template's topology.

use crate::mesh::{Mesh, Surface};
use crate::registration::Registration;
use crate::rig::RigError;
use crate::template::Template;
use crate::transfer::{Example, TransferError};
use crate::{Point, Vector};

/// An expression of a face, on the face's own mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    /// Name, for reports.
    pub name: String,
    /// Weights of the template's shapes that make it.
    pub weights: Vec<f32>,
    /// The posed vertices, in the units and order of the neutral mesh.
    pub positions: Vec<Point>,
}

/// A vertex of the template farther from the mesh has no displacement of its own. (mm)
const REACH: f64 = 8.0;

/// Carries expressions onto the template: every vertex takes the displacement of the nearest
/// place of the mesh, on its own side of lips and lids.
///
/// # Errors
///
/// [`TransferError::Example`] for an expression that does not have the mesh's vertices or has
/// some that are not finite; [`RigError::Surface`] where the mesh has no surface.
pub fn carry_expressions(
    face: &Mesh,
    registration: &Registration,
    template: &Template,
    expressions: &[Expression],
) -> Result<Vec<Example>, RigError> {
    if expressions.is_empty() {
        return Ok(Vec::new());
    }
    for expression in expressions {
        let wrong = |reason: String| TransferError::Example {
            name: expression.name.clone(),
            reason,
        };
        if expression.positions.len() != face.vertex_count() {
            return Err(wrong(format!(
                "it has {} vertices, the neutral face {}",
                expression.positions.len(),
                face.vertex_count()
            ))
            .into());
        }
        let bad = expression.positions.iter();
        if let Some(v) = bad
            .clone()
            .position(|p| !p.coords.iter().all(|c| c.is_finite()))
        {
            return Err(wrong(format!("vertex {v} is not finite")).into());
        }
    }
    let to_head = registration.to_head;
    let rest: Vec<Point> = face.positions().iter().map(|p| to_head * p).collect();
    let triangles = face.triangles();
    let surface = Surface::new(&rest, &triangles)?;
    let is_part = registration.part_mask();
    let regions = &template.regions;
    let places: Vec<_> = registration
        .positions
        .iter()
        .enumerate()
        .map(|(v, place)| {
            let own = regions.vertex_regions[v];
            surface.closest_where(place, REACH, |hit| {
                triangles[hit.triangle as usize].iter().all(|&corner| {
                    let other = registration.face_regions[corner as usize];
                    !is_part[corner as usize] && !regions.are_apart(own, other)
                })
            })
        })
        .collect();
    let is_seen: Vec<bool> = places.iter().map(Option::is_some).collect();
    Ok(expressions
        .iter()
        .map(|expression| {
            let moved: Vec<Vector> = expression
                .positions
                .iter()
                .zip(&rest)
                .map(|(p, rest)| to_head * p - rest)
                .collect();
            let at = |place: &Option<_>| {
                place
                    .as_ref()
                    .map_or_else(Vector::zeros, |place| surface.blend(place, &moved))
            };
            Example {
                name: expression.name.clone(),
                weights: expression.weights.clone(),
                deltas: places.iter().map(at).collect(),
                is_seen: is_seen.clone(),
            }
        })
        .collect())
}
