use std::path::PathBuf;

use crate::mesh::io::MeshIoError;

/// What can go wrong when the materials of a mesh are read.
#[derive(Debug, thiserror::Error)]
pub enum AppearanceError {
    /// The file holds another mesh than the one that is to look like it.
    #[error(
        "{}: {what} of the rig's face and this file differ ({expected} and {found}): give the very \
         mesh that the rig was made from",
        path.display()
    )]
    OtherMesh {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: &'static str,
        /// The mesh's.
        expected: usize,
        /// The file's.
        found: usize,
    },
    /// The materials cannot be read.
    #[error("the materials of {} cannot be read: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// What is stored does not hold together.
    #[error("{what} {index} names {kind} {found}, but there are {count}")]
    IndexOutOfRange {
        /// What names it.
        what: &'static str,
        /// Which one of them, from 0.
        index: usize,
        /// What is named.
        kind: &'static str,
        /// The number that is named, from 0.
        found: usize,
        /// How many there are.
        count: usize,
    },
    /// There is not one material per polygon.
    #[error("expected {expected} material numbers, one per polygon, got {found}")]
    PolygonCount {
        /// Polygons of the mesh.
        expected: usize,
        /// Numbers that there are.
        found: usize,
    },
    /// The mesh in the file cannot be read.
    #[error(transparent)]
    MeshIo(#[from] MeshIoError),
}
