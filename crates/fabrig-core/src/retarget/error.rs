/// What can go wrong when a motion is fitted.
#[derive(Debug, thiserror::Error)]
pub enum RetargetError {
    /// The rig could not be evaluated.
    #[error("the rig cannot be posed")]
    Scene(#[from] crate::scene::SceneError),
    /// Action units do not fit the rig.
    #[error("the action units cannot be used")]
    ActionUnits(#[from] crate::facs::FacsError),
    /// The result is no clip.
    #[error("the fitted weights are no take")]
    Clip(#[from] crate::motion::ClipError),
    /// The face has no surface to bind markers to.
    #[error("the face has no surface to bind markers to")]
    Surface(#[from] crate::mesh::SurfaceError),
    /// A matrix or list has not the size that it should have.
    #[error("expected {expected} {what}, got {found}")]
    Count {
        /// What is counted.
        what: &'static str,
        /// How many there should be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A frame has a number that is not finite.
    #[error("frame {frame}, {what}: the value is not finite")]
    NotFinite {
        /// The frame, from 0.
        frame: usize,
        /// What it belongs to.
        what: String,
    },
    /// Nothing there to fit.
    #[error("{what}")]
    Empty {
        /// What is missing, and what to do.
        what: &'static str,
    },
    /// The quadratic problem has no one solution.
    #[error("the normal matrix is not positive definite at control {control}; raise the ridge")]
    NotPositiveDefinite {
        /// Index of the control.
        control: usize,
    },
    /// An option makes no sense.
    #[error("{option} is {value}; it must be finite and {condition}")]
    Option {
        /// Its name.
        option: &'static str,
        /// Its value.
        value: f64,
        /// `above 0`, ...
        condition: &'static str,
    },
    /// A name is not known.
    #[error("there is no {what} '{found}' (nearest: '{nearest}')")]
    UnknownName {
        /// `marker`, `landmark`, ...
        what: &'static str,
        /// The name.
        found: String,
        /// The most similar one that there is.
        nearest: String,
    },
    /// Markers do not lie on the face.
    #[error(
        "the markers lie {distance:.1} mm (median) from the face, more than {limit:.0} mm: give \
         the rig whose face carried them, and three or more markers with the landmark each \
         stands at"
    )]
    FarFromFace {
        /// Median distance. (mm)
        distance: f64,
        /// The most that is taken for markers on skin. (mm)
        limit: f64,
    },
    /// The motion of the head cannot be told from the face's.
    #[error(
        "{found} sites that stand still on the head are seen in frame {frame}, {expected} are \
         needed to take off the head's motion: add markers at the forehead's top, the temples \
         or the bridge of the nose, or say that the head does not move"
    )]
    FewStableSites {
        /// The frame, from 0.
        frame: usize,
        /// How many are needed.
        expected: usize,
        /// How many there are.
        found: usize,
    },
}
