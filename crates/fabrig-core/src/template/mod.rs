//! The template pack: one face with everything that is transferred to others.
//!
//! A pack is data. Adding a muscle, a shape or another template changes no code.

mod pack;

pub use pack::{
    EyeSocket, JawHinge, Landmarks, Region, RegionId, Regions, RigidBody, RigidPart, Template,
    WholeFaceShape,
};
