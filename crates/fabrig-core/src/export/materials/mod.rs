//! Materials of a face: those of the mesh that it was made from, or plain colours by what its
//! pieces are.

mod gltf;
mod obj;
mod plain;

use serde_json::{Map, Value, json};

use super::gltf_buffer::{BufferBuilder, Target};
use super::{ExportError, writer::Notes};
use crate::mesh::Mesh;
use std::path::Path;

pub(super) use plain::{of_parts, of_surfaces};

/// A material.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Material {
    pub(super) name: String,
    /// Linear red, green, blue, and opacity.
    pub(super) color: [f64; 4],
    pub(super) roughness: f64,
    pub(super) metallic: f64,
    /// Index of the picture that colours it.
    pub(super) picture: Option<usize>,
    /// As glTF has it, textures by their index in [`Materials::textures`].
    gltf: Value,
}

impl Material {
    /// - `texture`: index of a texture and of its picture
    fn new(
        name: &str,
        color: [f64; 4],
        roughness: f64,
        metallic: f64,
        texture: Option<(usize, usize)>,
    ) -> Self {
        let mut gltf = json!({
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorFactor": color,
                "metallicFactor": metallic,
                "roughnessFactor": roughness,
            },
        });
        if let Some((texture, _)) = texture {
            gltf["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture});
        }
        if color[3] < 1.0 {
            gltf["alphaMode"] = json!("BLEND");
        }
        Self {
            name: name.to_owned(),
            color,
            roughness,
            metallic,
            picture: texture.map(|(_, picture)| picture),
            gltf,
        }
    }
}

/// A picture that materials use, as it is in its file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Picture {
    pub(super) name: String,
    /// `image/png` or `image/jpeg`.
    pub(super) mime: String,
    pub(super) bytes: Vec<u8>,
}

impl Picture {
    /// The extension of a file with it.
    pub(super) fn extension(&self) -> &'static str {
        if self.mime == "image/jpeg" {
            "jpg"
        } else {
            "png"
        }
    }
}

/// What a picture is, by its first bytes.
fn mime_of(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some("image/png")
    } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        Some("image/jpeg")
    } else {
        None
    }
}

/// All materials of a face with what they use.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Materials {
    pub(super) list: Vec<Material>,
    pub(super) pictures: Vec<Picture>,
    textures: Vec<Value>,
    samplers: Vec<Value>,
    extensions: Vec<String>,
}

impl Materials {
    /// Adds them to a glTF document.
    pub(super) fn write_gltf(&self, root: &mut Map<String, Value>, buffer: &mut BufferBuilder) {
        let materials: Vec<&Value> = self.list.iter().map(|m| &m.gltf).collect();
        root.insert("materials".to_owned(), json!(materials));
        let images: Vec<Value> = self
            .pictures
            .iter()
            .map(|picture| {
                let view = buffer.view(&picture.bytes, Target::Other);
                json!({"name": picture.name, "mimeType": picture.mime, "bufferView": view})
            })
            .collect();
        for (name, list) in [
            ("textures", self.textures.clone()),
            ("samplers", self.samplers.clone()),
            ("images", images),
        ] {
            if !list.is_empty() {
                root.insert(name.to_owned(), Value::Array(list));
            }
        }
        if !self.extensions.is_empty() {
            root.insert("extensionsUsed".to_owned(), json!(self.extensions));
        }
    }

    /// Names in order.
    pub(super) fn names(&self) -> Vec<String> {
        self.list.iter().map(|m| m.name.clone()).collect()
    }
}

