//! Rigs.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use fabrig_core::collision::PairMask;
use fabrig_core::edit::{export_muscle_shape, load_edited_rig, muscle_shape_names};
use fabrig_core::evaluation::{CheckGates, GATES, check_rig};
use fabrig_core::export::ExportOptions;
use fabrig_core::facs::expression_sheet;
use fabrig_core::mesh::Mesh;
use fabrig_core::rig::Rig;
use fabrig_core::scene::Scene;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays;
use crate::edits::{edited, edits_of};
use crate::errors::{input, to_py};
use crate::export::{Layout, shape_source};
use crate::mesh::PyMesh;
use crate::motion::PyClip;
use crate::pose::weights_of;
use crate::progress::{Progress, interruptible};
use crate::render::{Content, Shot, draw_rig};
use crate::simulation::scene;
use crate::template::template_of;

/// A face that is ready to move: made by `fabrig.rig`, or loaded.
///
/// >>> rig = fabrig.rig(fabrig.demo_face())
/// >>> rig
/// Rig(13082 vertices, 44 patches, 19380 nodes)
#[pyclass(frozen, name = "Rig", module = "fabrig")]
pub(crate) struct PyRig {
    pub(crate) inner: Arc<Rig>,
}

#[pymethods]
impl PyRig {
    /// Loads the rig file `path`, with the edits that stand beside it (`face.edits.toml`) unless
    /// `edits` is false.
    ///
    /// >>> fabrig.rig(fabrig.demo_face()).save("face.fabrig")
    /// >>> rig = fabrig.Rig.load("face.fabrig")
    #[staticmethod]
    #[pyo3(signature = (path, *, edits=true))]
    fn load(py: Python<'_>, path: PathBuf, edits: bool) -> PyResult<Self> {
        let inner = interruptible(py, move || {
            if edits {
                load_edited_rig(path)
            } else {
                Ok(Rig::load(path)?)
            }
        })?
        .map_err(to_py)?;
        Ok(Self {
            inner: Arc::new(inner),
        })
    }

    /// The rig with edits applied; this one stays as it is.
    ///
    /// - `edits`: an `Edits`, a mapping of the same fields, or the path of `face.edits.toml`
    ///
    /// >>> rig = fabrig.rig(fabrig.demo_face())
    /// >>> soft = rig.with_edits({"patches": {"malar_fat_l": {"alpha": 1.2}}})
    /// >>> round(soft.alphas["malar_fat_l"], 6)
    /// 1.2
    fn with_edits(&self, py: Python<'_>, edits: &Bound<'_, PyAny>) -> PyResult<Self> {
        let edits = edits_of(edits)?;
        let inner = py.detach(|| edited(&self.inner, &edits)).map_err(to_py)?;
        Ok(Self {
            inner: Arc::new(inner),
        })
    }

    /// Names of the muscle shapes, patch after patch: what edits are addressed to.
    ///
    /// >>> rig = fabrig.rig(fabrig.demo_face())
    /// >>> "zygomaticus_major_l.mouthSmileLeft" in rig.muscle_shapes
    /// True
    #[getter]
    fn muscle_shapes(&self) -> Vec<String> {
        let names = muscle_shape_names(&self.inner).into_iter();
        names.map(str::to_owned).collect()
    }

