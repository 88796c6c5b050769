//! Finer faces where a mesh is asked for them.
//!
//! A triangle becomes four, any other polygon as many quads as it has corners. New vertices lie
//! on a smooth surface through the old ones, which keep index and place: the middle of an edge is
//! that of the cubic whose ends leave along the planes of the vertex normals,
//!
//! `m = (a + b)/2 - ((b - a).n_a n_a + (a - b).n_b n_b) / 8`,
//!
//! and the middle of a polygon follows from its edges as on a Coons patch. Polygons at the rim
//! keep their corners and take the new middles in among them, so nothing comes apart; a polygon
//! with such a corner is not refined again, which keeps neighbours within one level.
//!
//! # Source
//!
//! Edge points of Vlachos et al. 2001, *Curved PN triangles*.

use std::collections::BTreeMap;

use super::{CornerUvs, FaceGroup, Mesh, MeshError, Polygons, vertex_normals};
use crate::{Point, Vector};

/// An edge's middle goes no further out than this share of its length.
const FURTHEST: f64 = 0.2;

/// A mesh with finer faces somewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct RefinedMesh {
    /// The mesh; the vertices of the old one come first, where they were.
    pub mesh: Mesh,
    /// The old polygon that each polygon lies on.
    pub face_origins: Vec<u32>,
    /// For each new vertex the old ones between which it lies, with shares that sum to one.
    pub vertex_origins: Vec<Vec<(u32, f64)>>,
}

/// Refines the polygons that touch a marked vertex until their edges are short enough.
///
/// - `is_marked`: one per vertex
/// - `edge_length`: no edge between marked vertices stays longer, in the mesh's own units, but
///   for the last ring of each level
/// - `level_limit`: how many times a polygon is parted at most
///
/// # Errors
///
/// [`MeshError::PositionCount`] where the marks do not fit.
pub fn refine(
    mesh: &Mesh,
    is_marked: &[bool],
    edge_length: f64,
    level_limit: u32,
) -> Result<RefinedMesh, MeshError> {
    if is_marked.len() != mesh.vertex_count() {
        return Err(MeshError::PositionCount {
            expected: mesh.vertex_count(),
            found: is_marked.len(),
        });
    }
    let mut refined = RefinedMesh {
        mesh: mesh.clone(),
        face_origins: (0..mesh.face_count() as u32).collect(),
        vertex_origins: Vec::new(),
    };
    let mut marks = is_marked.to_vec();
    for level in 0..level_limit {
        let polygons = refined.mesh.polygons();
        let positions = refined.mesh.positions();
        let is_long = |face: &[u32]| {
            let next = face.iter().cycle().skip(1);
            face.iter().zip(next).any(|(&a, &b)| {
                (positions[a as usize] - positions[b as usize]).norm() > edge_length
            })
        };
        let is_parted: Vec<bool> = polygons
            .iter()
            .map(|face| {
                let mut marked = face.iter().map(|&v| marks[v as usize]);
                let touches = if level == 0 {
                    marked.any(|m| m)
                } else {
                    marked.all(|m| m)
                };
                touches && is_long(face)
            })
            .collect();
        if !is_parted.contains(&true) {
            break;
        }
        marks = part(&mut refined, &is_parted)?;
    }
    Ok(refined)
}

/// New vertices of one level.
struct Parting<'a> {
    positions: Vec<Point>,
    normals: Vec<Vector>,
    /// Middle of each parted edge, lower vertex first.
    middles: BTreeMap<[u32; 2], u32>,
    /// The vertices between which each new one lies.
    parents: Vec<Vec<(u32, f64)>>,
    uvs: Option<&'a CornerUvs>,
    coordinates: Vec<[f32; 2]>,
    uv_middles: BTreeMap<[u32; 2], u32>,
    polygons: Polygons,
    uv_corners: Vec<u32>,
}

