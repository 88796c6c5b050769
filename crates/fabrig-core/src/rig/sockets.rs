//! Where the eyes and the jaw's hinge of a face are, from its normalized skin.

use crate::template::{EyeSocket, JawHinge, Template};
use crate::{Point, Vector};

/// Landmarks whose mean motion carries the hinge from the template to a face, each with its
/// mirror image.
const HINGE_LANDMARKS: [&str; 2] = ["tmj_", "ear_front_mid_"];
/// Landmarks around one eye that carry its socket.
const EYE_LANDMARKS: [&str; 4] = ["eye_inner_", "eye_outer_", "orbit_top_", "orbit_bottom_"];

/// The hinge under a face, and the size of its jaw against the template's.
///
/// The centre moves as the skin over both joints does; the axis stays across the head.
pub(super) fn fit_hinge(template: &Template, positions: &[Point]) -> (JawHinge, f64) {
    let rest = template.skin.positions();
    let marks: Vec<usize> = HINGE_LANDMARKS
        .iter()
        .flat_map(|name| ["l", "r"].map(|side| format!("{name}{side}")))
        .filter_map(|name| template.landmarks.get(&name).map(|&v| v as usize))
        .collect();
    let mut hinge = template.jaw;
    if !marks.is_empty() {
        let shift: Vector = marks.iter().map(|&v| positions[v] - rest[v]).sum();
        hinge.center += shift / marks.len() as f64;
    }
    let scale = template.landmarks.get("pogonion").map_or(1.0, |&chin| {
        let chin = chin as usize;
        let ratio =
            (positions[chin] - hinge.center).norm() / (rest[chin] - template.jaw.center).norm();
        if ratio.is_finite() { ratio } else { 1.0 }
    });
    (hinge, scale)
}

/// The eye sockets under a face: the template's, moved and scaled with the skin around them.
pub(super) fn fit_eyes(template: &Template, positions: &[Point]) -> [EyeSocket; 2] {
    let rest = template.skin.positions();
    let mut eyes = template.eyes;
    for (eye, side) in eyes.iter_mut().zip(["l", "r"]) {
        let marks: Vec<usize> = EYE_LANDMARKS
            .iter()
            .filter_map(|name| template.landmarks.get(&format!("{name}{side}")))
            .map(|&v| v as usize)
            .collect();
        if marks.len() < 2 {
            continue;
        }
        let center = |of: &[Point]| {
            let sum: Vector = marks.iter().map(|&v| of[v].coords).sum();
            Point::from(sum / marks.len() as f64)
        };
        let size = |of: &[Point], middle: Point| {
            marks.iter().map(|&v| (of[v] - middle).norm()).sum::<f64>()
        };
        let (from, to) = (center(rest), center(positions));
        let ratio = size(positions, to) / size(rest, from);
        let ratio = if ratio.is_finite() {
            ratio.clamp(0.5, 2.0)
        } else {
            1.0
        };
        eye.center = to + ratio * (eye.center - from);
        eye.radius *= ratio;
    }
    eyes
}
