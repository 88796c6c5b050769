//! Edges, neighbours and boundary loops of a mesh, from its faces alone.

use super::Mesh;

/// An undirected edge and the faces at it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// Its ends, lower index first.
    pub vertices: [u32; 2],
    /// First two faces at it, lower index first; `u32::MAX` where there is none.
    pub faces: [u32; 2],
    /// How many faces there are: 1 on a boundary, more than 2 where it is not manifold.
    pub face_count: u32,
    /// Whether two faces run along it in the same direction: they are oriented against each
    /// other (or it is not manifold).
    pub has_flip: bool,
}

/// Every edge of some triangles once, lower vertex first, rising.
pub fn triangle_edges(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Edges, neighbours and boundary loops.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topology {
    edges: Vec<Edge>,
    neighbour_starts: Vec<u32>,
    neighbours: Vec<u32>,
    boundary_half_edges: Vec<[u32; 2]>,
    vertex_count: usize,
}

impl Topology {
    /// From faces given as vertex indices below `vertex_count`.
    pub fn from_faces<'a>(vertex_count: usize, faces: impl IntoIterator<Item = &'a [u32]>) -> Self {
        // (low, high, face, runs low -> high)
        let mut half_edges: Vec<(u32, u32, u32, bool)> = Vec::new();
        for (face, corners) in faces.into_iter().enumerate() {
            for (k, &a) in corners.iter().enumerate() {
                let b = corners[(k + 1) % corners.len()];
                if a != b {
                    half_edges.push((a.min(b), a.max(b), face as u32, a < b));
                }
            }
        }
        half_edges.sort_unstable();

        let mut edges = Vec::with_capacity(half_edges.len() / 2 + 1);
        let mut boundary_half_edges = Vec::new();
        for group in half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (low, high, first, forward) = group[0];
            let forward_count = group.iter().filter(|h| h.3).count();
            edges.push(Edge {
                vertices: [low, high],
                faces: [first, group.get(1).map_or(u32::MAX, |h| h.2)],
                face_count: group.len() as u32,
                has_flip: forward_count > 1 || group.len() - forward_count > 1,
            });
            if group.len() == 1 {
                boundary_half_edges.push(if forward { [low, high] } else { [high, low] });
            }
        }
        boundary_half_edges.sort_unstable();

        let mut neighbour_starts = vec![0u32; vertex_count + 1];
        for e in &edges {
            for v in e.vertices {
                neighbour_starts[v as usize + 1] += 1;
            }
        }
        for v in 0..vertex_count {
            neighbour_starts[v + 1] += neighbour_starts[v];
        }
        let mut cursor = neighbour_starts.clone();
        let mut neighbours = vec![0u32; edges.len() * 2];
        for e in &edges {
            let [a, b] = e.vertices;
            neighbours[cursor[a as usize] as usize] = b;
            cursor[a as usize] += 1;
            neighbours[cursor[b as usize] as usize] = a;
            cursor[b as usize] += 1;
        }
        for v in 0..vertex_count {
            neighbours[neighbour_starts[v] as usize..neighbour_starts[v + 1] as usize]
                .sort_unstable();
        }
        Self {
            edges,
            neighbour_starts,
            neighbours,
            boundary_half_edges,
            vertex_count,
        }
    }

    /// From triangles with vertex indices below `vertex_count`.
    pub fn from_triangles(vertex_count: usize, triangles: &[[u32; 3]]) -> Self {
        Self::from_faces(vertex_count, triangles.iter().map(|t| &t[..]))
    }

    /// From a mesh's polygons: a quad's diagonal is no edge.
    pub fn from_mesh(mesh: &Mesh) -> Self {
        Self::from_faces(mesh.vertex_count(), mesh.polygons().iter())
    }

    /// How many vertices there are.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Edges, sorted by their vertices.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The edge between two vertices.
    pub fn edge_between(&self, a: u32, b: u32) -> Option<usize> {
        let key = [a.min(b), a.max(b)];
        self.edges.binary_search_by_key(&key, |e| e.vertices).ok()
    }

    /// Vertices joined to `vertex` by an edge, rising.
    pub fn neighbours(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.neighbours[self.neighbour_starts[v] as usize..self.neighbour_starts[v + 1] as usize]
    }

    /// Whether each vertex lies on a boundary edge.
    pub fn boundary_mask(&self) -> Vec<bool> {
        let mut mask = vec![false; self.vertex_count];
        for h in &self.boundary_half_edges {
            mask[h[0] as usize] = true;
            mask[h[1] as usize] = true;
        }
        mask
    }

    /// Closed chains of boundary edges, in the direction of their faces (the surface lies on
    /// the left, seen from outside), each from its lowest vertex on.
    ///
    /// Where boundaries touch in one vertex the chain leaves it by its lowest unused edge.
    /// Chains that do not close (inconsistent orientation) are left out.
    pub fn boundary_loops(&self) -> Vec<Vec<u32>> {
        let half_edges = &self.boundary_half_edges;
        let mut is_used = vec![false; half_edges.len()];
        let mut loops = Vec::new();
        for start in 0..half_edges.len() {
            if is_used[start] {
                continue;
            }
            is_used[start] = true;
            let mut chain = vec![half_edges[start][0]];
            let mut at = half_edges[start][1];
            while at != chain[0] {
                chain.push(at);
                let first = half_edges.partition_point(|h| h[0] < at);
                let Some(next) = (first..half_edges.len())
                    .take_while(|&i| half_edges[i][0] == at)
                    .find(|&i| !is_used[i])
                else {
                    chain.clear();
                    break;
                };
                is_used[next] = true;
                at = half_edges[next][1];
            }
            if chain.len() > 2 {
                loops.push(chain);
            }
        }
        loops
    }

    /// Every vertex reached from `seeds` in at most `steps` edges, with its step count;
    /// `u32::MAX` where it is not reached.
    pub fn rings(&self, seeds: &[u32], steps: u32) -> Vec<u32> {
        let mut distance = vec![u32::MAX; self.vertex_count];
        let mut front: Vec<u32> = seeds.to_vec();
        for &s in seeds {
            distance[s as usize] = 0;
        }
        for step in 1..=steps {
            let mut next = Vec::new();
            for &v in &front {
                for &n in self.neighbours(v) {
                    if distance[n as usize] == u32::MAX {
                        distance[n as usize] = step;
                        next.push(n);
                    }
                }
            }
            if next.is_empty() {
                break;
            }
            front = next;
        }
        distance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid_with_a_hole() -> Vec<[u32; 4]> {
        // 4 x 4 vertices, the middle quad is missing.
        let mut quads = Vec::new();
        for y in 0..3u32 {
            for x in 0..3u32 {
                if (x, y) != (1, 1) {
                    let v = y * 4 + x;
                    quads.push([v, v + 1, v + 5, v + 4]);
                }
            }
        }
        quads
    }

    #[test]
    fn a_grid_with_a_hole_has_two_loops_that_keep_the_surface_on_the_left() {
        let quads = grid_with_a_hole();
        let topology = Topology::from_faces(16, quads.iter().map(|q| &q[..]));
        let loops = topology.boundary_loops();
        assert_eq!(loops.len(), 2);
        assert_eq!(loops[0], vec![0, 1, 2, 3, 7, 11, 15, 14, 13, 12, 8, 4]);
        assert_eq!(loops[1], vec![5, 9, 10, 6]);
        assert_eq!(topology.edges().len(), 24);
        assert_eq!(topology.neighbours(5), &[1, 4, 6, 9]);
        assert!(topology.boundary_mask().iter().all(|&b| b));
        assert!(topology.edges().iter().all(|e| !e.has_flip));
        assert_eq!(topology.rings(&[0], 2)[5], 2);
    }

    #[test]
    fn a_flipped_triangle_is_seen_at_the_shared_edge() {
        let topology = Topology::from_triangles(4, &[[0, 1, 2], [1, 2, 3]]);
        let e = topology.edge_between(2, 1).expect("shared edge");
        assert!(topology.edges()[e].has_flip);
        assert_eq!(topology.edges()[e].faces, [0, 1]);
    }
}
