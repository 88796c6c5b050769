//! A face mesh made from the template's topology, with the true place of every template vertex.

use std::collections::BTreeMap;

use nalgebra::Similarity3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::mesh::{Mesh, MeshError, Polygons, Topology, vertex_normals};
use crate::template::build::decimate;
use crate::template::{Person, Template};
use crate::{Point, Vector};

/// A mesh and its truth; every step moves both alike.
#[derive(Debug, Clone)]
pub struct Specimen {
    /// True place of every template vertex, in the mesh's frame.
    pub truth: Vec<Point>,
    /// Whether the mesh still has that place.
    pub is_present: Vec<bool>,
    positions: Vec<Point>,
    faces: Vec<Vec<u32>>,
}

impl Specimen {
    /// The template itself.
    pub fn template(template: &Template) -> Self {
        Self::from_truth(template, template.skin.positions())
    }

    /// A person in the template's topology.
    pub fn person(template: &Template, person: &Person) -> Self {
        Self::from_truth(template, &person.positions)
    }

    /// The template's topology at any places.
    pub fn from_truth(template: &Template, truth: &[Point]) -> Self {
        Self {
            truth: truth.to_vec(),
            is_present: vec![true; truth.len()],
            positions: truth.to_vec(),
            faces: template
                .skin
                .polygons()
                .iter()
                .map(<[u32]>::to_vec)
                .collect(),
        }
    }

