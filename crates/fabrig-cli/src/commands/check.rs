//! `fabrig check`: whether every shape of a rig does on its face what it should.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use fabrig_core::Point;
use fabrig_core::collision::PairMask;
use fabrig_core::evaluation::{CheckGates, CheckReport, GATES, RigCheck, ShapeCheck, check_rig};
use fabrig_core::render::{
    ColorMap, FaceLook, Framing, Image, Layer, Legend, Paint, Picture, Points, Rgb, View,
    simulation_layers,
};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{Dynamics, FacePose, Scene, Simulation, hold_pose};
use fabrig_core::template::Template;
use serde_json::json;

use super::animate::load_rig;
use super::html::{Figures, escape, page_of, table, write_page};
use super::{Outcome, check_output, template_of};
use crate::cli::CheckArgs;
use crate::console::Console;

/// The colours of the confidence map end here. (mm)
const WORST_SHOWN_MM: f64 = 2.0;
/// Sizes of pictures. (px)
const MAP_SIZE: u32 = 460;
const SHAPE_SIZE: u32 = 280;

pub(crate) fn run(console: &Console, args: &CheckArgs) -> Result<Outcome> {
    if let Some(path) = &args.report {
        check_output(path)?;
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        ensure!(
            extension.is_some_and(|e| e == "html" || e == "htm"),
            "{}: a report is written as .html",
            path.display()
        );
    }
    let mut gates = CheckGates::default();
    for (name, limit) in &args.gate {
        gates.set(name, *limit);
    }
    let template = template_of(args.template.as_deref())?;
    let rig = Arc::new(load_rig(&args.rig)?);
    let total = rig.shape_names.len() as u64;
    let scene = if args.contact {
        let mut scene = Scene::default();
        scene.contact.pairs = PairMask::Sphincter;
        scene
    } else {
        Scene::without_dynamics()
    };
    let check = check_rig(&rig, &template, &gates, &scene, &mut |shape| {
        console.show("check", shape as u64, total, &rig.shape_names[shape])
    });
    console.clear();
    let check = check.with_context(|| format!("{} was not checked", args.rig.display()))?;
    if let Some(path) = &args.report {
        let page = page(console, &args.rig, &rig, &template, &scene, &check)?;
        write_page(path, &page)?;
    }
    let report = &check.report;
    if args.json {
        let mut value = serde_json::to_value(report)?;
        value["passes"] = json!(report.passes());
        console.result(&serde_json::to_string_pretty(&value)?);
    } else {
        print(console, report);
    }
    Ok(if report.passes() {
        Outcome::Done
    } else {
        Outcome::Partial
    })
}

/// Heads and cells of the table of shapes.
const COLUMNS: [&str; 12] = [
    "shape",
    "mm",
    "template",
    "ratio",
    "direction",
    "wrong side",
    "torn",
    "leak mm",
    "flipped",
    "area",
    "lips mm",
    "lids mm",
];

fn cells(shape: &ShapeCheck) -> [String; 12] {
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |x| format!("{x:.2}"));
    let depth = |pairs: usize, mm: f64| {
        if pairs == 0 {
            "-".to_owned()
        } else {
            format!("{mm:.2}")
        }
    };
    let [least, most] = shape.area_ratios;
    [
        match &shape.over {
            Some(base) => format!("{} over {base}", shape.shape),
            None => shape.shape.clone(),
        },
        format!("{:.1}", shape.amplitude_mm.max(shape.parts_mm)),
        format!("{:.1}", shape.template_mm),
        number(shape.ratio),
        number(shape.direction),
        shape.wrong_side.to_string(),
        shape.torn_edges.to_string(),
        number(shape.leak_mm),
        shape.flipped.to_string(),
        format!("{least:.2}-{most:.2}"),
        depth(shape.lip_crossings, shape.lip_depth_mm),
        depth(shape.lid_crossings, shape.lid_depth_mm),
    ]
}

fn print(console: &Console, report: &CheckReport) {
    let width = |k: usize| if k == 0 { 26 } else { 11 };
    let line = |cells: &[String]| {
        let mut line = String::new();
        for (k, cell) in cells.iter().enumerate() {
            // Writing to a string cannot fail.
            let _ = if k == 0 {
                write!(line, "{cell:<0$}", width(k))
            } else {
                write!(line, "{cell:>0$}", width(k))
            };
        }
        console.result(line.trim_end());
    };
    line(&COLUMNS.map(str::to_owned));
    report.shapes.iter().for_each(|shape| line(&cells(shape)));
    console.result("");
    let d = &report.distance;
    console.result(&format!(
        "{:<20}median {:.2}  95% {:.2}  max {:.2} mm from the registered template",
        "face", d.median, d.p95, d.max
    ));
    for muscle in &report.muscles {
        console.result(&format!(
            "{:<20}{}: ratio {:.2}, direction {:.2}",
            "muscle", muscle.name, muscle.ratio, muscle.direction
        ));
    }
    for note in &report.notes {
        console.result(&format!("{:<20}{note}", "note"));
    }
    for finding in &report.findings {
        let vertex = finding.vertex.map(|v| format!(", at vertex {v}"));
        console.result(&format!(
            "{:<20}{}{} (limit {})",
            finding.gate,
            finding.text,
            vertex.unwrap_or_default(),
            finding.limit
        ));
    }
    console.result(&format!(
        "{:<20}{}",
        "result",
        match report.findings.len() {
            0 => "passes".to_owned(),
            count => format!("{count} findings"),
        }
    ));
}

