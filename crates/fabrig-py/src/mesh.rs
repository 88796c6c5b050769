//! Meshes.

use std::path::PathBuf;

use fabrig_core::mesh::{CornerUvs, FaceGroup, Mesh, Polygons, io, vertex_normals};
use fabrig_core::template;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays;
use crate::errors::{input, to_py};
use crate::progress::interruptible;
use crate::render::{Shot, draw_mesh};

/// A polygon mesh: vertices in any unit, polygons counter-clockwise seen from outside.
///
/// - `vertices`: shape (N, 3)
/// - `faces`: an integer array of shape (F, corners), or a list of lists
/// - `uvs`: texture coordinates (U, 2), origin at the lower left, and the index of one of them
///   for each corner of the faces, shape (corners of all faces,)
/// - `groups`: name -> range of faces, as files name objects and materials
///
/// >>> square = fabrig.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
/// >>> square
/// Mesh(4 vertices, 1 faces)
#[pyclass(frozen, name = "Mesh", module = "fabrig")]
pub(crate) struct PyMesh {
    pub(crate) inner: Mesh,
    /// The file that it was read from: a rig of it keeps its materials and pictures.
    pub(crate) source: Option<PathBuf>,
}

impl From<Mesh> for PyMesh {
    fn from(inner: Mesh) -> Self {
        Self {
            inner,
            source: None,
        }
    }
}

#[pymethods]
impl PyMesh {
    #[new]
    #[pyo3(signature = (vertices, faces, *, uvs=None, groups=None))]
    fn new(
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        uvs: Option<(Bound<'_, PyAny>, Bound<'_, PyAny>)>,
        groups: Option<Vec<(String, (usize, usize))>>,
    ) -> PyResult<Self> {
        let positions = arrays::points("vertices", vertices)?;
        let polygons = arrays::polygons("faces", faces)?;
        let mut inner = Mesh::new(positions, polygons).map_err(to_py)?;
        if let Some((coordinates, corners)) = uvs {
            inner = with_uvs(inner, &coordinates, &corners)?;
        }
        if let Some(groups) = groups {
            let count = inner.face_count();
            let groups = groups.into_iter().map(|(name, (start, end))| {
                if start > end || end > count {
                    return Err(input(format!(
                        "groups: '{name}' is {start}..{end}, but there are {count} faces"
                    )));
                }
                Ok(FaceGroup {
                    name,
                    faces: start..end,
                })
            });
            inner = inner.with_groups(groups.collect::<PyResult<_>>()?);
        }
        Ok(inner.into())
    }

