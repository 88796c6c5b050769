//! What a manifest says of one face, take, scene or output. The same types are the text of the
//! manifest, with wildcards and paths from its folder, and what a job is told, one file each.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::export::LengthUnit;
use crate::motion::{Adjustment, ReadOptions, TakeFormat};
use crate::recording::RecordingOptions;
use crate::registration::{CutSeams, LandmarkOrder};
use crate::scene::RecordingChoice;
use crate::transfer::{AlphaMode, OffsetMode};

/// Length of one unit of a mesh or an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Inches.
    In,
}

impl Unit {
    /// Its length. (mm)
    pub(super) fn millimetres(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1000.0,
            Self::In => 25.4,
        }
    }
}

impl From<Unit> for LengthUnit {
    fn from(unit: Unit) -> Self {
        match unit {
            Unit::Mm => Self::Millimetre,
            Unit::Cm => Self::Centimetre,
            Unit::M => Self::Metre,
            Unit::In => Self::Inch,
        }
    }
}

/// What can be cut apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Seam {
    /// The lips.
    Mouth,
    /// The lids of both eyes.
    Eyes,
}

/// What a face's own shapes are good for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Alpha {
    /// One amplitude a patch.
    Patch,
    /// One a patch and shape.
    Shape,
    /// Linear maps.
    Map,
    /// They are taken as they are.
    Own,
}

impl From<Alpha> for AlphaMode {
    fn from(alpha: Alpha) -> Self {
        match alpha {
            Alpha::Patch => Self::Patch,
            Alpha::Shape => Self::PatchAndShape,
            Alpha::Map => Self::Map,
            Alpha::Own => Self::Own,
        }
    }
}

/// How displacements are put on a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Offsets {
    /// As they are, times the size of each patch.
    Global,
    /// Turned and stretched with the skin around.
    Frame,
    /// Deformation transfer.
    Transfer,
}

impl From<Offsets> for OffsetMode {
    fn from(offsets: Offsets) -> Self {
        match offsets {
            Offsets::Global => Self::Global,
            Offsets::Frame => Self::Frame,
            Offsets::Transfer => Self::DeformationTransfer,
        }
    }
}

/// Order of landmarks without names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// 68 points of iBUG 300-W.
    Ibug68,
    /// 468 or 478 points of MediaPipe.
    MediaPipe,
}

impl From<Order> for LandmarkOrder {
    fn from(order: Order) -> Self {
        match order {
            Order::Ibug68 => Self::Ibug68,
            Order::MediaPipe => Self::MediaPipe,
        }
    }
}

/// A face: a mesh to rig, or a rig that is there (`.fabrig`).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FaceEntry {
    /// The mesh or rig; in a manifest it may have wildcards.
    pub file: PathBuf,
    /// Its name in outputs; that of the file when empty.
    pub name: String,
    /// Landmarks, as `fabrig rig --landmarks` takes them; `{face}` stands for the name.
    pub landmarks: Option<PathBuf>,
    /// Order of landmarks without names.
    pub landmarks_order: Option<Order>,
    /// Edits, which go beside the rig; `{face}` stands for the name.
    pub edits: Option<PathBuf>,
    /// The face's own expressions; `{face}` stands for the name.
    pub shapes: Option<PathBuf>,
    /// What is made of them.
    pub alpha: Option<Alpha>,
    /// How the template's displacements are put on the face.
    pub offsets: Option<Offsets>,
    /// Folder of a template of one's own.
    pub template: Option<PathBuf>,
    /// Unit of the mesh.
    pub unit: Option<Unit>,
    /// Fused lips or lids to cut apart.
    pub cut_seams: Vec<Seam>,
}

impl FaceEntry {
    /// Whether it is a rig already.
    pub fn is_rig(&self) -> bool {
        is_a(&self.file, "fabrig")
    }

    pub(super) fn seams(&self) -> CutSeams {
        CutSeams {
            mouth: self.cut_seams.contains(&Seam::Mouth),
            eyes: self.cut_seams.contains(&Seam::Eyes),
        }
    }

    /// What of it matters beside the content of its files.
    pub(super) fn settings(&self) -> Self {
        Self {
            file: extension_of(&self.file),
            name: String::new(),
            landmarks: self.landmarks.as_deref().map(extension_of),
            edits: None,
            shapes: self.shapes.as_ref().map(|_| PathBuf::new()),
            template: self.template.as_ref().map(|_| PathBuf::new()),
            ..self.clone()
        }
    }
}

/// A take, or a part of one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TakeEntry {
    /// The file; in a manifest it may have wildcards.
    pub file: PathBuf,
    /// Its name in outputs; that of the file when empty.
    pub name: String,
    /// Where the part begins, on the take's own time axis. (s)
    pub from: Option<f64>,
    /// Where it ends. (s)
    pub to: Option<f64>,
    /// What wrote it; found from its content when not said.
    pub format: Option<TakeFormat>,
    /// Frames a second of a take that has frame numbers or no times. (1/s)
    pub fps: Option<f64>,
    /// Times are milliseconds where seconds are usual.
    pub milliseconds: bool,
    /// Pass over columns that are not known.
    pub ignore_unknown_columns: bool,
    /// Clamp weights outside [0, 1].
    pub clamp_weights: bool,
    /// From when to when the performer's face is at rest, which is taken off. (s)
    pub calibrate_neutral: Option<[f64; 2]>,
    /// Factors of weights by shape; `all` for every shape.
    pub gain: BTreeMap<String, f64>,
    /// Exchange left and right.
    pub swap_sides: bool,
    /// Leave `mouthClose` as it is where it exceeds `jawOpen`.
    pub keep_mouth_close: bool,
    /// Bring the take to so many frames a second first. (1/s)
    pub resample: Option<f64>,
}

