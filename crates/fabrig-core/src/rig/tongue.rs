//! Parts that deform: the user's tongue moves as the template's does (`tongueOut`).
//!
//! A piece of the user's mesh is the tongue when it fits the template's deforming part better
//! than any rigid one that follows the same bone. Both are brought to one box; each vertex
//! takes the motion of the template's vertices around it, scaled with the box.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::rig::RigPart;
use crate::template::{RigidPart, Template};
use crate::{Point, Vector};

/// Width of the kernel that template vertices are averaged with. (mm)
const KERNEL_WIDTH: f64 = 3.0;
/// A piece that is further from the template's part than this (mean of both ways) is
/// something else. (mm)
const FURTHEST: f64 = 8.0;

/// What a shape does to a part besides moving it rigidly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartShape {
    /// Index among the shapes of the rig.
    pub shape: u32,
    /// Displacement of each vertex of the part at weight 1, before the part's rigid motion.
    /// (mm)
    pub deltas: Vec<Vector3<f32>>,
}

/// Gives the part that fits each deforming part of the template its shapes.
///
/// - `positions`: the user's mesh in the head frame (mm)
/// - `registered`: the face in the template's topology (mm)
pub(super) fn give_shapes(
    template: &Template,
    registered: &[Point],
    positions: &[Point],
    parts: &mut [RigPart],
) {
    let shift = mouth_shift(template, registered);
    for &(shape, moving, ref deltas) in &template.part_deltas {
        let moving = moving as usize;
        let Some(best) = find(template, moving, shift, positions, parts) else {
            continue;
        };
        let piece: Vec<Point> = points_of(&parts[best], positions);
        let model = template.rigid_parts[moving].mesh.positions();
        let deltas = carry(model, deltas, &piece);
        parts[best].shapes.push(PartShape { shape, deltas });
        let name = &template.rigid_parts[moving].name;
        if parts.iter().all(|p| p.name != *name) {
            parts[best].name.clone_from(name);
        }
    }
}

/// The user's piece that is the template's part `moving`, if there is one.
fn find(
    template: &Template,
    moving: usize,
    shift: Vector,
    positions: &[Point],
    parts: &[RigPart],
) -> Option<usize> {
    let models = &template.rigid_parts;
    let follows = models[moving].follows;
    let distance = |model: &RigidPart, piece: &[Point]| {
        let moved: Vec<Point> = model.mesh.positions().iter().map(|p| p + shift).collect();
        0.5 * (mean_distance(&moved, piece) + mean_distance(piece, &moved))
    };
    let mut best: Option<(f64, usize)> = None;
    for (index, part) in parts.iter().enumerate() {
        if part.follows != follows || part.vertices.is_empty() {
            continue;
        }
        let piece = points_of(part, positions);
        let own = distance(&models[moving], &piece);
        let is_other = models.iter().enumerate().any(|(m, model)| {
            m != moving && model.follows == follows && distance(model, &piece) < own
        });
        if own < FURTHEST && !is_other && best.is_none_or(|(least, _)| own < least) {
            best = Some((own, index));
        }
    }
    best.map(|(_, index)| index)
}

fn points_of(part: &RigPart, positions: &[Point]) -> Vec<Point> {
    part.vertices
        .iter()
        .map(|&v| positions[v as usize])
        .collect()
}

/// How far the lips of the face lie from the template's. (mm)
fn mouth_shift(template: &Template, registered: &[Point]) -> Vector {
    let rest = template.skin.positions();
    let lips = ["upper_lip", "lower_lip"].map(|name| template.regions.find(name));
    let members: Vec<usize> = (0..rest.len())
        .filter(|&v| lips.contains(&Some(template.regions.vertex_regions[v])))
        .collect();
    let sum: Vector = members.iter().map(|&v| registered[v] - rest[v]).sum();
    sum / members.len().max(1) as f64
}

