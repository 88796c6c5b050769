//! `fabrig convert`: a recording in another format.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use fabrig_core::export::{ConvertOptions, convert};
use fabrig_core::recording::MessageReader;

use super::animate::load_rig;
use super::export::{check_target, finish, layout, progress};
use super::{Outcome, check_output};
use crate::cli::{ConvertArgs, Target};
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &ConvertArgs) -> Result<Outcome> {
    let output = match (&args.output, args.to) {
        (Some(output), None) => output.clone(),
        (None, Some(to)) => args.recording.with_extension(to.extension()),
        (Some(output), Some(to)) => {
            let extension = output.extension().unwrap_or_default();
            if extension.to_string_lossy().to_ascii_lowercase() != to.extension() {
                bail!(
                    "{}: its extension is not .{}, which --to asks for",
                    output.display(),
                    to.extension()
                );
            }
            output.clone()
        }
        (None, None) => bail!("give -o OUTPUT, or --to FORMAT to write beside the recording"),
    };
    if output
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("rrd"))
    {
        check_output(&output)?;
        return to_rerun(console, args, &output);
    }
    check_target(&output)?;
    let rig = match &args.rig {
        Some(path) => Some(Arc::new(load_rig(path)?)),
        None => None,
    };
    if rig.is_none() && args.layout.face.is_some() {
        bail!("--face says which materials a rig's polygons have: it needs --rig FACE.fabrig");
    }
    let options = ConvertOptions {
        rig,
        export: layout(&args.layout, &args.recording),
    };
    let report = convert(&args.recording, &output, &options, &mut progress(console));
    finish(console, report, &output, args.json)
}

/// Rerun's own file, by Rerun's own program; it takes its name once it is whole.
fn to_rerun(console: &Console, args: &ConvertArgs, output: &Path) -> Result<Outcome> {
    let recording = &args.recording;
    // Rerun's program says little of a file that is none.
    MessageReader::open(recording, false)?;
    let folder = match output.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let cannot_write = || format!("cannot write {}", output.display());
    let made = tempfile::Builder::new()
        .prefix(".fabrig-")
        .tempdir_in(folder)
        .with_context(cannot_write)?;
    // The name of a recording in Rerun is the stem of its file.
    let partial = made.path().join(output.file_name().unwrap_or_default());
    let tried = std::process::Command::new("rerun")
        .args(["mcap", "convert"])
        .arg(recording)
        .arg("-o")
        .arg(&partial)
        .stdin(std::process::Stdio::null())
        .output();
    let done = match tried {
        Ok(done) => done,
        Err(e) => bail!("the program `rerun` cannot be run ({e}): pip install rerun-sdk"),
    };
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        bail!("`rerun mcap convert` failed: {}", said.trim());
    }
    let bytes = std::fs::metadata(&partial).map(|file| file.len());
    let bytes = bytes.context("`rerun mcap convert` wrote nothing")?;
    std::fs::rename(&partial, output).with_context(cannot_write)?;
    if args.json {
        let report = serde_json::json!({"format": "rrd", "files": 1, "bytes": bytes});
        console.result(&serde_json::to_string_pretty(&report)?);
        return Ok(Outcome::Done);
    }
    console.result(&format!(
        "{:<20}{}, {:.2} MB",
        "written",
        output.display(),
        bytes as f64 / 1e6
    ));
    Ok(Outcome::Done)
}

impl Target {
    fn extension(self) -> &'static str {
        match self {
            Self::Glb => "glb",
            Self::Gltf => "gltf",
            Self::Usd => "usda",
            Self::Npz => "npz",
            Self::Pc2 => "pc2",
            Self::Mdd => "mdd",
            Self::Obj => "",
            Self::Rrd => "rrd",
        }
    }
}
