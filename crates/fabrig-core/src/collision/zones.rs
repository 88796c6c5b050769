//! Zones: nodes that block each other whatever share of their way they go, and so go it together.
//!
//! Sheets that lie on each other to a micrometre can hardly move against each other in a pass that
//! takes them a hundred times as far. Held where they are, they would stay there while the face
//! moves on. A zone goes the mean way of its nodes instead, all of them the same: nothing in it
//! comes nearer to anything else in it.
//!
//! Source: Bridson, Fedkiw & Anderson 2002, *Robust treatment of collisions, contact and friction
//! for cloth animation*, section 7.5 (rigid impact zones, after Provot 1997); without rotation,
//! which the passes are too short for.

use nalgebra::{Point3, Vector3};

/// A way is a multiple of this: added to positions within 256 mm it is not rounded, so that all of
/// a zone go exactly alike. (mm)
const GRAIN: f32 = 1.0 / 65_536.0;

/// No zone.
const NONE: u32 = u32::MAX;

/// Zones of a pass.
#[derive(Debug, Default)]
pub(super) struct Zones {
    /// Zone of each node, or [`NONE`].
    of_node: Vec<u32>,
    /// Nodes of each; none of those that were joined to another.
    members: Vec<Vec<u32>>,
    /// Where nodes were wanted before any was held back. (mm)
    hoped: Vec<Point3<f32>>,
}

impl Zones {
    /// Starts a pass of nodes that are wanted at `wanted` (mm).
    pub(super) fn begin(&mut self, wanted: &[Point3<f32>]) {
        self.of_node.clear();
        self.of_node.resize(wanted.len(), NONE);
        self.members.clear();
        self.hoped.clear();
        self.hoped.extend_from_slice(wanted);
    }

    /// Joins nodes, with the zones that they are in. Returns whether they were not yet joined.
    pub(super) fn join(&mut self, nodes: &[u32]) -> bool {
        let zones = nodes.iter().map(|&n| self.of_node[n as usize]);
        let largest = zones
            .filter(|&z| z != NONE)
            .max_by_key(|&z| self.members[z as usize].len());
        let zone = largest.unwrap_or_else(|| {
            self.members.push(Vec::new());
            self.members.len() as u32 - 1
        });
        let mut is_new = false;
        for &node in nodes {
            let other = self.of_node[node as usize];
            if other == zone {
                continue;
            }
            is_new = true;
            let joining = if other == NONE {
                vec![node]
            } else {
                std::mem::take(&mut self.members[other as usize])
            };
            for &node in &joining {
                self.of_node[node as usize] = zone;
            }
            self.members[zone as usize].extend(joining);
        }
        is_new
    }

    /// For each zone its nodes and the way that they go. (mm)
    ///
    /// - `positions`: where they are (mm)
    pub(super) fn ways<'a>(
        &'a self,
        positions: &'a [Point3<f32>],
    ) -> impl Iterator<Item = (&'a [u32], Vector3<f32>)> {
        self.members.iter().filter(|m| !m.is_empty()).map(|nodes| {
            let way = |&n: &u32| (self.hoped[n as usize] - positions[n as usize]).cast::<f64>();
            let sum: Vector3<f64> = nodes.iter().map(way).sum();
            let mean = (sum / nodes.len() as f64).cast::<f32>();
            (nodes.as_slice(), mean.map(|x| (x / GRAIN).round() * GRAIN))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_nodes_go_the_mean_way_exactly_alike() {
        let positions: Vec<_> = (0..6)
            .map(|k| Point3::new(64.0 + k as f32 * 1e-5, -61.9 + k as f32, 0.1 * k as f32))
            .collect();
        let wanted: Vec<_> = positions
            .iter()
            .enumerate()
            .map(|(k, p)| p + Vector3::new(0.1 * k as f32, -0.3, 0.0))
            .collect();
        let mut zones = Zones::default();
        zones.begin(&wanted);
        assert!(zones.join(&[0, 1]));
        assert!(zones.join(&[3, 4]));
        assert!(!zones.join(&[1, 0]));
        assert!(zones.join(&[4, 1]));
        let ways: Vec<_> = zones.ways(&positions).collect();
        assert_eq!(ways.len(), 1);
        let (nodes, way) = &ways[0];
        assert_eq!(nodes.len(), 4);
        // The mean of 0, 1, 3 and 4.
        assert!((way - Vector3::new(0.2, -0.3, 0.0)).norm() < 1e-4, "{way}");
        for &n in *nodes {
            let p = positions[n as usize];
            let gone = (p + way).cast::<f64>() - p.cast::<f64>();
            assert_eq!(gone, way.cast::<f64>());
        }
    }
}
