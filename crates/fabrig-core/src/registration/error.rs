//! What can go wrong while a face is registered.

use crate::mesh::SurfaceError;

/// Why a face could not be registered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RegistrationError {
    /// A landmark name that the template does not have.
    #[error("unknown landmark \"{name}\"; the nearest known names are: {}", .nearest.join(", "))]
    UnknownLandmark {
        /// The name given.
        name: String,
        /// Known names, most alike first.
        nearest: Vec<String>,
    },
    /// Fewer landmarks than a similarity needs.
    #[error(
        "{found} landmarks were given, at least {expected} are needed; useful ones: {}",
        .useful.join(", ")
    )]
    TooFewLandmarks {
        /// How many were given.
        found: usize,
        /// How many are needed.
        expected: usize,
        /// Landmarks that fix a head best.
        useful: Vec<String>,
    },
    /// A landmark coordinate is NaN or infinite.
    #[error("landmark \"{name}\" has a coordinate that is not a finite number")]
    LandmarkNotFinite {
        /// Its name.
        name: String,
    },
    /// The landmarks lie on a line or in one place.
    #[error("the {found} landmarks lie on one line or in one place: they fix no orientation")]
    LandmarksDegenerate {
        /// How many were given.
        found: usize,
    },
    /// The landmarks fit the template only as a mirror image.
    #[error(
        "the landmarks fit the template only as a mirror image (left and right look swapped): \
         {mirrored_mm:.1} mm mirrored against {straight_mm:.1} mm as given"
    )]
    LandmarksMirrored {
        /// RMS distance when mirrored. (mm)
        mirrored_mm: f64,
        /// RMS distance as given. (mm)
        straight_mm: f64,
    },
    /// No alignment stands out.
    #[error(
        "cannot tell how this face is oriented (confidence {confidence:.2}, needed {threshold:.2}); \
         give landmarks in the mesh's own units, at least 4 of: {}",
        .landmarks.join(", ")
    )]
    AlignmentUncertain {
        /// Margin of the best alignment over the second best, 0 to 1.
        confidence: f64,
        /// What was asked for.
        threshold: f64,
        /// Landmarks to give.
        landmarks: Vec<String>,
    },
    /// A scan of an expression does not come to lie on the face that it should be of.
    #[error(
        "the scan is not this face in this expression: {distance_mm:.2} mm from it in the median \
         after everything was tried; check its name, and that it is in the neutral's units"
    )]
    OtherFace {
        /// Median distance. (mm)
        distance_mm: f64,
    },
    /// Too little is left after cleaning.
    #[error(
        "the face has {triangle_count} usable triangles after cleaning, at least {expected} are needed"
    )]
    TooFewTriangles {
        /// Triangles with an area, in the largest piece.
        triangle_count: usize,
        /// What is needed.
        expected: usize,
    },
    /// The template cannot be registered.
    #[error("the template \"{template}\" lacks {what}")]
    TemplateIncomplete {
        /// Name of the template.
        template: String,
        /// What is missing.
        what: String,
    },
    /// An option is out of its range.
    #[error("option {name} is {value}, expected {expected}")]
    BadOption {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// A fused opening on which no line from corner to corner was found.
    #[error(
        "the {opening} cannot be cut: no line from corner to corner was found on the mesh; give          landmarks of its corners, or leave it out of the cut"
    )]
    SeamNotFound {
        /// Which.
        opening: &'static str,
    },
    /// A cut did not leave a valid mesh.
    #[error("the cut mesh is not valid")]
    Mesh(#[from] crate::mesh::MeshError),
    /// A mesh that no surface can be made of.
    #[error("the mesh has no usable surface")]
    Surface(#[from] SurfaceError),
    /// A linear system does not fit in memory.
    #[error("a linear system of {unknowns} unknowns does not fit in memory")]
    SystemTooLarge {
        /// How many unknowns it has.
        unknowns: usize,
    },
    /// A linear system is not positive definite.
    #[error("a linear system of {unknowns} unknowns has no unique solution")]
    SystemNotSolvable {
        /// How many unknowns it has.
        unknowns: usize,
    },
    /// The progress callback asked to stop.
    #[error("registration was cancelled during {stage}")]
    Cancelled {
        /// The stage it was in.
        stage: &'static str,
    },
}