    /// The mesh.
    ///
    /// # Errors
    ///
    /// [`MeshError`] when nothing is left of it.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        Mesh::new(self.positions.clone(), Polygons::from_faces(&self.faces))
    }

    /// Vertices of the mesh.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Moves everything.
    #[must_use]
    pub fn moved(mut self, by: impl Fn(&Point) -> Point) -> Self {
        for p in self.truth.iter_mut().chain(&mut self.positions) {
            *p = by(p);
        }
        self
    }

    /// Turns, scales and shifts.
    #[must_use]
    pub fn posed(self, pose: &Similarity3<f64>) -> Self {
        self.moved(|p| pose.transform_point(p))
    }

    /// A smooth nonlinear map: an affine part and bumps of 20 to 60 mm, `strength` times a few
    /// millimetres each, fixed by `seed`.
    #[must_use]
    pub fn warped(self, seed: u64, strength: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |reach: f64| rng.random_range(-reach..reach);
        let stretch = Vector::from_fn(|_, _| 1.0 + 0.04 * strength * draw(1.0));
        let shear = 0.0003 * strength * draw(1.0);
        let bumps: Vec<(Point, f64, Vector)> = (0..12)
            .map(|_| {
                let center = Point::new(draw(60.0), draw(90.0) - 10.0, 25.0 + draw(35.0));
                let radius = 40.0 + draw(18.0);
                // Steeper than a third, a bump would fold the surface over.
                let by = Vector::from_fn(|_, _| draw(2.5 * strength));
                (center, radius, by)
            })
            .collect();
        self.moved(|p| {
            let mut q = Point::new(p.x * stretch.x, p.y * stretch.y, p.z * stretch.z);
            q.x += shear * p.x * p.y;
            q.z += shear * p.y * p.y;
            for (center, radius, by) in &bumps {
                q += by * (-(p - center).norm_squared() / (radius * radius)).exp();
            }
            q
        })
    }

    /// One Gaussian bump.
    #[must_use]
    pub fn bulged(self, center: [f64; 3], radius: f64, by: [f64; 3]) -> Self {
        self.moved(|p| {
            let d = p - Point::from(center);
            p + Vector::from(by) * (-d.norm_squared() / (radius * radius)).exp()
        })
    }

    /// Drops faces that touch a vertex for which `is_cut` says so; the mesh must still have the
    /// template's vertices. Truth without a face is no longer present.
    #[must_use]
    pub fn cut(mut self, is_cut: impl Fn(u32, &Point) -> bool) -> Self {
        let gone: Vec<bool> = (0..self.positions.len())
            .map(|v| is_cut(v as u32, &self.positions[v]))
            .collect();
        self.faces.retain(|f| f.iter().all(|&v| !gone[v as usize]));
        let mut used = vec![false; self.positions.len()];
        for &v in self.faces.iter().flatten() {
            used[v as usize] = true;
        }
        for (is_present, used) in self.is_present.iter_mut().zip(used) {
            *is_present &= used;
        }
        self
    }

    /// Without mouth, sockets and nostrils, and their rims closed by fans: a scan whose lips and
    /// lids are one surface. Works on the template's vertices.
    #[must_use]
    pub fn sealed(self, template: &Template) -> Self {
        let regions = &template.regions;
        let mut sealed = self.cut(|v, _| {
            let name = &regions.regions[regions.vertex_regions[v as usize].0 as usize].name;
            name.starts_with("mouth_interior") || name.starts_with("socket")
        });
        let topology = Topology::from_faces(
            sealed.positions.len(),
            sealed.faces.iter().map(|f| f.as_slice()),
        );
        let mut loops = topology.boundary_loops();
        // The longest is the neck.
        loops.sort_by_key(Vec::len);
        loops.pop();
        for rim in loops {
            let sum: Vector = rim
                .iter()
                .map(|&v| sealed.positions[v as usize].coords)
                .sum();
            let middle = sealed.positions.len() as u32;
            sealed.positions.push(Point::from(sum / rim.len() as f64));
            for (k, &v) in rim.iter().enumerate() {
                sealed.faces.push(vec![rim[(k + 1) % rim.len()], v, middle]);
            }
        }
        sealed
    }

    /// Vertices at the middles of the edges only: triangles become smaller triangles, vertices
    /// become polygons. The surface stays, no vertex does.
    #[must_use]
    pub fn remeshed(mut self) -> Self {
        let triangles = self.triangles();
        let mut number = BTreeMap::new();
        let mut points = Vec::new();
        let mut middle = |a: u32, b: u32| {
            *number.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push(nalgebra::center(
                    &self.positions[a as usize],
                    &self.positions[b as usize],
                ));
                points.len() as u32 - 1
            })
        };
        let mut faces: Vec<Vec<u32>> = Vec::new();
        // For each vertex: edge middle -> next one, counter-clockwise around it.
        let mut around: Vec<BTreeMap<u32, u32>> = vec![BTreeMap::new(); self.positions.len()];
        for t in &triangles {
            let m = [0, 1, 2].map(|k| middle(t[k], t[(k + 1) % 3]));
            faces.push(m.to_vec());
            for k in 0..3 {
                around[t[k] as usize].insert(m[k], m[(k + 2) % 3]);
            }
        }
        for ring in around {
            let Some((&first, _)) = ring.first_key_value() else {
                continue;
            };
            let mut polygon = vec![first];
            let mut at = first;
            while let Some(&next) = ring.get(&at) {
                if next == first || polygon.len() == ring.len() {
                    break;
                }
                polygon.push(next);
                at = next;
            }
            if ring.get(&at) == Some(&first) && polygon.len() == ring.len() {
                faces.push(polygon);
            }
        }
        self.positions = points;
        self.faces = faces;
        self
    }

    /// Every triangle into four, `times` over; the surface stays.
    #[must_use]
    pub fn subdivided(mut self, times: usize) -> Self {
        let mut triangles = self.triangles();
        for _ in 0..times {
            // Edges sorted once: a map of a million of them takes longer.
            let mut edges: Vec<[u32; 2]> = triangles
                .iter()
                .flat_map(|t| [0, 1, 2].map(|k| sorted(t[k], t[(k + 1) % 3])))
                .collect();
            edges.sort_unstable();
            edges.dedup();
            let first = self.positions.len() as u32;
            for &[a, b] in &edges {
                self.positions.push(nalgebra::center(
                    &self.positions[a as usize],
                    &self.positions[b as usize],
                ));
            }
            let middle = |a: u32, b: u32| {
                let k = edges.binary_search(&sorted(a, b)).unwrap_or_default();
                first + k as u32
            };
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        self.faces = triangles.iter().map(|t| t.to_vec()).collect();
        self
    }

    /// Fewer vertices, at new places, by edge collapse.
    #[must_use]
    pub fn decimated(mut self, vertex_count: usize) -> Self {
        let (positions, triangles) = decimate(&self.positions, &self.triangles(), vertex_count);
        self.positions = positions;
        self.faces = triangles.iter().map(|t| t.to_vec()).collect();
        self
    }

    /// Normal noise along the normals. (standard deviation in the mesh's unit)
    #[must_use]
    pub fn noised(mut self, seed: u64, deviation: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normals = vertex_normals(&self.positions, &self.triangles());
        for (p, n) in self.positions.iter_mut().zip(&normals) {
            // Box & Muller.
            let u: f64 = rng.random_range(f64::MIN_POSITIVE..1.0);
            let v: f64 = rng.random_range(0.0..std::f64::consts::TAU);
            *p += n * (deviation * (-2.0 * u.ln()).sqrt() * v.cos());
        }
        self
    }

    /// Round holes, at the vertices nearest to `places`. Works on the template's vertices.
    #[must_use]
    pub fn holed(self, places: &[[f64; 3]], radius: f64) -> Self {
        self.cut(|_, p| places.iter().any(|h| (p - Point::from(*h)).norm() < radius))
    }

    /// The mirror image, corners in the same order: what a wrong axis in an exporter gives.
    #[must_use]
    pub fn mirrored(mut self, template: &Template) -> Self {
        self = self.moved(|p| Point::new(-p.x, p.y, p.z));
        // What was the left side is now the right one of the face that is seen.
        self.truth = template
            .mirror
            .iter()
            .map(|&v| self.truth[v as usize])
            .collect();
        self.is_present = template
            .mirror
            .iter()
            .map(|&v| self.is_present[v as usize])
            .collect();
        self
    }

    /// Corners in reverse order.
    #[must_use]
    pub fn turned_inside_out(mut self) -> Self {
        for f in &mut self.faces {
            f.reverse();
        }
        self
    }

    /// Adds the template's eyes, teeth and tongue as loose pieces.
    #[must_use]
    pub fn with_parts(mut self, template: &Template) -> Self {
        for part in &template.rigid_parts {
            let first = self.positions.len() as u32;
            self.positions.extend_from_slice(part.mesh.positions());
            self.faces.extend(
                part.mesh
                    .polygons()
                    .iter()
                    .map(|f| f.iter().map(|v| v + first).collect()),
            );
        }
        self
    }

    /// Another mesh instead, that has no truth at all.
    #[must_use]
    pub fn replaced(mut self, positions: Vec<Point>, faces: Vec<Vec<u32>>) -> Self {
        self.positions = positions;
        self.faces = faces;
        self.is_present.fill(false);
        self
    }

    fn triangles(&self) -> Vec<[u32; 3]> {
        Polygons::from_faces(&self.faces).triangles()
    }
}

fn sorted(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Surface;
    use crate::template::human;

    #[test]
    fn new_meshes_keep_the_surface_and_its_truth() {
        let template = human();
        let whole = Specimen::template(template).warped(3, 1.0);
        let surface = |s: &Specimen| Surface::new(&s.positions, &s.triangles()).expect("surface");
        let before = surface(&whole);
        for specimen in [whole.clone().remeshed(), whole.clone().subdivided(1)] {
            let off = specimen
                .positions
                .iter()
                .map(|p| before.closest(p).distance)
                .fold(0.0, f64::max);
            assert!(off < 1e-9, "{off}");
            assert_eq!(specimen.truth, whole.truth);
        }
        let fewer = whole.clone().decimated(500);
        assert!(fewer.vertex_count() <= 500);
        assert!(fewer.mesh().is_ok());
        let holed = whole.clone().cut(|_, p| p.x > 10.0);
        let kept = holed.is_present.iter().filter(|k| **k).count();
        assert!(kept < whole.truth.len() && kept > 1000);
        let twice = whole.clone().mirrored(template).mirrored(template);
        assert_eq!(twice.truth, whole.truth);
    }
}
