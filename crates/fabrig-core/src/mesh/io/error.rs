//! What can go wrong between a mesh and a file.

use std::io;
use std::path::PathBuf;

use crate::mesh::MeshError;

/// A mesh file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum MeshIoError {
    /// The file could not be read at all.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The file could not be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The extension names no format that is known here.
    #[error(
        "{}: unknown mesh format '{extension}' (known: .obj, .ply, .stl, .gltf, .glb)",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// Its extension, without the dot; empty where there is none.
        extension: String,
    },
    /// A line of an OBJ file is wrong.
    #[error("{}:{line}: {problem}", path.display())]
    Obj {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong there.
        problem: ObjProblem,
    },
    /// The file is well-formed but holds no surface.
    #[error(
        "{}: the file has {vertex_count} vertices and {face_count} faces; a mesh needs both",
        path.display()
    )]
    Empty {
        /// The file.
        path: PathBuf,
        /// Vertices found.
        vertex_count: usize,
        /// Polygons found.
        face_count: usize,
    },
    /// The file was read, but is not a valid mesh.
    #[error("{}: the mesh is not valid", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        #[source]
        source: MeshError,
    },
    /// A PLY, STL or glTF file is malformed.
    #[error("{}: not a readable {format} file: {problem}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// `PLY`, `STL` or `glTF`.
        format: &'static str,
        /// What its parser found.
        problem: String,
    },
}

/// What can be wrong with a line of an OBJ file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ObjProblem {
    /// A coordinate does not parse.
    #[error("'{found}' is not a number")]
    NotANumber {
        /// The text in its place.
        found: String,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} has the coordinate '{found}', which is not a finite number")]
    NotFinite {
        /// The vertex, from 1 as OBJ counts.
        vertex: usize,
        /// The text of the coordinate.
        found: String,
    },
    /// A `v` or `vt` line is too short.
    #[error("'{keyword}' needs {expected} coordinates, found {found}")]
    TooFewCoordinates {
        /// `v` or `vt`.
        keyword: &'static str,
        /// How many it needs.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A corner of a face does not parse.
    #[error("'{found}' is not a face corner (expected v, v/vt, v//vn or v/vt/vn)")]
    BadCorner {
        /// The text in its place.
        found: String,
    },
    /// A face has fewer than three corners.
    #[error("a face needs at least 3 corners, found {found}")]
    TooFewCorners {
        /// How many there are.
        found: usize,
    },
    /// A face names an element that the file does not have.
    #[error("the face references {element} {index}, but the file has {count}")]
    IndexOutOfRange {
        /// `vertex` or `texture coordinate`.
        element: &'static str,
        /// The index as the file gives it: from 1, or negative from the end.
        index: i64,
        /// How many there are (so far, for a negative index).
        count: usize,
    },
}
