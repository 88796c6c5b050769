use crate::cloth::MaterialError;
use crate::mesh::SurfaceError;
use crate::scene::SceneError;

/// Why wrinkles cannot be measured on a rig.
#[derive(Debug, thiserror::Error)]
pub enum WrinkleError {
    /// The rig lacks what the case is about.
    #[error("the rig has no {what} '{name}'; this case is about the bundled template's")]
    Missing {
        /// `patch` or `shape`.
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// The face cannot be simulated.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The rig's materials are none.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// The rig has no skin.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}
