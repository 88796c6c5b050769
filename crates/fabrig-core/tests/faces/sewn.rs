//! Faces whose lips and lids are sewn shut: what scans of closed faces look like.
#![allow(dead_code)]

use std::collections::BTreeSet;

use fabrig_core::Point;
use fabrig_core::mesh::{Mesh, Polygons, Topology};
use fabrig_core::registration::Registration;
use fabrig_core::template::{self, Template};

/// Whether a region of the template lies behind lips or lids.
fn is_lining(name: &str) -> bool {
    name.starts_with("mouth_interior") || name.starts_with("socket")
}

/// The template with its eyes closed by its own blink, sewn shut.
pub(crate) fn template() -> Mesh {
    let template = template::human();
    let mut positions = template.skin.positions().to_vec();
    for shape in &template.shapes {
        if shape.name.starts_with("eyeBlink") {
            for (v, delta) in &shape.deltas {
                positions[*v as usize] += delta.cast();
            }
        }
    }
    let skin = template.skin.with_positions(positions).expect("finite");
    let hidden: Vec<bool> = template
        .regions
        .vertex_regions
        .iter()
        .map(|r| is_lining(&template.regions.regions[r.0 as usize].name))
        .collect();
    sew(&skin, &hidden)
}

/// A registered face without what lies behind its lips and lids, sewn shut.
pub(crate) fn registered(face: &Mesh, registration: &Registration, template: &Template) -> Mesh {
    let hidden: Vec<bool> = registration
        .face_regions
        .iter()
        .map(|r| is_lining(&template.regions.regions[r.0 as usize].name))
        .collect();
    sew(face, &hidden)
}

/// Takes away polygons with a hidden vertex, keeps the largest piece, and joins the upper to
/// the lower side of each hole that this made.
fn sew(mesh: &Mesh, hidden: &[bool]) -> Mesh {
    let before: BTreeSet<u32> = rim(mesh.vertex_count(), mesh.polygons());
    let mut kept: Vec<Vec<u32>> = mesh
        .polygons()
        .iter()
        .filter(|f| f.iter().all(|&v| !hidden[v as usize]))
        .map(<[u32]>::to_vec)
        .collect();
    let components =
        fabrig_core::mesh::Components::from_faces(mesh.vertex_count(), kept.iter().map(|f| &f[..]));
    let mut sizes = vec![0; components.len()];
    for f in &kept {
        sizes[components.of_vertex(f[0]) as usize] += 1;
    }
    let largest = (0..sizes.len()).max_by_key(|&k| sizes[k]).expect("a piece") as u32;
    kept.retain(|f| components.of_vertex(f[0]) == largest);
    let topology = Topology::from_faces(mesh.vertex_count(), kept.iter().map(|f| &f[..]));
    for ring in topology.boundary_loops() {
        if ring.iter().any(|v| before.contains(v)) || ring.len() < 8 {
            continue;
        }
        kept.extend(zip(mesh.positions(), &ring));
    }
    let mut place = vec![u32::MAX; mesh.vertex_count()];
    let mut points = Vec::new();
    for v in kept.iter_mut().flatten() {
        let slot = &mut place[*v as usize];
        if *slot == u32::MAX {
            *slot = points.len() as u32;
            points.push(mesh.positions()[*v as usize]);
        }
        *v = *slot;
    }
    Mesh::new(points, Polygons::from_faces(kept)).expect("a mesh")
}

fn rim(vertex_count: usize, polygons: &Polygons) -> BTreeSet<u32> {
    Topology::from_faces(vertex_count, polygons.iter())
        .boundary_loops()
        .into_iter()
        .flatten()
        .collect()
}

/// Triangles across a hole, from its one end to the other along its longest extent. A rim
/// keeps its surface on the left, so what fills it runs against it.
fn zip(positions: &[Point], ring: &[u32]) -> Vec<Vec<u32>> {
    let at = |v: u32| positions[v as usize];
    let (mut a, mut b, mut far) = (0, 0, 0.0);
    for i in 0..ring.len() {
        for j in 0..i {
            let d = (at(ring[i]) - at(ring[j])).norm();
            if d > far {
                (a, b, far) = (j, i, d);
            }
        }
    }
    let one: Vec<u32> = ring[a..=b].to_vec();
    let mut other: Vec<u32> = ring[b..].iter().chain(&ring[..=a]).copied().collect();
    other.reverse();
    let along = |line: &[u32]| {
        let mut sums = vec![0.0];
        for w in line.windows(2) {
            sums.push(sums[sums.len() - 1] + (at(w[1]) - at(w[0])).norm());
        }
        let total = sums[sums.len() - 1];
        sums.into_iter().map(|s| s / total).collect::<Vec<f64>>()
    };
    let (s, t) = (along(&one), along(&other));
    let (mut i, mut j) = (0, 0);
    let mut triangles = Vec::new();
    while i + 1 < one.len() || j + 1 < other.len() {
        let first = j + 1 == other.len() || (i + 1 < one.len() && s[i + 1] <= t[j + 1]);
        let triangle = if first {
            i += 1;
            vec![one[i], one[i - 1], other[j]]
        } else {
            j += 1;
            vec![one[i], other[j - 1], other[j]]
        };
        let is_flat =
            triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[0] == triangle[2];
        if !is_flat {
            triangles.push(triangle);
        }
    }
    triangles
}
