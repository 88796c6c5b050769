//! `fabrig bench soft-tissue`: volume of fat under any gravity, and how it rings.

use std::sync::Arc;

use anyhow::Result;
use fabrig_core::evaluation::{gravity_directions, pad_rings, pad_volumes};
use fabrig_core::pipeline::RigFaceOptions;
use fabrig_core::scene::Scene;
use fabrig_core::template;
use serde_json::json;

use crate::cli::BenchSoftTissueArgs;
use crate::commands::Outcome;
use crate::commands::animate::apply_presets;
use crate::commands::rig;
use crate::console::Console;

/// Sideways and upwards at one g. (mm/s^2)
const PUSHES: [(&str, [f32; 3]); 2] = [
    ("sideways", [9810.0, 0.0, 0.0]),
    ("upwards", [0.0, 9810.0, 0.0]),
];

pub(crate) fn run(console: &Console, args: &BenchSoftTissueArgs) -> Result<Outcome> {
    let options = RigFaceOptions::default();
    let mut face = rig::rig(console, &template::demo_face(), &options)?.rig;
    apply_presets(&mut face, &args.preset)?;
    let face = Arc::new(face);
    let scene = Scene::default();
    let volumes = pad_volumes(&face, &scene, &gravity_directions())?;
    let mut rings = Vec::new();
    for (name, push) in PUSHES {
        rings.push((name, pad_rings(&face, &scene, push.into())?));
    }
    if args.json {
        let rings: Vec<_> = rings
            .iter()
            .map(|(push, pads)| json!({ "push": push, "pads": pads }))
            .collect();
        let both = json!({ "volumes": volumes, "rings": rings });
        console.result(&serde_json::to_string_pretty(&both)?);
        return Ok(Outcome::Done);
    }
    console.result(&format!(
        "{:<22}{:>12}{:>14}{:>12}   26 directions of gravity",
        "pad", "rest mm^3", "worst change", "sag mm"
    ));
    for pad in &volumes {
        console.result(&format!(
            "{:<22}{:>12.0}{:>13.2}%{:>12.2}",
            pad.patch,
            pad.rest,
            100.0 * pad.worst,
            pad.sag
        ));
    }
    for (name, pads) in &rings {
        console.result(&format!(
            "\n{:<22}{:>8}{:>8}{:>8}{:>8}{:>8}{:>9}{:>9}{:>8}{:>8}",
            format!("let go, {name}"),
            "lag mm",
            "said",
            "Hz",
            "said",
            "ratio",
            "damping",
            "said",
            "ratio",
            "own Hz",
        ));
        for pad in pads {
            let (Some(rang), Some(said), Some([frequency, damping])) =
                (pad.measured, pad.predicted, pad.ratios())
            else {
                console.result(&format!("{:<22}{:>8.2}  does not ring", pad.patch, pad.lag));
                continue;
            };
            console.result(&format!(
                "{:<22}{:>8.2}{:>8.2}{:>8.2}{:>8.2}{:>8.2}{:>9.3}{:>9.3}{:>8.2}{:>8.2}",
                pad.patch,
                pad.lag,
                pad.predicted_lag,
                rang.frequency,
                said.frequency,
                frequency,
                rang.damping_ratio,
                said.damping_ratio,
                damping,
                pad.alone.frequency,
            ));
        }
    }
    Ok(Outcome::Done)
}
