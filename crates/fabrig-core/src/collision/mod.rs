//! Contact: cloth against itself and against the world.
//!
//! [`Contact`] is a hook of the cloth's substeps. After the constraints of a substep it takes
//! the nodes that may touch from where they were to where the constraints want them, and sees
//! that nothing passes through anything on the way:
//!
//! ```text
//! pairs of tiles -> candidates -> contacts that may close -> push apart, friction, bonds
//!             -> hold back what would still cross -> new positions
//! ```
//!
//! - `rules`: which elements may collide at all
//! - `tile`, `detect`: pieces of parts, how far they have gone, and which of them may meet;
//!   `tile_shape`: how their cells lie now
//! - `certificate`: what proves from substep to substep that two tiles do not meet
//! - `collect`: where nothing proves it, the elements that may
//! - `distance`: vertices and triangles, edges and edges
//! - `plane`, `parting`: what planes between them show, before their distance is measured
//! - `project`: contacts as planes, Coulomb friction; `sticky`: bonds between lips
//! - `filter`: conservative advancement, the guarantee that nothing crosses
//! - `collider`, `world`, `cloth_shape`: things of the world; the last one speaks parry
//! - [`StarSurface`]: bodies of the face itself; [`Sheet`]: skin that others stay in front of
//! - [`crossings`]: an exact test that shares nothing with the rest, to judge it by
//!
//! Everything runs in one fixed order on one thread: results do not depend on how many threads
//! the cloth has.
//!
//! # Units
//!
//! Millimetres in the head frame. Forces are in newtons of a face whose patches weigh what
//! [`crate::cloth::ClothOptions::areal_density`] says.

mod certificate;
mod cloth_shape;
mod collect;
mod collider;
mod contact;
mod crossing;
mod detect;
mod distance;
mod error;
mod filter;
mod judge;
mod mesh;
mod options;
mod parting;
mod plane;
mod project;
mod report;
mod rules;
mod sheet;
mod star;
mod sticky;
mod tile;
mod tile_shape;
mod tree;
mod world;
mod zones;

#[cfg(test)]
mod tests;

pub use collider::{Collider, ColliderFrame, ColliderKey, ColliderShape, read_colliders};
pub use contact::{Contact, ContactBody, ContactPatch};
pub use crossing::{Crossing, crossings};
pub use error::CollisionError;
pub use judge::Verdict;
pub use options::{ContactOptions, PairMask, Stickiness};
pub use report::{ContactPoint, ContactReport};
pub use sheet::{Sheet, SheetPlace};
pub use star::StarSurface;
pub use sticky::Lip;
pub use world::collider_mesh;

pub(crate) use cloth_shape::WorldShape;
