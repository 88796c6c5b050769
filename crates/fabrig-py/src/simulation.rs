//! Stepping a rig.

use std::sync::Arc;

use fabrig_core::scene::{Dynamics, FacePose, Scene, SceneError, Simulation};
use nalgebra::{Isometry3, Vector3};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::motion::PyClip;
use crate::rig::PyRig;

/// A scene from keyword arguments: a mapping of a scene's fields, then single ones over it.
pub(crate) fn scene(
    fields: Option<&Bound<'_, PyAny>>,
    gravity: Option<&Bound<'_, PyAny>>,
    wind: Option<&Bound<'_, PyAny>>,
    substeps: Option<u32>,
    dynamics: bool,
) -> PyResult<Scene> {
    let mut scene = match fields {
        None => Scene::default(),
        Some(fields) => {
            let text: String = fields
                .py()
                .import("json")?
                .call_method1("dumps", (fields,))
                .map_err(|e| input(format!("scene: not made of plain values: {e}")))?
                .extract()?;
            Scene::from_json(&text).map_err(to_py)?
        }
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
    if !dynamics {
        scene.dynamics = Dynamics::None;
    }
    Ok(scene)
}

/// A rig on its way through time.
#[pyclass(name = "Simulation", module = "fabrig")]
pub(crate) struct PySimulation {
    inner: Simulation,
    rig: Py<PyRig>,
}

#[pymethods]
impl PySimulation {
    /// Puts a rig into a scene, at the first frame of a clip, or neutral without one.
    ///
    /// `scene` is a mapping of the fields of a scene file: `{"contact": {"pairs": "all"},
    /// "colliders": [...]}`; the other arguments go before it.
    #[new]
    #[pyo3(signature = (rig, clip=None, *, scene=None, gravity=None, wind=None, substeps=None,
                        dynamics=true))]
    #[allow(clippy::too_many_arguments)] // Keyword-only in Python.
    fn new(
        py: Python<'_>,
        rig: Py<PyRig>,
        clip: Option<&PyClip>,
        scene: Option<&Bound<'_, PyAny>>,
        gravity: Option<&Bound<'_, PyAny>>,
        wind: Option<&Bound<'_, PyAny>>,
        substeps: Option<u32>,
        dynamics: bool,
    ) -> PyResult<Self> {
        let scene = self::scene(scene, gravity, wind, substeps, dynamics)?;
        let (shared, clip) = (Arc::clone(&rig.get().inner), clip.map(|c| c.inner.clone()));
        let inner = py
            .detach(|| Simulation::new(shared, scene, clip))
            .map_err(to_py)?;
        Ok(Self { inner, rig })
    }

    /// Goes on by `dt` seconds: along the clip, or to weights of shape (S,) in the order of
    /// `Rig.shape_names`. Returns a report.
    #[pyo3(signature = (dt, *, weights=None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        dt: f64,
        weights: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let simulation = &mut self.inner;
        let report = match weights {
            None => py.detach(|| simulation.advance(dt)),
            Some(weights) => {
                if !(dt.is_finite() && dt > 0.0) {
                    return Err(input(format!(
                        "dt: {dt} is not a positive number of seconds"
                    )));
                }
                let pose = pose(simulation, weights, dt)?;
                py.detach(|| simulation.advance_to(pose, dt))
            }
        };
        arrays::to_python(py, &report.map_err(to_py)?)
    }

    /// Says where a collider is at the end of the next step, in place of its keys: `position`
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
        let matrix = self.inner.head().to_homogeneous();
        Array2::from_shape_fn((4, 4), |(row, column)| matrix[(row, column)]).into_pyarray(py)
    }
}

/// The pose with these weights, reached from the present one in `dt`.
fn pose(simulation: &Simulation, weights: &Bound<'_, PyAny>, dt: f64) -> PyResult<FacePose> {
    let values = arrays::numbers("weights", weights)?;
    let now = &simulation.pose().weights;
    if values.len() != now.len() {
        return Err(input(format!(
            "weights: expected shape ({},), got ({},)",
            now.len(),
            values.len()
        )));
    }
    if let Some(index) = values.iter().position(|w| !(0.0..=1.0).contains(w)) {
        return Err(input(format!(
            "weights: {} at index {index} is outside [0, 1]",
            values[index]
        )));
    }
    let mut pose = FacePose::neutral(now.len());
    for (shape, &value) in values.iter().enumerate() {
        pose.weights[shape] = value as f32;
        pose.rates[shape] = ((value - f64::from(now[shape])) / dt) as f32;
    }
    Ok(pose)
}