/// Mean distance from points to the nearest of others. (mm)
fn mean_distance(from: &[Point], to: &[Point]) -> f64 {
    // A few hundred points tell where a piece is as well as all of them.
    let stride = (from.len() / 256).max(1);
    let (mut sum, mut count) = (0.0, 0.0);
    for p in from.iter().step_by(stride) {
        let nearest = to
            .iter()
            .map(|q| (q - p).norm_squared())
            .fold(f64::INFINITY, f64::min);
        sum += nearest.sqrt();
        count += 1.0;
    }
    if count > 0.0 {
        sum / count
    } else {
        f64::INFINITY
    }
}

/// Displacements of the template's part, put on a piece of other topology and size.
fn carry(model: &[Point], deltas: &[Vector], piece: &[Point]) -> Vec<Vector3<f32>> {
    let (low, high) = bounds(model);
    let (own_low, own_high) = bounds(piece);
    let scale = Vector::from_fn(|c, _| {
        let ratio = (own_high[c] - own_low[c]) / (high[c] - low[c]);
        if ratio.is_finite() && ratio > 0.0 {
            ratio
        } else {
            1.0
        }
    });
    piece
        .iter()
        .map(|p| {
            let at = low + (p - own_low).component_div(&scale);
            let nearest = model
                .iter()
                .map(|q| (q - at).norm_squared())
                .fold(f64::INFINITY, f64::min);
            let (mut sum, mut total) = (Vector::zeros(), 0.0);
            for (q, delta) in model.iter().zip(deltas) {
                let far = (q - at).norm_squared() - nearest;
                let weight = (-far / (KERNEL_WIDTH * KERNEL_WIDTH)).exp();
                sum += weight * delta;
                total += weight;
            }
            (sum / total).component_mul(&scale).cast()
        })
        .collect()
}

fn bounds(points: &[Point]) -> (Point, Point) {
    let first = points.first().copied().unwrap_or_else(Point::origin);
    points
        .iter()
        .fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template::{RigidBody, human};

    fn part(name: &str, vertices: std::ops::Range<u32>) -> RigPart {
        RigPart {
            name: name.to_owned(),
            follows: RigidBody::Mandible,
            vertices: vertices.collect(),
            shapes: Vec::new(),
        }
    }

    #[test]
    fn a_tongue_is_told_from_teeth_and_moves_with_its_size() {
        let template = human();
        let model = |name: &str| {
            let part = template.rigid_parts.iter().find(|p| p.name == name);
            part.unwrap().mesh.positions()
        };
        let (teeth, tongue) = (model("lower_teeth"), model("tongue"));
        let (low, _) = bounds(tongue);
        let mut positions = teeth.to_vec();
        positions.extend(tongue.iter().map(|p| low + 0.9 * (p - low)));
        let (a, b) = (teeth.len() as u32, positions.len() as u32);
        let mut parts = [part("lower_rigid", 0..a), part("lower_rigid_2", a..b)];
        give_shapes(template, template.skin.positions(), &positions, &mut parts);
        assert!(parts[0].shapes.is_empty());
        assert_eq!(parts[1].name, "tongue");
        let [shape] = &parts[1].shapes[..] else {
            panic!("one shape moves the tongue");
        };
        assert_eq!(template.shapes[shape.shape as usize].name, "tongueOut");
        let furthest = |deltas: &mut dyn Iterator<Item = f64>| deltas.fold(0.0, f64::max);
        let drawn = furthest(&mut template.part_deltas[0].2.iter().map(Vector::norm));
        let moved = furthest(&mut shape.deltas.iter().map(|d| f64::from(d.norm())));
        assert!((moved / drawn - 0.9).abs() < 0.1, "{moved} of {drawn} mm");
    }

    #[test]
    fn teeth_alone_have_no_tongue() {
        let template = human();
        let teeth = template
            .rigid_parts
            .iter()
            .find(|p| p.name == "lower_teeth");
        let positions = teeth.unwrap().mesh.positions();
        let mut parts = [part("lower_rigid", 0..positions.len() as u32)];
        give_shapes(template, template.skin.positions(), positions, &mut parts);
        assert!(parts[0].shapes.is_empty());
    }
}
