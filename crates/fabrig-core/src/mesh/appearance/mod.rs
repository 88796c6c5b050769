//! What a mesh looks like: materials, the pictures that they use, and the material of every
//! polygon.
//!
//! Read from the file that a mesh came from ([`Appearance::of_file`]): OBJ with its MTL, or glTF
//! with all its extensions of materials. Materials are kept the way glTF writes them, beside the
//! few numbers that every format has.

mod error;
mod gltf;
mod material;
mod obj;
mod source;

pub use error::AppearanceError;
pub use material::{Appearance, Material, Picture, linear_color};
