//! Walks over the edges, diagonals, triples and cells of a grid, in the fixed orders in which
//! constraints are projected. In each, neighbours in the walk share no node (but at the seam
//! of a periodic grid with an odd number of columns), so their arithmetic overlaps.

use crate::anatomy::GridShape;

/// Edges (and cells) per row of the grid.
#[inline(always)]
pub(crate) fn edge_columns(shape: GridShape) -> usize {
    let u_count = shape.u_count as usize;
    if shape.is_periodic {
        u_count
    } else {
        u_count.saturating_sub(1)
    }
}

/// Rows of cells.
#[inline(always)]
pub(crate) fn cell_rows(shape: GridShape) -> usize {
    (shape.v_count as usize).saturating_sub(1)
}

/// How many edges run along u.
pub(crate) fn u_edge_count(shape: GridShape) -> usize {
    edge_columns(shape) * shape.v_count as usize
}

/// How many edges run along v.
pub(crate) fn v_edge_count(shape: GridShape) -> usize {
    shape.u_count as usize * cell_rows(shape)
}

/// How many cells there are; each has two diagonals.
pub(crate) fn cell_count(shape: GridShape) -> usize {
    edge_columns(shape) * cell_rows(shape)
}

/// Column after `u`, round the seam.
#[inline(always)]
fn after(u: usize, u_count: usize) -> usize {
    if u + 1 == u_count { 0 } else { u + 1 }
}

/// Calls `visit(edge, i, j)` for edges along u: row by row, even columns and then odd ones.
#[inline(always)]
pub(crate) fn for_u_edges(shape: GridShape, mut visit: impl FnMut(usize, usize, usize)) {
    let u_count = shape.u_count as usize;
    let columns = edge_columns(shape);
    for v in 0..shape.v_count as usize {
        for parity in 0..2 {
            let mut u = parity;
            while u < columns {
                visit(
                    v * columns + u,
                    v * u_count + u,
                    v * u_count + after(u, u_count),
                );
                u += 2;
            }
        }
    }
}

/// Calls `visit(edge, i, j)` for edges along v: even rows and then odd ones.
#[inline(always)]
pub(crate) fn for_v_edges(shape: GridShape, mut visit: impl FnMut(usize, usize, usize)) {
    let u_count = shape.u_count as usize;
    for parity in 0..2 {
        let mut v = parity;
        while v < cell_rows(shape) {
            for u in 0..u_count {
                visit(v * u_count + u, v * u_count + u, (v + 1) * u_count + u);
            }
            v += 2;
        }
    }
}

/// Calls `visit(diagonal, i, j)` for cell diagonals, row by row: first (u, v)-(u+1, v+1),
/// numbered by cell, then (u+1, v)-(u, v+1), numbered after all of the former.
#[inline(always)]
pub(crate) fn for_diagonals(shape: GridShape, mut visit: impl FnMut(usize, usize, usize)) {
    let u_count = shape.u_count as usize;
    let columns = edge_columns(shape);
    let cells = cell_count(shape);
    for v in 0..cell_rows(shape) {
        let (low, high) = (v * u_count, (v + 1) * u_count);
        for u in 0..columns {
            visit(v * columns + u, low + u, high + after(u, u_count));
        }
        for u in 0..columns {
            visit(cells + v * columns + u, low + after(u, u_count), high + u);
        }
    }
}

/// Calls `visit(i, j, k)` for three nodes in a row along u, column by column.
#[inline(always)]
pub(crate) fn for_u_triples(shape: GridShape, mut visit: impl FnMut(usize, usize, usize)) {
    let u_count = shape.u_count as usize;
    if u_count < 3 {
        return;
    }
    let (first, last) = if shape.is_periodic {
        (0, u_count)
    } else {
        (1, u_count - 1)
    };
    for u in first..last {
        let before = if u == 0 { u_count - 1 } else { u - 1 };
        for v in 0..shape.v_count as usize {
            let row = v * u_count;
            visit(row + before, row + u, row + after(u, u_count));
        }
    }
}

/// Calls `visit(i, j, k)` for three nodes in a row along v, row by row.
#[inline(always)]
pub(crate) fn for_v_triples(shape: GridShape, mut visit: impl FnMut(usize, usize, usize)) {
    let u_count = shape.u_count as usize;
    for v in 1..(shape.v_count as usize).saturating_sub(1) {
        for u in 0..u_count {
            let j = v * u_count + u;
            visit(j - u_count, j, j + u_count);
        }
    }
}

/// Calls `visit([a, b, c, d])` for cells, counter-clockwise, row by row.
#[inline(always)]
pub(crate) fn for_cells(shape: GridShape, mut visit: impl FnMut([usize; 4])) {
    let u_count = shape.u_count as usize;
    for v in 0..cell_rows(shape) {
        let (low, high) = (v * u_count, (v + 1) * u_count);
        for u in 0..edge_columns(shape) {
            let next = after(u, u_count);
            visit([low + u, low + next, high + next, high + u]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_element_is_visited_once_on_open_and_periodic_grids() {
        for (is_periodic, columns) in [(false, 4), (true, 5)] {
            let shape = GridShape {
                u_count: 5,
                v_count: 4,
                is_periodic,
            };
            let mut seen = vec![0; u_edge_count(shape)];
            for_u_edges(shape, |e, i, j| {
                seen[e] += 1;
                assert_eq!(i / 5, j / 5);
            });
            assert!(seen.iter().all(|&n| n == 1) && seen.len() == columns * 4);
            let mut seen = vec![0; v_edge_count(shape)];
            for_v_edges(shape, |e, i, j| {
                seen[e] += 1;
                assert_eq!(j - i, 5);
            });
            assert!(seen.iter().all(|&n| n == 1) && seen.len() == 15);
            let mut seen = vec![0; 2 * cell_count(shape)];
            for_diagonals(shape, |d, i, j| {
                seen[d] += 1;
                assert_eq!(i / 5 + 1, j / 5);
            });
            assert!(seen.iter().all(|&n| n == 1));
            let mut cells = 0;
            for_cells(shape, |_| cells += 1);
            assert_eq!(cells, columns * 3);
            let (mut along_u, mut along_v) = (0, 0);
            for_u_triples(shape, |_, _, _| along_u += 1);
            for_v_triples(shape, |_, _, _| along_v += 1);
            assert_eq!(along_u, if is_periodic { 20 } else { 12 });
            assert_eq!(along_v, 10);
        }
    }

    #[test]
    fn the_smallest_grids_have_nothing_to_visit() {
        let shape = GridShape {
            u_count: 1,
            v_count: 1,
            is_periodic: false,
        };
        for_u_edges(shape, |_, _, _| panic!("no edge"));
        for_v_edges(shape, |_, _, _| panic!("no edge"));
        for_diagonals(shape, |_, _, _| panic!("no diagonal"));
        for_u_triples(shape, |_, _, _| panic!("no triple"));
        for_v_triples(shape, |_, _, _| panic!("no triple"));
        for_cells(shape, |_| panic!("no cell"));
    }
}
