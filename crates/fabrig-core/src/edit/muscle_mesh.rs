//! One muscle shape as a mesh, out to a modelling program and back.

use nalgebra::{Point3, Vector3};

use super::apply::find_shape;
use super::{EditError, Edits, ShapeEdit};
use crate::Point;
use crate::mesh::{Mesh, Polygons};
use crate::rig::Rig;
use crate::transfer::ShapeWeights;

/// Nodes that an import moves by less stay as they are: OBJ text is rounded. (mm)
const UNMOVED: f64 = 0.005;

/// Names of a rig's muscle shapes, patch after patch.
pub fn muscle_shape_names(rig: &Rig) -> Vec<&str> {
    let shapes = rig.patches.iter().flat_map(|p| &p.transfer.shapes);
    shapes.map(|s| s.name.as_str()).collect()
}

/// A patch with one of its shapes at weight 1: a grid of quads [mm, head frame], vertices in
/// the order of its nodes.
///
/// # Errors
///
/// [`EditError::UnknownName`].
pub fn export_muscle_shape(rig: &Rig, name: &str) -> Result<Mesh, EditError> {
    let (patch, place) = find_shape(rig, name)?;
    let positions = at_full_weight(rig, patch, place);
    let quads = rig.patches[patch].patch.chart.grid.quads();
    Ok(Mesh::new(positions, Polygons::from_faces(quads))?)
}

fn at_full_weight(rig: &Rig, patch: usize, place: usize) -> Vec<Point> {
    let patch = &rig.patches[patch];
    let mut weights = vec![0.0; rig.shape_names.len()];
    weights[patch.transfer.shapes[place].shape as usize] = 1.0;
    let neutral: Vec<Point3<f32>> = patch.patch.neutral.iter().map(|q| q.cast()).collect();
    let mut positions = neutral.clone();
    let mut velocities = vec![Vector3::zeros(); neutral.len()];
    // Another edit's held weights would be in the mesh, and come back twice.
    let mut transfer = patch.transfer.clone();
    transfer.held.clear();
    transfer.evaluate(
        &rig.transfer_context(),
        &neutral,
        ShapeWeights {
            weights: &weights,
            rates: None,
        },
        &mut positions,
        &mut velocities,
    );
    positions.iter().map(|p| p.cast()).collect()
}

/// Takes the mesh of one muscle shape, changed elsewhere, into the edits.
///
/// - `rig`: as it was when the shape was exported, without these edits' displacements of it
/// - `mesh`: as [`export_muscle_shape`] gives it, vertices moved
///
/// Returns how many nodes are moved. Displacements of the shape that the edits had are
/// replaced; its strength and weight stay.
///
/// # Errors
///
/// [`EditError::UnknownName`], [`EditError::VertexCount`].
pub fn import_muscle_shape(
    rig: &Rig,
    name: &str,
    mesh: &Mesh,
    edits: &mut Edits,
) -> Result<usize, EditError> {
    let (patch, place) = find_shape(rig, name)?;
    let before = at_full_weight(rig, patch, place);
    if mesh.vertex_count() != before.len() {
        return Err(EditError::VertexCount {
            name: name.to_owned(),
            expected: before.len(),
            found: mesh.vertex_count(),
        });
    }
    // Micrometres are enough, and keep the text short.
    let rounded = |c: f64| (c * 1e3).round() * 1e-3;
    let moved = before
        .iter()
        .zip(mesh.positions())
        .enumerate()
        .map(|(node, (before, after))| (node, after - before))
        .filter(|(_, by)| by.norm() > UNMOVED)
        .map(|(node, by)| (node.to_string(), [by.x, by.y, by.z].map(rounded)))
        .collect();
    let edit: &mut ShapeEdit = edits.shapes.entry(name.to_owned()).or_default();
    edit.moved = moved;
    let count = edit.moved.len();
    if *edit == ShapeEdit::default() {
        edits.shapes.remove(name);
    }
    Ok(count)
}
