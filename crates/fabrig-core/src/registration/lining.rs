//! What lies behind a cut: the template's own lining of mouth or socket, as it was registered
//! with the face, joined to both sides of the cut.

use nalgebra::Similarity3;

use super::face_model::{FaceModel, Opening};
use crate::mesh::{SlitMesh, Topology};
use crate::{Point, Vector};

/// Vertices and polygons to append to a mesh.
pub(super) struct Lining {
    /// Template vertex of each new one; empty where they are none of its skin.
    pub(super) vertices: Vec<u32>,
    /// In the mesh's own units.
    pub(super) positions: Vec<Point>,
    /// In indices of the mesh they are appended to.
    pub(super) polygons: Vec<Vec<u32>>,
}

/// The lining of `opening`, with strips that join its rim to the two sides of `slit`.
pub(super) fn lining(
    model: &FaceModel<'_>,
    opening: &Opening,
    registered: &[Point],
    slit: &SlitMesh,
    to_head: &Similarity3<f64>,
) -> Lining {
    let [_, _, inside] = opening.kind.regions();
    let regions = &model.template.regions;
    let is_inside = |v: u32| {
        regions.regions[regions.vertex_regions[v as usize].0 as usize]
            .name
            .starts_with(inside)
    };
    let faces: Vec<&[u32]> = model
        .template
        .skin
        .polygons()
        .iter()
        .filter(|f| f.iter().any(|&v| is_inside(v)))
        .collect();
    let first = slit.mesh.vertex_count() as u32;
    let mut vertices: Vec<u32> = faces.iter().flat_map(|f| f.iter().copied()).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let index = |v: u32| first + vertices.binary_search(&v).map_or(0, |k| k as u32);
    let mut polygons: Vec<Vec<u32>> = faces
        .iter()
        .map(|f| f.iter().map(|&v| index(v)).collect())
        .collect();

    let topology = Topology::from_faces(registered.len(), faces.iter().copied());
    let rim = topology
        .boundary_loops()
        .into_iter()
        .max_by_key(|l| l.iter().filter(|v| opening.upper.contains(v)).count())
        .unwrap_or_default();
    if let Some([upper, lower]) = halves(&rim, opening, registered) {
        let place = |v: u32| to_head * slit.mesh.positions()[v as usize];
        for (rim, cut, is_lower) in [(upper, &slit.upper, false), (lower, &slit.lower, true)] {
            let rim_points: Vec<Point> = rim.iter().map(|&v| registered[v as usize]).collect();
            let cut_points: Vec<Point> = cut.iter().map(|&v| place(v)).collect();
            let rim: Vec<u32> = rim.into_iter().map(index).collect();
            polygons.extend(strip(cut, &cut_points, &rim, &rim_points, is_lower));
        }
    }
    let back = to_head.inverse();
    Lining {
        positions: vertices
            .iter()
            .map(|&v| back * registered[v as usize])
            .collect(),
        vertices,
        polygons,
    }
}

/// A closed rim as its upper and its lower half, both from the right corner to the left one.
fn halves(rim: &[u32], opening: &Opening, registered: &[Point]) -> Option<[Vec<u32>; 2]> {
    let at = |v: u32| registered[v as usize];
    let across: Vector = at(*opening.upper.last()?) - at(opening.upper[0]);
    let along = |k: usize| at(rim[k]).coords.dot(&across);
    let right = (0..rim.len()).min_by(|&a, &b| along(a).total_cmp(&along(b)))?;
    let left = (0..rim.len()).max_by(|&a, &b| along(a).total_cmp(&along(b)))?;
    let from_to = |from: usize, to: usize| -> Vec<u32> {
        let count = (to + rim.len() - from) % rim.len();
        (0..=count).map(|k| rim[(from + k) % rim.len()]).collect()
    };
    let one = from_to(right, left);
    let mut other = from_to(left, right);
    other.reverse();
    let uppers = |line: &[u32]| line.iter().filter(|v| opening.upper.contains(v)).count();
    (one.len() > 1 && other.len() > 1).then(|| {
        if uppers(&one) >= uppers(&other) {
            [one, other]
        } else {
            [other, one]
        }
    })
}

/// Triangles between a side of the cut and a half of the rim, both from right to left, paced
/// by the share of their lengths.
fn strip(
    cut: &[u32],
    cut_points: &[Point],
    rim: &[u32],
    rim_points: &[Point],
    is_lower: bool,
) -> Vec<Vec<u32>> {
    let shares = |points: &[Point]| {
        let mut sums = vec![0.0];
        for w in points.windows(2) {
            sums.push(sums[sums.len() - 1] + (w[1] - w[0]).norm());
        }
        let total = sums[sums.len() - 1].max(f64::MIN_POSITIVE);
        sums.into_iter().map(|s| s / total).collect::<Vec<f64>>()
    };
    let (s, t) = (shares(cut_points), shares(rim_points));
    let (mut i, mut j) = (0, 0);
    let mut triangles = Vec::new();
    while i + 1 < cut.len() || j + 1 < rim.len() {
        let moves_cut = j + 1 == rim.len() || (i + 1 < cut.len() && s[i + 1] <= t[j + 1]);
        let mut triangle = if moves_cut {
            i += 1;
            vec![cut[i], cut[i - 1], rim[j]]
        } else {
            j += 1;
            vec![cut[i], rim[j - 1], rim[j]]
        };
        if is_lower {
            triangle.reverse();
        }
        triangles.push(triangle);
    }
    triangles
}
