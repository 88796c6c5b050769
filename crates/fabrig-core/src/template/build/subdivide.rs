//! One Catmull-Clark step; borders keep their curve.
//!
//! Source: Catmull & Clark 1978; border rule as for cubic B-spline curves.

use std::collections::BTreeMap;

use crate::{Point, Vector};

/// Finer positions and quads.
pub(super) fn catmull_clark(
    positions: &[Point],
    faces: &[Vec<u32>],
) -> (Vec<Point>, Vec<Vec<u32>>) {
    let mean = |vertices: &[u32]| -> Vector {
        vertices
            .iter()
            .map(|&v| positions[v as usize].coords)
            .sum::<Vector>()
            / vertices.len() as f64
    };
    let key = |a: u32, b: u32| (a.min(b), a.max(b));
    let centers: Vec<Vector> = faces.iter().map(|face| mean(face)).collect();
    let mut edges: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
    for (i, face) in faces.iter().enumerate() {
        for (k, &a) in face.iter().enumerate() {
            edges
                .entry(key(a, face[(k + 1) % face.len()]))
                .or_default()
                .push(i);
        }
    }
    // Per vertex: sum of face centres, sum of edge middles, counts; border middles apart.
    let mut around_faces = vec![(Vector::zeros(), 0usize); positions.len()];
    let mut around_edges = vec![(Vector::zeros(), 0usize); positions.len()];
    let mut around_border = vec![(Vector::zeros(), 0usize); positions.len()];
    for (face, center) in faces.iter().zip(&centers) {
        for &v in face {
            around_faces[v as usize].0 += center;
            around_faces[v as usize].1 += 1;
        }
    }
    let mut finer: Vec<Vector> = Vec::new();
    let mut edge_vertex: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let first_edge = positions.len() + faces.len();
    for (&(a, b), sides) in &edges {
        let middle = mean(&[a, b]);
        let is_border = sides.len() != 2;
        for v in [a, b] {
            around_edges[v as usize].0 += middle;
            around_edges[v as usize].1 += 1;
            if is_border {
                around_border[v as usize].0 += middle;
                around_border[v as usize].1 += 1;
            }
        }
        edge_vertex.insert((a, b), (first_edge + finer.len()) as u32);
        finer.push(if is_border {
            middle
        } else {
            (middle + (centers[sides[0]] + centers[sides[1]]) / 2.0) / 2.0
        });
    }
    let old = positions.iter().enumerate().map(|(v, p)| {
        let (faces_sum, n) = around_faces[v];
        let (edges_sum, edge_count) = around_edges[v];
        let (border_sum, border_count) = around_border[v];
        if n == 0 {
            p.coords
        } else if border_count > 0 {
            (border_sum / border_count as f64 + p.coords) / 2.0
        } else {
            let n = n as f64;
            (faces_sum / n + 2.0 * edges_sum / edge_count as f64 + (n - 3.0) * p.coords) / n
        }
    });
    let all: Vec<Point> = old
        .chain(centers.iter().copied())
        .chain(finer)
        .map(Point::from)
        .collect();
    let mut quads = Vec::with_capacity(faces.len() * 4);
    for (i, face) in faces.iter().enumerate() {
        let center = (positions.len() + i) as u32;
        for (k, &v) in face.iter().enumerate() {
            let next = face[(k + 1) % face.len()];
            let last = face[(k + face.len() - 1) % face.len()];
            quads.push(vec![
                v,
                edge_vertex[&key(v, next)],
                center,
                edge_vertex[&key(last, v)],
            ]);
        }
    }
    (all, quads)
}
