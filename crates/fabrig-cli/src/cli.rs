//! The command line as types.

mod batch;
mod export;

pub(crate) use batch::{BatchArgs, BenchBatchArgs, BenchOutput};
pub(crate) use export::{ConvertArgs, ExportArgs, LayoutArgs, Target};

use fabrig_core::transfer::{AlphaMode, OffsetMode};
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use fabrig_core::evaluation::{CheckGates, GATES};
use fabrig_core::motion::TakeFormat;
use fabrig_core::recording::RecordingOptions;
use fabrig_core::render::Framing;

/// Rigs any 3D face, animates it from performance capture, records it to MCAP.
#[derive(Debug, Parser)]
#[command(name = "fabrig", version, about, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Make a rig from a neutral face mesh
    Rig(RigArgs),
    /// Drive a rig by a take and record it
    Animate(AnimateArgs),
    /// Rig and animate the bundled face with the bundled take
    Demo(DemoArgs),
    /// Say whether every shape of a rig does on its face what it should; exit code 3 where not
    Check(CheckArgs),
    /// Write a rig with its 52 shapes, or a take on it, for other programs: glTF, USD, OBJ,
    /// NumPy, point caches
    Export(ExportArgs),
    /// Write a recording for other programs
    Convert(ConvertArgs),
    /// Many faces times many takes, as a manifest says; does only what is missing or changed; exit
    /// code 3 where something could not be made
    Batch(BatchArgs),
    /// Fit the shapes of a rig to markers or an animated mesh, and write the take
    Retarget(RetargetArgs),
    /// Look at and change single muscles of a rig
    #[command(subcommand)]
    Edit(EditCommand),
    /// Draw a mesh, a rig or a recording to PNG or GIF
    Render(RenderArgs),
    /// Say what is in a mesh, a rig, a take or a recording
    Info(InfoArgs),
    /// Build or check a template pack
    #[command(subcommand)]
    Template(TemplateCommand),
    /// Measure
    #[command(subcommand)]
    Bench(BenchCommand),
}

/// Length of one unit of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Unit {
    /// Millimetres
    Mm,
    /// Centimetres
    Cm,
    /// Metres
    M,
    /// Inches
    In,
}

impl Unit {
    /// Its length. (mm)
    pub(crate) fn millimetres(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1000.0,
            Self::In => 25.4,
        }
    }
}

/// Order of a detector's points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Order {
    /// 68 points of iBUG 300-W and dlib
    Ibug68,
    /// 468 or 478 points of MediaPipe
    Mediapipe,
}

/// What can be cut apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Seam {
    /// The lips
    Mouth,
    /// The lids of both eyes
    Eyes,
}

