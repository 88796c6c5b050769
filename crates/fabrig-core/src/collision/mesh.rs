//! What collides with what: patches and meshes of colliders as nodes, edges and triangles.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

use super::tree::Tree;
use crate::anatomy::GridShape;

/// Nodes within this many cells of each other in a grid are neighbours.
const NEXT_CELLS: u32 = 2;

/// Least cosine between the normals of a flat sheet and their mean: 50 degrees, so that a
/// small budget's motion leaves them under 90.
const FLAT: f32 = 0.64;

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
    /// Unit normal of each cell where it was last looked at; zero where it has none.
    pub(crate) normals: Vec<Vector3<f32>>,
    pub(crate) tree: Tree,
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
            normals: Vec::new(),
            tree: Tree::of_grid(columns as usize, rows as usize),
            cells,
        }
    }

    /// The mesh of a collider: `triangles` index its own vertices.
    pub(crate) fn of_mesh(vertices: &[crate::Point], triangles: &[[u32; 3]], first: u32) -> Self {
        let mut seen_nodes = BTreeSet::new();
        let mut seen_edges = BTreeSet::new();
        let mut cells = Vec::with_capacity(triangles.len());
        let mut centers = Vec::with_capacity(triangles.len());
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
            let sum: crate::Vector = t.iter().map(|&v| vertices[v as usize].coords).sum();
            centers.push(sum / 3.0);
        }
        Self {
            first,
            count: vertices.len() as u32,
            grid: None,
            normals: Vec::new(),
            tree: Tree::of_centers(&centers),
            cells,
        }
    }

    /// Fits boxes and normals to positions.
    pub(crate) fn refit(&mut self, positions: &[Point3<f32>]) {
        self.tree.refit(&self.cells, positions);
        let at = |n: u32| positions[n as usize];
        self.normals.clear();
        self.normals.extend(self.cells.iter().map(|cell| {
            let normal = match cell.hull[..] {
                [a, b, c, d] => (at(c) - at(a)).cross(&(at(d) - at(b))),
                [a, b, c] => (at(b) - at(a)).cross(&(at(c) - at(a))),
                _ => Vector3::zeros(),
            };
            normal.try_normalize(0.0).unwrap_or_else(Vector3::zeros)
        }));
    }

    /// Whether all cells of a grid look so much the same way that it cannot reach itself, nor
    /// will within a small budget: a sheet must turn by a right angle to fold over.
    pub(crate) fn is_flat(&self) -> bool {
        let sum: Vector3<f32> = self.normals.iter().sum();
        let is_open = self.grid.is_some_and(|grid| !grid.is_periodic);
        let mean = sum.try_normalize(0.0);
        let is_along = |mean: Vector3<f32>| self.normals.iter().all(|n| n.dot(&mean) > FLAT);
        is_open && mean.is_some_and(is_along)
    }

    /// Whether everything that two cells own is further apart than `reach`, as their planes
    /// show: layers of tissue lie much nearer to each other than their boxes.
    #[inline]
    pub(crate) fn are_apart(
        &self,
        cell: u32,
        other: &Self,
        of_other: u32,
        reach: f32,
        positions: &[Point3<f32>],
    ) -> bool {
        let (a, b) = (&self.cells[cell as usize], &other.cells[of_other as usize]);
        let range = |hull: &[u32], n: &Vector3<f32>| {
            hull.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| {
                let height = positions[v as usize].coords.dot(n);
                (low.min(height), high.max(height))
            })
        };
        [
            &self.normals[cell as usize],
            &other.normals[of_other as usize],
        ]
        .into_iter()
        .any(|n| {
            let ((la, ha), (lb, hb)) = (range(&a.hull, n), range(&b.hull, n));
            lb - ha > reach || la - hb > reach
        })
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
