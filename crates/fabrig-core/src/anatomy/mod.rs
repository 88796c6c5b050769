//! Patches of muscle and fat under the skin, each a regular grid.
//!
//! The layout text of a template (`patches.toml`) says in named points of the skin where each
//! muscle's fibres run and how deep. [`charts`] turns it into grids on the template's skin;
//! [`lay_patches`] lays them under any face that has the template's topology.

mod attachments;
mod chart;
mod coverage;
mod error;
mod expression;
mod lay;
mod layout;
mod margin;
mod patch;
mod places;
mod quality;
mod ring;
mod sheet;
mod skin_frame;
mod spline;

pub use chart::charts;
pub use coverage::{ShapeCoverage, coverage};
pub use error::AnatomyError;
pub use lay::lay_patches;
pub use patch::{
    Attachment, GridShape, Patch, PatchChart, PatchKind, Resolution, Side, SurfaceNode,
};
pub use quality::Spacing;
