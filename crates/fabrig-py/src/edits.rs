//! Edits of single muscles.

use std::collections::BTreeMap;
use std::path::PathBuf;

use fabrig_core::edit::{EditError, Edits, edits_path, import_muscle_shape, presets};
use fabrig_core::rig::Rig;
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::mesh::PyMesh;
use crate::rig::PyRig;
use crate::simulation::json_of;

/// What an artist changes on a rig, by name: presets, muscle shapes, patches, materials. The
/// fields are those of `face.edits.toml`.
///
/// - `edits`: {"preset": "looser_skin", "shapes": {...}, "patches": {...}, "materials": {...}};
///   nothing by default
///
/// >>> smile = "zygomaticus_major_l.mouthSmileLeft"
/// >>> edits = fabrig.Edits({"shapes": {smile: {"strength": 1.4}}})
/// >>> edits.to_dict()["shapes"][smile]
/// {'strength': 1.4}
#[pyclass(name = "Edits", module = "fabrig")]
pub(crate) struct PyEdits {
    inner: Edits,
}

#[pymethods]
impl PyEdits {
    #[new]
    #[pyo3(signature = (edits=None))]
    fn new(edits: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Some(edits) = edits else {
            return Ok(Self {
                inner: Edits::default(),
            });
        };
        let text = json_of("edits", edits)?;
        let inner = serde_json::from_str(&text).map_err(|e| input(format!("edits: {e}")))?;
        Ok(Self { inner })
    }

    /// What `{"preset": name}` knows: names with what they make of a face.
    ///
    /// >>> sorted(fabrig.Edits.presets())
    /// ['aged', 'firmer_skin', 'less_fat', 'looser_skin', 'more_fat']
    #[staticmethod]
    fn presets() -> PyResult<BTreeMap<String, String>> {
        let known = presets().map_err(to_py)?;
        Ok(known.into_iter().map(|(name, p)| (name, p.about)).collect())
    }

    /// Reads a file of edits.
    ///
    /// >>> fabrig.Edits({"patches": {"malar_fat_l": {"alpha": 1.2}}}).save("face.edits.toml")
    /// >>> fabrig.Edits.load("face.edits.toml").to_dict()["patches"]
    /// {'malar_fat_l': {'alpha': 1.2}}
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let inner = Edits::load(path).map_err(to_py)?;
        Ok(Self { inner })
    }

    /// The edits that stand beside a rig file (`face.edits.toml` beside `face.fabrig`); none
    /// where there is no such file.
    ///
    /// >>> fabrig.Edits.beside("nothing.fabrig").to_dict()
    /// {}
    #[staticmethod]
    fn beside(rig: PathBuf) -> PyResult<Self> {
        let inner = Edits::beside(rig).map_err(to_py)?.unwrap_or_default();
        Ok(Self { inner })
    }

    /// Where the edits of a rig file stand.
    ///
    /// >>> fabrig.Edits.path_of("face.fabrig").name
    /// 'face.edits.toml'
    #[staticmethod]
    fn path_of(rig: PathBuf) -> PathBuf {
        edits_path(&rig)
    }

    /// Writes the edits to a file.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.inner.save(path).map_err(to_py)
    }

    /// As the text of a file (TOML): equal edits give equal text.
    fn to_text(&self) -> PyResult<String> {
        self.inner.to_text().map_err(to_py)
    }

    /// As plain values.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::to_python(py, &self.inner)
    }

    /// Takes a changed muscle shape in; returns how many nodes are moved.
    ///
    /// - `rig`: the rig without these edits
    /// - `shape`: its name, such as "zygomaticus_major_l.mouthSmileLeft"
    /// - `vertices`: where its nodes are now [mm, head frame], shape (nodes, 3), or a mesh, as
    ///   `Rig.muscle_shape` gives it
    ///
    /// >>> rig = fabrig.rig(fabrig.demo_face())
    /// >>> name, edits = "zygomaticus_major_l.mouthSmileLeft", fabrig.Edits()
    /// >>> shape = rig.muscle_shape(name)
    /// >>> edits.sculpt(rig, name, shape.vertices + [0, 1, 0])
    /// 420
    fn sculpt(&mut self, rig: &PyRig, shape: &str, vertices: &Bound<'_, PyAny>) -> PyResult<usize> {
        let base = rig.muscle_mesh(shape)?;
        let mesh = match vertices.cast::<PyMesh>() {
            Ok(mesh) => mesh.get().inner.clone(),
            Err(_) => {
                let positions = arrays::points("vertices", vertices)?;
                base.with_positions(positions).map_err(to_py)?
            }
        };
        import_muscle_shape(&rig.inner, shape, &mesh, &mut self.inner).map_err(to_py)
    }

    fn __len__(&self) -> usize {
        let Edits {
            shapes,
            patches,
            materials,
            wrinkles,
            ..
        } = &self.inner;
        shapes.len() + patches.len() + materials.len() + wrinkles.len()
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.inner.says_same_as(&other.inner)
    }

    fn __repr__(&self) -> String {
        format!(
            "Edits({} shapes, {} patches, {} materials)",
            self.inner.shapes.len(),
            self.inner.patches.len(),
            self.inner.materials.len()
        )
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyAny>,))> {
        let fields = slf.borrow().to_dict(slf.py())?;
        Ok((slf.get_type().into_any(), (fields,)))
    }
}

/// Edits from an `Edits`, a mapping, or the path of a file.
pub(crate) fn edits_of(value: &Bound<'_, PyAny>) -> PyResult<Edits> {
    if let Ok(edits) = value.cast::<PyEdits>() {
        return Ok(edits.borrow().inner.clone());
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return Edits::load(path).map_err(to_py);
    }
    Ok(PyEdits::new(Some(value))?.inner)
}

/// A rig with edits applied.
pub(crate) fn edited(rig: &Rig, edits: &Edits) -> Result<Rig, EditError> {
    let mut rig = rig.clone();
    edits.apply(&mut rig)?;
    Ok(rig)
}
