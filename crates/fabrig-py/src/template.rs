//! Templates.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

use fabrig_core::mesh::io::read_mesh;
use fabrig_core::pipeline::{
    OwnTemplateOptions, neutral_of_shapes, read_own_shapes, template_from_face,
};
use fabrig_core::rig::{RigOptions, rig_of_template, write_template_weights};
use fabrig_core::template::{self, Template};
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{TemplateError, input, to_py};
use crate::mesh::PyMesh;
use crate::pose::weights_of;
use crate::progress::{Progress, interruptible};
use crate::registration::registration_options;
use crate::render::{Shot, draw_template};
use crate::rig::PyRig;

/// The bundled template, shared.
static BUNDLED: LazyLock<Arc<Template>> = LazyLock::new(|| Arc::new(template::human().clone()));

/// A template from a `Template` or a folder; the bundled one without either.
pub(crate) fn template_of(value: Option<&Bound<'_, PyAny>>) -> PyResult<Arc<Template>> {
    let Some(value) = value else {
        return Ok(Arc::clone(&BUNDLED));
    };
    if let Ok(template) = value.cast::<PyTemplate>() {
        return Ok(Arc::clone(&template.get().inner));
    }
    let folder: PathBuf = value
        .extract()
        .map_err(|_| input("template: expected a Template, or the folder of one"))?;
    Ok(PyTemplate::load(value.py(), folder)?.inner)
}

/// The face that is transferred to others; every normalized face has its topology.
///
/// >>> fabrig.template()
/// Template('human', 4242 vertices, 52 shapes)
#[pyclass(frozen, name = "Template", module = "fabrig")]
pub(crate) struct PyTemplate {
    inner: Arc<Template>,
}

#[pymethods]
impl PyTemplate {
    /// Loads the template in a folder.
    ///
    /// >>> mine = fabrig.Template.load("mytemplate")  # doctest: +SKIP
    #[staticmethod]
    fn load(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let inner = interruptible(py, move || Template::load(&folder))?.map_err(to_py)?;
        Ok(Self {
            inner: Arc::new(inner),
        })
    }

