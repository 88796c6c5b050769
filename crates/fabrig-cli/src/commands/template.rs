//! `fabrig template`: builds and checks packs.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use fabrig_core::anatomy::{self, Resolution};
use fabrig_core::cloth::Materials;
use fabrig_core::facs::{ActionUnitMap, ActionUnitTable};
use fabrig_core::rig::write_template_weights;
use fabrig_core::template::{self, Template};

use super::Outcome;
use crate::cli::TemplateCommand;
use crate::console::Console;

pub(crate) fn run(console: &Console, command: &TemplateCommand) -> Result<Outcome> {
    match command {
        TemplateCommand::Build { data, folder } => build(console, data, folder),
        TemplateCommand::Fit { folder } => fit(console, folder),
        TemplateCommand::Check { folder } => match folder {
            Some(folder) => check(console, &Template::load(folder)?),
            None => check(console, template::human()),
        },
    }
}

fn build(console: &Console, data: &Path, folder: &Path) -> Result<Outcome> {
    let report = template::build::build_template(data, folder)?;
    console.result(&format!(
        "{} vertices, {} faces, {} bytes",
        report.vertex_count, report.face_count, report.byte_count
    ));
    for (shape, amplitude) in &report.amplitudes {
        console.result(&format!("{shape:<24}{amplitude:>8.2} mm"));
    }
    fit(console, folder)
}

/// Fits the skin weights that every face inherits and stores them in the pack.
fn fit(console: &Console, folder: &Path) -> Result<Outcome> {
    let byte_count = write_template_weights(&Template::load(folder)?, folder)?;
    console.result(&format!("skin weights: {byte_count} bytes"));
    Ok(Outcome::Done)
}

/// Reads everything that is read from a pack anywhere.
fn check(console: &Console, template: &Template) -> Result<Outcome> {
    let charts = anatomy::charts(template, Resolution::default())?;
    let patches = anatomy::lay_patches(template, &charts, template.skin.positions())?;
    let materials = Materials::parse(&template.materials)?;
    for chart in &charts {
        materials
            .get(&chart.material)
            .with_context(|| format!("patch {}", chart.name))?;
    }
    let units = ActionUnitTable::parse(&template.action_units)?;
    let shapes: Vec<&str> = template.shapes.iter().map(|s| s.name.as_str()).collect();
    ActionUnitMap::new(&units, &shapes)?;
    for (index, chart) in charts.iter().enumerate() {
        let mirror = &charts[chart.mirror as usize];
        ensure!(
            mirror.mirror as usize == index,
            "patch {} is the mirror of {}, but not the reverse",
            chart.name,
            mirror.name
        );
    }
    let node_count: usize = patches.iter().map(|p| p.neutral.len()).sum();
    let line = |name: &str, value: String| console.result(&format!("{name:<20}{value}"));
    line("template", template.name.clone());
    line(
        "skin",
        format!(
            "{} vertices, {} polygons, {} regions, {} landmarks",
            template.skin.vertex_count(),
            template.skin.face_count(),
            template.regions.regions.len(),
            template.landmarks.len()
        ),
    );
    line("rigid parts", template.rigid_parts.len().to_string());
    line("shapes", template.shapes.len().to_string());
    line("action units", units.units().len().to_string());
    line(
        "patches",
        format!("{} with {node_count} nodes", patches.len()),
    );
    Ok(Outcome::Done)
}
