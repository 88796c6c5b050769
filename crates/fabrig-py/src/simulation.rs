//! Stepping a rig.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fabrig_core::collision::{PairMask, Stickiness, read_colliders};
use fabrig_core::motion::{EyeAngles, ReadOptions};
use fabrig_core::pipeline::{StagedFace, load_faces};
use fabrig_core::scene::fields::HeadDrive;
use fabrig_core::scene::{Dynamics, FacePose, Scene, SceneError, Simulation, Tolerance, hold_pose};
use fabrig_core::template;
use nalgebra::{Isometry3, Vector3};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::errors::{SceneError as SceneFailure, input, to_py};
use crate::motion::PyClip;
use crate::pose::weights_of;
use crate::progress::Progress;
use crate::render::{Content, Shot, draw_simulation};
use crate::rig::PyRig;

/// Plain values as JSON.
pub(crate) fn json_of(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    value
        .py()
        .import("fabrig._plain")?
        .call_method1("to_json", (value,))
        .map_err(|e| input(format!("{argument}: not made of plain values: {e}")))?
        .extract()
}

/// A scene from keyword arguments: a mapping of a scene's fields or a file, then single ones
/// over it.
pub(crate) fn scene(
    fields: Option<&Bound<'_, PyAny>>,
    gravity: Option<&Bound<'_, PyAny>>,
    wind: Option<&Bound<'_, PyAny>>,
    substeps: Option<u32>,
    economy: Option<&Bound<'_, PyAny>>,
    dynamics: bool,
) -> PyResult<Scene> {
    let mut scene = match fields {
        None => Scene::default(),
        Some(fields) => match fields.extract::<PathBuf>() {
            Ok(path) => scene_file(&path)?,
            Err(_) => Scene::from_json(&json_of("scene", fields)?).map_err(to_py)?,
        },
    };
    if let Some(gravity) = gravity {
        scene.gravity = arrays::vector("gravity", gravity)?.into();
    }
    if let Some(wind) = wind {
        scene.wind = arrays::vector("wind", wind)?.into();
    }
    if let Some(substeps) = substeps {
        scene.cloth.substeps = substeps;
    }
    if let Some(tolerance) = economy {
        scene.economy.tolerance = match tolerance.extract::<f64>() {
            Ok(mm) => Tolerance::Millimetres(mm),
            Err(_) => tolerance
                .extract::<String>()
                .map_err(|_| {
                    input("economy: expected millimetres, or a text such as '0.05 %' or 'off'")
                })?
                .parse()
                .map_err(|e: SceneError| input(format!("economy: {e}")))?,
        };
    }
    if !dynamics {
        scene.dynamics = Dynamics::None;
    }
    Ok(scene)
}

fn scene_file(path: &Path) -> PyResult<Scene> {
    Scene::load(path).map_err(|e| match e {
        SceneError::Read { .. } => to_py(e),
        _ => SceneFailure::new_err(format!("{}: {}", path.display(), to_py(e))),
    })
}

/// Reads a scene file (TOML) as a dictionary of all its fields, those that it leaves out as by
/// default. Files that a dictionary names are looked for in the working folder.
///
/// - `path`: the file; without one, the default scene
///
/// >>> scene = fabrig.read_scene()
/// >>> scene["gravity"]
/// [0.0, -9810.0, 0.0]
#[pyfunction]
#[pyo3(signature = (path=None))]
pub(crate) fn read_scene<'py>(
    py: Python<'py>,
    path: Option<PathBuf>,
) -> PyResult<Bound<'py, PyAny>> {
    let scene = match path {
        Some(path) => scene_file(&path)?,
        None => Scene::default(),
    };
    arrays::to_python(py, &scene)
}

