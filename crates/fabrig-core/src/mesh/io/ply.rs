//! Stanford PLY, ASCII and binary.

use std::path::Path;

use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};

use super::MeshIoError;
use crate::Point;
use crate::mesh::{Mesh, Polygons};

/// Reads the elements `vertex` (x, y, z) and `face` (vertex_indices or vertex_index); other
/// elements and properties are passed over.
///
/// # Errors
///
/// See [`super::read_mesh`].
pub(super) fn parse_ply(bytes: &[u8], path: &Path) -> Result<Mesh, MeshIoError> {
    let malformed = |problem: String| MeshIoError::Malformed {
        path: path.to_owned(),
        format: "PLY",
        problem,
    };
    let ply = Parser::<DefaultElement>::new()
        .read_ply(&mut &*bytes)
        .map_err(|e| malformed(e.to_string()))?;
    let elements = |name: &str| ply.payload.get(name).map_or(&[][..], Vec::as_slice);

    let mut positions = Vec::new();
    for (index, vertex) in elements("vertex").iter().enumerate() {
        let coordinate = |axis: &str| {
            vertex
                .get(axis)
                .and_then(scalar)
                .ok_or_else(|| malformed(format!("vertex {index} has no scalar '{axis}'")))
        };
        positions.push(Point::new(
            coordinate("x")?,
            coordinate("y")?,
            coordinate("z")?,
        ));
    }
    let mut polygons = Polygons::new();
    for (index, face) in elements("face").iter().enumerate() {
        let corners = face
            .get("vertex_indices")
            .or_else(|| face.get("vertex_index"))
            .and_then(indices)
            .ok_or_else(|| malformed(format!("face {index} has no list of vertex indices")))?;
        polygons.push(&corners);
    }
    if positions.is_empty() || polygons.is_empty() {
        return Err(MeshIoError::Empty {
            path: path.to_owned(),
            vertex_count: positions.len(),
            face_count: polygons.len(),
        });
    }
    Mesh::new(positions, polygons).map_err(|source| MeshIoError::Invalid {
        path: path.to_owned(),
        source,
    })
}

fn scalar(property: &Property) -> Option<f64> {
    // The crate's own conversion goes through f32 and would round doubles.
    match property {
        Property::Double(v) => Some(*v),
        other => other.to_f32_lossy().map(f64::from),
    }
}

/// A negative index becomes one that no mesh has, so that validation names its face.
fn indices(property: &Property) -> Option<Vec<u32>> {
    let signed = |v: i64| u32::try_from(v).unwrap_or(u32::MAX);
    Some(match property {
        Property::ListChar(list) => list.iter().map(|&v| signed(v.into())).collect(),
        Property::ListShort(list) => list.iter().map(|&v| signed(v.into())).collect(),
        Property::ListInt(list) => list.iter().map(|&v| signed(v.into())).collect(),
        Property::ListUChar(list) => list.iter().map(|&v| v.into()).collect(),
        Property::ListUShort(list) => list.iter().map(|&v| v.into()).collect(),
        Property::ListUInt(list) => list.clone(),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\n\
        property double y\nproperty double z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n";

    fn parse(text: &str) -> Result<Mesh, MeshIoError> {
        parse_ply(text.as_bytes(), Path::new("face.ply"))
    }

    #[test]
    fn a_quad_stays_a_quad_and_doubles_stay_doubles() {
        let mesh = parse(&format!(
            "{HEADER}0.1 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
        ))
        .unwrap();
        assert_eq!(mesh.positions()[0].x, 0.1);
        assert_eq!(mesh.polygons().face(0), [0, 1, 2, 3]);
    }

    #[test]
    fn bad_files_are_typed_errors() {
        let body = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
        assert!(matches!(
            parse(&format!("{HEADER}{body}3 0 1 9\n")),
            Err(MeshIoError::Invalid { .. })
        ));
        assert!(matches!(
            parse(&format!("{HEADER}{body}3 0 -1 2\n")),
            Err(MeshIoError::Invalid { .. })
        ));
        assert!(matches!(
            parse(&format!("{HEADER}{body}")),
            Err(MeshIoError::Malformed { .. })
        ));
        // ASCII PLY has no spelling of NaN; binary PLY does.
        assert!(matches!(
            parse(&format!("{HEADER}nan 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n")),
            Err(MeshIoError::Malformed { .. })
        ));
        let mut binary = HEADER.replace("ascii", "binary_little_endian").into_bytes();
        for x in [f64::NAN, 1.0, 0.0, 1.0] {
            binary.extend([x, x * x, 0.0].iter().flat_map(|c| c.to_le_bytes()));
        }
        binary.push(3);
        binary.extend([0i32, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
        assert!(matches!(
            parse_ply(&binary, Path::new("face.ply")),
            Err(MeshIoError::Invalid {
                source: crate::mesh::MeshError::NotFinite { vertex: 0, .. },
                ..
            })
        ));
        assert!(matches!(
            parse("not a ply"),
            Err(MeshIoError::Malformed { .. })
        ));
    }
}
