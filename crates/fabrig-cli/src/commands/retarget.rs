//! `fabrig retarget`: markers or an animated mesh become a take.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, anyhow};
use fabrig_core::Point;
use fabrig_core::facs::{ActionUnitTable, nearest_name};
use fabrig_core::motion::{MarkerTake, write_csv};
use fabrig_core::retarget::{
    Controls, FitOptions, MarkerOptions, MeshMotion, ResponseModel, Retargeted, SiteMotion,
    bind_markers, fit_sites, mesh_sites,
};
use fabrig_core::rig::Rig;
use fabrig_core::template;
use serde_json::json;

use super::animate::load_rig;
use super::{Outcome, check_output};
use crate::cli::RetargetArgs;
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &RetargetArgs) -> Result<Outcome> {
    check_output(&args.output)?;
    let rig = Arc::new(load_rig(&args.rig)?);
    let controls = if args.units.is_empty() {
        Controls::shapes(&rig)
    } else {
        Controls::units(&rig, &ActionUnitTable::bundled()?, &args.units)?
    };
    let is_mesh = args.source.is_dir() || has_extension(&args.source, "npy");
    let fitted = if is_mesh {
        fit_mesh(args, rig, controls)
    } else {
        fit_markers(console, args, rig, controls)
    };
    let fitted = fitted.with_context(|| format!("{} was not fitted", args.source.display()))?;
    write_csv(&fitted.clip, &args.output)
        .with_context(|| format!("cannot write {}", args.output.display()))?;
    print_report(console, args, &fitted)?;
    Ok(Outcome::Done)
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

fn options(args: &RetargetArgs, defaults: FitOptions) -> FitOptions {
    FitOptions {
        noise: args.noise.unwrap_or(defaults.noise),
        ..defaults
    }
}

fn fit_mesh(args: &RetargetArgs, rig: Arc<Rig>, controls: Controls) -> Result<Retargeted> {
    let source = MeshMotion::read(&args.source, args.source_fps)?;
    let sites = mesh_sites(&rig);
    let mut model = ResponseModel::new(rig, controls, sites)?;
    let motion = SiteMotion {
        positions: source.at_sites(&model)?,
        neutral: model.rest(),
        times: source.times,
        has_head_motion: !args.still_head,
    };
    Ok(fit_sites(
        &mut model,
        &motion,
        &options(args, FitOptions::default()),
    )?)
}

fn fit_markers(
    console: &Console,
    args: &RetargetArgs,
    rig: Arc<Rig>,
    controls: Controls,
) -> Result<Retargeted> {
    let take = MarkerTake::read(&args.source)?;
    let places = match &args.places {
        Some(path) => read_places(path, &rig)?,
        None => BTreeMap::new(),
    };
    let bound = bind_markers(
        &take,
        &rig,
        &MarkerOptions {
            neutral: args.neutral,
            places,
        },
    )?;
    let unbound = take.names.len() - bound.names.len();
    if unbound > 0 {
        console.note(&format!(
            "{unbound} markers are not seen while the face is neutral and are left out"
        ));
    }
    let mut model = ResponseModel::new(rig, controls, bound.sites)?;
    let motion = SiteMotion {
        times: take.times,
        neutral: bound.neutral,
        positions: bound.positions,
        has_head_motion: !args.still_head,
    };
    Ok(fit_sites(
        &mut model,
        &motion,
        &options(args, FitOptions::markers()),
    )?)
}

/// Where markers are on the rig's face, from the landmarks that they stand at.
fn read_places(path: &Path, rig: &Rig) -> Result<BTreeMap<String, Point>> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let landmarks: BTreeMap<String, String> = serde_json::from_str(&text).with_context(|| {
        format!(
            "{} is not a JSON object of marker name to landmark name",
            path.display()
        )
    })?;
    let template = template::human();
    landmarks
        .into_iter()
        .map(|(marker, landmark)| {
            let vertex = template.landmarks.get(&landmark).ok_or_else(|| {
                let known = template.landmarks.keys().map(String::as_str);
                let nearest = nearest_name(&landmark, known).unwrap_or_default();
                anyhow!("there is no landmark '{landmark}' (nearest: '{nearest}')")
            })?;
            let place = rig.positions.get(*vertex as usize).copied();
            let place = place.ok_or_else(|| anyhow!("the rig was made with another template"))?;
            Ok((marker, place))
        })
        .collect()
}

fn print_report(console: &Console, args: &RetargetArgs, fitted: &Retargeted) -> Result<()> {
    let report = &fitted.report;
    if args.json {
        let facts = json!({ "take": args.output, "report": report });
        console.result(&serde_json::to_string_pretty(&facts)?);
        return Ok(());
    }
    let line = |name: &str, value: String| console.result(&format!("{name:<20}{value}"));
    line(
        "frames",
        format!(
            "{}, {:.2} s, {} sites, {} times one was not seen",
            report.frames,
            fitted.clip.duration(),
            report.sites,
            report.unseen
        ),
    );
    line(
        "residual",
        format!(
            "rms {:.3}  worst frame {:.3}  max {:.3} mm",
            report.residual_rms, report.residual_worst, report.residual_max
        ),
    );
    line("kkt residual", format!("{:.1e}", report.kkt_residual));
    if !report.unseen_controls.is_empty() {
        line("not seen, at rest", report.unseen_controls.join(" "));
    }
    line("take", args.output.display().to_string());
    Ok(())
}
