//! Mesh files: Wavefront OBJ, PLY, STL and glTF in, OBJ out.
//!
//! [`read_mesh`] picks the format by the file's extension. Vertices keep the file's order and
//! units, polygons stay polygons. [`read_mesh_with_shapes`] also gives glTF's morph targets. Anything wrong with a file is a [`MeshIoError`] that names
//! the file and, where the format has them, the line.

mod error;
mod gltf;
mod gltf_accessor;
mod gltf_file;
mod obj;
mod ply;
mod read;
mod shapes;
mod stl;
mod write;

pub(crate) use gltf_file::{GltfFile, gltf_companions};
pub(crate) use obj::logical_lines;

pub use error::{MeshIoError, ObjProblem};
pub use obj::parse_obj;
pub use read::{is_mesh_file, read_mesh};
pub use shapes::{MeshShape, MeshWithShapes, read_mesh_with_shapes};
pub use write::write_obj;
