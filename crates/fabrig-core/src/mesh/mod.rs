//! Polygon meshes: storage with validated topology, derived geometry, files.

pub mod appearance;
mod components;
pub mod io;
mod laplacian;
mod normals;
mod polygon_mesh;
mod refine;
mod self_intersection;
mod slit;
mod surface;
mod topology;

pub use components::Components;
pub use laplacian::{EdgeLaplacian, vertex_areas};
pub use normals::{triangle_normals, vertex_normals};
pub use polygon_mesh::{CornerUvs, FaceGroup, Mesh, MeshError, Polygons};
pub use refine::{RefinedMesh, refine};
pub use self_intersection::self_intersections;
pub use slit::{SlitField, SlitMesh, VertexOrigin, slit};
pub use surface::{RayHit, Surface, SurfaceError, SurfacePoint, closest_on_triangle};
pub use topology::{Edge, Topology, triangle_edges};
