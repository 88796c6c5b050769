//! Registration: a face in the template's topology.

use std::collections::BTreeMap;
use std::path::PathBuf;

use fabrig_core::Point;
use fabrig_core::registration::{
    LandmarkOrder, Registration, RegistrationOptions, parse_landmarks, read_landmarks, register,
};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::mesh::PyMesh;
use crate::pipeline::one_of;
use crate::progress::Progress;
use crate::template::template_of;

const UNITS: [(&str, f64); 4] = [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4)];

const ORDERS: [(&str, LandmarkOrder); 2] = [
    ("ibug68", LandmarkOrder::Ibug68),
    ("mediapipe", LandmarkOrder::MediaPipe),
];

/// What registration goes by.
pub(crate) fn registration_options(
    landmarks: Option<&Bound<'_, PyAny>>,
    landmarks_order: Option<&str>,
    unit: Option<&Bound<'_, PyAny>>,
    min_confidence: Option<f64>,
) -> PyResult<RegistrationOptions> {
    let mut options = RegistrationOptions::default();
    let order = landmarks_order
        .map(|name| one_of("landmarks_order", name, &ORDERS))
        .transpose()?;
    if let Some(landmarks) = landmarks {
        options.landmarks = landmark_places(landmarks, order)?;
    }
    options.unit_mm = unit.map(millimetres).transpose()?;
    options.min_confidence = min_confidence.unwrap_or(options.min_confidence);
    Ok(options)
}

/// Landmarks from a mapping, a file, or a detector's points.
fn landmark_places(
    value: &Bound<'_, PyAny>,
    order: Option<LandmarkOrder>,
) -> PyResult<BTreeMap<String, Point>> {
    if let Ok(named) = value.extract::<BTreeMap<String, [f64; 3]>>() {
        let named = named.into_iter();
        return Ok(named.map(|(name, at)| (name, Point::from(at))).collect());
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return read_landmarks(path, order).map_err(to_py);
    }
    let points = arrays::points("landmarks", value)?;
    let rows: Vec<[f64; 3]> = points.iter().map(|p| [p.x, p.y, p.z]).collect();
    let text = serde_json::to_string(&rows).map_err(|e| input(e.to_string()))?;
    parse_landmarks(&text, "landmarks.json".as_ref(), order).map_err(to_py)
}

/// Millimetres of a unit by its name or length.
fn millimetres(unit: &Bound<'_, PyAny>) -> PyResult<f64> {
    if let Ok(name) = unit.extract::<String>() {
        return one_of("unit", &name, &UNITS);
    }
    let length: f64 = unit
        .extract()
        .map_err(|_| input("unit: expected mm, cm, m, in, or millimetres per unit"))?;
    if length.is_finite() && length > 0.0 {
        Ok(length)
    } else {
        Err(input(format!("unit: {length} is no length")))
    }
}

/// A face in the template's topology, at true head size.
///
/// >>> registered = fabrig.register(fabrig.demo_face())
/// >>> registered.report["template_to_face"]["median"] < 0.2
/// True
#[pyclass(frozen, name = "Registration", module = "fabrig")]
pub(crate) struct PyRegistration {
    inner: Registration,
    mesh: Py<PyMesh>,
}

#[pymethods]
impl PyRegistration {
    /// The face in the template's topology [mm, head frame].
    #[getter]
    fn mesh(&self, py: Python<'_>) -> Py<PyMesh> {
        self.mesh.clone_ref(py)
    }

    /// What was measured: distances, confidence, coverage, openings, times, warnings.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::to_python(py, &self.inner.report)
    }

    /// From the given mesh to the head frame: a matrix [mm per unit], shape (4, 4).
    #[getter]
    fn to_head<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_matrix(py, &self.inner.to_head.to_homogeneous())
    }

    /// Distance of each vertex of the given mesh from the registered template (mm), shape (N,);
    /// NaN for pieces that are no skin.
    #[getter]
    fn distances<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let is_part = self.inner.part_mask();
        let places = self.inner.face_points.iter().zip(is_part);
        let distances = places.map(
            |(place, is_part)| {
                if is_part { f64::NAN } else { place.distance }
            },
        );
        PyArray1::from_vec(py, distances.collect())
    }

    /// Whether each vertex of the given mesh is of an eyeball, a row of teeth or the tongue,
    /// shape (N,).
    #[getter]
    fn is_part<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_vec(py, self.inner.part_mask())
    }

    fn __repr__(&self) -> String {
        let report = &self.inner.report;
        format!(
            "Registration(median {:.2} mm, 95 % {:.2} mm, confidence {:.2})",
            report.template_to_face.median, report.template_to_face.p95, report.confidence
        )
    }
}

/// Registers a neutral face to the template: the first half of `fabrig.rig`.
///
/// - `mesh`: whatever `Mesh.of` takes
/// - `landmarks`: name -> (x, y, z) in the mesh's own units; or 68 points in iBUG's order, 468 or
///   478 in MediaPipe's, shape (K, 3); or a file of either
/// - `landmarks_order`: "ibug68" or "mediapipe"; by the count of points without it
/// - `unit`: "mm", "cm", "m", "in", or millimetres per unit, where it is known
/// - `min_confidence`: margin below which an alignment is refused, 0 to 1
/// - `template`: a `Template`, or the folder of one
/// - `progress`: True for a bar, or a function of (stage, share)
///
/// >>> fabrig.register(fabrig.demo_face()).mesh
/// Mesh(4242 vertices, 4220 faces)
#[pyfunction(name = "register")]
#[pyo3(signature = (mesh, *, landmarks=None, landmarks_order=None, unit=None, min_confidence=None,
                    template=None, progress=None))]
#[allow(clippy::too_many_arguments)] // Keyword-only in Python.
pub(crate) fn register_face(
    py: Python<'_>,
    mesh: &Bound<'_, PyAny>,
    landmarks: Option<&Bound<'_, PyAny>>,
    landmarks_order: Option<&str>,
    unit: Option<&Bound<'_, PyAny>>,
    min_confidence: Option<f64>,
    template: Option<&Bound<'_, PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyRegistration> {
    let face = PyMesh::of(mesh)?;
    let face = &face.get().inner;
    let options = registration_options(landmarks, landmarks_order, unit, min_confidence)?;
    let template = template_of(template)?;
    let mut progress = Progress::new(py, progress)?;
    let registered = py.detach(|| {
        register(face, &template, &options, &mut |step| {
            progress.report(step.stage, step.fraction)
        })
    });
    progress.finish()?;
    let inner = registered.map_err(to_py)?;
    let normalized = template.skin.with_positions(inner.positions.clone());
    let mesh = Py::new(py, PyMesh::from(normalized.map_err(to_py)?))?;
    Ok(PyRegistration { inner, mesh })
}
