use crate::cloth::MaterialError;
use crate::scene::SceneError;

/// Why soft tissue cannot be measured on a rig.
#[derive(Debug, thiserror::Error)]
pub enum SoftTissueError {
    /// The rig has no pad of fat.
    #[error("the rig has no fat pads, so there is nothing to measure")]
    NoPads,
    /// Some patch has neither magnet nor anchor, so it does not hang but falls.
    #[error("a patch is held by nothing, so it cannot hang; give its material a magnet frequency")]
    Loose,
    /// The face cannot be simulated.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The rig's materials are none.
    #[error(transparent)]
    Material(#[from] MaterialError),
}