impl TakeEntry {
    pub(super) fn read_options(&self) -> ReadOptions {
        let gains = self.gain.iter().map(|(name, gain)| (name.clone(), *gain));
        ReadOptions {
            format: self.format,
            frame_rate: self.fps,
            times_in_milliseconds: self.milliseconds,
            ignore_unknown_columns: self.ignore_unknown_columns,
            clamp_weights: self.clamp_weights,
            adjust: Adjustment {
                swap_sides: self.swap_sides,
                neutral: self.calibrate_neutral,
                gains: gains.collect(),
                limit_mouth_close: !self.keep_mouth_close,
            },
            ..ReadOptions::default()
        }
    }

    /// What of it matters beside the content of its file.
    pub(super) fn settings(&self) -> Self {
        Self {
            file: extension_of(&self.file),
            name: String::new(),
            ..self.clone()
        }
    }
}

/// What is modelled.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneEntry {
    /// A scene file; the default scene when empty. In a manifest it may have wildcards.
    pub file: PathBuf,
    /// Its name in outputs; that of the file when empty, `default` without one.
    pub name: String,
    /// Frames a second of the simulation; the scene file's or else the take's own when not said.
    /// (1/s)
    pub fps: Option<f64>,
    /// Substeps of the cloth per 1/60 s, before what the file says.
    pub substeps: Option<u32>,
    /// Leave the cloth out.
    pub without_dynamics: bool,
}

impl SceneEntry {
    /// Whether it has a file.
    pub(super) fn has_file(&self) -> bool {
        !self.file.as_os_str().is_empty()
    }

    /// What of it matters beside the content of its file.
    pub(super) fn settings(&self) -> Self {
        Self {
            file: PathBuf::new(),
            name: String::new(),
            ..self.clone()
        }
    }
}

/// What an output holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Content {
    /// A recording of the simulation, as `fabrig animate` makes it.
    Recording,
    /// The rig with its shapes, or a take on it, as `fabrig export` makes it.
    Export,
    /// Simulated skin for learning: [`crate::batch`] says what is in it.
    Dataset,
}

/// A file per face, or per face, take and scene.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutputEntry {
    /// Where it goes: `{face}/{take}.mcap`.
    pub path: String,
    /// What `{format}` stands for, one output each.
    pub formats: Vec<String>,
    /// What it holds; by its extension when not said.
    pub content: Option<Content>,
    /// Of a dataset: where the topology of each face goes.
    pub topology: String,
    /// Of an export: simulate the take and write every frame's vertices.
    pub baked: bool,
    /// Of an export: leave the cloth out of the shapes.
    pub without_dynamics: bool,
    /// Of an export: compare the sum of the shapes with the simulation.
    pub check: bool,
    /// Of an export: leave head motion out.
    pub still_head: bool,
    /// Of an export: its unit of length.
    pub unit: Option<Unit>,
    /// Of a baked glTF: error of its morph targets. (mm)
    pub tolerance: Option<f64>,
    /// Of a recording: skin meshes per second. (1/s)
    pub skin_hz: Option<f64>,
    /// Of a recording: patch meshes per second. (1/s)
    pub patches_hz: Option<f64>,
    /// Of a recording: point clouds per second. (1/s)
    pub points_hz: Option<f64>,
    /// Of a recording: patch meshes coloured by their stretch per second. (1/s)
    pub strain_hz: Option<f64>,
}

/// Where the topology of a face goes when a dataset does not say it.
pub(super) const DEFAULT_TOPOLOGY: &str = "{face}.face.npz";

impl OutputEntry {
    /// What it holds.
    pub fn content(&self) -> Content {
        self.content.unwrap_or_else(|| {
            if is_a(Path::new(&self.path), "mcap") {
                Content::Recording
            } else {
                Content::Export
            }
        })
    }

    /// What is written how often: as it says, or else the scene.
    pub(super) fn recording(&self, of_scene: &RecordingChoice) -> RecordingOptions {
        let own = RecordingChoice {
            record: None,
            skin_hz: self.skin_hz,
            patches_hz: self.patches_hz,
            points_hz: self.points_hz,
            strain_hz: self.strain_hz,
        };
        own.or(of_scene).options()
    }

    /// What of it matters for one file.
    pub(super) fn settings(&self) -> Self {
        Self {
            path: extension_of(Path::new(&self.path)).display().to_string(),
            formats: Vec::new(),
            topology: String::new(),
            ..self.clone()
        }
    }
}

/// Which faces go with which takes and scenes: all of those that the names fit, with each other.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PairEntry {
    /// Names of faces, with wildcards; all when empty.
    pub faces: Vec<String>,
    /// Names of takes, with wildcards; all when empty.
    pub takes: Vec<String>,
    /// Names of scenes, with wildcards; all when empty.
    pub scenes: Vec<String>,
}

pub(super) fn is_a(path: &Path, extension: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

fn extension_of(path: &Path) -> PathBuf {
    PathBuf::from(path.extension().unwrap_or_default())
}
