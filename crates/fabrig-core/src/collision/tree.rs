//! The broad phase: a hierarchy of boxes over the cells of a part, refitted in O(n).
//!
//! For a grid the hierarchy is the quadtree that the grid implies, so it is never rebuilt; for
//! the mesh of a collider it is made once by halving the longest extent.

use nalgebra::Point3;

use super::mesh::Cell;
use crate::Vector;

#[derive(Debug, Clone, Copy)]
struct Node {
    low: [f32; 3],
    high: [f32; 3],
    /// Children, or for a leaf the cell and `u32::MAX`.
    children: [u32; 2],
}

/// Boxes over cells; parents stand before their children.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
}

const LEAF: u32 = u32::MAX;

impl Tree {
    /// The quadtree of `columns` x `rows` cells, cell (u, v) at `v * columns + u`.
    pub(crate) fn of_grid(columns: usize, rows: usize) -> Self {
        let mut tree = Self::default();
        if columns * rows > 0 {
            tree.split_grid([0, columns], [0, rows], columns);
        }
        tree
    }

    /// A hierarchy over cells with these centres.
    pub(crate) fn of_centers(centers: &[Vector]) -> Self {
        let mut tree = Self::default();
        let mut cells: Vec<u32> = (0..centers.len() as u32).collect();
        if !cells.is_empty() {
            tree.split_centers(&mut cells, centers);
        }
        tree
    }

    fn push(&mut self, children: [u32; 2]) -> usize {
        self.nodes.push(Node {
            low: [f32::MAX; 3],
            high: [f32::MIN; 3],
            children,
        });
        self.nodes.len() - 1
    }

    fn split_grid(&mut self, u: [usize; 2], v: [usize; 2], columns: usize) -> u32 {
        let (width, height) = (u[1] - u[0], v[1] - v[0]);
        if width == 1 && height == 1 {
            return self.push([(v[0] * columns + u[0]) as u32, LEAF]) as u32;
        }
        let index = self.push([0, 0]);
        let (a, b) = if width >= height {
            let middle = u[0] + width / 2;
            (
                self.split_grid([u[0], middle], v, columns),
                self.split_grid([middle, u[1]], v, columns),
            )
        } else {
            let middle = v[0] + height / 2;
            (
                self.split_grid(u, [v[0], middle], columns),
                self.split_grid(u, [middle, v[1]], columns),
            )
        };
        self.nodes[index].children = [a, b];
        index as u32
    }

    fn split_centers(&mut self, cells: &mut [u32], centers: &[Vector]) -> u32 {
        if let [cell] = cells {
            return self.push([*cell, LEAF]) as u32;
        }
        let index = self.push([0, 0]);
        let (mut low, mut high) = (Vector::repeat(f64::MAX), Vector::repeat(f64::MIN));
        for &c in cells.iter() {
            low = low.inf(&centers[c as usize]);
            high = high.sup(&centers[c as usize]);
        }
        let axis = (high - low).imax();
        cells.sort_by(|&a, &b| {
            centers[a as usize][axis]
                .total_cmp(&centers[b as usize][axis])
                .then(a.cmp(&b))
        });
        let middle = cells.len() / 2;
        let (first, second) = cells.split_at_mut(middle);
        let a = self.split_centers(first, centers);
        let b = self.split_centers(second, centers);
        self.nodes[index].children = [a, b];
        index as u32
    }

    /// Fits all boxes to the positions of the cells' nodes.
    pub(crate) fn refit(&mut self, cells: &[Cell], positions: &[Point3<f32>]) {
        for index in (0..self.nodes.len()).rev() {
            let [a, b] = self.nodes[index].children;
            let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
            if b == LEAF {
                for &node in &cells[a as usize].hull {
                    let p = &positions[node as usize];
                    for k in 0..3 {
                        low[k] = low[k].min(p[k]);
                        high[k] = high[k].max(p[k]);
                    }
                }
            } else {
                for child in [a, b] {
                    let c = self.nodes[child as usize];
                    for k in 0..3 {
                        low[k] = low[k].min(c.low[k]);
                        high[k] = high[k].max(c.high[k]);
                    }
                }
            }
            self.nodes[index].low = low;
            self.nodes[index].high = high;
        }
    }

