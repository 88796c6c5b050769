//! A mesh of polygons with shared vertices, validated at construction.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::Point;

/// What can be wrong with a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// There is nothing to work on.
    #[error("the mesh has {vertex_count} vertices and {face_count} faces; a face needs both")]
    Empty {
        /// How many vertices there are.
        vertex_count: usize,
        /// How many faces there are.
        face_count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} has a coordinate that is not a finite number: ({x}, {y}, {z})")]
    NotFinite {
        /// Index of the vertex, from 0.
        vertex: usize,
        /// Its x.
        x: f64,
        /// Its y.
        y: f64,
        /// Its z.
        z: f64,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} references vertex {vertex}, but the mesh has {vertex_count} vertices")]
    IndexOutOfRange {
        /// Index of the face, from 0.
        face: usize,
        /// The vertex it names, from 0.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A face has fewer than three corners.
    #[error("face {face} has {corner_count} corners; a face needs at least 3")]
    TooFewCorners {
        /// Index of the face, from 0.
        face: usize,
        /// How many corners it has.
        corner_count: usize,
    },
    /// Texture coordinates do not fit the faces.
    #[error("texture coordinates have {found} corners, but the faces have {expected}")]
    UvCornerCount {
        /// Corners that the faces have.
        expected: usize,
        /// Corners that the texture coordinates have.
        found: usize,
    },
    /// A list of positions does not fit the mesh.
    #[error("expected {expected} positions, one per vertex, got {found}")]
    PositionCount {
        /// The mesh's vertex count.
        expected: usize,
        /// Positions given.
        found: usize,
    },
}

/// Polygons as one list of corners and the places where each polygon starts.
///
/// Corners run counter-clockwise seen from outside.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Polygons {
    /// Start of each polygon in `corners`, and one past the end; length = polygons + 1.
    starts: Vec<u32>,
    /// Vertex index of each corner.
    corners: Vec<u32>,
}

impl Polygons {
    /// No polygons.
    pub fn new() -> Self {
        Self {
            starts: vec![0],
            corners: Vec::new(),
        }
    }

    /// From slices of vertex indices, one a polygon.
    pub fn from_faces<F: AsRef<[u32]>>(faces: impl IntoIterator<Item = F>) -> Self {
        let mut polygons = Self::new();
        for face in faces {
            polygons.push(face.as_ref());
        }
        polygons
    }

    /// Appends one polygon.
    pub fn push(&mut self, corners: &[u32]) {
        if self.starts.is_empty() {
            self.starts.push(0);
        }
        self.corners.extend_from_slice(corners);
        self.starts.push(self.corners.len() as u32);
    }

    /// How many polygons there are.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Vertex indices of one polygon.
    pub fn face(&self, face: usize) -> &[u32] {
        &self.corners[self.corner_range(face)]
    }

    /// Where one polygon's corners stand in [`Self::corners`].
    pub fn corner_range(&self, face: usize) -> Range<usize> {
        self.starts[face] as usize..self.starts[face + 1] as usize
    }

    /// All corners, polygon after polygon.
    pub fn corners(&self) -> &[u32] {
        &self.corners
    }

    /// Every polygon in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[u32]> + '_ {
        (0..self.len()).map(|face| self.face(face))
    }

    /// Fans of triangles, polygon after polygon: (0,1,2), (0,2,3), ...
    ///
    /// The split depends on corner order alone, so it is stable under deformation.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let mut triangles = Vec::with_capacity(self.corners.len());
        for face in self.iter() {
            for k in 1..face.len().saturating_sub(1) {
                triangles.push([face[0], face[k], face[k + 1]]);
            }
        }
        triangles
    }
}

/// Texture coordinates per corner, as OBJ and USD keep them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CornerUvs {
    /// Distinct coordinates, origin at the lower left.
    pub coordinates: Vec<[f32; 2]>,
    /// Index into `coordinates` for each corner of the polygons, in corner order.
    pub corners: Vec<u32>,
}

/// A named run of polygons (an object, group or material of the file).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FaceGroup {
    /// Name in the file.
    pub name: String,
    /// Polygons that belong to it.
    pub faces: Range<usize>,
}

/// A polygon mesh whose indices and coordinates have been checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    positions: Vec<Point>,
    polygons: Polygons,
    uvs: Option<CornerUvs>,
    groups: Vec<FaceGroup>,
}

