//! A rig in the formats of other programs: glTF, USD, point caches, OBJ, NumPy.
//!
//! [`export()`] turns the shapes of a rig into morph targets on the user's own mesh, and a take
//! into an animation of their weights or, baked, into the simulated vertices of every frame.
//! [`convert()`] does the latter with a recording. One file a format writes what `face`, `shapes`,
//! `take` and `basis` prepare; a format knows neither rigs nor simulations.

mod basis;
mod convert;
mod error;
mod face;
mod format;
mod glb;
mod gltf_buffer;
mod look;
mod npz;
mod obj_folder;
mod options;
mod point_cache;
mod report;
mod run;
mod seams;
mod shapes;
mod take;
mod usda;
mod usda_text;
mod writer;

pub(crate) use npz::{Elements, NpzWriter};

pub use convert::{ConvertOptions, convert};
pub use error::ExportError;
pub use format::ExportFormat;
pub use options::{ExportOptions, LengthUnit, ShapeSource};
pub use report::{BasisError, ExportReport, LinearError};
pub use run::export;
