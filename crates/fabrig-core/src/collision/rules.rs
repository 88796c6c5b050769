//! Which elements may collide at all.
//!
//! - A patch collides with itself, except elements within two cells of each other in its grid:
//!   stretch, shear and bending keep those apart.
//! - Two patches collide unless they are attached to each other (they are then one tissue,
//!   held at the offset of their targets) or cross at rest (interwoven fibres, as where the
//!   levators meet above the lip: there is no side to keep them on).
//! - Where a patch crosses itself at rest, as at a pinched corner of the mouth, the elements of
//!   that place are excused.

use nalgebra::Point3;

use super::crossing::crossings;
use super::judge::Side;
use super::mesh::Part;
use super::{ContactPatch, PairMask};
use crate::mesh::triangle_edges;

/// What may collide with what.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rules {
    /// Pairs of parts, the first not above the second, rising.
    pub(crate) parts: Vec<[usize; 2]>,
    /// Pairs of nodes, the first below the second, rising: elements with such a pair are not
    /// held apart.
    excused: Vec<[u32; 2]>,
}

impl Rules {
    /// Rules among patches at rest.
    ///
    /// - `index_of`: the part of each patch of the cloth, if it has one
    pub(crate) fn new(
        mask: PairMask,
        patches: &[&ContactPatch],
        parts: &[Part],
        rest: &[Point3<f32>],
        index_of: &[Option<usize>],
    ) -> Self {
        let mut rules = Self::default();
        if mask == PairMask::None {
            return rules;
        }
        let mut owner = vec![0_usize; rest.len()];
        let mut triangles = Vec::new();
        for (index, part) in parts.iter().enumerate() {
            owner[part.first as usize..(part.first + part.count) as usize].fill(index);
            triangles.extend(part.triangles());
        }
        let edges = triangle_edges(&triangles);
        let mut crossed = Vec::new();
        for c in crossings(rest, &edges, &triangles, |_, _| true) {
            let (edge, triangle) = (edges[c.edge as usize], triangles[c.triangle as usize]);
            let (a, b) = (owner[edge[0] as usize], owner[triangle[0] as usize]);
            crossed.push([a.min(b), a.max(b)]);
            if a == b {
                rules.excuse(&parts[a], &edge, &triangle);
            }
        }
        crossed.sort_unstable();
        rules.excused.sort_unstable();
        rules.excused.dedup();
        let is_attached = |a: usize, b: usize| {
            patches[a]
                .attached_to
                .iter()
                .any(|&p| index_of[p] == Some(b))
                || patches[b]
                    .attached_to
                    .iter()
                    .any(|&p| index_of[p] == Some(a))
        };
        for a in 0..parts.len() {
            for b in a..parts.len() {
                let allowed = if a == b {
                    mask == PairMask::All || patches[a].is_ring
                } else {
                    mask == PairMask::All
                        && !is_attached(a, b)
                        && crossed.binary_search(&[a, b]).is_err()
                };
                if allowed {
                    rules.parts.push([a, b]);
                }
            }
        }
        rules
    }

    /// Excuses the neighbours of two elements from each other.
    fn excuse(&mut self, part: &Part, edge: &[u32], triangle: &[u32]) {
        let around = |nodes: &[u32]| -> Vec<u32> {
            (part.first..part.first + part.count)
                .filter(|&n| nodes.iter().any(|&m| part.are_neighbours(m, n)))
                .collect()
        };
        for &a in &around(edge) {
            for &b in &around(triangle) {
                if a != b {
                    self.excused.push([a.min(b), a.max(b)]);
                }
            }
        }
    }

    /// How two elements of one part stand to each other.
    #[inline]
    pub(crate) fn side(&self, part: &Part, first: &[u32], second: &[u32]) -> Side {
        let pairs = || {
            first
                .iter()
                .flat_map(|&a| second.iter().map(move |&b| (a, b)))
        };
        if pairs().any(|(a, b)| part.are_neighbours(a, b)) {
            return Side::Neighbours;
        }
        let is_excused =
            |(a, b): (u32, u32)| self.excused.binary_search(&[a.min(b), a.max(b)]).is_ok();
        if !self.excused.is_empty() && pairs().any(is_excused) {
            return Side::Excused;
        }
        Side::Apart
    }
}
