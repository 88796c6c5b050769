//! The edges, diagonals, triples and cells of a grid, listed in the fixed orders in which
//! constraints are projected. Neighbours in a list share no node (but at the seam of a periodic
//! grid with an odd number of columns), so their arithmetic overlaps.
//!
//! Large grids are listed strip by strip, so that a sweep can project all kinds of constraints in
//! one strip before it goes to the next, and finds the nodes in the second cache.

use std::ops::Range;

use crate::anatomy::GridShape;

/// Grids of at most this many nodes are one strip.
const WHOLE: u32 = 800;

/// Nodes of a strip of a larger grid: what a sweep reads of so many in eight lanes fits into half
/// a megabyte.
const STRIP: u32 = 440;

/// Rows of a strip, at least.
const ROWS: u32 = 6;

/// Node indices of everything that constraints act on.
#[derive(Debug, Clone)]
pub(crate) struct GridLists {
    /// In each strip edges along u: row by row, even columns and then odd ones; then edges along
    /// v: even rows and then odd ones.
    pub(crate) edges: Vec<[u32; 2]>,
    /// Both diagonals of every cell, row by row: first (u, v)-(u+1, v+1) of all the row, then
    /// (u+1, v)-(u, v+1).
    pub(crate) diagonals: Vec<[u32; 2]>,
    /// In each strip three nodes in a row: along u, column by column; then along v, row by row.
    pub(crate) triples: Vec<[u32; 3]>,
    /// Cells, counter-clockwise, row by row.
    pub(crate) cells: Vec<[u32; 4]>,
    /// The strips, from the first row on.
    pub(crate) strips: Vec<Strip>,
}

/// What a sweep does in a strip, as parts of the lists, one kind after the other.
///
/// Each kind is some rows behind the one before, which so has done all that it does to them: strip
/// by strip comes to the same as list by list, bit for bit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Strip {
    pub(crate) triples: Range<usize>,
    /// Nodes that no later triple bends.
    pub(crate) nodes: Range<usize>,
    pub(crate) diagonals: Range<usize>,
    pub(crate) edges: Range<usize>,
}

/// Up to which row each kind has come at the end of a strip.
#[derive(Debug, Clone, Copy, Default)]
struct Reach {
    /// Triples along u.
    rows: u32,
    /// Middle nodes of triples along v.
    middles: u32,
    /// Nodes that are bent.
    bent: u32,
    /// Cells.
    cells: u32,
    /// Edges along u.
    edges: u32,
    /// First nodes of edges along v.
    crossed: u32,
}

impl Reach {
    /// Of a strip that ends before row `end` of `count`.
    fn new(end: u32, count: u32) -> Self {
        // A triple over the end of the strip bends two of its rows.
        let bent = if end == count {
            count
        } else {
            end.saturating_sub(2)
        };
        let cells = bent.saturating_sub(1);
        // The row that the next cells begin with waits for them.
        let edges = if end == count { count } else { cells };
        Self {
            rows: end,
            middles: end - 1,
            bent,
            cells,
            edges,
            crossed: edges.saturating_sub(1),
        }
    }
}

impl GridLists {
    /// Lists of a grid.
    pub(crate) fn new(shape: GridShape) -> Self {
        let is_whole = shape.node_count() <= WHOLE as usize;
        let height = (STRIP / shape.u_count).max(ROWS);
        Self::in_strips(shape, if is_whole { shape.v_count } else { height })
    }

    /// Lists in strips of `height` rows.
    fn in_strips(shape: GridShape, height: u32) -> Self {
        let mut lists = Self {
            edges: Vec::new(),
            diagonals: Vec::new(),
            triples: Vec::new(),
            cells: shape.quads(),
            strips: Vec::new(),
        };
        let mut from = Reach::default();
        while from.rows < shape.v_count {
            let end = (from.rows + height).min(shape.v_count);
            let to = Reach::new(end, shape.v_count);
            lists.push_strip(shape, &from, &to);
            from = to;
        }
        lists
    }

