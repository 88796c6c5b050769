//! Template packs.

use std::path::PathBuf;

use clap::{Args, Subcommand};

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
