//! Takes.

use std::collections::BTreeMap;
use std::path::PathBuf;

use fabrig_core::motion::{self, Adjustment, Clip, MotionError, ReadOptions, TakeFormat};
use fabrig_core::template;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::pipeline::one_of;

/// Weights of named shapes over time.
#[pyclass(frozen, name = "Clip", module = "fabrig")]
pub(crate) struct PyClip {
    pub(crate) inner: Clip,
}

#[pymethods]
impl PyClip {
    /// From times (s) of shape (F,), names of C shapes, and weights of shape (F, C) in [0, 1].
    #[new]
    fn new(
        times: &Bound<'_, PyAny>,
        channels: Vec<String>,
        weights: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let times = arrays::numbers("times", times)?;
        let (rows, columns, values) = arrays::table("weights", weights)?;
        if (rows, columns) != (times.len(), channels.len()) {
            return Err(input(format!(
                "weights: expected shape ({}, {}), got ({rows}, {columns})",
                times.len(),
                channels.len()
            )));
        }
        let weights = values.into_iter().map(|w| w as f32).collect();
        let inner = Clip::new(times, channels, weights).map_err(|source| {
            to_py(MotionError::Clip {
                name: "Clip".to_owned(),
                source,
            })
        })?;
        Ok(Self { inner })
    }

    /// Times of the frames (s), shape (F,).
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.inner.times().to_vec().into_pyarray(py)
    }

    /// Names of the shapes.
    #[getter]
    fn channels(&self) -> Vec<String> {
        self.inner.channels().to_vec()
    }

    /// Weights, shape (F, C).
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f32>> {
        let columns = self.inner.channels().len();
        let weights = self.inner.weights();
        Array2::from_shape_fn((self.inner.frame_count(), columns), |(f, c)| {
            weights[f * columns + c]
        })
        .into_pyarray(py)
    }

    /// Time from the first to the last frame (s).
    #[getter]
    fn duration(&self) -> f64 {
        self.inner.duration()
    }

    /// The usual number of frames per second; None for a single frame.
    #[getter]
    fn frame_rate(&self) -> Option<f64> {
        self.inner.frame_rate()
    }

    /// What reading had to decide.
    #[getter]
    fn notes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::to_python(py, self.inner.notes())
    }

    /// Weights at a time (s) between the frames, shape (C,).
    fn sample<'py>(&self, py: Python<'py>, time: f64) -> Bound<'py, PyArray1<f32>> {
        self.inner.sample(time).weights.into_pyarray(py)
    }

    /// The clip at even times, `rate` frames per second.
    fn resampled(&self, rate: f64) -> PyResult<Self> {
        let inner = self.inner.resampled(rate).map_err(|source| {
            to_py(MotionError::Clip {
                name: "Clip".to_owned(),
                source,
            })
        })?;
        Ok(Self { inner })
    }

    /// The clip as CSV that `read_motion` reads.
    fn to_csv(&self) -> String {
        self.inner.to_csv()
    }

    fn __len__(&self) -> usize {
        self.inner.frame_count()
    }

    fn __repr__(&self) -> String {
        format!(
            "Clip({} frames, {:.2} s, {} shapes)",
            self.inner.frame_count(),
            self.inner.duration(),
            self.inner.channels().len()
        )
    }
}

/// Names of formats, as on the command line.
const FORMATS: [(&str, TakeFormat); 6] = [
    ("keys", TakeFormat::Keys),
    ("arkit", TakeFormat::Arkit),
    ("open-face", TakeFormat::OpenFace),
    ("py-feat", TakeFormat::PyFeat),
    ("face-cap", TakeFormat::FaceCap),
    ("media-pipe", TakeFormat::MediaPipe),
];

/// Reads a take: ARKit, OpenFace, py-feat or MediaPipe CSV, MediaPipe JSON, Face Cap text or
/// keyed text, told apart by content unless `format` says it.
///
/// `calibrate_neutral` is a stretch (from, to) in seconds in which the performer rests,
/// `gains` maps shapes to factors.
#[pyfunction]
#[pyo3(signature = (
    path, *, format=None, frame_rate=None, ignore_unknown_columns=false, clamp_weights=false,
    calibrate_neutral=None, gains=None, swap_sides=false
))]
#[allow(
    clippy::too_many_arguments,
    reason = "Python's keyword arguments are the options"
)]
pub(crate) fn read_motion(
    py: Python<'_>,
    path: PathBuf,
    format: Option<&str>,
    frame_rate: Option<f64>,
    ignore_unknown_columns: bool,
    clamp_weights: bool,
    calibrate_neutral: Option<(f64, f64)>,
    gains: Option<BTreeMap<String, f64>>,
    swap_sides: bool,
) -> PyResult<PyClip> {
    let format = match format {
        Some(name) => Some(one_of("format", name, &FORMATS)?),
        None => None,
    };
    let options = ReadOptions {
        format,
        frame_rate,
        ignore_unknown_columns,
        clamp_weights,
        adjust: Adjustment {
            swap_sides,
            neutral: calibrate_neutral.map(|(from, to)| [from, to]),
            gains: gains.unwrap_or_default().into_iter().collect(),
            ..Adjustment::default()
        },
        ..ReadOptions::default()
    };
    let inner = py.detach(|| motion::read(path, &options)).map_err(to_py)?;
    Ok(PyClip { inner })
}

/// The bundled take.
#[pyfunction]
pub(crate) fn demo_take() -> PyResult<PyClip> {
    let text = template::demo_take();
    let inner = motion::parse(text, "the bundled take", &ReadOptions::default()).map_err(to_py)?;
    Ok(PyClip { inner })
}
