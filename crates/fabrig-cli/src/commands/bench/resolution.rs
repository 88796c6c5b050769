//! `fabrig bench resolution`: what fewer nodes cost, in millimetres and in time.

use anyhow::Result;
use fabrig_core::pipeline::resolution_rows;
use fabrig_core::template;

use super::demo_scene;
use crate::cli::BenchResolutionArgs;
use crate::commands::Outcome;
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &BenchResolutionArgs) -> Result<Outcome> {
    let clip = demo_scene::take()?;
    let frames = ((clip.duration() * demo_scene::FPS) as usize).clamp(1, args.frames.max(1));
    let (face, human) = (template::demo_face(), template::human());
    let rows = resolution_rows(&face, human, &clip, frames, &mut |name| {
        console.show("resolution", 0, 1, name)
    });
    console.clear();
    let rows = rows?;
    if args.json {
        console.result(&serde_json::to_string_pretty(&rows)?);
        return Ok(Outcome::Done);
    }
    console.result(&format!(
        "{:<12}{:>9}{:>14}{:>13}{:>13}{:>10}{:>11}{:>9}   skin against the finest, {frames} frames",
        "resolution",
        "nodes",
        "median rms mm",
        "worst rms mm",
        "vertex mm",
        "build s",
        "ms/frame",
        "99%"
    ));
    for row in &rows {
        console.result(&format!(
            "{:<12}{:>9}{:>14.3}{:>13.3}{:>13.2}{:>10.1}{:>11.2}{:>9.2}",
            row.name,
            row.nodes,
            row.rms[0],
            row.rms[1],
            row.largest,
            row.build,
            row.frame.median,
            row.frame.p99
        ));
    }
    Ok(Outcome::Done)
}
