//! Makes a pack from the CC0 MakeHuman base mesh, its identity targets and the CC0 ARKit face
//! units drawn for it.
//!
//! The recipe is `template.toml` in the pack's own folder; the outcome is `geometry.bin` beside
//! it. The same source and recipe give the same bytes. Steps: identity, crop, symmetry, rigid
//! parts, jaw and eye fits, shapes, regions.

mod crop;
mod decimate;
mod face;
mod identity;
mod lids;
mod lips;
mod pack;
mod regions;
mod rigid;
mod source;
mod subdivide;

pub use face::FaceList;
pub use pack::{BuildReport, build_geometry, build_template};
