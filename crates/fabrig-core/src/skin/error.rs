/// What can go wrong when skin is bound or moved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SkinError {
    /// A place on the template names a triangle that is not there.
    #[error(
        "skin vertex {vertex} lies on template triangle {triangle}, but there are {triangle_count}"
    )]
    TriangleOutOfRange {
        /// Index of the skin vertex.
        vertex: usize,
        /// The triangle it names.
        triangle: u32,
        /// Triangles that the template has.
        triangle_count: usize,
    },
    /// A list does not have one entry per skin vertex.
    #[error("expected {expected} entries, one per skin vertex, got {found}")]
    VertexCount {
        /// Skin vertices.
        expected: usize,
        /// Entries given.
        found: usize,
    },
    /// A list of patches does not fit the binding.
    #[error("expected {expected} patches, got {found}")]
    PatchCount {
        /// Patches that the binding was made for.
        expected: usize,
        /// Patches given.
        found: usize,
    },
    /// A patch does not have the nodes the binding was made for.
    #[error("patch {patch}: expected {expected} nodes, got {found}")]
    NodeCount {
        /// Index of the patch.
        patch: usize,
        /// Nodes that the binding was made for.
        expected: usize,
        /// Nodes given.
        found: usize,
    },
}
