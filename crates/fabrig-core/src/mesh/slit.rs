//! Slits: a polygon mesh cut open along a line on its surface.
//!
//! The line is the zero set of a height over a neighbourhood of the mesh, traced from polygon
//! to polygon. Polygons that it crosses are split in two, what lies on it exists twice
//! afterwards, except at both ends. Original vertices keep index and place; new ones are
//! appended. Vertices that lie almost on the line are taken to lie on it, so no slivers arise.

use std::collections::{BTreeMap, BTreeSet};

use super::{CornerUvs, FaceGroup, Mesh, MeshError, Polygons};
use crate::Point;

/// A vertex this close to the line, over its shortest edge, lies on it.
const SNAP_SHARE: f64 = 0.15;

/// Where a new vertex comes from: a place on an edge of the original mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VertexOrigin {
    /// Ends of the edge; the same vertex twice for a copy of it.
    pub vertices: [u32; 2],
    /// Share of the way from the first end to the second, 0 to 1.
    pub share: f64,
}

/// A mesh with a slit.
#[derive(Debug, Clone)]
pub struct SlitMesh {
    /// The mesh: original vertices first, then the new ones.
    pub mesh: Mesh,
    /// Origin of each new vertex.
    pub origins: Vec<VertexOrigin>,
    /// For each polygon the one of the original that it is, or is a part of.
    pub face_origins: Vec<u32>,
    /// Vertices of the positive side of the slit from its first to its last end, ends included.
    pub upper: Vec<u32>,
    /// Vertices of the negative side, likewise.
    pub lower: Vec<u32>,
}

/// What the slit follows.
pub struct SlitField<'a> {
    /// One number per place of the mesh: vertices with the same number are the same place
    /// (split at texture seams).
    pub places: &'a [u32],
    /// Height of each vertex over the line, `None` away from it.
    pub heights: &'a [Option<f64>],
    /// How far each vertex is along the line.
    pub along: &'a [f64],
    /// The slit runs between these values of `along`.
    pub range: [f64; 2],
    /// Near this point the slit is looked for.
    pub start: Point,
}

/// A place that the slit passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Node {
    Vertex(u32),
    /// On an edge between two places, lower first.
    Edge(u32, u32),
}

/// The mesh near the line, by place.
struct Neighbourhood {
    faces: Vec<u32>,
    /// Height of each place, snapped.
    height: BTreeMap<u32, f64>,
    along: BTreeMap<u32, f64>,
    point: BTreeMap<u32, Point>,
    /// Nodes of each face in the order of its corners.
    nodes: BTreeMap<u32, Vec<Node>>,
    faces_of: BTreeMap<Node, Vec<u32>>,
}

impl Neighbourhood {
    fn new(mesh: &Mesh, field: &SlitField<'_>) -> Self {
        let mut near = Self {
            faces: Vec::new(),
            height: BTreeMap::new(),
            along: BTreeMap::new(),
            point: BTreeMap::new(),
            nodes: BTreeMap::new(),
            faces_of: BTreeMap::new(),
        };
        let mut shortest: BTreeMap<u32, f64> = BTreeMap::new();
        for (face, corners) in mesh.polygons().iter().enumerate() {
            if corners.iter().any(|&v| field.heights[v as usize].is_none()) {
                continue;
            }
            near.faces.push(face as u32);
            for (k, &v) in corners.iter().enumerate() {
                let w = corners[(k + 1) % corners.len()];
                let place = field.places[v as usize];
                if let Some(height) = field.heights[v as usize] {
                    near.height.insert(place, height);
                }
                near.along.insert(place, field.along[v as usize]);
                let (p, q) = (mesh.positions()[v as usize], mesh.positions()[w as usize]);
                near.point.insert(place, p);
                for end in [place, field.places[w as usize]] {
                    let length = shortest.entry(end).or_insert(f64::INFINITY);
                    *length = length.min((q - p).norm());
                }
            }
        }
        for (place, height) in &mut near.height {
            if height.abs() < SNAP_SHARE * shortest[place] {
                *height = 0.0;
            }
        }
        for &face in &near.faces {
            let corners = mesh.polygons().face(face as usize);
            let mut nodes = Vec::new();
            for (k, &v) in corners.iter().enumerate() {
                let (a, b) = (
                    field.places[v as usize],
                    field.places[corners[(k + 1) % corners.len()] as usize],
                );
                let (ha, hb) = (near.height[&a], near.height[&b]);
                if ha == 0.0 {
                    nodes.push(Node::Vertex(a));
                } else if ha * hb < 0.0 {
                    nodes.push(Node::Edge(a.min(b), a.max(b)));
                }
            }
            for &node in &nodes {
                near.faces_of.entry(node).or_default().push(face);
            }
            near.nodes.insert(face, nodes);
        }
        near
    }

