//! The turn of a grid at each of its nodes.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::anatomy::GridShape;
use crate::machine::{F32x8, Real, Vec3, vectorized};

/// What a node does to the space around it: `x -> x + turn x + shift`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeAffine {
    /// R - I.
    pub turn: Matrix3<f32>,
    /// (q' - q) - (R - I) q. (mm)
    pub shift: Vector3<f32>,
}

impl NodeAffine {
    /// Nothing moves.
    pub fn identity() -> Self {
        Self {
            turn: Matrix3::zeros(),
            shift: Vector3::zeros(),
        }
    }

    /// The displacement it gives a point. (mm)
    pub fn displacement(&self, at: &Point3<f32>) -> Vector3<f32> {
        self.turn * at.coords + self.shift
    }
}

/// How many nodes away the turn of a node that folds is looked for: across a fold, which is
/// about as wide as twice that.
const ACROSS_FOLDS: usize = 3;

/// Nodes of a row that are looked at beside each other.
const LANES: usize = F32x8::LANES;

/// Edges of this length or less have no direction. (mm)
const SHORTEST: f64 = f32::EPSILON as f64;
/// Nor do sums of two unit vectors.
const LEAST_BISECTOR: f64 = 1e-3;

/// Columns of a rotation.
type Frame = [Vec3<F32x8>; 3];

/// Rest frames of one patch.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeFrames {
    grid: GridShape,
    rest: Vec<Point3<f32>>,
    /// Row after row, each in as many registers as it fills.
    blocks: Vec<Block>,
}

/// What is known at rest of nodes that lie beside each other in a row.
#[derive(Debug, Clone, PartialEq)]
struct Block {
    /// (mm)
    rest: Vec3<F32x8>,
    frame: Frame,
    /// 1 for nodes that look for their turn across folds, else 0; none where no node does.
    folds: Option<F32x8>,
}

impl NodeFrames {
    /// Takes a patch at rest. (mm)
    pub fn new(grid: GridShape, rest: Vec<Point3<f32>>) -> Self {
        let mut frames = Self {
            blocks: Vec::new(),
            grid,
            rest,
        };
        frames.look_at_rest(&[]);
        frames
    }

    /// The same, for a patch that folds at some nodes. Skin over a fold goes up and down with it
    /// and does not turn with its flanks: it lies further out than a fold is wide, and would
    /// be pushed through itself.
    ///
    /// - `is_folding`: one per node
    pub fn turning_across(mut self, is_folding: &[bool]) -> Self {
        self.look_at_rest(is_folding);
        self
    }

    /// Takes frames of all nodes at rest.
    fn look_at_rest(&mut self, is_folding: &[bool]) {
        let rows = Rows::new(self.grid, &self.rest);
        let blocks = rows.blocks().map(|(v, u)| {
            let mut folds = [0.0; LANES];
            let is_folding = is_folding.iter().skip(v * rows.count + u);
            for (fold, _) in folds.iter_mut().zip(is_folding).filter(|(_, is)| **is) {
                *fold = 1.0;
            }
            let folds = (folds != [0.0; LANES]).then_some(F32x8(folds));
            Block {
                rest: rows.at(v, PAD + u),
                frame: rows.frame(v, u, folds),
                folds,
            }
        });
        self.blocks = blocks.collect();
    }

    /// The patch at rest. (mm)
    pub fn rest(&self) -> &[Point3<f32>] {
        &self.rest
    }

    /// What each node does, given where the nodes are now (same length). (mm)
    ///
    /// A patch that stands at rest gives exactly zero.
    pub fn affines(&self, now: &[Point3<f32>], out: &mut [NodeAffine]) {
        self.for_each_affine(now, |node, affine| out[node] = affine);
    }

    /// As [`Self::affines`], node by node.
    pub(super) fn for_each_affine(&self, now: &[Point3<f32>], put: impl FnMut(usize, NodeAffine)) {
        vectorized(TakeAffines {
            frames: self,
            now,
            put,
        });
    }
}

struct TakeAffines<'a, P> {
    frames: &'a NodeFrames,
    now: &'a [Point3<f32>],
    put: P,
}

impl<P: FnMut(usize, NodeAffine)> pulp::NullaryFnOnce for TakeAffines<'_, P> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let rows = Rows::new(self.frames.grid, self.now);
        for ((v, u), block) in rows.blocks().zip(&self.frames.blocks) {
            let frame = rows.frame(v, u, block.folds);
            let affines = affines(block, &frame, rows.at(v, PAD + u));
            let first = v * rows.count + u;
            for lane in 0..LANES.min(rows.count - u) {
                let number = |k: usize| affines[k].0[lane];
                let affine = NodeAffine {
                    turn: Matrix3::from_fn(|row, column| number(3 * column + row)),
                    shift: Vector3::from_fn(|row, _| number(9 + row)),
                };
                (self.put)(first + lane, affine);
            }
        }
    }
}

