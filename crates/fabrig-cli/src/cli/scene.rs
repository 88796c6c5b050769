//! Scene files.

use std::path::PathBuf;

use clap::{Args, Subcommand};

#[derive(Debug, Subcommand)]
pub(crate) enum SceneCommand {
    /// Say what a scene would model, or what is wrong with it and where
    Check(SceneCheckArgs),
    /// Print a scene with every key, its meaning, unit and default
    Show,
}

#[derive(Debug, Args)]
pub(crate) struct SceneCheckArgs {
    /// The scene
    pub(crate) scene: PathBuf,
    /// Print what it would model as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
