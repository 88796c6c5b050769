//! Cleaning: a welded, oriented copy of the user's mesh, split into connected pieces.
//!
//! The user's own mesh is never changed; maps lead from its vertices to the clean copy.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::mesh::{Components, Mesh, Topology};
use crate::{Point, Vector};

/// What cleaning found and changed (in its own copy).
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CleaningReport {
    /// Vertices merged with another at the same place.
    pub welded_vertices: usize,
    /// Triangles without area or with a repeated corner.
    pub degenerate_triangles: usize,
    /// Triangles that repeat another.
    pub duplicate_triangles: usize,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Triangles turned round so that neighbours agree.
    pub flipped_triangles: usize,
    /// Whether the whole face was wound inside out: its triangles are wound clockwise, or the
    /// mesh is a mirror image. Registration treats both by turning the winding.
    pub was_inside_out: bool,
    /// Connected pieces of the mesh.
    pub components: usize,
}

/// A sphere fitted to the vertices of a piece.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// Centre.
    pub center: Point,
    /// Radius.
    pub radius: f64,
    /// RMS distance of the vertices from the sphere over the radius.
    pub relative_error: f64,
}

/// A connected piece of the clean copy.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    /// Vertices of the clean copy.
    pub(super) vertices: Vec<u32>,
    /// Triangles of the clean copy.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Sum of their areas.
    pub(super) area: f64,
    /// Set where it is as round as an eyeball.
    pub(super) sphere: Option<Sphere>,
}

/// The clean copy. Positions keep the user's units.
#[derive(Debug, Clone)]
pub(super) struct CleanMesh {
    pub(super) positions: Vec<Point>,
    /// Clean vertex of every vertex of the user's mesh.
    pub(super) from_user: Vec<u32>,
    /// Pieces with triangles, largest area first.
    pub(super) pieces: Vec<Piece>,
    pub(super) report: CleaningReport,
}

/// Welds, drops what has no area, and splits into pieces.
pub(super) fn clean(mesh: &Mesh) -> CleanMesh {
    let mut report = CleaningReport::default();
    let (positions, from_user) = weld(mesh);
    report.welded_vertices = mesh.vertex_count() - positions.len();

    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for t in mesh.triangles() {
        let t = t.map(|v| from_user[v as usize]);
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let longest = (b - a).norm_squared().max((c - a).norm_squared());
        if (b - a).cross(&(c - a)).norm() <= 1e-9 * longest {
            report.degenerate_triangles += 1;
        } else {
            triangles.push(t);
        }
    }
    report.duplicate_triangles = drop_duplicates(&mut triangles);

    let topology = Topology::from_triangles(positions.len(), &triangles);
    report.non_manifold_edges = topology.edges().iter().filter(|e| e.face_count > 2).count();
    report.flipped_triangles = agree_on_winding(&topology, &mut triangles);

    let components = Components::from_faces(positions.len(), triangles.iter().map(|t| &t[..]));
    let mut pieces: Vec<Piece> = components
        .vertices()
        .into_iter()
        .map(|vertices| Piece {
            vertices,
            triangles: Vec::new(),
            area: 0.0,
            sphere: None,
        })
        .collect();
    for &t in &triangles {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let piece = &mut pieces[components.of_vertex(t[0]) as usize];
        piece.triangles.push(t);
        piece.area += (b - a).cross(&(c - a)).norm() / 2.0;
    }
    pieces.retain(|p| !p.triangles.is_empty());
    report.components = pieces.len();
    for piece in &mut pieces {
        piece.sphere = fit_sphere(piece.vertices.iter().map(|&v| positions[v as usize]))
            .filter(|s| s.relative_error < 0.1 && turns_far(piece, &positions, s));
    }
    pieces.sort_by(|a, b| b.area.total_cmp(&a.area));
    CleanMesh {
        positions,
        from_user,
        pieces,
        report,
    }
}

/// Keeps the first of triangles with the same corners; returns how many others there were.
fn drop_duplicates(triangles: &mut Vec<[u32; 3]>) -> usize {
    let mut keys: Vec<([u32; 3], u32)> = triangles
        .iter()
        .enumerate()
        .map(|(k, t)| {
            let mut key = *t;
            key.sort_unstable();
            (key, k as u32)
        })
        .collect();
    keys.par_sort_unstable();
    let mut is_kept = vec![true; triangles.len()];
    for run in keys.chunk_by(|a, b| a.0 == b.0) {
        for &(_, k) in &run[1..] {
            is_kept[k as usize] = false;
        }
    }
    let before = triangles.len();
    let mut kept = is_kept.iter();
    triangles.retain(|_| kept.next() == Some(&true));
    before - triangles.len()
}

