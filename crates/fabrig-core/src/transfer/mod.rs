//! Transfer: the template's shapes on the patches of another face, and their sum at any
//! instant.
//!
//! Eq. 1-2 turn whole-face shapes into muscle shapes, one set a patch ([`muscle_shapes`]);
//! Eq. 3, `X_p = b_0 + alpha_p sum_i w_i Db_i`, puts them on a face ([`PatchTransfer`]):
//! displacements in one of several ways ([`OffsetMode`]), with amplitudes from size alone or
//! fitted to the face's own expressions ([`fit_alphas`]). Three parts are its own that a sum of
//! straight lines cannot hold: the jaw turns about its hinge ([`JawField`]), lids slide over
//! the eyeball ([`LidField`]), and lids that close meet on a face whose eyes open differently
//! ([`LidClosing`]).
//!
//! # Source
//!
//! Zhu & Joslin 2024, section 3.3; the hinge and the lids are this project's own.

mod alpha;
mod alpha_field;
mod blendshape;
mod closing;
mod error;
mod evaluate;
mod examples;
mod fit_alpha;
mod fit_jaw;
mod fit_maps;
#[cfg(test)]
mod fixtures;
mod jaw;
mod lids;
mod offset;
mod poisson;
mod roles;

pub use alpha::{ALPHA_LIMITS, size_ratio};
pub use alpha_field::AlphaField;
pub use blendshape::{
    MuscleShape, ShapeSampler, muscle_shapes, muscle_shapes_on_face, smoothed_normals,
};
pub use closing::LidClosing;
pub use error::TransferError;
pub use evaluate::{PatchTransfer, ShapeWeights, TransferContext};
pub use examples::{Example, check_examples};
pub use fit_alpha::{AlphaMode, Amplitudes, Observation, PatchEvidence, fit_alphas};
pub use fit_jaw::{TURN_ALONE, fit_open_angle, jaw_with_shares};
pub use fit_maps::fit_maps;
pub use jaw::{JawField, JawMode, JawPose};
pub use lids::{LidField, LidNode};
pub use offset::{FaceOffsets, OffsetMode, offsets_on_face};
pub use roles::{EyeShapes, JawShapes};
