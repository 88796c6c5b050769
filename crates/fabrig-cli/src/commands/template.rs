//! `fabrig template`: builds and checks packs.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, anyhow, bail, ensure};
use fabrig_core::anatomy::{self, Resolution};
use fabrig_core::cloth::Materials;
use fabrig_core::evaluation::{CheckGates, check_rig};
use fabrig_core::facs::{ARKIT_SHAPES, ActionUnitMap, ActionUnitTable, expression_sheet};
use fabrig_core::mesh::io::read_mesh;
use fabrig_core::pipeline::{
    OwnTemplateOptions, neutral_of_shapes, read_own_shapes, template_from_face,
};
use fabrig_core::registration::{RegistrationOptions, read_landmarks};
use fabrig_core::render::{
    FaceLook, Framing, Picture, Sheet, patch_layers, posed_template_layers, template_layers,
};
use fabrig_core::rig::{
    RigOptions, rig_of_template, stored_template_weights, write_template_weights,
};
use fabrig_core::scene::Scene;
use fabrig_core::template::{self, Template};

use super::{Outcome, check_output, stem, template_of};
use crate::cli::{TemplateBuildArgs, TemplateCommand};
use crate::console::Console;

/// The folder of the bundled template, and what its source has in it.
const BUNDLED: &str = "templates/human";
const BUNDLED_SOURCE: &str = "mpfb2";
/// Size of a picture. (px)
const SIZE: u32 = 360;

