//! What goes to other programs.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use fabrig_core::export::ExportOptions;

use super::{SceneArgs, TakeArgs, Unit};

#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// Rig, as `fabrig rig` makes it
    pub(crate) rig: PathBuf,
    /// Where to write: .glb, .gltf, .usda, .npz, .pc2, .mdd, or a folder for OBJ files
    #[arg(short, long, value_name = "OUT.glb|OUT/")]
    pub(crate) output: PathBuf,
    /// A take, which becomes an animation of the shapes
    #[arg(long, value_name = "TAKE")]
    pub(crate) motion: Option<PathBuf>,
    /// Simulate the take and write the vertices of every frame instead of the 52 shapes; always
    /// so for point caches, and for OBJ with a take
    #[arg(long, requires = "motion")]
    pub(crate) baked: bool,
    /// Leave out the comparison of the shapes' sum with the simulation
    #[arg(long)]
    pub(crate) skip_check: bool,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    #[command(flatten)]
    pub(crate) take: TakeArgs,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ConvertArgs {
    /// Recording, as `fabrig animate` makes it
    pub(crate) recording: PathBuf,
    /// Where to write; its extension says the format
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Option<PathBuf>,
    /// Format, to write beside the recording
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub(crate) to: Option<Target>,
    /// The rig that was recorded: keeps its polygons, texture coordinates, units and place
    #[arg(long, value_name = "FACE.fabrig")]
    pub(crate) rig: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// A format that `--to` names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Target {
    /// glTF, one binary file
    Glb,
    /// glTF, JSON and buffer
    Gltf,
    /// USD as text
    Usd,
    /// NumPy arrays
    Npz,
    /// PC2 point cache
    Pc2,
    /// MDD point cache
    Mdd,
    /// A folder of OBJ files
    Obj,
    /// Rerun's own, by its program `rerun`
    Rrd,
}

/// How a file is laid out, whatever it is made from.
#[derive(Debug, Args)]
pub(crate) struct LayoutArgs {
    /// The mesh that the rig was made from, for its materials and textures (OBJ, glTF)
    #[arg(long, value_name = "FACE.obj")]
    pub(crate) face: Option<PathBuf>,
    /// Unit of the file [default: metres for glTF, elsewhere the face's own]
    #[arg(long, value_enum)]
    pub(crate) unit: Option<Unit>,
    /// Name of the face in the file [default: the input's]
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// Leave head motion out
    #[arg(long)]
    pub(crate) still_head: bool,
    /// Morph targets of a baked glTF [default: as many as --tolerance needs]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) components: Option<u32>,
    /// Error of a baked glTF, root mean square over a frame, in mm
    #[arg(long, value_name = "MM", default_value_t = ExportOptions::default().basis_tolerance)]
    pub(crate) tolerance: f64,
}
