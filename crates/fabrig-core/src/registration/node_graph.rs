//! The coarse level of the template: a few hundred nodes chosen among its vertices, joined
//! along the surface (upper and lower lip are far apart in it), and how each vertex blends the
//! nodes around it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::Point;
use crate::mesh::Topology;

/// Nodes, their edges, and blending weights.
pub(super) struct NodeGraph {
    /// Template vertex of each node.
    pub(super) nodes: Vec<u32>,
    /// Pairs of nodes whose surroundings touch, lower first, sorted.
    pub(super) edges: Vec<(u32, u32)>,
    /// For each vertex: nodes and weights (sum 1).
    pub(super) blends: Vec<Vec<(u32, f64)>>,
}

impl NodeGraph {
    /// Every vertex is a node or within `spacing` steps of one.
    pub(super) fn new(positions: &[Point], topology: &Topology, spacing: u32) -> Self {
        let vertex_count = positions.len();
        let mut is_covered = vec![false; vertex_count];
        let mut nodes = Vec::new();
        for v in 0..vertex_count as u32 {
            if !is_covered[v as usize] {
                nodes.push(v);
                cover(topology, v, spacing, &mut is_covered);
            }
        }
        let owners = nearest_node(positions, topology, &nodes);
        let mut edges: Vec<(u32, u32)> = topology
            .edges()
            .iter()
            .map(|e| {
                let [a, b] = e.vertices.map(|v| owners[v as usize]);
                (a.min(b), a.max(b))
            })
            .filter(|(a, b)| a != b)
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let mut neighbours = vec![Vec::new(); nodes.len()];
        for &(a, b) in &edges {
            neighbours[a as usize].push(b);
            neighbours[b as usize].push(a);
        }
        let blends = (0..vertex_count)
            .map(|v| blend(positions, &nodes, &neighbours, v, owners[v]))
            .collect();
        Self {
            nodes,
            edges,
            blends,
        }
    }
}

fn cover(topology: &Topology, start: u32, steps: u32, is_covered: &mut [bool]) {
    is_covered[start as usize] = true;
    let mut front = vec![start];
    let mut reached = std::collections::BTreeSet::from([start]);
    for _ in 0..steps {
        let mut next = Vec::new();
        for v in front {
            for &n in topology.neighbours(v) {
                if reached.insert(n) {
                    is_covered[n as usize] = true;
                    next.push(n);
                }
            }
        }
        front = next;
    }
}

/// Node nearest to each vertex along edges (Dijkstra from all nodes at once).
fn nearest_node(positions: &[Point], topology: &Topology, nodes: &[u32]) -> Vec<u32> {
    let mut distance = vec![f64::INFINITY; positions.len()];
    let mut owner = vec![0u32; positions.len()];
    let mut queue = BinaryHeap::new();
    for (k, &v) in nodes.iter().enumerate() {
        distance[v as usize] = 0.0;
        owner[v as usize] = k as u32;
        queue.push(Reverse((0u64, v)));
    }
    // Non-negative floats order as their bits do.
    while let Some(Reverse((bits, v))) = queue.pop() {
        let d = f64::from_bits(bits);
        if d > distance[v as usize] {
            continue;
        }
        for &n in topology.neighbours(v) {
            let step = d + (positions[n as usize] - positions[v as usize]).norm();
            if step < distance[n as usize] {
                distance[n as usize] = step;
                owner[n as usize] = owner[v as usize];
                queue.push(Reverse((step.to_bits(), n)));
            }
        }
    }
    owner
}

fn blend(
    positions: &[Point],
    nodes: &[u32],
    neighbours: &[Vec<u32>],
    vertex: usize,
    owner: u32,
) -> Vec<(u32, f64)> {
    let around = &neighbours[owner as usize];
    let mut near: Vec<(u32, f64)> = std::iter::once(&owner)
        .chain(around)
        .map(|&k| {
            let at = positions[nodes[k as usize] as usize];
            (k, (positions[vertex] - at).norm())
        })
        .collect();
    near.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    // The first node left out has weight zero, so weights fade in and out.
    near.truncate(6);
    let reach = near.last().map_or(1.0, |n| n.1).max(f64::MIN_POSITIVE) * 1.0001;
    let mut sum = 0.0;
    for n in &mut near {
        n.1 = (1.0 - n.1 / reach).powi(2);
        sum += n.1;
    }
    if sum <= 0.0 {
        return vec![(owner, 1.0)];
    }
    near.retain(|n| n.1 > 1e-6 * sum);
    let sum: f64 = near.iter().map(|n| n.1).sum();
    for n in &mut near {
        n.1 /= sum;
    }
    near
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_cover_a_strip_and_weights_sum_to_one() {
        let n = 40u32;
        let positions: Vec<Point> = (0..2 * n)
            .map(|v| Point::new(f64::from(v / 2), f64::from(v % 2), 0.0))
            .collect();
        let quads: Vec<[u32; 4]> = (0..n - 1)
            .map(|k| [2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1])
            .collect();
        let topology = Topology::from_faces(2 * n as usize, quads.iter().map(|q| &q[..]));
        let graph = NodeGraph::new(&positions, &topology, 2);
        assert!(graph.nodes.len() > 8 && graph.nodes.len() < 30);
        assert!(graph.edges.len() >= graph.nodes.len() - 1);
        for b in &graph.blends {
            assert!((b.iter().map(|b| b.1).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
