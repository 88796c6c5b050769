//! Tiles: pieces of a part of some sixteen cells, and how far their nodes have gone.
//!
//! For every tile contact keeps the box that holds the ways of its nodes since the part was
//! last looked at, from there to where they are and to where they are wanted. Two tiles that
//! go the same way have boxes in the same place: their ways against each other are then small,
//! however far both go. That is what makes a certificate last ([`super::certificate`]).

use std::ops::Range;

use nalgebra::Point3;

use super::mesh::Part;
use super::tree::Tree;
use crate::Vector;
use crate::machine::vectorized;

/// Cells along an edge of a tile of a grid.
const GRID_CELLS: u32 = 4;
/// Most triangles of a tile of a mesh.
const MESH_CELLS: usize = 8;

/// An axis-aligned box; empty at first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub(crate) low: [f32; 3],
    pub(crate) high: [f32; 3],
}

impl Extent {
    pub(crate) const EMPTY: Self = Self {
        low: [f32::INFINITY; 3],
        high: [f32::NEG_INFINITY; 3],
    };
    /// The box of no way at all.
    pub(crate) const STILL: Self = Self {
        low: [0.0; 3],
        high: [0.0; 3],
    };

    /// The box of the ways of nodes.
    pub(crate) fn of_ways(from: &[Point3<f32>], to: &[Point3<f32>]) -> Self {
        vectorized(OfWays { from, to })
    }

    #[inline(always)]
    fn of_ways_lanes(from: &[Point3<f32>], to: &[Point3<f32>]) -> Self {
        let [from, to] = [from, to].map(bytemuck::cast_slice::<Point3<f32>, f32>);
        // Eight nodes beside each other.
        let (mut lows, mut highs) = ([f32::INFINITY; 24], [f32::NEG_INFINITY; 24]);
        let (rows_from, rest_from) = from.as_chunks::<24>();
        let (rows_to, rest_to) = to.as_chunks::<24>();
        for (from, to) in rows_from.iter().zip(rows_to) {
            for k in 0..24 {
                let by = to[k] - from[k];
                lows[k] = least(lows[k], by);
                highs[k] = most(highs[k], by);
            }
        }
        for (k, (from, to)) in rest_from.iter().zip(rest_to).enumerate() {
            let by = to - from;
            lows[k] = least(lows[k], by);
            highs[k] = most(highs[k], by);
        }
        let mut out = Self::EMPTY;
        for k in 0..24 {
            out.low[k % 3] = least(out.low[k % 3], lows[k]);
            out.high[k % 3] = most(out.high[k % 3], highs[k]);
        }
        out
    }

    #[inline]
    pub(crate) fn take(&mut self, p: &[f32; 3]) {
        for k in 0..3 {
            self.low[k] = least(self.low[k], p[k]);
            self.high[k] = most(self.high[k], p[k]);
        }
    }

    #[inline]
    pub(crate) fn union(&self, other: &Self) -> Self {
        let mut out = *self;
        for k in 0..3 {
            out.low[k] = least(out.low[k], other.low[k]);
            out.high[k] = most(out.high[k], other.high[k]);
        }
        out
    }

    /// Whether `other` lies within.
    #[inline]
    pub(crate) fn holds(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.low[k] && other.high[k] <= self.high[k])
    }

    /// Takes off what every way in `gone` has used up.
    #[inline]
    pub(crate) fn shrink(&mut self, gone: &Self) {
        for k in 0..3 {
            self.low[k] -= gone.low[k];
            self.high[k] -= gone.high[k];
        }
    }

    /// Whether two boxes come within `reach` of each other.
    #[inline]
    pub(crate) fn is_near(&self, other: &Self, reach: f32) -> bool {
        // One comparison at the end: most answers cannot be foreseen.
        let mut gap = f32::NEG_INFINITY;
        for k in 0..3 {
            gap = most(gap, self.low[k] - other.high[k]);
            gap = most(gap, other.low[k] - self.high[k]);
        }
        gap <= reach
    }
}

struct OfWays<'a> {
    from: &'a [Point3<f32>],
    to: &'a [Point3<f32>],
}

impl pulp::NullaryFnOnce for OfWays<'_> {
    type Output = Extent;

    #[inline(always)]
    fn call(self) -> Extent {
        Extent::of_ways_lanes(self.from, self.to)
    }
}

