//! The judge: does any edge pass through any triangle? Exactly, over all pairs.
//!
//! It shares nothing with the solver: not its candidates, not its distances, not its boxes.
//! Positions are snapped to a lattice of 2^-20 mm (a nanometre), where every orientation is a
//! determinant of integers and its sign is exact in 128 bits. Touching counts as crossing;
//! edges that lie in the plane of a triangle do not (another edge of the pair then tells).
//!
//! Two triangle meshes cross if and only if an edge of one crosses a triangle of the other, so
//! nothing else has to be looked at. Elements that share a vertex are not a pair.

use nalgebra::Point3;

/// Lattice steps per mm.
const STEPS_PER_MM: f64 = (1_u64 << 20) as f64;
/// Largest coordinate that is snapped without being cut off. (mm)
const LARGEST: f64 = 1024.0 * 1024.0;

/// An edge that passes through a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Crossing {
    /// Index of the edge.
    pub edge: u32,
    /// Index of the triangle.
    pub triangle: u32,
}

/// All crossings of edges with triangles for which `may_collide(edge, triangle)` holds, rising.
///
/// - `positions`: finite (mm), shape [vertex_count, 3]
/// - `edges`, `triangles`: indices into them
pub fn crossings(
    positions: &[Point3<f32>],
    edges: &[[u32; 2]],
    triangles: &[[u32; 3]],
    may_collide: impl Fn(u32, u32) -> bool,
) -> Vec<Crossing> {
    let lattice: Vec<[i64; 3]> = positions.iter().map(snap).collect();
    let boxes: Vec<Box3> = triangles
        .iter()
        .map(|t| Box3::around(t.iter().map(|&v| &lattice[v as usize])))
        .collect();
    let order = Sweep::new(&boxes);
    let mut found = Vec::new();
    for (index, edge) in edges.iter().enumerate() {
        let own = Box3::around(edge.iter().map(|&v| &lattice[v as usize]));
        for triangle in order.overlapping(&own) {
            let corners = triangles[triangle as usize];
            let is_neighbour = edge.iter().any(|v| corners.contains(v));
            if is_neighbour
                || !own.overlaps(&boxes[triangle as usize])
                || !may_collide(index as u32, triangle)
            {
                continue;
            }
            let [p, q] = edge.map(|v| lattice[v as usize]);
            if pierces(p, q, corners.map(|v| lattice[v as usize])) {
                found.push(Crossing {
                    edge: index as u32,
                    triangle,
                });
            }
        }
    }
    found.sort_unstable();
    found
}

fn snap(p: &Point3<f32>) -> [i64; 3] {
    [0, 1, 2].map(|k| (f64::from(p[k]).clamp(-LARGEST, LARGEST) * STEPS_PER_MM).round() as i64)
}

fn pierces(p: [i64; 3], q: [i64; 3], [a, b, c]: [[i64; 3]; 3]) -> bool {
    let (sp, sq) = (orientation(a, b, c, p), orientation(a, b, c, q));
    if sp * sq > 0 || (sp == 0 && sq == 0) {
        return false;
    }
    let around = [
        orientation(p, q, a, b),
        orientation(p, q, b, c),
        orientation(p, q, c, a),
    ];
    around.iter().all(|&s| s >= 0) || around.iter().all(|&s| s <= 0)
}

/// Sign of the volume of the tetrahedron a, b, c, d.
fn orientation(a: [i64; 3], b: [i64; 3], c: [i64; 3], d: [i64; 3]) -> i32 {
    let from = |p: [i64; 3]| [0, 1, 2].map(|k| i128::from(p[k] - a[k]));
    let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (from(b), from(c), from(d));
    let volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
    volume.signum() as i32
}

/// An axis-aligned box on the lattice.
#[derive(Debug, Clone, Copy)]
struct Box3 {
    low: [i64; 3],
    high: [i64; 3],
}

impl Box3 {
    fn around<'a>(points: impl Iterator<Item = &'a [i64; 3]>) -> Self {
        let mut out = Self {
            low: [i64::MAX; 3],
            high: [i64::MIN; 3],
        };
        for p in points {
            for k in 0..3 {
                out.low[k] = out.low[k].min(p[k]);
                out.high[k] = out.high[k].max(p[k]);
            }
        }
        out
    }

    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }
}

/// Boxes in columns across the first two axes; every box stands in each column it touches.
struct Sweep {
    cell: i64,
    /// (column, box), sorted.
    entries: Vec<([i64; 2], u32)>,
    lows: Vec<[i64; 2]>,
}

