//! A hierarchy of boxes over cells, made once by halving the longest extent and refitted in
//! O(n).

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

    /// Cells under the highest nodes that have no more than `most` of them.
    pub(crate) fn clusters(&self, most: usize) -> Vec<Vec<u32>> {
        let mut cells: Vec<Vec<u32>> = vec![Vec::new(); self.nodes.len()];
        let mut is_whole = vec![false; self.nodes.len()];
        // Children stand after their parents.
        for index in (0..self.nodes.len()).rev() {
            let [a, b] = self.nodes[index].children;
            if b == LEAF {
                cells[index] = vec![a];
                is_whole[index] = true;
                continue;
            }
            let [a, b] = [a as usize, b as usize];
            if is_whole[a] && is_whole[b] && cells[a].len() + cells[b].len() <= most {
                let mut own = std::mem::take(&mut cells[a]);
                own.append(&mut cells[b]);
                cells[index] = own;
                is_whole[index] = true;
            }
        }
        cells.retain(|c| !c.is_empty());
        cells
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
