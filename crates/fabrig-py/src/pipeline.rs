//! The whole line in two calls.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use fabrig_core::Point;
use fabrig_core::facs::{ARKIT_SHAPES, ShapeMatch, match_shape, nearest_name};
use fabrig_core::mesh::Mesh;
use fabrig_core::pipeline::{AnimateOptions, RigFaceOptions, rig_face};
use fabrig_core::rig::Expression;
use fabrig_core::template;
use fabrig_core::transfer::{AlphaMode, OffsetMode};
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::mesh::PyMesh;
use crate::motion::PyClip;
use crate::progress::Progress;
use crate::rig::PyRig;
use crate::simulation::scene;
use crate::template::template_of;

/// Makes the rig of a neutral face.
///
/// - `vertices`: shape (N, 3), any unit; `faces`: integer array of shape (F, corners), or lists;
///   or a `Mesh` alone, which keeps its texture coordinates and groups, and one that was
///   read from a file its materials and pictures
/// - `landmarks`: name -> (x, y, z) in the mesh's own units
/// - `unit_mm`: millimetres per unit, where it is known
/// - `cut_seams`: of "mouth" and "eyes" those to cut apart where they are one fused surface; new
///   vertices follow those given
/// - `expressions`: shape -> vertices (N, 3) of this very face, in ARKit's names, to fit the
///   muscles to; `alpha` says how: one amplitude a "patch", or a patch and "shape", a linear
///   "map", or their "own" shapes as they are
/// - `offsets`: how the template's displacements are put on the face, "global", "frame" or
///   "transfer" (deformation transfer)
/// - `template`: folder of a template of your own, as `fabrig template build` makes it
/// - `progress`: called with (stage, share)
#[pyfunction]
#[pyo3(signature = (
    vertices, faces=None, *, landmarks=None, unit_mm=None, cut_seams=None, expressions=None,
    alpha="own", offsets="global", template=None, progress=None
))]
#[allow(clippy::too_many_arguments)] // Keyword-only in Python.
pub(crate) fn rig(
    py: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    faces: Option<&Bound<'_, PyAny>>,
    landmarks: Option<BTreeMap<String, [f64; 3]>>,
    unit_mm: Option<f64>,
    cut_seams: Option<Vec<String>>,
    expressions: Option<BTreeMap<String, Bound<'_, PyAny>>>,
    alpha: &str,
    offsets: &str,
    template: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyRig> {
    let mut options = RigFaceOptions::default();
    let face = match (vertices.cast::<PyMesh>(), faces) {
        (Ok(mesh), None) => {
            options.source.clone_from(&mesh.get().source);
            mesh.get().inner.clone()
        }
        (Ok(_), Some(_)) => return Err(input("faces: the mesh given has its own")),
        (Err(_), None) => return Err(input("faces: needed beside an array of vertices")),
        (Err(_), Some(faces)) => {
            let positions = arrays::points("vertices", vertices)?;
            let polygons = arrays::polygons("faces", faces)?;
            Mesh::new(positions, polygons).map_err(to_py)?
        }
    };
    options.registration.unit_mm = unit_mm;
    for name in cut_seams.unwrap_or_default() {
        match name.as_str() {
            "mouth" => options.cut_seams.mouth = true,
            "eyes" => options.cut_seams.eyes = true,
            other => {
                return Err(input(format!(
                    "cut_seams: expected 'mouth' or 'eyes', got '{other}'"
                )));
            }
        }
    }
    options.registration.landmarks = landmarks
        .unwrap_or_default()
        .into_iter()
        .map(|(name, place)| (name, Point::from(place)))
        .collect();
    options.rig.alpha = one_of("alpha", alpha, &ALPHA_MODES)?;
    options.rig.offsets = one_of("offsets", offsets, &OFFSET_MODES)?;
    for (name, vertices) in expressions.unwrap_or_default() {
        options.expressions.push(expression(name, &vertices)?);
    }
    let template = template_of(template)?;
    let mut progress = Progress::new(progress);
    let rigged = py.detach(|| {
        rig_face(&face, &template, &options, &mut |step| {
            progress.report(step.stage, step.fraction)
        })
    });
    // What the callback raised is the reason, not the cancellation that followed.
    progress.finish()?;
    Ok(PyRig {
        inner: Arc::new(rigged.map_err(to_py)?.rig),
    })
}

const ALPHA_MODES: [(&str, AlphaMode); 4] = [
    ("patch", AlphaMode::Patch),
    ("shape", AlphaMode::PatchAndShape),
    ("map", AlphaMode::Map),
    ("own", AlphaMode::Own),
];

const OFFSET_MODES: [(&str, OffsetMode); 3] = [
    ("global", OffsetMode::Global),
    ("frame", OffsetMode::Frame),
    ("transfer", OffsetMode::DeformationTransfer),
];

/// The value that a name stands for.
pub(crate) fn one_of<T: Copy>(argument: &str, name: &str, known: &[(&str, T)]) -> PyResult<T> {
    known
        .iter()
        .find(|(other, _)| *other == name)
        .map(|(_, value)| *value)
        .ok_or_else(|| {
            let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
            input(format!(
                "{argument}: '{name}' is not one of {}",
                names.join(", ")
            ))
        })
}

/// One of the face's own shapes, by its name.
fn expression(name: String, vertices: &Bound<'_, PyAny>) -> PyResult<Expression> {
    let shapes = &template::human().shapes;
    let mut weights = vec![0.0; shapes.len()];
    let names = match_shape(&name).map_or_else(Vec::new, ShapeMatch::names);
    for (shape, weight) in shapes.iter().zip(&mut weights) {
        if names.contains(&shape.name.as_str()) {
            *weight = 1.0;
        }
    }
    if names.is_empty() {
        let nearest = nearest_name(&name, ARKIT_SHAPES).unwrap_or_default();
        return Err(input(format!(
            "expressions: '{name}' is no shape of ARKit (nearest: '{nearest}')"
        )));
    }
    Ok(Expression {
        positions: arrays::points(&format!("expressions['{name}']"), vertices)?,
        name,
        weights,
    })
}

/// Simulates a rig through a take and records it to an MCAP file; returns a report.
///
/// - `scene`: a mapping of the fields of a scene file; the other arguments go before it
/// - `fps`: frames a second; the take's own by default
/// - `gravity` (mm/s^2) and `wind` (mm/s): three numbers, world axes, +Y up
/// - `progress`: called with ("simulate", share); raising or Ctrl-C ends the recording there,
///   whole and readable
#[pyfunction]
#[pyo3(signature = (rig, clip, output, *, scene=None, fps=None, gravity=None, wind=None, substeps=None,
                    dynamics=true, progress=None))]