#[derive(Debug, Args)]
pub(crate) struct RigArgs {
    /// Neutral face or head: OBJ, PLY, STL or glTF
    pub(crate) face: PathBuf,
    /// Where to write the rig
    #[arg(short, long, value_name = "FACE.fabrig")]
    pub(crate) output: PathBuf,
    /// Landmarks in the mesh's own units: a JSON of name to [x, y, z], or points as a detector
    /// gives them (JSON array, CSV or .pts)
    #[arg(long, value_name = "FILE")]
    pub(crate) landmarks: Option<PathBuf>,
    /// Order of points without names [default: by their count]
    #[arg(long, value_enum, value_name = "ORDER", requires = "landmarks")]
    pub(crate) landmarks_order: Option<Order>,
    /// Folder of a template of your own, as `fabrig template build` makes it [default: the
    /// bundled one]
    #[arg(long, value_name = "FOLDER")]
    pub(crate) template: Option<PathBuf>,
    /// Unit of the mesh; without it the face is scaled by the distance of its eyes
    #[arg(long, value_enum)]
    pub(crate) unit: Option<Unit>,
    /// Cut lips or lids apart that are one fused surface; what is new follows the mesh's vertices
    #[arg(long, value_enum, value_name = "OPENING", value_delimiter = ',')]
    pub(crate) cut_seams: Vec<Seam>,
    /// The face's own expressions, named as ARKit's shapes, to fit the muscles' amplitudes to: a
    /// folder of meshes in the face's vertex order, or the morph targets of the face's own glTF
    #[arg(long, value_name = "FOLDER|FACE.glb")]
    pub(crate) shapes: Option<PathBuf>,
    /// What is made of them: amplitudes are fitted, or more
    #[arg(
        long,
        value_enum,
        value_name = "MODE",
        default_value = "own",
        requires = "shapes"
    )]
    pub(crate) alpha: Alpha,
    /// How the template's displacements are put on the face [default: the best on other faces]
    #[arg(long, value_enum, value_name = "MODE")]
    pub(crate) offsets: Option<Offsets>,
    /// Also write the mesh that the rig moves: the face with its cuts, in its own units
    #[arg(long, value_name = "OUT.obj")]
    pub(crate) skin: Option<PathBuf>,
    /// Also write the face in the template's topology, in millimetres
    #[arg(long, value_name = "OUT.obj")]
    pub(crate) normalized: Option<PathBuf>,
    /// Also write the report with pictures: input, fitted template, error in colour
    #[arg(long, value_name = "OUT.html|OUT.png")]
    pub(crate) report: Option<PathBuf>,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// How many amplitudes there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Alpha {
    /// One a patch
    Patch,
    /// One a patch and shape
    Shape,
    /// Which way too: a linear map, smooth over the skin
    Map,
    /// They are taken as they are, and shapes that are missing are mapped
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Offsets {
    /// As they are, times the size of each patch
    Global,
    /// Turned and stretched with the skin around
    Frame,
    /// Deformation transfer: by what a shape does to every triangle
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

/// What wrote a take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MotionFormat {
    /// Keyed text
    Keys,
    /// A table of ARKit's shapes: Live Link Face and others
    Arkit,
    /// OpenFace's CSV
    OpenFace,
    /// py-feat's CSV
    PyFeat,
    /// Face Cap's text
    FaceCap,
    /// MediaPipe's blendshapes, JSON or CSV
    MediaPipe,
}