/// Turns column by column, then shifts: from rest to a frame and to where nodes are.
#[inline(always)]
fn affines(block: &Block, frame: &Frame, now: Vec3<F32x8>) -> [F32x8; 12] {
    let (zero, one) = (F32x8::splat(0.0), F32x8::splat(1.0));
    let columns = |f: &Frame| f.map(|c| [c.x, c.y, c.z]);
    let (then, frame) = (columns(&block.frame), columns(frame));
    // Equal bits must give no turn at all: F F^T is only nearly one.
    let mut difference = zero;
    let mut turn = [[zero; 3]; 3];
    for k in 0..3 {
        for i in 0..3 {
            let d = frame[k][i] - then[k][i];
            difference += d * d;
            for j in 0..3 {
                turn[j][i] += frame[k][i] * then[k][j];
            }
        }
    }
    let rest = [block.rest.x, block.rest.y, block.rest.z];
    let mut shift = [now.x - rest[0], now.y - rest[1], now.z - rest[2]];
    for j in 0..3 {
        turn[j][j] -= one;
        for i in 0..3 {
            turn[j][i] = Real::select_less(zero, difference, turn[j][i], zero);
            shift[i] -= turn[j][i] * rest[j];
        }
    }
    let [[a, b, c], [d, e, f], [g, h, i]] = turn;
    let [x, y, z] = shift;
    [a, b, c, d, e, f, g, h, i, x, y, z]
}

/// What rows have before their first node, so that each finds neighbours on both sides.
const PAD: usize = ACROSS_FOLDS;

/// Nodes of a grid as rows of numbers. Where a grid ends its last node stands for what is beyond;
/// where it closes it goes on.
struct Rows {
    /// Nodes of a row, and rows.
    count: usize,
    row_count: usize,
    /// Numbers of a row.
    stride: usize,
    axes: [Vec<f32>; 3],
}

impl Rows {
    #[inline(always)]
    fn new(grid: GridShape, nodes: &[Point3<f32>]) -> Self {
        let (count, row_count) = (grid.u_count as usize, grid.v_count as usize);
        let stride = PAD + count.next_multiple_of(LANES) + PAD;
        let mut axes = [(); 3].map(|()| vec![0.0; stride * row_count]);
        for (v, nodes) in nodes.chunks_exact(count.max(1)).enumerate() {
            let row = v * stride;
            for (u, node) in nodes.iter().enumerate() {
                for (axis, x) in axes.iter_mut().zip(node.iter()) {
                    axis[row + PAD + u] = *x;
                }
            }
            for k in 1..=PAD {
                let (before, after) = if grid.is_periodic {
                    (count - 1 - (k - 1) % count, (k - 1) % count)
                } else {
                    (0, count - 1)
                };
                for axis in &mut axes {
                    axis[row + PAD - k] = axis[row + PAD + before];
                    axis[row + PAD + count - 1 + k] = axis[row + PAD + after];
                }
            }
        }
        Self {
            count,
            row_count,
            stride,
            axes,
        }
    }

    /// Rows, and in each the first of every [`LANES`] nodes.
    fn blocks(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (rows, count) = (self.row_count, self.count);
        (0..rows).flat_map(move |v| (0..count).step_by(LANES).map(move |u| (v, u)))
    }

    /// Numbers of a row, from one on.
    #[inline(always)]
    fn at(&self, v: usize, from: usize) -> Vec3<F32x8> {
        let axis = |k: usize| {
            let numbers = &self.axes[k][v * self.stride + from..][..LANES];
            let mut lanes = [0.0; LANES];
            lanes.copy_from_slice(numbers);
            F32x8(lanes)
        };
        Vec3::new(axis(0), axis(1), axis(2))
    }

    /// Orthonormal frames of nodes. The first two axes bisect the grid directions, so that
    /// neither u nor v is preferred under shear. Identity where the grid is degenerate.
    ///
    /// - `folds`: as of [`Block`]
    #[inline(always)]
    fn frame(&self, v: usize, u: usize, folds: Option<F32x8>) -> Frame {
        let ways = |reach: usize| {
            let along_u = self.at(v, PAD + u + reach) - self.at(v, PAD + u - reach);
            let (after, before) = ((v + reach).min(self.row_count - 1), v.saturating_sub(reach));
            let along_v = self.at(after, PAD + u) - self.at(before, PAD + u);
            [along_u, along_v]
        };
        let [mut along_u, mut along_v] = ways(1);
        if let Some(folds) = folds {
            let [across_u, across_v] = ways(ACROSS_FOLDS);
            along_u = where_set(folds, across_u, along_u);
            along_v = where_set(folds, across_v, along_v);
        }
        let (a, has_u) = direction(along_u, SHORTEST);
        let (b, has_v) = direction(along_v, SHORTEST);
        let (first, has_first) = direction(a + b, LEAST_BISECTOR);
        let (second, has_second) = direction(b - a, LEAST_BISECTOR);
        let is_whole = has_u * has_v * has_first * has_second;
        let unit = |axis: [f64; 3]| Vec3::splat(axis);
        [
            where_set(is_whole, first, unit([1.0, 0.0, 0.0])),
            where_set(is_whole, second, unit([0.0, 1.0, 0.0])),
            where_set(is_whole, first.cross(second), unit([0.0, 0.0, 1.0])),
        ]
    }
}

