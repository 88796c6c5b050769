//! Cuts the head off the body at a loop of edges around the neck.

use std::collections::{BTreeMap, BTreeSet};

use super::source::BaseMesh;
use crate::template::TemplateError;

/// The head as a part of the base mesh.
#[derive(Debug, Clone)]
pub(super) struct Head {
    /// Source vertex of each skin vertex, rising.
    pub(super) source: Vec<u32>,
    /// Quads in skin vertices; mirrored quads start at mirrored corners.
    pub(super) faces: Vec<Vec<u32>>,
    /// Mirror image of each skin vertex.
    pub(super) mirror: Vec<u32>,
}

/// Everything above the edge loop through `neck_vertex`, the loop included.
pub(super) fn crop_head(base: &BaseMesh, neck_vertex: u32) -> Result<Head, TemplateError> {
    let body = base.group("body")?;
    let rings = FaceRings::new(body);
    let neck: BTreeSet<u32> = edge_loop(&rings, body, base, neck_vertex)?
        .into_iter()
        .collect();
    let top = body
        .iter()
        .flatten()
        .copied()
        .max_by(|&a, &b| {
            let y = |v: u32| base.positions[v as usize].y;
            y(a).total_cmp(&y(b)).then(b.cmp(&a))
        })
        .unwrap_or(neck_vertex);
    let mut inside = BTreeSet::from([top]);
    let mut open = vec![top];
    while let Some(vertex) = open.pop() {
        for next in rings.neighbours(body, vertex) {
            if inside.insert(next) && !neck.contains(&next) {
                open.push(next);
            }
        }
    }
    let source: Vec<u32> = inside.into_iter().collect();
    let skin_of: BTreeMap<u32, u32> = (0u32..).zip(&source).map(|(i, &s)| (s, i)).collect();
    let mirror = source
        .iter()
        .map(|&s| {
            skin_of
                .get(&base.mirror[s as usize])
                .copied()
                .ok_or_else(|| TemplateError::Source {
                    reason: format!("the cut keeps vertex {s} but not its mirror image"),
                })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let faces: Vec<Vec<u32>> = body
        .iter()
        .filter_map(|face| face.iter().map(|v| skin_of.get(v).copied()).collect())
        .collect();
    Ok(Head {
        faces: mirrored_fans(faces, &mirror)?,
        source,
        mirror,
    })
}

/// Keeps one face of each mirrored pair as it is and writes the other as its image, so that
/// both split into mirrored triangles.
pub(super) fn mirrored_fans(
    faces: Vec<Vec<u32>>,
    mirror: &[u32],
) -> Result<Vec<Vec<u32>>, TemplateError> {
    let key = |face: &[u32]| {
        let mut sorted = face.to_vec();
        sorted.sort_unstable();
        sorted
    };
    let image = |face: &[u32]| -> Vec<u32> {
        std::iter::once(face[0])
            .chain(face[1..].iter().rev().copied())
            .map(|v| mirror[v as usize])
            .collect()
    };
    let index: BTreeMap<Vec<u32>, usize> =
        faces.iter().enumerate().map(|(i, f)| (key(f), i)).collect();
    let mut fans = faces.clone();
    for (i, face) in faces.iter().enumerate() {
        let mirrored = image(face);
        match index.get(&key(&mirrored)) {
            Some(&j) if j > i => fans[j] = mirrored,
            Some(&j) if j < i => {}
            _ => {
                return Err(TemplateError::Source {
                    reason: format!("face {i} has no mirrored partner"),
                });
            }
        }
    }
    Ok(fans)
}

/// Faces around each vertex.
struct FaceRings(BTreeMap<u32, Vec<usize>>);

impl FaceRings {
    fn new(faces: &[Vec<u32>]) -> Self {
        let mut rings: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (i, face) in faces.iter().enumerate() {
            for &v in face {
                rings.entry(v).or_default().push(i);
            }
        }
        Self(rings)
    }

    fn around(&self, vertex: u32) -> &[usize] {
        self.0.get(&vertex).map_or(&[], Vec::as_slice)
    }

    fn neighbours(&self, faces: &[Vec<u32>], vertex: u32) -> BTreeSet<u32> {
        let mut found = BTreeSet::new();
        for &i in self.around(vertex) {
            let face = &faces[i];
            for (k, &v) in face.iter().enumerate() {
                if v == vertex {
                    found.insert(face[(k + 1) % face.len()]);
                    found.insert(face[(k + face.len() - 1) % face.len()]);
                }
            }
        }
        found
    }
}

/// Walks from `start` towards the character's left, straight on at every vertex of four edges,
/// until it comes back.
fn edge_loop(
    rings: &FaceRings,
    faces: &[Vec<u32>],
    base: &BaseMesh,
    start: u32,
) -> Result<Vec<u32>, TemplateError> {
    let no_loop = || TemplateError::Source {
        reason: format!("no edge loop runs around the neck through vertex {start}"),
    };
    let first = rings
        .neighbours(faces, start)
        .into_iter()
        .max_by(|&a, &b| {
            let x = |v: u32| base.positions[v as usize].x;
            x(a).total_cmp(&x(b))
        })
        .ok_or_else(no_loop)?;
    let mut path = vec![start, first];
    loop {
        let (last, here) = (path[path.len() - 2], path[path.len() - 1]);
        let neighbours = rings.neighbours(faces, here);
        if neighbours.len() != 4 {
            return Err(no_loop());
        }
        let beside: BTreeSet<u32> = rings
            .around(here)
            .iter()
            .map(|&i| &faces[i])
            .filter(|face| face.contains(&last))
            .flatten()
            .copied()
            .collect();
        let next = neighbours
            .difference(&beside)
            .copied()
            .next()
            .ok_or_else(no_loop)?;
        if next == start {
            return Ok(path);
        }
        if path.len() > faces.len() {
            return Err(no_loop());
        }
        path.push(next);
    }
}
