//! The whole line in two calls.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use fabrig_core::atomic_file::write_atomically;
use fabrig_core::facs::{ARKIT_SHAPES, ShapeMatch, match_shape, nearest_name};
use fabrig_core::mesh::Mesh;
use fabrig_core::motion::ReadOptions;
use fabrig_core::pipeline::{
    AnimateOptions, ExpressionScan, OwnShapes, PatchDetail, RigFaceOptions, load_faces,
    read_own_shapes, rig_face,
};
use fabrig_core::recording::RecordedKind;
use fabrig_core::rig::{Expression, SkinRefinement};
use fabrig_core::scene::RecordingChoice;
use fabrig_core::template::Template;
use fabrig_core::transfer::{AlphaMode, JawMode, OffsetMode};
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::mesh::PyMesh;
use crate::motion::PyClip;
use crate::progress::Progress;
use crate::registration::registration_options;
use crate::rig::PyRig;
use crate::simulation::scene;
use crate::template::template_of;

/// Makes the rig of a neutral face.
///
/// - `vertices`: shape (N, 3), any unit; `faces`: integer array of shape (F, corners), or lists;
///   or one argument that `Mesh.of` takes: a `Mesh`, the path of a file, a mesh of trimesh, ...
///   One that was read from a file keeps its materials and pictures
/// - `landmarks`: name -> (x, y, z) in the mesh's own units; or 68 points in iBUG's order, 468 or
///   478 in MediaPipe's, shape (K, 3); or a file of either
/// - `landmarks_order`: "ibug68" or "mediapipe"; by the count of points without it
/// - `unit`: "mm", "cm", "m", "in", or millimetres per unit, where it is known
/// - `min_confidence`: margin below which an automatic alignment is refused, 0 to 1
/// - `cut_seams`: of "mouth" and "eyes" those to cut apart where they are one fused surface; new
///   vertices follow those given
/// - `expressions`: shape -> vertices (N, 3) of this very face, in ARKit's names, to fit the
///   muscles to; a `Mesh` of its own instead of vertices is a scan, which is registered; or the
///   folder or glTF file that has them
/// - `alpha`: what is made of them: one amplitude a "patch", or a patch and "shape", a linear
///   "map", or their "own" shapes as they are
/// - `offsets`: how the template's displacements are put on the face, "global", "frame" or
///   "transfer" (deformation transfer)
/// - `jaw`: how it opens, about its "hinge" or on a "linear" way, as in the paper
/// - `resolution`: of the patches: "coarse" 2,010 nodes, "standard" 19,380, "fine" 50,080,
///   "finest" 200,320; or the fewest that are within an accuracy such as "0.3mm" of the finest, or
///   within half a pixel of it where the face is so high in the picture, such as "900px"; all but
///   the standard one fit the skin's weights anew, which takes a while
/// - `refine_skin`: the mesh is parted over forehead and eyes until its edges are no longer than
///   this, in millimetres, so that it can hold wrinkles; new vertices follow those given
/// - `template`: a `Template`, or the folder of one, instead of the bundled one
/// - `progress`: True for a bar, or a function of (stage, share)
///
/// >>> face = fabrig.demo_face()
/// >>> fabrig.rig(face.vertices, face.faces)
/// Rig(13082 vertices, 44 patches, 19380 nodes)
#[pyfunction]
#[pyo3(signature = (
    vertices, faces=None, *, landmarks=None, landmarks_order=None, unit=None, min_confidence=None,
    cut_seams=None, expressions=None, alpha="own", offsets="global", jaw="hinge",
    resolution="standard", refine_skin=None, template=None, progress=None
))]
#[allow(clippy::too_many_arguments)] // Keyword-only in Python.
pub(crate) fn rig(
    py: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    faces: Option<&Bound<'_, PyAny>>,
    landmarks: Option<&Bound<'_, PyAny>>,
    landmarks_order: Option<&str>,
    unit: Option<&Bound<'_, PyAny>>,
    min_confidence: Option<f64>,
    cut_seams: Option<Vec<String>>,
    expressions: Option<&Bound<'_, PyAny>>,
    alpha: &str,
    offsets: &str,
    jaw: &str,
    resolution: &str,
    refine_skin: Option<f64>,
    template: Option<&Bound<'_, PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyRig> {
    let mut source = None;
    let face = match faces {
        None if vertices.hasattr("dtype")? => {
            return Err(input("faces: needed beside an array of vertices"));
        }
        None => {
            let mesh = PyMesh::of(vertices)?;
            source.clone_from(&mesh.get().source);
            mesh.get().inner.clone()
        }
        Some(_) if vertices.is_instance_of::<PyMesh>() => {
            return Err(input("faces: the mesh given has its own"));
        }
        Some(faces) => {
            let positions = arrays::points("vertices", vertices)?;
            let polygons = arrays::polygons("faces", faces)?;
            Mesh::new(positions, polygons).map_err(to_py)?
        }
    };
    let mut options = RigFaceOptions {
        source,
        registration: registration_options(landmarks, landmarks_order, unit, min_confidence)?,
        ..RigFaceOptions::default()
    };
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
    options.rig.alpha = one_of("alpha", alpha, &ALPHA_MODES)?;
    options.rig.offsets = one_of("offsets", offsets, &OFFSET_MODES)?;
    options.rig.jaw_mode = one_of("jaw", jaw, &JAW_MODES)?;
    let detail = resolution
        .parse::<PatchDetail>()
        .map_err(|error| input(format!("resolution: {error}")))?;
    options.rig.resolution = detail.resolution();
    options.refinement = refine_skin.map(SkinRefinement::to);
    let template = template_of(template)?;
    if let Some(expressions) = expressions {
        let own = own_expressions(py, expressions, &face, &template)?;
        options.expressions = own.expressions;
        options.expressions_on = own.neutral;
        options.scans = own.scans;
    }
    let mut progress = Progress::new(py, progress)?;
    let rigged = py.detach(|| {
        rig_face(&face, &template, &options, &mut |step| {
            progress.report(step.stage, step.fraction)
        })
    });
    // What the callback raised is the reason, not the cancellation that followed.
    progress.finish()?;
    let mut rigged = rigged.map_err(to_py)?;
    // As the report of the rig itself, with the time of building it.
    if let Ok(report) = serde_json::to_string(&rigged.report) {
        rigged.rig.registration_report = report;
    }
    Ok(PyRig {
        inner: Arc::new(rigged.rig),
    })
}

