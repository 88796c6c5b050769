//! `fabrig bench economy`: the economical run beside the full one, on takes and random scenes.

use std::sync::Arc;

use anyhow::Result;
use fabrig_core::motion::{self, ReadOptions, parse_keys};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{
    Economy, EconomyCase, EconomyFrame, Scene, active_take, economy_case, random_economy_case,
};
use serde_json::json;

use super::demo_scene;
use crate::cli::BenchEconomyArgs;
use crate::commands::Outcome;
use crate::console::Console;

/// A take in which the lower half of the face is still.
const UPPER_HALF: &str = "fabrig-keys 1
0.5 browInnerUp=0 browOuterUp=0
1.0 browInnerUp=0.9 browOuterUp=0.5
2.0 browInnerUp=0.2
3.0 browInnerUp=0.8 browOuterUp=0
4.0 browInnerUp=0 eyeBlink=0
4.2 eyeBlink=1
4.4 eyeBlink=0
5.0 browInnerUp=1
6.0 end
";

/// Length of the take in which all of the face moves. (s)
const ACTIVE: f64 = 6.0;

/// (mm)
const TOLERANCES: [f64; 3] = [0.05, 0.1, 0.2];

pub(crate) fn run(console: &Console, args: &BenchEconomyArgs) -> Result<Outcome> {
    let rig = demo_scene::demo_rig(console)?;
    let mut takes = vec![
        ("the bundled take".to_owned(), demo_scene::take()?),
        (
            "a still lower half".to_owned(),
            parse_keys(UPPER_HALF, "a still lower half")?,
        ),
        (
            "all shapes all the time".to_owned(),
            active_take(&rig.shape_names, ACTIVE)?,
        ),
    ];
    if let Some(path) = &args.motion {
        takes.push((
            path.display().to_string(),
            motion::read(path, &ReadOptions::default())?,
        ));
    }
    let total = (takes.len() * TOLERANCES.len()) as u64 + args.scenes;
    let mut cases = Vec::new();
    let show = |cases: &[EconomyCase]| console.show("scenes", cases.len() as u64, total, "");
    let dt = 1.0 / demo_scene::FPS;
    let scene = Scene::default();
    'measuring: {
        for (name, clip) in &takes {
            let frames = ((clip.duration() / dt) as usize).clamp(1, args.frames);
            for tolerance in TOLERANCES {
                let economy = Economy::within(tolerance);
                let of = (&scene, clip);
                let start = [0.0, dt];
                cases.push(economy_case(
                    name,
                    &rig,
                    of,
                    economy,
                    start,
                    frames,
                    args.repeats,
                )?);
                if show(&cases).is_break() {
                    break 'measuring;
                }
            }
        }
        for seed in args.seed..args.seed + args.scenes {
            cases.push(random(&rig, seed)?);
            if show(&cases).is_break() {
                break;
            }
        }
    }
    console.clear();
    if args.json {
        let rows: Vec<_> = cases
            .iter()
            .map(|case| {
                json!({
                    "case": case,
                    "worst": case.worst(),
                    "broken_bounds": case.broken_bounds(),
                    "time_share": case.time_share(),
                })
            })
            .collect();
        console.result(&serde_json::to_string_pretty(&rows)?);
    } else {
        print(console, &cases);
    }
    if console.is_stopped() {
        return Ok(Outcome::Partial);
    }
    let broken = cases.iter().filter(|case| case.broken_bounds() > 0).count();
    if broken > 0 {
        anyhow::bail!("the bound was violated in {broken} of {} runs", cases.len());
    }
    Ok(Outcome::Done)
}

fn random(rig: &Arc<Rig>, seed: u64) -> Result<EconomyCase> {
    Ok(random_economy_case(rig, seed)?)
}

fn print(console: &Console, cases: &[EconomyCase]) {
    console.result(&format!(
        "{:<24}{:>7}{:>11}{:>10}{:>10}{:>10}{:>10}{:>8}{:>9}{:>8}{:>8}{:>8}{:>8}",
        "run",
        "frames",
        "tolerance",
        "patch",
        "skin rms",
        "skin max",
        "bound",
        "broken",
        "in storm",
        "asleep",
        "substeps",
        "skin",
        "time"
    ));
    for case in cases {
        let count = case.frames.len() as f64;
        let most =
            |of: &dyn Fn(&EconomyFrame) -> f64| case.frames.iter().map(of).fold(0.0, f64::max);
        let share = |of: &dyn Fn(&EconomyFrame) -> [u32; 2]| {
            let (part, whole) = case.frames.iter().map(of).fold((0, 0), |(a, b), [p, w]| {
                (a + u64::from(p), b + u64::from(w))
            });
            part as f64 / whole.max(1) as f64
        };
        console.result(&format!(
            "{:<24}{:>7}{:>11.3}{:>10.4}{:>10.4}{:>10.3}{:>10.3}{:>8}{:>9}{:>8.2}{:>8.2}{:>8.2}{:>8.2}",
            case.name,
            count,
            case.tolerance,
            most(&|f| f.patch),
            most(&|f| f.skin),
            most(&|f| f.vertex),
            most(&|f| f.report.bound),
            case.broken_bounds(),
            case.storm_frames(),
            share(&|f| [f.report.sleeping, f.report.patches]),
            share(&|f| [f.report.substeps, f.report.full_substeps]),
            share(&|f| [f.report.skin_moved, f.report.skin_vertices]),
            case.time_share()
        ));
    }
}