    /// Share of an edge node between its places.
    fn share(&self, a: u32, b: u32) -> f64 {
        let (ha, hb) = (self.height[&a], self.height[&b]);
        ha / (ha - hb)
    }

    fn point(&self, node: Node) -> Point {
        match node {
            Node::Vertex(v) => self.point[&v],
            Node::Edge(a, b) => {
                self.point[&a] + (self.point[&b] - self.point[&a]) * self.share(a, b)
            }
        }
    }

    fn along(&self, node: Node) -> f64 {
        match node {
            Node::Vertex(v) => self.along[&v],
            Node::Edge(a, b) => {
                self.along[&a] + (self.along[&b] - self.along[&a]) * self.share(a, b)
            }
        }
    }

    /// Nodes from `start` on towards rising (`sign` 1) or falling (-1) `along`, up to `end`,
    /// each with the face that leads to it. The start is not among them.
    fn walk(&self, start: Node, sign: f64, end: f64) -> Vec<(u32, Node)> {
        let mut visited = BTreeSet::from([start]);
        let mut used: BTreeSet<u32> = BTreeSet::new();
        let mut way = Vec::new();
        let mut at = start;
        loop {
            let ahead = self.faces_of[&at]
                .iter()
                .filter(|f| !used.contains(f))
                .flat_map(|&f| self.nodes[&f].iter().map(move |&n| (f, n)))
                .filter(|(_, n)| !visited.contains(n))
                .max_by(|a, b| (sign * self.along(a.1)).total_cmp(&(sign * self.along(b.1))));
            let Some((face, next)) = ahead else {
                return way;
            };
            // The first step decides the direction; later ones may turn back under a fold.
            if way.is_empty() && sign * (self.along(next) - self.along(start)) <= 0.0 {
                return way;
            }
            let (before, after) = (
                sign * (end - self.along(at)),
                sign * (end - self.along(next)),
            );
            if after < 0.0 && -after > before {
                return way;
            }
            used.extend(self.faces_of[&at].iter().copied());
            visited.insert(next);
            way.push((face, next));
            if after < 0.0 {
                return way;
            }
            at = next;
        }
    }
}

/// Cuts `mesh` along the line of `field`; `None` where no line of at least three places is
/// found.
///
/// # Errors
///
/// [`MeshError`] where the result is no mesh.
pub fn slit(mesh: &Mesh, field: &SlitField<'_>) -> Result<Option<SlitMesh>, MeshError> {
    let near = Neighbourhood::new(mesh, field);
    let Some(start) = near
        .faces_of
        .keys()
        .filter(|n| (field.range[0]..=field.range[1]).contains(&near.along(**n)))
        .min_by(|a, b| {
            let d = |n: Node| (near.point(n) - field.start).norm();
            d(**a).total_cmp(&d(**b))
        })
        .copied()
    else {
        return Ok(None);
    };
    let back = near.walk(start, -1.0, field.range[0]);
    let forth = near.walk(start, 1.0, field.range[1]);
    let mut line: Vec<Node> = back.iter().rev().map(|s| s.1).collect();
    line.push(start);
    line.extend(forth.iter().map(|s| s.1));
    let faces: Vec<u32> = back.iter().rev().chain(&forth).map(|s| s.0).collect();
    if line.len() < 3 {
        return Ok(None);
    }
    let mut cutter = Cutter::new(mesh, field, &near, &line);
    cutter.cut(&faces);
    cutter.finish().map(Some)
}

/// A corner of a polygon while it is split.
#[derive(Debug, Clone, Copy)]
struct Corner {
    /// Vertex of the original; the edge's ends for a node on it.
    vertices: [u32; 2],
    share: f64,
    uv: u32,
    /// Index on the line.
    node: Option<usize>,
}

