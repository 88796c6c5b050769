//! A piece of surface that others must stay in front of: one lip for the other.

use nalgebra::{Point3, Vector3};

use super::mesh::Cell;
use super::tree::Tree;
use crate::Point;
use crate::mesh::closest_on_triangle;

/// Triangles with a hierarchy of boxes, whose front is where they are counter-clockwise.
#[derive(Debug, Clone)]
pub struct Sheet {
    triangles: Vec<[u32; 3]>,
    /// For each triangle which of its sides (corners 0-1, 1-2, 2-0) are the sheet's border.
    borders: Vec<[bool; 3]>,
    cells: Vec<Cell>,
    tree: Tree,
    /// Vertices on the border, rising.
    border_vertices: Vec<u32>,
    /// Vertices of the sheet, rising, and their normals now.
    vertices: Vec<u32>,
    normals: Vec<Vector3<f32>>,
}

/// Where a sheet is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SheetPlace {
    /// Corners of the triangle.
    pub corners: [u32; 3],
    /// Barycentric coordinates on it.
    pub barycentric: [f32; 3],
    /// Distance, negative behind the sheet. (mm)
    pub distance: f32,
    /// Unit direction to the front.
    pub normal: Vector3<f32>,
    /// Whether it is the sheet's border that is nearest: beyond it there is no front or back.
    pub is_border: bool,
}

impl Sheet {
    /// - `triangles`: indices into the positions given later
    pub fn new(triangles: Vec<[u32; 3]>, positions: &[Point3<f32>]) -> Self {
        let edge = |a: u32, b: u32| [a.min(b), a.max(b)];
        let mut edges: Vec<[u32; 2]> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)])
            .collect();
        edges.sort_unstable();
        let is_border = |e: [u32; 2]| {
            let first = edges.partition_point(|x| *x < e);
            edges.get(first + 1) != Some(&e)
        };
        let mut border_vertices: Vec<u32> = edges
            .iter()
            .copied()
            .filter(|e| is_border(*e))
            .flatten()
            .collect();
        border_vertices.sort_unstable();
        border_vertices.dedup();
        let borders = triangles
            .iter()
            .map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)].map(is_border))
            .collect();
        let cells = triangles
            .iter()
            .map(|t| Cell {
                hull: t.to_vec(),
                ..Cell::default()
            })
            .collect();
        let centers: Vec<crate::Vector> = triangles
            .iter()
            .map(|t| {
                let sum: Vector3<f32> = t.iter().map(|&v| positions[v as usize].coords).sum();
                sum.cast::<f64>() / 3.0
            })
            .collect();
        let mut vertices: Vec<u32> = triangles.iter().flatten().copied().collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut sheet = Self {
            normals: vec![Vector3::zeros(); vertices.len()],
            tree: Tree::of_centers(&centers),
            triangles,
            borders,
            border_vertices,
            cells,
            vertices,
        };
        sheet.refit(positions);
        sheet
    }

    /// Whether it has no triangle.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Its vertices, rising.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// Unit normals of [`Self::vertices`] at the positions last fitted to.
    pub fn normals(&self) -> &[Vector3<f32>] {
        &self.normals
    }

    /// Takes the positions of its vertices. (mm)
    pub fn refit(&mut self, positions: &[Point3<f32>]) {
        self.tree.refit(&self.cells, positions);
        self.normals.fill(Vector3::zeros());
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            // Longer for larger triangles, which count for more.
            let normal = (b - a).cross(&(c - a));
            for v in t {
                if let Ok(slot) = self.vertices.binary_search(v) {
                    self.normals[slot] += normal;
                }
            }
        }
        for n in &mut self.normals {
            *n = n.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        }
    }

    /// The nearest place within `reach`. (mm)
    pub fn nearest(
        &self,
        point: &Point3<f32>,
        reach: f32,
        positions: &[Point3<f32>],
    ) -> Option<SheetPlace> {
        let wide: Point = point.cast();
        let measure = |index: u32| {
            let corners = self.triangles[index as usize].map(|v| positions[v as usize].cast());
            let (place, barycentric) = closest_on_triangle(&wide, corners);
            Some(((place - wide).norm() as f32, (index, place, barycentric)))
        };
        let (distance, (index, place, barycentric)) =
            self.tree.nearest_cell(point, reach, measure)?;
        let corners = self.triangles[index as usize];
        // Which sides the place is on: opposite to corners that have no share in it.
        let is_on = |side: usize| barycentric[(side + 2) % 3] <= 1e-9;
        let is_at = |k: usize| is_on((k + 2) % 3) && is_on(k);
        let ends = |k: usize| self.border_vertices.binary_search(&corners[k]).is_ok();
        let is_border = (0..3).any(|side| is_on(side) && self.borders[index as usize][side])
            || (0..3).any(|k| is_at(k) && ends(k));
        let mut normal = Vector3::zeros();
        for (v, b) in corners.iter().zip(barycentric) {
            if let Ok(slot) = self.vertices.binary_search(v) {
                normal += self.normals[slot] * b as f32;
            }
        }
        let flat = {
            let [a, b, c] = corners.map(|v| positions[v as usize]);
            (b - a).cross(&(c - a))
        };
        let normal = normal.try_normalize(1e-6).unwrap_or_else(Vector3::zeros);
        // Within a triangle its own plane tells the side, on its edges those of both.
        let is_within = barycentric.iter().all(|&b| b > 1e-9);
        let telling = if is_within { flat } else { normal };
        let away: Vector3<f32> = (wide - place).cast();
        let side = if away.dot(&telling) < 0.0 { -1.0 } else { 1.0 };
        Some(SheetPlace {
            corners,
            barycentric: barycentric.map(|b| b as f32),
            distance: side * distance,
            normal,
            is_border,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bowl_knows_its_front_and_where_it_ends() {
        let count = 9_u32;
        let positions: Vec<Point3<f32>> = (0..count * count)
            .map(|i| {
                let (x, y) = ((i % count) as f32 - 4.0, (i / count) as f32 - 4.0);
                Point3::new(x, y, 0.05 * (x * x + y * y))
            })
            .collect();
        let mut triangles = Vec::new();
        for y in 0..count - 1 {
            for x in 0..count - 1 {
                let a = y * count + x;
                triangles.push([a, a + 1, a + count + 1]);
                triangles.push([a, a + count + 1, a + count]);
            }
        }
        let sheet = Sheet::new(triangles, &positions);
        let at = |z: f32| sheet.nearest(&Point3::new(0.2, 0.3, z), 3.0, &positions);
        let (above, below) = (at(1.0).unwrap(), at(-1.0).unwrap());
        assert!(above.distance > 0.8 && below.distance < -0.8);
        assert!(above.normal.z > 0.9);
        assert_eq!(at(9.0), None, "out of reach");
        let beyond = Point3::new(6.0, 0.0, 0.0);
        let past = sheet.nearest(&beyond, 9.0, &positions).unwrap();
        assert!(past.is_border && !above.is_border);
    }
}
