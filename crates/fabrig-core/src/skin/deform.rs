//! Moving the skin.

use nalgebra::Point3;
use rayon::prelude::*;

use crate::anatomy::GridShape;
use crate::skin::{NodeAffine, NodeFrames, SkinBinding, SkinError};

/// A bound skin, ready to be moved frame after frame.
#[derive(Debug, Clone)]
pub struct SkinDeformer {
    frames: Vec<NodeFrames>,
    /// One per node, patch after patch, then the mandible.
    affines: Vec<NodeAffine>,
    rest: Vec<Point3<f32>>,
}

impl SkinDeformer {
    /// Prepares a skin.
    ///
    /// - `patches`: each grid with its nodes at rest (mm)
    /// - `rest`: skin at rest, one per vertex of `binding` [mm, head frame]
    ///
    /// # Errors
    ///
    /// [`SkinError`] where sizes do not fit the binding.
    pub fn new(
        binding: &SkinBinding,
        patches: Vec<(GridShape, Vec<Point3<f32>>)>,
        rest: Vec<Point3<f32>>,
    ) -> Result<Self, SkinError> {
        if patches.len() != binding.node_counts.len() {
            return Err(SkinError::PatchCount {
                expected: binding.node_counts.len(),
                found: patches.len(),
            });
        }
        for (patch, ((_, nodes), &expected)) in patches.iter().zip(&binding.node_counts).enumerate()
        {
            if nodes.len() != expected as usize {
                return Err(SkinError::NodeCount {
                    patch,
                    expected: expected as usize,
                    found: nodes.len(),
                });
            }
        }
        if rest.len() != binding.vertex_count() {
            return Err(SkinError::VertexCount {
                expected: binding.vertex_count(),
                found: rest.len(),
            });
        }
        let count = binding.mandible() as usize + 1;
        Ok(Self {
            frames: patches
                .into_iter()
                .map(|(grid, nodes)| NodeFrames::new(grid, nodes))
                .collect(),
            affines: vec![NodeAffine::identity(); count],
            rest,
        })
    }

    /// The same, where a patch folds at some nodes: see [`NodeFrames::turning_across`].
    ///
    /// - `is_folding`: one per node of `patch`, or none where nothing folds
    pub fn turning_across(mut self, patch: usize, is_folding: &[bool]) -> Self {
        if is_folding.contains(&true) {
            let frames = self.frames.remove(patch).turning_across(is_folding);
            self.frames.insert(patch, frames);
        }
        self
    }

    /// Skin at rest. [mm, head frame]
    pub fn rest(&self) -> &[Point3<f32>] {
        &self.rest
    }

    /// What every node and the mandible do now; kept from the last [`Self::deform`].
    pub fn affines(&self) -> &[NodeAffine] {
        &self.affines
    }

    /// Moves the skin with nodes and mandible.
    ///
    /// - `nodes`: each patch's nodes now [mm, head frame]
    /// - `mandible`: what the lower jaw does to space
    /// - `out`: receives the skin [mm, head frame], one per vertex
    ///
    /// # Errors
    ///
    /// [`SkinError`] where sizes do not fit the binding.
    pub fn deform<N: AsRef<[Point3<f32>]> + Sync>(
        &mut self,
        binding: &SkinBinding,
        nodes: &[N],
        mandible: NodeAffine,
        out: &mut [Point3<f32>],
    ) -> Result<(), SkinError> {
        if nodes.len() != self.frames.len() {
            return Err(SkinError::PatchCount {
                expected: self.frames.len(),
                found: nodes.len(),
            });
        }
        if out.len() != self.rest.len() {
            return Err(SkinError::VertexCount {
                expected: self.rest.len(),
                found: out.len(),
            });
        }
        let mut rest = &mut self.affines[..];
        let mut by_patch = Vec::with_capacity(nodes.len());
        for (patch, (frames, now)) in self.frames.iter().zip(nodes).enumerate() {
            let (expected, found) = (frames.rest().len(), now.as_ref().len());
            if expected != found {
                return Err(SkinError::NodeCount {
                    patch,
                    expected,
                    found,
                });
            }
            let (own, others) = rest.split_at_mut(expected);
            by_patch.push((frames, now.as_ref(), own));
            rest = others;
        }
        rest[0] = mandible;
        by_patch
            .into_par_iter()
            .for_each(|(frames, now, affines)| frames.affines(now, affines));
        let affines = &self.affines;
        out.par_iter_mut()
            .zip(&self.rest)
            .enumerate()
            .with_min_len(256)
            .for_each(|(vertex, (out, rest))| {
                let mut moved = nalgebra::Vector3::zeros();
                for (node, weight) in binding.row(vertex) {
                    moved += affines[node as usize].displacement(rest) * weight;
                }
                *out = rest + moved;
            });
        Ok(())
    }
}