struct Cutter<'a> {
    mesh: &'a Mesh,
    field: &'a SlitField<'a>,
    near: &'a Neighbourhood,
    line: &'a [Node],
    on_line: BTreeMap<Node, usize>,
    positions: Vec<Point>,
    origins: Vec<VertexOrigin>,
    coordinates: Vec<[f32; 2]>,
    /// Copies by original vertices and side; the ends have one for both.
    copies: BTreeMap<([u32; 2], bool), u32>,
    /// What polygons near the line become.
    replaced: BTreeMap<u32, Vec<Vec<(u32, u32)>>>,
    sides: [Vec<u32>; 2],
}

impl<'a> Cutter<'a> {
    fn new(
        mesh: &'a Mesh,
        field: &'a SlitField<'a>,
        near: &'a Neighbourhood,
        line: &'a [Node],
    ) -> Self {
        Self {
            mesh,
            field,
            near,
            line,
            on_line: line.iter().enumerate().map(|(k, n)| (*n, k)).collect(),
            positions: mesh.positions().to_vec(),
            origins: Vec::new(),
            coordinates: mesh.uvs().map_or_else(Vec::new, |u| u.coordinates.clone()),
            copies: BTreeMap::new(),
            replaced: BTreeMap::new(),
            sides: [vec![u32::MAX; line.len()], vec![u32::MAX; line.len()]],
        }
    }

    fn cut(&mut self, faces: &[u32]) {
        let mut chords: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (k, &face) in faces.iter().enumerate() {
            chords.entry(face).or_default().push(k);
        }
        for &face in &self.near.faces {
            let touches = self.near.nodes[&face]
                .iter()
                .any(|n| self.on_line.contains_key(n));
            if !touches {
                continue;
            }
            let mut loops = vec![self.corners(face)];
            for &k in chords.get(&face).map_or(&[][..], Vec::as_slice) {
                split_at(&mut loops, k, k + 1);
            }
            let polygons = loops.iter().map(|corners| self.place(corners)).collect();
            self.replaced.insert(face, polygons);
        }
    }

    /// The corners of a polygon with the line's nodes on its edges put in.
    fn corners(&mut self, face: u32) -> Vec<Corner> {
        let polygons = self.mesh.polygons();
        let range = polygons.corner_range(face as usize);
        let corners = polygons.face(face as usize);
        let uv = |k: usize| self.mesh.uvs().map_or(0, |u| u.corners[range.start + k]);
        let mut out = Vec::with_capacity(corners.len() + 2);
        for (k, &v) in corners.iter().enumerate() {
            let next = (k + 1) % corners.len();
            let w = corners[next];
            let (a, b) = (self.field.places[v as usize], self.field.places[w as usize]);
            out.push(Corner {
                vertices: [v, v],
                share: 0.0,
                uv: uv(k),
                node: self.on_line.get(&Node::Vertex(a)).copied(),
            });
            let Some(&node) = self.on_line.get(&Node::Edge(a.min(b), a.max(b))) else {
                continue;
            };
            let low_first = self.near.share(a.min(b), a.max(b));
            let share = if a < b { low_first } else { 1.0 - low_first };
            let (from, to) = (uv(k), uv(next));
            let mixed = if self.mesh.uvs().is_some() {
                let (f, t) = (
                    self.coordinates[from as usize],
                    self.coordinates[to as usize],
                );
                self.coordinates
                    .push([0, 1].map(|c| f[c] + (t[c] - f[c]) * share as f32));
                self.coordinates.len() as u32 - 1
            } else {
                0
            };
            let (vertices, share) = if v < w {
                ([v, w], share)
            } else {
                ([w, v], 1.0 - share)
            };
            out.push(Corner {
                vertices,
                share,
                uv: mixed,
                node: Some(node),
            });
        }
        out
    }

