//! What crosses, as the exact test sees it.

use nalgebra::{Isometry3, Point3};

use super::contact::Contact;
use super::crossing::crossings;
use super::{Collider, CollisionError, collider_mesh};
use crate::mesh::triangle_edges;

/// Crossings among everything that may collide.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Verdict {
    /// Crossings of patches with each other and themselves.
    pub cloth: usize,
    /// Crossings of patches with colliders.
    pub colliders: usize,
    /// Folds: crossings of a patch with its own next two cells, which contact leaves to bending.
    pub folds: usize,
}

impl Contact {
    /// Tests every edge against every triangle that it may collide with, exactly. Only what
    /// may collide at all is taken from contact; round colliders are judged by meshes inside
    /// them.
    ///
    /// - `positions`: nodes of a patch of the cloth (mm)
    /// - `colliders`: the scene's colliders with their poses in the head frame
    ///
    /// # Errors
    ///
    /// [`CollisionError`] for a collider that cannot be.
    pub fn judge<'a>(
        &self,
        positions: impl Fn(usize) -> &'a [Point3<f32>],
        colliders: &[(&Collider, Isometry3<f64>)],
    ) -> Result<Verdict, CollisionError> {
        let mut points: Vec<Point3<f32>> = Vec::new();
        let mut triangles = Vec::new();
        for (&patch, part) in self.patches.iter().zip(&self.parts) {
            points.extend_from_slice(positions(patch));
            triangles.extend(part.triangles());
        }
        let cloth = self.patches.len();
        let mut owner: Vec<usize> = self.part_of[..points.len()]
            .iter()
            .map(|&p| p as usize)
            .collect();
        for (index, (collider, pose)) in colliders.iter().enumerate() {
            let (vertices, own) = collider_mesh(collider, index)?;
            let first = points.len() as u32;
            points.extend(vertices.iter().map(|p| (pose * p).cast::<f32>()));
            triangles.extend(own.iter().map(|t| t.map(|v| v + first)));
            owner.resize(points.len(), cloth + index);
        }
        let edges = triangle_edges(&triangles);
        let mut verdict = Verdict::default();
        let found = crossings(&points, &edges, &triangles, |e, t| {
            let (a, b) = (
                owner[edges[e as usize][0] as usize],
                owner[triangles[t as usize][0] as usize],
            );
            if a >= cloth && b >= cloth {
                return false;
            }
            a >= cloth
                || b >= cloth
                || self
                    .rules
                    .parts
                    .binary_search(&[a.min(b), a.max(b)])
                    .is_ok()
        });
        for c in found {
            let (edge, triangle) = (edges[c.edge as usize], triangles[c.triangle as usize]);
            let (a, b) = (owner[edge[0] as usize], owner[triangle[0] as usize]);
            if a >= cloth || b >= cloth {
                verdict.colliders += 1;
            } else if a != b {
                verdict.cloth += 1;
            } else {
                match self.rules.side(&self.parts[a], &edge, &triangle) {
                    Side::Apart => verdict.cloth += 1,
                    Side::Neighbours => verdict.folds += 1,
                    Side::Excused => {}
                }
            }
        }
        Ok(verdict)
    }
}

/// How two elements of one patch stand to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    /// They are held apart.
    Apart,
    /// They are within two cells of each other.
    Neighbours,
    /// They are where the patch crosses itself at rest.
    Excused,
}
