//! Moving the skin.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::anatomy::GridShape;
use crate::skin::{NodeAffine, NodeFrames, SkinBinding, SkinError};

/// A bound skin, ready to be moved frame after frame.
#[derive(Debug, Clone)]
pub struct SkinDeformer {
    frames: Vec<NodeFrames>,
    /// What each node does, patch after patch, then the mandible.
    affines: Vec<Numbers>,
    rest: Vec<Point3<f32>>,
    /// What moves each vertex: a bit per patch, [`MANDIBLE`] and [`ALWAYS`].
    movers: Vec<u64>,
    /// Nodes of each patch, and what the mandible did, when the skin was last moved by them.
    last: Vec<Vec<Point3<f32>>>,
    last_mandible: NodeAffine,
    /// Corners of a box around what the mandible moves. (mm)
    jaw: [Point3<f32>; 8],
}

/// Bits of [`SkinDeformer::movers`] beyond the patches.
const MANDIBLE: u64 = 1 << 63;
const ALWAYS: u64 = 1 << 62;

/// The bit of a patch. Those beyond the bits that there are move their vertices always.
fn bit(patch: usize) -> u64 {
    if patch < 62 { 1 << patch } else { ALWAYS }
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
        let movers = movers(binding);
        let on_jaw = rest
            .iter()
            .zip(&movers)
            .filter(|(_, m)| **m & MANDIBLE != 0);
        Ok(Self {
            jaw: corners(on_jaw.map(|(vertex, _)| vertex)),
            movers,
            last: patches.iter().map(|(_, nodes)| nodes.clone()).collect(),
            last_mandible: NodeAffine::identity(),
            frames: patches
                .into_iter()
                .map(|(grid, nodes)| NodeFrames::new(grid, nodes))
                .collect(),
            affines: vec![[0.0; 12]; count],
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

    /// Says of vertices that they are moved by more than the patches: they are never left out.
    pub fn move_always(&mut self, vertices: &[u32]) {
        for &vertex in vertices {
            self.movers[vertex as usize] |= ALWAYS;
        }
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
        self.check(nodes, out)?;
        self.deform_where(binding, nodes, mandible, u64::MAX, out);
        Ok(())
    }

    /// As [`Self::deform`], where `out` is as the last call left it: patches of which no node has
    /// gone further than `slack` since they last moved the skin are as they were then, and
    /// vertices that nothing else moves stay. With a slack of 0 the bits are those of
    /// [`Self::deform`]. Returns how many vertices were moved.
    ///
    /// - `may_have_moved`: patches of which it says no are not looked at
    /// - `slack`: (mm)
    ///
    /// # Errors
    ///
    /// As [`Self::deform`].
    pub fn deform_again<N: AsRef<[Point3<f32>]> + Sync>(
        &mut self,
        binding: &SkinBinding,
        nodes: &[N],
        mandible: NodeAffine,
        may_have_moved: impl Fn(usize) -> bool,
        slack: f32,
        out: &mut [Point3<f32>],
    ) -> Result<usize, SkinError> {
        self.check(nodes, out)?;
        let limit = slack * slack;
        let mut moved = ALWAYS;
        for (patch, (now, last)) in nodes.iter().zip(&self.last).enumerate() {
            let mut ways = now.as_ref().iter().zip(last);
            if may_have_moved(patch) && ways.any(|(p, q)| (p - q).norm_squared() > limit) {
                moved |= bit(patch);
            }
        }
        // Between the corners of a box an affine map goes no further than at one of them.
        let before = &self.last_mandible;
        let way = |at: &Point3<f32>| mandible.displacement(at) - before.displacement(at);
        if self.jaw.iter().any(|at| way(at).norm_squared() > limit) {
            moved |= MANDIBLE;
        }
        Ok(self.deform_where(binding, nodes, mandible, moved, out))
    }

    fn check<N: AsRef<[Point3<f32>]>>(
        &self,
        nodes: &[N],
        out: &[Point3<f32>],
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
        for (patch, (frames, now)) in self.frames.iter().zip(nodes).enumerate() {
            let (expected, found) = (frames.rest().len(), now.as_ref().len());
            if expected != found {
                return Err(SkinError::NodeCount {
                    patch,
                    expected,
                    found,
                });
            }
        }
        Ok(())
    }

    /// Takes up the patches of `moved`, and moves the vertices that they move.
    fn deform_where<N: AsRef<[Point3<f32>]> + Sync>(
        &mut self,
        binding: &SkinBinding,
        nodes: &[N],
        mandible: NodeAffine,
        moved: u64,
        out: &mut [Point3<f32>],
    ) -> usize {
        let mut rest = &mut self.affines[..];
        let mut by_patch = Vec::with_capacity(nodes.len());
        let lasts = self.last.iter_mut();
        for (patch, ((frames, now), last)) in self.frames.iter().zip(nodes).zip(lasts).enumerate() {
            let (own, others) = rest.split_at_mut(last.len());
            if moved & bit(patch) != 0 {
                by_patch.push((frames, now.as_ref(), last, own));
            }
            rest = others;
        }
        if moved & MANDIBLE != 0 {
            rest[0] = numbers(&mandible);
            self.last_mandible = mandible;
        }
        by_patch
            .into_par_iter()
            .for_each(|(frames, now, last, affines)| {
                for (node, out) in affines.iter_mut().enumerate() {
                    *out = numbers(&frames.affine(now, node));
                }
                last.copy_from_slice(now);
            });
        let (affines, movers) = (&self.affines, &self.movers);
        out.par_iter_mut()
            .zip(&self.rest)
            .enumerate()
            .with_min_len(256)
            .filter(|(vertex, _)| moved == u64::MAX || movers[*vertex] & moved != 0)
            .map(|(vertex, (out, rest))| {
                // Maps are summed as numbers, so that one is applied a vertex, not one a node.
                let mut sum = [0.0; 12];
                for (node, weight) in binding.row(vertex) {
                    let affine = &affines[node as usize];
                    for k in 0..12 {
                        sum[k] += affine[k] * weight;
                    }
                }
                *out = rest + displacement(&sum, rest);
            })
            .count()
    }
}

/// Numbers of a [`NodeAffine`]: its turn column by column, then its shift.
type Numbers = [f32; 12];

fn numbers(affine: &NodeAffine) -> Numbers {
    let (turn, shift) = (affine.turn.as_slice(), affine.shift.as_slice());
    std::array::from_fn(|k| if k < 9 { turn[k] } else { shift[k - 9] })
}

/// The displacement that it gives a point. (mm)
///
/// Not inlined: the sum that it takes is then built in its own order, four numbers at a time.
#[inline(never)]
fn displacement(affine: &Numbers, at: &Point3<f32>) -> Vector3<f32> {
    let [x, y, z] = [at.x, at.y, at.z];
    let axis = |k: usize| affine[k] * x + affine[3 + k] * y + affine[6 + k] * z + affine[9 + k];
    Vector3::new(axis(0), axis(1), axis(2))
}

/// What moves each vertex.
fn movers(binding: &SkinBinding) -> Vec<u64> {
    let mut ends = Vec::with_capacity(binding.node_counts.len());
    let mut end = 0;
    for &count in &binding.node_counts {
        end += count;
        ends.push(end);
    }
    let mover = |node: u32| match ends.partition_point(|&end| end <= node) {
        patch if patch == ends.len() => MANDIBLE,
        patch => bit(patch),
    };
    (0..binding.vertex_count())
        .map(|vertex| {
            let row = binding.row(vertex);
            row.fold(0, |bits, (node, _)| bits | mover(node))
        })
        .collect()
}

/// Corners of the box around points; the origin where there are none. (mm)
fn corners<'a>(points: impl Iterator<Item = &'a Point3<f32>>) -> [Point3<f32>; 8] {
    let bounds = points.fold(None, |bounds, p| match bounds {
        None => Some((*p, *p)),
        Some((low, high)) => Some((low.inf(p), high.sup(p))),
    });
    let (low, high) = bounds.unwrap_or((Point3::origin(), Point3::origin()));
    std::array::from_fn(|corner| {
        Point3::from(Vector3::from_fn(|axis, _| match corner >> axis & 1 {
            0 => low[axis],
            _ => high[axis],
        }))
    })
}
