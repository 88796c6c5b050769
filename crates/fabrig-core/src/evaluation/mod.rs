//! How near a rig comes to a face's own expressions, beside whole-face delta transfer: Table 3.
//!
//! A face that has its own shapes is rigged from its neutral mesh; poses are then compared with
//! the face's own, vertex by vertex. Delta transfer, the yardstick, adds the template's whole
//! displacements times the ratio of head sizes at the same places of the same registration.
//!
//! [`pad_volumes`] and [`pad_rings`]: whether fat keeps its volume and how it rings.
//! [`measure_wrinkles`]: how deep skin wrinkles and how finely, beside what a beam on springs does.
//!
//! # Source
//!
//! Zhu & Joslin 2024, section 4.2, Table 3.

mod check;
mod delta_transfer;
mod faces;
mod methods;
mod soft_tissue;
mod space_map;
mod table3;
mod wrinkles;

pub use check::{
    CheckError, CheckGates, CheckReport, Finding, GATES, Gate, MuscleCheck, RegionDistance,
    RigCheck, ShapeCheck, check_rig,
};
pub use faces::{OwnFace, synthetic_faces};
pub use methods::{Drive, METHODS, Method, POSES, Pose};
pub use soft_tissue::{
    Oscillation, PadRing, PadVolume, SoftTissueError, gravity_directions, oscillation, pad_rings,
    pad_volumes,
};
pub use table3::{FaceResult, PoseError, RegionError, Table3, Table3Error, evaluate_face};
pub use wrinkles::{
    Site, WRINKLE_CASES, Winkler, WrinkleCase, WrinkleError, WrinkleFigures, WrinkleMeasure,
    figures_of_lines, measure_wrinkles, winkler,
};
