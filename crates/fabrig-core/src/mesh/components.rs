//! Connected components of a mesh: vertices joined by faces.

/// Which connected component every vertex belongs to.
///
/// Components are numbered in order of their lowest vertex, so the numbering depends on the
/// mesh alone. A vertex that no face uses is a component of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Components {
    vertex_components: Vec<u32>,
    component_count: usize,
}

impl Components {
    /// Joins the corners of each face; `faces` hold vertex indices below `vertex_count`.
    pub fn from_faces<'a>(vertex_count: usize, faces: impl IntoIterator<Item = &'a [u32]>) -> Self {
        let mut parents: Vec<u32> = (0..vertex_count as u32).collect();
        for face in faces {
            for pair in face.windows(2) {
                let a = root(&mut parents, pair[0]);
                let b = root(&mut parents, pair[1]);
                // The lower index becomes the root, which keeps the numbering stable.
                parents[a.max(b) as usize] = a.min(b);
            }
        }
        let mut numbers = vec![u32::MAX; vertex_count];
        let mut component_count = 0;
        let vertex_components = (0..vertex_count as u32)
            .map(|v| {
                let r = root(&mut parents, v) as usize;
                if numbers[r] == u32::MAX {
                    numbers[r] = component_count;
                    component_count += 1;
                }
                numbers[r]
            })
            .collect();
        Self {
            vertex_components,
            component_count: component_count as usize,
        }
    }

    /// How many components there are.
    pub fn len(&self) -> usize {
        self.component_count
    }

    /// Whether there are no vertices at all.
    pub fn is_empty(&self) -> bool {
        self.component_count == 0
    }

    /// Component of a vertex.
    pub fn of_vertex(&self, vertex: u32) -> u32 {
        self.vertex_components[vertex as usize]
    }

    /// Component of every vertex.
    pub fn vertex_components(&self) -> &[u32] {
        &self.vertex_components
    }

    /// Vertices of every component, rising.
    pub fn vertices(&self) -> Vec<Vec<u32>> {
        let mut lists = vec![Vec::new(); self.component_count];
        for (v, &c) in self.vertex_components.iter().enumerate() {
            lists[c as usize].push(v as u32);
        }
        lists
    }
}

fn root(parents: &mut [u32], mut v: u32) -> u32 {
    while parents[v as usize] != v {
        parents[v as usize] = parents[parents[v as usize] as usize];
        v = parents[v as usize];
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_triangles_and_a_loose_vertex_are_three_components() {
        let faces: [[u32; 3]; 3] = [[5, 4, 6], [0, 2, 1], [2, 1, 0]];
        let c = Components::from_faces(7, faces.iter().map(|f| &f[..]));
        assert_eq!(c.len(), 3);
        assert_eq!(c.vertex_components(), &[0, 0, 0, 1, 2, 2, 2]);
        assert_eq!(c.vertices()[2], vec![4, 5, 6]);
    }
}
