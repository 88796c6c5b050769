//! Where each vertex of the user's mesh lies on the registered template, lips and lids by side.
//!
//! Most vertices simply take the closest place that faces the same way. Where the other side of
//! a slit is about as near, the choice is made along the user's own surface: such a vertex
//! belongs to the side of the nearest vertex, along edges, that is beyond doubt.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::RegistrationError;
use super::face_model::{FaceModel, OpeningKind};
use crate::mesh::{Mesh, Surface, SurfacePoint, Topology, vertex_normals};
use crate::template::RegionId;
use crate::{Point, Vector};

/// Places within this much of each other on both sides of a slit are in doubt. (mm)
const DOUBT_MM: f64 = 3.0;

/// A side of an opening: opening index * 2 for the upper one, + 1 for the lower one.
pub(super) type Side = u8;

/// Maps every vertex of `face`, whose vertices lie at `positions` in the head frame and face
/// along `normals`, to the template at `registered`.
pub(super) fn map_vertices(
    model: &FaceModel<'_>,
    face: &Mesh,
    positions: &[Point],
    normals: &[Vector],
    registered: &[Point],
) -> Result<(Vec<SurfacePoint>, Vec<RegionId>), RegistrationError> {
    let surface = Surface::new(registered, &model.triangles)?;
    let template_normals = vertex_normals(registered, &model.triangles);
    let triangle_sides = triangle_sides(model);
    let closest = |v: usize, refused: Option<Side>| {
        let n = normals[v];
        let accept = |at: &SurfacePoint| {
            (refused.is_none() || triangle_sides[at.triangle as usize] != refused)
                && surface.blend(at, &template_normals).dot(&n) >= 0.0
        };
        surface
            .closest_where(&positions[v], f64::INFINITY, accept)
            .unwrap_or_else(|| surface.closest(&positions[v]))
    };

    // First choice, and whether the other side of the slit is in reach.
    let first: Vec<(SurfacePoint, Option<Side>, bool)> = (0..positions.len())
        .into_par_iter()
        .map(|v| {
            let place = closest(v, None);
            let side = triangle_sides[place.triangle as usize];
            let is_in_doubt = side.is_some_and(|side| {
                let limit = place.distance + DOUBT_MM;
                surface
                    .closest_where(&positions[v], limit, |at| {
                        triangle_sides[at.triangle as usize] == Some(side ^ 1)
                    })
                    .is_some()
            });
            (place, side, is_in_doubt)
        })
        .collect();

    let sides = settle_doubts(face, positions, &first);
    let places: Vec<SurfacePoint> = (0..positions.len())
        .into_par_iter()
        .map(|v| {
            let (place, side, _) = first[v];
            if sides[v] == side || sides[v].is_none() {
                place
            } else {
                closest(v, sides[v].map(|s| s ^ 1))
            }
        })
        .collect();
    let regions = places
        .iter()
        .map(|p| {
            let t = model.triangles[p.triangle as usize];
            let k = (0..3)
                .max_by(|&a, &b| p.barycentric[a].total_cmp(&p.barycentric[b]))
                .unwrap_or(0);
            model.region(t[k])
        })
        .collect();
    Ok((places, regions))
}

/// Side of every template triangle: that of most of its corners.
pub(super) fn triangle_sides(model: &FaceModel<'_>) -> Vec<Option<Side>> {
    let vertex_sides = vertex_sides(model);
    model
        .triangles
        .iter()
        .map(|t| {
            let s = t.map(|v| vertex_sides[v as usize]);
            if s[0] == s[1] || s[0] == s[2] {
                s[0]
            } else {
                s[1].filter(|_| s[1] == s[2])
            }
        })
        .collect()
}

/// Side of every template vertex: lips, lids and the parts of the mouth behind each lip.
fn vertex_sides(model: &FaceModel<'_>) -> Vec<Option<Side>> {
    let regions = &model.template.regions;
    let side_of_region: Vec<Option<Side>> = regions
        .regions
        .iter()
        .map(|r| {
            OpeningKind::ALL.iter().find_map(|kind| {
                let [upper, lower, inside] = kind.regions();
                if r.name == upper || r.name == format!("{inside}_upper") {
                    Some(kind.side(true))
                } else if r.name == lower || r.name == format!("{inside}_lower") {
                    Some(kind.side(false))
                } else {
                    None
                }
            })
        })
        .collect();
    regions
        .vertex_regions
        .iter()
        .map(|r| side_of_region[r.0 as usize])
        .collect()
}

/// Gives vertices in doubt the side of the nearest vertex beyond doubt, along the user's edges
/// and through vertices in doubt only. Where none is reached the first choice stays.
fn settle_doubts(
    face: &Mesh,
    positions: &[Point],
    first: &[(SurfacePoint, Option<Side>, bool)],
) -> Vec<Option<Side>> {
    let mut sides: Vec<Option<Side>> = first.iter().map(|f| f.1).collect();
    if !first.iter().any(|f| f.2) {
        return sides;
    }
    let topology = Topology::from_mesh(face);
    let mut distance = vec![f64::INFINITY; positions.len()];
    let mut queue = BinaryHeap::new();
    for v in 0..positions.len() {
        if first[v].1.is_some() && !first[v].2 {
            distance[v] = 0.0;
            queue.push(Reverse((0u64, v as u32)));
        }
    }
    while let Some(Reverse((bits, v))) = queue.pop() {
        let d = f64::from_bits(bits);
        if d > distance[v as usize] {
            continue;
        }
        for &n in topology.neighbours(v) {
            let k = n as usize;
            // Only between the two sides of one slit is there anything to settle.
            let same_slit = match (first[k].1, sides[v as usize]) {
                (Some(a), Some(b)) => a / 2 == b / 2,
                _ => false,
            };
            let step = d + (positions[k] - positions[v as usize]).norm();
            if first[k].2 && same_slit && step < distance[k] {
                distance[k] = step;
                sides[k] = sides[v as usize];
                queue.push(Reverse((step.to_bits(), n)));
            }
        }
    }
    sides
}
