//! Wavefront OBJ, written.

use std::io::{self, Write};
use std::path::Path;

use super::MeshIoError;
use crate::atomic_file::write_atomically;
use crate::mesh::Mesh;

/// Writes a mesh as OBJ: positions in the mesh's own units and order, polygons, texture
/// coordinates and groups. Numbers are written so that reading gives the same bits.
///
/// # Errors
///
/// [`MeshIoError::Write`]; a file that stood at `path` before is then left as it was.
pub fn write_obj(path: impl AsRef<Path>, mesh: &Mesh) -> Result<(), MeshIoError> {
    let path = path.as_ref();
    write_atomically(path, |out| write_to(out, mesh)).map_err(|source| MeshIoError::Write {
        path: path.to_owned(),
        source,
    })
}

fn write_to(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    for p in mesh.positions() {
        writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
    }
    if let Some(uvs) = mesh.uvs() {
        for [u, v] in &uvs.coordinates {
            writeln!(out, "vt {u} {v}")?;
        }
    }
    for (face, corners) in mesh.polygons().iter().enumerate() {
        write_group_change(out, mesh, face)?;
        write!(out, "f")?;
        let first = mesh.polygons().corner_range(face).start;
        for (k, vertex) in corners.iter().enumerate() {
            match mesh.uvs() {
                Some(uvs) => write!(out, " {}/{}", vertex + 1, uvs.corners[first + k] + 1)?,
                None => write!(out, " {}", vertex + 1)?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// A `g` line with every name in force from this face on, where that changes.
fn write_group_change(out: &mut dyn Write, mesh: &Mesh, face: usize) -> io::Result<()> {
    let changes = |g: &&crate::mesh::FaceGroup| g.faces.start == face || g.faces.end == face;
    if !mesh.groups().iter().any(|g| changes(&g)) {
        return Ok(());
    }
    write!(out, "g")?;
    for group in mesh.groups().iter().filter(|g| g.faces.contains(&face)) {
        // A space would end the name.
        write!(out, " {}", group.name.replace(char::is_whitespace, "_"))?;
    }
    writeln!(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::io::parse_obj;

    #[test]
    fn what_is_written_is_read_back_bit_for_bit() {
        let text = "v 0.1 -1e-17 3\nv 1 0 0.30000000000000004\nv 1 1 1e20\nv 0 1 0\nv 5 5 5\n\
                    vt 0.25 0.3\nvt 1 1\ng skin\nf 1/1 2/2 3/1 4/1\ng\nf 1/1 3/1 5/2\n\
                    g lips\nf 2/1 5/1 3/1\n";
        let mesh = parse_obj(text, Path::new("in.obj")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.obj");
        write_obj(&path, &mesh).unwrap();
        let again = crate::mesh::io::read_mesh(&path).unwrap();
        assert_eq!(mesh, again);
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let mesh = parse_obj("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", Path::new("x")).unwrap();
        let error = write_obj("no/such/folder/out.obj", &mesh).unwrap_err();
        assert!(matches!(error, MeshIoError::Write { .. }));
    }
}
