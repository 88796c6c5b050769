//! The whole line in two calls: a mesh becomes a rig, a rig and a take become a recording.
//!
//! Everything here is an arrangement of the other modules; programs that need more than this
//! call those. Both calls report progress and stop when they are asked to.
//!
//! ```no_run
//! use std::ops::ControlFlow::Continue;
//! use fabrig_core::{mesh::io::read_mesh, motion, pipeline, scene::Scene, template};
//!
//! # fn main() -> Result<(), fabrig_core::Error> {
//! let face = read_mesh("face.obj")?;
//! let rigged =
//!     pipeline::rig_face(&face, template::human(), &Default::default(), &mut |_| Continue(()))?;
//! rigged.rig.save("face.fabrig")?;
//! let clip = motion::read("take.csv", &Default::default())?;
//! let (rig, out) = (std::sync::Arc::new(rigged.rig), std::path::Path::new("out.mcap"));
//! pipeline::animate(rig, clip, Scene::default(), out, &Default::default(), &mut |_| Continue(()))?;
//! # Ok(())
//! # }
//! ```

mod animate;
mod contact;
mod cost;
mod economy;
mod expression_scans;
mod frames;
mod live;
mod own_shapes;
mod own_template;
mod patch_detail;
mod rig_face;
mod runtime;
mod stage;
mod strain;
mod surfaces;
mod timing;

pub use animate::{
    AnimateOptions, AnimateProgress, AnimateReport, animate, frame_count, recording_rate,
};
pub use contact::{ColliderForce, ContactSummary};
pub use cost::{CostRow, cost};
pub use economy::EconomySummary;
pub use expression_scans::{ExpressionScan, ScanReport};
pub use live::LiveFace;
pub use own_shapes::{OwnShapes, OwnShapesError, neutral_of_shapes, read_own_shapes};
pub use own_template::{OwnTemplate, OwnTemplateOptions, template_from_face};
pub use patch_detail::{PatchDetail, PatchDetailError, ResolutionRow, resolution_rows};
pub use rig_face::{CutOrigins, RigFaceOptions, RiggedFace, rig_face};
pub use runtime::{FaceRow, Growth, RuntimeProgress, RuntimeReport, SizeRow, runtime};
pub use stage::{
    StageReport, StagedFace, animate_scene, edits_of, load_faces, scene_duration, scene_rate,
};
pub use timing::TimeStatistics;
