//! From the file that a mesh came from to what it looks like.

use std::path::Path;

use super::{Appearance, AppearanceError, Material, gltf, linear_color, obj};
use crate::mesh::Mesh;

impl Appearance {
    /// The materials of the file that a mesh came from.
    ///
    /// Polygons that the file does not have in their place (a face whose lips were cut apart)
    /// take the material of the polygons about their vertices; linings and eyeballs that the cut
    /// added get one of their own. A file without materials gives nothing, and so do formats that
    /// have none.
    ///
    /// - `notes`: gets what a person should know, such as a picture that is not there
    ///
    /// # Errors
    ///
    /// [`AppearanceError`]: the file cannot be read, or holds another mesh.
    pub fn of_file(
        path: impl AsRef<Path>,
        mesh: &Mesh,
        notes: &mut Vec<String>,
    ) -> Result<Self, AppearanceError> {
        of_file(path.as_ref(), mesh, notes)
    }
}

fn of_file(
    path: &Path,
    face: &Mesh,
    notes: &mut Vec<String>,
) -> Result<Appearance, AppearanceError> {
    let file = crate::mesh::io::read_mesh_with_shapes(path)?;
    let source = &file.mesh;
    if source.vertex_count() > face.vertex_count() {
        return Err(AppearanceError::OtherMesh {
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
        return Err(AppearanceError::OtherMesh {
            path: path.to_owned(),
            what: "polygons",
            expected: face.face_count(),
            found: source.face_count(),
        });
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let mut appearance = match extension.to_ascii_lowercase().as_str() {
        "obj" => obj::read(path, source, notes)?,
        "gltf" | "glb" => gltf::read(path, &file, notes)?,
        _ => {
            notes.push(format!("{} has no materials", path.display()));
            Appearance::default()
        }
    };
    if appearance.is_empty() {
        return Ok(appearance);
    }
    let of_polygon = std::mem::take(&mut appearance.of_polygon);
    let count = appearance.materials.len();
    let mut of_vertex: Vec<Vec<u32>> = vec![Vec::new(); face.vertex_count()];
    for (polygon, &material) in source.polygons().iter().zip(&of_polygon) {
        for &vertex in polygon {
            of_vertex[vertex as usize].push(material);
        }
    }
    let mut lining = None;
    appearance.of_polygon = faces()
        .map(|(k, corners)| {
            if is_same(k, corners) {
                return of_polygon[k];
            }
            let mut votes = vec![0u32; count];
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
        let color = linear_color([150, 80, 76]);
        let lining = Material::new("lining", color, 0.5, 0.0, None);
        appearance.materials.push(lining);
    }
    Ok(appearance)
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
        let mut notes = Vec::new();
        let appearance = Appearance::of_file(&path, &face, &mut notes).unwrap();
        assert_eq!(appearance.names(), ["skin", "lips", "lining"]);
        assert_eq!(appearance.of_polygon, [0, 0, 1, 2]);
        appearance.check(face.face_count()).unwrap();
        let other = Polygons::from_faces([[5u32, 4, 3]]);
        let other = Mesh::new(source.positions().to_vec(), other).unwrap();
        let error = Appearance::of_file(&path, &other, &mut notes).unwrap_err();
        assert!(
            matches!(
                error,
                AppearanceError::OtherMesh {
                    what: "polygons",
                    ..
                }
            ),
            "{error}"
        );
    }
}
