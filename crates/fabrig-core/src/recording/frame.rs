//! What a recording holds: its topics, what it is opened with, and one frame of it.

use nalgebra::{Isometry3, Point3};

use super::{ContactFrame, RecordingError};

/// Units of the messages per millimetre: they carry decimetres.
pub const UNITS_PER_MM: f64 = 0.01;

/// Rounding step of recorded positions in message units; a power of two leaves the low bits
/// of the mantissa zero. (dm)
pub(super) const POSITION_STEP: f64 = 1.0 / 8192.0;
/// Rounding step of recorded normals.
pub(super) const NORMAL_STEP: f32 = 1.0 / 64.0;

/// The topics.
pub mod topics {
    /// Head in rig, rig in world.
    pub const TF: &str = "/tf";
    /// The skin as a shaded mesh.
    pub const SKIN: &str = "/rig/skin";
    /// The patches of muscle and fat as shaded meshes.
    pub const PATCHES: &str = "/rig/patches";
    /// The patches again, coloured by their stretch; only where it is asked for.
    pub const STRAIN: &str = "/rig/strain";
    /// Eyeballs, teeth and tongue as shaded meshes.
    pub const PARTS: &str = "/rig/parts";
    /// Colliders as shaded meshes; only where there are any.
    pub const COLLIDERS: &str = "/colliders";
    /// Where things touch, as arrows; only where contact is on.
    pub const CONTACTS: &str = "/contacts";
    /// Skin vertices as points; shows in Rerun with no setup.
    pub const SKIN_POINTS: &str = "/points/skin";
    /// Patch nodes as points.
    pub const PATCH_POINTS: &str = "/points/patches";
    /// Where the muscle shapes want the patch nodes, as points; only where it is asked for.
    pub const MAGNETS: &str = "/points/magnets";
    /// One number per shape or muscle.
    pub const WEIGHTS: &str = "/weights";
    /// One number per energy, error or time.
    pub const STATS: &str = "/stats";
    /// Events in words.
    pub const LOG: &str = "/log";
}

/// A surface whose topology stays while its vertices move.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SurfaceInfo {
    /// Name, constant over the recording: `skin`, `zygomaticus_major_l`, `eye_l`.
    pub name: String,
    /// sRGB and opacity.
    pub color: [u8; 4],
    /// How many vertices it has.
    pub vertex_count: usize,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// sRGB and opacity of every vertex; empty where all have [`Self::color`].
    pub vertex_colors: Vec<[u8; 4]>,
}

/// What a recording is opened with: everything that does not change from frame to frame.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingInfo {
    /// Name of the face where a recording has several; empty where it has one. It goes before
    /// the names of topics and frames.
    pub face: String,
    /// Name of the rig.
    pub rig: String,
    /// Name and version of its template.
    pub template: String,
    /// Frames a second of simulation. (1/s)
    pub fps: f64,
    /// Seed of everything random.
    pub seed: u64,
    /// The skin.
    pub skin: SurfaceInfo,
    /// Patches; none is fine.
    pub patches: Vec<SurfaceInfo>,
    /// Eyeballs, teeth, tongue; none is fine.
    pub parts: Vec<SurfaceInfo>,
    /// Colliders of a scene with contact, none is fine; `None` for a scene without contact.
    pub colliders: Option<Vec<SurfaceInfo>>,
    /// Names of the weights, in the order of [`Frame::weights`].
    pub weight_names: Vec<String>,
    /// Weights that plots show at first, by name; some from all over the list where empty.
    pub plotted_weights: Vec<String>,
    /// Names of the statistics with their unit (`step_ms`), in the order of [`Frame::stats`].
    pub stat_names: Vec<String>,
    /// More for the metadata record, such as the take's name and the settings.
    pub extra: Vec<(String, String)>,
}

