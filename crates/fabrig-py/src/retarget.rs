//! Takes from how a face moves.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use fabrig_core::Point;
use fabrig_core::facs::{ActionUnitTable, nearest_name};
use fabrig_core::motion::MarkerTake;
use fabrig_core::retarget::{
    Controls, FitOptions, MarkerOptions, MeshMotion, MeshMotionError, ResponseModel, Retargeted,
    SiteMotion, bind_markers, fit_sites, mesh_sites,
};
use fabrig_core::rig::Rig;
use fabrig_core::template;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{RetargetError, input, to_py};
use crate::motion::PyClip;
use crate::progress::interruptible;
use crate::rig::PyRig;

/// Where points of a face are, frame by frame.
enum Source {
    Markers(MarkerTake),
    Mesh(MeshMotion),
}

/// Why there is no source, or no fit.
enum Failure {
    Core(Box<fabrig_core::Error>),
    Mesh(MeshMotionError),
}

impl<E: Into<fabrig_core::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Core(Box::new(error.into()))
    }
}

impl Failure {
    fn into_py(self) -> PyErr {
        match self {
            Self::Core(error) => to_py(*error),
            Self::Mesh(error) => RetargetError::new_err(error.to_string()),
        }
    }
}

fn read_source(path: &Path, fps: f64) -> Result<Source, Failure> {
    let is_npy = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("npy"));
    if path.is_dir() || is_npy {
        let motion = MeshMotion::read(path, fps).map_err(Failure::Mesh)?;
        return Ok(Source::Mesh(motion));
    }
    Ok(Source::Markers(MarkerTake::read(path)?))
}

/// A source from an array (F, N, 3): of the rig's own vertices, or of named markers.
fn array_source(
    value: &Bound<'_, PyAny>,
    rig: &Rig,
    fps: f64,
    markers: Option<Vec<String>>,
) -> PyResult<Source> {
    if !(fps.is_finite() && fps > 0.0) {
        return Err(input(format!("fps: {fps} is not a frame rate")));
    }
    let frames = arrays::frames("source", value)?;
    let times = (0..frames.len()).map(|i| i as f64 / fps).collect();
    let count = frames.first().map_or(0, Vec::len);
    let Some(names) = markers else {
        let expected = rig.face.vertex_count();
        if count != expected {
            return Err(input(format!(
                "source: expected shape (F, {expected}, 3), the rig's own vertices, got ({}, \
                 {count}, 3); of markers give their names too",
                frames.len()
            )));
        }
        return Ok(Source::Mesh(MeshMotion { times, frames }));
    };
    if names.len() != count {
        return Err(input(format!(
            "markers: expected {count} names, got {}",
            names.len()
        )));
    }
    // What is not seen is NaN.
    let seen = |p: &Point| p.iter().all(|x| x.is_finite()).then_some(*p);
    let positions = frames.iter().flatten().map(seen).collect();
    Ok(Source::Markers(MarkerTake {
        names,
        times,
        positions,
    }))
}

/// Where markers are at rest [mm, head frame]: at landmarks of the template, by name.
fn places_of(places: BTreeMap<String, String>, rig: &Rig) -> PyResult<BTreeMap<String, Point>> {
    let template = template::human();
    let each = places.into_iter().map(|(marker, landmark)| {
        let vertex = template.landmarks.get(&landmark).ok_or_else(|| {
            let known = template.landmarks.keys().map(String::as_str);
            let nearest = nearest_name(&landmark, known).unwrap_or_default();
            input(format!(
                "places: there is no landmark '{landmark}' (nearest: '{nearest}')"
            ))
        })?;
        let place = rig.positions.get(*vertex as usize).copied();
        let place = place.ok_or_else(|| input("places: the rig was made with another template"))?;
        Ok((marker, place))
    });
    each.collect()
}

/// What is fitted how.
struct Job {
    rig: Arc<Rig>,
    units: Option<Vec<u32>>,
    neutral: [f64; 2],
    places: BTreeMap<String, Point>,
    has_head_motion: bool,
    noise: Option<f64>,
}

