//! Corrections of single vertices, spread smoothly over the skin around them.
//!
//! `d(v) = sum_c K(g(v, c)) e_c / max(1, sum_c K(g(v, c)))` with the kernel of [`super::kernel`]
//! over the way `g` along edges at rest: what one place needs moves its surroundings less and
//! less, and never skin that is only near in space, such as the other lip.

use std::collections::{BTreeMap, BinaryHeap};

use nalgebra::{Point3, Vector3};

use super::kernel;
use crate::mesh::Topology;

/// Corrections nearer to an earlier one than this share of the width are carried by it: dense
/// meshes would spread thousands of the same.
const SPACING: f32 = 0.25;

/// Edges of a skin with their lengths at rest.
#[derive(Debug, Clone)]
pub struct SkinSpreader {
    starts: Vec<u32>,
    /// Other end and length (mm).
    ways: Vec<(u32, f32)>,
    /// Ways from the place that is being spread, and whether a correction carries the vertex.
    reached: BTreeMap<u32, f32>,
}

impl SkinSpreader {
    /// - `rest`: skin at rest (mm); `triangles`: of the skin, without rigid parts
    pub fn new(rest: &[Point3<f32>], triangles: &[[u32; 3]]) -> Self {
        let topology = Topology::from_triangles(rest.len(), triangles);
        let mut starts = vec![0];
        let mut ways = Vec::new();
        for (v, p) in (0u32..).zip(rest) {
            let around = topology.neighbours(v).iter();
            ways.extend(around.map(|&n| (n, (rest[n as usize] - p).norm())));
            starts.push(ways.len() as u32);
        }
        Self {
            starts,
            ways,
            reached: BTreeMap::new(),
        }
    }

    /// Moves skin so that each vertex in `corrections` goes about as far as it asks, and skin
    /// within `width` (mm) of it goes along. Returns how many vertices moved.
    ///
    /// - `corrections`: by vertex (mm)
    pub fn spread(
        &mut self,
        corrections: &BTreeMap<u32, Vector3<f32>>,
        width: f32,
        skin: &mut [Point3<f32>],
    ) -> usize {
        let mut sums: BTreeMap<u32, (f32, Vector3<f32>)> = BTreeMap::new();
        let mut is_carried = std::collections::BTreeSet::new();
        for (&vertex, correction) in corrections {
            if is_carried.contains(&vertex) {
                continue;
            }
            self.reach(vertex, width);
            for (&near, &way) in &self.reached {
                let k = kernel::falloff(f64::from(way), f64::from(width)) as f32;
                let sum = sums.entry(near).or_insert((0.0, Vector3::zeros()));
                sum.0 += k;
                sum.1 += correction * k;
                if way < SPACING * width {
                    is_carried.insert(near);
                }
            }
        }
        for (&vertex, (weight, sum)) in &sums {
            skin[vertex as usize] += sum / weight.max(1.0);
        }
        sums.len()
    }

    /// Shortest ways along edges from a vertex, up to `width`.
    fn reach(&mut self, vertex: u32, width: f32) {
        self.reached.clear();
        // Non-negative floats are ordered as their bits.
        let mut open = BinaryHeap::from([std::cmp::Reverse((0_u32, vertex))]);
        while let Some(std::cmp::Reverse((way, v))) = open.pop() {
            let way = f32::from_bits(way);
            if self.reached.contains_key(&v) {
                continue;
            }
            self.reached.insert(v, way);
            let range = self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize;
            for &(next, length) in &self.ways[range] {
                let further = way + length;
                if further < width && !self.reached.contains_key(&next) {
                    open.push(std::cmp::Reverse((further.to_bits(), next)));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat sheet of one-millimetre cells.
    fn sheet(count: u32) -> (Vec<Point3<f32>>, Vec<[u32; 3]>) {
        let rest = (0..count * count)
            .map(|i| Point3::new((i % count) as f32, (i / count) as f32, 0.0))
            .collect();
        let mut triangles = Vec::new();
        for y in 0..count - 1 {
            for x in 0..count - 1 {
                let a = y * count + x;
                triangles.push([a, a + 1, a + count + 1]);
                triangles.push([a, a + count + 1, a + count]);
            }
        }
        (rest, triangles)
    }

    #[test]
    fn one_correction_becomes_a_smooth_bump() {
        let (rest, triangles) = sheet(21);
        let mut spreader = SkinSpreader::new(&rest, &triangles);
        let mut skin = rest.clone();
        let middle = 10 * 21 + 10;
        let up = Vector3::new(0.0, 0.0, 1.0);
        let moved = spreader.spread(&BTreeMap::from([(middle, up)]), 5.0, &mut skin);
        assert_eq!(moved, skin.iter().filter(|p| p.z > 0.0).count());
        assert!((skin[middle as usize].z - 1.0).abs() < 1e-6);
        let row: Vec<f32> = (0..11).map(|x| skin[10 * 21 + x].z).collect();
        assert!(row.windows(2).all(|w| w[1] >= w[0]), "{row:?}");
        assert_eq!(row[5], 0.0, "no further than the width");
    }

    #[test]
    fn equal_corrections_side_by_side_add_to_no_more_than_one() {
        let (rest, triangles) = sheet(21);
        let mut spreader = SkinSpreader::new(&rest, &triangles);
        let mut skin = rest.clone();
        let up = Vector3::new(0.0, 0.0, 1.0);
        let all = (0..21 * 21).map(|v| (v, up)).collect();
        spreader.spread(&all, 4.0, &mut skin);
        for p in &skin {
            assert!(p.z <= 1.0 + 1e-5 && p.z > 0.9, "{p}");
        }
    }
}
