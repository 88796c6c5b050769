//! Takes.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;

use fabrig_core::motion::{
    self, Adjustment, Clip, ClipError, ClipNotes, ClipTracks, EyeAngles, HeadPose, MotionError,
    ReadOptions, TakeFormat,
};
use fabrig_core::{Vector, template};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::pipeline::one_of;
use crate::progress::interruptible;

/// Weights of named shapes over time, with head, eyes and wind where the take has them.
///
/// - `times`: (s), rising, shape (F,)
/// - `channels`: names of C shapes
/// - `weights`: in [0, 1], shape (F, C)
/// - `head`: yaw, pitch, roll (rad) and translation x, y, z (mm), shape (F, 6): to the
///   character's left, down, top of the head to the right
/// - `eyes`: yaw and pitch of the left eye, then of the right (rad), shape (F, 4)
/// - `wind`: velocity of the air in the world (mm/s), shape (F, 3)
///
/// >>> clip = fabrig.Clip([0.0, 1.0], ["jawOpen"], [[0.0], [1.0]])
/// >>> float(clip.sample(0.5)[0])
/// 0.5
#[pyclass(frozen, name = "Clip", module = "fabrig")]
pub(crate) struct PyClip {
    pub(crate) inner: Clip,
}

/// A clip as it is pickled.
type Parts = (Vec<f64>, Vec<String>, Vec<f32>, ClipTracks, ClipNotes);

#[pymethods]
impl PyClip {
    #[new]
    #[pyo3(signature = (times, channels, weights, *, head=None, eyes=None, wind=None))]
    fn new(
        times: &Bound<'_, PyAny>,
        channels: Vec<String>,
        weights: &Bound<'_, PyAny>,
        head: Option<&Bound<'_, PyAny>>,
        eyes: Option<&Bound<'_, PyAny>>,
        wind: Option<&Bound<'_, PyAny>>,
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
        let tracks = ClipTracks {
            head: track("head", head, rows)?.iter().map(head_pose).collect(),
            eyes: track("eyes", eyes, rows)?.iter().map(eye_angles).collect(),
            wind: track("wind", wind, rows)?
                .iter()
                .map(|v: &[f64; 3]| Vector::from(*v))
                .collect(),
        };
        made((times, channels, weights, tracks, ClipNotes::default()))
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
        arrays::from_rows(py, self.inner.channels().len(), self.inner.weights())
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

    /// Pose of the head in each frame, shape (F, 6) as `Clip` takes it; None without.
    #[getter]
    fn head<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let poses = self.inner.tracks().head.iter();
        let rows: Vec<f64> = poses
            .flat_map(|p| {
                let t = p.translation;
                [p.yaw, p.pitch, p.roll, t.x, t.y, t.z]
            })
            .collect();
        (!rows.is_empty()).then(|| arrays::from_rows(py, 6, &rows))
    }

