//! Many faces times many takes.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
pub(crate) struct BatchArgs {
    /// What there is and what is wanted of it: a .toml file, or a .csv table with a row a pair
    /// (`docs/batch.md`)
    pub(crate) manifest: PathBuf,
    /// Folder for everything that is made; a run goes on from what is there
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
    /// Jobs at a time; memory goes with it [default: as many as processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) jobs: Option<u32>,
    /// Threads of each job; results do not depend on it
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: u32,
    /// Only outputs of this name, with wildcards, and what they need; may be repeated
    #[arg(long, value_name = "PATTERN")]
    pub(crate) only: Vec<String>,
    /// Do the one job with this output and nothing else, as another program's worker
    #[arg(long, value_name = "OUTPUT", conflicts_with_all = ["only", "dry_run", "report", "jobs"])]
    pub(crate) job: Option<String>,
    /// Only say what would be done
    #[arg(long, conflicts_with = "report")]
    pub(crate) dry_run: bool,
    /// Read all results that are there, to see whether they are as they were made, instead of
    /// trusting their size
    #[arg(long)]
    pub(crate) verify: bool,
    /// Also write the report as a page with a picture of every face
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct BenchBatchArgs {
    /// Faces, of those bundled
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) faces: u32,
    /// Clips, cut from the bundled take one after the other
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) clips: u32,
    /// Length of a clip
    #[arg(long, value_name = "SECS", default_value_t = 1.5)]
    pub(crate) seconds: f64,
    /// What is made of each pair: `dataset`, `recording`, or both
    #[arg(long, value_enum, value_delimiter = ',', default_value = "dataset")]
    pub(crate) outputs: Vec<BenchOutput>,
    /// Workers to compare, each with one thread
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "1,2")]
    pub(crate) workers: Vec<u32>,
    /// Only write faces, takes and manifest there
    #[arg(long, value_name = "FOLDER", conflicts_with = "json")]
    pub(crate) write: Option<PathBuf>,
    /// Print as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// What a pair of the measurement becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum BenchOutput {
    /// NumPy arrays for learning
    Dataset,
    /// MCAP
    Recording,
}