/// Merges vertices at the same place, up to a millionth of the mesh's size: exporters split
/// vertices at texture seams.
fn weld(mesh: &Mesh) -> (Vec<Point>, Vec<u32>) {
    let positions = mesh.positions();
    let (mut low, mut high) = (positions[0], positions[0]);
    for p in positions {
        low = low.inf(p);
        high = high.sup(p);
    }
    let size = (high - low).amax();
    let step = if size > 0.0 { size * 1e-6 } else { 1.0 };
    // Sorted by place and then by index: the first of each run stands for it.
    let mut keys: Vec<([i64; 3], u32)> = positions
        .iter()
        .enumerate()
        .map(|(v, p)| {
            let key = [0, 1, 2].map(|k| ((p[k] - low[k]) / step).round() as i64);
            (key, v as u32)
        })
        .collect();
    keys.par_sort_unstable();
    let mut first: Vec<u32> = vec![0; positions.len()];
    for run in keys.chunk_by(|a, b| a.0 == b.0) {
        for &(_, v) in run {
            first[v as usize] = run[0].1;
        }
    }
    // Numbered in the order of the user's mesh; the first of a run comes before the others.
    let mut welded = Vec::new();
    let mut from_user = vec![0; positions.len()];
    for v in 0..positions.len() {
        from_user[v] = if first[v] as usize == v {
            welded.push(positions[v]);
            welded.len() as u32 - 1
        } else {
            from_user[first[v] as usize]
        };
    }
    (welded, from_user)
}

/// Turns triangles so that both at an edge run along it in opposite directions, keeping the
/// winding of most of each connected piece. Returns how many were turned.
fn agree_on_winding(topology: &Topology, triangles: &mut [[u32; 3]]) -> usize {
    if topology.edges().iter().all(|e| !e.has_flip) {
        return 0;
    }
    let mut neighbours: Vec<Vec<(u32, bool)>> = vec![Vec::new(); triangles.len()];
    for e in topology.edges().iter().filter(|e| e.face_count == 2) {
        let [f, g] = e.faces;
        neighbours[f as usize].push((g, e.has_flip));
        neighbours[g as usize].push((f, e.has_flip));
    }
    let mut turn: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut flipped = 0;
    for start in 0..triangles.len() {
        if turn[start].is_some() {
            continue;
        }
        turn[start] = Some(false);
        let mut piece = vec![start];
        let mut at = 0;
        while at < piece.len() {
            let f = piece[at];
            let own = turn[f] == Some(true);
            for &(g, differs) in &neighbours[f] {
                if turn[g as usize].is_none() {
                    turn[g as usize] = Some(own != differs);
                    piece.push(g as usize);
                }
            }
            at += 1;
        }
        let turned = piece.iter().filter(|&&f| turn[f] == Some(true)).count();
        let invert = turned * 2 > piece.len();
        for f in piece {
            if (turn[f] == Some(true)) != invert {
                triangles[f].swap(1, 2);
                flipped += 1;
            }
        }
    }
    flipped
}

/// Signed volume of triangles with every hole closed by a fan about its middle; positive when
/// they are wound counter-clockwise seen from outside.
pub(super) fn closed_volume(positions: &[Point], triangles: &[[u32; 3]]) -> f64 {
    let topology = Topology::from_triangles(positions.len(), triangles);
    let origin = positions[triangles[0][0] as usize];
    let part = |a: Vector, b: Vector, c: Vector| a.dot(&b.cross(&c)) / 6.0;
    let mut volume: f64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| positions[v as usize] - origin);
            part(a, b, c)
        })
        .sum();
    for chain in topology.boundary_loops() {
        let middle = chain
            .iter()
            .map(|&v| positions[v as usize] - origin)
            .sum::<Vector>()
            / chain.len() as f64;
        for (k, &v) in chain.iter().enumerate() {
            let next = chain[(k + 1) % chain.len()];
            // The fan runs against the boundary's own direction.
            volume += part(
                positions[next as usize] - origin,
                positions[v as usize] - origin,
                middle,
            );
        }
    }
    volume
}

/// Least-squares sphere, `|x|^2 = 2 c.x + (r^2 - |c|^2)`; `None` for fewer than 12 points or
/// points in a plane.
fn fit_sphere(points: impl Iterator<Item = Point>) -> Option<Sphere> {
    let points: Vec<Point> = points.collect();
    if points.len() < 12 {
        return None;
    }
    let middle = Point::from(points.iter().map(|p| p.coords).sum::<Vector>() / points.len() as f64);
    let size = points
        .iter()
        .map(|p| (p - middle).norm())
        .fold(0.0, f64::max);
    if size <= 0.0 {
        return None;
    }
    let mut a = nalgebra::Matrix4::<f64>::zeros();
    let mut b = nalgebra::Vector4::<f64>::zeros();
    for p in &points {
        let x = (p - middle) / size;
        let row = nalgebra::Vector4::new(2.0 * x.x, 2.0 * x.y, 2.0 * x.z, 1.0);
        a += row * row.transpose();
        b += row * x.norm_squared();
    }
    let s = a.cholesky()?.solve(&b);
    let center = Vector::new(s.x, s.y, s.z);
    let radius = (s.w + center.norm_squared()).max(0.0).sqrt();
    if !(radius.is_finite() && radius > 0.0) {
        return None;
    }
    let error = points
        .iter()
        .map(|p| (((p - middle) / size - center).norm() - radius).powi(2))
        .sum::<f64>();
    Some(Sphere {
        center: middle + center * size,
        radius: radius * size,
        relative_error: (error / points.len() as f64).sqrt() / radius,
    })
}