// Not `f32::min`: a plain comparison is one instruction.
#[inline]
pub(super) fn least(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

#[inline]
pub(super) fn most(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

/// The ways of a tile's nodes as a box about its middle: what certificates ask for. (mm)
///
/// Of four numbers the last is nothing: four are what a register has.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Way {
    pub(crate) middle: [f32; 4],
    pub(crate) half: [f32; 4],
}

impl Way {
    #[inline]
    pub(crate) fn of(extent: &Extent) -> Self {
        let ([a, b, c], [d, e, f]) = (extent.low, extent.high);
        Self {
            middle: [0.5 * (a + d), 0.5 * (b + e), 0.5 * (c + f), 0.0],
            half: [0.5 * (d - a), 0.5 * (e - b), 0.5 * (f - c), 0.0],
        }
    }

    /// The ways of `self` against those of `other`.
    #[inline]
    pub(crate) fn against(&self, other: &Self) -> Self {
        let mut out = *self;
        for k in 0..4 {
            out.middle[k] -= other.middle[k];
            out.half[k] += other.half[k];
        }
        out
    }

    /// The least, and the most, that is gone along a direction. (mm)
    #[inline]
    pub(crate) fn along(&self, n: &[f32; 4]) -> [f32; 2] {
        let (mut middle, mut half) = ([0.0; 4], [0.0; 4]);
        for k in 0..4 {
            middle[k] = n[k] * self.middle[k];
            half[k] = n[k].abs() * self.half[k];
        }
        let (middle, half) = (sum(&middle), sum(&half));
        [middle - half, middle + half]
    }

    /// The longest way in it. (mm)
    #[inline]
    pub(crate) fn longest(&self) -> f32 {
        let mut squares = [0.0; 4];
        for k in 0..4 {
            let most = self.middle[k].abs() + self.half[k];
            squares[k] = most * most;
        }
        sum(&squares).sqrt()
    }
}

#[inline]
fn sum(x: &[f32; 4]) -> f32 {
    (x[0] + x[1]) + (x[2] + x[3])
}

/// A piece of a part.
#[derive(Debug, Clone)]
pub(crate) struct Tile {
    pub(crate) part: u32,
    /// Cells of the part.
    pub(crate) cells: Vec<u32>,
    /// Corners of its cells, in their order: of a quad (a, b, c, d) the normal is
    /// (c - a) x (d - b), and a triangle (a, b, c) is the quad (a, a, b, c).
    pub(crate) corners: Vec<[u32; 4]>,
    /// All nodes of its cells, rising.
    pub(crate) hull: Vec<u32>,
    /// Those that this tile alone owns.
    pub(crate) own: Vec<u32>,
    /// Its column and row among the tiles of a grid.
    place: [u32; 2],
}

/// The tiles of all parts.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tiles {
    pub(crate) tiles: Vec<Tile>,
    /// Tiles of each part.
    pub(crate) of_part: Vec<Range<usize>>,
    /// Tiles that have each node, from `starts[node]` on.
    starts: Vec<u32>,
    of_node: Vec<u32>,
    /// For each part that is a grid its columns and rows of tiles.
    counts: Vec<[u32; 2]>,
}

impl Tiles {
    /// - `rest`: all nodes (mm)
    pub(crate) fn new(parts: &[Part], rest: &[Point3<f32>]) -> Self {
        let mut out = Self::default();
        for (index, part) in parts.iter().enumerate() {
            let first = out.tiles.len();
            let groups = match part.grid {
                Some(_) => grid_groups(part),
                None => mesh_groups(part, rest),
            };
            let counts = groups.iter().fold([0, 0], |[u, v]: [u32; 2], (p, _)| {
                [u.max(p[0] + 1), v.max(p[1] + 1)]
            });
            for (place, cells) in groups {
                let of_cells = || cells.iter().map(|&c| &part.cells[c as usize]);
                let mut hull: Vec<u32> = of_cells().flat_map(|c| c.hull.clone()).collect();
                hull.sort_unstable();
                hull.dedup();
                out.tiles.push(Tile {
                    part: index as u32,
                    corners: of_cells().filter_map(|c| corners(&c.hull)).collect(),
                    own: of_cells().flat_map(|c| c.nodes.clone()).collect(),
                    hull,
                    cells,
                    place,
                });
            }
            out.counts.push(counts);
            out.of_part.push(first..out.tiles.len());
        }
        let mut lists = vec![Vec::new(); rest.len()];
        for (index, tile) in out.tiles.iter().enumerate() {
            for &node in &tile.hull {
                lists[node as usize].push(index as u32);
            }
        }
        for list in lists {
            out.starts.push(out.of_node.len() as u32);
            out.of_node.extend(list);
        }
        out.starts.push(out.of_node.len() as u32);
        out
    }

