//! Materials of an OBJ file: `usemtl`, and what its `mtllib` says of them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::material::mime_of;
use super::{Appearance, AppearanceError, Material, Picture};
use crate::mesh::Mesh;
use crate::mesh::io::logical_lines;

/// Grey of a material that nothing is known of.
const UNKNOWN: [f64; 4] = [0.6, 0.6, 0.6, 1.0];

/// Reads the materials of an OBJ file and the one of each polygon.
pub(super) fn read(
    path: &Path,
    mesh: &Mesh,
    notes: &mut Vec<String>,
) -> Result<Appearance, AppearanceError> {
    let failed = |e: std::io::Error| AppearanceError::Unreadable {
        path: path.to_owned(),
        reason: e.to_string(),
    };
    let bytes = std::fs::read(path).map_err(failed)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut names: Vec<String> = Vec::new();
    let mut libraries: Vec<PathBuf> = Vec::new();
    let mut current = None;
    let mut of_polygon = Vec::with_capacity(mesh.face_count());
    for (_, line) in logical_lines(&text) {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match keyword {
            "usemtl" => current = Some(index_of(&mut names, rest.trim())),
            "f" | "fo" => {
                let material = *current.get_or_insert_with(|| index_of(&mut names, "default"));
                of_polygon.push(material);
            }
            "mtllib" => libraries.push(path.with_file_name(rest.trim())),
            _ => {}
        }
    }
    let mut appearance = Appearance::default();
    // The very lines that the mesh was read from: one a polygon.
    debug_assert_eq!(of_polygon.len(), mesh.face_count());
    of_polygon.resize(mesh.face_count(), 0);
    if !text.contains("usemtl") {
        notes.push(format!("{} has no materials", path.display()));
        return Ok(appearance);
    }
    let mut known = HashMap::new();
    let mut files = Vec::new();
    for library in libraries {
        match std::fs::read(&library) {
            Ok(bytes) => {
                let text = String::from_utf8_lossy(&bytes);
                let into = (&mut appearance, &mut files);
                read_library(&text, &library, into, &mut known, notes);
            }
            Err(e) => notes.push(format!("{} is left out: {e}", library.display())),
        }
    }
    // In the order of use; what the library has besides is left out.
    appearance.materials = names
        .iter()
        .map(|name| match known.remove(name) {
            Some(material) => material,
            None => Material::new(name, UNKNOWN, 0.6, 0.0, None),
        })
        .collect();
    appearance.of_polygon = of_polygon;
    Ok(appearance)
}

fn index_of(names: &mut Vec<String>, name: &str) -> u32 {
    let known = names.iter().position(|n| n == name);
    known.unwrap_or_else(|| {
        names.push(name.to_owned());
        names.len() - 1
    }) as u32
}

/// What a library says of one material.
struct Entry {
    name: String,
    color: [f64; 4],
    roughness: f64,
    metallic: f64,
    picture: Option<String>,
}

fn read_library(
    text: &str,
    path: &Path,
    (appearance, files): (&mut Appearance, &mut Vec<PathBuf>),
    known: &mut HashMap<String, Material>,
    notes: &mut Vec<String>,
) {
    let mut entries: Vec<Entry> = Vec::new();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        let words: Vec<&str> = words.collect();
        let number = |k: usize| words.get(k).and_then(|w| w.parse::<f64>().ok());
        if keyword == "newmtl" {
            entries.push(Entry {
                name: words.join(" "),
                color: UNKNOWN,
                roughness: 0.6,
                metallic: 0.0,
                picture: None,
            });
        }
        let Some(entry) = entries.last_mut() else {
            continue;
        };
        let share = |x: f64| x.clamp(0.0, 1.0);
        match (keyword, number(0)) {
            ("Kd", Some(red)) => {
                let [green, blue] = [1, 2].map(|k| number(k).unwrap_or(red));
                entry.color[..3].copy_from_slice(&[red, green, blue].map(share));
            }
            ("d", Some(opacity)) => entry.color[3] = share(opacity),
            ("Tr", Some(transparency)) => entry.color[3] = share(1.0 - transparency),
            ("Pr", Some(roughness)) => entry.roughness = share(roughness),
            ("Pm", Some(metallic)) => entry.metallic = share(metallic),
            // Blinn-Phong exponent to the roughness of the same lobe.
            ("Ns", Some(exponent)) => {
                entry.roughness = share((2.0 / (exponent.max(0.0) + 2.0)).sqrt().sqrt());
            }
            ("map_Kd", _) => entry.picture = words.last().map(|w| (*w).to_owned()),
            _ => {}
        }
    }
    for entry in entries {
        let picture = entry.picture.and_then(|name| {
            let file = path.with_file_name(name.replace('\\', "/"));
            picture(file, appearance, files, notes)
        });
        let color = if picture.is_some() {
            [1.0, 1.0, 1.0, entry.color[3]]
        } else {
            entry.color
        };
        let Entry {
            name,
            roughness,
            metallic,
            ..
        } = entry;
        let material = Material::new(&name, color, roughness, metallic, picture);
        known.entry(name).or_insert(material);
    }
}

/// Texture and picture of a file, read once: `files` holds those that were.
fn picture(
    file: PathBuf,
    appearance: &mut Appearance,
    files: &mut Vec<PathBuf>,
    notes: &mut Vec<String>,
) -> Option<(usize, usize)> {
    if let Some(k) = files.iter().position(|known| *known == file) {
        return Some((k, k));
    }
    let bytes = match std::fs::read(&file) {
        Ok(bytes) => bytes,
        Err(e) => {
            notes.push(format!("{} is left out: {e}", file.display()));
            return None;
        }
    };
    let Some(mime) = mime_of(&bytes) else {
        notes.push(format!(
            "{} is left out: neither PNG nor JPEG",
            file.display()
        ));
        return None;
    };
    let picture = Picture {
        name: file.file_stem()?.to_string_lossy().into_owned(),
        mime: mime.to_owned(),
        bytes,
    };
    let index = appearance.keep(picture, notes)?;
    let texture = serde_json::json!({"source": index});
    appearance.textures.push(texture);
    files.push(file);
    Some((index, index))
}
