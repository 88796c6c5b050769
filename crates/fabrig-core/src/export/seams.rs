//! Vertices split where texture coordinates differ: glTF has one of each a vertex.

use std::collections::HashMap;

use crate::mesh::{CornerUvs, Polygons};

/// The vertices of a mesh with one texture coordinate each.
///
/// The first `vertex_count` are the mesh's own, in order; those that a seam needs besides
/// follow them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SplitVertices {
    /// The mesh's vertex that each is.
    pub(super) vertex_of: Vec<u32>,
    /// Texture coordinates from the lower left; none where the mesh has none.
    pub(super) uvs: Option<Vec<[f32; 2]>>,
    /// Split vertex of each corner of the polygons.
    pub(super) corners: Vec<u32>,
}

impl SplitVertices {
    pub(super) fn new(vertex_count: usize, polygons: &Polygons, uvs: Option<&CornerUvs>) -> Self {
        let mut vertex_of: Vec<u32> = (0..vertex_count as u32).collect();
        let Some(uvs) = uvs else {
            return Self {
                vertex_of,
                uvs: None,
                corners: polygons.corners().to_vec(),
            };
        };
        // By value: equal coordinates under two numbers are no seam.
        let bits = |uv: u32| uvs.coordinates[uv as usize].map(f32::to_bits);
        let mut first: Vec<Option<u32>> = vec![None; vertex_count];
        let mut others: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
        let mut uv_of = vec![0; vertex_count];
        let pairs = polygons.corners().iter().zip(&uvs.corners);
        let corners = pairs
            .map(|(&vertex, &uv)| match first[vertex as usize] {
                None => {
                    first[vertex as usize] = Some(uv);
                    uv_of[vertex as usize] = uv;
                    vertex
                }
                Some(own) if bits(own) == bits(uv) => vertex,
                Some(_) => *others.entry((vertex, bits(uv))).or_insert_with(|| {
                    vertex_of.push(vertex);
                    uv_of.push(uv);
                    vertex_of.len() as u32 - 1
                }),
            })
            .collect();
        let uvs = uv_of.iter().map(|&uv| uvs.coordinates[uv as usize]);
        Self {
            uvs: Some(uvs.collect()),
            vertex_of,
            corners,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seams_alone_split_and_vertices_keep_their_numbers() {
        let polygons = Polygons::from_faces([[0u32, 1, 2], [2, 1, 3], [3, 1, 4]]);
        let uvs = CornerUvs {
            // 3 repeats 1 by value.
            coordinates: vec![[0.0, 0.0], [1.0, 0.0], [0.5, 1.0], [1.0, 0.0], [0.9, 0.9]],
            corners: vec![0, 1, 2, 2, 3, 0, 0, 4, 2],
        };
        let split = SplitVertices::new(6, &polygons, Some(&uvs));
        assert_eq!(split.vertex_of, [0, 1, 2, 3, 4, 5, 1]);
        assert_eq!(split.corners, [0, 1, 2, 2, 1, 3, 3, 6, 4]);
        assert_eq!(split.uvs.unwrap()[6], [0.9, 0.9]);
    }
}