    pub(crate) fn len(&self) -> usize {
        self.tiles.len()
    }

    /// Tiles that have a node.
    #[inline]
    pub(crate) fn of_node(&self, node: u32) -> &[u32] {
        let n = node as usize;
        &self.of_node[self.starts[n] as usize..self.starts[n + 1] as usize]
    }

    /// Whether two tiles of one part share nodes or are one.
    pub(crate) fn are_adjacent(&self, part: &Part, a: u32, b: u32) -> bool {
        let (a, b) = (&self.tiles[a as usize], &self.tiles[b as usize]);
        let mut du = a.place[0].abs_diff(b.place[0]);
        if part.grid.is_some_and(|grid| grid.is_periodic) {
            du = du.min(self.counts[a.part as usize][0] - du);
        }
        part.grid.is_some() && du <= 1 && a.place[1].abs_diff(b.place[1]) <= 1
    }

    /// Boxes of the ways of all nodes of a part from `reference` to `places`, tile by tile.
    ///
    /// - `rows`: room to work in
    pub(crate) fn measure(
        &self,
        index: usize,
        part: &Part,
        states: [&[Point3<f32>]; 2],
        out: &mut [Extent],
        rows: &mut [Vec<f32>; 2],
    ) {
        vectorized(Measure {
            tiles: self,
            index,
            part,
            states,
            out,
            rows,
        });
    }

    #[inline(always)]
    fn measure_lanes(
        &self,
        index: usize,
        part: &Part,
        [reference, places]: [&[Point3<f32>]; 2],
        out: &mut [Extent],
        rows: &mut [Vec<f32>; 2],
    ) {
        let own = self.of_part[index].clone();
        let Some(grid) = part.grid.filter(|_| !own.is_empty()) else {
            for t in own {
                out[t] = Extent::EMPTY;
                for &node in &self.tiles[t].hull {
                    let n = node as usize;
                    let by = places[n] - reference[n];
                    out[t].take(&[by.x, by.y, by.z]);
                }
            }
            return;
        };
        let columns = grid.u_count as usize;
        let width = 3 * columns;
        let flat = |all: &'_ [Point3<f32>]| -> Range<usize> {
            debug_assert!(all.len() >= (part.first + part.count) as usize);
            3 * part.first as usize..3 * (part.first + part.count) as usize
        };
        let range = flat(reference);
        let reference = &bytemuck::cast_slice::<Point3<f32>, f32>(reference)[range.clone()];
        let places = &bytemuck::cast_slice::<Point3<f32>, f32>(places)[range];
        let [lows, highs] = rows;
        let [tiles_u, tiles_v] = self.counts[index];
        for band in 0..tiles_v {
            let first = (band * GRID_CELLS) as usize;
            let last = ((band + 1) * GRID_CELLS).min(grid.v_count - 1) as usize;
            // First over the rows of the band, all columns beside each other.
            lows.clear();
            lows.resize(width, f32::INFINITY);
            highs.clear();
            highs.resize(width, f32::NEG_INFINITY);
            for row in first..=last {
                let r = &reference[row * width..(row + 1) * width];
                let p = &places[row * width..(row + 1) * width];
                let ends = lows.iter_mut().zip(highs.iter_mut());
                for ((low, high), (p, r)) in ends.zip(p.iter().zip(r)) {
                    let by = p - r;
                    *low = least(*low, by);
                    *high = most(*high, by);
                }
            }
            for u in 0..tiles_u {
                let mut extent = Extent::EMPTY;
                let start = (u * GRID_CELLS) as usize;
                let end = start + GRID_CELLS as usize;
                for column in start..=end {
                    // A ring's last tile ends where the first begins.
                    let c = match column < columns {
                        true => column,
                        false if grid.is_periodic => column - columns,
                        false => break,
                    };
                    for k in 0..3 {
                        extent.low[k] = least(extent.low[k], lows[3 * c + k]);
                        extent.high[k] = most(extent.high[k], highs[3 * c + k]);
                    }
                }
                out[own.start + (band * tiles_u + u) as usize] = extent;
            }
        }
    }
}