impl Mesh {
    /// Checks and takes positions (any unit, shape [vertex_count, 3]) and polygons.
    ///
    /// # Errors
    ///
    /// [`MeshError`] when there is nothing in it, a coordinate is not finite, a face has fewer
    /// than three corners or names a vertex that does not exist.
    pub fn new(positions: Vec<Point>, polygons: Polygons) -> Result<Self, MeshError> {
        if positions.is_empty() || polygons.is_empty() {
            return Err(MeshError::Empty {
                vertex_count: positions.len(),
                face_count: polygons.len(),
            });
        }
        check_finite(&positions)?;
        for (face, corners) in polygons.iter().enumerate() {
            if corners.len() < 3 {
                return Err(MeshError::TooFewCorners {
                    face,
                    corner_count: corners.len(),
                });
            }
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= positions.len()) {
                return Err(MeshError::IndexOutOfRange {
                    face,
                    vertex,
                    vertex_count: positions.len(),
                });
            }
        }
        Ok(Self {
            positions,
            polygons,
            uvs: None,
            groups: Vec::new(),
        })
    }

    /// From triangles instead of polygons; see [`Self::new`].
    pub fn from_triangles(
        positions: Vec<Point>,
        triangles: &[[u32; 3]],
    ) -> Result<Self, MeshError> {
        Self::new(positions, Polygons::from_faces(triangles))
    }

    /// Adds texture coordinates.
    pub fn with_uvs(mut self, uvs: CornerUvs) -> Result<Self, MeshError> {
        let expected = self.polygons.corners().len();
        if uvs.corners.len() != expected {
            return Err(MeshError::UvCornerCount {
                expected,
                found: uvs.corners.len(),
            });
        }
        self.uvs = Some(uvs);
        Ok(self)
    }

    /// Adds the file's named groups.
    pub fn with_groups(mut self, groups: Vec<FaceGroup>) -> Self {
        self.groups = groups;
        self
    }

    /// The same topology at other positions.
    pub fn with_positions(&self, positions: Vec<Point>) -> Result<Self, MeshError> {
        if positions.len() != self.positions.len() {
            return Err(MeshError::PositionCount {
                expected: self.positions.len(),
                found: positions.len(),
            });
        }
        check_finite(&positions)?;
        Ok(Self {
            positions,
            ..self.clone()
        })
    }

    /// Vertex positions, shape [vertex_count, 3].
    pub fn positions(&self) -> &[Point] {
        &self.positions
    }

    /// Polygons, counter-clockwise seen from outside.
    pub fn polygons(&self) -> &Polygons {
        &self.polygons
    }

    /// Texture coordinates, where the file had them.
    pub fn uvs(&self) -> Option<&CornerUvs> {
        self.uvs.as_ref()
    }

    /// Named runs of polygons, where the file had them.
    pub fn groups(&self) -> &[FaceGroup] {
        &self.groups
    }

    /// How many vertices there are.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// How many polygons there are.
    pub fn face_count(&self) -> usize {
        self.polygons.len()
    }

    /// See [`Polygons::triangles`].
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        self.polygons.triangles()
    }
}

fn check_finite(positions: &[Point]) -> Result<(), MeshError> {
    match positions
        .iter()
        .position(|p| !p.iter().all(|c| c.is_finite()))
    {
        None => Ok(()),
        Some(vertex) => {
            let p = positions[vertex];
            Err(MeshError::NotFinite {
                vertex,
                x: p.x,
                y: p.y,
                z: p.z,
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quad_splits_into_a_fan() {
        let polygons = Polygons::from_faces([[0u32, 1, 2, 3]]);
        assert_eq!(polygons.triangles(), vec![[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn bad_meshes_are_refused_with_the_place() {
        let p = vec![Point::origin(); 3];
        assert_eq!(
            Mesh::from_triangles(p.clone(), &[[0, 1, 3]]),
            Err(MeshError::IndexOutOfRange {
                face: 0,
                vertex: 3,
                vertex_count: 3
            })
        );
        let mut q = p.clone();
        q[1].y = f64::NAN;
        assert!(matches!(
            Mesh::from_triangles(q, &[[0, 1, 2]]),
            Err(MeshError::NotFinite { vertex: 1, .. })
        ));
        assert!(matches!(
            Mesh::from_triangles(p, &[]),
            Err(MeshError::Empty { .. })
        ));
    }
}
