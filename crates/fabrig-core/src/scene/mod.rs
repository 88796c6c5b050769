//! Scenes: what to model around a rig, and stepping it through a take.

mod anchors;
mod bench_face;
mod bodies;
mod chain_loss;
mod contact;
mod description;
mod economy;
mod error;
mod face_cases;
mod faces;
pub mod fields;
mod head;
mod modelled;
mod simulation;
mod skin_contact;
mod skin_sheet;
#[cfg(test)]
pub(crate) mod tests;
mod text;

pub use bench_face::{all_frames, face_bench_scene, liveliest_frames};
pub use chain_loss::{LossFigures, ShapeLoss, chain_loss, contour_vertices, hold_pose, shape_loss};
pub use description::{Dynamics, EyeSource, Scene};
pub use economy::{
    Economy, EconomyCase, EconomyFrame, EconomyReport, Tolerance, active_take, economy_case,
    random_economy_case,
};
pub use error::{Hint, SceneError, TextPlace};
pub use face_cases::face_cases;
pub use faces::{Placement, RecordingChoice, SceneFace, Simulate};
pub use simulation::{FacePose, FrameReport, PartPose, Simulation, cloth_patches};
pub use skin_contact::SkinContactReport;
pub use text::{SceneSource, annotated_scene};
