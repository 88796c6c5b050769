//! Measurements.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::BenchBatchArgs;

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
    /// The economical run beside the full one, on takes and random scenes: what is left out, what
    /// it costs, and whether any bound is violated
    Economy(BenchEconomyArgs),
    /// The cloth solver's time beside its error: modes, substeps, sweeps, stiffness ratios
    Pareto(BenchParetoArgs),
    /// Faces times takes with one worker and with two: time, throughput, equal bytes
    Batch(BenchBatchArgs),
    /// What fewer nodes a patch cost, in millimetres of the skin and in time
    Resolution(BenchResolutionArgs),
    /// What a frame costs: faces simple and complex, with and without skin and recording, and
    /// cloth from 2,000 to 200,000 nodes
    Runtime(BenchRuntimeArgs),
    /// The cloth solver's hard cases, each with its worst figure
    Stability(BenchStabilityArgs),
    /// How deep and how finely loose skin wrinkles, on patches and on the skin over them, beside
    /// what a beam on springs does
    Wrinkles(BenchWrinklesArgs),
    /// Whether fat keeps its volume under gravity from every side, and how it rings, beside an
    /// oscillator of its materials
    SoftTissue(BenchSoftTissueArgs),
    /// How near rigs come to faces' own expressions, beside whole-face delta transfer
    Table3(BenchTable3Args),
}

#[derive(Debug, Args)]
pub(crate) struct BenchResolutionArgs {
    /// Frames of the bundled take, at most
    #[arg(long, value_name = "N", default_value_t = 360)]
    pub(crate) frames: usize,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct BenchWrinklesArgs {
    /// Seeds of the imperfection that decides where skin buckles
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
    /// Longest edge of the skin over what wrinkles
    #[arg(long, value_name = "MM", default_value_t = 1.5)]
    pub(crate) refine_skin: f64,
    /// Skin that is measured: looser_skin, firmer_skin or aged
    #[arg(long, value_name = "PRESET", default_value = "looser_skin")]
    pub(crate) preset: String,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct BenchSoftTissueArgs {
    /// Skin and fat that are not the bundled face's own, with commas between
    #[arg(long, value_name = "PRESET", value_delimiter = ',')]
    pub(crate) preset: Vec<String>,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
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
pub(crate) struct BenchEconomyArgs {
    /// Random scenes
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub(crate) scenes: u64,
    /// Seed of the first of them
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1 << 40))]
    pub(crate) seed: u64,
    /// A take to measure beside the bundled ones
    #[arg(long, value_name = "FILE")]
    pub(crate) motion: Option<PathBuf>,
    /// Frames of a take, at most
    #[arg(long, value_name = "N", default_value_t = 720)]
    pub(crate) frames: usize,
    /// How often a take is run, for the shortest time of each frame
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(crate) repeats: usize,
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
    /// A take for the complex face instead of the bundled one, all of it
    #[arg(long, value_name = "TAKE")]
    pub(crate) motion: Option<PathBuf>,
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
