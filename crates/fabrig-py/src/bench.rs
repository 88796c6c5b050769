//! Measurements, as plain values; `fabrig.bench` names and documents them.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use fabrig_core::cloth::ClothOptions;
use fabrig_core::cloth::bench::{BenchScene, Extent, Pareto, pareto, settings, stability};
use fabrig_core::evaluation::{
    METHODS, OwnFace, Table3, Table3Error, evaluate_face, synthetic_faces,
};
use fabrig_core::pipeline::{RigFaceOptions, cost, rig_face, runtime};
use fabrig_core::registration::bench::{cases, run_case};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{
    Scene, SceneError, all_frames, chain_loss, face_bench_scene, face_cases, liveliest_frames,
};
use fabrig_core::template::human;
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::mesh::PyMesh;
use crate::motion::PyClip;
use crate::pipeline::own_expressions;
use crate::progress::{Progress, interruptible, interruptible_with};
use crate::rig::PyRig;
use crate::template::template_of;

/// Name, neutral mesh, expressions.
type FaceArgument<'py> = (String, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// Frames per second of what is measured.
const FPS: f64 = 60.0;

#[pyfunction]
#[pyo3(signature = (cloth))]
pub(crate) fn bench_chain(py: Python<'_>, cloth: bool) -> PyResult<Bound<'_, PyAny>> {
    let losses = interruptible(py, move || {
        let template = human();
        let options = RigFaceOptions::default();
        let go_on = &mut |_| ControlFlow::Continue(());
        let rigged = rig_face(&template.skin, template, &options, go_on)?;
        let scene = if cloth {
            Scene::default()
        } else {
            Scene::without_dynamics()
        };
        Ok::<_, fabrig_core::Error>(chain_loss(&Arc::new(rigged.rig), template, &scene)?)
    })?;
    arrays::to_python(py, &losses.map_err(to_py)?)
}

#[pyfunction]
#[pyo3(signature = (filter, count, progress))]
pub(crate) fn bench_registration<'py>(
    py: Python<'py>,
    filter: &str,
    count: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut chosen = cases();
    chosen.retain(|case| case.name.contains(filter));
    if chosen.is_empty() {
        return Err(input(format!("filter: no case has '{filter}' in its name")));
    }
    chosen.truncate(count.unwrap_or(usize::MAX));
    let mut progress = Progress::new(py, progress)?;
    let mut results = Vec::new();
    let mut outcome = Ok(());
    for (done, case) in chosen.iter().enumerate() {
        let share = done as f64 / chosen.len() as f64;
        if progress.report(&case.name, share).is_break() {
            break;
        }
        match py.detach(|| run_case(case, human())) {
            Ok(result) => results.push(result),
            Err(error) => {
                outcome = Err(to_py(error));
                break;
            }
        }
    }
    progress.finish()?;
    outcome?;
    arrays::to_python(py, &results)
}

#[pyfunction]
#[pyo3(signature = (largest, progress))]
pub(crate) fn bench_registration_cost<'py>(
    py: Python<'py>,
    largest: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let temporary = py.import("tempfile")?.call_method0("TemporaryDirectory")?;
    let folder: PathBuf = temporary.getattr("name")?.extract()?;
    let mut progress = Progress::new(py, progress)?;
    let rows = py.detach(|| {
        cost(human(), largest, &folder, &mut |row| {
            let share = row.vertex_count as f64 / largest as f64;
            progress.report(&format!("{} vertices", row.vertex_count), share.min(1.0))
        })
    });
    progress.finish()?;
    temporary.call_method0("cleanup")?;
    arrays::to_python(py, &rows.map_err(to_py)?)
}

/// The rig that is measured: the caller's own, or that of the bundled face.
fn rig_of(py: Python<'_>, rig: Option<&PyRig>) -> PyResult<Arc<Rig>> {
    if let Some(rig) = rig {
        return Ok(Arc::clone(&rig.inner));
    }
    let rigged = interruptible(py, || {
        let options = RigFaceOptions::default();
        let go_on = &mut |_| ControlFlow::Continue(());
        rig_face(
            &fabrig_core::template::demo_face(),
            human(),
            &options,
            go_on,
        )
    })?;
    Ok(Arc::new(rigged.map_err(to_py)?.rig))
}

