//! Rigs.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use fabrig_core::edit::{Edits, load_edited_rig};
use fabrig_core::evaluation::{CheckGates, GATES, check_rig};
use fabrig_core::export::ExportOptions;
use fabrig_core::rig::Rig;
use fabrig_core::scene::Scene;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::export::{Layout, shape_source};
use crate::mesh::PyMesh;
use crate::motion::PyClip;
use crate::progress::Progress;
use crate::template::template_of;

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

    /// Writes the rig for other programs; returns a report.
    ///
    /// - `path`: .glb, .gltf, .usda, .npz, .pc2, .mdd, or a folder for OBJ files
    /// - `motion`: a take, which becomes an animation of the 52 shapes; `baked`: of the simulated
    ///   vertices instead, always so for point caches and OBJ
    /// - `face`: the mesh that the rig was made from, for its materials and textures
    /// - `unit`: "own", "mm", "cm", "m" or "in"; metres for glTF by default, else the face's own
    /// - `shapes`: "settled" takes them from the cloth at rest, "targets" from the muscle shapes
    ///   alone, which is quicker
    /// - `components`: morph targets of a baked glTF; as many as `tolerance` (mm) needs by default
    /// - `check`: whether the sum of the shapes is compared with the simulation
    /// - `scene`: a mapping of the fields of a scene file
    /// - `progress`: called with (stage, share)
    ///
    /// >>> rig.export("face.glb", motion=fabrig.demo_take())["linear"]["rms_mm"]
    #[pyo3(signature = (path, *, motion=None, baked=false, face=None, unit=None, name=None,
                        fps=None, shapes="settled", still_head=false, components=None,
                        tolerance=None, check=true, scene=None, progress=None))]
    #[allow(clippy::too_many_arguments)] // Keyword-only in Python.
    fn export<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        motion: Option<&PyClip>,
        baked: bool,
        face: Option<PathBuf>,
        unit: Option<&str>,
        name: Option<String>,
        fps: Option<f64>,
        shapes: &str,
        still_head: bool,
        components: Option<usize>,
        tolerance: Option<f64>,
        check: bool,
        scene: Option<Bound<'py, PyAny>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let layout = Layout {
            face,
            unit,
            name,
            still_head,
            components,
            tolerance,
        };
        let options = ExportOptions {
            baked,
            fps,
            shapes: shape_source(shapes)?,
            check_sum: check,
            scene: crate::simulation::scene(scene.as_ref(), None, None, None, true)?,
            ..layout.options()?
        };
        crate::export::export(py, self, path, motion, options, progress)
    }

    /// The user's mesh, in its own units and vertex order.
    #[getter]
    fn mesh(&self) -> PyMesh {
        PyMesh {
            inner: self.inner.face.clone(),
            source: None,
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

    /// Whether every shape does on this face what it should: the report of `fabrig check`, as a
    /// dictionary, with `passes`, the `distances` of all vertices from the registered template
    /// [mm, NaN for parts that are no skin], shape (N,), and `marked`: shape name -> vertices
    /// that findings are about.
    ///
    /// - `gates`: limit by name, instead of the defaults
    /// - `template`: folder of the template that the rig was made with, where that is your own
    /// - `progress`: called with ("check", share)
    #[pyo3(signature = (*, gates=None, template=None, progress=None))]
    fn check<'py>(
        &self,
        py: Python<'py>,
        gates: Option<BTreeMap<String, f64>>,
        template: Option<PathBuf>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut limits = CheckGates::default();
        for (name, limit) in gates.unwrap_or_default() {
            if !limit.is_finite() || !limits.set(&name, limit) {
                let names: Vec<&str> = GATES.iter().map(|gate| gate.name).collect();
                return Err(input(format!(
                    "gates: '{name}' = {limit} is not a limit of one of {}",
                    names.join(", ")
                )));
            }
        }
        let mut progress = Progress::new(progress);
        let template = template_of(template)?;
        let count = self.inner.shape_names.len() as f64;
        let check = py.detach(|| {
            let scene = Scene::without_dynamics();
            check_rig(&self.inner, &template, &limits, &scene, &mut |shape| {
                progress.report("check", shape as f64 / count)
            })
        });
        progress.finish()?;
        let check = check.map_err(to_py)?;
        let report = arrays::to_python(py, &check.report)?;
        report.set_item("passes", check.report.passes())?;
        let distances = check.distances.iter();
        let distances: Vec<f64> = distances.map(|d| d.unwrap_or(f64::NAN)).collect();
        report.set_item("distances", PyArray1::from_vec(py, distances))?;
        let names = self.inner.shape_names.iter().cloned();
        let marked: BTreeMap<String, Vec<u32>> = names
            .zip(check.marked)
            .filter(|(_, vertices)| !vertices.is_empty())
            .collect();
        report.set_item("marked", marked)?;
        Ok(report)
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
