//! A face's own expressions from a folder: one mesh a shape, named as ARKit names it.

use std::path::{Path, PathBuf};

use crate::facs::{ShapeMatch, match_shape};
use crate::mesh::Mesh;
use crate::mesh::io::{MeshIoError, read_mesh};
use crate::rig::Expression;
use crate::template::Template;

/// Expressions of a face, and files that are none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OwnShapes {
    /// In the order of file names.
    pub expressions: Vec<Expression>,
    /// Meshes that were passed over, and why.
    pub skipped: Vec<(PathBuf, String)>,
}

/// What can go wrong when a folder of shapes is read.
#[derive(Debug, thiserror::Error)]
pub enum OwnShapesError {
    /// The folder cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
    /// A mesh cannot be read.
    #[error(transparent)]
    Mesh(#[from] MeshIoError),
    /// A shape is on another mesh.
    #[error(
        "{} has {found} vertices, the neutral face {expected}: export every shape from the same \
         mesh, in the same vertex order",
        path.display()
    )]
    VertexCount {
        /// The file.
        path: PathBuf,
        /// The neutral's.
        expected: usize,
        /// The shape's.
        found: usize,
    },
    /// Nothing in the folder is a shape.
    #[error(
        "{} has no mesh that is named like one of ARKit's 52 shapes (jawOpen.obj, \
         mouthSmile_L.obj, ...)",
        path.display()
    )]
    Nothing {
        /// The folder.
        path: PathBuf,
    },
}

const EXTENSIONS: [&str; 5] = ["obj", "ply", "stl", "gltf", "glb"];

/// Reads every mesh of a folder that is named like a shape of the template.
///
/// - `neutral`: the face at rest, whose vertices every shape has
///
/// # Errors
///
/// [`OwnShapesError`].
pub fn read_own_shapes(
    folder: &Path,
    neutral: &Mesh,
    template: &Template,
) -> Result<OwnShapes, OwnShapesError> {
    let mut found = OwnShapes::default();
    for path in mesh_files(folder)? {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        if is_neutral(&stem) {
            continue;
        }
        let names = match_shape(&stem).map_or_else(Vec::new, ShapeMatch::names);
        let mut weights = vec![0.0; template.shapes.len()];
        let shapes = names.iter().filter_map(|name| template.shape_index(name));
        shapes.for_each(|shape| weights[shape] = 1.0);
        if weights.iter().all(|w| *w == 0.0) {
            let reason = "its name is no shape of ARKit".to_owned();
            found.skipped.push((path, reason));
            continue;
        }
        let mesh = read_mesh(&path)?;
        if mesh.vertex_count() != neutral.vertex_count() {
            return Err(OwnShapesError::VertexCount {
                path,
                expected: neutral.vertex_count(),
                found: mesh.vertex_count(),
            });
        }
        found.expressions.push(Expression {
            name: names.join("+"),
            weights,
            positions: mesh.positions().to_vec(),
        });
    }
    if found.expressions.is_empty() {
        return Err(OwnShapesError::Nothing {
            path: folder.to_owned(),
        });
    }
    Ok(found)
}

/// The mesh of a folder that is named as its neutral (`neutral.obj`,
/// `generic_neutral_mesh.obj`); `None` where there is none, or more than one.
///
/// # Errors
///
/// [`OwnShapesError::Io`].
pub fn neutral_of_folder(folder: &Path) -> Result<Option<PathBuf>, OwnShapesError> {
    let mut neutrals = mesh_files(folder)?;
    neutrals.retain(|path| is_neutral(&path.file_stem().unwrap_or_default().to_string_lossy()));
    Ok((neutrals.len() == 1).then(|| neutrals.remove(0)))
}

fn is_neutral(stem: &str) -> bool {
    stem.to_ascii_lowercase().contains("neutral")
}

/// Meshes of a folder in the order of their names.
fn mesh_files(folder: &Path) -> Result<Vec<PathBuf>, OwnShapesError> {
    let io = |source| OwnShapesError::Io {
        path: folder.to_owned(),
        source,
    };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        if EXTENSIONS.contains(&extension.to_ascii_lowercase().as_str()) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::io::write_obj;
    use crate::template::human;

    #[test]
    fn shapes_are_read_by_name_and_others_told() {
        let template = human();
        let folder = std::env::temp_dir().join(format!("fabrig-shapes-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let write = |name: &str, mesh: &Mesh| write_obj(folder.join(name), mesh).unwrap();
        let corner = [
            crate::Point::origin(),
            [1.0, 0.0, 0.0].into(),
            [0.0, 1.0, 0.0].into(),
        ];
        let neutral = Mesh::from_triangles(corner.to_vec(), &[[0, 1, 2]]).unwrap();
        assert!(matches!(
            read_own_shapes(&folder, &neutral, template),
            Err(OwnShapesError::Nothing { .. })
        ));
        for name in [
            "My_Neutral.obj",
            "mouthSmile_L.obj",
            "browInnerUp.obj",
            "hat.obj",
        ] {
            write(name, &neutral);
        }
        let found = read_own_shapes(&folder, &neutral, template).unwrap();
        let names: Vec<&str> = found.expressions.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["browInnerUp", "mouthSmileLeft"]);
        assert_eq!(found.skipped.len(), 1);
        let path = neutral_of_folder(&folder).unwrap().unwrap();
        assert!(path.ends_with("My_Neutral.obj"));
        let square = Mesh::from_triangles(
            [corner.as_slice(), &[[1.0, 1.0, 0.0].into()]].concat(),
            &[[0, 1, 2], [1, 3, 2]],
        )
        .unwrap();
        write("jawOpen.obj", &square);
        let error = read_own_shapes(&folder, &neutral, template).unwrap_err();
        assert!(
            error.to_string().contains("jawOpen.obj has 4 vertices"),
            "{error}"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
