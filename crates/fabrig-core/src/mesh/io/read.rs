//! Picks the reader by the file's extension.

use std::path::Path;

use super::{MeshIoError, MeshWithShapes, gltf, obj, ply, stl};
use crate::mesh::Mesh;

/// Reads a mesh file: `.obj`, `.ply`, `.stl`, `.gltf` or `.glb`, in any case.
///
/// Vertices keep the file's order and units (glTF is in metres by definition). STL has no
/// shared vertices; equal corners become one.
///
/// # Errors
///
/// [`MeshIoError`]: the file is missing, of an unknown kind, malformed, empty, has a
/// coordinate that is not finite, or an index that is out of range.
pub fn read_mesh(path: impl AsRef<Path>) -> Result<Mesh, MeshIoError> {
    Ok(read(path.as_ref())?.mesh)
}

/// Whether a file is of a kind that [`read_mesh`] reads, by its name.
pub fn is_mesh_file(path: impl AsRef<Path>) -> bool {
    parser_of(&extension_of(path.as_ref())).is_some()
}

type Parse = fn(&[u8], &Path) -> Result<MeshWithShapes, MeshIoError>;

fn extension_of(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_ascii_lowercase()
}

fn parser_of(extension: &str) -> Option<Parse> {
    Some(match extension {
        // Names may be in any encoding; everything that matters is ASCII.
        "obj" => |bytes, path| Ok(obj::parse_obj(&String::from_utf8_lossy(bytes), path)?.into()),
        "ply" => |bytes, path| Ok(ply::parse_ply(bytes, path)?.into()),
        "stl" => |bytes, path| Ok(stl::parse_stl(bytes, path)?.into()),
        "gltf" | "glb" => gltf::parse_gltf,
        _ => return None,
    })
}

/// The mesh with its shapes.
pub(super) fn read(path: &Path) -> Result<MeshWithShapes, MeshIoError> {
    let extension = extension_of(path);
    let Some(parse) = parser_of(&extension) else {
        return Err(MeshIoError::UnknownFormat {
            path: path.to_owned(),
            extension,
        });
    };
    let bytes = std::fs::read(path).map_err(|source| MeshIoError::Read {
        path: path.to_owned(),
        source,
    })?;
    parse(&bytes, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_and_unknown_files_are_named() {
        let missing = read_mesh("no/such/face.obj").unwrap_err();
        assert!(matches!(missing, MeshIoError::Read { .. }), "{missing}");
        let unknown = read_mesh("face.fbx").unwrap_err();
        assert!(unknown.to_string().contains("'fbx'"), "{unknown}");
    }

    #[test]
    fn real_faces_are_read_whole() {
        let Some(shared) = std::env::var_os("FABRIG_SHARED") else {
            return;
        };
        let faces = Path::new(&shared).join("faces");
        for (name, vertex_count, face_count) in [
            ("ict_neutral.obj", 11_248, 11_144),
            ("lee_perry_smith.obj", 8_839, 17_678),
            ("mediapipe_canonical.obj", 468, 898),
        ] {
            let mesh = read_mesh(faces.join(name)).unwrap();
            assert_eq!(
                (mesh.vertex_count(), mesh.face_count()),
                (vertex_count, face_count)
            );
        }
    }
}
