//! Rigs and recordings for other programs.

use std::path::PathBuf;
use std::sync::Arc;

use fabrig_core::export::{ConvertOptions, ExportOptions, LengthUnit, ShapeSource};
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::motion::PyClip;
use crate::pipeline::one_of;
use crate::progress::Progress;
use crate::rig::PyRig;

const UNITS: [(&str, LengthUnit); 5] = [
    ("own", LengthUnit::Own),
    ("mm", LengthUnit::Millimetre),
    ("cm", LengthUnit::Centimetre),
    ("m", LengthUnit::Metre),
    ("in", LengthUnit::Inch),
];

const SHAPE_SOURCES: [(&str, ShapeSource); 2] = [
    ("settled", ShapeSource::Settled),
    ("targets", ShapeSource::Targets),
];

/// What is asked of the file, whatever it is made from.
pub(crate) struct Layout<'a> {
    pub(crate) face: Option<PathBuf>,
    pub(crate) unit: Option<&'a str>,
    pub(crate) name: Option<String>,
    pub(crate) still_head: bool,
    pub(crate) components: Option<usize>,
    pub(crate) tolerance: Option<f64>,
}

impl Layout<'_> {
    pub(crate) fn options(self) -> PyResult<ExportOptions> {
        let defaults = ExportOptions::default();
        Ok(ExportOptions {
            name: self.name.unwrap_or(defaults.name),
            unit: self
                .unit
                .map(|unit| one_of("unit", unit, &UNITS))
                .transpose()?,
            source: self.face,
            still_head: self.still_head,
            components: self.components,
            basis_tolerance: self.tolerance.unwrap_or(defaults.basis_tolerance),
            ..ExportOptions::default()
        })
    }
}

pub(crate) fn shape_source(name: &str) -> PyResult<ShapeSource> {
    one_of("shapes", name, &SHAPE_SOURCES)
}

/// Exports a rig; returns the report.
pub(crate) fn export<'py>(
    py: Python<'py>,
    rig: &PyRig,
    path: PathBuf,
    motion: Option<&PyClip>,
    options: ExportOptions,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let options = ExportOptions {
        motion: motion.map(|clip| clip.inner.clone()),
        ..options
    };
    if options.motion.is_none() && options.baked {
        return Err(input("baked: there is nothing to bake without motion"));
    }
    let rig = Arc::clone(&rig.inner);
    let mut progress = Progress::new(py, progress)?;
    let report = py.detach(|| {
        fabrig_core::export::export(&rig, &path, &options, &mut |step| {
            progress.report(step.stage, step.fraction)
        })
    });
    progress.finish()?;
    arrays::to_python(py, &report.map_err(to_py)?)
}

/// Converts the file `recording` to `output`, by its ending: .glb, .gltf, .usda, .npz, .pc2, .mdd or a folder of OBJ files; returns
/// a report.
///
/// - `rig`: the rig that was recorded, to keep its polygons, texture coordinates, units and
///   place; without it the recording's triangles in the head frame are written
/// - `face`: the mesh that the rig was made from, for its materials
/// - `unit`: "own", "mm", "cm", "m" or "in"; metres for glTF by default, else the rig's own
/// - `name`: of the object in the file; `still_head`: leave the motion of the head out
/// - `components`: morph targets of a glTF; as many as `tolerance` (mm) needs by default
/// - `progress`: True for a bar, or a function of (stage, share)
///
/// >>> rig = fabrig.Rig.load("face.fabrig")  # doctest: +SKIP
/// >>> report = fabrig.convert("out.mcap", "out.usda", rig=rig)  # doctest: +SKIP
#[pyfunction]
#[pyo3(signature = (recording, output, *, rig=None, face=None, unit=None, name=None,
                    still_head=false, components=None, tolerance=None, progress=None))]
#[allow(clippy::too_many_arguments)] // Keyword-only in Python.
pub(crate) fn convert<'py>(
    py: Python<'py>,
    recording: PathBuf,
    output: PathBuf,
    rig: Option<&PyRig>,
    face: Option<PathBuf>,
    unit: Option<&str>,
    name: Option<String>,
    still_head: bool,
    components: Option<usize>,
    tolerance: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    if face.is_some() && rig.is_none() {
        return Err(input(
            "face: materials are of a rig's polygons; give rig too",
        ));
    }
    let layout = Layout {
        face,
        unit,
        name,
        still_head,
        components,
        tolerance,
    };
    let options = ConvertOptions {
        rig: rig.map(|rig| Arc::clone(&rig.inner)),
        export: layout.options()?,
    };
    let mut progress = Progress::new(py, progress)?;
    let report = py.detach(|| {
        fabrig_core::export::convert(&recording, &output, &options, &mut |step| {
            progress.report(step.stage, step.fraction)
        })
    });
    progress.finish()?;
    arrays::to_python(py, &report.map_err(to_py)?)
}