/// The face's own expressions, scans, and the mesh that they are on where it is another one.
pub(crate) fn own_expressions(
    py: Python<'_>,
    value: &Bound<'_, PyAny>,
    face: &Mesh,
    template: &Template,
) -> PyResult<OwnShapes> {
    if let Ok(source) = value.extract::<PathBuf>() {
        return py
            .detach(|| read_own_shapes(&source, face, template))
            .map_err(to_py);
    }
    let named: BTreeMap<String, Bound<'_, PyAny>> = value
        .extract()
        .map_err(|_| input("expressions: expected shape -> vertices, a folder or a glTF file"))?;
    let mut own = OwnShapes::default();
    for (name, given) in named {
        let weights = shape_weights(&name, template)?;
        match given.cast::<PyMesh>() {
            Ok(mesh) if mesh.get().inner.vertex_count() != face.vertex_count() => {
                own.scans.push(ExpressionScan {
                    path: mesh.get().source.clone().unwrap_or_else(|| (&name).into()),
                    mesh: mesh.get().inner.clone(),
                    name,
                    weights,
                });
            }
            Ok(mesh) => own.expressions.push(Expression {
                positions: mesh.get().inner.positions().to_vec(),
                name,
                weights,
            }),
            Err(_) => own.expressions.push(Expression {
                positions: arrays::points(&format!("expressions['{name}']"), &given)?,
                name,
                weights,
            }),
        }
    }
    Ok(own)
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

const JAW_MODES: [(&str, JawMode); 2] = [("hinge", JawMode::Hinge), ("linear", JawMode::Linear)];

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

/// The weights of the template's shapes that a name means.
fn shape_weights(name: &str, template: &Template) -> PyResult<Vec<f32>> {
    let shapes = &template.shapes;
    let mut weights = vec![0.0; shapes.len()];
    let names = match_shape(name).map_or_else(Vec::new, ShapeMatch::names);
    for (shape, weight) in shapes.iter().zip(&mut weights) {
        if names.contains(&shape.name.as_str()) {
            *weight = 1.0;
        }
    }
    if names.is_empty() {
        let nearest = nearest_name(name, ARKIT_SHAPES).unwrap_or_default();
        return Err(input(format!(
            "expressions: '{name}' is no shape of ARKit (nearest: '{nearest}')"
        )));
    }
    Ok(weights)
}

/// Simulates a rig through a take and records it to an MCAP file; returns a report.
///
/// - `rig`, `clip`: what is simulated; `output`: the file
/// - `scene`: a mapping of the fields of a scene file, or its path; the other arguments go
///   before it
/// - `fps`: frames a second; the scene's or else the take's own by default
/// - `gravity`, `wind`: shape (3,), world axes, +Y up (mm/s^2, mm/s)
/// - `substeps`: of the cloth, per 1/60 s
/// - `economy`: by how much frames may differ from the full model, as the root mean square over
///   any patch (mm), or "0.05 %" of the face's height; "off" models everything. What was left out is in
///   the report's "economy"
/// - `dynamics`: False leaves patches where the muscle shapes want them
/// - `record`: all that is to be in the recording, of "skin", "patches", "points", "magnets",
///   "strain", "contacts", "colliders", "weights", "energies", "errors" and "timings"; by default
///   everything but magnets, strain and timings
/// - `skin_hz`, `patches_hz`, `points_hz`, `strain_hz`: meshes a second in the recording, 0 for
///   none
/// - `rig_name`, `take_name`: what the recording calls them
/// - `layout`: where to write the layout for Foxglove and Lichtblick; nowhere by default
/// - `progress`: True for a bar, or a function of (stage, share)
///
/// >>> rig, clip = fabrig.rig(fabrig.demo_face()), fabrig.demo_take().between(0, 0.1)
/// >>> fabrig.animate(rig, clip, "out.mcap", fps=30)["frames"]
/// 4
#[pyfunction]
#[pyo3(signature = (rig, clip, output, *, scene=None, fps=None, gravity=None, wind=None, substeps=None,
                    economy=None, dynamics=true, record=None, skin_hz=None, patches_hz=None, points_hz=None, strain_hz=None,
                    rig_name=None, take_name=None, layout=None, progress=None))]
