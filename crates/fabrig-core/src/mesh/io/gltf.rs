//! glTF 2.0, `.gltf` with its buffers or `.glb`.

use std::path::Path;

use ::gltf::mesh::Mode;
use ::gltf::{Gltf, Primitive, Semantic};
use nalgebra::Matrix4;
use serde_json::Value;

use super::gltf_accessor::Buffers;
use super::gltf_file::{buffers_of, document_of, list};
use super::{MeshIoError, MeshShape, MeshWithShapes};
use crate::mesh::{CornerUvs, FaceGroup, Mesh, Polygons};
use crate::{Point, Vector};

/// Reads the triangles of the default scene (the first, if none is named; all meshes
/// untransformed, if there is no scene), node transforms applied, one group per primitive.
///
/// glTF splits vertices at texture seams; they stay split, as the file has them, but primitives
/// of a mesh that share their positions share vertices. Texture coordinates turn from glTF's
/// upper left origin to the lower left.
///
/// Morph targets become shapes, node transforms applied. Targets of one name are one shape,
/// whichever primitives and meshes they stand on; names are `extras.targetNames` of the mesh,
/// and `target_0`, ... where it has none. Default weights are passed over: the mesh is the one
/// with all weights zero.
///
/// # Errors
///
/// See [`super::read_mesh`].
pub(super) fn parse_gltf(bytes: &[u8], path: &Path) -> Result<MeshWithShapes, MeshIoError> {
    let malformed = |problem: String| MeshIoError::Malformed {
        path: path.to_owned(),
        format: "glTF",
        problem,
    };
    let (root, Gltf { document, blob }) = document_of(bytes).map_err(malformed)?;
    let data = buffers_of(&document, blob, path).map_err(malformed)?;
    let buffers = Buffers::new(&data);

    let mut collector = Collector::new(target_names(&root), bytes.len() + buffers.total_length());
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

struct Collector {
    positions: Vec<Point>,
    /// One per vertex; (0, 0) where a primitive has none.
    coordinates: Vec<[f32; 2]>,
    has_uvs: bool,
    polygons: Polygons,
    groups: Vec<FaceGroup>,
    group_materials: Vec<Option<usize>>,
    shapes: Vec<MeshShape>,
    /// Names of morph targets, by mesh.
    target_names: Vec<Vec<String>>,
    /// Vertices and displacements that may still be made: nodes and targets can name the same
    /// data over and over, so a small file could ask for any amount.
    allowance: usize,
}

/// Vertices that a primitive already read gave, if another may use them.
struct SharedVertices {
    position_accessor: usize,
    uv_accessor: Option<usize>,
    /// Accessors of the positions of its targets.
    target_accessors: Vec<Option<usize>>,
    first: usize,
    count: usize,
}

impl Collector {
    fn new(target_names: Vec<Vec<String>>, allowance: usize) -> Self {
        Self {
            positions: Vec::new(),
            coordinates: Vec::new(),
            has_uvs: false,
            polygons: Polygons::new(),
            groups: Vec::new(),
            group_materials: Vec::new(),
            shapes: Vec::new(),
            target_names,
            allowance,
        }
    }

    fn spend(&mut self, count: usize) -> Result<(), String> {
        self.allowance = self
            .allowance
            .checked_sub(count)
            .ok_or("its nodes and morph targets repeat the same data too often")?;
        Ok(())
    }

    fn node(
        &mut self,
        node: &::gltf::Node<'_>,
        parent: Matrix4<f64>,
        buffers: &Buffers<'_>,
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
        buffers: &Buffers<'_>,
    ) -> Result<(), String> {
        let mut shared: Vec<SharedVertices> = Vec::new();
        for primitive in mesh.primitives() {
            let place = format!("mesh {} primitive {}", mesh.index(), primitive.index());
            if matches!(
                primitive.mode(),
                Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip
            ) {
                continue;
            }
            let accessors = accessors_of(&primitive)
                .ok_or_else(|| format!("{place} has no readable positions"))?;
            let same = shared.iter().find(|s| {
                s.position_accessor == accessors.position_accessor
                    && s.uv_accessor == accessors.uv_accessor
                    && s.target_accessors == accessors.target_accessors
            });
            let (first_vertex, vertex_count) = match same {
                Some(same) => (same.first, same.count),
                None => {
                    let range = self
                        .vertices(mesh.index(), &primitive, to_world, buffers)
                        .map_err(|problem| format!("{place} {problem}"))?;
                    shared.push(SharedVertices {
                        first: range.0,
                        count: range.1,
                        ..accessors
                    });
                    range
                }
            };
            let indices: Vec<u32> = match primitive.indices() {
                Some(accessor) => buffers
                    .indices(&accessor)
                    .map_err(|problem| format!("{place} {problem}"))?,
                None => (0..vertex_count as u32).collect(),
            };
            if let Some(&bad) = indices.iter().find(|&&i| i as usize >= vertex_count) {
                return Err(format!(
                    "{place} references vertex {bad}, but it has {vertex_count}"
                ));
            }
            self.spend(indices.len() / 3)?;
            let first_face = self.polygons.len();
            // A mirroring transform turns faces inside out.
            let is_mirrored = to_world.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
            for mut triangle in triangles(primitive.mode(), &indices) {
                if is_mirrored {
                    triangle.swap(1, 2);
                }
                self.polygons
                    .push(&triangle.map(|i| i + first_vertex as u32));
            }
            if self.polygons.len() > first_face {
                self.group_materials.push(primitive.material().index());
                self.groups.push(FaceGroup {
                    name: mesh.name().map_or(place, str::to_owned),
                    faces: first_face..self.polygons.len(),
                });
            }
        }
        Ok(())
    }

    /// Adds the vertices of a primitive with their texture coordinates and shapes; returns the
    /// first and how many there are.
    fn vertices(
        &mut self,
        mesh: usize,
        primitive: &Primitive<'_>,
        to_world: Matrix4<f64>,
        buffers: &Buffers<'_>,
    ) -> Result<(usize, usize), String> {
        let first = self.positions.len();
        let positions = primitive
            .get(&Semantic::Positions)
            .ok_or("has no positions")?;
        let positions = buffers.vectors(&positions)?;
        let count = positions.len();
        self.spend(count)?;
        self.positions.extend(
            positions
                .into_iter()
                .map(|p| to_world.transform_point(&Point::from(p.map(f64::from)))),
        );
        if let Some(accessor) = primitive.get(&Semantic::TexCoords(0)) {
            self.has_uvs = true;
            let uvs = buffers.coordinates(&accessor)?;
            self.coordinates
                .extend(uvs.into_iter().take(count).map(|[u, v]| [u, 1.0 - v]));
        }
        self.coordinates.resize(self.positions.len(), [0.0, 0.0]);
        let turn = to_world.fixed_view::<3, 3>(0, 0).into_owned();
        for (k, target) in primitive.morph_targets().enumerate() {
            let name = self.target_names.get(mesh).and_then(|names| names.get(k));
            let name = name.cloned().unwrap_or_else(|| format!("target_{k}"));
            let shape = self.shape(name);
            let Some(accessor) = target.positions() else {
                continue;
            };
            let deltas = buffers
                .vectors(&accessor)
                .map_err(|problem| format!("morph target {k} {problem}"))?;
            if deltas.len() != count {
                return Err(format!(
                    "morph target {k} has {} displacements, but there are {count} vertices",
                    deltas.len()
                ));
            }
            if let Some(v) = deltas.iter().position(|d| !d.iter().all(|c| c.is_finite())) {
                return Err(format!(
                    "morph target {k} has a displacement that is not a finite number, at vertex {v}"
                ));
            }
            let moved = (first as u32..).zip(deltas);
            let moved: Vec<(u32, Vector)> = moved
                .filter(|(_, d)| *d != [0.0; 3])
                .map(|(v, d)| (v, turn * Vector::from(d.map(f64::from))))
                .collect();
            self.spend(moved.len())?;
            self.shapes[shape].deltas.extend(moved);
        }
        Ok((first, count))
    }

    /// Index of the shape of a name, which is made where there is none.
    fn shape(&mut self, name: String) -> usize {
        let known = self.shapes.iter().position(|shape| shape.name == name);
        known.unwrap_or_else(|| {
            self.shapes.push(MeshShape {
                name,
                deltas: Vec::new(),
            });
            self.shapes.len() - 1
        })
    }

    fn finish(self, path: &Path) -> Result<MeshWithShapes, MeshIoError> {
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
        Ok(MeshWithShapes {
            mesh: mesh.with_groups(self.groups),
            shapes: self.shapes,
            group_materials: self.group_materials,
        })
    }
}

/// What a primitive's vertices are made of; `None` without positions.
fn accessors_of(primitive: &Primitive<'_>) -> Option<SharedVertices> {
    let index = |semantic| primitive.get(&semantic).map(|accessor| accessor.index());
    Some(SharedVertices {
        position_accessor: index(Semantic::Positions)?,
        uv_accessor: index(Semantic::TexCoords(0)),
        target_accessors: primitive
            .morph_targets()
            .map(|target| target.positions().map(|accessor| accessor.index()))
            .collect(),
        first: 0,
        count: 0,
    })
}

/// `extras.targetNames` of every mesh, whatever else stands there.
fn target_names(root: &Value) -> Vec<Vec<String>> {
    let names_of = |mesh: &Value| -> Vec<String> {
        let names = list(&mesh["extras"]["targetNames"]).iter();
        let names = names.map(|name| name.as_str().unwrap_or_default());
        names.map(str::to_owned).collect()
    };
    list(&root["meshes"]).iter().map(names_of).collect()
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

    /// Two primitives under a node that turns and scales: one with a dense and a sparse target,
    /// one with the sparse one alone, which stands second there too.
    const MORPHED: &str = r#"{
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [2, 2, 2], "translation": [5, 0, 0],
                   "rotation": [0, 0, 0.70710678, 0.70710678]}],
        "meshes": [{"extras": {"targetNames": ["jawOpen", "mouthSmile_L"]}, "weights": [1, 0],
          "primitives": [
            {"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}, {"POSITION": 2}]},
            {"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}, {"POSITION": 2}]},
            {"attributes": {"POSITION": 0}, "targets": [{}, {"POSITION": 2}]}]}],
        "accessors": [
          {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
           "min": [0, 0, 0], "max": [1, 1, 0]},
          {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"},
          {"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {"count": 1,
           "indices": {"bufferView": 2, "componentType": 5123},
           "values": {"bufferView": 3}}}],
        "bufferViews": [{"buffer": 0, "byteLength": 36},
          {"buffer": 0, "byteOffset": 36, "byteLength": 36},
          {"buffer": 0, "byteOffset": 72, "byteLength": 2},
          {"buffer": 0, "byteOffset": 76, "byteLength": 12}],
        "buffers": [{"uri": "face.bin", "byteLength": 88}]
    }"#;

    fn morphed(folder: &Path, json: &str) -> Result<MeshWithShapes, MeshIoError> {
        let positions = [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]];
        let dense = [[0f32, 0., 0.], [0., -1., 0.], [0., 0., 3.]];
        let floats = |list: &[[f32; 3]]| -> Vec<u8> {
            list.iter()
                .flatten()
                .flat_map(|c| c.to_le_bytes())
                .collect()
        };
        let mut buffer = [floats(&positions), floats(&dense)].concat();
        buffer.extend([2, 0, 0, 0]);
        buffer.extend(floats(&[[0.5, 0., 0.]]));
        std::fs::write(folder.join("face.bin"), buffer).unwrap();
        let path = folder.join("face.gltf");
        std::fs::write(&path, json).unwrap();
        crate::mesh::io::read_mesh_with_shapes(path)
    }

    #[test]
    fn morph_targets_are_shapes_under_their_node() {
        let folder = tempfile::tempdir().unwrap();
        let MeshWithShapes { mesh, shapes, .. } = morphed(folder.path(), MORPHED).unwrap();
        // The first two primitives share their vertices, the third has its own.
        assert_eq!((mesh.vertex_count(), mesh.face_count()), (6, 3));
        let names: Vec<&str> = shapes.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["jawOpen", "mouthSmile_L"]);
        let near = |a: Vector, b: [f64; 3]| (a - Vector::from(b)).norm() < 1e-6;
        // A quarter turn about z and twice the size, and no shift.
        let [(1, a), (2, b)] = shapes[0].deltas[..] else {
            panic!("{:?}", shapes[0]);
        };
        assert!(near(a, [2., 0., 0.]) && near(b, [0., 0., 6.]), "{a} {b}");
        let moved: Vec<u32> = shapes[1].deltas.iter().map(|d| d.0).collect();
        assert_eq!(moved, [2, 5]);
        assert!(shapes[1].deltas.iter().all(|d| near(d.1, [0., 1., 0.])));
        let posed = shapes[0].positions(&mesh);
        assert!(near(posed[1] - mesh.positions()[1], [2., 0., 0.]));
    }

    #[test]
    fn shapes_that_do_not_fit_or_would_swell_are_typed_errors() {
        let folder = tempfile::tempdir().unwrap();
        let many = format!(r#"{{"nodes": [{}0]}}"#, "0,".repeat(900));
        for (from, to, says) in [
            (
                r#""count": 3, "type": "VEC3", "sparse""#,
                r#""count": 4, "type": "VEC3", "sparse""#,
                "4 displacements",
            ),
            (
                r#""count": 3, "type": "VEC3", "sparse""#,
                r#""count": 4000000000, "type": "VEC3", "sparse""#,
                "without data",
            ),
            (
                r#""byteOffset": 76"#,
                r#""byteOffset": 77"#,
                "sparse values",
            ),
            (
                r#""byteOffset": 72"#,
                r#""byteOffset": 87"#,
                "sparse indices",
            ),
            (
                r#""sparse": {"count": 1"#,
                r#""sparse": {"count": 4"#,
                "4 sparse values",
            ),
            (
                r#"5126, "count": 3, "type": "VEC3"}"#,
                r#"5121, "count": 3, "type": "VEC3"}"#,
                "expected",
            ),
            (
                r#"5126, "count": 3, "type": "VEC3"}"#,
                r#"5126, "count": 3, "type": "VEC2"}"#,
                "expected",
            ),
            (r#"{"nodes": [0]}"#, &many, "too often"),
            ("face.bin", "%ff.bin", "not the name of a file"),
            (r#"{"POSITION": 0}"#, r#"{"POSITION": 9}"#, "in accessor 9"),
        ] {
            let json = MORPHED.replacen(from, to, 1);
            assert_ne!(json, MORPHED, "{from}");
            let error = morphed(folder.path(), &json).expect_err(says);
            assert!(matches!(error, MeshIoError::Malformed { .. }), "{error}");
            assert!(error.to_string().contains(says), "{to}: {error}");
        }
    }

    #[test]
    fn a_short_buffer_is_a_typed_error() {
        let folder = tempfile::tempdir().unwrap();
        let error = crate::mesh::io::read_mesh(triangle_file(folder.path(), 20)).unwrap_err();
        assert!(matches!(error, MeshIoError::Malformed { .. }), "{error}");
    }
}
