//! `fabrig bench stability`: the solver's hard cases, each with its worst figure.

use anyhow::Result;
use fabrig_core::cloth::bench::{Extent, stability};
use fabrig_core::scene::face_cases;
use serde_json::json;

use super::demo_scene;
use crate::cli::BenchStabilityArgs;
use crate::commands::Outcome;
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &BenchStabilityArgs) -> Result<Outcome> {
    let rig = demo_scene::demo_rig(console)?;
    let mut results = face_cases(&rig)?;
    let extent = if args.full {
        Extent::FULL
    } else {
        Extent::USUAL
    };
    results.extend(stability(extent, &mut |done, total| {
        console
            .show("hard cases", done as u64, total as u64, "")
            .is_continue()
    }));
    console.clear();
    if args.json {
        let cases: Vec<_> = results
            .iter()
            .map(|case| json!({ "case": case, "passed": case.is_passed() }))
            .collect();
        console.result(&serde_json::to_string_pretty(&cases)?);
    } else {
        console.result(&format!(
            "{:<76}{:>11}{:>10}  {:<24}{}",
            "case", "worst", "limit", "unit", ""
        ));
        for case in &results {
            console.result(&format!(
                "{:<76}{:>11.3e}{:>10.3e}  {:<24}{}",
                case.claim,
                case.worst,
                case.limit,
                case.unit,
                if case.is_passed() { "passed" } else { "FAILED" }
            ));
        }
    }
    if console.is_stopped() {
        return Ok(Outcome::Partial);
    }
    let failed = results.iter().filter(|case| !case.is_passed()).count();
    if failed > 0 {
        anyhow::bail!("{failed} of {} cases failed", results.len());
    }
    Ok(Outcome::Done)
}