/// How often the large topics are written, and how the file is cut.
///
/// A rate is a wish: every n-th frame is written, n chosen so that the rate is not exceeded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordingOptions {
    /// Rate of the skin and parts meshes, 0 for none. (1/s)
    pub skin_hz: f64,
    /// Rate of the patch meshes, 0 for none. (1/s)
    pub patches_hz: f64,
    /// Rate of both point clouds, 0 for none. (1/s)
    pub points_hz: f64,
    /// Rate of the patches coloured by [`Frame::strains`], 0 for none. (1/s)
    pub strain_hz: f64,
    /// Rate of the points that the patches are drawn to ([`Frame::magnets`]), 0 for none. (1/s)
    pub magnets_hz: f64,
    /// Whether colliders are written, where there are any.
    pub colliders: bool,
    /// Whether arrows are written where things touch.
    pub contacts: bool,
    /// Whether the weights of the shapes are written.
    pub weights: bool,
    /// Whether the cloth's energies are among the statistics.
    pub energies: bool,
    /// Whether the distances from the muscle shapes are among the statistics.
    pub errors: bool,
    /// Whether times are among the statistics: then equal inputs no longer give equal bytes.
    pub timings: bool,
    /// Size at which a chunk is closed; what does not change from frame to frame is stored
    /// once a chunk. (bytes before compression)
    pub chunk_bytes: u64,
    /// Simulated time after which what is written is made safe against a crash. (s)
    pub flush_secs: f64,
}

impl Default for RecordingOptions {
    fn default() -> Self {
        Self {
            skin_hz: 30.0,
            patches_hz: 30.0,
            points_hz: 10.0,
            strain_hz: 0.0,
            magnets_hz: 0.0,
            colliders: true,
            contacts: true,
            weights: true,
            energies: true,
            errors: true,
            timings: false,
            chunk_bytes: 64 << 20,
            flush_secs: 0.5,
        }
    }
}

/// How bad an event is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogLevel {
    /// For information.
    Info,
    /// Something to look at.
    Warning,
    /// Something failed.
    Error,
}

/// Something that happened, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogEvent {
    /// How bad it is.
    pub level: LogLevel,
    /// What happened.
    pub message: String,
}

/// One instant, borrowed from whoever computed it.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// Skin vertices in the head frame. (mm)
    pub skin: &'a [Point3<f32>],
    /// Nodes of every patch in the head frame. (mm)
    pub patches: &'a [&'a [Point3<f32>]],
    /// Vertices of every part in the head frame. (mm)
    pub parts: &'a [&'a [Point3<f32>]],
    /// Where the muscle shapes want the nodes of every patch. (mm) Only read where
    /// [`RecordingOptions::magnets_hz`] asks for it; may be empty otherwise.
    pub magnets: &'a [&'a [Point3<f32>]],
    /// Stretch of every node of every patch: 0 at rest, 0.1 for a tenth longer. Only read where
    /// [`RecordingOptions::strain_hz`] asks for it; may be empty otherwise.
    pub strains: &'a [&'a [f32]],
    /// Contact; only where [`RecordingInfo::colliders`] announces it.
    pub contact: Option<ContactFrame<'a>>,
    /// Where the head is: head frame to a fixed frame with +Y up. (mm)
    pub head: Isometry3<f64>,
    /// One per [`RecordingInfo::weight_names`].
    pub weights: &'a [f32],
    /// One per [`RecordingInfo::stat_names`].
    pub stats: &'a [f64],
    /// What happened since the last frame.
    pub events: &'a [LogEvent],
}

/// What was written on one topic.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct TopicReport {
    /// The topic.
    pub topic: String,
    /// How many messages.
    pub messages: u64,
    /// Their size before compression.
    pub raw_bytes: u64,
}

/// What a finished recording holds.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RecordingReport {
    /// Size of the file.
    pub bytes: u64,
    /// Frames recorded.
    pub frames: u64,
    /// Simulated time. (s)
    pub duration_secs: f64,
    /// Largest error of a recorded coordinate: they are rounded. (um)
    pub position_error_um: f64,
    /// Largest error of a component of a recorded unit normal.
    pub normal_error: f64,
    /// Topics that have messages.
    pub topics: Vec<TopicReport>,
}

/// Whether one of several faces in a recording may be called so: its name goes into topics.
pub(crate) fn is_name_of_several(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    !name.is_empty() && name.chars().all(is_plain)
}

