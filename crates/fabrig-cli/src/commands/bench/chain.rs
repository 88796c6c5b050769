//! `fabrig bench chain`: what the whole chain loses, shape by shape.

use std::sync::Arc;

use anyhow::Result;
use fabrig_core::pipeline::RigFaceOptions;
use fabrig_core::scene::{Scene, ShapeLoss, chain_loss};
use fabrig_core::template;

use crate::commands::{Outcome, rig};
use crate::console::Console;

pub(crate) fn run(console: &Console, cloth: bool, json: bool) -> Result<Outcome> {
    let template = template::human();
    let rigged = rig::rig(console, &template.skin, &RigFaceOptions::default())?;
    let scene = if cloth {
        Scene::default()
    } else {
        Scene::without_dynamics()
    };
    let losses = chain_loss(&Arc::new(rigged.rig), template, &scene)?;
    if json {
        console.result(&serde_json::to_string_pretty(&losses)?);
    } else {
        print_table(console, &losses);
    }
    Ok(Outcome::Done)
}

fn print_table(console: &Console, losses: &[ShapeLoss]) {
    console.result(&format!(
        "{:<20}{:>7}{:>6}{:>8}{:>8}{:>8}{:>9}{:>8}{:>8}{:>8}",
        "shape [mm]", "peak", "moved", "mean", "95 %", "max", "contour", "95 %", "leak", "settle"
    ));
    for loss in losses {
        console.result(&format!(
            "{:<20}{:>7.2}{:>6}{:>8.3}{:>8.3}{:>8.2}{:>9.3}{:>8.3}{:>8.3}{:>8.3}",
            loss.shape,
            loss.amplitude,
            loss.moved.count,
            loss.moved.mean,
            loss.moved.percentile_95,
            loss.moved.max,
            loss.contours.mean,
            loss.contours.percentile_95,
            loss.still.max,
            loss.settle_rms,
        ));
    }
    let worst = |of: fn(&ShapeLoss) -> f64| losses.iter().map(of).fold(0.0, f64::max);
    console.result(&format!(
        "worst shape: mean {:.3}, 95 % {:.3}, contour mean {:.3}, settle {:.3} mm",
        worst(|l| l.moved.mean),
        worst(|l| l.moved.percentile_95),
        worst(|l| l.contours.mean),
        worst(|l| l.settle_rms),
    ));
}