/// The scene of the bundled contact story: a finger on the demo face's cheek, a ball on its
/// forehead, sticky lips; for `fabrig.demo_take(story="contact")`.
///
/// >>> [collider["name"] for collider in fabrig.demo_scene()["colliders"]]
/// ['finger', 'ball']
#[pyfunction]
pub(crate) fn demo_scene(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let mut scene = Scene::default();
    let colliders = read_colliders(template::demo_contact_colliders());
    scene.colliders = colliders.map_err(|e| to_py(SceneError::from(e)))?;
    scene.contact.pairs = PairMask::All;
    scene.contact.sticky_lips = Some(Stickiness::default());
    arrays::to_python(py, &scene)
}

/// A rig on its way through time.
///
/// - `rig`: what moves; `clip`: the take, at whose first frame it starts; neutral without one
/// - `scene`: a mapping of the fields of a scene file, such as {"contact": {"pairs": "all"},
///   "colliders": [...]}, or its path; the other arguments go before it. With "faces" in it, it
///   stands for rig and clip too, and time is the scene's
/// - `face`: name of one of those faces, where there are several
/// - `gravity`, `wind`: shape (3,), world axes, +Y up (mm/s^2, mm/s)
/// - `substeps`: of the cloth, per 1/60 s
/// - `economy`: by how much frames may differ from the full model, as the root mean square over
///   any patch (mm), or "0.05 %" of the face's height; "off" models everything
/// - `dynamics`: False leaves patches where the muscle shapes want them
///
/// >>> simulation = fabrig.Simulation(fabrig.rig(fabrig.demo_face()))
/// >>> for _ in range(3):
/// ...     report = simulation.step(1 / 60, weights={"jawOpen": 0.5})
/// >>> simulation.vertices.shape
/// (13082, 3)
#[pyclass(name = "Simulation", module = "fabrig")]
pub(crate) struct PySimulation {
    inner: Simulation,
    rig: Py<PyRig>,
}

