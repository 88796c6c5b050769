use std::path::PathBuf;

use crate::anatomy::AnatomyError;
use crate::mesh::appearance::AppearanceError;
use crate::skin::SkinError;
use crate::transfer::TransferError;

/// What can go wrong when a rig is built, saved or loaded.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The face's positions in the template's topology do not fit the template.
    #[error("expected {expected} normalized positions, one per template vertex, got {found}")]
    PositionCount {
        /// The template's skin vertices.
        expected: usize,
        /// Positions given.
        found: usize,
    },
    /// There is not one place per vertex of the face.
    #[error("expected {expected} places on the template, one per vertex of the face, got {found}")]
    PlaceCount {
        /// Vertices of the face.
        expected: usize,
        /// Places given.
        found: usize,
    },
    /// Patches could not be laid.
    #[error(transparent)]
    Anatomy(#[from] AnatomyError),
    /// Shapes could not be transferred.
    #[error(transparent)]
    Transfer(#[from] TransferError),
    /// The mesh has no surface to carry expressions from.
    #[error(transparent)]
    Surface(#[from] crate::mesh::SurfaceError),
    /// The skin cannot be refined as asked.
    #[error("the skin cannot be refined: {problem}")]
    Refinement {
        /// Why not, and what to give.
        problem: String,
    },
    /// The refined skin is no mesh.
    #[error(transparent)]
    Mesh(#[from] crate::mesh::MeshError),
    /// Skin could not be bound.
    #[error(transparent)]
    Skin(#[from] SkinError),
    /// The file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("not a rig file: it does not start with the mark of one; make one with `fabrig rig`")]
    NotARig,
    /// The file is of a version that this build does not read.
    #[error(
        "the rig file is of format version {found}, this build reads {oldest} to {expected}; make \
         it again with `fabrig rig`"
    )]
    Version {
        /// The oldest that this build reads.
        oldest: u32,
        /// The newest that this build reads, and the one it writes.
        expected: u32,
        /// What the file says.
        found: u32,
    },
    /// The file ends too early, or goes on too long.
    #[error(
        "the rig file has {found} bytes where its header says {expected}: it is cut or damaged"
    )]
    Length {
        /// What the header says.
        expected: u64,
        /// What there is.
        found: u64,
    },
    /// The content is damaged.
    #[error("the rig file is damaged: checksum {found:08x} where its header says {expected:08x}")]
    Checksum {
        /// What the header says.
        expected: u32,
        /// What the content gives.
        found: u32,
    },
    /// Materials could not be read, or those in the file do not hold together.
    #[error(transparent)]
    Appearance(#[from] AppearanceError),
    /// The content cannot be decoded although its checksum is right.
    #[error("the rig file cannot be decoded: {reason}")]
    Content {
        /// What the decoder said.
        reason: String,
    },
}
