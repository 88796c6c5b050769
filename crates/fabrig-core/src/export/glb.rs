//! glTF 2.0: one mesh, one primitive a material, shapes as morph targets, a take as an
//! animation of their weights and of the node that is the head.
//!
//! All primitives share one list of vertices: the user's, in order, then those that texture
//! seams split (`_ORIGINAL_VERTEX` says which each one is). So the targets and their order are
//! the same on every primitive by construction.
//!
//! Source: Khronos, glTF 2.0 Specification.

use std::path::Path;

use serde_json::{Map, Value, json};

use super::ExportError;
use super::face::{ExportFace, Shape, WeightAnimation, single};
use super::gltf_buffer::{BufferBuilder, Target};
use super::seams::SplitVertices;
use crate::atomic_file::write_atomically;
use crate::mesh::appearance::Appearance;
use crate::{Point, Vector};

/// Changes of normals below this are left out.
const SMALLEST_TURN: f64 = 1e-4;

/// What was written.
pub(super) struct Written {
    pub(super) files: usize,
    pub(super) bytes: u64,
    pub(super) vertices: usize,
}

/// Writes a face as `.glb`, or as `.gltf` with its buffer as `.bin` beside it.
pub(super) fn write(
    path: &Path,
    face: &ExportFace,
    shapes: &[Shape],
    animation: Option<&WeightAnimation>,
    is_binary: bool,
) -> Result<Written, ExportError> {
    let split = SplitVertices::new(face.positions.len(), &face.polygons, face.uvs.as_ref());
    let mut buffer = BufferBuilder::default();
    let mut root = document(face, shapes, &split, &mut buffer);
    if let Some(animation) = animation {
        root.insert("animations".to_owned(), animated(animation, &mut buffer));
    }
    let io = ExportError::io(path);
    let mut written = Written {
        files: 1,
        bytes: 0,
        vertices: split.vertex_of.len(),
    };
    let name = path.with_extension("bin");
    let mut entry = json!({"byteLength": buffer.bytes.len()});
    if !is_binary {
        let name = name.file_name().unwrap_or_default().to_string_lossy();
        entry["uri"] = json!(escaped(&name));
    }
    root.insert("bufferViews".to_owned(), Value::Array(buffer.views));
    root.insert("accessors".to_owned(), Value::Array(buffer.accessors));
    root.insert("buffers".to_owned(), json!([entry]));
    let mut text = Value::Object(root).to_string().into_bytes();
    if !is_binary {
        written.files = 2;
        written.bytes = (text.len() + buffer.bytes.len()) as u64;
        write_atomically(&name, |out| out.write_all(&buffer.bytes))
            .map_err(ExportError::io(&name))?;
        write_atomically(path, |out| out.write_all(&text)).map_err(io)?;
        return Ok(written);
    }
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut data = buffer.bytes;
    data.resize(data.len().next_multiple_of(4), 0);
    written.bytes = (12 + 8 + text.len() + 8 + data.len()) as u64;
    let too_large = |_| ExportError::TooLarge {
        path: path.to_owned(),
        bytes: written.bytes,
        format: "GLB",
    };
    let total = u32::try_from(written.bytes).map_err(too_large)?;
    write_atomically(path, |out| {
        out.write_all(b"glTF")?;
        for word in [2, total, text.len() as u32] {
            out.write_all(&word.to_le_bytes())?;
        }
        out.write_all(b"JSON")?;
        out.write_all(&text)?;
        out.write_all(&(data.len() as u32).to_le_bytes())?;
        out.write_all(b"BIN\0")?;
        out.write_all(&data)
    })
    .map_err(io)?;
    Ok(written)
}

fn document(
    face: &ExportFace,
    shapes: &[Shape],
    split: &SplitVertices,
    buffer: &mut BufferBuilder,
) -> Map<String, Value> {
    let count = split.vertex_of.len();
    let flat = |of: &dyn Fn(usize) -> [f32; 3]| -> Vec<f32> {
        let vertices = split.vertex_of.iter();
        vertices.flat_map(|&v| of(v as usize)).collect()
    };
    let normals = face.normals(&face.positions);
    let positions = flat(&|v| single(&face.positions[v].coords));
    let mut attributes = json!({
        "POSITION": buffer.floats(&positions, 3, Target::Vertices),
        "NORMAL": buffer.floats(&flat(&|v| single(&normals[v])), 3, Target::Vertices),
    });
    if let Some(uvs) = &split.uvs {
        let flipped: Vec<f32> = uvs.iter().flat_map(|[u, v]| [*u, 1.0 - v]).collect();
        attributes["TEXCOORD_0"] = json!(buffer.floats(&flipped, 2, Target::Vertices));
    }
    // Programs that load primitives one by one lose the order.
    let original: Vec<f32> = split.vertex_of.iter().map(|&v| v as f32).collect();
    attributes["_ORIGINAL_VERTEX"] = json!(buffer.floats(&original, 1, Target::Vertices));
    let targets: Vec<Value> = shapes
        .iter()
        .map(|shape| {
            let (offsets, turns) = target(face, shape, &normals, split);
            json!({
                "POSITION": buffer.offsets(count, &offsets),
                "NORMAL": buffer.offsets(count, &turns),
            })
        })
        .collect();
    let primitives: Vec<Value> = face
        .sections
        .iter()
        .map(|section| {
            let mut indices = Vec::new();
            for &polygon in &section.polygons {
                let corners = &split.corners[face.polygons.corner_range(polygon as usize)];
                for k in 1..corners.len() - 1 {
                    indices.extend([corners[0], corners[k], corners[k + 1]]);
                }
            }
            let mut primitive = json!({
                "attributes": attributes,
                "indices": buffer.indices(&indices),
                "material": section.material,
            });
            if !targets.is_empty() {
                primitive["targets"] = json!(targets);
            }
            primitive
        })
        .collect();
    let mut mesh = json!({
        "name": face.name,
        "primitives": primitives,
        "extras": {"originalVertexCount": face.positions.len()},
    });
    if !shapes.is_empty() {
        let names: Vec<&str> = shapes.iter().map(|s| s.name.as_str()).collect();
        mesh["weights"] = json!(vec![0.0; shapes.len()]);
        mesh["extras"]["targetNames"] = json!(names);
    }
    let mut root = Map::new();
    let generator = concat!("fabrig ", env!("CARGO_PKG_VERSION"));
    root.insert(
        "asset".to_owned(),
        json!({"version": "2.0", "generator": generator}),
    );
    root.insert("scene".to_owned(), json!(0));
    root.insert("scenes".to_owned(), json!([{"nodes": [0]}]));
    root.insert("nodes".to_owned(), json!([{"name": face.name, "mesh": 0}]));
    root.insert("meshes".to_owned(), json!([mesh]));
    write_materials(&face.appearance, &mut root, buffer);
    root
}

