//! `fabrig bench stability`: the solver's hard cases, each with its worst figure.

use std::sync::Arc;

use anyhow::Result;
use fabrig_core::cloth::bench::{CaseResult, Extent, stability};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{FacePose, Scene, Simulation};
use serde_json::json;

use super::demo_scene;
use crate::cli::BenchStabilityArgs;
use crate::commands::Outcome;
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &BenchStabilityArgs) -> Result<Outcome> {
    let rig = demo_scene::demo_rig(console)?;
    let mut results = vec![all_shapes(&rig)?, far_from_the_origin(&rig)?];
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

/// Every shape of the face at weight 1, antagonists together, from one frame to the next.
fn all_shapes(rig: &Arc<Rig>) -> Result<CaseResult> {
    let mut simulation = Simulation::new(Arc::clone(rig), Scene::default(), None)?;
    let mut pose = FacePose::neutral(rig.shape_names.len());
    pose.weights.fill(1.0);
    let mut frozen = 0;
    let mut settle = f64::INFINITY;
    for _ in 0..120 {
        let report = simulation.advance_to(pose.clone(), 1.0 / demo_scene::FPS)?;
        frozen += report.step.counters.frozen_patches;
        settle = report.settle_rms;
    }
    let worst = if frozen > 0 { f64::INFINITY } else { settle };
    Ok(CaseResult::new(
        "8 all shapes at 1, antagonists together: the face settles on them",
        worst,
        1.0,
        "mm RMS",
    ))
}

/// The same pose with the head at the origin and a kilometre away.
fn far_from_the_origin(rig: &Arc<Rig>) -> Result<CaseResult> {
    let run = |away: f64| -> Result<_> {
        let mut simulation = Simulation::new(Arc::clone(rig), Scene::default(), None)?;
        let mut pose = FacePose::neutral(rig.shape_names.len());
        for (i, weight) in pose.weights.iter_mut().enumerate() {
            *weight = if i % 3 == 0 { 0.5 } else { 0.0 };
        }
        (pose.head.translation.x, pose.head.translation.y) = (away, away);
        for _ in 0..20 {
            simulation.advance_to(pose.clone(), 1.0 / demo_scene::FPS)?;
        }
        Ok(simulation.skin().to_vec())
    };
    let (here, there) = (run(0.0)?, run(1e6)?);
    let worst = here
        .iter()
        .zip(&there)
        .map(|(a, b)| f64::from((a - b).norm()))
        .fold(0.0, f64::max);
    Ok(CaseResult::new(
        "13 a head one kilometre away moves as one at the origin",
        worst,
        1e-3,
        "mm",
    ))
}