fn page(
    console: &Console,
    source: &Path,
    rig: &Arc<Rig>,
    template: &Template,
    scene: &Scene,
    check: &RigCheck,
) -> Result<String> {
    let report = &check.report;
    let mut body = String::new();
    let verdict = if report.passes() {
        "<p>Every gate holds.</p>\n".to_owned()
    } else {
        format!("<p class=\"bad\">{} findings</p>\n", report.findings.len())
    };
    body += &verdict;
    body += &table(
        &["gate", "what", "limit", "found"],
        report.findings.iter().map(|finding| {
            let at = finding.vertex.map(|v| format!(", vertex {v}"));
            [
                finding.gate.to_owned(),
                format!("{}{}", finding.text, at.unwrap_or_default()),
                finding.limit.to_string(),
                format!("{:.2}", finding.value),
            ]
        }),
        |_| true,
    );
    for note in &report.notes {
        body += &format!("<p>{}</p>\n", escape(note));
    }
    body += "<h2>Confidence: distance of the face from the registered template</h2>\n";
    let held = Framing::Face.points(template, &rig.positions, &rig.jaw.hinge);
    let mut figures = Figures::new()?;
    for view in ["front", "three-quarter", "side"] {
        figures.push(&confidence(rig, check, view.parse()?)?, view)?;
    }
    body += &figures.grid(3);
    body += &table(
        &["region", "vertices", "median mm", "95 % mm", "max mm"],
        report.regions.iter().map(|region| {
            let d = &region.distance;
            [
                region.region.clone(),
                d.count.to_string(),
                format!("{:.2}", d.median),
                format!("{:.2}", d.p95),
                format!("{:.2}", d.max),
            ]
        }),
        |_| false,
    );
    body += "<h2>Shapes at weight 1; red dots are what findings are about</h2>\n";
    body += &shape_pictures(console, rig, scene, check, &held)?.grid(4);
    let is_bad = |name: &str| {
        let mut findings = report.findings.iter();
        findings.any(|f| f.shape.as_deref() == Some(name))
    };
    body += "<div class=\"wide\">";
    body += &table(&COLUMNS, report.shapes.iter().map(cells), |row| {
        is_bad(row[0].split(' ').next().unwrap_or_default())
    });
    body += "</div>\n";
    body += &table(
        &["muscle shape", "template mm", "ratio", "direction"],
        report.muscles.iter().map(|muscle| {
            [
                muscle.name.clone(),
                format!("{:.2}", muscle.template_mm),
                format!("{:.2}", muscle.ratio),
                format!("{:.2}", muscle.direction),
            ]
        }),
        |row| is_bad(&row[0]),
    );
    body += "<h2>Gates</h2>\n";
    body += &table(
        &["gate", "meaning", "limit"],
        GATES.iter().map(|gate| {
            let limit = report.gates.get(gate.name).unwrap_or_default();
            [
                gate.name.to_owned(),
                gate.meaning.to_owned(),
                limit.to_string(),
            ]
        }),
        |_| false,
    );
    Ok(page_of(&format!("Rig check: {}", source.display()), &body))
}

/// The mesh at rest, coloured by how far it is from the registered template.
fn confidence(rig: &Rig, check: &RigCheck, view: View) -> Result<Image> {
    let map = ColorMap::sequential(0.0, WORST_SHOWN_MM);
    let no_skin = Rgb::from_srgb([205, 205, 205]);
    let colors = check
        .distances
        .iter()
        .map(|d| d.map_or(no_skin, |d| map.color(d)))
        .collect();
    let positions: Vec<Point> = rig.skin_at_rest().iter().map(|p| p.cast()).collect();
    let layer = Layer::from_polygons(positions, rig.face.polygons())?;
    let picture = Picture::new(MAP_SIZE, MAP_SIZE)
        .with_view(view)
        .with_focus(rig.positions.iter().copied())
        .with_layer(layer.with_paint(Paint::Vertex(colors))?)
        .with_legend(Legend {
            map,
            title: "distance (mm)".to_owned(),
        });
    Ok(picture.render()?)
}

/// Every shape at weight 1.
fn shape_pictures(
    console: &Console,
    rig: &Arc<Rig>,
    scene: &Scene,
    check: &RigCheck,
    held: &[Point],
) -> Result<Figures> {
    let mut simulation = Simulation::new(Arc::clone(rig), scene.clone(), None)?;
    let mut figures = Figures::new()?;
    let total = check.report.shapes.len() as u64;
    for (index, shape) in check.report.shapes.iter().enumerate() {
        if console
            .show("pictures", index as u64, total, &shape.shape)
            .is_break()
        {
            anyhow::bail!("stopped; nothing was written");
        }
        let mut pose = FacePose::neutral(rig.shape_names.len());
        pose.weights[index] = 1.0;
        if let Some(base) = shape.over.as_deref().and_then(|base| rig.shape_index(base)) {
            pose.weights[base] = 1.0;
        }
        match scene.dynamics {
            Dynamics::None => simulation.reset(pose)?,
            Dynamics::Cloth => hold_pose(&mut simulation, &pose)?,
        }
        let skin = simulation.skin();
        let marks = check.marked[index].iter();
        let picture = Picture::new(SHAPE_SIZE, SHAPE_SIZE)
            .with_focus(held.iter().copied())
            .with_layers(simulation_layers(&simulation, &FaceLook::default())?)
            .with_points(Points {
                centers: marks.map(|&v| skin[v as usize].cast()).collect(),
                radius: 1.6,
                color: Rgb::from_srgb([220, 30, 30]),
            });
        let mut findings = check.report.findings.iter();
        let is_bad = findings.any(|f| f.shape.as_deref() == Some(&shape.shape));
        let class = if is_bad { "bad" } else { "" };
        figures.push_as(&picture.render()?, &shape.shape, class)?;
    }
    console.clear();
    Ok(figures)
}
