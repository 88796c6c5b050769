//! What was exported.

use serde::Serialize;

use super::ExportFormat;

/// How far the weighted sum of morph targets is from the simulated skin.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LinearError {
    /// The take it was measured over.
    pub take: String,
    /// Frames of it.
    pub frames: usize,
    /// Root mean square over all vertices and frames. (mm)
    pub rms_mm: f64,
    /// Largest distance of a vertex in a frame. (mm)
    pub max_mm: f64,
    /// When that was. (s)
    pub max_at_secs: f64,
    /// Root mean square displacement of the simulated skin from rest, to compare. (mm)
    pub motion_rms_mm: f64,
}

/// How far the components of a baked glTF are from the frames they stand for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BasisError {
    /// Morph targets, the one that holds the mean included.
    pub components: usize,
    /// Root mean square over all vertices and frames. (mm)
    pub rms_mm: f64,
    /// Largest root mean square of a frame. (mm)
    pub worst_frame_rms_mm: f64,
    /// Largest distance of a vertex in a frame. (mm)
    pub max_mm: f64,
}

/// What an export wrote.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExportReport {
    /// Its format.
    pub format: ExportFormat,
    /// Files that were written.
    pub files: usize,
    /// Bytes of all of them.
    pub bytes: u64,
    /// Vertices of the user's mesh.
    pub vertices: usize,
    /// Vertices that the format needs for it: texture seams split them in glTF.
    pub written_vertices: usize,
    /// Polygons of the user's mesh.
    pub polygons: usize,
    /// Length of one unit of the file. (mm)
    pub millimetres_per_unit: f64,
    /// Names of the shapes that were written; none in point caches.
    pub shapes: Vec<String>,
    /// Shapes that move nothing on this face.
    pub still_shapes: Vec<String>,
    /// Names of materials.
    pub materials: Vec<String>,
    /// Frames of animation.
    pub frames: usize,
    /// Frames a second. (1/s)
    pub fps: Option<f64>,
    /// Duration of the animation. (s)
    pub seconds: f64,
    /// What the sum of morph targets costs against the simulation, if it was measured.
    pub linear: Option<LinearError>,
    /// What a reduced basis costs, if there is one.
    pub basis: Option<BasisError>,
    /// What a person should know.
    pub notes: Vec<String>,
    /// Everything, by the clock on the wall. (s)
    pub wall_secs: f64,
}
