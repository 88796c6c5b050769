//! The skin as a place to lay patches on: smoothed normals, areas, thickness.

use super::error::AnatomyError;
use crate::mesh::{Surface, SurfacePoint, triangle_edges, vertex_areas, vertex_normals};
use crate::{Point, Vector};

/// Rounds of averaging over neighbours that normals and areas go through: wide enough to pass
/// over the fold beside the nose, narrow enough to keep upper and lower lip apart.
const SMOOTHING_ROUNDS: usize = 6;

/// A ray into the head starts this far inside, so that it does not meet the skin it leaves.
/// [mm at an edge length of 5 mm; scaled with the skin]
const RAY_START: f64 = 0.3;

/// A skin with what laying patches needs to know of it.
#[derive(Debug)]
pub(super) struct SkinFrame {
    /// The triangles, searchable.
    pub(super) surface: Surface,
    /// Smoothed outward unit normals of the vertices.
    pub(super) normals: Vec<Vector>,
    /// Smoothed area that each vertex stands for.
    pub(super) areas: Vec<f64>,
}

impl SkinFrame {
    /// From positions of a template's skin and its triangles.
    pub(super) fn new(positions: &[Point], triangles: &[[u32; 3]]) -> Result<Self, AnatomyError> {
        let surface = Surface::new(positions, triangles)?;
        let edges = triangle_edges(triangles);
        let mut normals = vertex_normals(positions, triangles);
        let mut areas = vertex_areas(positions, triangles);
        for _ in 0..SMOOTHING_ROUNDS {
            smooth(&edges, &mut normals, Vector::zeros());
            for n in &mut normals {
                *n = n.try_normalize(0.0).unwrap_or_else(Vector::zeros);
            }
            smooth(&edges, &mut areas, 0.0);
        }
        Ok(Self {
            surface,
            normals,
            areas,
        })
    }

    /// Smoothed normal at a place.
    pub(super) fn normal(&self, triangle: u32, barycentric: [f64; 3]) -> Vector {
        let t = self.surface.triangles()[triangle as usize];
        let sum: Vector = (0..3)
            .map(|k| self.normals[t[k] as usize] * barycentric[k])
            .sum();
        sum.try_normalize(0.0).unwrap_or_else(Vector::zeros)
    }

    /// Smoothed vertex area at a place.
    pub(super) fn area(&self, triangle: u32, barycentric: [f64; 3]) -> f64 {
        let t = self.surface.triangles()[triangle as usize];
        (0..3)
            .map(|k| self.areas[t[k] as usize] * barycentric[k])
            .sum()
    }

    /// Distance along the inward normal to the skin on the other side, none if there is none
    /// within `reach`. `scale` is the size of the skin relative to the template.
    pub(super) fn thickness(
        &self,
        point: &Point,
        normal: &Vector,
        scale: f64,
        reach: f64,
    ) -> Option<f64> {
        let start = RAY_START * scale;
        let hit = self
            .surface
            .cast_ray(&(point - normal * start), &-normal, reach * scale)?;
        Some(hit.distance + start)
    }

    /// The skin that a blended normal at `point` meets, forwards or backwards, or else the
    /// closest place; within `reach` and only where `accept` takes the triangle.
    pub(super) fn project(
        &self,
        point: &Point,
        normal: &Vector,
        reach: f64,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<SurfacePoint> {
        let facing = |triangle: u32| {
            let [a, b, c] = self.surface.corners(triangle);
            accept(triangle) && (b - a).cross(&(c - a)).dot(normal) > 0.0
        };
        let mut best: Option<SurfacePoint> = None;
        for direction in [*normal, -normal] {
            let hit = self
                .surface
                .cast_ray_where(point, &direction, reach, |h| facing(h.triangle));
            if let Some(hit) = hit
                && best.is_none_or(|b| hit.distance < b.distance)
            {
                best = Some(SurfacePoint {
                    triangle: hit.triangle,
                    barycentric: hit.barycentric,
                    point: self.surface.point_at(hit.triangle, hit.barycentric),
                    distance: hit.distance,
                });
            }
        }
        best.or_else(|| self.closest(point, reach, accept))
    }

    /// The closest place within `reach` on a triangle that `accept` takes.
    pub(super) fn closest(
        &self,
        point: &Point,
        reach: f64,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<SurfacePoint> {
        self.surface
            .closest_where(point, reach, |place| accept(place.triangle))
    }
}

/// One round: every value becomes half itself, half the mean of its neighbours.
fn smooth<T>(edges: &[[u32; 2]], values: &mut [T], zero: T)
where
    T: Copy + std::ops::AddAssign + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let mut sums = vec![zero; values.len()];
    let mut counts = vec![0u32; values.len()];
    for &[a, b] in edges {
        let (a, b) = (a as usize, b as usize);
        sums[a] += values[b];
        sums[b] += values[a];
        counts[a] += 1;
        counts[b] += 1;
    }
    for ((value, sum), count) in values.iter_mut().zip(sums).zip(counts) {
        if count > 0 {
            *value = *value * 0.5 + sum * (0.5 / f64::from(count));
        }
    }
}
