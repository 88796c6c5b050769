//! The edges, diagonals, triples and cells of a grid, listed in the fixed orders in which
//! constraints are projected. Neighbours in a list share no node (but at the seam of a periodic
//! grid with an odd number of columns), so their arithmetic overlaps.

use crate::anatomy::GridShape;

/// Node indices of everything that constraints act on.
#[derive(Debug, Clone)]
pub(crate) struct GridLists {
    /// Edges along u: row by row, even columns and then odd ones; then edges along v: even
    /// rows and then odd ones.
    pub(crate) edges: Vec<[u32; 2]>,
    /// Both diagonals of every cell, row by row: first (u, v)-(u+1, v+1) of all the row, then
    /// (u+1, v)-(u, v+1).
    pub(crate) diagonals: Vec<[u32; 2]>,
    /// Three nodes in a row: along u, column by column; then along v, row by row.
    pub(crate) triples: Vec<[u32; 3]>,
    /// Cells, counter-clockwise, row by row.
    pub(crate) cells: Vec<[u32; 4]>,
}

impl GridLists {
    /// Lists of a grid.
    pub(crate) fn new(shape: GridShape) -> Self {
        let GridShape {
            u_count,
            v_count,
            is_periodic,
        } = shape;
        let columns = if is_periodic { u_count } else { u_count - 1 };
        let rows = v_count - 1;
        let node = |u: u32, v: u32| v * u_count + u % u_count;
        let mut edges = Vec::new();
        for v in 0..v_count {
            for parity in 0..2 {
                for u in (parity..columns).step_by(2) {
                    edges.push([node(u, v), node(u + 1, v)]);
                }
            }
        }
        for parity in 0..2 {
            for v in (parity..rows).step_by(2) {
                for u in 0..u_count {
                    edges.push([node(u, v), node(u, v + 1)]);
                }
            }
        }
        let mut diagonals = Vec::new();
        for v in 0..rows {
            for u in 0..columns {
                diagonals.push([node(u, v), node(u + 1, v + 1)]);
            }
            for u in 0..columns {
                diagonals.push([node(u + 1, v), node(u, v + 1)]);
            }
        }
        let mut triples = Vec::new();
        for u in 0..u_count {
            let is_inner = is_periodic || (u > 0 && u + 1 < u_count);
            for v in 0..v_count {
                if is_inner {
                    triples.push([node(u + u_count - 1, v), node(u, v), node(u + 1, v)]);
                }
            }
        }
        for v in 1..rows.max(1) {
            for u in 0..u_count {
                triples.push([node(u, v - 1), node(u, v), node(u, v + 1)]);
            }
        }
        let mut cells = Vec::new();
        for v in 0..rows {
            for u in 0..columns {
                cells.push([
                    node(u, v),
                    node(u + 1, v),
                    node(u + 1, v + 1),
                    node(u, v + 1),
                ]);
            }
        }
        Self {
            edges,
            diagonals,
            triples,
            cells,
        }
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
