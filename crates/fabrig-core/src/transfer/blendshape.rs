//! Muscle shapes: whole-face shapes sampled on patches (Eq. 1-2).
//!
//! A node hangs at depth `d` under a place `p` of the skin. Where a shape moves the skin to
//! `p'` with normal `n'`, the node moves by `(p' - d n') - (p - d n)`: it follows its place
//! and swings with the normal. So each muscle shape holds the muscle's own contraction and
//! the passive motion that other muscles cause.

use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::anatomy::{PatchChart, SurfaceNode};
use crate::mesh::vertex_normals;
use crate::template::Template;
use crate::transfer::TransferError;
use crate::{Point, Vector};

/// Rounds of neighbour averaging of the normals that nodes swing with: enough to keep the
/// crease of a lip or lid from turning a node over.
const NORMAL_SMOOTHING_ROUNDS: usize = 3;

/// One template shape on one patch, Db_i of Eq. 3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MuscleShape {
    /// `zygomaticus_major_l.mouthSmileLeft`
    pub name: String,
    /// Index in [`Template::shapes`].
    pub shape: u32,
    /// Displacement of every node at weight 1 on the template. (mm), shape `[node_count]`
    pub deltas: Vec<Vector3<f32>>,
}

/// Vertex normals averaged over neighbours, unit length.
pub fn smoothed_normals(positions: &[Point], triangles: &[[u32; 3]], rounds: usize) -> Vec<Vector> {
    let mut normals = vertex_normals(positions, triangles);
    for _ in 0..rounds {
        let mut sums = normals.clone();
        for t in triangles {
            let total: Vector = t.iter().map(|&v| normals[v as usize]).sum();
            for &v in t {
                sums[v as usize] += total;
            }
        }
        for (normal, sum) in normals.iter_mut().zip(sums) {
            *normal = sum.try_normalize(f64::EPSILON).unwrap_or(*normal);
        }
    }
    normals
}

/// Samples displacements of a skin in the template's topology anywhere at or under it.
pub struct ShapeSampler<'a> {
    rest: &'a [Point],
    triangles: Vec<[u32; 3]>,
    normals: Vec<Vector>,
}

/// One shape at weight 1 on every skin vertex.
pub struct SampledShape {
    /// Displacements of the skin. (mm)
    deltas: Vec<Vector>,
    /// Change of the smoothed normals.
    normal_deltas: Vec<Vector>,
}

impl<'a> ShapeSampler<'a> {
    /// Prepares the template's neutral skin.
    pub fn new(template: &'a Template) -> Self {
        Self::on(template, template.skin.positions())
    }

    /// Prepares the skin of a face in the template's topology.
    ///
    /// - `rest`: one position for each vertex of the template (mm)
    pub fn on(template: &Template, rest: &'a [Point]) -> Self {
        let triangles = template.skin.triangles();
        let normals = smoothed_normals(rest, &triangles, NORMAL_SMOOTHING_ROUNDS);
        Self {
            rest,
            triangles,
            normals,
        }
    }

    /// Triangles of the template's skin.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// A displacement of every vertex (mm), with the change of normals that it makes.
    pub fn sample_deltas(&self, deltas: Vec<Vector>) -> SampledShape {
        let moved: Vec<Point> = self.rest.iter().zip(&deltas).map(|(p, d)| p + d).collect();
        let normals = smoothed_normals(&moved, &self.triangles, NORMAL_SMOOTHING_ROUNDS);
        let normal_deltas = normals
            .iter()
            .zip(&self.normals)
            .map(|(moved, rest)| moved - rest)
            .collect();
        SampledShape {
            deltas,
            normal_deltas,
        }
    }

