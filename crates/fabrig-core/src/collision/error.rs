/// What can be wrong with contact.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CollisionError {
    /// A text of colliders cannot be read.
    #[error("colliders: {reason}")]
    Text {
        /// What is wrong, with line and column.
        reason: String,
    },
    /// A collider cannot be what it says.
    #[error("collider {index} (`{name}`): {reason}")]
    Collider {
        /// Its index in the scene.
        index: usize,
        /// Its name.
        name: String,
        /// What is wrong, and what to do.
        reason: String,
    },
    /// An option is out of range.
    #[error("contact option `{name}` must be from {low} to {high}, got {value}")]
    Option {
        /// Its name.
        name: &'static str,
        /// What was given.
        value: f64,
        /// Smallest that is allowed.
        low: f64,
        /// Largest that is allowed.
        high: f64,
    },
    /// There is no collider with this index.
    #[error("there is no collider {index}; the scene has {count}")]
    NoSuchCollider {
        /// The index asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A pose is not a number, or too far away.
    #[error("the pose of collider {index} is not a finite place within 1 km")]
    Pose {
        /// The collider.
        index: usize,
    },
}
