//! Retargeting: weights of shapes from how a face moves.
//!
//! A source is a moving set of sites on a face: the vertices of an animated mesh, or markers.
//! [`ResponseModel`] says how the sites of a rig answer to each control (a shape, or an action
//! unit); [`fit_clip`] finds the controls that move them as the source does, one
//! box-constrained quadratic problem a frame ([`solve_box_qp`]), smooth over time. The weights
//! then drive any other rig.
//!
//! ```text
//! markers (C3D, TRC) ─bind─▶ sites ─┐
//! animated mesh ─────────────▶ sites ├─fit─▶ weights (a take)
//! rig of the source's face ──────────┘
//! ```

mod box_qp;
mod controls;
mod error;
mod fit;
mod head;
mod markers;
mod motion_of_mesh;
mod response;

pub use box_qp::{BoxQp, BoxSolution, solve_box_qp};
pub use controls::Controls;
pub use error::RetargetError;
pub use fit::{FitFrame, FitOptions, FitReport, Retargeted, fit_clip};
pub use head::{SiteMotion, fit_sites};
pub use markers::{BoundMarkers, MarkerOptions, bind_markers};
pub use motion_of_mesh::{MeshMotion, MeshMotionError, mesh_sites};
pub use response::{ResponseModel, Site};
