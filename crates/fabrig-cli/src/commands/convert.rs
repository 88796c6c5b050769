//! `fabrig convert`: a recording in another format.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, bail};
use fabrig_core::export::{ConvertOptions, convert};

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
        return to_rerun(console, &args.recording, &output);
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

/// Rerun's own file, by Rerun's own program.
fn to_rerun(console: &Console, recording: &Path, output: &Path) -> Result<Outcome> {
    let tried = std::process::Command::new("rerun")
        .args(["mcap", "convert"])
        .arg(recording)
        .arg("-o")
        .arg(output)
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
    console.result(&format!("{:<20}{}", "written", output.display()));
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
