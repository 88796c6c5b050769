//! `fabrig demo`: the whole line with nothing but the binary.

use anyhow::Result;
use fabrig_core::motion::{self, ReadOptions};
use fabrig_core::pipeline::{AnimateOptions, RigFaceOptions};
use fabrig_core::template;
use serde_json::json;

use super::animate::{outcome, print_report, record};
use super::rig;
use super::viewers::print_how_to_open;
use super::{Outcome, check_output};
use crate::cli::DemoArgs;
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &DemoArgs) -> Result<Outcome> {
    check_output(&args.output)?;
    if let Some(path) = &args.rig {
        check_output(path)?;
    }
    let face = template::demo_face();
    let clip = motion::parse(
        template::demo_take(),
        "the bundled take",
        &ReadOptions::default(),
    )?;
    let rigged = rig::rig(console, &face, &RigFaceOptions::default())?;
    if let Some(path) = &args.rig {
        rigged.rig.save(path)?;
    }
    if !args.scene.json {
        rig::print_report(console, &rigged);
        console.result("");
    }
    let options = AnimateOptions {
        fps: args.scene.fps,
        rig_name: "demo".to_owned(),
        take_name: "demo".to_owned(),
        recording: args.scene.recording(),
    };
    let registration = rigged.report;
    let report = record(
        console,
        rigged.rig,
        clip,
        &args.scene,
        &args.output,
        &options,
    )?;
    if args.scene.json {
        let both = json!({ "rig": registration, "animation": report });
        console.result(&serde_json::to_string_pretty(&both)?);
    } else {
        print_report(console, &report);
        print_how_to_open(console, &args.output);
    }
    Ok(outcome(console, &report))
}
