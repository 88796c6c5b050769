//! What can go wrong on the way out.

use std::io;
use std::path::PathBuf;

use crate::mesh::MeshError;
use crate::mesh::appearance::AppearanceError;
use crate::mesh::io::MeshIoError;
use crate::recording::RecordingError;
use crate::scene::SceneError;

/// A face could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The output names no format that is known here.
    #[error(
        "{}: '{extension}' is no format to export to (known: .glb, .gltf, .usda, .npz, .pc2, .mdd, \
         or a folder for OBJ files)",
        path.display()
    )]
    UnknownFormat {
        /// The output.
        path: PathBuf,
        /// Its extension, without the dot.
        extension: String,
    },
    /// A format that holds moving points alone was asked for without motion.
    #[error("{}: {format} holds moving points: give a take (`--motion TAKE`)", path.display())]
    NoMotion {
        /// The output.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
    },
    /// The file cannot be written.
    #[error("cannot write {}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: io::Error,
    },
    /// The format's own length fields cannot hold so much.
    #[error(
        "{}: {bytes} bytes are more than {format} can hold; export fewer frames or as .gltf or .npz",
        path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Bytes it would have.
        bytes: u64,
        /// Name of the format.
        format: &'static str,
    },
    /// The materials of the source mesh cannot be read, or belong to another mesh.
    #[error(transparent)]
    Appearance(#[from] AppearanceError),
    /// A frame rate or a number of components that cannot be.
    #[error("{name} must be {expected}, got {found}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// The recording holds no skin to convert.
    #[error(
        "{}: the recording holds {frames} frames with a skin mesh; record it with `--skin-hz` above 0",
        path.display()
    )]
    NoSkin {
        /// The recording.
        path: PathBuf,
        /// Frames that have one.
        frames: usize,
    },
    /// The skin of a recording does not have the vertices it is said to have.
    #[error("{}: the skin has {found} vertices where {expected} are expected", path.display())]
    VertexCount {
        /// The recording.
        path: PathBuf,
        /// What the rig or the first frame has.
        expected: usize,
        /// What a frame has.
        found: usize,
    },
    /// The caller stopped it.
    #[error("stopped; nothing was written")]
    Stopped,
    /// The rig does not fit its scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A mesh cannot be written.
    #[error(transparent)]
    MeshIo(#[from] MeshIoError),
    /// Vertices came out that are not numbers.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

impl ExportError {
    /// For `map_err` where a file is written.
    pub(super) fn io(path: &std::path::Path) -> impl Fn(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io {
            path: path.clone(),
            source,
        }
    }
}
