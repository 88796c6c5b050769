//! Meshes.

use std::path::PathBuf;

use fabrig_core::mesh::{Mesh, io};
use fabrig_core::template;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::errors::to_py;

/// A polygon mesh: vertices in any unit, polygons counter-clockwise seen from outside.
#[pyclass(frozen, name = "Mesh", module = "fabrig")]
pub(crate) struct PyMesh {
    pub(crate) inner: Mesh,
    /// The file that it was read from: a rig of it keeps its materials and pictures.
    pub(crate) source: Option<PathBuf>,
}

#[pymethods]
impl PyMesh {
    /// From vertices of shape (N, 3) and faces: an integer array of shape (F, corners), or a
    /// list of lists.
    #[new]
    fn new(vertices: &Bound<'_, PyAny>, faces: &Bound<'_, PyAny>) -> PyResult<Self> {
        let positions = arrays::points("vertices", vertices)?;
        let polygons = arrays::polygons("faces", faces)?;
        let inner = Mesh::new(positions, polygons).map_err(to_py)?;
        Ok(Self {
            inner,
            source: None,
        })
    }

    /// Vertices, shape (N, 3).
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_points(py, self.inner.positions())
    }

    /// Faces as lists of vertex indices.
    #[getter]
    fn faces(&self) -> Vec<Vec<u32>> {
        self.inner.polygons().iter().map(<[u32]>::to_vec).collect()
    }

    /// Faces split into triangles, shape (T, 3).
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u32>> {
        arrays::from_triangles(py, &self.inner.triangles())
    }

    /// Writes an OBJ file.
    fn write_obj(&self, path: PathBuf) -> PyResult<()> {
        io::write_obj(path, &self.inner).map_err(to_py)
    }

    fn __repr__(&self) -> String {
        format!(
            "Mesh({} vertices, {} faces)",
            self.inner.vertex_count(),
            self.inner.face_count()
        )
    }
}

/// Reads an OBJ, PLY, STL or glTF file.
#[pyfunction]
pub(crate) fn read_mesh(py: Python<'_>, path: PathBuf) -> PyResult<PyMesh> {
    let inner = py.detach(|| io::read_mesh(&path)).map_err(to_py)?;
    Ok(PyMesh {
        inner,
        source: Some(path),
    })
}

/// The shapes that a mesh file holds beside its mesh (morph targets of glTF), by name: the
/// vertices (N, 3) at weight 1, in the file's units.
///
/// >>> mesh, shapes = fabrig.read_mesh("face.glb"), fabrig.read_shapes("face.glb")
/// >>> rig = fabrig.rig(mesh, expressions=shapes)
#[pyfunction]
pub(crate) fn read_shapes<'py>(py: Python<'py>, path: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let file = py
        .detach(|| io::read_mesh_with_shapes(path))
        .map_err(to_py)?;
    let shapes = PyDict::new(py);
    for shape in &file.shapes {
        let positions = arrays::from_points(py, &shape.positions(&file.mesh));
        shapes.set_item(&shape.name, positions)?;
    }
    Ok(shapes)
}

/// The bundled face: not the template, in metres, turned, with eyes and teeth.
#[pyfunction]
pub(crate) fn demo_face() -> PyMesh {
    PyMesh {
        inner: template::demo_face(),
        source: None,
    }
}