struct Measure<'a> {
    tiles: &'a Tiles,
    index: usize,
    part: &'a Part,
    states: [&'a [Point3<f32>]; 2],
    out: &'a mut [Extent],
    rows: &'a mut [Vec<f32>; 2],
}

impl pulp::NullaryFnOnce for Measure<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let tiles = self.tiles;
        tiles.measure_lanes(self.index, self.part, self.states, self.out, self.rows);
    }
}

impl Tile {
    /// The box of its nodes at `places`.
    pub(crate) fn bounds(&self, places: &[Point3<f32>]) -> Extent {
        let mut out = Extent::EMPTY;
        for &n in &self.hull {
            let p = places[n as usize];
            out.take(&[p.x, p.y, p.z]);
        }
        out
    }

    /// The box of the ways of its nodes.
    pub(crate) fn ways(&self, reference: &[Point3<f32>], places: &[Point3<f32>]) -> Extent {
        let mut out = Extent::EMPTY;
        for &n in &self.hull {
            let by = places[n as usize] - reference[n as usize];
            out.take(&[by.x, by.y, by.z]);
        }
        out
    }
}

/// Corners of a cell with this hull as [`Tile::corners`] has them.
fn corners(hull: &[u32]) -> Option<[u32; 4]> {
    match *hull {
        [a, b, c, d] => Some([a, b, c, d]),
        [a, b, c] => Some([a, a, b, c]),
        _ => None,
    }
}

/// Cells of a grid in squares, row after row, with the place of each square.
fn grid_groups(part: &Part) -> Vec<([u32; 2], Vec<u32>)> {
    let Some(grid) = part.grid else {
        return Vec::new();
    };
    let columns = if grid.is_periodic {
        grid.u_count
    } else {
        grid.u_count.saturating_sub(1)
    };
    let rows = grid.v_count.saturating_sub(1);
    let mut groups = Vec::new();
    for v in 0..rows.div_ceil(GRID_CELLS) {
        for u in 0..columns.div_ceil(GRID_CELLS) {
            let along = |at: u32, count: u32| at * GRID_CELLS..((at + 1) * GRID_CELLS).min(count);
            let cells = along(v, rows)
                .flat_map(|row| along(u, columns).map(move |column| row * columns + column));
            groups.push(([u, v], cells.collect()));
        }
    }
    groups
}

/// Triangles of a mesh that lie beside each other.
fn mesh_groups(part: &Part, rest: &[Point3<f32>]) -> Vec<([u32; 2], Vec<u32>)> {
    let center = |cell: &super::mesh::Cell| -> Vector {
        let nodes = cell.hull.iter();
        let sum: Vector = nodes.map(|&n| rest[n as usize].coords.cast::<f64>()).sum();
        sum / cell.hull.len().max(1) as f64
    };
    let centers: Vec<Vector> = part.cells.iter().map(center).collect();
    let groups = Tree::of_centers(&centers).clusters(MESH_CELLS);
    (0..).map(|k| [k, 0]).zip(groups).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::GridShape;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn rows_are_measured_as_nodes_are_one_by_one() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for (u_count, v_count, is_periodic) in [(21, 20, false), (48, 15, true), (7, 3, true)] {
            let shape = GridShape {
                u_count,
                v_count,
                is_periodic,
            };
            let part = Part::of_grid(shape, 0);
            let mut places = || -> Vec<Point3<f32>> {
                let mut at = || random.random_range(-9.0..9.0_f32);
                (0..part.count)
                    .map(|_| Point3::new(at(), at(), at()))
                    .collect()
            };
            let (from, to) = (places(), places());
            let tiles = Tiles::new(std::slice::from_ref(&part), &from);
            let mut out = vec![Extent::EMPTY; tiles.len()];
            let mut rows = [Vec::new(), Vec::new()];
            tiles.measure(0, &part, [&from, &to], &mut out, &mut rows);
            let mut owned = 0;
            for (tile, extent) in tiles.tiles.iter().zip(&out) {
                let ways = tile.ways(&from, &to);
                // A ring that is no multiple of a tile may take a column more.
                assert!(extent.holds(&ways), "{shape:?}");
                assert!(u_count == 7 || *extent == ways, "{shape:?}");
                owned += tile.own.len();
            }
            assert_eq!(owned, part.count as usize, "every node has one owner");
        }
    }
}
