//! What makes and looks after rigs.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use fabrig_core::evaluation::{CheckGates, GATES};
use fabrig_core::pipeline::PatchDetail;
use fabrig_core::transfer::{AlphaMode, OffsetMode};

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
    /// How many nodes the patches have: coarse, standard, fine or finest; or the fewest that are
    /// within an accuracy such as 0.3mm of the finest, or within half a pixel of it where the face
    /// is so high in the picture, such as 900px [default: standard]
    #[arg(long, value_name = "NAME|MM|PX")]
    pub(crate) resolution: Option<PatchDetail>,
    /// Part the mesh over forehead and eyes until its edges are no longer than this, so that it
    /// can hold wrinkles (1.5 does); what is new follows the mesh's vertices
    #[arg(long, value_name = "MM", value_parser = clap::value_parser!(f64))]
    pub(crate) refine_skin: Option<f64>,
    /// Skin and fat that are not the face's own, with commas between: looser_skin, firmer_skin,
    /// more_fat, less_fat, aged
    #[arg(long, value_name = "PRESET", value_delimiter = ',')]
    pub(crate) preset: Vec<String>,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gates_are_read() {
        assert_eq!(parse_gate("leak-mm=0.3"), Ok(("leak_mm".to_owned(), 0.3)));
        for bad in ["", "leak_mm", "leak_mm=x", "leek_mm=1"] {
            assert!(parse_gate(bad).is_err(), "{bad}");
        }
    }
}
