//! glTF 2.0, `.gltf` with its buffers or `.glb`.

use std::path::Path;

use ::gltf::mesh::Mode;
use nalgebra::Matrix4;

use super::MeshIoError;
use crate::Point;
use crate::mesh::{CornerUvs, FaceGroup, Mesh, Polygons};

/// Reads the triangles of the default scene (the first, if none is named; all meshes
/// untransformed, if there is no scene), node transforms applied, one group per primitive.
///
/// glTF splits vertices at texture seams; they stay split, as the file has them. Texture
/// coordinates turn from glTF's upper left origin to the lower left.
///
/// # Errors
///
/// See [`super::read_mesh`].
pub(super) fn parse_gltf(bytes: &[u8], path: &Path) -> Result<Mesh, MeshIoError> {
    let malformed = |problem: String| MeshIoError::Malformed {
        path: path.to_owned(),
        format: "glTF",
        problem,
    };
    let ::gltf::Gltf { document, blob } =
        ::gltf::Gltf::from_slice(bytes).map_err(|e| malformed(e.to_string()))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let buffers = ::gltf::import_buffers(&document, Some(folder), blob)
        .map_err(|e| malformed(e.to_string()))?;

    let mut collector = Collector::default();
    match document.default_scene().or(document.scenes().next()) {
        Some(scene) => {
            for node in scene.nodes() {
                collector
                    .node(&node, Matrix4::identity(), &buffers, 0)
                    .map_err(malformed)?;
            }
        }
        None => {
            for mesh in document.meshes() {
                collector
                    .mesh(&mesh, Matrix4::identity(), &buffers)
                    .map_err(malformed)?;
            }
        }
    }
    collector.finish(path)
}

/// Deeper trees than this are taken for cycles, which glTF forbids.
const MAX_DEPTH: usize = 256;

#[derive(Default)]
struct Collector {
    positions: Vec<Point>,
    /// One per vertex; (0, 0) where a primitive has none.
    coordinates: Vec<[f32; 2]>,
    has_uvs: bool,
    polygons: Polygons,
    groups: Vec<FaceGroup>,
}

impl Collector {
    fn node(
        &mut self,
        node: &::gltf::Node<'_>,
        parent: Matrix4<f64>,
        buffers: &[::gltf::buffer::Data],
        depth: usize,
    ) -> Result<(), String> {
        if depth > MAX_DEPTH {
            return Err(format!("nodes are nested deeper than {MAX_DEPTH}"));
        }
        let local = Matrix4::from(node.transform().matrix()).map(f64::from);
        let to_world = parent * local;
        if let Some(mesh) = node.mesh() {
            self.mesh(&mesh, to_world, buffers)?;
        }
        for child in node.children() {
            self.node(&child, to_world, buffers, depth + 1)?;
        }
        Ok(())
    }

    fn mesh(
        &mut self,
        mesh: &::gltf::Mesh<'_>,
        to_world: Matrix4<f64>,
        buffers: &[::gltf::buffer::Data],
    ) -> Result<(), String> {
        for primitive in mesh.primitives() {
            let place = format!("mesh {} primitive {}", mesh.index(), primitive.index());
            if matches!(
                primitive.mode(),
                Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip
            ) {
                continue;
            }
            let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|b| &b.0[..]));
            let first_vertex = self.positions.len();
            let first_face = self.polygons.len();
            let positions = reader
                .read_positions()
                .ok_or_else(|| format!("{place} has no readable positions"))?;
            self.positions.extend(
                positions.map(|p| to_world.transform_point(&Point::from(p.map(f64::from)))),
            );
            let vertex_count = self.positions.len() - first_vertex;
            let indices: Vec<u32> = match reader.read_indices() {
                Some(indices) => indices.into_u32().collect(),
                None => (0..vertex_count as u32).collect(),
            };
            if let Some(&bad) = indices.iter().find(|&&i| i as usize >= vertex_count) {
                return Err(format!(
                    "{place} references vertex {bad}, but it has {vertex_count}"
                ));
            }
            // A mirroring transform turns faces inside out.
            let is_mirrored = to_world.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
            for mut triangle in triangles(primitive.mode(), &indices) {
                if is_mirrored {
                    triangle.swap(1, 2);
                }
                self.polygons
                    .push(&triangle.map(|i| i + first_vertex as u32));
            }
            if let Some(uvs) = reader.read_tex_coords(0) {
                self.has_uvs = true;
                self.coordinates
                    .extend(uvs.into_f32().map(|[u, v]| [u, 1.0 - v]));
            }
            self.coordinates.resize(self.positions.len(), [0.0, 0.0]);
            if self.polygons.len() > first_face {
                self.groups.push(FaceGroup {
                    name: mesh.name().map_or(place, str::to_owned),
                    faces: first_face..self.polygons.len(),
                });
            }
        }
        Ok(())
    }

    fn finish(self, path: &Path) -> Result<Mesh, MeshIoError> {
        if self.positions.is_empty() || self.polygons.is_empty() {
            return Err(MeshIoError::Empty {
                path: path.to_owned(),
                vertex_count: self.positions.len(),
                face_count: self.polygons.len(),
            });
        }
        let invalid = |source| MeshIoError::Invalid {
            path: path.to_owned(),
            source,
        };
        let corners = self.polygons.corners().to_vec();
        let mesh = Mesh::new(self.positions, self.polygons).map_err(invalid)?;
        let mesh = if self.has_uvs {
            let uvs = CornerUvs {
                coordinates: self.coordinates,
                corners,
            };
            mesh.with_uvs(uvs).map_err(invalid)?
        } else {
            mesh
        };
        Ok(mesh.with_groups(self.groups))
    }
}

fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(k, w)| {
                if k % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[0], w[2], w[1]]
                }
            })
            .collect(),
        Mode::TriangleFan => (1..indices.len().saturating_sub(1))
            .map(|k| [indices[0], indices[k], indices[k + 1]])
            .collect(),
        _ => indices
            .chunks_exact(3)
            .map(|c| [c[0], c[1], c[2]])
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One triangle, its buffer beside it, under a node that scales by -2 along x.
    fn triangle_file(folder: &Path, byte_length: usize) -> std::path::PathBuf {
        let mut buffer: Vec<u8> = [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]]
            .iter()
            .flatten()
            .flat_map(|c| c.to_le_bytes())
            .collect();
        buffer.truncate(byte_length);
        std::fs::write(folder.join("face.bin"), buffer).unwrap();
        let json = r#"{
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "scale": [-2, 1, 1]}],
            "meshes": [{"name": "skin", "primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                           "min": [0, 0, 0], "max": [1, 1, 0]}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "buffers": [{"uri": "face.bin", "byteLength": 36}]
        }"#;
        let path = folder.join("face.gltf");
        std::fs::write(&path, json).unwrap();
        path
    }

    #[test]
    fn node_transforms_apply_and_mirrors_keep_faces_outwards() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = crate::mesh::io::read_mesh(triangle_file(folder.path(), 36)).unwrap();
        assert_eq!(mesh.positions()[1], Point::new(-2.0, 0.0, 0.0));
        assert_eq!(mesh.polygons().face(0), [0, 2, 1]);
        assert_eq!(mesh.groups()[0].name, "skin");
    }

    #[test]
    fn a_short_buffer_is_a_typed_error() {
        let folder = tempfile::tempdir().unwrap();
        let error = crate::mesh::io::read_mesh(triangle_file(folder.path(), 20)).unwrap_err();
        assert!(matches!(error, MeshIoError::Malformed { .. }), "{error}");
    }
}