impl Parting<'_> {
    fn add(&mut self, position: Point, parents: Vec<(u32, f64)>) -> u32 {
        self.positions.push(position);
        self.parents.push(parents);
        self.positions.len() as u32 - 1
    }

    fn middle(&mut self, a: u32, b: u32) -> u32 {
        let key = [a.min(b), a.max(b)];
        if let Some(&middle) = self.middles.get(&key) {
            return middle;
        }
        let [a, b] = key.map(|v| v as usize);
        let (pa, pb) = (self.positions[a], self.positions[b]);
        let (na, nb) = (self.normals[a], self.normals[b]);
        let along = pb - pa;
        let mut lift = (nb * along.dot(&nb) - na * along.dot(&na)) / 8.0;
        let most = FURTHEST * along.norm();
        if lift.norm() > most {
            lift *= most / lift.norm();
        }
        let middle = self.add(
            nalgebra::center(&pa, &pb) + lift,
            key.map(|v| (v, 0.5)).to_vec(),
        );
        self.middles.insert(key, middle);
        middle
    }

    fn uv_middle(&mut self, a: u32, b: u32) -> u32 {
        let key = [a.min(b), a.max(b)];
        let next = self.coordinates.len() as u32;
        let middle = *self.uv_middles.entry(key).or_insert(next);
        if middle == next {
            let [a, b] = key.map(|c| self.coordinates[c as usize]);
            self.coordinates
                .push([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
        }
        middle
    }

    fn push(&mut self, corners: &[(u32, u32)]) {
        let vertices: Vec<u32> = corners.iter().map(|c| c.0).collect();
        self.polygons.push(&vertices);
        if self.uvs.is_some() {
            self.uv_corners.extend(corners.iter().map(|c| c.1));
        }
    }

    /// Parts one polygon of (vertex, texture coordinate) corners; returns how many it became.
    fn part(&mut self, corners: &[(u32, u32)]) -> u32 {
        let count = corners.len();
        let middles: Vec<(u32, u32)> = (0..count)
            .map(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % count]);
                let uv = self.uvs.map_or(0, |_| self.uv_middle(a.1, b.1));
                (self.middle(a.0, b.0), uv)
            })
            .collect();
        if let [a, b, c] = *corners {
            let [ab, bc, ca] = [middles[0], middles[1], middles[2]];
            self.push(&[a, ab, ca]);
            self.push(&[ab, b, bc]);
            self.push(&[ca, bc, c]);
            self.push(&[ab, bc, ca]);
            return 4;
        }
        let mean = |of: &[(u32, u32)]| -> Vector {
            let sum: Vector = of.iter().map(|c| self.positions[c.0 as usize].coords).sum();
            sum / of.len() as f64
        };
        let center = Point::from(2.0 * mean(&middles) - mean(corners));
        let share = 1.0 / count as f64;
        let parents = corners.iter().map(|c| (c.0, share)).collect();
        let center = self.add(center, parents);
        let mut center = (center, 0);
        if self.uvs.is_some() {
            let mut sum = [0.0; 2];
            for corner in corners {
                let uv = self.coordinates[corner.1 as usize];
                sum = [sum[0] + uv[0], sum[1] + uv[1]];
            }
            center.1 = self.coordinates.len() as u32;
            self.coordinates
                .push(sum.map(|x: f32| x / corners.len() as f32));
        }
        for k in 0..count {
            let before = middles[(k + count - 1) % count];
            self.push(&[corners[k], middles[k], center, before]);
        }
        count as u32
    }

    /// Takes the middles of parted edges in among the corners of a polygon that stays. It then
    /// starts at one of them, so that no triangle of its fan is flat.
    fn keep(&mut self, corners: &[(u32, u32)]) -> bool {
        let mut all = Vec::with_capacity(corners.len() + 1);
        let mut start = None;
        for (k, &a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            all.push(a);
            let key = [a.0.min(b.0), a.0.max(b.0)];
            if let Some(&middle) = self.middles.get(&key) {
                let uv = self.uvs.map_or(0, |_| self.uv_middle(a.1, b.1));
                start.get_or_insert(all.len());
                all.push((middle, uv));
            }
        }
        all.rotate_left(start.unwrap_or(0));
        self.push(&all);
        start.is_some()
    }
}