    /// A mesh of any object that has one: a `Mesh` itself, trimesh's `Trimesh`, meshio's `Mesh`,
    /// pyvista's `PolyData`, a pair of arrays (vertices, faces), or the path of a file.
    ///
    /// >>> fabrig.Mesh.of(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    /// Mesh(3 vertices, 1 faces)
    #[staticmethod]
    pub(crate) fn of<'py>(source: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyMesh>> {
        if let Ok(mesh) = source.cast::<PyMesh>() {
            return Ok(mesh.clone());
        }
        let interop = source.py().import("fabrig._interop")?;
        let mesh = interop.call_method1("as_mesh", (source,))?;
        Ok(mesh.cast_into::<PyMesh>()?)
    }

    /// Vertices, shape (N, 3): a copy.
    ///
    /// >>> fabrig.demo_face().vertices.shape
    /// (13082, 3)
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_points(py, self.inner.positions())
    }

    /// Faces as lists of vertex indices.
    ///
    /// >>> fabrig.demo_face().faces[0]
    /// [0, 1, 2]
    #[getter]
    fn faces(&self) -> Vec<Vec<u32>> {
        self.inner.polygons().iter().map(<[u32]>::to_vec).collect()
    }

    /// Faces split into triangles, shape (T, 3): (0, 1, 2), (0, 2, 3), ... of each.
    ///
    /// >>> fabrig.demo_face().triangles.shape[1]
    /// 3
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u32>> {
        arrays::from_triangles(py, &self.inner.triangles())
    }

    /// How many corners each face has, shape (F,), and their vertices one after the other,
    /// shape (corners of all faces,): faces as arrays, whatever their sizes.
    ///
    /// >>> counts, corners = fabrig.demo_face().polygons
    /// >>> int(counts.sum()) == len(corners)
    /// True
    #[getter]
    fn polygons<'py>(
        &self,
        py: Python<'py>,
    ) -> (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u32>>) {
        let polygons = self.inner.polygons();
        let counts = polygons.iter().map(|face| face.len() as u32).collect();
        (
            PyArray1::from_vec(py, counts),
            PyArray1::from_slice(py, polygons.corners()),
        )
    }

    /// Texture coordinates: (U, 2) and an index for each corner of the faces; None without.
    ///
    /// >>> fabrig.demo_face().uvs is None
    /// True
    #[getter]
    #[allow(clippy::type_complexity)] // A pair of arrays.
    fn uvs<'py>(
        &self,
        py: Python<'py>,
    ) -> Option<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<u32>>)> {
        let uvs = self.inner.uvs()?;
        Some((
            arrays::from_rows(py, 2, bytemuck::cast_slice(&uvs.coordinates)),
            PyArray1::from_slice(py, &uvs.corners),
        ))
    }

    /// Named runs of faces: (name, (first, one past the last)), as the file has them.
    ///
    /// >>> [name for name, _ in fabrig.demo_face().groups][0]
    /// 'skin'
    #[getter]
    fn groups(&self) -> Vec<(String, (usize, usize))> {
        let groups = self.inner.groups().iter();
        groups
            .map(|g| (g.name.clone(), (g.faces.start, g.faces.end)))
            .collect()
    }

    /// Unit normals of the vertices, shape (N, 3).
    ///
    /// >>> fabrig.demo_face().normals.shape
    /// (13082, 3)
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let normals = vertex_normals(self.inner.positions(), &self.inner.triangles());
        arrays::from_rows(py, 3, bytemuck::cast_slice(&normals))
    }

    /// The same faces on other vertices, shape (N, 3).
    ///
    /// >>> face = fabrig.demo_face()
    /// >>> doubled = face.with_vertices(face.vertices * 2)
    fn with_vertices(&self, vertices: &Bound<'_, PyAny>) -> PyResult<Self> {
        let positions = arrays::points("vertices", vertices)?;
        let inner = self.inner.with_positions(positions).map_err(to_py)?;
        Ok(Self {
            inner,
            source: self.source.clone(),
        })
    }

    /// Writes an OBJ file.
    ///
    /// >>> fabrig.demo_face().write_obj("face.obj")
    fn write_obj(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| io::write_obj(path, &self.inner))
            .map_err(to_py)
    }

    /// A picture of the mesh, shape (size, size, 3) of bytes.
    ///
    /// - `view`: "front", "three-quarter", "side", "back", "top", "below" or "YAW,PITCH" in
    ///   degrees
    /// - `size`: pixels to each side
    /// - `edges`: whether the edges of faces are drawn
    ///
    /// >>> fabrig.demo_face().render(size=64).shape
    /// (64, 64, 3)
    #[pyo3(signature = (*, view="front", size=512, edges=false))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        view: &str,
        size: u32,
        edges: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let shot = Shot::new(view, size, edges)?;
        draw_mesh(py, self.inner.clone(), shot)
    }

    /// As a mesh of trimesh: triangles, vertices in their order.
    ///
    /// >>> mesh = fabrig.demo_face().to_trimesh()  # doctest: +SKIP
    fn to_trimesh<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        interop(slf, "to_trimesh", None)
    }

    /// As a mesh of meshio, with which every format that meshio knows can be written.
    ///
    /// >>> fabrig.demo_face().to_meshio().write("face.vtk")  # doctest: +SKIP
    fn to_meshio<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        interop(slf, "to_meshio", None)
    }

    /// As a mesh of pyvista.
    ///
    /// >>> fabrig.demo_face().to_pyvista().plot()  # doctest: +SKIP
    fn to_pyvista<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        interop(slf, "to_pyvista", None)
    }

    /// Shows the mesh in a window or notebook by pyvista; returns what its `plot` returns.
    ///
    /// - `scalars`: a number for each vertex, shape (N,), drawn as colour
    /// - `options`: anything else goes to `pyvista.DataSet.plot`
    ///
    /// >>> fabrig.demo_face().plot()  # doctest: +SKIP
    #[pyo3(signature = (*, scalars=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        scalars: Option<Bound<'py, PyAny>>,
        options: Option<Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let options = options.unwrap_or_else(|| PyDict::new(slf.py()));
        options.set_item("scalars", scalars)?;
        interop(slf, "plot", Some(&options))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let bytes = postcard::to_allocvec(&self.inner).map_err(|e| input(e.to_string()))?;
        arrays::restored_by(py, "mesh", &bytes)
    }

    #[staticmethod]
    fn _from_bytes(bytes: &[u8]) -> PyResult<Self> {
        let bad = |e: postcard::Error| input(format!("bytes: no mesh: {e}"));
        let read: Mesh = postcard::from_bytes(bytes).map_err(bad)?;
        // What is read is not trusted: the mesh is made anew of its parts.
        let polygons = Polygons::from_faces(read.polygons().iter());
        let mut inner = Mesh::new(read.positions().to_vec(), polygons).map_err(to_py)?;
        if let Some(uvs) = read.uvs() {
            inner = inner.with_uvs(uvs.clone()).map_err(to_py)?;
        }
        Ok(inner.with_groups(read.groups().to_vec()).into())
    }

    fn __len__(&self) -> usize {
        self.inner.vertex_count()
    }

    fn __repr__(&self) -> String {
        format!(
            "Mesh({} vertices, {} faces)",
            self.inner.vertex_count(),
            self.inner.face_count()
        )
    }
}

