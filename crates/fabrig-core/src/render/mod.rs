//! Pictures of faces, patches and recordings on the CPU, with no window and no GPU.
//!
//! Visibility comes from rays through the bounding volume hierarchy of `parry3d`, files from
//! `image`, text from `embedded-graphics`. A [`Picture`] takes [`Layer`]s of triangles, points,
//! labels and a legend, and gives an [`Image`]; [`Sheet`] sets several into a grid, and
//! [`write_gif`] makes frames move.
//!
//! One ray finds what each pixel shows, pixels that differ from their neighbours get the full
//! grid of rays. Light is a key, a fill and a rim light in the camera's frame over an ambient
//! term; ambient occlusion and the key light's soft shadow are baked at the vertices with a
//! fixed set of rays. Pixels do not depend on each other, so any thread count gives the same
//! picture.
//!
//! # Limitations
//!
//! No textures, no refraction, no depth of field; shadows are as sharp as the mesh is fine.

mod animation;
mod annotation;
mod camera;
mod color;
mod error;
mod face;
mod framing;
mod image_buffer;
mod layer;
mod light;
mod palette;
mod picture;
mod sheet;
mod simulated;
mod subjects;
mod tracer;

pub use animation::write_gif;
pub use annotation::{Label, Legend};
pub use camera::{Camera, Projection, View};
pub use color::{ColorMap, Rgb};
pub use error::RenderError;
pub use face::{FaceLook, mesh_layers};
pub use framing::Framing;
pub use image_buffer::Image;
pub use layer::{Edges, Layer, Material, Paint, Points};
pub use picture::{Background, Picture, Shot};
pub use sheet::Sheet;
pub use simulated::{simulation_labels, simulation_layers, simulation_patch_layers};
pub use subjects::{
    RecordingContent, patch_layer, patch_layers, posed_template_layers, recording_layers,
    template_layers,
};
