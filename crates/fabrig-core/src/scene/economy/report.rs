//! What frames did without.

use serde::{Deserialize, Serialize};

/// What a frame did without. All zero where everything is modelled on purpose.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct EconomyReport {
    /// Whether nothing at all was left out.
    pub is_whole: bool,
    /// Patches that are cloth.
    pub patches: u32,
    /// Patches that slept.
    pub sleeping: u32,
    /// Patches whose muscle shapes were not evaluated.
    pub still: u32,
    /// Substeps that were taken.
    pub substeps: u32,
    /// Substeps that the full model would have taken.
    pub full_substeps: u32,
    /// Vertices of the skin.
    pub skin_vertices: u32,
    /// How many of them were moved.
    pub skin_moved: u32,
    /// Estimated difference to the full model, as the tolerance counts it: of what slept, and of
    /// the substeps that were spared. (mm)
    pub estimate: f64,
    /// Bound of that difference: where a patch that can rest in either of two folds snaps into the
    /// other. (mm)
    pub bound: f64,
    /// Whether the face was in a storm, in which everything is modelled: patches are so far from
    /// their muscle shapes, or the wind is so strong, that they buckle.
    pub is_storm: bool,
}