fn fit(source: Source, job: Job) -> Result<(Retargeted, Vec<String>), Failure> {
    let controls = match &job.units {
        None => Controls::shapes(&job.rig),
        Some(units) => Controls::units(&job.rig, &ActionUnitTable::bundled()?, units)?,
    };
    let names = controls.names().to_vec();
    let options = |defaults: FitOptions| FitOptions {
        noise: job.noise.unwrap_or(defaults.noise),
        ..defaults
    };
    let has_head_motion = job.has_head_motion;
    let fitted = match source {
        Source::Mesh(mesh) => {
            let sites = mesh_sites(&job.rig);
            let mut model = ResponseModel::new(job.rig, controls, sites)?;
            let motion = SiteMotion {
                positions: mesh.at_sites(&model)?,
                neutral: model.rest(),
                times: mesh.times,
                has_head_motion,
            };
            fit_sites(&mut model, &motion, &options(FitOptions::default()))?
        }
        Source::Markers(take) => {
            let placed = MarkerOptions {
                neutral: job.neutral,
                places: job.places,
            };
            let bound = bind_markers(&take, &job.rig, &placed)?;
            let mut model = ResponseModel::new(job.rig, controls, bound.sites)?;
            let motion = SiteMotion {
                times: take.times,
                neutral: bound.neutral,
                positions: bound.positions,
                has_head_motion,
            };
            fit_sites(&mut model, &motion, &options(FitOptions::markers()))?
        }
    };
    Ok((fitted, names))
}

/// Fits the shapes of a rig to how a face moves; returns the take and a report, with `values`
/// (F, controls) and `controls`, their names.
///
/// - `source`: markers as C3D or TRC; a folder of OBJ files or a .npy of the rig's own mesh in
///   motion; or an array (F, N, 3) of that mesh's vertices in its own units, or of markers
/// - `rig`: of the face that the source shows
/// - `markers`: names of the N markers of an array (mm), whose rows are NaN where not seen
/// - `fps`: frames per second of a mesh or an array
/// - `units`: numbers of FACS action units to fit, instead of the shapes one by one
/// - `neutral`: when the markers' face is neutral, (from, to) in seconds; the first 0.2 s by
///   default
/// - `places`: marker -> name of the landmark that it stands at, three or more
/// - `still_head`: the source is without head motion
/// - `noise`: of the source's coordinates (mm): more is smoother; 0.5 for markers and 0.01 for a
///   mesh by default
///
/// >>> rig = fabrig.rig(fabrig.demo_face())
/// >>> frames = [rig.mesh.vertices] * 2
/// >>> take, report = fabrig.retarget(frames, rig, units=[12, 26], still_head=True)
/// >>> report["residual_rms"] < 0.01
/// True
#[pyfunction]
#[pyo3(signature = (source, rig, *, markers=None, fps=30.0, units=None, neutral=None,
                    places=None, still_head=false, noise=None))]
#[allow(clippy::too_many_arguments)] // Keyword-only in Python.
pub(crate) fn retarget<'py>(
    py: Python<'py>,
    source: &Bound<'py, PyAny>,
    rig: &PyRig,
    markers: Option<Vec<String>>,
    fps: f64,
    units: Option<Vec<u32>>,
    neutral: Option<(f64, f64)>,
    places: Option<BTreeMap<String, String>>,
    still_head: bool,
    noise: Option<f64>,
) -> PyResult<(PyClip, Bound<'py, PyAny>)> {
    let job = Job {
        rig: Arc::clone(&rig.inner),
        units,
        neutral: neutral.map_or(MarkerOptions::default().neutral, |(from, to)| [from, to]),
        places: places_of(places.unwrap_or_default(), &rig.inner)?,
        has_head_motion: !still_head,
        noise,
    };
    let given = match source.extract::<PathBuf>() {
        Ok(path) => Err(path),
        Err(_) => Ok(array_source(source, &rig.inner, fps, markers)?),
    };
    let (fitted, names) = interruptible(py, move || {
        let source = match given {
            Ok(source) => source,
            Err(path) => read_source(&path, fps)?,
        };
        fit(source, job)
    })?
    .map_err(Failure::into_py)?;
    let report = arrays::to_python(py, &fitted.report)?;
    let values: Bound<'py, PyArray2<f64>> = arrays::from_rows(py, names.len(), &fitted.values);
    report.set_item("values", values)?;
    report.set_item("controls", names)?;
    Ok((PyClip { inner: fitted.clip }, report))
}
