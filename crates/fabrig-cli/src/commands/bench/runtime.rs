//! `fabrig bench runtime`: what a frame costs, and how the cost grows with the cloth.

use anyhow::Result;
use fabrig_core::motion::{self, ReadOptions};
use fabrig_core::pipeline::{RuntimeReport, TimeStatistics, runtime};

use super::demo_scene;
use crate::cli::BenchRuntimeArgs;
use crate::commands::Outcome;
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &BenchRuntimeArgs) -> Result<Outcome> {
    let rig = demo_scene::demo_rig(console)?;
    let frames = args.frames as usize;
    let complex = match &args.motion {
        Some(path) => motion::read(path, &ReadOptions::default())?,
        None => demo_scene::take()?,
    };
    let report = runtime(&rig, &complex, frames, &mut |at| {
        console.show("simulating", at.frame, at.frame_count, &at.what)
    })?;
    console.clear();
    if args.json {
        console.result(&serde_json::to_string_pretty(&report)?);
    } else {
        print(console, &report);
    }
    Ok(if report.is_complete {
        Outcome::Done
    } else {
        Outcome::Partial
    })
}

fn print(console: &Console, report: &RuntimeReport) {
    console.result(&report.processor);
    console.result(&format!(
        "{:<9}{:<11}{:>7}  {:<24}{:<24}{:<24}{:>7}{:>8}{:>11}{:>9}",
        "take",
        "contact",
        "threads",
        "simulation [ms]",
        "+ skin",
        "+ recording",
        "fps",
        "x none",
        "candidates",
        "contacts"
    ));
    let times = |t: &TimeStatistics| format!("{:.2} / {:.2} / {:.2}", t.median, t.p95, t.p99);
    for row in &report.faces {
        console.result(&format!(
            "{:<9}{:<11}{:>7}  {:<24}{:<24}{:<24}{:>7.1}{:>8.2}{:>11}{:>9}",
            row.take,
            row.contact,
            row.threads,
            times(&row.simulation),
            times(&row.with_skin),
            times(&row.with_recording),
            row.fps,
            row.against_none,
            row.candidates,
            row.contacts
        ));
    }
    console.result(&format!(
        "median / 95 % / 99 %; frames a second are of the median with skin; the paper's four rows \
         of the same size: {} fps",
        report.paper_fps.map(|fps| fps.to_string()).join(", ")
    ));
    console.result(
        "the cloth alone under a shaking head, patches attached to each other or not; time per node \
         of the quickest frame:",
    );
    console.result(&format!(
        "{:>8}{:>10}{:>9}  {:<26}{:>9}{:>12}",
        "nodes", "attached", "threads", "frame [ms]", "least", "us per node"
    ));
    for row in &report.sizes {
        console.result(&format!(
            "{:>8}{:>10}{:>9}  {:<26}{:>9.3}{:>12.4}",
            row.nodes,
            if row.is_attached { "yes" } else { "no" },
            row.threads,
            times(&row.frame),
            row.least_ms,
            row.microseconds_per_node
        ));
    }
    for growth in &report.growth {
        console.result(&format!(
            "{} threads, {}: the dearest node costs {:.2} times the cheapest",
            growth.threads,
            if growth.is_attached {
                "attached"
            } else {
                "unattached"
            },
            growth.ratio
        ));
    }
}
