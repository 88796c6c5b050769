//! One file per verb.

mod animate;
mod batch;
mod batch_page;
mod bench;
mod check;
mod convert;
mod demo;
mod doctor;
mod edit;
mod export;
mod html;
mod info;
#[cfg(feature = "play")]
mod play;
mod pose;
mod render;
mod report;
mod retarget;
mod rig;
mod scene;
mod self_description;
mod story_pictures;
mod subjects;
mod template;
mod viewers;

use std::borrow::Cow;
use std::path::Path;

use anyhow::{Context, Result, bail};
use fabrig_core::template::{Template, human};

use crate::cli::Command;
use crate::console::Console;

/// How a command that did not fail ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// All that was asked for.
    Done,
    /// Less than that, and said so: what is there is whole.
    Partial,
}

/// Runs a command.
pub(crate) fn run(console: &Console, command: Command) -> Result<Outcome> {
    match command {
        Command::Rig(args) => rig::run(console, &args),
        Command::Animate(args) => animate::run(console, &args),
        Command::Scene(command) => scene::run(console, &command),
        Command::Demo(args) => demo::run(console, &args),
        Command::Check(args) => check::run(console, &args),
        Command::Export(args) => export::run(console, &args),
        Command::Convert(args) => convert::run(console, &args),
        Command::Batch(args) => batch::run(console, &args),
        Command::Retarget(args) => retarget::run(console, &args),
        #[cfg(feature = "play")]
        Command::Play(args) => play::run(console, &args),
        #[cfg(not(feature = "play"))]
        Command::Play(_) => bail!(
            "this build has no `play`: cargo install --path crates/fabrig-cli --features play"
        ),
        Command::Edit(command) => edit::run(console, &command),
        Command::Render(args) => render::run(console, &args),
        Command::Info(args) => info::run(console, &args),
        Command::Template(command) => template::run(console, &command),
        Command::Bench(command) => bench::run(console, &command),
        Command::Doctor(args) => doctor::run(console, &args),
        Command::Completions(args) => self_description::completions(&args),
        Command::Man => self_description::man(),
    }
}

/// Refuses an output before anything is computed for it.
fn check_output(path: &Path) -> Result<()> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        bail!(
            "cannot write {}: the folder {} does not exist",
            path.display(),
            folder.display()
        );
    }
    if path.is_dir() {
        bail!("cannot write {}: it is a folder", path.display());
    }
    Ok(())
}

/// The template in a folder, or the bundled one.
fn template_of(folder: Option<&Path>) -> Result<Cow<'static, Template>> {
    Ok(match folder {
        Some(folder) => Cow::Owned(
            Template::load(folder)
                .with_context(|| format!("{} cannot be used", folder.display()))?,
        ),
        None => Cow::Borrowed(human()),
    })
}

/// The name of a file without folder and extension.
fn stem(path: &Path) -> String {
    path.file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default()
}