pub(crate) fn run(console: &Console, command: &TemplateCommand) -> Result<Outcome> {
    match command {
        TemplateCommand::Build(args) if args.source.join(BUNDLED_SOURCE).is_dir() => {
            let folder = args.folder.as_deref().unwrap_or(Path::new(BUNDLED));
            build(console, &args.source, folder)
        }
        TemplateCommand::Build(args) => build_own(console, args),
        TemplateCommand::Fit { folder } => fit(console, folder),
        TemplateCommand::Check { folder, picture } => {
            if let Some(path) = picture {
                check_output(path)?;
            }
            let template = template_of(folder.as_deref())?;
            let outcome = check(console, &template)?;
            if let Some(path) = picture {
                draw(&template, path)?;
                console.result(&format!("{:<20}{}", "picture", path.display()));
            }
            Ok(outcome)
        }
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

/// A pack from a rig that somebody has.
fn build_own(console: &Console, args: &TemplateBuildArgs) -> Result<Outcome> {
    let folder = args.folder.as_deref().ok_or_else(|| {
        anyhow!(
            "a template of your own needs a folder to go to: fabrig template build {} FOLDER",
            args.source.display()
        )
    })?;
    let base = template::human();
    let path = neutral_of_shapes(&args.source)?.ok_or_else(|| {
        anyhow!(
            "{}: a folder needs one mesh with 'neutral' in its name",
            args.source.display()
        )
    })?;
    let neutral = read_mesh(&path)?;
    let own = read_own_shapes(&args.source, &neutral, base)
        .and_then(|own| own.without_scans(&neutral))
        .with_context(|| format!("shapes of {}", path.display()))?;
    let mut registration = RegistrationOptions::default();
    if let Some(path) = &args.landmarks {
        registration.landmarks = read_landmarks(path, None)?;
    }
    let options = OwnTemplateOptions {
        name: args.name.clone().unwrap_or_else(|| stem(folder)),
        credit: args.credit.clone(),
        registration,
    };
    if options.name == base.name {
        bail!(
            "'{}' is the bundled template; give another --name",
            base.name
        );
    }
    let made = template_from_face(&neutral, &own.expressions, base, &options, &mut |step| {
        console.share(step.stage, step.fraction)
    });
    console.clear();
    let made = made.with_context(|| format!("{} gave no template", path.display()))?;
    made.template.save(folder)?;
    let line = |name: &str, value: String| console.result(&format!("{name:<20}{value}"));
    let d = &made.report.template_to_face;
    line(
        "registration",
        format!(
            "median {:.2}  95% {:.2}  max {:.2} mm",
            d.median, d.p95, d.max
        ),
    );
    line(
        "asymmetry",
        format!("{:.2} mm in the mean, averaged out", made.asymmetry_mm),
    );
    line("own shapes", made.own.len().to_string());
    if !made.borrowed.is_empty() {
        line(
            "borrowed shapes",
            format!(
                "{} of {}: {}",
                made.borrowed.len(),
                base.name,
                made.borrowed.join(" ")
            ),
        );
    }
    for (path, reason) in &own.skipped {
        line("note", format!("{} passed over: {reason}", path.display()));
    }
    for warning in &made.report.warnings {
        line("note", warning.clone());
    }
    fit(console, folder)?;
    line("template", folder.display().to_string());
    Ok(Outcome::Done)
}

/// Fits the skin weights that every face inherits and stores them in the pack.
fn fit(console: &Console, folder: &Path) -> Result<Outcome> {
    let byte_count = write_template_weights(&Template::load(folder)?, folder)?;
    console.result(&format!("{:<20}{byte_count} bytes", "skin weights"));
    Ok(Outcome::Done)
}

/// Reads everything that is read from a pack anywhere, and holds its shapes on itself.
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
    let missing: Vec<&str> = ARKIT_SHAPES
        .into_iter()
        .filter(|name| template.shape_index(name).is_none())
        .collect();
    if !missing.is_empty() {
        line("note", format!("without {}", missing.join(" ")));
    }
    line("action units", units.units().len().to_string());
    line(
        "patches",
        format!("{} with {node_count} nodes", patches.len()),
    );
    let options = RigOptions::default();
    let weights = stored_template_weights(template, &options)?;
    line(
        "skin weights",
        match weights {
            Some(_) => "stored".to_owned(),
            None => "none for these shapes; `fabrig template fit` stores them".to_owned(),
        },
    );
    let rig = Arc::new(rig_of_template(template, &options)?);
    let scene = Scene::without_dynamics();
    let check = check_rig(&rig, template, &CheckGates::default(), &scene, &mut |_| {
        console.share("check", 0.0)
    })?;
    console.clear();
    for finding in &check.report.findings {
        line(finding.gate, finding.text.clone());
    }
    Ok(if check.report.passes() {
        line("result", "passes".to_owned());
        Outcome::Done
    } else {
        line(
            "result",
            format!("{} findings", check.report.findings.len()),
        );
        Outcome::Partial
    })
}

/// Skin, muscles and twelve expressions as the pack's shapes have them.
fn draw(template: &Template, path: &Path) -> Result<()> {
    let look = FaceLook::default();
    let charts = anatomy::charts(template, Resolution::default())?;
    let patches = anatomy::lay_patches(template, &charts, template.skin.positions())?;
    let mut sheet = Sheet::new().with_title(template.name.clone());
    for view in ["front", "three-quarter"] {
        let (muscles, _) = patch_layers(&patches)?;
        for (name, layers) in [
            ("skin", template_layers(template, &look)?),
            ("muscles", muscles),
        ] {
            let picture = Picture::new(SIZE, SIZE)
                .with_view(view.parse()?)
                .with_focus(template.skin.positions().iter().copied())
                .with_layers(layers);
            sheet.push(picture.render()?, format!("{name}, {view}"));
        }
    }
    let shapes: Vec<String> = template.shapes.iter().map(|s| s.name.clone()).collect();
    let held = Framing::Face.points(template, template.skin.positions(), &template.jaw);
    for (name, weights) in expression_sheet("motion", &shapes)? {
        let picture = Picture::new(SIZE, SIZE)
            .with_focus(held.iter().copied())
            .with_layers(posed_template_layers(template, &weights, &look)?);
        sheet.push(picture.render()?, name);
    }
    sheet.compose(4)?.save_png(path)?;
    Ok(())
}