impl RecordingInfo {
    /// Refuses what no viewer could show.
    pub(super) fn check(&self) -> Result<(), RecordingError> {
        let refuse = |reason: String| Err(RecordingError::Info { reason });
        if !self.face.is_empty() && !is_name_of_several(&self.face) {
            return refuse(format!(
                "`{}` cannot be a face's name in a recording: it goes into topics, so it may have \
                 letters from a to z, digits and any of _ - . alone",
                self.face
            ));
        }
        if !(self.fps.is_finite() && self.fps > 0.0 && self.fps <= 1e6) {
            return refuse(format!("{} frames a second is not a frame rate", self.fps));
        }
        let surfaces = std::iter::once(&self.skin)
            .chain(&self.patches)
            .chain(&self.parts)
            .chain(self.colliders.iter().flatten());
        for surface in surfaces {
            let count = surface.vertex_count;
            let colors = surface.vertex_colors.len();
            if colors != 0 && colors != count {
                return refuse(format!(
                    "`{}` has {colors} colours for {count} vertices",
                    surface.name
                ));
            }
            for (i, t) in surface.triangles.iter().enumerate() {
                if let Some(v) = t.iter().find(|&&v| v as usize >= count) {
                    return refuse(format!(
                        "triangle {i} of `{}` references vertex {v} of {count}",
                        surface.name
                    ));
                }
            }
        }
        let none = Vec::new();
        let colliders = self.colliders.as_ref().unwrap_or(&none);
        for (what, list) in [
            ("patches", &self.patches),
            ("parts", &self.parts),
            ("colliders", colliders),
        ] {
            let mut names: Vec<&str> = list.iter().map(|s| s.name.as_str()).collect();
            names.sort_unstable();
            if let Some(pair) = names.windows(2).find(|w| w[0] == w[1]) {
                return refuse(format!("two {what} are called `{}`", pair[0]));
            }
        }
        let is_unknown = |name: &&String| !self.weight_names.contains(name);
        if let Some(name) = self.plotted_weights.iter().find(is_unknown) {
            return refuse(format!("`{name}` is to be plotted, but is no weight"));
        }
        for (what, names) in [("weight", &self.weight_names), ("stat", &self.stat_names)] {
            let mut fields: Vec<String> = names.iter().map(|n| field_name(n)).collect();
            fields.sort_unstable();
            if let Some(pair) = fields.windows(2).find(|w| w[0] == w[1]) {
                return refuse(format!("two {what} names become the field `{}`", pair[0]));
            }
        }
        Ok(())
    }

    /// One of [`topics`] as the recording calls it: with the face's name before it.
    pub fn topic(&self, topic: &str) -> String {
        if self.face.is_empty() {
            topic.to_owned()
        } else {
            format!("/{}{topic}", self.face)
        }
    }

    /// Time from frame to frame. Rounded up: viewers warn of a topic when its message count
    /// over the duration exceeds 60 a second. (ns)
    pub(super) fn step_nanos(&self) -> u64 {
        (1e9 / self.fps).ceil() as u64
    }
}

/// A name as a protobuf field: letters, digits and underscores, not starting with a digit.
pub(super) fn field_name(name: &str) -> String {
    let mut field: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    if !field.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        field.insert(0, '_');
    }
    field
}

/// Every n-th frame keeps a topic at or below its rate; `None` for a topic that is off.
pub(super) fn stride(fps: f64, hz: f64) -> Option<u64> {
    // A frame rate of 29.97 is within a rate of 30, and 60.0001 is twice it.
    (hz > 0.0).then(|| ((fps / hz - 1e-3).ceil() as u64).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_not_exceeded() {
        assert_eq!(stride(60.0, 30.0), Some(2));
        assert_eq!(stride(29.97, 30.0), Some(1));
        assert_eq!(stride(120.0, 30.0), Some(4));
        assert_eq!(stride(100.0, 30.0), Some(4));
        assert_eq!(stride(24.0, 0.0), None);
    }

    #[test]
    fn names_become_fields() {
        assert_eq!(field_name("jawOpen"), "jawOpen");
        assert_eq!(field_name("p95 (ms)"), "p95__ms_");
        assert_eq!(field_name("3d"), "_3d");
    }
}
