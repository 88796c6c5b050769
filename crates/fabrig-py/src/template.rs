//! The bundled template.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;

use fabrig_core::template::{self, Template};
use pyo3::prelude::*;

use crate::errors::to_py;
use crate::mesh::PyMesh;

/// The template in a folder, or the bundled one.
pub(crate) fn template_of(folder: Option<PathBuf>) -> PyResult<Cow<'static, Template>> {
    Ok(match folder {
        Some(folder) => Cow::Owned(Template::load(&folder).map_err(to_py)?),
        None => Cow::Borrowed(template::human()),
    })
}

/// The template whose topology every normalized face has.
#[pyclass(frozen, name = "Template", module = "fabrig")]
pub(crate) struct PyTemplate;

#[pymethods]
impl PyTemplate {
    /// The neutral skin [mm, head frame].
    #[getter]
    fn mesh(&self) -> PyMesh {
        PyMesh {
            inner: template::human().skin.clone(),
            source: None,
        }
    }

    /// Name of each landmark -> its vertex.
    #[getter]
    fn landmarks(&self) -> BTreeMap<String, u32> {
        let landmarks = template::human().landmarks.iter();
        landmarks.map(|(name, &v)| (name.clone(), v)).collect()
    }

    /// Name of the region of each vertex: `upper_lip`, `scalp`, ...
    #[getter]
    fn regions(&self) -> Vec<String> {
        let regions = &template::human().regions;
        let named = regions.vertex_regions.iter();
        named
            .map(|region| regions.regions[usize::from(region.0)].name.clone())
            .collect()
    }

    fn __repr__(&self) -> String {
        let skin = &template::human().skin;
        format!("Template({} vertices)", skin.vertex_count())
    }
}

/// The bundled template.
#[pyfunction(name = "template")]
pub(crate) fn template_pack() -> PyTemplate {
    PyTemplate
}