#[pyfunction]
#[pyo3(signature = (rig, clip, ratio, frames, substeps, reference_substeps, full, progress))]
#[allow(clippy::too_many_arguments)] // `fabrig.bench` gives them names.
pub(crate) fn bench_pareto<'py>(
    py: Python<'py>,
    rig: Option<&PyRig>,
    clip: &PyClip,
    ratio: Option<f64>,
    frames: Option<usize>,
    substeps: Option<Vec<u32>>,
    reference_substeps: u32,
    full: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    if !(2..=65_536).contains(&reference_substeps) {
        return Err(input(format!(
            "reference_substeps: {reference_substeps} is not from 2 to 65536"
        )));
    }
    let scene = match ratio {
        Some(ratio) if ratio.is_finite() && ratio > 0.0 => {
            BenchScene::standard_patch(ratio, frames.unwrap_or(60).max(1))
        }
        Some(ratio) => return Err(input(format!("ratio: {ratio} is not a positive number"))),
        None => {
            let rig = rig_of(py, rig)?;
            let clip = &clip.inner;
            let range = match frames {
                Some(count) => liveliest_frames(clip, FPS, count),
                None => all_frames(clip, FPS),
            };
            if range.is_empty() {
                return Err(input("clip, frames: there is no frame to measure"));
            }
            let made = py.detach(|| face_bench_scene(&rig, clip, &Scene::default(), FPS, range));
            made.map_err(to_py)?
        }
    };
    let mut wanted = settings(full);
    if let Some(substeps) = substeps {
        wanted.retain(|setting| substeps.contains(&setting.substeps));
        if wanted.is_empty() {
            return Err(input("substeps: none of the settings has as many"));
        }
    }
    let progress = Progress::new(py, progress)?;
    let result: Result<Pareto, _> = interruptible_with(py, progress, move |progress| {
        let base = ClothOptions::default();
        pareto(
            &scene,
            &base,
            &wanted,
            reference_substeps,
            &mut |done, total| {
                let share = done as f64 / total as f64;
                progress.report(&scene.name, share).is_continue()
            },
        )
    })?;
    let result = result.map_err(to_py)?;
    let report = arrays::to_python(py, &result)?;
    // The names that people read settings by.
    for (index, point) in result.points.iter().enumerate() {
        let item = report.get_item("points")?.get_item(index)?;
        item.set_item("family", point.setting.family())?;
        item.set_item("substeps", point.setting.substeps)?;
    }
    Ok(report)
}

#[pyfunction]
#[pyo3(signature = (rig, full, progress))]
pub(crate) fn bench_stability<'py>(
    py: Python<'py>,
    rig: Option<&PyRig>,
    full: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let rig = rig_of(py, rig)?;
    let extent = if full { Extent::FULL } else { Extent::USUAL };
    let progress = Progress::new(py, progress)?;
    let results = interruptible_with(py, progress, move |progress| {
        let mut results = face_cases(&rig)?;
        results.extend(stability(extent, &mut |done, total| {
            let share = done as f64 / total as f64;
            progress.report("hard cases", share).is_continue()
        }));
        Ok::<_, SceneError>(results)
    })?;
    let results = results.map_err(to_py)?;
    let rows = arrays::to_python(py, &results)?;
    for (index, case) in results.iter().enumerate() {
        rows.get_item(index)?.set_item("passed", case.is_passed())?;
    }
    Ok(rows)
}

#[pyfunction]
#[pyo3(signature = (rig, clip, frames, progress))]
pub(crate) fn bench_runtime<'py>(
    py: Python<'py>,
    rig: Option<&PyRig>,
    clip: &PyClip,
    frames: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    if frames == 0 {
        return Err(input("frames: there must be at least one"));
    }
    let rig = rig_of(py, rig)?;
    let mut progress = Progress::new(py, progress)?;
    let report = py.detach(|| {
        runtime(&rig, &clip.inner, frames, &mut |at| {
            progress.report(&at.what, at.frame as f64 / at.frame_count as f64)
        })
    });
    progress.finish()?;
    arrays::to_python(py, &report.map_err(to_py)?)
}

#[pyfunction]
#[pyo3(signature = (faces, filter, methods, template, progress))]
pub(crate) fn bench_table3<'py>(
    py: Python<'py>,
    faces: Option<Vec<FaceArgument<'py>>>,
    filter: &str,
    methods: Option<Vec<String>>,
    template: Option<&Bound<'py, PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let template = template_of(template)?;
    let faces = match faces {
        None => py
            .detach(|| synthetic_faces(&template, filter))
            .map_err(to_py)?,
        Some(faces) => {
            let each = faces.into_iter().map(|(name, neutral, expressions)| {
                let neutral = PyMesh::of(&neutral)?.get().inner.clone();
                let own = own_expressions(py, &expressions, &neutral, &template)?;
                let own = own.without_scans(&neutral).map_err(to_py)?;
                Ok(OwnFace {
                    name,
                    is_synthetic: false,
                    neutral: own.neutral.unwrap_or(neutral),
                    expressions: own.expressions,
                })
            });
            each.collect::<PyResult<Vec<_>>>()?
        }
    };
    if faces.is_empty() {
        return Err(input(format!(
            "filter: no bundled face has '{filter}' in its name"
        )));
    }
    let mut chosen = METHODS.to_vec();
    if let Some(names) = methods {
        if let Some(name) = names.iter().find(|n| METHODS.iter().all(|m| m.name != **n)) {
            let known: Vec<&str> = METHODS.iter().map(|m| m.name).collect();
            return Err(input(format!(
                "methods: '{name}' is not one of {}",
                known.join("; ")
            )));
        }
        chosen.retain(|method| names.iter().any(|name| name == method.name));
    }
    let mut progress = Progress::new(py, progress)?;
    let total = (faces.len() * chosen.len()) as f64;
    let mut done = 0.0;
    let mut table = Table3::default();
    for face in &faces {
        let result = py.detach(|| {
            evaluate_face(face, &template, &chosen, &mut |method| {
                done += 1.0;
                progress.report(&format!("{}: {}", face.name, method.name), done / total)
            })
        });
        match result {
            Ok(result) => table.faces.push(result),
            Err(Table3Error::Stopped) => break,
            Err(error) => table.refused.push((face.name.clone(), error.to_string())),
        }
    }
    progress.finish()?;
    arrays::to_python(py, &table)
}
