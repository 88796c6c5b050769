//! A face's own expressions, named as ARKit names them: a folder with one mesh a shape, or a
//! glTF file whose morph targets they are.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::ExpressionScan;
use crate::facs::{ARKIT_SHAPES, ShapeMatch, match_shape};
use crate::mesh::Mesh;
use crate::mesh::io::{MeshIoError, MeshShape, read_mesh, read_mesh_with_shapes};
use crate::rig::Expression;
use crate::template::Template;

/// Expressions of a face, and files that are none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OwnShapes {
    /// In the order of file names, or of the file's morph targets.
    pub expressions: Vec<Expression>,
    /// Those on a mesh of their own: scans.
    pub scans: Vec<ExpressionScan>,
    /// Meshes and morph targets (`face.glb#hat`) that were passed over, and why.
    pub skipped: Vec<(PathBuf, String)>,
    /// The mesh that the expressions are on, at rest, where it is another than the face: they
    /// reach the face by its own registration.
    pub neutral: Option<Mesh>,
}

/// What can go wrong when shapes are read.
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
         mesh, in the same vertex order, or put that mesh at rest beside them (neutral.obj)",
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
    /// Nothing in the folder or file is a shape.
    #[error(
        "{} has no mesh or morph target that is named like one of ARKit's 52 shapes (jawOpen, \
         mouthSmile_L, ...)",
        path.display()
    )]
    Nothing {
        /// The folder or file.
        path: PathBuf,
    },
    /// The mesh that the morph targets stand on is another one than the neutral face.
    #[error(
        "{}: vertex {vertex} is {distance:.3} units off the neutral face: rig the face from this \
         very file, so that its morph targets are in the same units and place",
        path.display()
    )]
    OtherRest {
        /// The file.
        path: PathBuf,
        /// The vertex that is farthest off.
        vertex: usize,
        /// How far, in units of the neutral face.
        distance: f64,
    },
}

impl OwnShapes {
    /// The same, if all expressions are on the neutral's mesh.
    ///
    /// # Errors
    ///
    /// [`OwnShapesError::VertexCount`] with the first scan.
    pub fn without_scans(self, neutral: &Mesh) -> Result<Self, OwnShapesError> {
        match self.scans.first() {
            None => Ok(self),
            Some(scan) => Err(OwnShapesError::VertexCount {
                path: scan.path.clone(),
                expected: self.neutral.as_ref().unwrap_or(neutral).vertex_count(),
                found: scan.mesh.vertex_count(),
            }),
        }
    }
}

const EXTENSIONS: [&str; 5] = ["obj", "ply", "stl", "gltf", "glb"];

/// A vertex of a file with morph targets may be this far from the neutral face, as a share of
/// the face's size: formats round.
const REST_TOLERANCE: f64 = 1e-4;

/// Reads the shapes of a face that are shapes of the template too: every mesh of a folder that
/// is named like one, or every morph target of a glTF file.
///
/// Shapes may be on another mesh of the same face, where the folder has that mesh at rest. A mesh
/// with another number of vertices is taken for a scan with a topology of its own. A shape that
/// comes as two halves (ICT-FaceKit's `browInnerUp_L` and `_R`) is their sum.
///
/// - `source`: the folder or file
/// - `neutral`: the face at rest
///
/// # Errors
///
/// [`OwnShapesError`].
pub fn read_own_shapes(
    source: &Path,
    neutral: &Mesh,
    template: &Template,
) -> Result<OwnShapes, OwnShapesError> {
    let mut found = OwnShapes::default();
    if source.is_file() {
        read_morph_targets(source, neutral, template, &mut found)?;
    } else {
        read_folder(source, neutral, template, &mut found)?;
    }
    if found.expressions.is_empty() && found.scans.is_empty() {
        return Err(OwnShapesError::Nothing {
            path: source.to_owned(),
        });
    }
    Ok(found)
}

