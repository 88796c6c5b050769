//! Parts without a counterpart on the face (inside of the mouth, sockets, nostrils) follow the
//! skin around them.
//!
//! Each connected part takes the similarity that its surroundings have undergone, then the
//! remaining displacement of its rim is spread inwards harmonically. A harmonic function has
//! no extremes inside, so nothing swings out through the skin, as a thin plate would do.

use nalgebra::Similarity3;

use super::RegistrationError;
use super::face_model::{FaceModel, Role};
use super::similarity::umeyama;
use super::sparse::SpdSystem;
use crate::mesh::Components;
use crate::{Point, Vector};

/// Skin within this many edges of a part tells how it moves as a whole.
const SURROUNDING_RINGS: u32 = 4;

/// Replaces the positions of hidden vertices.
pub(super) fn settle_hidden(
    model: &FaceModel<'_>,
    vertices: &mut [Point],
) -> Result<(), RegistrationError> {
    let is_hidden = |v: u32| model.roles[v as usize] == Role::Hidden;
    let hidden_edges: Vec<[u32; 2]> = model
        .topology
        .edges()
        .iter()
        .map(|e| e.vertices)
        .filter(|e| is_hidden(e[0]) && is_hidden(e[1]))
        .collect();
    let parts = Components::from_faces(vertices.len(), hidden_edges.iter().map(|e| &e[..]));
    let mut numbers = vec![u32::MAX; vertices.len()];
    let mut hidden = Vec::new();
    for v in (0..vertices.len() as u32).filter(|&v| is_hidden(v)) {
        numbers[v as usize] = hidden.len() as u32;
        hidden.push(v);
    }
    if hidden.is_empty() {
        return Ok(());
    }
    let moves: Vec<Similarity3<f64>> = parts
        .vertices()
        .iter()
        .map(|part| {
            if is_hidden(part[0]) {
                surrounding_move(model, part, vertices)
            } else {
                Similarity3::identity()
            }
        })
        .collect();

    let count = hidden.len();
    let pairs: Vec<(u32, u32)> = hidden_edges
        .iter()
        .map(|e| (numbers[e[0] as usize], numbers[e[1] as usize]))
        .collect();
    let mut system = SpdSystem::new(count, &pairs)?;
    let mut rhs = vec![0.0; 3 * count];
    for (k, &v) in hidden.iter().enumerate() {
        let own = &moves[parts.of_vertex(v) as usize];
        // Parts without a rim stay where the similarity puts them.
        system.add(k as u32, k as u32, 1e-6);
        for &n in model.topology.neighbours(v) {
            system.add(k as u32, k as u32, 1.0);
            if is_hidden(n) {
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
    for (k, &v) in hidden.iter().enumerate() {
        let own = &moves[parts.of_vertex(v) as usize];
        vertices[v as usize] = own.transform_point(&model.positions()[v as usize])
            + Vector::new(rhs[k], rhs[count + k], rhs[2 * count + k]);
    }
    Ok(())
}

/// The similarity of the skin around a part, from the template to `vertices`.
fn surrounding_move(model: &FaceModel<'_>, part: &[u32], vertices: &[Point]) -> Similarity3<f64> {
    let rings = model.topology.rings(part, SURROUNDING_RINGS);
    let around: Vec<usize> = (0..vertices.len())
        .filter(|&v| rings[v] != u32::MAX && model.roles[v] != Role::Hidden)
        .collect();
    let from: Vec<Point> = around.iter().map(|&v| model.positions()[v]).collect();
    let to: Vec<Point> = around.iter().map(|&v| vertices[v]).collect();
    let weights = vec![1.0; around.len()];
    umeyama(&from, &to, &weights).unwrap_or_else(Similarity3::identity)
}
