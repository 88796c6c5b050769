/// What can go wrong when shapes are put on a face.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TransferError {
    /// A weight is NaN or infinite.
    #[error("weight {shape} is not a finite number: {value}")]
    WeightNotFinite {
        /// Index of the shape.
        shape: usize,
        /// Its value.
        value: f32,
    },
    /// The list of weights does not fit the rig.
    #[error("expected {expected} weights, one per shape of the template, got {found}")]
    WeightCount {
        /// Shapes that the template has.
        expected: usize,
        /// Weights given.
        found: usize,
    },
    /// The buffer for targets does not fit the rig.
    #[error("expected buffers for {expected} patches, got {found}")]
    PatchCount {
        /// Patches that the rig has.
        expected: usize,
        /// Buffers given.
        found: usize,
    },
    /// A chart's node lies on a triangle that the template does not have.
    #[error(
        "patch {patch}, node {node} lies on triangle {triangle}, but the template has \
         {triangle_count} triangles"
    )]
    NodeOutOfRange {
        /// Name of the patch.
        patch: String,
        /// Index of the node.
        node: usize,
        /// The triangle it names.
        triangle: u32,
        /// Triangles that the template's skin has.
        triangle_count: usize,
    },
    /// A face's positions do not have the template's topology.
    #[error("expected {expected} positions in the template's order, got {found}")]
    PositionCount {
        /// The template's skin vertices.
        expected: usize,
        /// Positions given.
        found: usize,
    },
    /// Deformation transfer has no answer on this face.
    #[error(
        "deformation transfer onto this face could not be solved ({unknowns} unknowns): its \
         normalized mesh has degenerate triangles; use another offset mode, or look at the \
         registration report"
    )]
    Unsolvable {
        /// Vertices that are free to move.
        unknowns: usize,
    },
    /// An example expression does not fit the template.
    #[error("example {name}: {reason}")]
    Example {
        /// Its name.
        name: String,
        /// What is wrong.
        reason: String,
    },
}
