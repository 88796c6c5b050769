use crate::cloth::{ClothError, MaterialError};
use crate::collision::CollisionError;
use crate::skin::SkinError;
use crate::transfer::TransferError;

/// What can go wrong when a scene is set up or stepped.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// A time step is not a positive number.
    #[error("the time step must be a positive number of seconds, got {dt}")]
    TimeStep {
        /// What was given.
        dt: f64,
    },
    /// The text of a scene cannot be read.
    #[error("the scene cannot be read: {reason}")]
    Text {
        /// What is wrong, with line and column.
        reason: String,
    },
    /// Contact refused its options or a collider.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// The cloth refused its input.
    #[error(transparent)]
    Cloth(#[from] ClothError),
    /// The rig's materials cannot be read, or lack one that a patch names.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// The weights do not fit the rig.
    #[error(transparent)]
    Transfer(#[from] TransferError),
    /// The skin does not fit the rig.
    #[error(transparent)]
    Skin(#[from] SkinError),
}
