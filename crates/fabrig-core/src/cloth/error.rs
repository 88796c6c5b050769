//! What can be wrong with what a cloth is given.

use super::input::NodeVariation;
use super::materials::MaterialError;

/// Why a cloth cannot be made or stepped. Nothing has changed when a step returns one.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ClothError {
    /// A patch has no nodes, or not as many as its grid.
    #[error(
        "patch {patch}: a grid of {u_count} x {v_count} needs {expected} rest positions, got {actual}"
    )]
    NodeCount {
        /// Index of the patch.
        patch: usize,
        /// Columns of its grid.
        u_count: u32,
        /// Rows of its grid.
        v_count: u32,
        /// Nodes of the grid.
        expected: usize,
        /// Rest positions given.
        actual: usize,
    },
    /// A grid has no node, or is periodic with fewer than three columns.
    #[error(
        "patch {patch}: a {kind} grid needs at least {expected} columns and one row, got {u_count} x {v_count}"
    )]
    GridTooSmall {
        /// Index of the patch.
        patch: usize,
        /// `periodic` or `plain`.
        kind: &'static str,
        /// Columns it needs.
        expected: u32,
        /// Columns it has.
        u_count: u32,
        /// Rows it has.
        v_count: u32,
    },
    /// A material's number is out of range.
    #[error("patch {patch}: bad material")]
    Material {
        /// Index of the patch.
        patch: usize,
        /// What is wrong.
        #[source]
        source: MaterialError,
    },
    /// Not one variation per node, or a factor out of its range.
    #[error("patch {patch}: the variation of node {node} is {value:?}; {condition}")]
    Variation {
        /// Index of the patch.
        patch: usize,
        /// Index of the node.
        node: usize,
        /// Its factors, if there are any for it.
        value: Option<NodeVariation>,
        /// What is expected.
        condition: &'static str,
    },
    /// An attachment names a patch or a node that does not exist.
    #[error("patch {patch}: attachment {attachment} names {what} {index}, but there are {count}")]
    AttachmentIndex {
        /// Index of the patch.
        patch: usize,
        /// Index of its attachment.
        attachment: usize,
        /// `patch`, `node` or `other node`.
        what: &'static str,
        /// The index.
        index: u32,
        /// How many there are.
        count: usize,
    },
    /// A patch is attached to itself.
    #[error("patch {patch}: attachment {attachment} holds the patch to itself")]
    SelfAttachment {
        /// Index of the patch.
        patch: usize,
        /// Index of its attachment.
        attachment: usize,
    },
    /// A strength is negative or no number.
    #[error(
        "patch {patch}: attachment {attachment} has strength {strength}, but it must be between 0 and 1e6"
    )]
    AttachmentStrength {
        /// Index of the patch.
        patch: usize,
        /// Index of its attachment.
        attachment: usize,
        /// What was given.
        strength: f64,
    },
    /// An option is out of range.
    #[error("option `{name}` is {value}, but must be between {low} and {high}")]
    Option {
        /// Its name.
        name: &'static str,
        /// What was given.
        value: f64,
        /// Smallest allowed.
        low: f64,
        /// Largest allowed.
        high: f64,
    },
    /// Not one motion per patch.
    #[error("{what}: expected one motion for each of {expected} patches, got {actual}")]
    PatchCount {
        /// `targets` or `anchors`.
        what: &'static str,
        /// How many patches there are.
        expected: usize,
        /// How many were given.
        actual: usize,
    },
    /// Not one position (or velocity) per node (or anchor).
    #[error("{what} of patch {patch}: expected {expected}, got {actual}")]
    MotionLength {
        /// `target positions`, `anchor velocities`, ...
        what: &'static str,
        /// Index of the patch.
        patch: usize,
        /// How many there must be.
        expected: usize,
        /// How many were given.
        actual: usize,
    },
    /// A number that is not finite, or so large that nothing is left of its precision.
    #[error(
        "{what} of patch {patch}, node {node}: {value:?} is not finite or beyond {limit} in size"
    )]
    MotionValue {
        /// `target positions`, `rest positions`, ...
        what: &'static str,
        /// Index of the patch.
        patch: usize,
        /// Index of the node (or anchor).
        node: usize,
        /// What was given.
        value: [f32; 3],
        /// Largest size allowed.
        limit: f32,
    },
    /// Gravity, wind or head motion is not finite, or absurd.
    #[error("{what}: {value:?} is not finite or beyond {limit} in size")]
    FieldValue {
        /// `gravity`, `wind`, ...
        what: &'static str,
        /// What was given.
        value: [f32; 3],
        /// Largest size allowed.
        limit: f32,
    },
    /// A frame of no, negative or infinite duration.
    #[error("dt is {dt} s, but must be above 0 and at most {limit} s")]
    TimeStep {
        /// What was given. (s)
        dt: f64,
        /// Longest allowed. (s)
        limit: f64,
    },
}