#[allow(clippy::too_many_arguments)] // Keyword-only in Python.
pub(crate) fn animate<'py>(
    py: Python<'py>,
    rig: &PyRig,
    clip: &PyClip,
    output: PathBuf,
    scene: Option<Bound<'py, PyAny>>,
    fps: Option<f64>,
    gravity: Option<Bound<'py, PyAny>>,
    wind: Option<Bound<'py, PyAny>>,
    substeps: Option<u32>,
    dynamics: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    if let Some(fps) = fps
        && !(fps.is_finite() && fps > 0.0)
    {
        return Err(input(format!("fps: {fps} is not a frame rate")));
    }
    let scene = self::scene(
        scene.as_ref(),
        gravity.as_ref(),
        wind.as_ref(),
        substeps,
        dynamics,
    )?;
    let options = AnimateOptions {
        fps,
        ..AnimateOptions::default()
    };
    let mut progress = Progress::new(progress);
    let (rig, clip) = (Arc::clone(&rig.inner), clip.inner.clone());
    let report = py.detach(|| {
        fabrig_core::pipeline::animate(rig, clip, scene, &output, &options, &mut |now| {
            progress.report("simulate", now.frame as f64 / now.frame_count as f64)
        })
    });
    progress.finish()?;
    arrays::to_python(py, &report.map_err(to_py)?)
}
