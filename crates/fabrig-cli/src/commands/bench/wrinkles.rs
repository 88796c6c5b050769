//! `fabrig bench wrinkles`: depth and wavelength of wrinkles on patches and skin.

use std::sync::Arc;

use anyhow::Result;
use fabrig_core::evaluation::{WRINKLE_CASES, WrinkleCase, WrinkleMeasure, measure_wrinkles};
use fabrig_core::pipeline::RigFaceOptions;
use fabrig_core::rig::{Rig, SkinRefinement};
use fabrig_core::scene::Scene;
use fabrig_core::template;
use serde::Serialize;

use crate::cli::BenchWrinklesArgs;
use crate::commands::Outcome;
use crate::commands::animate::apply_presets;
use crate::commands::rig;
use crate::console::Console;

/// What one case measured over all seeds.
#[derive(Debug, Serialize)]
struct Row {
    case: WrinkleCase,
    skin: &'static str,
    /// Spread over the seeds: largest less smallest, as a share of the mean.
    depth_spread: f64,
    wavelength_spread: f64,
    seeds: Vec<WrinkleMeasure>,
}

pub(crate) fn run(console: &Console, args: &BenchWrinklesArgs) -> Result<Outcome> {
    let mut rows = Vec::new();
    for (skin, refinement) in [
        ("as it came", None),
        ("refined", Some(SkinRefinement::to(args.refine_skin))),
    ] {
        let options = RigFaceOptions {
            refinement,
            ..RigFaceOptions::default()
        };
        let mut face = rig::rig(console, &template::demo_face(), &options)?.rig;
        apply_presets(&mut face, std::slice::from_ref(&args.preset))?;
        let face = Arc::new(face);
        for case in WRINKLE_CASES {
            rows.push(measure(console, &face, skin, case, args.seeds)?);
        }
    }
    console.clear();
    if args.json {
        console.result(&serde_json::to_string_pretty(&rows)?);
        return Ok(Outcome::Done);
    }
    console.result(&format!(
        "{:<16}{:<12}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>8}{:>8}",
        "case",
        "skin",
        "patch",
        "ridge",
        "skin",
        "ridge",
        "kept",
        "said",
        "wave",
        "on skin",
        "Winkler",
        "ratio",
        "depth+-",
        "wave+-"
    ));
    console.result(&format!(
        "{:<16}{:<12}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>8}{:>8}",
        "", "", "rms mm", "mm", "rms mm", "mm", "", "", "mm", "mm", "mm", "", "", ""
    ));
    for row in &rows {
        let mean = |of: &dyn Fn(&WrinkleMeasure) -> f64| mean_of(&row.seeds, of);
        let predicted = mean(&|m| m.winkler.map_or(f64::NAN, |w| w.wavelength));
        console.result(&format!(
            "{:<16}{:<12}{:>9.3}{:>9.2}{:>9.3}{:>9.2}{:>9.2}{:>9.2}{:>9.2}{:>9.2}{:>9.2}{:>9.2}{:>7.0}%{:>7.0}%",
            row.case.name,
            row.skin,
            mean(&|m| m.patch.depth_rms),
            mean(&|m| m.patch.trough_to_ridge),
            mean(&|m| m.skin.depth_rms),
            mean(&|m| m.skin.trough_to_ridge),
            mean(&|m| m.skin.depth_rms) / mean(&|m| m.patch.depth_rms),
            mean(&|m| m.kept_predicted),
            mean(&|m| m.patch.wavelength),
            mean(&|m| m.skin.wavelength),
            predicted,
            mean(&|m| m.patch.wavelength) / predicted,
            100.0 * row.depth_spread,
            100.0 * row.wavelength_spread,
        ));
    }
    Ok(Outcome::Done)
}

fn mean_of(seeds: &[WrinkleMeasure], of: &dyn Fn(&WrinkleMeasure) -> f64) -> f64 {
    seeds.iter().map(of).sum::<f64>() / seeds.len().max(1) as f64
}

fn measure(
    console: &Console,
    face: &Arc<Rig>,
    skin: &'static str,
    case: WrinkleCase,
    count: u64,
) -> Result<Row> {
    let mut seeds = Vec::new();
    for seed in 0..count {
        let mut scene = Scene::default();
        scene.cloth.seed = seed;
        seeds.push(measure_wrinkles(face, &scene, &case)?);
        if console.show("hold", seed + 1, count, case.name).is_break() {
            anyhow::bail!("stopped; nothing is reported");
        }
    }
    let spread = |of: &dyn Fn(&WrinkleMeasure) -> f64| {
        let values = || seeds.iter().map(of);
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        (high - low) / mean_of(&seeds, of).max(f64::MIN_POSITIVE)
    };
    Ok(Row {
        case,
        skin,
        depth_spread: spread(&|m| m.patch.depth_rms),
        wavelength_spread: spread(&|m| m.patch.wavelength),
        seeds,
    })
}
