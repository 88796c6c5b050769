//! Where the materials of what is written come from: a file, the rig, or plain colours by what
//! the pieces of a face are.

use std::path::Path;

use super::ExportError;
use crate::mesh::appearance::{Appearance, Material, linear_color};
use crate::rig::Rig;
use crate::{Point, Vector};

/// Half angle of iris and pupil from the line of sight in an adult's eye. (degrees)
const IRIS: f64 = 29.0;
const PUPIL: f64 = 10.0;

/// What a rig's face looks like: as the file says that its materials are to come from, else as
/// the rig keeps it, else in plain colours.
pub(super) fn appearance(
    rig: &Rig,
    source: Option<&Path>,
    notes: &mut Vec<String>,
) -> Result<Appearance, ExportError> {
    let given = match source {
        Some(path) => Some(Appearance::of_file(path, &rig.face, notes)?),
        None => None,
    };
    let known = given.filter(|a| !a.is_empty());
    let known = known.or_else(|| rig.appearance.clone());
    Ok(known.unwrap_or_else(|| of_parts(rig)))
}

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

/// A material for every kind of piece that the rig knows: skin, eyes with iris and pupil,
/// teeth, tongue; with the one of each polygon of its face.
pub(super) fn of_parts(rig: &Rig) -> Appearance {
    let mut part_of = vec![None; rig.face.vertex_count()];
    for (part, piece) in rig.parts.iter().enumerate() {
        for &vertex in &piece.vertices {
            part_of[vertex as usize] = Some(part);
        }
    }
    let rest = rig.face_in_head();
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
            list.push(Material::new(
                name,
                linear_color(color),
                roughness,
                0.0,
                None,
            ));
        }
    }
    Appearance {
        materials: list,
        of_polygon: kinds
            .iter()
            .map(|&kind| index_of[kind].unwrap_or(0))
            .collect(),
        ..Appearance::default()
    }
}

/// A material for every surface of a recording: its name and colour.
///
/// - `of_polygon`: the surface of each polygon
pub(super) fn of_surfaces(surfaces: &[(String, [u8; 4])], of_polygon: Vec<u32>) -> Appearance {
    let list = surfaces.iter().map(|(name, [r, g, b, _])| {
        Material::new(name, linear_color([*r, *g, *b]), 0.5, 0.0, None)
    });
    Appearance {
        materials: list.collect(),
        of_polygon,
        ..Appearance::default()
    }
}
