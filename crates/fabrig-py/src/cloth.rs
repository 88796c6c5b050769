//! The cloth solver alone: grids, targets and materials in, positions out.

use std::time::Instant;

use fabrig_core::cloth::{
    Cloth, ClothAttachment, ClothOptions, ClothPatch, FrameInput, GridShape, Integrator, Material,
    Materials, PatchMotion, Precision,
};
use nalgebra::Vector3;
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use serde_json::Value;

use crate::arrays::{self, Grid};
use crate::errors::{input, to_py};

/// Patch, other patch, pairs of their nodes, strength.
type PairArgument = (u32, u32, Vec<(u32, u32)>, f64);

/// Cloth patches drawn to moving targets, without a face: a grid each, with stretch, shear,
/// bend and pressure. Lengths in mm, times in seconds, +Y up.
///
/// >>> import numpy as np
/// >>> v, u = np.mgrid[0:20, 0:21] * 2.0
/// >>> sheet = np.stack([u, v, 0 * u], axis=-1)      # (rows, columns, 3)
/// >>> cloth = fabrig.Cloth([sheet], material="fat")
/// >>> report = cloth.step(1 / 60, [sheet + [0, 1, 0]])
/// >>> cloth.positions[0].shape
/// (20, 21, 3)
///
/// - `grids`: one array of rest positions (rows, columns, 3) per patch; constraints run along
///   rows and columns. Patches of one shape are solved side by side in SIMD lanes
/// - `material`: "linear", "sphincter" or "fat" (the paper's Table 2), a dict of its numbers
///   on top of "linear" (or of another by `base`), or a list with one of these per patch
/// - `periodic`: whether rows close into rings; one flag, or one per patch
/// - `anchors`: per patch the indices (row * columns + column) of nodes held to anchors, with
///   `anchor_strength` times the strength of attachments
/// - `pairs`: tuples (patch, other patch, (K, 2) node indices, strength) held to each other
/// - `substeps`: per 1/60 s; `rest_blend`: 0 keeps rest lengths (wrinkles), 1 takes the targets'
/// - `rest_imperfection`: how much `rest_blend` varies from edge to edge, which decides how a
///   smooth patch buckles; `seed` makes other variations
/// - `standing_gravity`: gravity under which rest is at equilibrium (mm/s^2)
/// - `precision`: "single", "single_scalar" or "double"; `integrator`: "bdf2" or
///   "backward_euler"
#[pyclass(name = "Cloth", module = "fabrig")]
pub(crate) struct PyCloth {
    inner: Cloth,
    shapes: Vec<GridShape>,
    anchor_counts: Vec<usize>,
}

