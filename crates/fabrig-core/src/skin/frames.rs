//! The turn of a grid at each of its nodes.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::anatomy::GridShape;

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
const ACROSS_FOLDS: u32 = 3;

/// Rest frames of one patch.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeFrames {
    grid: GridShape,
    rest: Vec<Point3<f32>>,
    frames: Vec<Matrix3<f32>>,
    /// How many nodes away each node looks for its turn; empty where all look at the next.
    reaches: Vec<u32>,
}

impl NodeFrames {
    /// Takes a patch at rest. (mm)
    pub fn new(grid: GridShape, rest: Vec<Point3<f32>>) -> Self {
        let frames = (0..rest.len()).map(|i| frame(grid, &rest, i, 1)).collect();
        Self {
            grid,
            rest,
            frames,
            reaches: Vec::new(),
        }
    }

    /// The same, for a patch that folds at some nodes. Skin over a fold goes up and down with it
    /// and does not turn with its flanks: it lies further out than a fold is wide, and would
    /// be pushed through itself.
    ///
    /// - `is_folding`: one per node
    pub fn turning_across(mut self, is_folding: &[bool]) -> Self {
        let reach = |&folds: &bool| if folds { ACROSS_FOLDS } else { 1 };
        self.reaches = is_folding.iter().map(reach).collect();
        self.frames = (0..self.rest.len())
            .map(|i| frame(self.grid, &self.rest, i, self.reach(i)))
            .collect();
        self
    }

    fn reach(&self, node: usize) -> u32 {
        self.reaches.get(node).copied().unwrap_or(1)
    }

    /// The patch at rest. (mm)
    pub fn rest(&self) -> &[Point3<f32>] {
        &self.rest
    }

    /// What each node does, given where the nodes are now (same length). (mm)
    ///
    /// A patch that stands at rest gives exactly zero.
    pub fn affines(&self, now: &[Point3<f32>], out: &mut [NodeAffine]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.affine(now, i);
        }
    }

    /// What one node does, as [`Self::affines`]. (mm)
    ///
    /// # Panics
    ///
    /// If there is no such node.
    #[inline(always)]
    pub fn affine(&self, now: &[Point3<f32>], node: usize) -> NodeAffine {
        let frame_now = frame(self.grid, now, node, self.reach(node));
        // Equal bits must give no turn at all: F F^T is only nearly one.
        let turn = if frame_now == self.frames[node] {
            Matrix3::zeros()
        } else {
            frame_now * self.frames[node].transpose() - Matrix3::identity()
        };
        let rest = self.rest[node].coords;
        NodeAffine {
            turn,
            shift: (now[node].coords - rest) - turn * rest,
        }
    }
}

/// Orthonormal frame of a grid at a node. The first two axes bisect the grid directions, so
/// that neither u nor v is preferred under shear. Identity where the grid is degenerate.
///
/// - `reach`: how many nodes away the grid directions are taken from
fn frame(grid: GridShape, nodes: &[Point3<f32>], node: usize, reach: u32) -> Matrix3<f32> {
    let (u, v) = (
        node as u32 % grid.u_count.max(1),
        node as u32 / grid.u_count.max(1),
    );
    let at = |u: u32, v: u32| nodes[grid.index(u, v)];
    let along_u = if grid.is_periodic {
        let next = (u + reach) % grid.u_count;
        let previous = (u + grid.u_count - reach % grid.u_count) % grid.u_count;
        at(next, v) - at(previous, v)
    } else {
        at((u + reach).min(grid.u_count - 1), v) - at(u.saturating_sub(reach), v)
    };
    let along_v = at(u, (v + reach).min(grid.v_count - 1)) - at(u, v.saturating_sub(reach));
    let bisected = || {
        let (a, b) = (
            along_u.try_normalize(f32::EPSILON)?,
            along_v.try_normalize(f32::EPSILON)?,
        );
        let first = (a + b).try_normalize(1e-3)?;
        let second = (b - a).try_normalize(1e-3)?;
        Some(Matrix3::from_columns(&[
            first,
            second,
            first.cross(&second),
        ]))
    };
    bisected().unwrap_or_else(Matrix3::identity)
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
