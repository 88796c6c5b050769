//! The command line as types: one file a group of verbs.

mod animate;
mod batch;
mod bench;
mod examples;
mod export;
mod look;
mod play;
mod rig;
mod scene;
mod take;
mod template;
mod tools;

pub(crate) use animate::{AnimateArgs, ContactPairs, DemoArgs, DemoScene, SceneArgs};
pub(crate) use batch::{BatchArgs, BenchBatchArgs, BenchOutput};
pub(crate) use bench::{
    BenchCommand, BenchEconomyArgs, BenchParetoArgs, BenchRegistrationArgs, BenchResolutionArgs,
    BenchRuntimeArgs, BenchSoftTissueArgs, BenchStabilityArgs, BenchTable3Args, BenchWrinklesArgs,
};
pub(crate) use export::{ConvertArgs, ExportArgs, LayoutArgs, Target};
pub(crate) use look::{InfoArgs, RenderArgs, Zoom};
pub(crate) use play::PlayArgs;
pub(crate) use rig::{CheckArgs, EditCommand, Order, RigArgs, Seam, Unit};
pub(crate) use scene::{SceneCheckArgs, SceneCommand};
pub(crate) use take::{RetargetArgs, TakeArgs};
pub(crate) use template::{TemplateBuildArgs, TemplateCommand};
pub(crate) use tools::{CompletionsArgs, DoctorArgs};

use clap::{Parser, Subcommand};

/// Rigs any 3D face, animates it from performance capture, records it to MCAP.
#[derive(Debug, Parser)]
#[command(
    name = "fabrig",
    version,
    about,
    arg_required_else_help = true,
    after_help = examples::FABRIG
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Make a rig from a neutral face mesh
    #[command(after_help = examples::RIG)]
    Rig(RigArgs),
    /// Drive a rig by a take and record it
    #[command(after_help = examples::ANIMATE)]
    Animate(AnimateArgs),
    /// Look at scene files: what is wrong with one, what it would model, what keys there are
    #[command(subcommand, after_help = examples::SCENE)]
    Scene(SceneCommand),
    /// Rig and animate the bundled face with the bundled take
    #[command(after_help = examples::DEMO)]
    Demo(DemoArgs),
    /// Say whether every shape of a rig does on its face what it should; exit code 3 where not
    #[command(after_help = examples::CHECK)]
    Check(CheckArgs),
    /// Write a rig with its 52 shapes, or a take on it, for other programs: glTF, USD, OBJ,
    /// NumPy, point caches
    #[command(after_help = examples::EXPORT)]
    Export(ExportArgs),
    /// Write a recording for other programs
    #[command(after_help = examples::CONVERT)]
    Convert(ConvertArgs),
    /// Many faces times many takes, as a manifest says; does only what is missing or changed; exit
    /// code 3 where something could not be made
    #[command(after_help = examples::BATCH)]
    Batch(BatchArgs),
    /// Fit the shapes of a rig to markers or an animated mesh, and write the take
    #[command(after_help = examples::RETARGET)]
    Retarget(RetargetArgs),
    /// Show a recording, or a rig that is simulated meanwhile, live in Foxglove
    #[command(after_help = examples::PLAY)]
    Play(PlayArgs),
    /// Look at and change single muscles of a rig
    #[command(subcommand, after_help = examples::EDIT)]
    Edit(EditCommand),
    /// Draw a mesh, a rig or a recording to PNG or GIF
    #[command(after_help = examples::RENDER)]
    Render(RenderArgs),
    /// Say what is in a mesh, a rig, a take or a recording
    #[command(after_help = examples::INFO)]
    Info(InfoArgs),
    /// Build or check a template pack
    #[command(subcommand, after_help = examples::TEMPLATE)]
    Template(TemplateCommand),
    /// Measure
    #[command(subcommand, after_help = examples::BENCH)]
    Bench(BenchCommand),
    /// Say what this build and machine can do
    #[command(after_help = examples::DOCTOR)]
    Doctor(DoctorArgs),
    /// Print the completions of a shell
    #[command(after_help = examples::COMPLETIONS)]
    Completions(CompletionsArgs),
    /// Print the manual page
    #[command(after_help = examples::MAN)]
    Man,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }
}