fn read_folder(
    folder: &Path,
    neutral: &Mesh,
    template: &Template,
    found: &mut OwnShapes,
) -> Result<(), OwnShapesError> {
    if let Some(path) = neutral_of_shapes(folder)? {
        let own = read_mesh(&path)?;
        found.neutral = (own.vertex_count() != neutral.vertex_count()).then_some(own);
    }
    let neutral = &found.neutral.clone().unwrap_or_else(|| neutral.clone());
    let mut halves: BTreeMap<&str, Vec<(PathBuf, Mesh)>> = BTreeMap::new();
    for path in mesh_files(folder)? {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        if is_neutral(&stem) {
            continue;
        }
        if let Some(whole) = whole_of_half(&stem) {
            let mesh = read_mesh(&path)?;
            check_count(&path, &mesh, neutral)?;
            halves.entry(whole).or_default().push((path, mesh));
            continue;
        }
        let Some((name, weights)) = shapes_of_name(&stem, template) else {
            found.skipped.push((path, NO_SHAPE.to_owned()));
            continue;
        };
        let mesh = read_mesh(&path)?;
        if mesh.vertex_count() == neutral.vertex_count() {
            found.expressions.push(Expression {
                name,
                weights,
                positions: mesh.positions().to_vec(),
            });
        } else {
            found.scans.push(ExpressionScan {
                name,
                weights,
                mesh,
                path,
            });
        }
    }
    for (whole, mut parts) in halves {
        let Some((name, weights)) = shapes_of_name(whole, template) else {
            continue;
        };
        if parts.len() != 2 {
            let reason = format!("one half of {whole} without the other");
            found
                .skipped
                .extend(parts.drain(..).map(|(path, _)| (path, reason.clone())));
            continue;
        }
        let sides = parts[0].1.positions().iter().zip(parts[1].1.positions());
        let sums = sides.zip(neutral.positions());
        let positions = sums.map(|((a, b), rest)| a + (b - rest)).collect();
        found.expressions.push(Expression {
            name,
            weights,
            positions,
        });
    }
    Ok(())
}

/// The shape of both sides that a name is the left or right half of.
fn whole_of_half(name: &str) -> Option<&'static str> {
    const SIDES: [&str; 6] = ["_L", "_R", "_l", "_r", "Left", "Right"];
    if match_shape(name).is_some() {
        return None;
    }
    let base = SIDES.iter().find_map(|side| name.strip_suffix(side))?;
    match match_shape(base)? {
        ShapeMatch::One(shape) => Some(ARKIT_SHAPES[shape]),
        ShapeMatch::Both(..) => None,
    }
}

fn read_morph_targets(
    path: &Path,
    neutral: &Mesh,
    template: &Template,
    found: &mut OwnShapes,
) -> Result<(), OwnShapesError> {
    let file = read_mesh_with_shapes(path)?;
    if file.mesh.vertex_count() != neutral.vertex_count() {
        push_targets(path, &file.shapes, &file.mesh, template, found);
        found.neutral = Some(file.mesh);
        return Ok(());
    }
    let pairs = neutral.positions().iter().zip(file.mesh.positions());
    let distances = pairs.map(|(p, q)| (p - q).norm()).enumerate();
    let (vertex, distance) = distances
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0, 0.0));
    let middle = neutral.positions()[0];
    let size = neutral.positions().iter().map(|p| (p - middle).norm());
    if distance > REST_TOLERANCE * size.fold(0.0, f64::max) {
        return Err(OwnShapesError::OtherRest {
            path: path.to_owned(),
            vertex,
            distance,
        });
    }
    push_targets(path, &file.shapes, neutral, template, found);
    Ok(())
}

fn push_targets(
    path: &Path,
    shapes: &[MeshShape],
    neutral: &Mesh,
    template: &Template,
    found: &mut OwnShapes,
) {
    for shape in shapes {
        let Some((name, weights)) = shapes_of_name(&shape.name, template) else {
            let target = format!("{}#{}", path.display(), shape.name);
            found.skipped.push((target.into(), NO_SHAPE.to_owned()));
            continue;
        };
        found.expressions.push(Expression {
            name,
            weights,
            positions: shape.positions(neutral),
        });
    }
}

const NO_SHAPE: &str = "its name is no shape of ARKit";

/// The template's shapes that a name means, as one name and as weights.
fn shapes_of_name(name: &str, template: &Template) -> Option<(String, Vec<f32>)> {
    let names = match_shape(name)?.names();
    let mut weights = vec![0.0; template.shapes.len()];
    let shapes = names.iter().filter_map(|name| template.shape_index(name));
    shapes.for_each(|shape| weights[shape] = 1.0);
    let is_known = weights.contains(&1.0);
    is_known.then(|| (names.join("+"), weights))
}