/// Adds materials, their pictures and how those are sampled.
fn write_materials(
    appearance: &Appearance,
    root: &mut Map<String, Value>,
    buffer: &mut BufferBuilder,
) {
    let materials: Vec<&Value> = appearance.materials.iter().map(|m| &m.gltf).collect();
    root.insert("materials".to_owned(), json!(materials));
    let images: Vec<Value> = appearance
        .pictures
        .iter()
        .map(|picture| {
            let view = buffer.view(&picture.bytes, Target::Other);
            json!({"name": picture.name, "mimeType": picture.mime, "bufferView": view})
        })
        .collect();
    for (name, list) in [
        ("textures", appearance.textures.clone()),
        ("samplers", appearance.samplers.clone()),
        ("images", images),
    ] {
        if !list.is_empty() {
            root.insert(name.to_owned(), Value::Array(list));
        }
    }
    if !appearance.extensions.is_empty() {
        root.insert("extensionsUsed".to_owned(), json!(appearance.extensions));
    }
}

/// Offsets of the vertices and of their normals.
type Offsets = Vec<(u32, [f32; 3])>;

fn target(
    face: &ExportFace,
    shape: &Shape,
    normals: &[Vector],
    split: &SplitVertices,
) -> (Offsets, Offsets) {
    let mut dense = vec![Vector::zeros(); face.positions.len()];
    for &(vertex, offset) in &shape.offsets {
        dense[vertex as usize] = offset;
    }
    let moved: Vec<Point> = face
        .positions
        .iter()
        .zip(&dense)
        .map(|(p, d)| p + d)
        .collect();
    let turned = face.normals(&moved);
    let (mut offsets, mut turns) = (Vec::new(), Vec::new());
    for (index, &vertex) in (0u32..).zip(&split.vertex_of) {
        let v = vertex as usize;
        if dense[v] != Vector::zeros() {
            offsets.push((index, single(&dense[v])));
        }
        let turn = turned[v] - normals[v];
        if turn.norm() > SMALLEST_TURN {
            turns.push((index, single(&turn)));
        }
    }
    (offsets, turns)
}

fn animated(animation: &WeightAnimation, buffer: &mut BufferBuilder) -> Value {
    let times: Vec<f32> = animation.times.iter().map(|t| *t as f32).collect();
    let input = buffer.floats(&times, 1, Target::Other);
    let mut samplers = Vec::new();
    let mut channels = Vec::new();
    let mut channel = |path: &str, output: usize| {
        channels.push(json!({"sampler": samplers.len(), "target": {"node": 0, "path": path}}));
        samplers.push(json!({"input": input, "output": output, "interpolation": "LINEAR"}));
    };
    let weights: Vec<f32> = animation.weights.iter().flatten().copied().collect();
    if !weights.is_empty() {
        channel("weights", buffer.floats(&weights, 1, Target::Other));
    }
    if !animation.heads.is_empty() {
        let shifts = animation
            .heads
            .iter()
            .map(|h| single(&h.translation.vector));
        let shifts: Vec<f32> = shifts.flatten().collect();
        channel("translation", buffer.floats(&shifts, 3, Target::Other));
        let mut turns: Vec<f32> = Vec::new();
        let mut before = nalgebra::Quaternion::identity();
        for head in &animation.heads {
            // Of the two quaternions of a rotation the one nearer to the last.
            let mut q = head.rotation.into_inner();
            if q.dot(&before) < 0.0 {
                q = -q;
            }
            before = q;
            turns.extend([q.i, q.j, q.k, q.w].map(|x| x as f32));
        }
        channel("rotation", buffer.floats(&turns, 4, Target::Other));
    }
    json!([{"name": animation.name, "samplers": samplers, "channels": channels}])
}

/// A file name as a relative URI.
fn escaped(name: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-._~".contains(&b);
    name.bytes()
        .map(|b| {
            if plain(b) {
                char::from(b).to_string()
            } else {
                format!("%{b:02X}")
            }
        })
        .collect()
}
