//! Meshes whose files hold shapes beside them: glTF's morph targets.

use std::path::Path;

use super::{MeshIoError, read};
use crate::mesh::Mesh;
use crate::{Point, Vector};

/// A shape that a mesh file holds: how its vertices move at weight 1.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshShape {
    /// Name in the file.
    pub name: String,
    /// Vertices that move and their displacements, in the mesh's units, rising.
    pub deltas: Vec<(u32, Vector)>,
}

impl MeshShape {
    /// The mesh's vertices at weight 1, in its units.
    ///
    /// # Panics
    ///
    /// If `rest` is not the mesh that the shape was read with.
    pub fn positions(&self, rest: &Mesh) -> Vec<Point> {
        let mut positions = rest.positions().to_vec();
        for &(vertex, delta) in &self.deltas {
            positions[vertex as usize] += delta;
        }
        positions
    }
}

/// A mesh with the shapes that its file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshWithShapes {
    /// The mesh, all weights zero.
    pub mesh: Mesh,
    /// Its shapes, in the order of the file; none where the format has no shapes.
    pub shapes: Vec<MeshShape>,
    /// Index of the file's material for each of the mesh's groups, where that is a glTF file's
    /// primitive; none otherwise.
    pub group_materials: Vec<Option<usize>>,
}

impl From<Mesh> for MeshWithShapes {
    fn from(mesh: Mesh) -> Self {
        Self {
            mesh,
            shapes: Vec::new(),
            group_materials: Vec::new(),
        }
    }
}

/// Reads a mesh file as [`super::read_mesh`] does, with its shapes: morph targets of glTF.
///
/// Memory stays in proportion to the file, however often that names the same data.
///
/// # Errors
///
/// See [`super::read_mesh`].
pub fn read_mesh_with_shapes(path: impl AsRef<Path>) -> Result<MeshWithShapes, MeshIoError> {
    read::read(path.as_ref())
}
