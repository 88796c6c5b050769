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
            affines: vec![Numbers::default(); count],
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
            rest[0] = mandible.into();
            self.last_mandible = mandible;
        }
        by_patch
            .into_par_iter()
            .for_each(|(frames, now, last, affines)| {
                frames.for_each_affine(now, |node, affine| affines[node] = affine.into());
                last.copy_from_slice(now);
            });
        let deformer = &*self;
        let chunks = out.par_chunks_mut(CHUNK).enumerate();
        let arch = pulp::Arch::new();
        chunks
            .map(|(chunk, out)| {
                arch.dispatch(MoveVertices {
                    deformer,
                    binding,
                    moved,
                    first: chunk * CHUNK,
                    out,
                })
            })
            .sum()
    }
}

/// Vertices that are moved one after another.
const CHUNK: usize = 256;

/// Moves some vertices, by vector instructions.
struct MoveVertices<'a> {
    deformer: &'a SkinDeformer,
    binding: &'a SkinBinding,
    /// As in [`SkinDeformer::deform_where`].
    moved: u64,
    /// The first of them.
    first: usize,
    out: &'a mut [Point3<f32>],
}

impl pulp::WithSimd for MoveVertices<'_> {
    /// How many were moved.
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> usize {
        let SkinDeformer {
            affines,
            movers,
            rest,
            ..
        } = self.deformer;
        let mut count = 0;
        for (vertex, out) in (self.first..).zip(self.out) {
            if self.moved != u64::MAX && movers[vertex] & self.moved == 0 {
                continue;
            }
            // Maps are summed as numbers, so that one is applied a vertex, not one a node. A product
            // and a sum, never both at once: the bits are the same for all instructions.
            let registers = NUMBERS / S::F32_LANES;
            let mut sum = [simd.splat_f32s(0.0); NUMBERS];
            for (node, weight) in self.binding.row(vertex) {
                let (affine, _) = S::as_simd_f32s(&affines[node as usize].0);
                let weight = simd.splat_f32s(weight);
                for k in 0..registers {
                    sum[k] = simd.add_f32s(sum[k], simd.mul_f32s(affine[k], weight));
                }
            }
            let mut numbers = Numbers::default();
            let sum: &[f32] = bytemuck::cast_slice(&sum[..registers]);
            numbers.0.copy_from_slice(sum);
            *out = rest[vertex] + numbers.displacement(&rest[vertex]);
            count += 1;
        }
        count
    }
}

/// Numbers of a [`NodeAffine`], and as many more as fill registers of any width.
const NUMBERS: usize = 16;

/// A [`NodeAffine`]: its turn column by column, then its shift. Each lies in a line of the cache.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(64))]
struct Numbers([f32; NUMBERS]);

impl From<NodeAffine> for Numbers {
    fn from(affine: NodeAffine) -> Self {
        let mut numbers = Self::default();
        numbers.0[..9].copy_from_slice(affine.turn.as_slice());
        numbers.0[9..12].copy_from_slice(affine.shift.as_slice());
        numbers
    }
}

impl Numbers {
    /// The displacement that it gives a point. (mm)
    #[inline(always)]
    fn displacement(&self, at: &Point3<f32>) -> Vector3<f32> {
        let ([x, y, z], n) = ([at.x, at.y, at.z], &self.0);
        let axis = |k: usize| n[k] * x + n[3 + k] * y + n[6 + k] * z + n[9 + k];
        Vector3::new(axis(0), axis(1), axis(2))
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::WithSimd;

    #[test]
    fn bits_are_those_of_one_number_after_another() {
        let grid = GridShape {
            u_count: 9,
            v_count: 7,
            is_periodic: false,
        };
        let wave = |k: usize| ((k * k) as f32 * 0.37).sin();
        let nodes: Vec<Point3<f32>> = (0..grid.node_count())
            .map(|i| Point3::new((i % 9) as f32, (i / 9) as f32, wave(i)))
            .collect();
        let now: Vec<Point3<f32>> = (nodes.iter().enumerate())
            .map(|(i, p)| p + Vector3::new(wave(3 * i), wave(5 * i), wave(7 * i)))
            .collect();
        let vertex_count = 2 * CHUNK + 5;
        let row = |v: usize| (0..1 + v % 13).map(move |k| ((v + 5 * k) % 64) as u32);
        let entries: Vec<u32> = (0..vertex_count).flat_map(row).collect();
        let mut starts = vec![0];
        for v in 0..vertex_count {
            starts.push(starts[v] + row(v).count() as u32);
        }
        let binding = SkinBinding {
            node_counts: vec![63],
            starts,
            weights: (0..entries.len()).map(|k| 0.1 + 0.08 * wave(k)).collect(),
            nodes: entries,
        };
        let rest: Vec<Point3<f32>> = (0..vertex_count)
            .map(|v| Point3::new(wave(v), wave(v + 9), 2.0))
            .collect();
        let patches = vec![(grid, nodes)];
        let mut deformer = SkinDeformer::new(&binding, patches, rest.clone()).unwrap();
        let mut out = rest.clone();
        let mandible = NodeAffine {
            shift: Vector3::new(0.0, -3.0, 1.0),
            ..NodeAffine::identity()
        };
        deformer
            .deform(&binding, &[now], mandible, &mut out)
            .unwrap();
        let mut scalar = rest.clone();
        let count = MoveVertices {
            deformer: &deformer,
            binding: &binding,
            moved: u64::MAX,
            first: 0,
            out: &mut scalar,
        }
        .with_simd(pulp::Scalar);
        assert_eq!(count, vertex_count);
        assert_eq!(out, scalar);
        // And what the documentation of the module says.
        for (v, (out, rest)) in out.iter().zip(&rest).enumerate() {
            let sum = binding
                .row(v)
                .fold(Vector3::zeros(), |sum, (node, weight)| {
                    sum + deformer.affines[node as usize].displacement(rest) * weight
                });
            assert!((out - rest - sum).norm() < 1e-4, "{v}: {out} {sum}");
        }
    }
}
