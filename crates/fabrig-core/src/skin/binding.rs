//! The user's vertices on the nodes.

use serde::{Deserialize, Serialize};

use crate::mesh::SurfacePoint;
use crate::skin::{SkinError, SmoothInterpolation, TemplateWeights};

/// Weights below this are dropped.
const LEAST_WEIGHT: f32 = 1e-4;

/// Which nodes move each skin vertex, and how much; rows stand one after another.
///
/// Nodes count patch after patch; the index after the last node is the mandible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SkinBinding {
    /// Nodes of each patch.
    pub node_counts: Vec<u32>,
    /// Start of each vertex's row, and the end; length = vertex count + 1.
    pub starts: Vec<u32>,
    /// Node of each entry, rising within a row.
    pub nodes: Vec<u32>,
    /// Weight of each entry; a row sums to about one at most, the rest is the
    /// skull's.
    pub weights: Vec<f32>,
}

impl SkinBinding {
    /// Gives every user vertex the weights of its place on the template.
    ///
    /// - `places`: for each user vertex its place on the template's topology, or `None` for
    ///   vertices that do not follow the patches
    /// - `interpolation`: over the template's skin
    ///
    /// # Errors
    ///
    /// [`SkinError::TriangleOutOfRange`].
    pub fn bind(
        weights: &TemplateWeights,
        interpolation: &SmoothInterpolation<'_>,
        places: &[Option<SurfacePoint>],
        node_counts: Vec<u32>,
    ) -> Result<Self, SkinError> {
        let mut binding = Self {
            node_counts,
            starts: Vec::with_capacity(places.len() + 1),
            nodes: Vec::new(),
            weights: Vec::new(),
        };
        binding.starts.push(0);
        let mut row: Vec<(u32, f32)> = Vec::new();
        let mut shares = Vec::new();
        for (vertex, place) in places.iter().enumerate() {
            row.clear();
            if let Some(place) = place {
                let triangle_count = interpolation.triangle_count();
                if place.triangle as usize >= triangle_count {
                    return Err(SkinError::TriangleOutOfRange {
                        vertex,
                        triangle: place.triangle,
                        triangle_count,
                    });
                }
                interpolation.shares(place, &mut shares);
                for &(v, share) in &shares {
                    let share = share as f32;
                    let entries = &weights.by_vertex[v as usize];
                    row.extend(entries.iter().map(|&(node, w)| (node, share * w)));
                }
            }
            row.sort_by_key(|entry| entry.0);
            for same in row.chunk_by(|a, b| a.0 == b.0) {
                let weight: f32 = same.iter().map(|entry| entry.1).sum();
                if weight.abs() >= LEAST_WEIGHT {
                    binding.nodes.push(same[0].0);
                    binding.weights.push(weight);
                }
            }
            binding.starts.push(binding.nodes.len() as u32);
        }
        Ok(binding)
    }

    /// How many skin vertices there are.
    pub fn vertex_count(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Entries of one vertex: (node, weight).
    pub fn row(&self, vertex: usize) -> impl Iterator<Item = (u32, f32)> + '_ {
        let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        self.nodes[range.clone()]
            .iter()
            .copied()
            .zip(self.weights[range].iter().copied())
    }

    /// Index that stands for the mandible.
    pub fn mandible(&self) -> u32 {
        self.node_counts.iter().sum()
    }
}
