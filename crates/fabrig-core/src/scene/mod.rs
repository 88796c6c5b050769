//! Scenes: what to model around a rig, and stepping it through a take.

mod anchors;
mod bench_face;
mod bodies;
mod chain_loss;
mod contact;
mod description;
mod error;
mod face_cases;
mod head;
mod simulation;
mod skin_contact;

pub use bench_face::{all_frames, face_bench_scene, liveliest_frames};
pub use chain_loss::{LossFigures, ShapeLoss, chain_loss, contour_vertices, hold_pose, shape_loss};
pub use description::{Dynamics, EyeSource, Scene};
pub use error::SceneError;
pub use face_cases::face_cases;
pub use simulation::{FacePose, FrameReport, PartPose, Simulation, cloth_patches};
pub use skin_contact::SkinContactReport;
