use std::path::PathBuf;

/// What can be wrong with edits.
#[derive(Debug, thiserror::Error)]
pub enum EditError {
    /// The file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
    /// The text is not of the form that is read.
    #[error("the edits do not parse: {message}")]
    Syntax {
        /// What the parser says, with the line.
        message: String,
    },
    /// A name is not known.
    #[error("the rig has no {what} '{found}' (nearest: '{nearest}')")]
    UnknownName {
        /// `muscle shape`, `patch` or `material`.
        what: &'static str,
        /// The name.
        found: String,
        /// The most similar one that there is.
        nearest: String,
    },
    /// There is no such preset.
    #[error("there is no preset '{found}' (nearest: '{nearest}'); there are: {known}")]
    UnknownPreset {
        /// The name.
        found: String,
        /// The most similar one that there is.
        nearest: String,
        /// All that there are.
        known: String,
    },
    /// Only fat has a thickness.
    #[error("{name}: only fat pads have a thickness; give its muscle shapes a strength instead")]
    NoPad {
        /// The patch.
        name: String,
    },
    /// A number is not one that can be used.
    #[error("{name}: {what} is {value}; it must be {condition}")]
    OutOfRange {
        /// Whose number.
        name: String,
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What it should be.
        condition: &'static str,
    },
    /// A node is not there.
    #[error("{name}: node {node} is moved, but the patch has {node_count} nodes, from 0")]
    NodeOutOfRange {
        /// The muscle shape.
        name: String,
        /// The node.
        node: String,
        /// How many there are.
        node_count: usize,
    },
    /// A mesh is not the patch's.
    #[error(
        "{name}: the mesh has {found} vertices, the patch has {expected} nodes; keep number and \
         order of the exported vertices"
    )]
    VertexCount {
        /// The muscle shape.
        name: String,
        /// Nodes of the patch.
        expected: usize,
        /// Vertices of the mesh.
        found: usize,
    },
    /// A wrinkle map cannot be used.
    #[error("wrinkle map {}: {problem}", path.display())]
    WrinkleMap {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and what to do.
        problem: String,
    },
    /// Materials do not come out valid.
    #[error("the edited materials are not valid")]
    Materials(#[from] crate::cloth::MaterialError),
    /// A patch is no surface that skin could hang on.
    #[error(transparent)]
    Surface(#[from] crate::mesh::SurfaceError),
    /// The skin does not fit the rig.
    #[error(transparent)]
    Skin(#[from] crate::skin::SkinError),
    /// A mesh could not be built.
    #[error(transparent)]
    Mesh(#[from] crate::mesh::MeshError),
}
