//! Pieces of the user's mesh that are not skin: eyeballs, teeth, tongue.

use nalgebra::Similarity3;
use serde::{Deserialize, Serialize};

use super::clean::CleanMesh;
use super::face_model::{FaceModel, OpeningKind};
use crate::mesh::Mesh;
use crate::template::RigidBody;
use crate::{Point, Vector};

/// A piece of the user's mesh that moves rigidly.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RigidComponent {
    /// Vertices of the user's mesh, rising.
    pub vertices: Vec<u32>,
    /// What it moves with.
    pub body: RigidBody,
}

/// Recognises the pieces other than the face itself.
///
/// - `positions`: clean positions in the head frame (mm); `registered`: the template there
pub(super) fn recognise(
    model: &FaceModel<'_>,
    clean: &CleanMesh,
    face_piece: usize,
    positions: &[Point],
    registered: &[Point],
) -> Vec<RigidComponent> {
    let eyes = eye_centers(model, registered);
    let mouth_shift = mouth_shift(model, registered);
    let mut users: Vec<Vec<u32>> = vec![Vec::new(); clean.positions.len()];
    for (user, &v) in clean.from_user.iter().enumerate() {
        users[v as usize].push(user as u32);
    }
    let mut components = Vec::new();
    for (k, piece) in clean.pieces.iter().enumerate() {
        if k == face_piece {
            continue;
        }
        let points: Vec<Point> = piece
            .vertices
            .iter()
            .map(|&v| positions[v as usize])
            .collect();
        let body = eye_of(&points, &eyes).or_else(|| mouth_part(model, &points, mouth_shift));
        if let Some(body) = body {
            let mut vertices: Vec<u32> = piece
                .vertices
                .iter()
                .flat_map(|&v| users[v as usize].iter().copied())
                .collect();
            vertices.sort_unstable();
            components.push(RigidComponent { vertices, body });
        }
    }
    components
}

/// Where the eyeballs of the registered face should be, with the template's radii, left first.
fn eye_centers(model: &FaceModel<'_>, registered: &[Point]) -> Vec<(RigidBody, Point, f64)> {
    let mut eyes = Vec::new();
    for (kind, body, eye) in [
        (
            OpeningKind::LeftEye,
            RigidBody::EyeLeft,
            &model.template.eyes[0],
        ),
        (
            OpeningKind::RightEye,
            RigidBody::EyeRight,
            &model.template.eyes[1],
        ),
    ] {
        if let Some(opening) = model.openings.iter().find(|o| o.kind == kind) {
            let ring: Vec<u32> = opening
                .upper
                .iter()
                .chain(&opening.lower)
                .copied()
                .collect();
            let shift = mean(registered, &ring) - mean(model.positions(), &ring);
            eyes.push((body, eye.center + shift, eye.radius));
        }
    }
    eyes
}

/// The template's eyeball, placed behind the registered lids of `kind`. (mm)
pub(super) fn eyeball(
    model: &FaceModel<'_>,
    registered: &[Point],
    kind: OpeningKind,
) -> Option<(RigidBody, Mesh)> {
    let (body, eye) = match kind {
        OpeningKind::Mouth => return None,
        OpeningKind::LeftEye => (RigidBody::EyeLeft, &model.template.eyes[0]),
        OpeningKind::RightEye => (RigidBody::EyeRight, &model.template.eyes[1]),
    };
    let (_, center, _) = eye_centers(model, registered)
        .into_iter()
        .find(|e| e.0 == body)?;
    let part = model
        .template
        .rigid_parts
        .iter()
        .find(|p| p.follows == body)?;
    let shift = center - eye.center;
    let positions = part.mesh.positions().iter().map(|p| p + shift).collect();
    Some((body, part.mesh.with_positions(positions).ok()?))
}

/// Where the face's eyes are, left first: the middles of its eyeballs where it has them, else
/// behind its lids where these are open. In the frame that `to_head` leads to. (mm)
pub(super) fn found_eyes(
    model: &FaceModel<'_>,
    clean: &CleanMesh,
    to_head: &Similarity3<f64>,
    registered: &[Point],
    has_open_eyes: bool,
) -> Option<[Point; 2]> {
    let [left, right] = eye_centers(model, registered)[..] else {
        return None;
    };
    let ball = |(_, expected, radius): (RigidBody, Point, f64)| {
        clean
            .pieces
            .iter()
            .filter_map(|p| p.sphere)
            .map(|s| {
                (
                    to_head.transform_point(&s.center),
                    s.radius * to_head.scaling(),
                )
            })
            .filter(|(c, r)| (c - expected).norm() < radius && (0.6..1.5).contains(&(r / radius)))
            .min_by(|a, b| (a.0 - expected).norm().total_cmp(&(b.0 - expected).norm()))
            .map(|(center, _)| center)
    };
    match (ball(left), ball(right)) {
        (Some(l), Some(r)) => Some([l, r]),
        _ => has_open_eyes.then_some([left.1, right.1]),
    }
}

/// A piece is an eye's when all of it lies within the eyeball, with room for size and place.
fn eye_of(points: &[Point], eyes: &[(RigidBody, Point, f64)]) -> Option<RigidBody> {
    eyes.iter()
        .find(|(_, center, radius)| points.iter().all(|p| (p - center).norm() < 1.5 * radius))
        .map(|e| e.0)
}

/// How far the mouth has moved from the template's.
fn mouth_shift(model: &FaceModel<'_>, registered: &[Point]) -> Vector {
    model
        .openings
        .iter()
        .find(|o| o.kind == OpeningKind::Mouth)
        .map_or_else(Vector::zeros, |o| {
            let ring: Vec<u32> = o.upper.iter().chain(&o.lower).copied().collect();
            mean(registered, &ring) - mean(model.positions(), &ring)
        })
}

/// A piece that lies where the template's teeth and tongue are moves as the nearest of them.
fn mouth_part(model: &FaceModel<'_>, points: &[Point], shift: Vector) -> Option<RigidBody> {
    const ROOM_MM: f64 = 9.0;
    let parts: Vec<_> = model
        .template
        .rigid_parts
        .iter()
        .filter(|p| matches!(p.follows, RigidBody::Skull | RigidBody::Mandible))
        .collect();
    let all: Vec<Point> = parts
        .iter()
        .flat_map(|p| p.mesh.positions().iter().map(|q| q + shift))
        .collect();
    let (low, high) = bounds(&all)?;
    let inside = points
        .iter()
        .all(|p| (0..3).all(|c| p[c] > low[c] - ROOM_MM && p[c] < high[c] + ROOM_MM));
    let (own_low, own_high) = bounds(points)?;
    let center = nalgebra::center(&own_low, &own_high);
    parts
        .iter()
        .filter(|_| inside)
        .filter_map(|p| {
            let (low, high) = bounds(p.mesh.positions())?;
            Some((
                (nalgebra::center(&low, &high) + shift - center).norm(),
                p.follows,
            ))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, body)| body)
}

fn bounds(points: &[Point]) -> Option<(Point, Point)> {
    let first = *points.first()?;
    Some(
        points
            .iter()
            .fold((first, first), |(low, high), p| (low.inf(p), high.sup(p))),
    )
}

/// Mean position of some vertices.
fn mean(positions: &[Point], vertices: &[u32]) -> Point {
    let sum: Vector = vertices.iter().map(|&v| positions[v as usize].coords).sum();
    Point::from(sum / vertices.len().max(1) as f64)
}
