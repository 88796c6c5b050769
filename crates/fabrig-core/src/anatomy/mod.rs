//! Patches of muscle and fat under the skin, each a regular grid.

mod patch;

pub use patch::{Attachment, GridShape, Patch, PatchChart, PatchKind, Side, SurfaceNode};
