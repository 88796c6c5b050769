//! The template pack: one face with everything that is transferred to others.
//!
//! A pack is data. Adding a muscle, a shape or another template changes no code.

pub mod build;
mod demo;
mod description;
mod error;
mod geometry;
mod identity;
mod load;
mod pack;
mod people;
mod store;

pub use demo::{
    demo_contact_colliders, demo_contact_take, demo_face, demo_physics_take, demo_take,
};
pub use error::TemplateError;
pub(crate) use load::human_files;
pub use load::{PackFiles, human};
pub use pack::{
    EyeSocket, JawHinge, Landmarks, Region, RegionId, Regions, RigidBody, RigidPart, Template,
    WholeFaceShape,
};
pub use people::{Person, people};