/// Parts the polygons of one level. Returns which vertices may be refined further: those of
/// parted polygons that no polygon of the rim has.
fn part(refined: &mut RefinedMesh, is_parted: &[bool]) -> Result<Vec<bool>, MeshError> {
    let mesh = &refined.mesh;
    let old_count = mesh.vertex_count();
    let mut parting = Parting {
        positions: mesh.positions().to_vec(),
        normals: vertex_normals(mesh.positions(), &mesh.triangles()),
        middles: BTreeMap::new(),
        parents: Vec::new(),
        uvs: mesh.uvs(),
        coordinates: mesh
            .uvs()
            .map_or_else(Vec::new, |uvs| uvs.coordinates.clone()),
        uv_middles: BTreeMap::new(),
        polygons: Polygons::new(),
        uv_corners: Vec::new(),
    };
    let corners_of = |face: usize| -> Vec<(u32, u32)> {
        let range = mesh.polygons().corner_range(face);
        let uv = |k: usize| mesh.uvs().map_or(0, |uvs| uvs.corners[k]);
        range
            .map(|k| (mesh.polygons().corners()[k], uv(k)))
            .collect()
    };
    // All middles first: polygons that stay need those of neighbours that come after them.
    for (face, _) in is_parted.iter().enumerate().filter(|(_, parted)| **parted) {
        let corners = corners_of(face);
        for (k, a) in corners.iter().enumerate() {
            parting.middle(a.0, corners[(k + 1) % corners.len()].0);
        }
    }
    let mut origins = Vec::new();
    let mut starts = vec![0];
    let mut marks = vec![false; old_count];
    let mut rim = Vec::new();
    for (face, &is_parted) in is_parted.iter().enumerate() {
        let corners = corners_of(face);
        let first = parting.polygons.len();
        if is_parted {
            parting.part(&corners);
            marks.resize(parting.positions.len(), false);
            for k in first..parting.polygons.len() {
                for &v in parting.polygons.face(k) {
                    marks[v as usize] = true;
                }
            }
        } else if parting.keep(&corners) {
            rim.extend_from_slice(parting.polygons.face(first));
        }
        origins.resize(parting.polygons.len(), refined.face_origins[face]);
        starts.push(parting.polygons.len());
    }
    for v in rim {
        marks[v as usize] = false;
    }
    let groups = mesh.groups().iter().map(|group| FaceGroup {
        name: group.name.clone(),
        faces: starts[group.faces.start.min(starts.len() - 1)]
            ..starts[group.faces.end.min(starts.len() - 1)],
    });
    let groups = groups.collect();
    let uvs = mesh.uvs().is_some().then_some(CornerUvs {
        coordinates: parting.coordinates,
        corners: parting.uv_corners,
    });
    let mut finer = Mesh::new(parting.positions, parting.polygons)?.with_groups(groups);
    if let Some(uvs) = uvs {
        finer = finer.with_uvs(uvs)?;
    }
    let first_count = old_count - refined.vertex_origins.len();
    for parents in parting.parents {
        // Back to the vertices of the mesh that was given.
        let mut shares: BTreeMap<u32, f64> = BTreeMap::new();
        for (parent, share) in parents {
            match (parent as usize).checked_sub(first_count) {
                None => *shares.entry(parent).or_default() += share,
                Some(k) => {
                    for &(v, s) in &refined.vertex_origins[k] {
                        *shares.entry(v).or_default() += s * share;
                    }
                }
            }
        }
        refined.vertex_origins.push(shares.into_iter().collect());
    }
    refined.mesh = finer;
    refined.face_origins = origins;
    Ok(marks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Topology;

    /// A cylinder of quads about the y axis, open above and below.
    fn cylinder(around: u32, rows: u32) -> Mesh {
        let mut positions = Vec::new();
        let mut coordinates = Vec::new();
        for row in 0..=rows {
            for k in 0..around {
                let angle = f64::from(k) / f64::from(around) * std::f64::consts::TAU;
                positions.push(Point::new(angle.sin(), f64::from(row) * 0.3, angle.cos()));
                coordinates.push([k as f32, row as f32]);
            }
        }
        let mut polygons = Polygons::new();
        for row in 0..rows {
            for k in 0..around {
                let (a, b) = (row * around + k, row * around + (k + 1) % around);
                polygons.push(&[a, b, b + around, a + around]);
            }
        }
        let corners = polygons.corners().to_vec();
        let groups = vec![FaceGroup {
            name: "upper".to_owned(),
            faces: polygons.len() / 2..polygons.len(),
        }];
        let mesh = Mesh::new(positions, polygons).unwrap().with_groups(groups);
        mesh.with_uvs(CornerUvs {
            coordinates,
            corners,
        })
        .unwrap()
    }

    #[test]
    fn new_vertices_lie_on_the_smooth_surface_and_old_ones_stay() {
        let coarse = cylinder(24, 8);
        let marks: Vec<bool> = coarse.positions().iter().map(|p| p.z > 0.5).collect();
        let fine = refine(&coarse, &marks, 0.1, 2).unwrap();
        let positions = fine.mesh.positions();
        assert_eq!(&positions[..coarse.vertex_count()], coarse.positions());
        // Vertices of the open ends know half of their normals; the others lie on the cylinder.
        let worst = positions
            .iter()
            .filter(|p| p.y > 0.5 && p.y < 1.9)
            .map(|p| (p.x.hypot(p.z) - 1.0).abs())
            .fold(0.0, f64::max);
        let flat = 1.0 - (std::f64::consts::PI / 24.0).cos();
        assert!(worst < 0.1 * flat, "{worst} of {flat}");
        for (shares, _) in fine.vertex_origins.iter().zip(coarse.vertex_count()..) {
            let total: f64 = shares.iter().map(|s| s.1).sum();
            assert!((total - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn nothing_comes_apart_and_uvs_and_groups_are_kept() {
        let coarse = cylinder(24, 8);
        let marks: Vec<bool> = coarse.positions().iter().map(|p| p.z > 0.5).collect();
        let fine = refine(&coarse, &marks, 0.08, 3).unwrap();
        let edges = Topology::from_mesh(&fine.mesh);
        let open = edges.edges().iter().filter(|e| e.face_count != 2).count();
        let coarse_open = Topology::from_mesh(&coarse);
        let before = coarse_open.edges().iter().filter(|e| e.face_count == 1);
        // The rims of the cylinder alone are open, a little finer where they are refined.
        let ends = |e: &&crate::mesh::Topology| e.boundary_loops().len();
        assert_eq!(ends(&&edges), ends(&&coarse_open));
        assert!(open > before.count());
        assert!(
            edges
                .edges()
                .iter()
                .all(|e| e.face_count <= 2 && !e.has_flip)
        );
        let uvs = fine.mesh.uvs().unwrap();
        for (face, &origin) in fine.face_origins.iter().enumerate() {
            let is_upper = fine.mesh.groups()[0].faces.contains(&face);
            assert_eq!(
                is_upper,
                coarse.groups()[0].faces.contains(&(origin as usize))
            );
            for k in fine.mesh.polygons().corner_range(face) {
                let v = fine.mesh.polygons().corners()[k];
                let uv = uvs.coordinates[uvs.corners[k] as usize];
                let height = fine.mesh.positions()[v as usize].y / 0.3;
                assert!((f64::from(uv[1]) - height).abs() < 0.05, "{uv:?} {height}");
            }
        }
        // No triangle of any fan is flat.
        let areas = fine.mesh.triangles().into_iter().map(|t| {
            let [a, b, c] = t.map(|v| fine.mesh.positions()[v as usize]);
            (b - a).cross(&(c - a)).norm()
        });
        assert!(areas.fold(f64::INFINITY, f64::min) > 1e-4);
    }

    #[test]
    fn fine_meshes_and_unmarked_ones_stay_as_they_are() {
        let coarse = cylinder(24, 8);
        let marks = vec![true; coarse.vertex_count()];
        assert_eq!(refine(&coarse, &marks, 1.0, 3).unwrap().mesh, coarse);
        let none = vec![false; coarse.vertex_count()];
        assert_eq!(refine(&coarse, &none, 0.01, 3).unwrap().mesh, coarse);
        assert!(refine(&coarse, &none[1..], 0.01, 3).is_err());
    }
}
