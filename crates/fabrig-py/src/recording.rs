//! Recordings, read again.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;

use fabrig_core::recording::{RecordedFrame, RecordedSurface, RecordingReader};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::errors::{FabrigError, to_py};
use crate::render::{Shot, draw_frame};

/// A recording, frame by frame: iterating goes on from where it stands.
///
/// - `path`: the MCAP file
/// - `recover`: read a file that was cut short as far as it is whole
/// - `face`: which face, where it has several; its metadata tells their names as `faces`
///
/// >>> rig, clip = fabrig.rig(fabrig.demo_face()), fabrig.demo_take().between(0, 0.1)
/// >>> report = fabrig.animate(rig, clip, "out.mcap", fps=30)
/// >>> [round(frame.time, 3) for frame in fabrig.Recording("out.mcap")]
/// [0.0, 0.033, 0.067, 0.1]
#[pyclass(frozen, name = "Recording", module = "fabrig")]
pub(crate) struct PyRecording {
    reader: Mutex<RecordingReader>,
    metadata: BTreeMap<String, String>,
}

#[pymethods]
impl PyRecording {
    #[new]
    #[pyo3(signature = (path, *, recover=false, face=None))]
    fn new(py: Python<'_>, path: PathBuf, recover: bool, face: Option<&str>) -> PyResult<Self> {
        let reader = py.detach(|| match (recover, face) {
            (true, None) => RecordingReader::with_recovery(path),
            (true, Some(face)) => RecordingReader::face_with_recovery(path, face),
            (false, None) => RecordingReader::open(path),
            (false, Some(face)) => RecordingReader::open_face(path, face),
        });
        let reader = reader.map_err(to_py)?;
        Ok(Self {
            metadata: reader.metadata().clone(),
            reader: Mutex::new(reader),
        })
    }

    /// What the recording says of itself: `rig`, `template`, `fps`, `seed`, `version`, ...
    #[getter]
    fn metadata(&self) -> BTreeMap<String, String> {
        self.metadata.clone()
    }

    fn __iter__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<PyRecordedFrame>> {
        let frame = py.detach(|| {
            let mut reader = self.reader.lock().ok()?;
            Some(reader.next_frame())
        });
        let frame =
            frame.ok_or_else(|| FabrigError::new_err("the recording's reader broke off"))?;
        let frame = frame.map_err(to_py)?;
        Ok(frame.map(|inner| PyRecordedFrame { inner }))
    }

    fn __repr__(&self) -> String {
        let said = |key: &str| self.metadata.get(key).map_or("", String::as_str);
        format!("Recording(rig '{}', {} fps)", said("rig"), said("fps"))
    }
}

/// One instant of a recording.
#[pyclass(frozen, name = "RecordedFrame", module = "fabrig")]
pub(crate) struct PyRecordedFrame {
    inner: RecordedFrame,
}

#[pymethods]
impl PyRecordedFrame {
    /// Simulated time (s).
    #[getter]
    fn time(&self) -> f64 {
        self.inner.time_secs
    }

    /// From the head frame to the world (mm), shape (4, 4).
    #[getter]
    fn head<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_matrix(py, &self.inner.head.to_homogeneous())
    }

    /// Vertices by the name of their surface [mm, head frame]: `skin`, pieces such as `eye_l`,
    /// patches, colliders; arrays (N, 3).
    #[getter]
    fn surfaces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let surfaces = PyDict::new(py);
        for surface in self.all() {
            let positions = arrays::from_points(py, &surface.positions);
            surfaces.set_item(&surface.info.name, positions)?;
        }
        Ok(surfaces)
    }

    /// Triangles by the name of their surface, arrays (T, 3).
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let triangles = PyDict::new(py);
        for surface in self.all() {
            let of = arrays::from_triangles(py, &surface.info.triangles);
            triangles.set_item(&surface.info.name, of)?;
        }
        Ok(triangles)
    }

    /// Names of the surfaces that are patches of muscle and fat.
    #[getter]
    fn patch_names(&self) -> Vec<&str> {
        let patches = self.inner.patches.iter();
        patches.map(|patch| patch.info.name.as_str()).collect()
    }

    /// A picture: (size, size, 3) of bytes.
    ///
    /// - `view`, `size`, `edges`: as for `Rig.render`
    /// - `patches`: muscles and fat instead of the skin
    #[pyo3(signature = (*, view="front", size=512, patches=false, edges=false))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        view: &str,
        size: u32,
        patches: bool,
        edges: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        draw_frame(py, &self.inner, Shot::new(view, size, edges)?, patches)
    }

    fn __repr__(&self) -> String {
        format!(
            "RecordedFrame({:.3} s, {} surfaces)",
            self.inner.time_secs,
            self.all().count()
        )
    }
}

impl PyRecordedFrame {
    fn all(&self) -> impl Iterator<Item = &RecordedSurface> {
        let frame = &self.inner;
        let meshes = frame.skin.iter().chain(&frame.parts).chain(&frame.patches);
        meshes.chain(&frame.colliders).chain(&frame.contacts)
    }
}
