//! Registration: a user's face in template topology, at true head size.
//!
//! Stages, each in its own file:
//!
//! 1. `clean`: a welded, oriented copy, split into pieces.
//! 2. `alignment` (no landmarks) or `similarity` (landmarks): units, place, orientation.
//! 3. `identity_fit`: the template shaped by how people differ.
//! 4. `nonrigid_icp` on the coarse `node_graph`, then `refinement` at full resolution; mouth
//!    and eyes by `openings`.
//! 5. `mapping` from the user's vertices to the template, `parts` that are not skin, `report`.
//!
//! A scan of an expression of a face that is registered follows by `expression_scan`.
//!
//! The user's mesh stays the skin; the registered template only carries anatomy to it.
//!
//! # Limits
//!
//! Lips and lids that are one closed surface have no contact line to match; the report says so
//! (`openings`), and [`cut_seams`] cuts them on request. One face a mesh; hair that hides the face is taken for skin.

mod alignment;
pub mod bench;
mod clean;
mod closest_grid;
mod cut;
mod error;
mod expression_scan;
mod face_model;
mod identity_fit;
mod landmarks;
mod lining;
mod mapping;
mod node_graph;
mod nonrigid_icp;
mod opening_state;
mod openings;
mod parts;
mod refinement;
mod register;
mod report;
mod settling;
mod similarity;
mod sparse;
mod target;

pub use clean::{CleaningReport, Sphere};
pub use cut::{CutFace, CutSeams, SeamCut, cut_seams};
pub use error::RegistrationError;
pub use expression_scan::{RegisteredExpression, register_expression};
pub use landmarks::{LandmarkFileError, LandmarkOrder, parse_landmarks, read_landmarks};
pub use parts::RigidComponent;
pub use register::{Progress, Registration, RegistrationOptions, register};
pub use report::{
    DistanceStatistics, OpeningMeasure, OpeningMeasures, OpeningState, RegistrationReport,
    StageTime,
};
pub use similarity::MIN_LANDMARK_COUNT;
pub(crate) use similarity::umeyama;
pub(crate) use sparse::SpdSystem;
