//! What collides with what: patches and meshes of colliders as nodes, edges and triangles.

use std::collections::BTreeSet;

use crate::anatomy::GridShape;

/// Nodes within this many cells of each other in a grid are neighbours.
const NEXT_CELLS: u32 = 2;

/// A cell of a part and the elements that it owns; every element is owned by one cell.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cell {
    /// Nodes that bound everything it owns.
    pub(crate) hull: Vec<u32>,
    pub(crate) nodes: Vec<u32>,
    pub(crate) edges: Vec<[u32; 2]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// A patch, or the mesh of a collider.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// First of its nodes among all.
    pub(crate) first: u32,
    pub(crate) count: u32,
    /// Its grid; none for a collider.
    pub(crate) grid: Option<GridShape>,
    pub(crate) cells: Vec<Cell>,
}

impl Part {
    /// The grid of a patch; quads are cut along their first diagonal.
    pub(crate) fn of_grid(shape: GridShape, first: u32) -> Self {
        let (nu, nv) = (shape.u_count, shape.v_count);
        let columns = if shape.is_periodic {
            nu
        } else {
            nu.saturating_sub(1)
        };
        let rows = nv.saturating_sub(1);
        let mut cells = Vec::with_capacity((columns * rows) as usize);
        for v in 0..rows {
            for u in 0..columns {
                let at = |du: u32, dv: u32| first + (v + dv) * nu + (u + du) % nu;
                let (a, b, c, d) = (at(0, 0), at(1, 0), at(1, 1), at(0, 1));
                let mut cell = Cell {
                    hull: vec![a, b, c, d],
                    nodes: vec![a],
                    edges: vec![[a, b], [a, d], [a, c]],
                    triangles: vec![[a, b, c], [a, c, d]],
                };
                let is_last_column = !shape.is_periodic && u + 1 == columns;
                let is_last_row = v + 1 == rows;
                if is_last_column {
                    cell.nodes.push(b);
                    cell.edges.push([b, c]);
                }
                if is_last_row {
                    cell.nodes.push(d);
                    cell.edges.push([d, c]);
                }
                if is_last_column && is_last_row {
                    cell.nodes.push(c);
                }
                cells.push(cell);
            }
        }
        Self {
            first,
            count: shape.node_count() as u32,
            grid: Some(shape),
            cells,
        }
    }

    /// The mesh of a collider: `triangles` index its own vertices.
    pub(crate) fn of_mesh(vertex_count: usize, triangles: &[[u32; 3]], first: u32) -> Self {
        let mut seen_nodes = BTreeSet::new();
        let mut seen_edges = BTreeSet::new();
        let mut cells = Vec::with_capacity(triangles.len());
        for t in triangles {
            let [a, b, c] = t.map(|v| v + first);
            let mut cell = Cell {
                hull: vec![a, b, c],
                triangles: vec![[a, b, c]],
                ..Cell::default()
            };
            for v in [a, b, c] {
                if seen_nodes.insert(v) {
                    cell.nodes.push(v);
                }
            }
            for [v, w] in [[a, b], [b, c], [c, a]] {
                let edge = [v.min(w), v.max(w)];
                if seen_edges.insert(edge) {
                    cell.edges.push(edge);
                }
            }
            cells.push(cell);
        }
        Self {
            first,
            count: vertex_count as u32,
            grid: None,
            cells,
        }
    }

    /// Whether two nodes of this part are so near in the grid, within [`NEXT_CELLS`] of each
    /// other, that its constraints keep them apart, not contact.
    #[inline]
    pub(crate) fn are_neighbours(&self, a: u32, b: u32) -> bool {
        let Some(shape) = self.grid else {
            return true;
        };
        let (a, b) = (a - self.first, b - self.first);
        let (ua, va) = (a % shape.u_count, a / shape.u_count);
        let (ub, vb) = (b % shape.u_count, b / shape.u_count);
        let mut du = ua.abs_diff(ub);
        if shape.is_periodic {
            du = du.min(shape.u_count - du);
        }
        du <= NEXT_CELLS && va.abs_diff(vb) <= NEXT_CELLS
    }

    /// Whether two cells are so near in the grid that all their nodes are neighbours.
    #[inline]
    pub(crate) fn are_next_cells(&self, a: u32, b: u32) -> bool {
        let Some(shape) = self.grid else {
            return true;
        };
        let columns = shape.u_count - u32::from(!shape.is_periodic);
        let (ua, va, ub, vb) = (a % columns, a / columns, b % columns, b / columns);
        let mut du = ua.abs_diff(ub);
        if shape.is_periodic {
            du = du.min(columns - du);
        }
        // Corners of a cell are one further.
        du < NEXT_CELLS && va.abs_diff(vb) < NEXT_CELLS
    }

    /// All triangles, cell after cell.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.cells.iter().flat_map(|c| c.triangles.iter().copied())
    }
}