    /// Where the eyes look in each frame, shape (F, 4) as `Clip` takes it; None without.
    #[getter]
    fn eyes<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let eyes = self.inner.tracks().eyes.iter();
        let rows: Vec<f64> = eyes
            .flat_map(|[l, r]| [l.yaw, l.pitch, r.yaw, r.pitch])
            .collect();
        (!rows.is_empty()).then(|| arrays::from_rows(py, 4, &rows))
    }

    /// Velocity of the air in each frame (mm/s), shape (F, 3); None without.
    #[getter]
    fn wind<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let wind = &self.inner.tracks().wind;
        (!wind.is_empty()).then(|| arrays::from_rows(py, 3, bytemuck::cast_slice(wind)))
    }

    /// The clip at even times, `rate` frames per second.
    ///
    /// >>> len(fabrig.Clip([0.0, 1.0], ["jawOpen"], [[0.0], [1.0]]).resampled(4))
    /// 5
    fn resampled(&self, rate: f64) -> PyResult<Self> {
        let inner = self.inner.resampled(rate).map_err(clip_error)?;
        Ok(Self { inner })
    }

    /// The frames from one time to another, both included.
    ///
    /// - `start`, `end`: (s), on the clip's own axis
    ///
    /// >>> fabrig.demo_take().between(1.0, 2.0).duration <= 1.0
    /// True
    fn between(&self, start: f64, end: f64) -> PyResult<Self> {
        let clip = &self.inner;
        let frames: Vec<usize> = (0..clip.frame_count())
            .filter(|&f| (start..=end).contains(&clip.times()[f]))
            .collect();
        if frames.is_empty() {
            let times = clip.times();
            return Err(input(format!(
                "start, end: no frame lies in {start} to {end} s; the clip goes from {} to {} s",
                times[0],
                times[times.len() - 1]
            )));
        }
        let columns = clip.channels().len();
        let row = |f: &usize| clip.weights()[f * columns..(f + 1) * columns].to_vec();
        let tracks = clip.tracks();
        made((
            frames.iter().map(|&f| clip.times()[f]).collect(),
            clip.channels().to_vec(),
            frames.iter().flat_map(row).collect(),
            ClipTracks {
                head: picked(&tracks.head, &frames),
                eyes: picked(&tracks.eyes, &frames),
                wind: picked(&tracks.wind, &frames),
            },
            clip.notes().clone(),
        ))
    }

    /// The clip as CSV that `read_motion` reads.
    ///
    /// >>> fabrig.Clip([0.0], ["jawOpen"], [[0.5]]).to_csv().splitlines()[0]
    /// 'time,jawOpen'
    fn to_csv(&self) -> String {
        self.inner.to_csv()
    }

    /// Writes the clip as CSV that `read_motion` reads.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        Ok(motion::write_csv(&self.inner, path)?)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let clip = &self.inner;
        let parts = (
            clip.times(),
            clip.channels(),
            clip.weights(),
            clip.tracks(),
            clip.notes(),
        );
        let bytes = postcard::to_allocvec(&parts).map_err(|e| input(e.to_string()))?;
        arrays::restored_by(py, "clip", &bytes)
    }

    #[staticmethod]
    fn _from_bytes(bytes: &[u8]) -> PyResult<Self> {
        let parts: Parts =
            postcard::from_bytes(bytes).map_err(|e| input(format!("bytes: no clip: {e}")))?;
        made(parts)
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

fn clip_error(source: ClipError) -> PyErr {
    to_py(MotionError::Clip {
        name: "Clip".to_owned(),
        source,
    })
}

fn made((times, channels, weights, tracks, notes): Parts) -> PyResult<PyClip> {
    let clip = Clip::new(times, channels, weights).map_err(clip_error)?;
    let clip = clip.with_tracks(tracks).map_err(clip_error)?;
    Ok(PyClip {
        inner: clip.with_notes(notes),
    })
}

/// Entries of the frames that are picked; none where there are none.
fn picked<T: Clone>(track: &[T], frames: &[usize]) -> Vec<T> {
    let present = frames.iter().filter_map(|&f| track.get(f));
    present.cloned().collect()
}

/// Rows of a track, one a frame; none where it is not given.
fn track<const N: usize>(
    name: &str,
    value: Option<&Bound<'_, PyAny>>,
    frame_count: usize,
) -> PyResult<Vec<[f64; N]>> {
    let Some(value) = value else {
        return Ok(Vec::new());
    };
    let (rows, columns, numbers) = arrays::table(name, value)?;
    if (rows, columns) != (frame_count, N) {
        return Err(input(format!(
            "{name}: expected shape ({frame_count}, {N}), got ({rows}, {columns})"
        )));
    }
    let (rows, _) = numbers.as_chunks::<N>();
    Ok(rows.to_vec())
}

fn head_pose(&[yaw, pitch, roll, x, y, z]: &[f64; 6]) -> HeadPose {
    HeadPose {
        yaw,
        pitch,
        roll,
        translation: Vector::new(x, y, z),
    }
}

fn eye_angles(&[left_yaw, left_pitch, right_yaw, right_pitch]: &[f64; 4]) -> [EyeAngles; 2] {
    let eye = |yaw, pitch| EyeAngles { yaw, pitch };
    [eye(left_yaw, left_pitch), eye(right_yaw, right_pitch)]
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
/// keyed text, told apart by content.
///
/// - `path`: the file
/// - `format`: "keys", "arkit", "open-face", "py-feat", "face-cap" or "media-pipe", where the
///   content does not say it
/// - `frame_rate`: of takes that have frame numbers or no times (1/s)
/// - `milliseconds`: whether times are milliseconds where seconds are usual
/// - `ignore_unknown_columns`: pass over columns that are not known, instead of an error
/// - `clamp_weights`: clamp weights outside [0, 1], instead of an error
/// - `calibrate_neutral`: a stretch (from, to) in seconds in which the performer rests
/// - `gains`: shape -> factor; "all" for every shape
/// - `swap_sides`: exchange left and right
/// - `keep_mouth_close`: leave `mouthClose` as it is where it exceeds `jawOpen`
/// - `resample`: bring the take to this many frames per second
///
/// >>> fabrig.demo_take().save("take.csv")
/// >>> fabrig.read_motion("take.csv", gains={"jawOpen": 0.5}).duration
/// 12.0
#[pyfunction]
#[pyo3(signature = (
    path, *, format=None, frame_rate=None, milliseconds=false, ignore_unknown_columns=false,
    clamp_weights=false, calibrate_neutral=None, gains=None, swap_sides=false,
    keep_mouth_close=false, resample=None
))]
#[allow(clippy::too_many_arguments)] // Python's keyword arguments are the options.
pub(crate) fn read_motion(
    py: Python<'_>,
    path: PathBuf,
    format: Option<&str>,
    frame_rate: Option<f64>,
    milliseconds: bool,
    ignore_unknown_columns: bool,
    clamp_weights: bool,
    calibrate_neutral: Option<(f64, f64)>,
    gains: Option<BTreeMap<String, f64>>,
    swap_sides: bool,
    keep_mouth_close: bool,
    resample: Option<f64>,
) -> PyResult<PyClip> {
    let format = match format {
        Some(name) => Some(one_of("format", name, &FORMATS)?),
        None => None,
    };
    let options = ReadOptions {
        format,
        frame_rate,
        times_in_milliseconds: milliseconds,
        ignore_unknown_columns,
        clamp_weights,
        adjust: Adjustment {
            swap_sides,
            neutral: calibrate_neutral.map(|(from, to)| [from, to]),
            gains: gains.unwrap_or_default().into_iter().collect(),
            limit_mouth_close: !keep_mouth_close,
        },
        ..ReadOptions::default()
    };
    let mut inner = interruptible(py, move || motion::read(path, &options))?.map_err(to_py)?;
    if let Some(rate) = resample {
        inner = inner.resampled(rate).map_err(clip_error)?;
    }
    Ok(PyClip { inner })
}

