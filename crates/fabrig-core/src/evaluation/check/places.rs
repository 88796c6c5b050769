//! Where the vertices of a rig's mesh are on the template, and what the template does there.

use nalgebra::Point3;
use rayon::prelude::*;

use super::run::CheckError;
use crate::evaluation::delta_transfer::size;
use crate::mesh::{Surface, SurfacePoint, triangle_edges, vertex_normals};
use crate::rig::Rig;
use crate::template::{RegionId, Template};
use crate::{Point, Vector};

/// A vertex is in view where nothing stands over it within this. (mm)
const CLEAR: f64 = 40.0;
/// Start of the ray that looks for it. (mm)
const LIFT: f64 = 0.3;
/// Regions that one does not see, and those that are no face.
const HIDDEN: [&str; 3] = ["mouth_interior", "socket", "nostril"];
const NO_FACE: [&str; 3] = ["neck", "scalp", "ear"];

/// A rig's mesh on its template.
pub(super) struct Places<'a> {
    pub(super) template: &'a Template,
    /// Triangles of the template.
    pub(super) template_triangles: Vec<[u32; 3]>,
    /// The registered template.
    pub(super) surface: Surface,
    /// Place of every vertex of the skin on it.
    pub(super) of_vertex: Vec<Option<SurfacePoint>>,
    /// Region of every vertex of the skin.
    pub(super) regions: Vec<Option<RegionId>>,
    /// Triangles of the skin.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Their edges.
    pub(super) edges: Vec<[u32; 2]>,
    /// Whether a vertex is on the face and in view.
    pub(super) is_in_view: Vec<bool>,
    /// Size of the face against the template.
    pub(super) size: f64,
}

impl<'a> Places<'a> {
    pub(super) fn new(rig: &Rig, template: &'a Template) -> Result<Self, CheckError> {
        let names: Vec<&str> = template
            .regions
            .regions
            .iter()
            .map(|r| r.name.as_str())
            .collect();
        let is_same = rig.region_names.iter().map(String::as_str).eq(names);
        if rig.template != template.name
            || rig.positions.len() != template.skin.vertex_count()
            || rig.shape_names.len() != template.shapes.len()
            || !is_same
        {
            return Err(CheckError::Template {
                expected: rig.template.clone(),
                found: template.name.clone(),
            });
        }
        let template_triangles = template.skin.triangles();
        let surface = Surface::new(&rig.positions, &template_triangles)?;
        let positions = rig.face_in_head();
        let is_skin = |v: &u32| rig.regions[*v as usize].is_some();
        let mut triangles = rig.face.triangles();
        triangles.retain(|t| t.iter().all(is_skin));
        let normals = vertex_normals(&positions, &triangles);
        let template_normals = vertex_normals(&rig.positions, &template_triangles);
        let regions = &template.regions;
        let of_vertex = positions
            .par_iter()
            .enumerate()
            .map(|(v, p)| {
                let own = rig.regions[v]?;
                let is_own_side = |at: &SurfacePoint| {
                    template_triangles[at.triangle as usize]
                        .iter()
                        .all(|&c| !regions.are_apart(own, regions.vertex_regions[c as usize]))
                };
                let faces = |at: &SurfacePoint| {
                    surface.blend(at, &template_normals).dot(&normals[v]) >= 0.0
                };
                surface
                    .closest_where(p, f64::INFINITY, |at| is_own_side(at) && faces(at))
                    .or_else(|| surface.closest_where(p, f64::INFINITY, is_own_side))
            })
            .collect();
        let begins = |region: RegionId, with: &[&str]| {
            let name = &regions.regions[region.0 as usize].name;
            with.iter().any(|start| name.starts_with(start))
        };
        // Labels are of the nearest place; what lies behind cheeks and lips has theirs.
        let own = Surface::new(&positions, &triangles)?;
        let is_in_view = rig
            .regions
            .par_iter()
            .enumerate()
            .map(|(v, region)| {
                let is_of_face = |r| !begins(r, &HIDDEN) && !begins(r, &NO_FACE);
                region.is_some_and(is_of_face) && {
                    let from = positions[v] + normals[v] * LIFT;
                    own.cast_ray(&from, &normals[v], CLEAR).is_none()
                }
            })
            .collect();
        Ok(Self {
            template,
            size: size(&rig.positions) / size(template.skin.positions()),
            edges: triangle_edges(&triangles),
            regions: rig.regions.clone(),
            template_triangles,
            surface,
            of_vertex,
            triangles,
            is_in_view,
        })
    }

    /// Displacement of every vertex of the template by some of its shapes at weight 1. (mm)
    pub(super) fn drawn(&self, shapes: &[usize]) -> Vec<Vector> {
        let mut whole = vec![Vector::zeros(); self.template.skin.vertex_count()];
        for &shape in shapes {
            for &(v, delta) in &self.template.shapes[shape].deltas {
                whole[v as usize] += delta;
            }
        }
        whole
    }

    /// What that does at a place, at the face's size. (mm)
    pub(super) fn at(&self, place: &SurfacePoint, drawn: &[Vector]) -> Vector {
        let corners = self.template_triangles[place.triangle as usize].iter();
        let shares = corners.zip(place.barycentric);
        let sum: Vector = shares.map(|(&v, share)| drawn[v as usize] * share).sum();
        sum * self.size
    }

    /// The place on the template itself: its own coordinates, the same on every face. (mm)
    pub(super) fn on_template(&self, place: &SurfacePoint) -> Point {
        let corners = self.template_triangles[place.triangle as usize].iter();
        let shares = corners.zip(place.barycentric);
        let positions = self.template.skin.positions();
        let sum: Vector = shares
            .map(|(&v, share)| positions[v as usize].coords * share)
            .sum();
        Point::from(sum)
    }

    /// Unit normals of triangles, zero for those without area, and their areas. (mm^2)
    pub(super) fn normals_and_areas(
        &self,
        positions: &[Point3<f32>],
    ) -> Vec<(nalgebra::Vector3<f32>, f32)> {
        self.triangles
            .par_iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| positions[v as usize]);
                let normal = (b - a).cross(&(c - a));
                let area = normal.norm() / 2.0;
                (normal.try_normalize(0.0).unwrap_or_default(), area)
            })
            .collect()
    }
}