/// The materials of the mesh that a face was made from, and the one of each of its polygons.
///
/// Polygons that the source does not have in their place (a face whose lips were cut apart) take
/// the material of the polygons about their vertices; linings and eyeballs that the cut added
/// get one of their own.
pub(super) fn of_source(
    path: &Path,
    face: &Mesh,
    notes: &mut Notes,
) -> Result<(Materials, Vec<u32>), ExportError> {
    let file = crate::mesh::io::read_mesh_with_shapes(path)?;
    let source = &file.mesh;
    if source.vertex_count() > face.vertex_count() {
        return Err(ExportError::OtherFace {
            path: path.to_owned(),
            what: "vertices",
            expected: face.vertex_count(),
            found: source.vertex_count(),
        });
    }
    let is_same =
        |k: usize, corners: &[u32]| k < source.face_count() && source.polygons().face(k) == corners;
    let faces = || face.polygons().iter().enumerate();
    // A cut changes few and adds fewer than there are.
    let same = faces().filter(|&(k, corners)| is_same(k, corners)).count();
    if 2 * same < face.face_count() {
        return Err(ExportError::OtherFace {
            path: path.to_owned(),
            what: "polygons",
            expected: face.face_count(),
            found: source.face_count(),
        });
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let (mut materials, of_polygon) = match extension.to_ascii_lowercase().as_str() {
        "obj" => obj::read(path, source, notes)?,
        "gltf" | "glb" => gltf::read(path, &file, notes)?,
        _ => {
            notes.add(format!("{} has no materials", path.display()));
            (Materials::default(), Vec::new())
        }
    };
    if materials.list.is_empty() {
        return Ok((materials, Vec::new()));
    }
    let mut of_vertex: Vec<Vec<u32>> = vec![Vec::new(); face.vertex_count()];
    for (polygon, &material) in source.polygons().iter().zip(&of_polygon) {
        for &vertex in polygon {
            of_vertex[vertex as usize].push(material);
        }
    }
    let mut lining = None;
    let of_face = faces()
        .map(|(k, corners)| {
            if is_same(k, corners) {
                return of_polygon[k];
            }
            let mut votes = vec![0u32; materials.list.len()];
            for &vertex in corners {
                for &material in &of_vertex[vertex as usize] {
                    votes[material as usize] += 1;
                }
            }
            let best = (0..votes.len()).max_by_key(|&m| (votes[m], std::cmp::Reverse(m)));
            match best.filter(|&m| votes[m] > 0) {
                Some(material) => material as u32,
                None => *lining.get_or_insert(votes.len() as u32),
            }
        })
        .collect();
    if lining.is_some() {
        let color = plain::linear([150, 80, 76]);
        materials
            .list
            .push(Material::new("lining", color, 0.5, 0.0, None));
    }
    Ok((materials, of_face))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Polygons;

    #[test]
    fn polygons_that_a_cut_changed_or_added_have_materials_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("face.obj");
        let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n\
                    usemtl skin\nf 1 2 3 4\nf 1 2 3\nusemtl lips\nf 2 5 6 3\n";
        std::fs::write(&path, text).unwrap();
        let source = crate::mesh::io::read_mesh(&path).unwrap();
        let mut positions = source.positions().to_vec();
        positions.extend(source.positions()[..4].iter().map(|p| p * 2.0));
        // Two are as they were, one lost a corner, one is new.
        let polygons =
            Polygons::from_faces([&[0u32, 1, 2, 3][..], &[0, 1, 2], &[4, 5, 2], &[6, 7, 8, 9]]);
        let face = Mesh::new(positions, polygons).unwrap();
        let mut notes = Notes::default();
        let (materials, of_polygon) = of_source(&path, &face, &mut notes).unwrap();
        assert_eq!(materials.names(), ["skin", "lips", "lining"]);
        assert_eq!(of_polygon, [0, 0, 1, 2]);
        let other = Polygons::from_faces([[5u32, 4, 3]]);
        let other = Mesh::new(source.positions().to_vec(), other).unwrap();
        let error = of_source(&path, &other, &mut notes).unwrap_err();
        assert!(
            matches!(
                error,
                ExportError::OtherFace {
                    what: "polygons",
                    ..
                }
            ),
            "{error}"
        );
    }
}