/// Reads a take from text: what a file has, or a few keys that a person writes, for which the
/// first line of such a file may be left out.
///
/// - `text`: time in seconds, then shapes or action units with weights, a line a key
/// - `frame_rate`: as for `read_motion`
///
/// >>> clip = fabrig.parse_motion("0 jawOpen=0\n0.4 jawOpen=0.6 mouthSmile=1\n1 AU12.l=0.5")
/// >>> clip.duration
/// 1.0
#[pyfunction]
#[pyo3(signature = (text, *, frame_rate=None))]
pub(crate) fn parse_motion(text: &str, frame_rate: Option<f64>) -> PyResult<PyClip> {
    let options = ReadOptions {
        frame_rate,
        ..ReadOptions::default()
    };
    let first = text.split_whitespace().next();
    // Keys start with a time; a table, JSON and Face Cap's text with a word or a bracket.
    let is_bare = first.is_some_and(|word| word.parse::<f64>().is_ok());
    let whole = if is_bare {
        Cow::Owned(format!("fabrig-keys 1\n{text}"))
    } else {
        Cow::Borrowed(text)
    };
    let inner = motion::parse(&whole, "text", &options).map_err(to_py)?;
    Ok(PyClip { inner })
}

/// A bundled take.
///
/// - `story`: "performance", twelve seconds of a face that shows what it can; or "contact", lips
///   that press and open, blinks, a face that is pressed, for `fabrig.demo_scene`
///
/// >>> fabrig.demo_take().duration
/// 12.0
#[pyfunction]
#[pyo3(signature = (*, story="performance"))]
pub(crate) fn demo_take(story: &str) -> PyResult<PyClip> {
    let texts = [
        ("performance", template::demo_take()),
        ("contact", template::demo_contact_take()),
    ];
    let text = one_of("story", story, &texts)?;
    let inner = motion::parse(text, "the bundled take", &ReadOptions::default()).map_err(to_py)?;
    Ok(PyClip { inner })
}
