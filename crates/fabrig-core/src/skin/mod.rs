//! Skin: the user's own mesh, moved by the patches under it.
//!
//! Each vertex hangs on a few patch nodes, on the mandible and on the skull:
//!
//! `y' = y + sum_j w_j [(q_j' - q_j) + (R_j - I)(y - q_j)]`
//!
//! with `R_j` the turn of the grid at node j ([`NodeFrames`]). The weights start from the
//! kernel `(1 - (d/R)^2)^3` ([`kernel`]) and are then *fitted to the shapes* ([`fit`]): on the
//! template, over all of its shapes, they are the non-negative weights (skull takes what is
//! missing to one) that give each vertex the motion the shapes give it. A user's vertex takes
//! the weights of the place on the template where registration put it ([`SkinBinding`]).
//!
//! Of what patches do beyond their muscle shapes skin takes what is wide enough for it
//! ([`SheetFilter`]).
//!
//! # Limitations
//!
//! Weights of outer skin are convex: a vertex outside the hull of the nodes near it follows
//! them by their turn alone. Detail of a motion finer than the grid of the patch is lost.

mod active_set;
mod binding;
mod candidates;
mod deform;
mod error;
pub mod fit;
mod frames;
mod interpolation;
pub mod kernel;
mod mirror;
mod narrow;
mod sheet_filter;
mod spread;
mod stored;
mod vertex_fit;

pub use binding::SkinBinding;
pub use candidates::{Candidate, CandidateFinder};
pub use deform::SkinDeformer;
pub use error::SkinError;
pub use fit::{FitOptions, Pose, TemplateWeights, fit_to_shapes};
pub use frames::{NodeAffine, NodeFrames};
pub use interpolation::SmoothInterpolation;
pub use mirror::NodeMirror;
pub use narrow::{Footing, NarrowPatch};
pub use sheet_filter::SheetFilter;
pub use spread::SkinSpreader;
