//! Makes a pack from the CC0 MakeHuman base mesh, its identity targets and the CC0 ARKit face
//! units drawn for it.
//!
//! The recipe is `template.toml` in the pack's own folder; the outcome is `geometry.bin` beside
//! it. The same source and recipe give the same bytes. Steps:
//!
//! 1. identity: base mesh + weighted targets, made exactly symmetric, scaled to millimetres;
//! 2. crop at the edge loop around the neck; mirrored quads get mirrored corner orders;
//! 3. eyeballs, teeth, tongue; a sphere fitted to each eyeball, a hinge to the lower teeth;
//! 4. landmarks from the recipe, regions by outline and flood fill;
//! 5. shapes: left and right averaged into exact mirrors, then corrected: dents and ridges
//!    smoothed, lids kept outside the eyeball and closed in blinks, lips sealed or opened and
//!    kept out of each other, each half kept to its own side.
//!
//! [`IdentityRecipe`] makes `identity.bin`: how people differ, from the source's own targets.
//! [`FaceList`] makes faces of other people from the same source: remeshed for tests and for the
//! demo, and in the template's topology as the truth that registration is measured against.

mod aperture;
mod corrections;
mod crop;
mod decimate;
mod face;
mod fairing;
mod identities;
mod identity;
mod lids;
mod linings;
mod lips;
mod pack;
mod regions;
mod rigid;
mod sides;
mod source;
mod subdivide;

pub(crate) use decimate::decimate;
pub use face::FaceList;
pub use identities::IdentityRecipe;
pub use pack::{BuildReport, build_geometry, build_template};