    /// Makes a template of a rig that you have, as an artist made it, and writes it to a folder;
    /// returns it with a report.
    ///
    /// - `source`: a folder with a neutral mesh and meshes named as ARKit's shapes, or a glTF
    ///   file with morph targets
    /// - `folder`: where it goes; `name`: its name, the folder's by default
    /// - `credit`: whose work the rig is, and under which licence
    /// - `landmarks`, `landmarks_order`: as for `fabrig.rig`
    /// - `progress`: True for a bar, or a function of (stage, share)
    ///
    /// >>> mine, report = fabrig.Template.build("myrig", "mytemplate")  # doctest: +SKIP
    /// >>> report["own"]  # doctest: +SKIP
    #[staticmethod]
    #[pyo3(signature = (source, folder, *, name=None, credit="", landmarks=None,
                        landmarks_order=None, progress=None))]
    #[allow(clippy::too_many_arguments)] // Keyword-only in Python.
    fn build<'py>(
        py: Python<'py>,
        source: PathBuf,
        folder: PathBuf,
        name: Option<String>,
        credit: &str,
        landmarks: Option<&Bound<'py, PyAny>>,
        landmarks_order: Option<&str>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Self, Bound<'py, PyAny>)> {
        let base = template::human();
        let named = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default();
            name.to_string_lossy().into_owned()
        };
        let options = OwnTemplateOptions {
            name: name.unwrap_or_else(|| named(&folder)),
            credit: credit.to_owned(),
            registration: registration_options(landmarks, landmarks_order, None, None)?,
        };
        if options.name == base.name {
            return Err(input(format!(
                "name: '{}' is the bundled template; give another",
                base.name
            )));
        }
        let mut progress = Progress::new(py, progress)?;
        let made = py.detach(|| -> Result<_, fabrig_core::Error> {
            let Some(path) = neutral_of_shapes(&source)? else {
                return Ok(None);
            };
            let neutral = read_mesh(&path)?;
            let own = read_own_shapes(&source, &neutral, base)?;
            let report = &mut |step: fabrig_core::registration::Progress| {
                progress.report(step.stage, step.fraction)
            };
            let made = template_from_face(&neutral, &own.expressions, base, &options, report)?;
            made.template.save(&folder)?;
            // Read again as it is stored: that is what weights are fitted to.
            write_template_weights(&Template::load(&folder)?, &folder)?;
            Ok(Some((Template::load(&folder)?, made, own.skipped)))
        });
        progress.finish()?;
        let Some((inner, made, skipped)) = made.map_err(to_py)? else {
            return Err(TemplateError::new_err(format!(
                "{}: a folder needs one mesh with 'neutral' in its name",
                source.display()
            )));
        };
        let report = serde_json::json!({
            "own": made.own,
            "borrowed": made.borrowed,
            "asymmetry_mm": made.asymmetry_mm,
            "skipped": skipped,
            "registration": made.report,
        });
        let inner = Arc::new(inner);
        Ok((Self { inner }, arrays::to_python(py, &report)?))
    }

    /// Whether the template's shapes do on itself what they should: the report of `Rig.check`, as
    /// `fabrig template check` makes it.
    ///
    /// - `gates`: limit by name, instead of the defaults
    /// - `progress`: True for a bar, or a function of ("check", share)
    ///
    /// >>> fabrig.template().check()["passes"]
    /// True
    #[pyo3(signature = (*, gates=None, progress=None))]
    fn check<'py>(
        slf: &Bound<'py, Self>,
        gates: Option<BTreeMap<String, f64>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rig = slf.get().rig(slf.py())?;
        rig.check(slf.py(), gates, Some(slf.as_any()), false, progress)
    }

    /// The rig of the template itself: its skin, moved by its own muscles.
    ///
    /// >>> fabrig.template().rig()
    /// Rig(4242 vertices, 44 patches, 19380 nodes)
    fn rig(&self, py: Python<'_>) -> PyResult<PyRig> {
        let template = Arc::clone(&self.inner);
        let rig = interruptible(py, move || {
            rig_of_template(&template, &RigOptions::default())
        })?;
        Ok(PyRig {
            inner: Arc::new(rig.map_err(to_py)?),
        })
    }

    /// Name.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// Whose work it stands on, and under which licence.
    #[getter]
    fn credit(&self) -> &str {
        &self.inner.credit
    }

    /// The neutral skin [mm, head frame].
    #[getter]
    fn mesh(&self) -> PyMesh {
        self.inner.skin.clone().into()
    }

    /// Name of each landmark -> its vertex.
    #[getter]
    fn landmarks(&self) -> BTreeMap<String, u32> {
        let landmarks = self.inner.landmarks.iter();
        landmarks.map(|(name, &v)| (name.clone(), v)).collect()
    }

    /// Name of the region of each vertex: `upper_lip`, `scalp`, ...
    #[getter]
    fn regions(&self) -> Vec<&str> {
        let regions = &self.inner.regions;
        let named = regions.vertex_regions.iter();
        named
            .map(|region| regions.regions[usize::from(region.0)].name.as_str())
            .collect()
    }

    /// Names of the whole-face shapes.
    #[getter]
    fn shape_names(&self) -> Vec<&str> {
        self.inner.shapes.iter().map(|s| s.name.as_str()).collect()
    }

    /// What a shape does to the skin at weight 1: displacements (mm), shape (4242, 3).
    ///
    /// >>> float(abs(fabrig.template().shape("jawOpen")).max()) > 20
    /// True
    fn shape<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let index = self
            .inner
            .shape_index(name)
            .ok_or_else(|| input(format!("name: the template has no shape '{name}'")))?;
        let deltas = self.inner.shapes[index].spread(self.inner.skin.vertex_count());
        Ok(arrays::from_rows(py, 3, bytemuck::cast_slice(&deltas)))
    }

    /// A picture of the template under its own shapes: (size, size, 3) of bytes. Nothing is
    /// simulated.
    ///
    /// - `pose`: name -> weight, or weights; neutral by default
    /// - `view`, `size`, `zoom`, `edges`: as for `Rig.render`
    ///
    /// >>> fabrig.template().render({"mouthSmile": 1}, size=64).shape
    /// (64, 64, 3)
    #[pyo3(signature = (pose=None, *, view="front", size=512, zoom="all", edges=false))]
    #[allow(clippy::too_many_arguments)] // Keyword-only in Python.
    fn render<'py>(
        &self,
        py: Python<'py>,
        pose: Option<&Bound<'py, PyAny>>,
        view: &str,
        size: u32,
        zoom: &str,
        edges: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let names: Vec<String> = self.inner.shapes.iter().map(|s| s.name.clone()).collect();
        let weights = match pose {
            Some(pose) => weights_of("pose", pose, &names)?,
            None => vec![0.0; names.len()],
        };
        let shot = Shot::new(view, size, edges)?.framed(zoom)?;
        draw_template(py, &self.inner, weights, shot)
    }

    fn __repr__(&self) -> String {
        format!(
            "Template('{}', {} vertices, {} shapes)",
            self.inner.name,
            self.inner.skin.vertex_count(),
            self.inner.shapes.len()
        )
    }
}

/// The bundled template.
///
/// >>> fabrig.template().name
/// 'human'
#[pyfunction(name = "template")]
pub(crate) fn template_pack() -> PyTemplate {
    PyTemplate {
        inner: Arc::clone(&BUNDLED),
    }
}
