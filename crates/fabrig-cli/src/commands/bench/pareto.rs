//! `fabrig bench pareto`: the solver's time beside its error.

use anyhow::{Context, Result};
use fabrig_core::atomic_file::write_atomically;
use fabrig_core::cloth::ClothOptions;
use fabrig_core::cloth::bench::{BenchScene, Pareto, pareto, settings};
use fabrig_core::scene::{Scene, all_frames, face_bench_scene, liveliest_frames};

use super::demo_scene;
use super::plot::page;
use crate::cli::BenchParetoArgs;
use crate::commands::{Outcome, check_output};
use crate::console::Console;

/// Stiffness ratios of the standard patch.
const RATIOS: [f64; 4] = [10.0, 30.0, 100.0, 1000.0];

pub(crate) fn run(console: &Console, args: &BenchParetoArgs) -> Result<Outcome> {
    if let Some(path) = &args.html {
        check_output(path)?;
    }
    let clip = demo_scene::take()?;
    let rig = demo_scene::demo_rig(console)?;
    let range = if args.full {
        all_frames(&clip, demo_scene::FPS)
    } else {
        liveliest_frames(&clip, demo_scene::FPS, 90)
    };
    let scene = Scene::default();
    let mut face = face_bench_scene(&rig, &clip, &scene, demo_scene::FPS, range)?;
    face.name = format!("demo face, {}", face.name);
    let mut scenes = vec![(face, scene.cloth, if args.full { 256 } else { 128 })];
    for ratio in RATIOS {
        let frames = if args.full { 120 } else { 60 };
        let patch = BenchScene::standard_patch(ratio, frames);
        scenes.push((patch, ClothOptions::default(), 1024));
    }
    let settings = settings(args.full);
    let mut results = Vec::new();
    let mut outcome = Outcome::Done;
    for (scene, base, reference) in &scenes {
        let result = pareto(scene, base, &settings, *reference, &mut |done, total| {
            console
                .show("measuring", done as u64, total as u64, &scene.name)
                .is_continue()
        })?;
        results.push(result);
        if console.is_stopped() {
            outcome = Outcome::Partial;
            break;
        }
    }
    console.clear();
    if let Some(path) = &args.html {
        write_atomically(path, |out| out.write_all(page(&results).as_bytes()))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if args.json {
        console.result(&serde_json::to_string_pretty(&results)?);
    } else {
        for result in &results {
            print(console, result);
        }
    }
    Ok(outcome)
}

fn print(console: &Console, result: &Pareto) {
    let floor = &result.floor;
    let (own, nudge) = (&result.reference_difference, &result.micrometre);
    console.result(&format!(
        "{}: {} nodes, {} constraints, {} frames, {} threads",
        result.scene,
        result.node_count,
        floor.constraint_count,
        result.frame_count,
        result.thread_count
    ));
    console.result(&format!(
        "reference f64, {} substeps; half as many differ by {:.1e} ({:.4} mm RMS); 1 um in the \
         neutral shape by {:.1e} ({:.4} mm RMS)",
        result.reference_substeps, own.relative, own.rms, nudge.relative, nudge.rms
    ));
    console.result(&format!(
        "floor on one thread: {:.3} ns per constraint in {} lanes",
        floor.ns_per_constraint, floor.lane_count
    ));
    console.result(&format!(
        "{:<20}{:>9}{:>10}{:>8}{:>8}{:>9}{:>9}{:>9}{:>10}{:>9}{:>8}",
        "mode",
        "substeps",
        "median ms",
        "95 %",
        "least",
        "x floor",
        "least x",
        "RMS mm",
        "max mm",
        "relative",
        "guards"
    ));
    for point in &result.points {
        let setting = &point.setting;
        let floor_ms = floor.frame_ms(setting.substeps, setting.sweeps);
        console.result(&format!(
            "{:<20}{:>9}{:>10.3}{:>8.3}{:>8.3}{:>9.2}{:>9.2}{:>9.4}{:>10.4}{:>9.2e}{:>8}",
            setting.family(),
            setting.substeps,
            point.median_ms,
            point.p95_ms,
            point.least_ms,
            point.median_ms / floor_ms,
            point.least_ms / floor_ms,
            point.error.rms,
            point.error.max,
            point.error.relative,
            point.counters.total()
        ));
    }
    console.result("");
}