impl From<MotionFormat> for TakeFormat {
    fn from(format: MotionFormat) -> Self {
        match format {
            MotionFormat::Keys => Self::Keys,
            MotionFormat::Arkit => Self::Arkit,
            MotionFormat::OpenFace => Self::OpenFace,
            MotionFormat::PyFeat => Self::PyFeat,
            MotionFormat::FaceCap => Self::FaceCap,
            MotionFormat::MediaPipe => Self::MediaPipe,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct TakeArgs {
    /// What wrote the take [default: found from its content]
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub(crate) motion_format: Option<MotionFormat>,
    /// Frames per second of a take that has frame numbers or no times
    #[arg(long, value_name = "FPS")]
    pub(crate) motion_fps: Option<f64>,
    /// Times of the take are milliseconds where seconds are usual
    #[arg(long)]
    pub(crate) motion_milliseconds: bool,
    /// Pass over columns of the take that are not known
    #[arg(long)]
    pub(crate) ignore_unknown_columns: bool,
    /// Clamp weights of the take that are outside [0, 1]
    #[arg(long)]
    pub(crate) clamp_weights: bool,
    /// Take the performer's neutral face off: its median over the first SECS, or FROM..TO
    #[arg(
        long,
        value_name = "SECS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "1",
        value_parser = parse_stretch
    )]
    pub(crate) calibrate_neutral: Option<[f64; 2]>,
    /// Multiply the weights of a shape: SHAPE=FACTOR; `all` for every shape; may be repeated
    #[arg(long, value_name = "SHAPE=FACTOR", value_parser = parse_gain)]
    pub(crate) gain: Vec<(String, f64)>,
    /// Exchange left and right
    #[arg(long)]
    pub(crate) swap_sides: bool,
    /// Leave `mouthClose` as it is where it exceeds `jawOpen`
    #[arg(long)]
    pub(crate) keep_mouth_close: bool,
    /// Bring the take to this many frames per second first, 1 to 240
    #[arg(long, value_name = "FPS")]
    pub(crate) resample: Option<f64>,
}

#[derive(Debug, Args)]
pub(crate) struct SceneArgs {
    /// Frames per second of the simulation [default: the take's]
    #[arg(long)]
    pub(crate) fps: Option<f64>,
    /// Substeps of the cloth per 1/60 s [default: the solver's]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) substeps: Option<u32>,
    /// Gravity in mm/s^2, world axes, +Y up [default: 0,-9810,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub(crate) gravity: Option<[f32; 3]>,
    /// Wind in mm/s, world axes, added to the take's own
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub(crate) wind: Option<[f32; 3]>,
    /// Leave the cloth out: patches stand where the muscle shapes want them
    #[arg(long)]
    pub(crate) without_dynamics: bool,
    /// What is modelled, as TOML: `docs/scenes.md`; what else is given here goes before it
    #[arg(long = "scene", value_name = "SCENE.toml")]
    pub(crate) file: Option<PathBuf>,
    /// Which patches collide [default: none]
    #[arg(long, value_enum)]
    pub(crate) contact: Option<ContactPairs>,
    /// Things that the face can touch: a TOML file of `colliders` tables
    #[arg(long, value_name = "COLLIDERS.toml")]
    pub(crate) colliders: Option<PathBuf>,
    /// Let lips stick to each other
    #[arg(long)]
    pub(crate) sticky_lips: bool,
}

#[derive(Debug, Args)]
pub(crate) struct RecordingArgs {
    /// Skin meshes per second in the recording, 0 for none
    #[arg(long, default_value_t = RecordingOptions::default().skin_hz, value_parser = parse_rate)]
    pub(crate) skin_hz: f64,
    /// Patch meshes per second in the recording, 0 for none
    #[arg(long, default_value_t = RecordingOptions::default().patches_hz, value_parser = parse_rate)]
    pub(crate) patches_hz: f64,
    /// Point clouds per second in the recording, 0 for none
    #[arg(long, default_value_t = RecordingOptions::default().points_hz, value_parser = parse_rate)]
    pub(crate) points_hz: f64,
    /// Patch meshes coloured by their stretch per second in the recording, 0 for none
    #[arg(long, default_value_t = RecordingOptions::default().strain_hz, value_parser = parse_rate)]
    pub(crate) strain_hz: f64,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Which patches collide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ContactPairs {
    /// None
    None,
    /// Ring muscles with themselves: lips, and lids with eyeballs
    Sphincter,
    /// All that are not attached to each other
    All,
}

impl RecordingArgs {
    /// How often what is written.
    pub(crate) fn options(&self) -> RecordingOptions {
        RecordingOptions {
            skin_hz: self.skin_hz,
            patches_hz: self.patches_hz,
            points_hz: self.points_hz,
            strain_hz: self.strain_hz,
            ..RecordingOptions::default()
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct AnimateArgs {
    /// Rig, as `fabrig rig` makes it
    pub(crate) rig: PathBuf,
    /// Live Link Face, ARKit, OpenFace, py-feat or MediaPipe CSV, MediaPipe JSON, Face Cap text
    /// or keyed text
    #[arg(long, value_name = "TAKE")]
    pub(crate) motion: PathBuf,
    /// Where to write the recording
    #[arg(short, long, value_name = "OUT.mcap")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) take: TakeArgs,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) recording: RecordingArgs,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Rig, as `fabrig rig` makes it; edits beside it are applied
    pub(crate) rig: PathBuf,
    /// Folder of the template that it was made with [default: the bundled one]
    #[arg(long, value_name = "FOLDER")]
    pub(crate) template: Option<PathBuf>,
    /// Hold each shape by the cloth, with contact of lips and lids, instead of looking at it as
    /// the muscles have it
    #[arg(long)]
    pub(crate) contact: bool,
    /// Limit of a gate, as listed in `docs/check.md`; may be repeated
    #[arg(long, value_name = "GATE=LIMIT", value_parser = parse_gate)]
    pub(crate) gate: Vec<(String, f64)>,
    /// Also write one page with pictures of every shape
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct RetargetArgs {
    /// Markers as C3D or TRC; or the rig's own mesh in motion: a folder of OBJ files, or .npy
    /// with shape (frames, vertices, 3)
    pub(crate) source: PathBuf,
    /// Rig of the face that the source shows
    #[arg(long, value_name = "FACE.fabrig")]
    pub(crate) rig: PathBuf,
    /// Where to write the take, a CSV of ARKit's shapes
    #[arg(short, long, value_name = "TAKE.csv")]
    pub(crate) output: PathBuf,
    /// Fit FACS action units instead of the shapes one by one: numbers with commas between
    #[arg(long, value_name = "1,2,4,...", value_delimiter = ',')]
    pub(crate) units: Vec<u32>,
    /// When the markers' face is neutral: the first SECS, or FROM..TO
    #[arg(long, value_name = "SECS", default_value = "0.2", value_parser = parse_stretch)]
    pub(crate) neutral: [f64; 2],
    /// JSON of marker name to the name of the landmark it stands at, three or more
    #[arg(long, value_name = "JSON")]
    pub(crate) places: Option<PathBuf>,
    /// Frames per second of an animated mesh
    #[arg(long, value_name = "FPS", default_value_t = 30.0)]
    pub(crate) source_fps: f64,
    /// The source is without head motion
    #[arg(long)]
    pub(crate) still_head: bool,
    /// Noise of the source's coordinates in mm: more is smoother [default: 0.5 for markers,
    /// 0.01 for a mesh]
    #[arg(long, value_name = "MM")]
    pub(crate) noise: Option<f64>,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum EditCommand {
    /// Names of the muscle shapes, and what FACE.edits.toml changes
    List {
        /// Rig, as `fabrig rig` makes it
        rig: PathBuf,
        /// Print as JSON
        #[arg(long)]
        json: bool,
    },
    /// Write one muscle shape as a mesh in millimetres
    Export {
        /// Rig, as `fabrig rig` makes it
        rig: PathBuf,
        /// Muscle shape, such as zygomaticus_major_l.mouthSmileLeft
        shape: String,
        /// Where to write it
        #[arg(short, long, value_name = "SHAPE.obj")]
        output: PathBuf,
    },
    /// Take a changed mesh of a muscle shape into FACE.edits.toml
    Import {
        /// Rig, as `fabrig rig` makes it
        rig: PathBuf,
        /// Muscle shape, such as zygomaticus_major_l.mouthSmileLeft
        shape: String,
        /// The mesh, vertices as they were exported
        mesh: PathBuf,
    },
}

#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Where to write the recording
    #[arg(short, long, value_name = "OUT.mcap", default_value = "demo.mcap")]
    pub(crate) output: PathBuf,
    /// Also keep the rig
    #[arg(long, value_name = "FACE.fabrig")]
    pub(crate) rig: Option<PathBuf>,
    /// What is played
    #[arg(long, value_enum, default_value_t = DemoScene::Performance)]
    pub(crate) story: DemoScene,
    /// Also draw the contact story into this folder
    #[arg(long, value_name = "FOLDER")]
    pub(crate) pictures: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) recording: RecordingArgs,
}

/// What the demo plays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DemoScene {
    /// A performance of twelve seconds
    Performance,
    /// Lips that stick, a finger on the cheek, a ball on the forehead, blinks: contact is on
    Contact,
}

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
}

impl From<Zoom> for Framing {
    fn from(zoom: Zoom) -> Self {
        match zoom {
            Zoom::All => Self::All,
            Zoom::Face => Self::Face,
            Zoom::Mouth => Self::Mouth,
            Zoom::Eyes => Self::Eyes,
            Zoom::Eye => Self::Eye,
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

#[derive(Debug, Subcommand)]
pub(crate) enum TemplateCommand {
    /// Build a pack: the bundled one from its source data, or one of your own from a rig that you
    /// have; its skin weights are fitted
    Build(TemplateBuildArgs),
    /// Fit the skin weights of a pack and store them in it as `skin_weights.bin`
    Fit {
        /// The pack
        #[arg(default_value = "templates/human")]
        folder: PathBuf,
    },
    /// Load a pack with everything that is read from it, and check its own shapes on it
    Check {
        /// The pack; the bundled one without it
        folder: Option<PathBuf>,
        /// Also draw it: skin, muscles and twelve expressions
        #[arg(long, value_name = "OUT.png")]
        picture: Option<PathBuf>,
    },
}

#[derive(Debug, Args)]
pub(crate) struct TemplateBuildArgs {
    /// The `data` folder of the bundled template's source; or your own rig: a folder with a neutral
    /// mesh and meshes named as ARKit's shapes (ICT-FaceKit's layout too), or a glTF file with
    /// morph targets
    pub(crate) source: PathBuf,
    /// The pack [default: templates/human for the bundled template's source]
    pub(crate) folder: Option<PathBuf>,
    /// Name of the template [default: the folder's]
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// Whose work your rig is, and under which licence
    #[arg(long, default_value = "")]
    pub(crate) credit: String,
    /// Landmarks of the neutral mesh, as `fabrig rig` takes them
    #[arg(long, value_name = "FILE")]
    pub(crate) landmarks: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// What the whole chain loses: the template rigged as a user's face, shape by shape
    Chain {
        /// Let the cloth settle on each shape instead of placing the patches
        #[arg(long)]
        cloth: bool,
        /// Print as JSON
        #[arg(long)]
        json: bool,
    },
    /// How well faces of known truth are registered, or with `--cost` how long faces of growing
    /// size take to rig
    Registration(BenchRegistrationArgs),
    /// The cloth solver's time beside its error: modes, substeps, sweeps, stiffness ratios
    Pareto(BenchParetoArgs),
    /// Faces times takes with one worker and with two: time, throughput, equal bytes
    Batch(BenchBatchArgs),
    /// What a frame costs: faces simple and complex, with and without skin and recording, and
    /// cloth from 2,000 to 200,000 nodes
    Runtime(BenchRuntimeArgs),
    /// The cloth solver's hard cases, each with its worst figure
    Stability(BenchStabilityArgs),
    /// How near rigs come to faces' own expressions, beside whole-face delta transfer
    Table3(BenchTable3Args),
}

#[derive(Debug, Args)]
pub(crate) struct BenchTable3Args {
    /// Faces with their own shapes, named as ARKit's, instead of the bundled synthetic ones:
    /// folders with a neutral mesh (`neutral.obj`), or glTF files with morph targets
    #[arg(value_name = "FOLDER|FACE.glb")]
    pub(crate) folders: Vec<PathBuf>,
    /// Only bundled faces whose name has this in it
    #[arg(long, value_name = "TEXT", default_value = "")]
    pub(crate) filter: String,
    /// Also write one page with pictures: every pose of every face, coloured by its error
    #[arg(long, value_name = "OUT.html")]
    pub(crate) html: Option<PathBuf>,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct BenchParetoArgs {
    /// The whole take and every setting, instead of its liveliest second and a half and the
    /// settings about the default
    #[arg(long)]
    pub(crate) full: bool,
    /// Also write one page with plots
    #[arg(long, value_name = "OUT.html")]
    pub(crate) html: Option<PathBuf>,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct BenchRuntimeArgs {
    /// Frames of each measurement
    #[arg(long, default_value_t = 120, value_parser = clap::value_parser!(u32).range(10..=100_000))]
    pub(crate) frames: u32,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct BenchStabilityArgs {
    /// A million frames at a held target and a thousand random scenes, instead of twenty
    /// thousand and a hundred
    #[arg(long)]
    pub(crate) full: bool,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct BenchRegistrationArgs {
    /// Only cases whose name has this in it
    #[arg(long, value_name = "TEXT")]
    pub(crate) filter: Option<String>,
    /// Only the first so many of them
    #[arg(long, value_name = "N")]
    pub(crate) cases: Option<usize>,
    /// Time against size instead: from file to rig, stage by stage
    #[arg(long, conflicts_with_all = ["filter", "cases", "write"])]
    pub(crate) cost: bool,
    /// Largest number of vertices with `--cost`
    #[arg(long, value_name = "N", default_value_t = 1_100_000, requires = "cost")]
    pub(crate) largest: usize,
    /// Only write the meshes there, as OBJ, each with the true places of the template's
    /// vertices beside it
    #[arg(long, value_name = "FOLDER", conflicts_with = "json")]
    pub(crate) write: Option<PathBuf>,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `SECS` from the start, or `FROM..TO`. (s)
fn parse_stretch(text: &str) -> Result<[f64; 2], String> {
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|t| t.is_finite());
    let stretch = match text.split_once("..") {
        Some((from, to)) => number(from).zip(number(to)),
        None => number(text).map(|to| (0.0, to)),
    };
    match stretch {
        Some((from, to)) if 0.0 <= from && from <= to => Ok([from, to]),
        _ => Err("expected seconds from the start, or FROM..TO".to_owned()),
    }
}

fn parse_gain(text: &str) -> Result<(String, f64), String> {
    let (name, factor) = text.split_once('=').unwrap_or((text, ""));
    match factor.trim().parse::<f64>() {
        Ok(factor) if factor.is_finite() && factor >= 0.0 => Ok((name.trim().to_owned(), factor)),
        _ => Err("expected SHAPE=FACTOR with a factor of at least 0".to_owned()),
    }
}

fn parse_gate(text: &str) -> Result<(String, f64), String> {
    let (name, limit) = text.split_once('=').unwrap_or((text, ""));
    let name = name.trim().replace('-', "_");
    let limit = limit.trim().parse::<f64>().ok().filter(|x| x.is_finite());
    if CheckGates::default().get(&name).is_none() {
        let names: Vec<&str> = GATES.iter().map(|gate| gate.name).collect();
        return Err(format!("gates are {}", names.join(", ")));
    }
    match limit {
        Some(limit) => Ok((name, limit)),
        None => Err("expected GATE=LIMIT with a number".to_owned()),
    }
}

fn parse_rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate.is_finite() && rate >= 0.0 => Ok(rate),
        _ => Err("expected a number of times per second, at least 0".to_owned()),
    }
}

fn parse_vector(text: &str) -> Result<[f32; 3], String> {
    let numbers: Vec<f32> = text
        .split(',')
        .map(|part| part.trim().parse::<f32>())
        .collect::<Result<_, _>>()
        .map_err(|_| "expected three numbers X,Y,Z".to_owned())?;
    match numbers[..] {
        [x, y, z] if numbers.iter().all(|n| n.is_finite()) => Ok([x, y, z]),
        _ => Err("expected three finite numbers X,Y,Z".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn stretches_and_gains_are_read() {
        assert_eq!(parse_stretch("2"), Ok([0.0, 2.0]));
        assert_eq!(parse_stretch("1.5..2"), Ok([1.5, 2.0]));
        assert_eq!(
            parse_gain("mouthSmile=1.5"),
            Ok(("mouthSmile".to_owned(), 1.5))
        );
        for bad in ["", "x", "2..1", "-1..2", "nan"] {
            assert!(parse_stretch(bad).is_err(), "{bad}");
        }
        for bad in ["", "jawOpen", "jawOpen=-1", "jawOpen=inf"] {
            assert!(parse_gain(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_gate("leak-mm=0.3"), Ok(("leak_mm".to_owned(), 0.3)));
        for bad in ["", "leak_mm", "leak_mm=x", "leek_mm=1"] {
            assert!(parse_gate(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn vectors_are_three_finite_numbers() {
        assert_eq!(parse_vector("1,-2.5, 3"), Ok([1.0, -2.5, 3.0]));
        for bad in ["", "1,2", "1,2,3,4", "1,x,3", "1,nan,3"] {
            assert!(parse_vector(bad).is_err(), "{bad}");
        }
    }
}
