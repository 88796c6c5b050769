//! The edge of an opening: the closed loop of mesh edges around the eye or between the lips.

use std::collections::BTreeMap;

use super::error::AnatomyError;
use super::layout::{MarginText, PatchText};
use super::places::Places;
use crate::mesh::SurfacePoint;

/// The two arcs of a margin, as vertices of the skin; both run from the corner towards -X to
/// that towards +X, or from the mid line to the left corner.
pub(super) struct Margin {
    /// Arc above the opening.
    pub(super) upper: Vec<u32>,
    /// Arc below it.
    pub(super) lower: Vec<u32>,
}

impl Margin {
    /// Finds the loop around the regions that the layout names.
    pub(super) fn find(places: &Places<'_>, text: &PatchText) -> Result<Self, AnatomyError> {
        let Some(margin) = &text.margin else {
            return Err(text.bad_value("margin", "a margin", &"none"));
        };
        let bad = |reason: String| AnatomyError::BadMargin {
            patch: text.name.clone(),
            key: "margin".to_owned(),
            reason,
        };
        let next = boundary(places, text, margin)?;
        let expected = if text.is_pair { 2 } else { 1 };
        if margin.corners.len() != expected {
            let expected = format!("{expected} landmarks");
            return Err(text.bad_value("margin.corners", &expected, &margin.corners));
        }
        let mut corners = Vec::new();
        for name in &margin.corners {
            let at = places.place(&text.name, "margin.corners", name)?.point;
            let positions = places.template.skin.positions();
            let distance = |v: u32| (positions[v as usize] - at).norm();
            let corner = next
                .keys()
                .copied()
                .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
                .ok_or_else(|| bad("no edge lies around the regions inside".to_owned()))?;
            corners.push(corner);
        }
        if !text.is_pair {
            corners.insert(0, places.template.mirror[corners[0] as usize]);
        }
        let walk = |from: u32, to: u32| {
            let mut path = vec![from];
            while path.len() <= next.len() {
                let at = *next.get(&path[path.len() - 1])?;
                path.push(at);
                if at == to {
                    return Some(path);
                }
            }
            None
        };
        let (Some(there), Some(mut back)) =
            (walk(corners[0], corners[1]), walk(corners[1], corners[0]))
        else {
            return Err(bad(format!(
                "the edges around the regions inside do not form one loop through both corners \
                 (vertices {} and {})",
                corners[0], corners[1]
            )));
        };
        back.reverse();
        let height = |path: &[u32]| {
            let sum: f64 = path
                .iter()
                .map(|&v| places.template.skin.positions()[v as usize].y)
                .sum();
            sum / path.len() as f64
        };
        let (mut upper, mut lower) = if height(&there) > height(&back) {
            (there, back)
        } else {
            (back, there)
        };
        if !text.is_pair {
            for arc in [&mut upper, &mut lower] {
                let mid = arc
                    .iter()
                    .position(|&v| places.template.mirror[v as usize] == v)
                    .ok_or_else(|| bad("an arc has no vertex on the mid line".to_owned()))?;
                arc.drain(..mid);
            }
        }
        Ok(Self { upper, lower })
    }

    /// The place at a share of the length of an arc, on a triangle that `is_open` takes.
    pub(super) fn place(
        places: &Places<'_>,
        arc: &[u32],
        share: f64,
        is_open: &[bool],
    ) -> Option<SurfacePoint> {
        let positions = places.template.skin.positions();
        let at = |k: usize| positions[arc[k] as usize];
        let length: f64 = (1..arc.len()).map(|k| (at(k) - at(k - 1)).norm()).sum();
        let mut rest = share.clamp(0.0, 1.0) * length;
        for k in 1..arc.len() {
            let step = (at(k) - at(k - 1)).norm();
            if rest <= step || k + 1 == arc.len() {
                let s = if step > 0.0 {
                    (rest / step).min(1.0)
                } else {
                    0.0
                };
                return on_edge(places, [arc[k - 1], arc[k]], s, is_open);
            }
            rest -= step;
        }
        None
    }
}

/// The place at `s` along an edge, on an open triangle that has it.
fn on_edge(places: &Places<'_>, edge: [u32; 2], s: f64, is_open: &[bool]) -> Option<SurfacePoint> {
    let has = |t: &[u32; 3]| edge.iter().all(|v| t.contains(v));
    let triangle =
        (0..places.triangles.len()).find(|&t| is_open[t] && has(&places.triangles[t]))?;
    let barycentric = places.triangles[triangle].map(|v| {
        if v == edge[0] {
            1.0 - s
        } else if v == edge[1] {
            s
        } else {
            0.0
        }
    });
    let triangle = triangle as u32;
    Some(SurfacePoint {
        triangle,
        barycentric,
        point: places.skin.surface.point_at(triangle, barycentric),
        distance: 0.0,
    })
}

/// Directed edges between the faces outside and inside, as vertex -> next vertex. A face is
/// inside when one of its corners is.
fn boundary(
    places: &Places<'_>,
    text: &PatchText,
    margin: &MarginText,
) -> Result<BTreeMap<u32, u32>, AnatomyError> {
    let inside = places.regions(&text.name, "margin.inside", &margin.inside)?;
    let labels = &places.template.regions.vertex_regions;
    let polygons = places.template.skin.polygons();
    let mut owner: BTreeMap<(u32, u32), bool> = BTreeMap::new();
    for face in polygons.iter() {
        let is_inside = face.iter().any(|&v| inside.contains(&labels[v as usize]));
        for (k, &a) in face.iter().enumerate() {
            owner.insert((a, face[(k + 1) % face.len()]), is_inside);
        }
    }
    Ok(owner
        .iter()
        .filter(|((a, b), is_inside)| {
            let across = owner.get(&(*b, *a));
            if margin.inside.is_empty() {
                across.is_none()
            } else {
                !**is_inside && across == Some(&true)
            }
        })
        .map(|((a, b), _)| (*a, *b))
        .collect())
}
