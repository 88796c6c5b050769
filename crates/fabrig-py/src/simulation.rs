//! Stepping a rig.

use std::sync::Arc;

use fabrig_core::scene::{Dynamics, FacePose, Scene, Simulation};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::motion::PyClip;
use crate::rig::PyRig;

/// A scene from keyword arguments.
pub(crate) fn scene(
    gravity: Option<&Bound<'_, PyAny>>,
    wind: Option<&Bound<'_, PyAny>>,
    substeps: Option<u32>,
    dynamics: bool,
) -> PyResult<Scene> {
    let mut scene = Scene::default();
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
    #[new]
    #[pyo3(signature = (rig, clip=None, *, gravity=None, wind=None, substeps=None, dynamics=true))]
    fn new(
        py: Python<'_>,
        rig: Py<PyRig>,
        clip: Option<&PyClip>,
        gravity: Option<&Bound<'_, PyAny>>,
        wind: Option<&Bound<'_, PyAny>>,
        substeps: Option<u32>,
        dynamics: bool,
    ) -> PyResult<Self> {
        let scene = scene(gravity, wind, substeps, dynamics)?;
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