    /// Displacement of one node under a sampled shape. (mm)
    pub fn node_delta(&self, shape: &SampledShape, node: &SurfaceNode) -> Vector {
        let corners = self.triangles[node.triangle as usize];
        let mut delta = Vector::zeros();
        for (&corner, weight) in corners.iter().zip(node.barycentric) {
            let v = corner as usize;
            delta += weight * (shape.deltas[v] - node.depth * shape.normal_deltas[v]);
        }
        delta
    }

    /// Displacements of all nodes of a patch under a sampled shape. (mm)
    pub fn patch_deltas(&self, shape: &SampledShape, chart: &PatchChart) -> Vec<Vector> {
        let nodes = chart.nodes.iter();
        nodes.map(|node| self.node_delta(shape, node)).collect()
    }

    /// Blends values given per skin vertex at the place of a node.
    pub fn blend(&self, node: &SurfaceNode, values: &[Vector]) -> Vector {
        let corners = self.triangles[node.triangle as usize];
        corners
            .iter()
            .zip(node.barycentric)
            .map(|(&v, weight)| values[v as usize] * weight)
            .sum()
    }

    /// Checks that every node of the charts lies on this template.
    ///
    /// # Errors
    ///
    /// [`TransferError::NodeOutOfRange`].
    pub fn check(&self, charts: &[PatchChart]) -> Result<(), TransferError> {
        for chart in charts {
            for (index, node) in chart.nodes.iter().enumerate() {
                if node.triangle as usize >= self.triangles.len() {
                    return Err(TransferError::NodeOutOfRange {
                        patch: chart.name.clone(),
                        node: index,
                        triangle: node.triangle,
                        triangle_count: self.triangles.len(),
                    });
                }
            }
        }
        Ok(())
    }
}

/// Samples every shape of the template on every patch; shapes that move no node of a patch
/// by `threshold_mm` are left out of it.
///
/// Returns one list per chart, shapes in the template's order.
///
/// # Errors
///
/// [`TransferError::NodeOutOfRange`] where a chart does not belong to this template.
pub fn muscle_shapes(
    template: &Template,
    charts: &[PatchChart],
    threshold_mm: f64,
) -> Result<Vec<Vec<MuscleShape>>, TransferError> {
    let count = template.skin.vertex_count();
    let shapes = template.shapes.iter();
    let deltas: Vec<Vec<Vector>> = shapes.map(|shape| shape.spread(count)).collect();
    muscle_shapes_on_face(
        template,
        template.skin.positions(),
        &deltas,
        charts,
        threshold_mm,
    )
}

/// As [`muscle_shapes`], of displacements that the template's shapes make on another face.
///
/// - `positions`: the face in the template's topology (mm)
/// - `deltas`: of every vertex by each of the template's shapes (mm), as
///   [`offsets_on_face`](super::offsets_on_face) gives them
///
/// # Errors
///
/// [`TransferError::NodeOutOfRange`] where a chart does not belong to this template.
pub fn muscle_shapes_on_face(
    template: &Template,
    positions: &[Point],
    deltas: &[Vec<Vector>],
    charts: &[PatchChart],
    threshold_mm: f64,
) -> Result<Vec<Vec<MuscleShape>>, TransferError> {
    let sampler = ShapeSampler::on(template, positions);
    sampler.check(charts)?;
    let sampled: Vec<SampledShape> = deltas
        .par_iter()
        .map(|deltas| sampler.sample_deltas(deltas.clone()))
        .collect();
    let of_chart = |chart: &PatchChart| {
        let shapes = template.shapes.iter().zip(&sampled).enumerate();
        shapes
            .filter_map(|(index, (shape, sampled))| {
                let deltas = sampler.patch_deltas(sampled, chart);
                let moves = deltas.iter().any(|d| d.norm() >= threshold_mm);
                moves.then(|| MuscleShape {
                    name: format!("{}.{}", chart.name, shape.name),
                    shape: index as u32,
                    deltas: deltas.iter().map(|d| d.cast::<f32>()).collect(),
                })
            })
            .collect()
    };
    Ok(charts.par_iter().map(of_chart).collect())
}