    /// A patch with one of its muscle shapes at weight 1: a grid of quads [mm, head frame].
    ///
    /// - `name`: of `muscle_shapes`
    ///
    /// >>> rig = fabrig.rig(fabrig.demo_face())
    /// >>> rig.muscle_shape("zygomaticus_major_l.mouthSmileLeft")
    /// Mesh(420 vertices, 380 faces)
    fn muscle_shape(&self, name: &str) -> PyResult<PyMesh> {
        Ok(self.muscle_mesh(name)?.into())
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
    /// - `name`: of the object in the file; `fps`: frames a second of `motion`
    /// - `still_head`: leave the motion of the head out
    /// - `check`: whether the sum of the shapes is compared with the simulation
    /// - `scene`: a mapping of the fields of a scene file, or its path
    /// - `progress`: True for a bar, or a function of (stage, share)
    ///
    /// >>> rig = fabrig.rig(fabrig.demo_face())
    /// >>> rig.export("face.glb", shapes="targets", check=False)["morph_targets"]  # doctest: +SKIP
    /// 52
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
            scene: self::scene(scene.as_ref(), None, None, None, None, true)?,
            ..layout.options()?
        };
        crate::export::export(py, self, path, motion, options, progress)
    }

    /// Weights of the rig's shapes by name, in any spelling; a name without its side sets both.
    ///
    /// - `pose`: name -> weight in [0, 1]
    /// - returns: shape (S,), in the order of `shape_names`
    ///
    /// >>> rig = fabrig.rig(fabrig.demo_face())
    /// >>> float(rig.weights({"jawOpen": 0.5, "mouthSmile": 1}).sum())
    /// 2.5
    fn weights<'py>(
        &self,
        py: Python<'py>,
        pose: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let weights = weights_of("pose", pose, &self.inner.shape_names)?;
        Ok(PyArray1::from_vec(py, weights))
    }

    /// Named expressions of a sheet of twelve, as `Simulation.step` and `render` take them:
    /// name -> weights (S,).
    ///
    /// - `sheet`: "motion", how far a face goes, or "emotions", with shapes of speech
    ///
    /// >>> rig = fabrig.rig(fabrig.demo_face())
    /// >>> len(rig.expressions("emotions"))
    /// 12
    #[pyo3(signature = (sheet="motion"))]
    fn expressions<'py>(&self, py: Python<'py>, sheet: &str) -> PyResult<Bound<'py, PyDict>> {
        let known = expression_sheet(sheet, &self.inner.shape_names).map_err(to_py)?;
        if known.is_empty() {
            return Err(input(format!(
                "sheet: '{sheet}' is not one of motion, emotions"
            )));
        }
        let poses = PyDict::new(py);
        for (name, weights) in known {
            poses.set_item(name, PyArray1::from_vec(py, weights))?;
        }
        Ok(poses)
    }

    /// A picture of the face in a pose, held until it is still: (size, size, 3) of bytes.
    ///
    /// - `pose`: name -> weight, or weights (S,); neutral by default
    /// - `view`: "front", "three-quarter", "side", "back", "top", "below" or "YAW,PITCH" in
    ///   degrees
    /// - `size`: pixels to each side
    /// - `zoom`: "all", "face", "mouth", "eyes" or "eye"
    /// - `patches`: muscles and fat instead of the skin; `names`: with their names beside them, in
    ///   a picture that is 8/5 as wide
    /// - `edges`: whether the edges of faces are drawn
    /// - `dynamics`: whether the cloth settles, or the patches stand where the shapes want them
    ///
    /// >>> rig = fabrig.rig(fabrig.demo_face())
    /// >>> rig.render({"jawOpen": 0.6}, size=64, dynamics=False).shape
    /// (64, 64, 3)
    #[pyo3(signature = (pose=None, *, view="front", size=512, zoom="all", patches=false,
                        names=false, edges=false, dynamics=true))]
    #[allow(clippy::too_many_arguments)] // Keyword-only in Python.
    fn render<'py>(
        &self,
        py: Python<'py>,
        pose: Option<&Bound<'py, PyAny>>,
        view: &str,
        size: u32,
        zoom: &str,
        patches: bool,
        names: bool,
        edges: bool,
        dynamics: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let shapes = &self.inner.shape_names;
        let weights = match pose {
            Some(pose) => weights_of("pose", pose, shapes)?,
            None => vec![0.0; shapes.len()],
        };
        let shot = Shot::new(view, size, edges)?.framed(zoom)?;
        let scene = scene(None, None, None, None, None, dynamics)?;
        draw_rig(
            py,
            &self.inner,
            weights,
            scene,
            shot,
            Content { patches, names },
        )
    }

    /// The user's mesh, in its own units and vertex order.
    #[getter]
    fn mesh(&self) -> PyMesh {
        self.inner.face.clone().into()
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
    /// - `template`: the template that the rig was made with, or its folder, where that is your
    ///   own
    /// - `contact`: hold each shape by the cloth, with contact of lips and lids, instead of
    ///   looking at it as the muscles have it; takes minutes
    /// - `progress`: True for a bar, or a function of ("check", share)
    ///
    /// >>> rig = fabrig.rig(fabrig.demo_face())
    /// >>> rig.check()["passes"]
    /// True
    #[pyo3(signature = (*, gates=None, template=None, contact=false, progress=None))]
    pub(crate) fn check<'py>(
        &self,
        py: Python<'py>,
        gates: Option<BTreeMap<String, f64>>,
        template: Option<&Bound<'py, PyAny>>,
        contact: bool,
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
        let mut progress = Progress::new(py, progress)?;
        let template = template_of(template)?;
        let count = self.inner.shape_names.len() as f64;
        let check = py.detach(|| {
            let scene = if contact {
                let mut scene = Scene::default();
                scene.contact.pairs = PairMask::Sphincter;
                scene
            } else {
                Scene::without_dynamics()
            };
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

    /// Name of the template that the rig was made with.
    ///
    /// >>> fabrig.rig(fabrig.demo_face()).template
    /// 'human'
    #[getter]
    fn template(&self) -> &str {
        &self.inner.template
    }

    /// Region of each vertex of the user's mesh; None where it is no skin.
    ///
    /// >>> "upper_lip" in fabrig.rig(fabrig.demo_face()).regions
    /// True
    #[getter]
    fn regions(&self) -> Vec<Option<&str>> {
        let names = &self.inner.region_names;
        let regions = self.inner.regions.iter();
        regions
            .map(|region| {
                names
                    .get(usize::from(region.as_ref()?.0))
                    .map(String::as_str)
            })
            .collect()
    }

    /// Loose pieces that are no skin (eyeballs, teeth, tongue): name -> vertices.
    ///
    /// >>> sorted(fabrig.rig(fabrig.demo_face()).parts)[0]
    /// 'eye_l'
    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let parts = PyDict::new(py);
        for part in &self.inner.parts {
            parts.set_item(&part.name, PyArray1::from_slice(py, &part.vertices))?;
        }
        Ok(parts)
    }

    /// Nodes of a patch at rest [mm, head frame], shape (rows, columns, 3): fibres run along
    /// the columns.
    ///
    /// >>> fabrig.rig(fabrig.demo_face()).patch("masseter_l").shape
    /// (20, 21, 3)
    fn patch<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let patch = &self.inner.patches[self.patch_index(name)?].patch;
        let grid = patch.chart.grid;
        let nodes = arrays::from_points(py, &patch.neutral);
        nodes.call_method1("reshape", (grid.v_count, grid.u_count, 3))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let bytes = py.detach(|| self.inner.to_bytes()).map_err(to_py)?;
        arrays::restored_by(py, "rig", &bytes)
    }

    #[staticmethod]
    fn _from_bytes(py: Python<'_>, bytes: &[u8]) -> PyResult<Self> {
        let inner = py.detach(|| Rig::from_bytes(bytes)).map_err(to_py)?;
        Ok(Self {
            inner: Arc::new(inner),
        })
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
    /// A muscle shape as a mesh.
    pub(crate) fn muscle_mesh(&self, name: &str) -> PyResult<Mesh> {
        export_muscle_shape(&self.inner, name).map_err(to_py)
    }

    /// Index of a patch by its name.
    pub(crate) fn patch_index(&self, name: &str) -> PyResult<usize> {
        let mut patches = self.inner.patches.iter();
        patches
            .position(|p| p.patch.chart.name == name)
            .ok_or_else(|| input(format!("patch: the rig has no patch '{name}'")))
    }
}
