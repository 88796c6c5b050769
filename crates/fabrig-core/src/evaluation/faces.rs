//! Faces that have their own expressions, made of bundled people.
//!
//! The people share the template's shapes, displacement for displacement, so delta transfer
//! would be right on them by construction. Two ways out, both with everything about them known,
//! and both labelled synthetic:
//!
//! - *warped*: a person with the template's displacements, neutral and expressions put through
//!   one nonlinear map of space of a few millimetres;
//! - *carried*: template and expressions put through the smooth map of space that takes the
//!   template to the person, then through such a map: expressions grow and turn with the face.

use super::space_map::SpaceMap;
use crate::Point;
use crate::mesh::{Mesh, MeshError};
use crate::registration::bench::Specimen;
use crate::rig::Expression;
use crate::template::{Template, people};

/// Every how many of the template's vertices fix the map that carries it to a person.
const STRIDE: usize = 8;
/// Strength of the nonlinear map, as in the cases of registration.
const WARP: f64 = 1.0;

/// A neutral face with expressions of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnFace {
    /// Name, with how it was made.
    pub name: String,
    /// Whether it was made rather than captured or sculpted.
    pub is_synthetic: bool,
    /// The neutral mesh, in any unit.
    pub neutral: Mesh,
    /// Expressions on it, each one shape of the template at weight 1.
    pub expressions: Vec<Expression>,
}

/// The bundled people as warped and as carried faces, remeshed so that nothing shares the
/// template's vertices.
///
/// - `filter`: only faces whose name holds it
///
/// # Errors
///
/// [`MeshError`] where a face cannot be made.
pub fn synthetic_faces(template: &Template, filter: &str) -> Result<Vec<OwnFace>, MeshError> {
    let rest = template.skin.positions();
    let mut faces = Vec::new();
    for (seed, person) in people().iter().enumerate() {
        for kind in ["warped", "carried"] {
            let name = format!("{} {kind}", person.name);
            if !name.contains(filter) {
                continue;
            }
            let map = if kind == "carried" {
                let pick = |points: &[Point]| -> Vec<Point> {
                    points.iter().step_by(STRIDE).copied().collect()
                };
                SpaceMap::between(&pick(rest), &pick(&person.positions))
            } else {
                None
            };
            let posed = |deltas: &[(u32, crate::Vector)]| -> Result<Mesh, MeshError> {
                let mut at = match &map {
                    Some(_) => rest.to_vec(),
                    None => person.positions.clone(),
                };
                for &(v, delta) in deltas {
                    at[v as usize] += delta;
                }
                if let Some(map) = &map {
                    at = at.iter().map(|p| map.at(p)).collect();
                }
                Specimen::from_truth(template, &at)
                    .remeshed()
                    .warped(seed as u64 + 100, WARP)
                    .mesh()
            };
            let neutral = posed(&[])?;
            let mut expressions = Vec::new();
            for (index, shape) in template.shapes.iter().enumerate() {
                let mut weights = vec![0.0; template.shapes.len()];
                weights[index] = 1.0;
                expressions.push(Expression {
                    name: shape.name.clone(),
                    weights,
                    positions: posed(&shape.deltas)?.positions().to_vec(),
                });
            }
            faces.push(OwnFace {
                name,
                is_synthetic: true,
                neutral,
                expressions,
            });
        }
    }
    Ok(faces)
}