    fn push_strip(&mut self, shape: GridShape, from: &Reach, to: &Reach) {
        let u_count = shape.u_count;
        let columns = if shape.is_periodic {
            u_count
        } else {
            u_count - 1
        };
        let node = |u: u32, v: u32| v * u_count + u % u_count;
        let starts = [&self.edges, &self.diagonals].map(Vec::len);
        let first_triple = self.triples.len();
        for u in 0..u_count {
            let is_inner = shape.is_periodic || (u > 0 && u + 1 < u_count);
            for v in from.rows..to.rows {
                if is_inner {
                    let before = node(u + u_count - 1, v);
                    self.triples.push([before, node(u, v), node(u + 1, v)]);
                }
            }
        }
        for v in from.middles.max(1)..to.middles {
            for u in 0..u_count {
                self.triples
                    .push([node(u, v - 1), node(u, v), node(u, v + 1)]);
            }
        }
        for v in from.cells..to.cells {
            for u in 0..columns {
                self.diagonals.push([node(u, v), node(u + 1, v + 1)]);
            }
            for u in 0..columns {
                self.diagonals.push([node(u + 1, v), node(u, v + 1)]);
            }
        }
        for v in from.edges..to.edges {
            for parity in 0..2 {
                for u in (parity..columns).step_by(2) {
                    self.edges.push([node(u, v), node(u + 1, v)]);
                }
            }
        }
        for parity in 0..2 {
            for v in (from.crossed..to.crossed).filter(|v| v % 2 == parity) {
                for u in 0..u_count {
                    self.edges.push([node(u, v), node(u, v + 1)]);
                }
            }
        }
        self.strips.push(Strip {
            triples: first_triple..self.triples.len(),
            nodes: (from.bent * u_count) as usize..(to.bent * u_count) as usize,
            diagonals: starts[1]..self.diagonals.len(),
            edges: starts[0]..self.edges.len(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_element_is_listed_once_on_open_and_periodic_grids() {
        for (is_periodic, columns, along_u) in [(false, 4, 12), (true, 5, 20)] {
            let lists = GridLists::new(GridShape {
                u_count: 5,
                v_count: 4,
                is_periodic,
            });
            assert_eq!(lists.edges.len(), columns * 4 + 15);
            assert_eq!(lists.diagonals.len(), 2 * columns * 3);
            assert_eq!(lists.triples.len(), along_u + 10);
            assert_eq!(lists.cells.len(), columns * 3);
            let pairs = lists.edges.iter().chain(&lists.diagonals);
            let unique: HashSet<_> = pairs.map(|&[i, j]| (i.min(j), i.max(j))).collect();
            assert_eq!(unique.len(), lists.edges.len() + lists.diagonals.len());
            for &[i, j, k] in &lists.triples {
                assert!(i != j && j != k && i != k);
            }
        }
    }

    #[test]
    fn neighbours_in_the_lists_share_no_node() {
        let lists = GridLists::new(GridShape {
            u_count: 21,
            v_count: 20,
            is_periodic: false,
        });
        let shares = |a: &[u32], b: &[u32]| a.iter().any(|i| b.contains(i));
        let count = lists
            .edges
            .windows(2)
            .filter(|w| shares(&w[0], &w[1]))
            .count();
        // Where even columns meet odd ones, at most.
        assert!(count <= 20, "{count}");
        assert!(!lists.diagonals.windows(2).any(|w| shares(&w[0], &w[1])));
        assert!(!lists.triples.windows(2).any(|w| shares(&w[0], &w[1])));
    }

    #[test]
    fn strips_list_what_the_whole_grid_does_and_each_kind_after_all_of_the_one_before() {
        for is_periodic in [false, true] {
            for (v_count, height) in [(20, 6), (20, 20), (23, 7), (13, 6), (7, 6), (6, 6), (3, 6)] {
                let shape = GridShape {
                    u_count: 9,
                    v_count,
                    is_periodic,
                };
                let whole = GridLists::in_strips(shape, v_count);
                assert_eq!(whole.strips.len(), 1);
                let lists = GridLists::in_strips(shape, height);
                assert_eq!(lists.strips.len(), v_count.div_ceil(height) as usize);
                // The same elements in another order.
                let sorted = |mut pairs: Vec<[u32; 2]>| {
                    pairs.sort_unstable();
                    pairs
                };
                assert_eq!(sorted(lists.edges.clone()), sorted(whole.edges));
                assert_eq!(sorted(lists.diagonals.clone()), sorted(whole.diagonals));
                assert_eq!(lists.triples.len(), whole.triples.len());
                // What has been done to each node: bent, placed, sheared, stretched.
                let mut stage = vec![0; shape.node_count()];
                let mut reach = |nodes: &[u32], now: u32| {
                    for &node in nodes {
                        let stage = &mut stage[node as usize];
                        assert!(*stage <= now, "{shape:?} in {height}: node {node}");
                        assert!(now < 2 || *stage >= 1, "node {node} is not placed yet");
                        *stage = now;
                    }
                };
                for strip in &lists.strips {
                    for triple in &lists.triples[strip.triples.clone()] {
                        reach(triple, 0);
                    }
                    for node in strip.nodes.clone() {
                        reach(&[node as u32], 1);
                    }
                    for diagonal in &lists.diagonals[strip.diagonals.clone()] {
                        reach(diagonal, 2);
                    }
                    for edge in &lists.edges[strip.edges.clone()] {
                        reach(edge, 3);
                    }
                }
                assert!(stage.iter().all(|s| *s == 3), "{shape:?} in {height}");
            }
        }
    }

    #[test]
    fn the_smallest_grids_have_nothing_to_list() {
        let lists = GridLists::new(GridShape {
            u_count: 1,
            v_count: 1,
            is_periodic: false,
        });
        assert!(lists.edges.is_empty() && lists.diagonals.is_empty());
        assert!(lists.triples.is_empty() && lists.cells.is_empty());
    }
}
