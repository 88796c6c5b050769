//! What goes beside a recording, and how to open it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use fabrig_core::atomic_file::write_atomically;
use fabrig_core::recording::RERUN_SCRIPT;

use crate::console::Console;

fn layout_path(recording: &Path) -> PathBuf {
    recording.with_extension("foxglove.json")
}

fn script_path(recording: &Path) -> PathBuf {
    recording.with_file_name("open_in_rerun.py")
}

/// Writes Foxglove's layout and the script that opens the recording in Rerun beside it.
pub(super) fn write_viewer_files(recording: &Path, layout: &str) -> Result<()> {
    for (path, text) in [
        (layout_path(recording), layout),
        (script_path(recording), RERUN_SCRIPT),
    ] {
        write_atomically(&path, |file| file.write_all(text.as_bytes()))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Says how to look at a recording.
pub(super) fn print_how_to_open(console: &Console, recording: &Path) {
    console.result(&format!("{:<20}{}", "recording", recording.display()));
    console.result(&format!(
        "{:<20}open the file in Foxglove or Lichtblick, then import the layout {}",
        "Foxglove",
        layout_path(recording).display()
    ));
    console.result(&format!(
        "{:<20}pip install rerun-sdk mcap, then python {} {}",
        "Rerun",
        script_path(recording).display(),
        recording.display()
    ));
}