impl Sweep {
    fn new(boxes: &[Box3]) -> Self {
        let mut sizes: Vec<i64> = boxes
            .iter()
            .map(|b| (b.high[0] - b.low[0]).max(b.high[1] - b.low[1]))
            .collect();
        sizes.sort_unstable();
        // Columns as wide as nearly all boxes keep the list short.
        let cell = sizes
            .get(sizes.len() * 9 / 10)
            .copied()
            .unwrap_or(1)
            .max(1024);
        let mut sweep = Self {
            cell,
            entries: Vec::new(),
            lows: Vec::new(),
        };
        for (index, b) in boxes.iter().enumerate() {
            let first = sweep.column(b.low);
            sweep.lows.push(first);
            let last = sweep.column(b.high);
            for x in first[0]..=last[0] {
                for y in first[1]..=last[1] {
                    sweep.entries.push(([x, y], index as u32));
                }
            }
        }
        sweep.entries.sort_unstable();
        sweep
    }

    fn column(&self, p: [i64; 3]) -> [i64; 2] {
        [p[0].div_euclid(self.cell), p[1].div_euclid(self.cell)]
    }

    /// Boxes in the columns of `of`, each once.
    fn overlapping(&self, of: &Box3) -> Vec<u32> {
        let (first, last) = (self.column(of.low), self.column(of.high));
        let mut out = Vec::new();
        for x in first[0]..=last[0] {
            for y in first[1]..=last[1] {
                let start = self.entries.partition_point(|e| e.0 < [x, y]);
                for &(column, index) in &self.entries[start..] {
                    if column != [x, y] {
                        break;
                    }
                    // Seen only in the first column that both touch.
                    let low = self.lows[index as usize];
                    if [first[0].max(low[0]), first[1].max(low[1])] == [x, y] {
                        out.push(index);
                    }
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(p: [f32; 3], q: [f32; 3]) -> usize {
        let positions: Vec<Point3<f32>> = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], p, q]
            .map(Point3::from)
            .to_vec();
        crossings(&positions, &[[3, 4]], &[[0, 1, 2]], |_, _| true).len()
    }

    #[test]
    fn an_edge_through_a_triangle_is_found_and_one_beside_it_is_not() {
        assert_eq!(one([0.2, 0.2, -1.0], [0.2, 0.2, 1.0]), 1);
        assert_eq!(one([0.2, 0.2, 0.1], [0.2, 0.2, 1.0]), 0);
        assert_eq!(one([0.6, 0.6, -1.0], [0.6, 0.6, 1.0]), 0);
        assert_eq!(one([-1.0, 0.2, 0.0], [2.0, 0.2, 0.0]), 0, "in its plane");
        assert_eq!(one([0.2, 0.2, 0.0], [0.2, 0.2, 1.0]), 1, "touching");
        assert_eq!(
            one([0.5, 0.5, -1.0], [0.5, 0.5, 1.0]),
            1,
            "through its side"
        );
    }

    #[test]
    fn a_crossing_a_nanometre_deep_is_a_crossing() {
        let step = (1.0 / STEPS_PER_MM) as f32;
        assert_eq!(one([0.25, 0.25, -step], [0.25, 0.25, 1.0]), 1);
        assert_eq!(one([0.25, 0.25, step], [0.25, 0.25, 1.0]), 0);
    }

    #[test]
    fn columns_lose_no_pair() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for t in 0..200_u32 {
            let c: [f32; 3] = [0; 3].map(|_| random.random_range(-4.0..4.0));
            for _ in 0..3 {
                positions.push(Point3::from(c.map(|x| x + random.random_range(-2.0..2.0))));
            }
            triangles.push([3 * t, 3 * t + 1, 3 * t + 2]);
        }
        let edges = crate::mesh::triangle_edges(&triangles);
        let found = crossings(&positions, &edges, &triangles, |_, _| true);
        let lattice: Vec<_> = positions.iter().map(snap).collect();
        let mut expected = Vec::new();
        for (e, edge) in edges.iter().enumerate() {
            for (t, corners) in triangles.iter().enumerate() {
                let [p, q] = edge.map(|v| lattice[v as usize]);
                if !edge.iter().any(|v| corners.contains(v))
                    && pierces(p, q, corners.map(|v| lattice[v as usize]))
                {
                    expected.push(Crossing {
                        edge: e as u32,
                        triangle: t as u32,
                    });
                }
            }
        }
        assert!(found.len() > 100);
        assert_eq!(found, expected);
    }
}