#[allow(clippy::too_many_arguments)] // Keyword-only in Python.
pub(crate) fn animate<'py>(
    py: Python<'py>,
    rig: &PyRig,
    clip: &PyClip,
    output: PathBuf,
    scene: Option<&Bound<'py, PyAny>>,
    fps: Option<f64>,
    gravity: Option<&Bound<'py, PyAny>>,
    wind: Option<&Bound<'py, PyAny>>,
    substeps: Option<u32>,
    economy: Option<&Bound<'py, PyAny>>,
    dynamics: bool,
    record: Option<Vec<String>>,
    skin_hz: Option<f64>,
    patches_hz: Option<f64>,
    points_hz: Option<f64>,
    strain_hz: Option<f64>,
    rig_name: Option<String>,
    take_name: Option<String>,
    layout: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    check_rate(fps)?;
    let scene = self::scene(scene, gravity, wind, substeps, economy, dynamics)?;
    let mut options = AnimateOptions {
        fps,
        ..AnimateOptions::default()
    };
    options.rig_name = rig_name.unwrap_or(options.rig_name);
    options.take_name = take_name.unwrap_or(options.take_name);
    for (name, rate) in [
        ("skin_hz", skin_hz),
        ("patches_hz", patches_hz),
        ("points_hz", points_hz),
        ("strain_hz", strain_hz),
    ] {
        if let Some(rate) = rate.filter(|rate| !(rate.is_finite() && *rate >= 0.0)) {
            return Err(input(format!("{name}: {rate} is not a rate of at least 0")));
        }
    }
    let choice = RecordingChoice {
        record: recorded(record.as_deref())?,
        skin_hz,
        patches_hz,
        points_hz,
        strain_hz,
    };
    options.recording = choice.or(&scene.recording).options();
    let mut progress = Progress::new(py, progress)?;
    let (rig, clip) = (Arc::clone(&rig.inner), clip.inner.clone());
    let report = py.detach(|| {
        fabrig_core::pipeline::animate(rig, clip, scene, &output, &options, &mut |now| {
            progress.report("simulate", now.frame as f64 / now.frame_count as f64)
        })
    });
    progress.finish()?;
    let report = report.map_err(to_py)?;
    write_layout(layout, &report.foxglove_layout)?;
    arrays::to_python(py, &report)
}