#[pymethods]
impl PySimulation {
    #[new]
    #[pyo3(signature = (rig=None, clip=None, *, scene=None, face=None, gravity=None, wind=None,
                        substeps=None, economy=None, dynamics=true))]
    #[allow(clippy::too_many_arguments)] // Keyword-only in Python.
    fn new(
        py: Python<'_>,
        rig: Option<Py<PyRig>>,
        clip: Option<&PyClip>,
        scene: Option<&Bound<'_, PyAny>>,
        face: Option<&str>,
        gravity: Option<&Bound<'_, PyAny>>,
        wind: Option<&Bound<'_, PyAny>>,
        substeps: Option<u32>,
        economy: Option<&Bound<'_, PyAny>>,
        dynamics: bool,
    ) -> PyResult<Self> {
        let scene = self::scene(scene, gravity, wind, substeps, economy, dynamics)?;
        let Some(rig) = rig else {
            if clip.is_some() {
                return Err(input(
                    "clip: needs a rig; a scene's faces have takes of their own",
                ));
            }
            return Self::of_scene(py, &scene, face);
        };
        if face.is_some() {
            return Err(input(
                "face: is of the scene's own faces, but a rig was given",
            ));
        }
        let (shared, clip) = (Arc::clone(&rig.get().inner), clip.map(|c| c.inner.clone()));
        let inner = py
            .detach(|| Simulation::new(shared, scene, clip))
            .map_err(to_py)?;
        Ok(Self { inner, rig })
    }

    /// Goes on by `dt` seconds: along the clip, or to a pose that is given. Returns a report.
    ///
    /// - `weights`: name -> weight in [0, 1], in any spelling, or numbers of shape (S,) in the
    ///   order of `Rig.shape_names`; without them the clip goes on
    /// - `head`: from the head frame to the world (mm), a rigid motion of shape (4, 4)
    /// - `eyes`: yaw and pitch of the left eye and of the right (rad), shape (4,), for scenes
    ///   whose `eyes` are "tracked"
    /// - `wind`: velocity of the air in the world (mm/s), shape (3,)
    #[pyo3(signature = (dt, *, weights=None, head=None, eyes=None, wind=None))]
    #[allow(clippy::too_many_arguments)] // Keyword-only in Python.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        dt: f64,
        weights: Option<&Bound<'py, PyAny>>,
        head: Option<&Bound<'py, PyAny>>,
        eyes: Option<&Bound<'py, PyAny>>,
        wind: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let is_given = [weights, head, eyes, wind].iter().any(Option::is_some);
        let simulation = &mut self.inner;
        let report = if is_given {
            if !(dt.is_finite() && dt > 0.0) {
                return Err(input(format!(
                    "dt: {dt} is not a positive number of seconds"
                )));
            }
            let pose = pose(
                simulation,
                Given {
                    weights,
                    head,
                    eyes,
                    wind,
                },
                Some(dt),
            )?;
            py.detach(|| simulation.advance_to(pose, dt))
        } else {
            py.detach(|| simulation.advance(dt))
        };
        arrays::to_python(py, &report.map_err(to_py)?)
    }

    /// Puts the face into a pose at once: patches on their muscle shapes, at rest.
    ///
    /// - `weights`, `head`, `eyes`, `wind`: as for `step`; the neutral face without them
    #[pyo3(signature = (*, weights=None, head=None, eyes=None, wind=None))]
    fn reset(
        &mut self,
        py: Python<'_>,
        weights: Option<&Bound<'_, PyAny>>,
        head: Option<&Bound<'_, PyAny>>,
        eyes: Option<&Bound<'_, PyAny>>,
        wind: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let simulation = &mut self.inner;
        let pose = pose(
            simulation,
            Given {
                weights,
                head,
                eyes,
                wind,
            },
            None,
        )?;
        py.detach(|| simulation.reset(pose)).map_err(to_py)
    }

    /// Holds a pose until the face is still, or four seconds long.
    ///
    /// - `weights`, `head`, `eyes`, `wind`: as for `step`; the neutral face without them
    #[pyo3(signature = (*, weights=None, head=None, eyes=None, wind=None))]
    fn hold(
        &mut self,
        py: Python<'_>,
        weights: Option<&Bound<'_, PyAny>>,
        head: Option<&Bound<'_, PyAny>>,
        eyes: Option<&Bound<'_, PyAny>>,
        wind: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let simulation = &mut self.inner;
        let pose = pose(
            simulation,
            Given {
                weights,
                head,
                eyes,
                wind,
            },
            None,
        )?;
        py.detach(|| hold_pose(simulation, &pose)).map_err(to_py)
    }

    /// A picture of the face now: (size, size, 3) of bytes.
    ///
    /// - `view`, `size`, `zoom`, `patches`, `names`, `edges`: as for `Rig.render`
    #[pyo3(signature = (*, view="front", size=512, zoom="all", patches=false, names=false,
                        edges=false))]
    #[allow(clippy::too_many_arguments)] // Keyword-only in Python.
    fn render<'py>(
        &self,
        py: Python<'py>,
        view: &str,
        size: u32,
        zoom: &str,
        patches: bool,
        names: bool,
        edges: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let shot = Shot::new(view, size, edges)?.framed(zoom)?;
        draw_simulation(py, &self.inner, shot, Content { patches, names })
    }

    /// Whether anything passes through anything now, by a test that shares nothing with the
    /// solver: a mapping; None where nothing could touch.
    fn judge_contact<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let verdict = py.detach(|| self.inner.judge_contact());
        let verdict = verdict.map_err(|e| to_py(SceneError::from(e)))?;
        verdict.map(|v| arrays::to_python(py, &v)).transpose()
    }

    /// All fields of the scene, as `read_scene` gives them.
    #[getter]
    fn scene<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::to_python(py, self.inner.scene())
    }

    /// Distance of the nodes from their muscle shapes: (root mean square, largest). (mm)
    #[getter]
    fn settle_error(&self) -> (f64, f64) {
        self.inner.settle_error()
    }

    /// Puts `vertices` into an array of yours, and returns it: nothing is allocated.
    ///
    /// - `out`: 32- or 64-bit floats of shape (N, 3)
    fn vertices_into<'py>(&self, out: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        arrays::into_out(&out, &self.inner.skin_in_own_units())?;
        Ok(out)
    }

    /// Says where the collider called `name` is at the end of the next step, in place of its keys: `position`
    /// (mm) and `rotation`, an axis times an angle (rad), in the collider's own frame.
    #[pyo3(signature = (name, position, *, rotation=None))]
    fn set_collider(
        &mut self,
        name: &str,
        position: &Bound<'_, PyAny>,
        rotation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let colliders = &self.inner.scene().colliders;
        let Some(index) = colliders.iter().position(|c| c.name == name) else {
            let known: Vec<&str> = colliders.iter().map(|c| c.name.as_str()).collect();
            return Err(input(format!(
                "name: there is no collider {name:?}; there are: {}",
                known.join(", ")
            )));
        };
        let wide = |v: [f32; 3]| Vector3::from(v.map(f64::from));
        let position = wide(arrays::vector("position", position)?);
        let rotation = rotation
            .map(|r| arrays::vector("rotation", r))
            .transpose()?
            .map_or_else(Vector3::zeros, wide);
        let pose = Isometry3::new(position, rotation);
        self.inner
            .set_collider_pose(index, pose)
            .map_err(|e| to_py(SceneError::from(e)))
    }

    /// Force of the face on each collider at the end of the last step, by name: shape (3,), in
    /// newtons of a face whose patches weigh the cloth's areal density, in the head frame.
    #[getter]
    fn collider_forces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let forces = PyDict::new(py);
        let report = self.inner.contact_report();
        let values = report.map_or(&[][..], |report| &report.forces);
        for (collider, force) in self.inner.scene().colliders.iter().zip(values) {
            let force: Vec<f64> = force.iter().copied().collect();
            forces.set_item(&collider.name, force.into_pyarray(py))?;
        }
        Ok(forces)
    }

    /// What contact did in the last step, as a mapping; `None` where nothing could touch.
    #[getter]
    fn contact<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let report = self.inner.contact_report();
        report
            .map(|report| arrays::to_python(py, report))
            .transpose()
    }

    /// Places that touch [mm, head frame], shape (K, 3).
    #[getter]
    fn contact_points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f32>> {
        let points = self.inner.contact_points().iter();
        let points: Vec<_> = points.map(|point| point.position).collect();
        arrays::from_points_f32(py, &points)
    }

    /// Time on the clip's axis (s).
    #[getter]
    fn time(&self) -> f64 {
        self.inner.time()
    }

    /// The rig.
    #[getter]
    fn rig(&self, py: Python<'_>) -> Py<PyRig> {
        self.rig.clone_ref(py)
    }

    /// The user's mesh now, in its own units and vertex order, shape (N, 3).
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_points(py, &self.inner.skin_in_own_units())
    }

    /// The user's mesh now [mm, head frame], shape (N, 3).
    #[getter]
    fn skin<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f32>> {
        arrays::from_points_f32(py, self.inner.skin())
    }

    /// Nodes of a patch now [mm, head frame], shape (nodes, 3).
    fn patch<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let index = self.rig.get().patch_index(name)?;
        Ok(arrays::from_points_f32(
            py,
            self.inner.patch_positions(index),
        ))
    }

    /// Weights now, in the order of `Rig.shape_names`, shape (S,).
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        self.inner.pose().weights.clone().into_pyarray(py)
    }

    /// From the head frame to the world (mm), shape (4, 4).
    #[getter]
    fn head<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_matrix(py, &self.inner.head().to_homogeneous())
    }
}

