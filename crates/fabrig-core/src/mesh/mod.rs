//! Polygon meshes: storage with validated topology, derived geometry, files.

mod polygon_mesh;

pub use polygon_mesh::{CornerUvs, FaceGroup, Mesh, MeshError, Polygons};