    /// Vertices and texture coordinates of one part of a polygon.
    fn place(&mut self, corners: &[Corner]) -> Vec<(u32, u32)> {
        let sum = |of: &dyn Fn(u32) -> f64| -> f64 {
            corners
                .iter()
                .filter(|c| c.vertices[0] == c.vertices[1])
                .map(|c| of(c.vertices[0]))
                .sum()
        };
        let mut height = sum(&|v| self.near.height[&self.field.places[v as usize]]);
        if height == 0.0 {
            // All its corners lie on the line: what they were before that was decided.
            height = sum(&|v| self.field.heights[v as usize].unwrap_or(0.0));
        }
        let is_lower = height < 0.0;
        corners
            .iter()
            .map(|c| (self.vertex(c, is_lower), c.uv))
            .collect()
    }

    fn vertex(&mut self, corner: &Corner, is_lower: bool) -> u32 {
        let Some(node) = corner.node else {
            return corner.vertices[0];
        };
        let is_end = node == 0 || node + 1 == self.line.len();
        let is_original = corner.vertices[0] == corner.vertices[1];
        let vertex = if is_original && (is_end || !is_lower) {
            corner.vertices[0]
        } else {
            let key = (corner.vertices, is_lower && !is_end);
            match self.copies.get(&key) {
                Some(&v) => v,
                None => {
                    let [a, b] = corner.vertices.map(|v| self.mesh.positions()[v as usize]);
                    self.positions.push(a + (b - a) * corner.share);
                    self.origins.push(VertexOrigin {
                        vertices: corner.vertices,
                        share: corner.share,
                    });
                    let v = self.positions.len() as u32 - 1;
                    self.copies.insert(key, v);
                    v
                }
            }
        };
        if is_end {
            self.sides[0][node] = vertex;
            self.sides[1][node] = vertex;
        } else {
            self.sides[usize::from(is_lower)][node] = vertex;
        }
        vertex
    }

    fn finish(self) -> Result<SlitMesh, MeshError> {
        let mut polygons = Polygons::new();
        let mut uv_corners = Vec::new();
        let mut face_origins = Vec::new();
        // Start of each original polygon among the new ones.
        let mut starts = Vec::with_capacity(self.mesh.face_count() + 1);
        for (face, corners) in self.mesh.polygons().iter().enumerate() {
            starts.push(polygons.len());
            match self.replaced.get(&(face as u32)) {
                Some(parts) => {
                    for part in parts {
                        let vertices: Vec<u32> = part.iter().map(|c| c.0).collect();
                        polygons.push(&vertices);
                        uv_corners.extend(part.iter().map(|c| c.1));
                        face_origins.push(face as u32);
                    }
                }
                None => {
                    polygons.push(corners);
                    if let Some(uvs) = self.mesh.uvs() {
                        uv_corners.extend_from_slice(
                            &uvs.corners[self.mesh.polygons().corner_range(face)],
                        );
                    }
                    face_origins.push(face as u32);
                }
            }
        }
        starts.push(polygons.len());
        let groups = self
            .mesh
            .groups()
            .iter()
            .map(|g| FaceGroup {
                name: g.name.clone(),
                faces: starts[g.faces.start]..starts[g.faces.end],
            })
            .collect();
        let mut mesh = Mesh::new(self.positions, polygons)?.with_groups(groups);
        if self.mesh.uvs().is_some() {
            mesh = mesh.with_uvs(CornerUvs {
                coordinates: self.coordinates,
                corners: uv_corners,
            })?;
        }
        // Where only one side has polygons, both sides share its vertex.
        let [mut upper, mut lower] = self.sides;
        for (u, l) in upper.iter_mut().zip(&mut lower) {
            (*u, *l) = (
                if *u == u32::MAX { *l } else { *u },
                if *l == u32::MAX { *u } else { *l },
            );
        }
        Ok(SlitMesh {
            mesh,
            origins: self.origins,
            face_origins,
            upper,
            lower,
        })
    }
}

