//! What is drawn and told of files.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use fabrig_core::render::Framing;

/// A part of a face that a picture is framed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Zoom {
    /// Everything there is
    All,
    /// From the hairline to the chin of an open jaw
    Face,
    /// From the wings of the nose to the chin
    Mouth,
    /// Brows to cheekbones
    Eyes,
    /// The left eye
    Eye,
    /// Brows to hairline
    Forehead,
    /// The outer corner of the left eye
    EyeCorner,
}

impl From<Zoom> for Framing {
    fn from(zoom: Zoom) -> Self {
        match zoom {
            Zoom::All => Self::All,
            Zoom::Face => Self::Face,
            Zoom::Mouth => Self::Mouth,
            Zoom::Eyes => Self::Eyes,
            Zoom::Eye => Self::Eye,
            Zoom::Forehead => Self::Forehead,
            Zoom::EyeCorner => Self::EyeCorner,
        }
    }
}

/// A sheet of expressions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExpressionSheet {
    /// How far a face goes
    Motion,
    /// Six emotions, contempt and five mouth shapes of speech
    Emotions,
}

impl ExpressionSheet {
    /// Its name in `expressions.toml`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Motion => "motion",
            Self::Emotions => "emotions",
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    /// Mesh, rig (.fabrig), recording (.mcap) or folder of a template; `demo` and `template` are
    /// the bundled ones; several rigs are drawn row by row
    #[arg(required = true)]
    pub(crate) input: Vec<PathBuf>,
    /// PNG, or GIF for a recording
    #[arg(short, long, value_name = "OUT.png")]
    pub(crate) output: PathBuf,
    /// Views side by side: front, three-quarter, side, back, top, below or YAW,PITCH in degrees
    #[arg(long, value_name = "VIEW", default_value = "front", num_args = 1..)]
    pub(crate) view: Vec<String>,
    /// Size of each picture in pixels
    #[arg(long, default_value_t = 640, value_parser = clap::value_parser!(u32).range(16..=8192))]
    pub(crate) size: u32,
    /// Show muscles and fat instead of the skin
    #[arg(long)]
    pub(crate) patches: bool,
    /// Write the name of each patch beside it
    #[arg(long, requires = "patches")]
    pub(crate) names: bool,
    /// Show polygon edges
    #[arg(long)]
    pub(crate) edges: bool,
    /// Pose of a rig, held until still: SHAPE=WEIGHT,...; each one is a row
    #[arg(long, value_name = "POSE", conflicts_with = "expressions")]
    pub(crate) pose: Vec<String>,
    /// A sheet of twelve expressions of a rig, closer on the face: how far it goes, or emotions
    /// and speech (templates/human/expressions.toml)
    #[arg(long, value_enum, value_name = "SHEET", num_args = 0..=1, default_missing_value = "motion")]
    pub(crate) expressions: Option<ExpressionSheet>,
    /// A sheet of every shape of a rig at weight 1, one tile each
    #[arg(long, conflicts_with_all = ["expressions", "pose"])]
    pub(crate) all_shapes: bool,
    /// Skin and fat of a rig that are not its own, with commas between: looser_skin, firmer_skin,
    /// more_fat, less_fat, aged
    #[arg(long, value_name = "PRESET", value_delimiter = ',')]
    pub(crate) preset: Vec<String>,
    /// What of a rig or the template fills the picture; sheets show the face, anything else all
    #[arg(long, value_enum)]
    pub(crate) zoom: Option<Zoom>,
    /// Time of the frame of a recording, in seconds
    #[arg(long, value_name = "SECS")]
    pub(crate) time: Option<f64>,
    /// Frames per second of a GIF
    #[arg(long, default_value_t = 15.0)]
    pub(crate) fps: f64,
}

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// Mesh, rig, take or recording
    pub(crate) file: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