    /// Pairs of cells of two trees whose boxes are within `reach` of each other.
    pub(crate) fn near_cells(&self, other: &Self, reach: f32, out: &mut Vec<[u32; 2]>) {
        out.clear();
        if !self.nodes.is_empty() && !other.nodes.is_empty() {
            self.descend(other, [0, 0], reach, out);
        }
    }

    /// Pairs of cells of this tree whose boxes are within `reach`, each once.
    pub(crate) fn near_own_cells(&self, reach: f32, out: &mut Vec<[u32; 2]>) {
        out.clear();
        for node in &self.nodes {
            if let [l, r] = node.children
                && r != LEAF
            {
                self.descend(self, [l, r], reach, out);
            }
        }
    }

    /// Pairs of cells under two nodes, one of each tree, whose boxes are within `reach`.
    fn descend(&self, other: &Self, start: [u32; 2], reach: f32, out: &mut Vec<[u32; 2]>) {
        let mut stack = vec![start];
        while let Some([a, b]) = stack.pop() {
            let (na, nb) = (&self.nodes[a as usize], &other.nodes[b as usize]);
            if !are_near(na, nb, reach) {
                continue;
            }
            match (na.children[1] == LEAF, nb.children[1] == LEAF) {
                (true, true) => out.push([na.children[0], nb.children[0]]),
                (true, false) => nb.children.iter().for_each(|&c| stack.push([a, c])),
                (false, true) => na.children.iter().for_each(|&c| stack.push([c, b])),
                (false, false) => {
                    if size(na) >= size(nb) {
                        na.children.iter().for_each(|&c| stack.push([c, b]));
                    } else {
                        nb.children.iter().for_each(|&c| stack.push([a, c]));
                    }
                }
            }
        }
    }

    /// The cell nearest to a point within `reach`: `measure` gives the distance of a cell, or
    /// nothing for one that does not count, and what to return with it.
    pub(crate) fn nearest_cell<T>(
        &self,
        point: &Point3<f32>,
        reach: f32,
        mut measure: impl FnMut(u32) -> Option<(f32, T)>,
    ) -> Option<(f32, T)> {
        let mut best: Option<(f32, T)> = None;
        let mut limit = reach;
        let mut stack = Vec::new();
        if let Some(root) = self.nodes.first() {
            stack.push((outside(root, point), 0_u32));
        }
        while let Some((distance, index)) = stack.pop() {
            if distance > limit {
                continue;
            }
            let [a, b] = self.nodes[index as usize].children;
            if b == LEAF {
                if let Some(found) = measure(a)
                    && (found.0 < limit || (best.is_none() && found.0 <= limit))
                {
                    limit = found.0;
                    best = Some(found);
                }
                continue;
            }
            let of = |child: u32| (outside(&self.nodes[child as usize], point), child);
            let (a, b) = (of(a), of(b));
            // The nearer one is looked at first.
            let (near, far) = if a.0 <= b.0 { (a, b) } else { (b, a) };
            stack.extend([far, near]);
        }
        best
    }
}

/// Distance from a point to a box, zero inside.
#[inline]
fn outside(n: &Node, p: &Point3<f32>) -> f32 {
    let squared: f32 = (0..3)
        .map(|k| (n.low[k] - p[k]).max(p[k] - n.high[k]).max(0.0).powi(2))
        .sum();
    squared.sqrt()
}

#[inline]
fn are_near(a: &Node, b: &Node, reach: f32) -> bool {
    (0..3).all(|k| a.low[k] - b.high[k] <= reach && b.low[k] - a.high[k] <= reach)
}

#[inline]
fn size(n: &Node) -> f32 {
    (0..3).map(|k| n.high[k] - n.low[k]).fold(0.0, f32::max)
}