impl PySimulation {
    /// One of a scene's own faces, at the scene's start.
    fn of_scene(py: Python<'_>, scene: &Scene, face: Option<&str>) -> PyResult<Self> {
        let names: Vec<String> = scene.faces.iter().map(|f| f.display_name()).collect();
        let known = names.join(", ");
        let index = match (face, names.len()) {
            (_, 0) => return Err(input("rig: needed, as the scene has no faces of its own")),
            (None, 1) => 0,
            (None, _) => return Err(input(format!("face: the scene has several: {known}"))),
            (Some(face), _) => names
                .iter()
                .position(|name| name == face)
                .ok_or_else(|| input(format!("face: '{face}' is not one of {known}")))?,
        };
        let mut only = scene.clone();
        only.faces = vec![scene.faces[index].clone()];
        // Rigging a mesh can be interrupted.
        let mut progress = Progress::new(py, None)?;
        let staged = py.detach(|| -> Result<_, fabrig_core::Error> {
            let faces = load_faces(&only, &ReadOptions::default(), &mut |step| {
                progress.report(step.stage, step.fraction)
            })?;
            let [face] = <[StagedFace; 1]>::try_from(faces)
                .map_err(|faces| SceneError::HasFaces { count: faces.len() })?;
            let rig = Arc::clone(&face.rig);
            let mut inner = Simulation::new(face.rig, face.scene, face.clip)?;
            inner.start_at(0.0)?;
            Ok((inner, rig))
        });
        progress.finish()?;
        let (inner, rig) = staged.map_err(to_py)?;
        let rig = Py::new(py, PyRig { inner: rig })?;
        Ok(Self { inner, rig })
    }
}