/// Whether a piece covers enough of its sphere to be an eyeball, not a slightly curved shard.
fn turns_far(piece: &Piece, positions: &[Point], sphere: &Sphere) -> bool {
    piece.area > 0.8 * std::f64::consts::PI * sphere.radius * sphere.radius
        && piece
            .vertices
            .iter()
            .all(|&v| (positions[v as usize] - sphere.center).norm() < 1.6 * sphere.radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Polygons;

    fn cube(offset: f64) -> (Vec<Point>, Vec<[u32; 4]>) {
        let p = (0..8)
            .map(|k| {
                Point::new(
                    f64::from(k & 1) + offset,
                    f64::from(k >> 1 & 1),
                    f64::from(k >> 2 & 1),
                )
            })
            .collect();
        let quads = vec![
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        (p, quads)
    }

    #[test]
    fn seams_are_welded_bad_triangles_dropped_and_a_flip_undone() {
        let (p, mut quads) = cube(0.0);
        quads[2].reverse();
        // Every quad has its own corners, as after a split at texture seams.
        let corners: Vec<Point> = quads.iter().flatten().map(|&v| p[v as usize]).collect();
        let mut faces: Vec<Vec<u32>> = (0..6).map(|q| (4 * q..4 * q + 4).collect()).collect();
        faces.push(vec![0, 0, 1]);
        faces.push(vec![0, 1, 2]);
        let mesh = Mesh::new(corners, Polygons::from_faces(faces)).expect("mesh");
        let clean = clean(&mesh);
        assert_eq!(clean.positions.len(), 8);
        assert_eq!(clean.report.welded_vertices, 16);
        assert_eq!(clean.report.degenerate_triangles, 1);
        assert_eq!(clean.report.duplicate_triangles, 1);
        assert_eq!(clean.report.flipped_triangles, 2);
        assert_eq!(clean.pieces.len(), 1);
        let volume = closed_volume(&clean.positions, &clean.pieces[0].triangles);
        assert!((volume - 1.0).abs() < 1e-12, "{volume}");
        assert!((clean.pieces[0].area - 6.0).abs() < 1e-12);
    }

    #[test]
    fn a_cube_with_a_hole_keeps_the_sign_of_its_volume() {
        let (p, quads) = cube(3.0);
        let mesh = Mesh::new(p, Polygons::from_faces(&quads[1..])).expect("mesh");
        let triangles = mesh.triangles();
        assert!((closed_volume(mesh.positions(), &triangles) - 1.0).abs() < 1e-12);
        let turned: Vec<_> = triangles.iter().map(|t| [t[0], t[2], t[1]]).collect();
        assert!((closed_volume(mesh.positions(), &turned) + 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_sphere_is_recognised_and_a_cube_is_not() {
        let mut p = Vec::new();
        let mut faces: Vec<[u32; 4]> = Vec::new();
        let (rows, columns) = (12u32, 16u32);
        for r in 0..=rows {
            for c in 0..columns {
                let a = (0.05 + 0.9 * f64::from(r) / f64::from(rows)) * std::f64::consts::PI;
                let b = f64::from(c) / f64::from(columns) * std::f64::consts::TAU;
                p.push(Point::new(
                    5.0 + 2.0 * a.sin() * b.cos(),
                    2.0 * a.sin() * b.sin(),
                    2.0 * a.cos(),
                ));
                if r < rows {
                    let next = (c + 1) % columns;
                    faces.push([
                        r * columns + c,
                        (r + 1) * columns + c,
                        (r + 1) * columns + next,
                        r * columns + next,
                    ]);
                }
            }
        }
        let mesh = Mesh::new(p, Polygons::from_faces(&faces)).expect("mesh");
        let sphere = clean(&mesh).pieces[0].sphere.expect("a sphere");
        assert!((sphere.radius - 2.0).abs() < 1e-9);
        assert!((sphere.center - Point::new(5.0, 0.0, 0.0)).norm() < 1e-9);
        let (p, quads) = cube(0.0);
        let mesh = Mesh::new(p, Polygons::from_faces(&quads)).expect("mesh");
        assert!(clean(&mesh).pieces[0].sphere.is_none());
    }
}
