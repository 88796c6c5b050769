//! Rigs.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use fabrig_core::edit::{Edits, load_edited_rig};
use fabrig_core::rig::Rig;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::mesh::PyMesh;

/// A face that is ready to move.
#[pyclass(frozen, name = "Rig", module = "fabrig")]
pub(crate) struct PyRig {
    pub(crate) inner: Arc<Rig>,
}

#[pymethods]
impl PyRig {
    /// Loads a rig file, with the edits that stand beside it (`face.edits.toml`) unless
    /// `edits` is false.
    #[staticmethod]
    #[pyo3(signature = (path, *, edits=true))]
    fn load(py: Python<'_>, path: PathBuf, edits: bool) -> PyResult<Self> {
        let inner = py
            .detach(|| {
                if edits {
                    load_edited_rig(path)
                } else {
                    Ok(Rig::load(path)?)
                }
            })
            .map_err(to_py)?;
        Ok(Self {
            inner: Arc::new(inner),
        })
    }

    /// The rig with the edits of a file (`face.edits.toml`); this one stays as it is.
    fn with_edits(&self, py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let edited = py.detach(|| {
            let mut rig = Rig::clone(&self.inner);
            Edits::load(path)?.apply(&mut rig)?;
            Ok::<_, fabrig_core::edit::EditError>(rig)
        });
        Ok(Self {
            inner: Arc::new(edited.map_err(to_py)?),
        })
    }

    /// Saves the rig as one file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.inner.save(path)).map_err(to_py)
    }

    /// The user's mesh, in its own units and vertex order.
    #[getter]
    fn mesh(&self) -> PyMesh {
        PyMesh {
            inner: self.inner.face.clone(),
        }
    }

    /// The face in the template's topology [mm, head frame], shape (M, 3).
    #[getter]
    fn normalized<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_points(py, &self.inner.positions)
    }

    /// Names of the shapes, in the order of weights.
    #[getter]
    fn shape_names(&self) -> Vec<String> {
        self.inner.shape_names.clone()
    }

    /// Names of the patches of muscle and fat.
    #[getter]
    fn patch_names(&self) -> Vec<String> {
        let patches = self.inner.patches.iter();
        patches.map(|p| p.patch.chart.name.clone()).collect()
    }

    /// Amplitude of each patch against the template's, alpha of Eq. 3, by name.
    #[getter]
    fn alphas(&self) -> BTreeMap<String, f64> {
        let patches = self.inner.patches.iter();
        patches
            .map(|p| (p.patch.chart.name.clone(), p.transfer.alpha))
            .collect()
    }

    /// Nodes of all patches.
    #[getter]
    fn node_count(&self) -> usize {
        self.inner
            .patches
            .iter()
            .map(|p| p.patch.neutral.len())
            .sum()
    }

    /// Millimetres per unit of the user's mesh.
    #[getter]
    fn millimetres_per_unit(&self) -> f64 {
        self.inner.to_head.scaling()
    }

    /// From the user's mesh to the head frame: a matrix [mm per unit], shape (4, 4).
    #[getter]
    fn to_head<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_matrix(py, &self.inner.to_head.to_homogeneous())
    }

    /// What registration measured; empty for a rig that was made without it.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.inner.registration_report.as_str();
        let text = if text.is_empty() { "{}" } else { text };
        py.import("json")?.call_method1("loads", (text,))
    }

    fn __repr__(&self) -> String {
        format!(
            "Rig({} vertices, {} patches, {} nodes)",
            self.inner.face.vertex_count(),
            self.inner.patches.len(),
            self.node_count()
        )
    }
}

impl PyRig {
    /// Index of a patch by its name.
    pub(crate) fn patch_index(&self, name: &str) -> PyResult<usize> {
        let mut patches = self.inner.patches.iter();
        patches
            .position(|p| p.patch.chart.name == name)
            .ok_or_else(|| input(format!("patch: the rig has no patch '{name}'")))
    }
}