#[pymethods]
impl PyCloth {
    #[new]
    #[pyo3(signature = (
        grids, *, material=None, periodic=None, anchors=None, anchor_strength=1.0, pairs=None,
        substeps=None, rest_blend=None, rest_imperfection=None, seed=None, standing_gravity=None,
        precision=None, integrator=None
    ))]
    #[allow(clippy::too_many_arguments, reason = "each is a keyword in Python")]
    fn new(
        py: Python<'_>,
        grids: &Bound<'_, PyAny>,
        material: Option<&Bound<'_, PyAny>>,
        periodic: Option<&Bound<'_, PyAny>>,
        anchors: Option<Vec<Option<Vec<i64>>>>,
        anchor_strength: f64,
        pairs: Option<Vec<PairArgument>>,
        substeps: Option<u32>,
        rest_blend: Option<f64>,
        rest_imperfection: Option<f64>,
        seed: Option<u64>,
        standing_gravity: Option<&Bound<'_, PyAny>>,
        precision: Option<&Bound<'_, PyAny>>,
        integrator: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let grids = arrays::grids("grids", grids)?;
        let materials = per_patch("material", material, grids.len(), self::material)?;
        let flags = per_patch("periodic", periodic, grids.len(), |value| {
            value.map_or(Ok(false), |v| {
                v.extract()
                    .map_err(|_| input("periodic: expected True or False, or one per patch"))
            })
        })?;
        let mut patches = Vec::with_capacity(grids.len());
        for ((grid, material), is_periodic) in grids.into_iter().zip(materials).zip(flags) {
            let shape = GridShape {
                u_count: grid.columns,
                v_count: grid.rows,
                is_periodic,
            };
            patches.push(ClothPatch {
                shape,
                rest: grid.points,
                material,
                attachments: Vec::new(),
                variations: Vec::new(),
            });
        }
        let count = patches.len();
        let mut anchor_counts = vec![0; count];
        if let Some(anchors) = anchors {
            if anchors.len() != count {
                return Err(input(format!(
                    "anchors: expected one list (or None) for each of {count} patches, got {}",
                    anchors.len()
                )));
            }
            for (index, nodes) in anchors.into_iter().enumerate() {
                let Some(nodes) = nodes else { continue };
                let nodes = nodes
                    .into_iter()
                    .map(|node| {
                        u32::try_from(node).map_err(|_| {
                            input(format!("anchors: patch {index} has the node index {node}"))
                        })
                    })
                    .collect::<PyResult<Vec<u32>>>()?;
                anchor_counts[index] = nodes.len();
                patches[index].attachments.push(ClothAttachment::Anchors {
                    nodes,
                    strength: anchor_strength,
                });
            }
        }
        for (a, b, nodes, strength) in pairs.unwrap_or_default() {
            let patch = patches.get_mut(a as usize).ok_or_else(|| {
                input(format!(
                    "pairs: there is no patch {a}, only {count} patches"
                ))
            })?;
            patch.attachments.push(ClothAttachment::Patch {
                patch: b,
                pairs: nodes,
                strength,
            });
        }
        let mut options = ClothOptions::default();
        options.substeps = substeps.unwrap_or(options.substeps);
        options.rest_blend = rest_blend.unwrap_or(options.rest_blend);
        options.rest_imperfection = rest_imperfection.unwrap_or(options.rest_imperfection);
        options.seed = seed.unwrap_or(options.seed);
        if let Some(gravity) = standing_gravity {
            options.standing_gravity = arrays::vector("standing_gravity", gravity)?.into();
        }
        if let Some(name) = precision {
            options.precision = named::<Precision>("precision", name)?;
        }
        if let Some(name) = integrator {
            options.integrator = named::<Integrator>("integrator", name)?;
        }
        let inner = py
            .detach(|| Cloth::new(&patches, &options))
            .map_err(to_py)?;
        Ok(Self {
            inner,
            shapes: patches.iter().map(|p| p.shape).collect(),
            anchor_counts,
        })
    }

    /// Goes on by `dt` seconds, in which the targets move to `targets`: one array (rows,
    /// columns, 3) per patch. With `velocities` there (mm/s) they follow cubic curves, without
    /// them straight lines. `anchors` are arrays (K, 3), one per patch; without them anchors
    /// stay. `gravity` (mm/s^2) is the standing one where none is given, `wind` in mm/s.
    ///
    /// Returns a report: substeps, guards that acted, energies, and `milliseconds`, the time
    /// that the solver took without the copying of arrays.
    #[pyo3(signature = (dt, targets, velocities=None, *, anchors=None, gravity=None, wind=None))]
    #[allow(clippy::too_many_arguments, reason = "each is a keyword in Python")]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        dt: f64,
        targets: &Bound<'py, PyAny>,
        velocities: Option<&Bound<'py, PyAny>>,
        anchors: Option<&Bound<'py, PyAny>>,
        gravity: Option<&Bound<'py, PyAny>>,
        wind: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let targets = self.motions(targets, velocities)?;
        let anchors = self.anchors(anchors)?;
        let mut frame = FrameInput::new(dt, &targets);
        frame.anchors = &anchors;
        if let Some(gravity) = gravity {
            frame.gravity = Some(arrays::vector("gravity", gravity)?.into());
        }
        if let Some(wind) = wind {
            frame.wind = arrays::vector("wind", wind)?.into();
        }
        let cloth = &mut self.inner;
        let (report, milliseconds) = py.detach(|| {
            let clock = Instant::now();
            let report = cloth.step(&frame);
            (report, clock.elapsed().as_secs_f64() * 1e3)
        });
        let report = arrays::to_python(py, &report.map_err(to_py)?)?;
        report.set_item("milliseconds", milliseconds)?;
        Ok(report)
    }

    /// Puts the cloth on `targets` at once, moving with `velocities` (at rest without), and its
    /// anchors on `anchors`, as for `step`.
    #[pyo3(signature = (targets, velocities=None, *, anchors=None))]
    fn reset(
        &mut self,
        targets: &Bound<'_, PyAny>,
        velocities: Option<&Bound<'_, PyAny>>,
        anchors: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let targets = self.motions(targets, velocities)?;
        let anchors = self.anchors(anchors)?;
        self.inner.reset(&targets, &anchors).map_err(to_py)
    }

    /// Positions now (mm): one fresh array (rows, columns, 3) per patch.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray3<f32>>> {
        self.shapes
            .iter()
            .enumerate()
            .map(|(patch, shape)| {
                let points = self.inner.positions(patch);
                let columns = shape.u_count as usize;
                let size = (shape.v_count as usize, columns, 3);
                Array3::from_shape_fn(size, |(v, u, axis)| points[v * columns + u][axis])
                    .into_pyarray(py)
            })
            .collect()
    }

    /// How many patches there are.
    #[getter]
    fn patch_count(&self) -> usize {
        self.shapes.len()
    }
}

