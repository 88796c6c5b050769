//! A glTF file as it is: its JSON, and the bytes that this speaks of.

use std::path::{Path, PathBuf};

use ::gltf::Gltf;
use ::gltf::buffer::{self, Data};
use ::gltf::image::Source;
use serde_json::Value;

use super::MeshIoError;

/// A glTF file, for what the meshes of it do not say: materials and their pictures.
pub(crate) struct GltfFile {
    /// The whole document.
    pub(crate) root: Value,
    path: PathBuf,
    document: ::gltf::Document,
    buffers: Vec<Data>,
}

impl GltfFile {
    /// Reads the document and its buffers.
    pub(crate) fn read(path: &Path) -> Result<Self, MeshIoError> {
        let bytes = std::fs::read(path).map_err(|source| MeshIoError::Read {
            path: path.to_owned(),
            source,
        })?;
        let malformed = |problem: String| MeshIoError::Malformed {
            path: path.to_owned(),
            format: "glTF",
            problem,
        };
        let (root, Gltf { document, blob }) = document_of(&bytes).map_err(malformed)?;
        let buffers = buffers_of(&document, blob, path).map_err(malformed)?;
        Ok(Self {
            root,
            path: path.to_owned(),
            document,
            buffers,
        })
    }

    /// Bytes of the picture with this index; the error says why there are none.
    pub(crate) fn image(&self, index: usize) -> Result<Vec<u8>, String> {
        let image = self.document.images().nth(index).ok_or("it is not there")?;
        match image.source() {
            Source::View { view, .. } => {
                let buffer = self.buffers.get(view.buffer().index());
                let end = view.offset().checked_add(view.length());
                let range = end.and_then(|end| buffer?.0.get(view.offset()..end));
                Ok(range.ok_or("it is not in its buffer")?.to_vec())
            }
            Source::Uri { uri, .. } if uri.starts_with("data:") => {
                Err("pictures inside the JSON are not read".to_owned())
            }
            Source::Uri { uri, .. } => {
                let name = decoded(uri).ok_or("its name is not text")?;
                let path = self.path.with_file_name(name);
                std::fs::read(path).map_err(|e| e.to_string())
            }
        }
    }
}

/// The files beside a glTF file that it speaks of: numbers and pictures; none for what is no
/// glTF.
pub(crate) fn gltf_companions(path: &Path) -> Vec<PathBuf> {
    let Ok(bytes) = std::fs::read(path) else {
        return Vec::new();
    };
    let root = document_of(&bytes).map_or(Value::Null, |(root, _)| root);
    let entries = ["buffers", "images"];
    let entries = entries.iter().flat_map(|kind| list(&root[*kind]));
    let uris = entries.filter_map(|entry| entry["uri"].as_str());
    let names = uris.filter(|uri| !uri.contains(':')).filter_map(decoded);
    names.map(|name| path.with_file_name(name)).collect()
}

/// The contents of a document's buffers.
pub(super) fn buffers_of(
    document: &::gltf::Document,
    blob: Option<Vec<u8>>,
    path: &Path,
) -> Result<Vec<Data>, String> {
    for buffer in document.buffers() {
        match buffer.source() {
            // The glTF crate takes for granted that names are text.
            buffer::Source::Uri(uri) if !uri.contains(':') && decoded(uri).is_none() => {
                return Err(format!("'{uri}' is not the name of a file"));
            }
            _ => {}
        }
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    ::gltf::import_buffers(document, Some(folder), blob).map_err(|e| e.to_string())
}

/// A relative URI without its percent signs; `None` where that is no text.
pub(super) fn decoded(uri: &str) -> Option<String> {
    let hex = |byte: Option<&u8>| byte.and_then(|b| char::from(*b).to_digit(16));
    let (bytes, mut decoded, mut k) = (uri.as_bytes(), Vec::new(), 0);
    while k < bytes.len() {
        match (bytes[k], hex(bytes.get(k + 1)), hex(bytes.get(k + 2))) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((16 * high + low) as u8);
                k += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                k += 1;
            }
        }
    }
    String::from_utf8(decoded).ok()
}

/// A document as plain JSON and as the glTF crate has it.
pub(super) fn document_of(bytes: &[u8]) -> Result<(Value, Gltf), String> {
    let glb;
    let json: &[u8] = if bytes.starts_with(b"glTF") {
        glb = ::gltf::Glb::from_slice(bytes).map_err(|e| e.to_string())?;
        &glb.json
    } else {
        bytes
    };
    let root: Value = serde_json::from_slice(json).map_err(|e| e.to_string())?;
    // The glTF crate looks the positions up before it has checked that they are there.
    let count = list(&root["accessors"]).len();
    for mesh in list(&root["meshes"]) {
        for primitive in list(&mesh["primitives"]) {
            let position = primitive["attributes"]["POSITION"].as_u64();
            if let Some(index) = position.filter(|&index| index >= count as u64) {
                return Err(format!(
                    "a primitive has its positions in accessor {index}, but there are {count}"
                ));
            }
        }
    }
    let document = Gltf::from_slice(bytes).map_err(|e| e.to_string())?;
    Ok((root, document))
}

pub(super) fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}