/// What is to be recorded, by names; nothing said where there are none.
fn recorded(names: Option<&[String]>) -> PyResult<Option<Vec<RecordedKind>>> {
    let kind = |name: &String| one_of("record", name, &RecordedKind::NAMED);
    let kinds = names.map(|names| names.iter().map(kind).collect());
    kinds.transpose()
}

/// Frames a second that an argument asks for.
fn check_rate(fps: Option<f64>) -> PyResult<()> {
    match fps {
        Some(fps) if !(fps.is_finite() && fps > 0.0) => {
            Err(input(format!("fps: {fps} is not a frame rate")))
        }
        _ => Ok(()),
    }
}

/// Writes a layout for Foxglove where one is asked for.
fn write_layout(path: Option<PathBuf>, layout: &str) -> PyResult<()> {
    if let Some(path) = path {
        write_atomically(&path, |file| file.write_all(layout.as_bytes()))?;
    }
    Ok(())
}

/// Simulates the faces of a scene side by side and records them to one MCAP file; returns for each
/// its name and a report. With several faces the topics of each begin with its name.
///
/// - `scene`: the path of a scene file with `faces`, or a mapping of its fields; `output`: the file
/// - `fps`: frames a second; the scene's or else the first take's own by default
/// - `record`: as for `animate`; the scene's by default
/// - `layout`: where to write the layout for Foxglove and Lichtblick; nowhere by default
/// - `progress`: True for a bar, or a function of (stage, share)
///
/// >>> fabrig.rig(fabrig.demo_face()).save("ann.fabrig")
/// >>> scene = {"faces": [{"rig": "ann.fabrig"}], "duration": 0.1, "wind": [3000, 0, 0]}
/// >>> [(name, report["frames"]) for name, report in fabrig.animate_scene(scene, "shot.mcap", fps=20)]
/// [('ann', 3)]
#[pyfunction]
#[pyo3(signature = (scene, output, *, fps=None, record=None, layout=None, progress=None))]
pub(crate) fn animate_scene<'py>(
    py: Python<'py>,
    scene: &Bound<'py, PyAny>,
    output: PathBuf,
    fps: Option<f64>,
    record: Option<Vec<String>>,
    layout: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
    check_rate(fps)?;
    let scene = self::scene(Some(scene), None, None, None, None, true)?;
    if scene.faces.is_empty() {
        return Err(input(
            "scene: it has no `faces`; `animate` takes a rig and a clip",
        ));
    }
    let choice = RecordingChoice {
        record: recorded(record.as_deref())?,
        ..scene.recording.clone()
    };
    let options = AnimateOptions {
        fps,
        recording: choice.or(&scene.recording).options(),
        ..AnimateOptions::default()
    };
    let mut progress = Progress::new(py, progress)?;
    let report = py.detach(|| {
        let faces = load_faces(&scene, &ReadOptions::default(), &mut |step| {
            progress.report(step.stage, step.fraction)
        })?;
        fabrig_core::pipeline::animate_scene(&scene, faces, &output, &options, &mut |now| {
            progress.report("simulate", now.frame as f64 / now.frame_count as f64)
        })
    });
    progress.finish()?;
    let report = report.map_err(to_py)?;
    if let Some((_, first)) = report.faces.first() {
        write_layout(layout, &first.foxglove_layout)?;
    }
    let faces = report.faces.iter();
    faces
        .map(|(name, report)| Ok((name.clone(), arrays::to_python(py, report)?)))
        .collect()
}