impl PyCloth {
    fn motions(
        &self,
        targets: &Bound<'_, PyAny>,
        velocities: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<PatchMotion>> {
        let positions = arrays::grids("targets", targets)?;
        self.check_shapes("targets", &positions)?;
        let mut motions: Vec<PatchMotion> = positions
            .into_iter()
            .map(|grid| PatchMotion {
                positions: grid.points,
                velocities: Vec::new(),
            })
            .collect();
        if let Some(velocities) = velocities {
            let grids = arrays::grids("velocities", velocities)?;
            self.check_shapes("velocities", &grids)?;
            for (motion, grid) in motions.iter_mut().zip(grids) {
                motion.velocities = grid.points.iter().map(|p| p.coords).collect();
            }
        }
        Ok(motions)
    }

    fn check_shapes(&self, name: &str, grids: &[Grid]) -> PyResult<()> {
        if grids.len() != self.shapes.len() {
            return Err(input(format!(
                "{name}: expected one array for each of {} patches, got {}",
                self.shapes.len(),
                grids.len()
            )));
        }
        for (index, (grid, shape)) in grids.iter().zip(&self.shapes).enumerate() {
            if (grid.rows, grid.columns) != (shape.v_count, shape.u_count) {
                return Err(input(format!(
                    "{name}: patch {index}: expected shape ({}, {}, 3), got ({}, {}, 3)",
                    shape.v_count, shape.u_count, grid.rows, grid.columns
                )));
            }
        }
        Ok(())
    }

    fn anchors(&self, anchors: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<PatchMotion>> {
        let Some(anchors) = anchors else {
            return Ok(Vec::new());
        };
        let mut motions = Vec::new();
        for (index, value) in anchors.try_iter()?.enumerate() {
            let value = value?;
            let positions = if value.is_none() {
                Vec::new()
            } else {
                arrays::points(&format!("anchors: patch {index}"), &value)?
            };
            if let Some(&count) = self.anchor_counts.get(index)
                && count != positions.len()
            {
                return Err(input(format!(
                    "anchors: patch {index}: expected shape ({count}, 3), got ({}, 3)",
                    positions.len()
                )));
            }
            motions.push(PatchMotion {
                velocities: vec![Vector3::zeros(); positions.len()],
                positions: positions.iter().map(|p| p.cast()).collect(),
            });
        }
        Ok(motions)
    }
}

/// One value for all patches, or a list with one per patch.
fn per_patch<T: Clone>(
    name: &str,
    value: Option<&Bound<'_, PyAny>>,
    count: usize,
    read: impl Fn(Option<&Bound<'_, PyAny>>) -> PyResult<T>,
) -> PyResult<Vec<T>> {
    let is_single = value.is_none_or(|v| {
        v.is_instance_of::<PyString>() || v.is_instance_of::<PyDict>() || v.try_iter().is_err()
    });
    let (Some(value), false) = (value, is_single) else {
        return Ok(vec![read(value)?; count]);
    };
    let values = value
        .try_iter()?
        .map(|item| read(Some(&item?)))
        .collect::<PyResult<Vec<T>>>()?;
    if values.len() != count {
        return Err(input(format!(
            "{name}: expected one for each of {count} patches, got {}",
            values.len()
        )));
    }
    Ok(values)
}

/// A material by name, or by its numbers.
fn material(value: Option<&Bound<'_, PyAny>>) -> PyResult<Material> {
    let known = Materials::default();
    let by_name = |name: &str| {
        known
            .get(name)
            .copied()
            .map_err(|e| input(format!("material: {e}")))
    };
    let Some(value) = value else {
        return by_name("linear");
    };
    if let Ok(name) = value.extract::<String>() {
        return by_name(&name);
    }
    let numbers = value
        .cast::<PyDict>()
        .map_err(|_| input("material: expected a name or a dict of numbers"))?;
    let base = match numbers.get_item("base")? {
        Some(base) => by_name(&base.extract::<String>()?)?,
        None => by_name("linear")?,
    };
    let mut fields = serde_json::to_value(base).map_err(|e| input(e.to_string()))?;
    for (key, number) in numbers {
        let key: String = key.extract()?;
        if key != "base" {
            let number: f64 = number
                .extract()
                .map_err(|_| input(format!("material: `{key}` is not a number")))?;
            fields[key.as_str()] = if number.is_finite() {
                Value::from(number)
            } else {
                return Err(input(format!("material: `{key}` is {number}")));
            };
        }
    }
    serde_json::from_value(fields).map_err(|e| input(format!("material: {e}")))
}

/// An option by its name.
fn named<T: serde::de::DeserializeOwned>(what: &str, name: &Bound<'_, PyAny>) -> PyResult<T> {
    let text: String = name
        .extract()
        .map_err(|_| input(format!("{what}: expected a name")))?;
    serde_json::from_value(Value::String(text)).map_err(|e| input(format!("{what}: {e}")))
}