fn check_count(path: &Path, mesh: &Mesh, neutral: &Mesh) -> Result<(), OwnShapesError> {
    if mesh.vertex_count() == neutral.vertex_count() {
        return Ok(());
    }
    Err(OwnShapesError::VertexCount {
        path: path.to_owned(),
        expected: neutral.vertex_count(),
        found: mesh.vertex_count(),
    })
}

/// The mesh that shapes stand on: a file itself, or the mesh of a folder that is named as its
/// neutral (`neutral.obj`, `generic_neutral_mesh.obj`); `None` where there is none, or more
/// than one.
///
/// # Errors
///
/// [`OwnShapesError::Io`].
pub fn neutral_of_shapes(source: &Path) -> Result<Option<PathBuf>, OwnShapesError> {
    if source.is_file() {
        return Ok(Some(source.to_owned()));
    }
    let mut neutrals = mesh_files(source)?;
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
        let path = neutral_of_shapes(&folder).unwrap().unwrap();
        assert!(path.ends_with("My_Neutral.obj"));
        let square = Mesh::from_triangles(
            [corner.as_slice(), &[[1.0, 1.0, 0.0].into()]].concat(),
            &[[0, 1, 2], [1, 3, 2]],
        )
        .unwrap();
        let found = read_own_shapes(&folder, &square, template).unwrap();
        assert_eq!(
            found.neutral,
            Some(neutral.clone()),
            "shapes of another mesh"
        );
        write("browInnerUp_L.obj", &neutral);
        write("cheekPuff_R.obj", &neutral);
        write("cheekPuff_L.obj", &neutral);
        let found = read_own_shapes(&folder, &neutral, template).unwrap();
        let names: Vec<&str> = found.expressions.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["browInnerUp", "mouthSmileLeft", "cheekPuff"]);
        assert_eq!(
            found.skipped.len(),
            2,
            "a half without the other, and a hat"
        );
        assert_eq!(found.neutral, None);
        write("jawOpen.obj", &square);
        let found = read_own_shapes(&folder, &neutral, template).unwrap();
        assert_eq!(found.scans.len(), 1, "a mesh of its own is a scan");
        assert_eq!(found.scans[0].name, "jawOpen");
        let error = found.without_scans(&neutral).unwrap_err();
        assert!(
            error.to_string().contains("jawOpen.obj has 4 vertices"),
            "{error}"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn morph_targets_of_the_face_s_own_file_are_shapes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("face.gltf");
        let floats = [
            0f32, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 0., 0., -1., 0., 0., 0., 0.,
        ];
        let bytes: Vec<u8> = floats.iter().flat_map(|c| c.to_le_bytes()).collect();
        std::fs::write(folder.path().join("face.bin"), bytes).unwrap();
        let json = r#"{"asset": {"version": "2.0"},
            "meshes": [{"extras": {"targetNames": ["blends.mouthSmile", "hat", "jaw_open"]},
              "primitives": [{"attributes": {"POSITION": 0},
                "targets": [{"POSITION": 1}, {"POSITION": 1}, {"POSITION": 1}]}]}],
            "accessors": [
              {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
               "min": [0, 0, 0], "max": [1, 1, 0]},
              {"bufferView": 0, "byteOffset": 36, "componentType": 5126, "count": 3,
               "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": 72}],
            "buffers": [{"uri": "face.bin", "byteLength": 72}]}"#;
        std::fs::write(&path, json).unwrap();
        let neutral = read_mesh(neutral_of_shapes(&path).unwrap().unwrap()).unwrap();
        let found = read_own_shapes(&path, &neutral, human()).unwrap();
        let names: Vec<&str> = found.expressions.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["mouthSmileLeft+mouthSmileRight", "jawOpen"]);
        assert_eq!(found.expressions[1].positions[1], [1.0, -1.0, 0.0].into());
        assert!(found.skipped[0].0.ends_with("face.gltf#hat"));
        let larger = neutral.positions().iter().map(|p| p * 1000.0).collect();
        let larger = neutral.with_positions(larger).unwrap();
        let error = read_own_shapes(&path, &larger, human()).unwrap_err();
        assert!(matches!(error, OwnShapesError::OtherRest { .. }), "{error}");
    }
}