/// A unit vector, and 1 where there is one: where `v` is longer than `least`; else 0.
#[inline(always)]
fn direction(v: Vec3<F32x8>, least: f64) -> (Vec3<F32x8>, F32x8) {
    let (zero, one) = (F32x8::splat(0.0), F32x8::splat(1.0));
    let length = v.dot(v).sqrt();
    let has_one = Real::select_less(F32x8::splat(least), length, one, zero);
    (v * (one / length.max(F32x8::splat(least))), has_one)
}

/// `yes` in lanes where `is` is 1, `no` where it is 0.
#[inline(always)]
fn where_set(is: F32x8, yes: Vec3<F32x8>, no: Vec3<F32x8>) -> Vec3<F32x8> {
    let half = F32x8::splat(0.5);
    let pick = |yes, no| Real::select_less(half, is, yes, no);
    Vec3::new(pick(yes.x, no.x), pick(yes.y, no.y), pick(yes.z, no.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent_grid() -> (GridShape, Vec<Point3<f32>>) {
        let grid = GridShape {
            u_count: 6,
            v_count: 5,
            is_periodic: false,
        };
        let nodes = (0..grid.node_count())
            .map(|i| {
                let (u, v) = ((i % 6) as f32, (i / 6) as f32);
                Point3::new(
                    2.0 * u + 0.3 * v,
                    1.7 * v,
                    0.1 * u * u - 0.05 * u * v + 40.0,
                )
            })
            .collect();
        (grid, nodes)
    }

    #[test]
    fn a_rigid_motion_is_followed_exactly() {
        let (grid, rest) = bent_grid();
        let motion =
            nalgebra::Isometry3::new(Vector3::new(3.0, -2.0, 5.0), Vector3::new(0.2, -0.4, 0.3));
        let now: Vec<_> = rest.iter().map(|p| motion * p).collect();
        let frames = NodeFrames::new(grid, rest.clone());
        let mut affines = vec![NodeAffine::identity(); rest.len()];
        frames.affines(&now, &mut affines);
        let above = Point3::new(4.0f32, 3.0, 47.0);
        for affine in &affines {
            let moved = above + affine.displacement(&above);
            assert!((moved - motion * above).norm() < 1e-3);
        }
    }

    #[test]
    fn folds_turn_nothing_where_frames_look_across_them() {
        let grid = GridShape {
            u_count: 13,
            v_count: 9,
            is_periodic: false,
        };
        let nodes = |depth: f32| -> Vec<Point3<f32>> {
            (0..grid.node_count())
                .map(|i| {
                    let (u, v) = ((i % 13) as f32, (i / 13) as f32);
                    let fold = (u * std::f32::consts::TAU / 6.0).sin();
                    Point3::new(2.0 * u, 2.0 * v, depth * fold)
                })
                .collect()
        };
        let most_turn = |frames: &NodeFrames| {
            let mut affines = vec![NodeAffine::identity(); grid.node_count()];
            frames.affines(&nodes(1.0), &mut affines);
            let inner = (3..10).map(|u| affines[4 * 13 + u].turn.norm());
            inner.fold(0.0f32, f32::max)
        };
        let near = NodeFrames::new(grid, nodes(0.0));
        assert!(most_turn(&near) > 0.5);
        let across = near.turning_across(&[true; 117]);
        assert!(most_turn(&across) < 1e-5);
    }

    #[test]
    fn rest_moves_nothing_bit_for_bit() {
        let (grid, rest) = bent_grid();
        let frames = NodeFrames::new(grid, rest.clone()).turning_across(&[true; 30]);
        let mut affines = vec![NodeAffine::identity(); rest.len()];
        frames.affines(&rest, &mut affines);
        for affine in affines {
            assert_eq!(
                affine.displacement(&Point3::new(1.0, 2.0, 3.0)),
                Vector3::zeros()
            );
        }
    }

    #[test]
    fn a_collapsed_grid_does_not_turn() {
        let (grid, rest) = bent_grid();
        let frames = NodeFrames::new(grid, vec![rest[0]; rest.len()]);
        let mut affines = vec![NodeAffine::identity(); rest.len()];
        frames.affines(&vec![rest[3]; rest.len()], &mut affines);
        assert_eq!(affines[7].turn, Matrix3::zeros());
    }
}
