//! Plain colours, by what the pieces of a face are.

use super::{Material, Materials};
use crate::rig::Rig;
use crate::{Point, Vector};

/// Half angle of iris and pupil from the line of sight in an adult's eye. (degrees)
const IRIS: f64 = 29.0;
const PUPIL: f64 = 10.0;

/// Name, colour and roughness of what a face is made of.
const KINDS: [(&str, [u8; 3], f64); 7] = [
    ("skin", [224, 172, 147], 0.55),
    ("eye", [240, 238, 232], 0.15),
    ("iris", [86, 116, 128], 0.15),
    ("pupil", [14, 14, 16], 0.1),
    ("teeth", [236, 228, 210], 0.3),
    ("tongue", [190, 96, 92], 0.4),
    ("other", [150, 140, 132], 0.6),
];

/// Linear colour of an sRGB one, opaque.
pub(super) fn linear(color: [u8; 3]) -> [f64; 4] {
    let [r, g, b] = color.map(|c| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    });
    [r, g, b, 1.0]
}

/// A material for every kind of piece that the rig knows: skin, eyes with iris and pupil,
/// teeth, tongue; with the one of each polygon of its face.
pub(in crate::export) fn of_parts(rig: &Rig) -> (Materials, Vec<u32>) {
    let mut part_of = vec![None; rig.face.vertex_count()];
    for (part, piece) in rig.parts.iter().enumerate() {
        for &vertex in &piece.vertices {
            part_of[vertex as usize] = Some(part);
        }
    }
    let rest: Vec<Point> = rig
        .face
        .positions()
        .iter()
        .map(|p| rig.to_head * p)
        .collect();
    let kind_of = |polygon: &[u32]| -> usize {
        let Some(part) = part_of[polygon[0] as usize] else {
            return 0;
        };
        let name = &rig.parts[part].name;
        if name.contains("eye") {
            let sum: Vector = polygon.iter().map(|&v| rest[v as usize].coords).sum();
            let middle = Point::from(sum / polygon.len() as f64);
            let distance = |k: usize| (middle - rig.eyes[k].center).norm();
            let eye = usize::from(distance(1) < distance(0));
            let angle = (middle - rig.eyes[eye].center).angle(&Vector::z());
            match angle.to_degrees() {
                ..PUPIL => 3,
                ..IRIS => 2,
                _ => 1,
            }
        } else if name.contains("teeth") {
            4
        } else if name.contains("tongue") {
            5
        } else {
            6
        }
    };
    let kinds: Vec<usize> = rig.face.polygons().iter().map(kind_of).collect();
    let mut list = Vec::new();
    let mut index_of = [None; KINDS.len()];
    for (kind, (name, color, roughness)) in KINDS.into_iter().enumerate() {
        if kinds.contains(&kind) {
            index_of[kind] = Some(list.len() as u32);
            list.push(Material::new(name, linear(color), roughness, 0.0, None));
        }
    }
    let of_polygon = kinds.iter().map(|&kind| index_of[kind].unwrap_or(0));
    let materials = Materials {
        list,
        ..Materials::default()
    };
    (materials, of_polygon.collect())
}

/// A material for every surface of a recording: its name and colour.
pub(in crate::export) fn of_surfaces(surfaces: &[(String, [u8; 4])]) -> Materials {
    let list = surfaces
        .iter()
        .map(|(name, [r, g, b, _])| Material::new(name, linear([*r, *g, *b]), 0.5, 0.0, None));
    Materials {
        list: list.collect(),
        ..Materials::default()
    }
}
