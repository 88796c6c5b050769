//! Speed beside error: scenes, timed runs, their difference to a converged reference, the
//! floor that the bare kernels set, hard cases.
//!
//! Scenes are lists of frames, so that the solver runs alone: a face-sized one made of domes and
//! rings, the standard patch of 24 x 24 nodes at any stiffness ratio, and (from
//! [`crate::scene::face_bench_scene`]) a rig on a take.

mod floor;
mod measure;
mod pareto;
mod scene;
pub(crate) mod stability;
mod synthetic;

pub use floor::{Floor, constraint_count, floor};
pub use measure::{Difference, Run, difference, nudged, run};
pub use pareto::{Pareto, ParetoPoint, Setting, pareto, settings};
pub use scene::{BenchScene, SceneFrame};
pub use stability::{CaseResult, Extent, random_scenes, stability};