/// Calls a function of the package that speaks to another one.
fn interop<'py>(
    mesh: &Bound<'py, PyMesh>,
    function: &str,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let module = mesh.py().import("fabrig._interop")?;
    module.getattr(function)?.call((mesh,), options)
}

fn with_uvs(
    mesh: Mesh,
    coordinates: &Bound<'_, PyAny>,
    corners: &Bound<'_, PyAny>,
) -> PyResult<Mesh> {
    let (rows, columns, numbers) = arrays::table("uvs", coordinates)?;
    if columns != 2 {
        return Err(input(format!(
            "uvs: expected shape (U, 2), got ({rows}, {columns})"
        )));
    }
    let coordinates = numbers.chunks_exact(2);
    let coordinates: Vec<[f32; 2]> = coordinates.map(|uv| [uv[0] as f32, uv[1] as f32]).collect();
    let indices = corners
        .call_method0("tolist")
        .unwrap_or_else(|_| corners.clone());
    let indices: Vec<i64> = indices
        .extract()
        .map_err(|_| input("uvs: expected whole numbers, one per corner of the faces"))?;
    let corners = indices
        .into_iter()
        .enumerate()
        .map(|(corner, index)| match u32::try_from(index) {
            Ok(index) if (index as usize) < coordinates.len() => Ok(index),
            _ => Err(input(format!(
                "uvs: corner {corner} has the index {index}, but there are {} coordinates",
                coordinates.len()
            ))),
        })
        .collect::<PyResult<_>>()?;
    let uvs = CornerUvs {
        coordinates,
        corners,
    };
    mesh.with_uvs(uvs).map_err(to_py)
}

/// Reads an OBJ, PLY, STL or glTF file. A rig of the mesh keeps the file's materials and pictures.
///
/// >>> fabrig.demo_face().write_obj("face.obj")
/// >>> fabrig.read_mesh("face.obj")
/// Mesh(13082 vertices, 25805 faces)
#[pyfunction]
pub(crate) fn read_mesh(py: Python<'_>, path: PathBuf) -> PyResult<PyMesh> {
    let file = path.clone();
    let inner = interruptible(py, || io::read_mesh(file))?.map_err(to_py)?;
    Ok(PyMesh {
        inner,
        source: Some(path),
    })
}

/// The shapes that a mesh file holds beside its mesh (morph targets of glTF), by name: the
/// vertices (N, 3) at weight 1, in the file's units.
///
/// >>> mesh, shapes = fabrig.read_mesh("face.glb"), fabrig.read_shapes("face.glb")  # doctest: +SKIP
/// >>> rig = fabrig.rig(mesh, expressions=shapes)  # doctest: +SKIP
#[pyfunction]
pub(crate) fn read_shapes<'py>(py: Python<'py>, path: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let file = interruptible(py, || io::read_mesh_with_shapes(path))?.map_err(to_py)?;
    let shapes = PyDict::new(py);
    for shape in &file.shapes {
        let positions = arrays::from_points(py, &shape.positions(&file.mesh));
        shapes.set_item(&shape.name, positions)?;
    }
    Ok(shapes)
}

/// The bundled face: not the template, in metres, turned, with eyes and teeth.
///
/// >>> fabrig.demo_face()
/// Mesh(13082 vertices, 25805 faces)
#[pyfunction]
pub(crate) fn demo_face() -> PyMesh {
    template::demo_face().into()
}
