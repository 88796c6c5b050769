//! Vertices that follow their surroundings: parts without a counterpart on the face (inside of
//! the mouth, sockets, nostrils) and places where the surface has folded.
//!
//! Each connected part takes the similarity that its surroundings have undergone, then the
//! remaining displacement of its rim is spread inwards harmonically. A harmonic function has
//! no extremes inside, so nothing swings out through the skin, as a thin plate would do.

use nalgebra::Similarity3;

use super::RegistrationError;
use super::face_model::{FaceModel, Role};
use super::report::folded_triangles;
use super::similarity::umeyama;
use super::sparse::SpdSystem;
use crate::mesh::Components;
use crate::{Point, Vector};

/// Skin within this many edges of a part tells how it moves as a whole.
const SURROUNDING_RINGS: u32 = 4;
/// A fold is smoothed over this many edges around it at most.
const MAX_UNFOLD_RINGS: u32 = 6;

/// Replaces the positions of hidden vertices.
pub(super) fn settle_hidden(
    model: &FaceModel<'_>,
    vertices: &mut [Point],
) -> Result<(), RegistrationError> {
    let is_free: Vec<bool> = model.roles.iter().map(|r| *r == Role::Hidden).collect();
    settle(model, vertices, &is_free)
}

/// Smooths the surroundings of folded triangles, wider while folds are left.
pub(super) fn unfold(
    model: &FaceModel<'_>,
    vertices: &mut [Point],
) -> Result<(), RegistrationError> {
    for rings in 0..=MAX_UNFOLD_RINGS {
        let folded = folded_triangles(model, vertices);
        if folded.is_empty() {
            break;
        }
        let seeds: Vec<u32> = folded
            .iter()
            .flat_map(|&t| model.triangles[t as usize])
            .collect();
        let is_free: Vec<bool> = model
            .topology
            .rings(&seeds, rings)
            .iter()
            .map(|r| *r != u32::MAX)
            .collect();
        settle(model, vertices, &is_free)?;
    }
    Ok(())
}

/// Replaces the positions of free vertices.
fn settle(
    model: &FaceModel<'_>,
    vertices: &mut [Point],
    is_free: &[bool],
) -> Result<(), RegistrationError> {
    let free_edges: Vec<[u32; 2]> = model
        .topology
        .edges()
        .iter()
        .map(|e| e.vertices)
        .filter(|e| is_free[e[0] as usize] && is_free[e[1] as usize])
        .collect();
    let parts = Components::from_faces(vertices.len(), free_edges.iter().map(|e| &e[..]));
    let mut numbers = vec![u32::MAX; vertices.len()];
    let mut free = Vec::new();
    for v in (0..vertices.len() as u32).filter(|&v| is_free[v as usize]) {
        numbers[v as usize] = free.len() as u32;
        free.push(v);
    }
    if free.is_empty() {
        return Ok(());
    }
    let moves: Vec<Similarity3<f64>> = parts
        .vertices()
        .iter()
        .map(|part| {
            if is_free[part[0] as usize] {
                surrounding_move(model, part, vertices, is_free)
            } else {
                Similarity3::identity()
            }
        })
        .collect();

    let count = free.len();
    let pairs: Vec<(u32, u32)> = free_edges
        .iter()
        .map(|e| (numbers[e[0] as usize], numbers[e[1] as usize]))
        .collect();
    let mut system = SpdSystem::new(count, &pairs)?;
    let mut rhs = vec![0.0; 3 * count];
    for (k, &v) in free.iter().enumerate() {
        let own = &moves[parts.of_vertex(v) as usize];
        // Parts without a rim stay where the similarity puts them.
        system.add(k as u32, k as u32, 1e-6);
        for &n in model.topology.neighbours(v) {
            system.add(k as u32, k as u32, 1.0);
            if is_free[n as usize] {
                if n > v {
                    system.add(k as u32, numbers[n as usize], -1.0);
                }
            } else {
                let rest = model.positions()[n as usize];
                let left: Vector = vertices[n as usize] - own.transform_point(&rest);
                for c in 0..3 {
                    rhs[c * count + k] += left[c];
                }
            }
        }
    }
    system.solve(&mut rhs)?;
    for (k, &v) in free.iter().enumerate() {
        let own = &moves[parts.of_vertex(v) as usize];
        vertices[v as usize] = own.transform_point(&model.positions()[v as usize])
            + Vector::new(rhs[k], rhs[count + k], rhs[2 * count + k]);
    }
    Ok(())
}

/// The similarity of the skin around a part, from the template to `vertices`.
fn surrounding_move(
    model: &FaceModel<'_>,
    part: &[u32],
    vertices: &[Point],
    is_free: &[bool],
) -> Similarity3<f64> {
    let rings = model.topology.rings(part, SURROUNDING_RINGS);
    let around: Vec<usize> = (0..vertices.len())
        .filter(|&v| rings[v] != u32::MAX && !is_free[v] && model.roles[v] != Role::Hidden)
        .collect();
    let from: Vec<Point> = around.iter().map(|&v| model.positions()[v]).collect();
    let to: Vec<Point> = around.iter().map(|&v| vertices[v]).collect();
    let weights = vec![1.0; around.len()];
    umeyama(&from, &to, &weights).unwrap_or_else(Similarity3::identity)
}