/// What of a pose a caller gave.
struct Given<'a, 'py> {
    weights: Option<&'a Bound<'py, PyAny>>,
    head: Option<&'a Bound<'py, PyAny>>,
    eyes: Option<&'a Bound<'py, PyAny>>,
    wind: Option<&'a Bound<'py, PyAny>>,
}

/// The pose that is given, reached from the present one in `dt`, or at rest.
fn pose(simulation: &mut Simulation, given: Given<'_, '_>, dt: Option<f64>) -> PyResult<FacePose> {
    let at = simulation.time() + dt.unwrap_or(0.0);
    let of_scene = match simulation.scene().head_motion {
        HeadDrive::Keyed(_) => Some(simulation.pose_at(at)),
        HeadDrive::Take(_) => None,
    };
    let now = simulation.pose();
    let mut pose = FacePose::neutral(now.weights.len());
    if let Some(weights) = given.weights {
        pose.weights = weights_of("weights", weights, &simulation.rig().shape_names)?;
    }
    if let Some(dt) = dt {
        let change = pose.weights.iter().zip(&now.weights);
        pose.rates = change
            .map(|(&to, &from)| (f64::from(to - from) / dt) as f32)
            .collect();
    }
    if let Some(head) = given.head {
        pose.head = arrays::rigid("head", head)?;
    }
    if let Some(eyes) = given.eyes {
        let angles = arrays::numbers("eyes", eyes)?;
        let &[left_yaw, left_pitch, right_yaw, right_pitch] = &angles[..] else {
            return Err(input(format!(
                "eyes: expected shape (4,), got ({},)",
                angles.len()
            )));
        };
        if angles.iter().any(|a| !a.is_finite()) {
            return Err(input("eyes: expected finite angles"));
        }
        pose.eyes = Some([
            EyeAngles {
                yaw: left_yaw,
                pitch: left_pitch,
            },
            EyeAngles {
                yaw: right_yaw,
                pitch: right_pitch,
            },
        ]);
    }
    pose.wind = simulation.air(&pose.head, at);
    if let (Some(keyed), None) = (of_scene, given.head) {
        pose.head = keyed.head;
        pose.head_motion = keyed.head_motion;
        pose.wind = keyed.wind;
    }
    if let Some(wind) = given.wind {
        pose.wind = Vector3::from(arrays::vector("wind", wind)?).cast();
    }
    Ok(pose)
}