/// Splits the loop that has both nodes of the line between them, where that leaves two
/// polygons.
fn split_at(loops: &mut Vec<Vec<Corner>>, from: usize, to: usize) {
    for k in 0..loops.len() {
        let find = |node: usize| loops[k].iter().position(|c| c.node == Some(node));
        let (Some(a), Some(b)) = (find(from), find(to)) else {
            continue;
        };
        let (a, b) = (a.min(b), a.max(b));
        if b - a < 2 || loops[k].len() - (b - a) < 2 {
            continue;
        }
        let one = loops[k][a..=b].to_vec();
        let mut other = loops[k][b..].to_vec();
        other.extend_from_slice(&loops[k][..=a]);
        loops[k] = one;
        loops.push(other);
        return;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Topology;

    /// A sheet of quads over [0, 8] x [0, 6], and its field for a slit at y = `height`.
    fn cut(height: impl Fn(f64) -> f64, range: [f64; 2]) -> (Mesh, SlitMesh) {
        let (columns, rows) = (9u32, 7u32);
        let positions: Vec<Point> = (0..columns * rows)
            .map(|k| Point::new(f64::from(k % columns), f64::from(k / columns), 0.0))
            .collect();
        let mut quads = Vec::new();
        for y in 0..rows - 1 {
            for x in 0..columns - 1 {
                let v = y * columns + x;
                quads.push([v, v + 1, v + columns + 1, v + columns]);
            }
        }
        let mesh = Mesh::new(positions, Polygons::from_faces(&quads)).expect("a sheet");
        let heights: Vec<Option<f64>> = mesh
            .positions()
            .iter()
            .map(|p| Some(p.y - height(p.x)))
            .collect();
        let along: Vec<f64> = mesh.positions().iter().map(|p| p.x).collect();
        let places: Vec<u32> = (0..columns * rows).collect();
        let field = SlitField {
            places: &places,
            heights: &heights,
            along: &along,
            range,
            start: Point::new(4.0, height(4.0), 0.0),
        };
        let cut = slit(&mesh, &field).expect("a mesh").expect("a slit");
        (mesh, cut)
    }

    fn check(mesh: &Mesh, cut: &SlitMesh) {
        let n = mesh.vertex_count();
        assert_eq!(&cut.mesh.positions()[..n], mesh.positions());
        assert_eq!(cut.mesh.vertex_count(), n + cut.origins.len());
        for (k, origin) in cut.origins.iter().enumerate() {
            let [a, b] = origin.vertices.map(|v| mesh.positions()[v as usize]);
            let expected = a + (b - a) * origin.share;
            assert!((cut.mesh.positions()[n + k] - expected).norm() < 1e-12);
        }
        let area = |m: &Mesh| -> f64 {
            m.triangles()
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| m.positions()[v as usize]);
                    (b - a).cross(&(c - a)).z / 2.0
                })
                .sum()
        };
        assert!((area(mesh) - area(&cut.mesh)).abs() < 1e-9);
        assert_eq!(cut.upper.len(), cut.lower.len());
        let last = cut.upper.len() - 1;
        assert_eq!(
            (cut.upper[0], cut.upper[last]),
            (cut.lower[0], cut.lower[last])
        );
        for k in 1..last {
            let (u, l) = (cut.upper[k] as usize, cut.lower[k] as usize);
            assert_ne!(u, l);
            assert!((cut.mesh.positions()[u] - cut.mesh.positions()[l]).norm() < 1e-12);
        }
        // The rim of the sheet, and the slit.
        let loops = Topology::from_mesh(&cut.mesh).boundary_loops();
        assert_eq!(loops.len(), 2);
        let mut slit_loop = loops.iter().map(Vec::len).collect::<Vec<_>>();
        slit_loop.sort_unstable();
        assert_eq!(slit_loop[0].min(slit_loop[1]), 2 * last);
        assert!(
            Topology::from_mesh(&cut.mesh)
                .edges()
                .iter()
                .all(|e| !e.has_flip)
        );
    }

    #[test]
    fn a_slit_across_quads_opens_one_loop_and_keeps_the_rest() {
        let (mesh, cut) = cut(|_| 2.4, [1.6, 6.4]);
        check(&mesh, &cut);
        assert_eq!(cut.upper.len(), 5);
        let (mesh, cut) = self::cut(|x| 2.6 + 0.9 * (0.7 * x).sin(), [0.8, 7.2]);
        check(&mesh, &cut);
    }

    #[test]
    fn a_slit_along_edges_splits_no_polygon() {
        let (mesh, cut) = cut(|_| 3.02, [1.0, 7.0]);
        check(&mesh, &cut);
        assert_eq!(cut.mesh.face_count(), mesh.face_count());
        assert_eq!(cut.origins.len(), 5);
        assert!(cut.origins.iter().all(|o| o.vertices[0] == o.vertices[1]));
    }
}
