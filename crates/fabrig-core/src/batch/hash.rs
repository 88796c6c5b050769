//! SHA-256 of files and settings: what a job's result depends on, in 64 letters.
//!
//! Source: FIPS 180-4.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::Serialize;
use sha2::{Digest as _, Sha256};

use super::entry::is_a;
use crate::mesh::io::gltf_companions;
use crate::rig::FORMAT_VERSION;
use crate::template::human_files;

/// Changed whenever what jobs do changes without any of their inputs.
const BATCH_VERSION: u32 = 1;

/// Hexadecimal SHA-256.
pub(super) type Digest = String;

/// Gathers what a result depends on; every part has a name and a length, so that no two
/// different lists are one text.
pub(super) struct KeyBuilder(Sha256);

impl KeyBuilder {
    /// - `stage`: what the job does
    pub(super) fn new(stage: &str) -> Self {
        let key = Self(Sha256::new());
        key.with("stage", stage)
            .with("fabrig", env!("CARGO_PKG_VERSION"))
            .with("batch", &BATCH_VERSION.to_string())
            .with("rig", &FORMAT_VERSION.to_string())
    }

    pub(super) fn with(mut self, name: &str, value: &str) -> Self {
        for text in [name, value] {
            self.0.update((text.len() as u64).to_le_bytes());
            self.0.update(text.as_bytes());
        }
        self
    }

    /// Adds settings as JSON: fields in the order of their declaration, so equal settings are
    /// equal texts.
    pub(super) fn with_settings(self, name: &str, settings: &impl Serialize) -> Self {
        // Plain structs of numbers, texts and lists are always JSON.
        let text = serde_json::to_string(settings).unwrap_or_default();
        self.with(name, &text)
    }

    pub(super) fn finish(self) -> Digest {
        hexadecimal(&self.0.finalize())
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        // Writing to a string does not fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

fn add_file(hash: &mut Sha256, path: &Path) -> io::Result<u64> {
    let mut file = File::open(path)?;
    let mut buffer = vec![0; 1 << 18];
    let mut length = 0;
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            return Ok(length);
        }
        length += count as u64;
        hash.update(&buffer[..count]);
    }
}

/// Content and size of a file, or of all files of a folder with their names.
///
/// # Errors
///
/// What the system says.
pub(super) fn measure(path: &Path) -> io::Result<(Digest, u64)> {
    let mut hash = Sha256::new();
    if !path.is_dir() {
        let length = add_file(&mut hash, path)?;
        return Ok((hexadecimal(&hash.finalize()), length));
    }
    let mut total = 0;
    let mut entries = std::fs::read_dir(path)?.collect::<io::Result<Vec<_>>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let (digest, length) = measure(&entry.path())?;
        hash.update(entry.file_name().as_encoded_bytes());
        hash.update([0]);
        hash.update(digest.as_bytes());
        total += length;
    }
    Ok((hexadecimal(&hash.finalize()), total))
}

/// Content of a file that a job reads, or of a folder; what a mesh speaks of (buffers, materials,
/// pictures) goes with it.
///
/// # Errors
///
/// What the system says.
pub(super) fn digest_input(path: &Path) -> io::Result<Digest> {
    let (own, _) = measure(path)?;
    let companions = if is_a(path, "gltf") || is_a(path, "glb") {
        gltf_companions(path)
    } else if is_a(path, "obj") {
        obj_companions(path)
    } else {
        Vec::new()
    };
    if companions.is_empty() {
        return Ok(own);
    }
    let mut key = KeyBuilder::new("mesh").with("file", &own);
    for file in companions {
        // One that cannot be read is said by the job that needs it.
        let digest = measure(&file).map_or_else(|_| String::new(), |(digest, _)| digest);
        key = key.with("beside", &digest);
    }
    Ok(key.finish())
}

/// The material libraries of an OBJ file, and their pictures.
fn obj_companions(path: &Path) -> Vec<PathBuf> {
    let named = |path: &Path, keyword: &str| -> Vec<String> {
        let bytes = std::fs::read(path).unwrap_or_default();
        let text = String::from_utf8_lossy(&bytes);
        let lines = text
            .lines()
            .filter_map(|line| line.trim().split_once(char::is_whitespace));
        let found = lines.filter(|(first, _)| *first == keyword);
        found.map(|(_, rest)| rest.trim().to_owned()).collect()
    };
    let mut files = Vec::new();
    for library in named(path, "mtllib") {
        let library = path.with_file_name(library);
        for line in named(&library, "map_Kd") {
            let name = line.split_whitespace().next_back().unwrap_or_default();
            files.push(library.with_file_name(name.replace('\\', "/")));
        }
        files.push(library);
    }
    files
}

/// The bundled template.
pub(super) fn digest_human() -> Digest {
    let files = human_files();
    let mut hash = Sha256::new();
    for bytes in [
        files.description.as_bytes(),
        files.geometry,
        files.identity,
        files.patch_layout.as_bytes(),
        files.action_units.as_bytes(),
        files.materials.as_bytes(),
        files.skin_weights,
    ] {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    }
    hexadecimal(&hash.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_the_standards() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        let (digest, length) = measure(&path).unwrap();
        assert_eq!(
            digest,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
        assert_eq!(length, 3);
        let (before, _) = measure(folder.path()).unwrap();
        std::fs::rename(&path, folder.path().join("abd")).unwrap();
        let (after, _) = measure(folder.path()).unwrap();
        assert_ne!(before, after);
    }

    #[test]
    fn a_mesh_is_its_materials_too() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let face = put("face.obj", "mtllib face.mtl\nv 0 0 0\n");
        let mut digests = vec![digest_input(&face).unwrap()];
        put("face.mtl", "newmtl skin\nmap_Kd -s 1 1 skin.png\n");
        digests.push(digest_input(&face).unwrap());
        put("skin.png", "red");
        digests.push(digest_input(&face).unwrap());
        put("skin.png", "blue");
        digests.push(digest_input(&face).unwrap());
        let same = put("other.png", "green");
        assert_eq!(digest_input(&face).unwrap(), digests[3]);
        std::fs::remove_file(same).unwrap();
        digests.sort();
        digests.dedup();
        assert_eq!(digests.len(), 4);
    }

    #[test]
    fn parts_do_not_run_into_each_other() {
        let key = |a: &str, b: &str| KeyBuilder::new("x").with(a, b).finish();
        assert_ne!(key("ab", "c"), key("a", "bc"));
        assert_eq!(key("ab", "c"), key("ab", "c"));
    }
}
