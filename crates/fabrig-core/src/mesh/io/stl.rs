//! STL, ASCII and binary.

use std::io::Cursor;
use std::path::Path;

use super::MeshIoError;
use crate::Point;
use crate::mesh::Mesh;

/// Reads triangles; corners at the very same place become one vertex, in order of first use.
///
/// # Errors
///
/// See [`super::read_mesh`].
pub(super) fn parse_stl(bytes: &[u8], path: &Path) -> Result<Mesh, MeshIoError> {
    let malformed = |problem: String| MeshIoError::Malformed {
        path: path.to_owned(),
        format: "STL",
        problem,
    };
    check_binary_length(bytes).map_err(malformed)?;
    let stl =
        stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|error| malformed(error.to_string()))?;
    let positions: Vec<Point> = stl
        .vertices
        .iter()
        .map(|v| Point::from(v.0.map(f64::from)))
        .collect();
    let triangles: Vec<[u32; 3]> = stl
        .faces
        .iter()
        .map(|f| f.vertices.map(|v| u32::try_from(v).unwrap_or(u32::MAX)))
        .collect();
    if triangles.is_empty() {
        return Err(MeshIoError::Empty {
            path: path.to_owned(),
            vertex_count: positions.len(),
            face_count: 0,
        });
    }
    Mesh::from_triangles(positions, &triangles).map_err(|source| MeshIoError::Invalid {
        path: path.to_owned(),
        source,
    })
}

/// A binary file says how many triangles follow; checked first, because a wrong count would
/// have the reader reserve memory for it.
fn check_binary_length(bytes: &[u8]) -> Result<(), String> {
    const HEADER_LENGTH: usize = 84;
    const TRIANGLE_LENGTH: usize = 50;
    if bytes.starts_with(b"solid") {
        return Ok(());
    }
    let count = bytes
        .get(80..HEADER_LENGTH)
        .and_then(|count| count.try_into().ok())
        .map(u32::from_le_bytes)
        .ok_or_else(|| format!("{} bytes are too few for a header", bytes.len()))?;
    let expected = HEADER_LENGTH + TRIANGLE_LENGTH * count as usize;
    if bytes.len() < expected {
        return Err(format!(
            "{count} triangles need {expected} bytes, but the file has {}",
            bytes.len()
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary(count: u32, triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = vec![0u8; 80];
        bytes.extend(count.to_le_bytes());
        for triangle in triangles {
            bytes.extend([0u8; 12]);
            bytes.extend(triangle.iter().flatten().flat_map(|c| c.to_le_bytes()));
            bytes.extend([0u8; 2]);
        }
        bytes
    }

    const TWO: [[[f32; 3]; 3]; 2] = [
        [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.]],
        [[0., 0., 0.], [1., 1., 0.], [0., 1., 0.]],
    ];

    #[test]
    fn equal_corners_are_shared() {
        let mesh = parse_stl(&binary(2, &TWO), Path::new("face.stl")).unwrap();
        assert_eq!((mesh.vertex_count(), mesh.face_count()), (4, 2));
    }

    #[test]
    fn truncated_and_foreign_files_are_typed_errors() {
        for bytes in [binary(u32::MAX, &TWO), b"short".to_vec(), {
            let mut cut = binary(2, &TWO);
            cut.truncate(120);
            cut
        }] {
            assert!(matches!(
                parse_stl(&bytes, Path::new("face.stl")),
                Err(MeshIoError::Malformed { .. })
            ));
        }
        assert!(matches!(
            parse_stl(&binary(0, &[]), Path::new("face.stl")),
            Err(MeshIoError::Empty { .. })
        ));
    }
}
