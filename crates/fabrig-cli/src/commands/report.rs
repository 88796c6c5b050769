//! `fabrig rig --report`: what was measured on a face, with pictures, as one HTML or PNG file.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Result, bail};
use fabrig_core::mesh::{Mesh, Surface};
use fabrig_core::pipeline::RiggedFace;
use fabrig_core::registration::{DistanceStatistics, OpeningMeasure, OpeningState};
use fabrig_core::render::{
    ColorMap, FaceLook, Image, Layer, Legend, Paint, Picture, Sheet, View, mesh_layers,
};

use super::html::{Figures, escape, page_of, write_page};

/// The colours end here. (mm)
const WORST_SHOWN_MM: f64 = 2.0;
/// Size of a picture. (px)
const SIZE: u32 = 520;

/// Writes the report of a face that was read from `source`.
pub(super) fn write(path: &Path, source: &Path, rigged: &RiggedFace) -> Result<()> {
    let extension = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase());
    let pictures = pictures(rigged)?;
    match extension.as_deref() {
        Some("png") => {
            let mut sheet = Sheet::new().with_title(headline(source, rigged));
            let columns = pictures.len() / 2;
            for (image, caption) in pictures {
                sheet.push(image, caption);
            }
            sheet.compose(columns as u32)?.save_png(path)?;
        }
        Some("html" | "htm") => {
            write_page(path, &page(source, rigged, &pictures)?)?;
        }
        _ => bail!("{}: a report is written as .html or .png", path.display()),
    }
    Ok(())
}

fn headline(source: &Path, rigged: &RiggedFace) -> String {
    let d = &rigged.report.template_to_face;
    format!(
        "{}: template to face median {:.2}, 95% {:.2}, max {:.2} mm",
        source.display(),
        d.median,
        d.p95,
        d.max
    )
}

/// Input, fitted template and its distance from the input, from the front and from the side.
fn pictures(rigged: &RiggedFace) -> Result<Vec<(Image, String)>> {
    let rig = &rigged.rig;
    let look = FaceLook::default();
    let positions = rig.face_in_head();
    let face: Mesh = rig.face.with_positions(positions)?;
    let fitted = &rigged.normalized;
    let surface = Surface::new(face.positions(), &face.triangles())?;
    let map = ColorMap::sequential(0.0, WORST_SHOWN_MM);
    let colors = fitted
        .positions()
        .iter()
        .map(|p| map.color(surface.closest(p).distance.min(WORST_SHOWN_MM)))
        .collect();
    let colored = Layer::from_mesh(fitted)?.with_paint(Paint::Vertex(colors))?;
    let subjects: [(&str, Vec<Layer>, bool); 3] = [
        ("input", mesh_layers(&face, &look)?, false),
        (
            "fitted template",
            vec![look.skin(fitted.positions().to_vec(), fitted.polygons())?],
            false,
        ),
        ("distance from the input", vec![colored], true),
    ];
    let mut images = Vec::new();
    for view_name in ["front", "three-quarter"] {
        let view: View = view_name.parse()?;
        for (name, layers, has_legend) in &subjects {
            let mut picture = Picture::new(SIZE, SIZE)
                .with_view(view)
                .with_focus(fitted.positions().iter().copied())
                .with_layers(layers.iter().cloned());
            if *has_legend {
                picture = picture.with_legend(Legend {
                    map,
                    title: "distance (mm)".to_owned(),
                });
            }
            images.push((picture.render()?, format!("{name}, {view_name}")));
        }
    }
    Ok(images)
}

fn page(source: &Path, rigged: &RiggedFace, pictures: &[(Image, String)]) -> Result<String> {
    let report = &rigged.report;
    let mut rows = String::new();
    let mut row = |name: &str, value: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(
            rows,
            "<tr><th>{}</th><td>{}</td></tr>",
            escape(name),
            escape(&value)
        );
    };
    row("confidence", format!("{:.2}", report.confidence));
    row(
        "unit",
        format!("{:.6} mm per unit of the mesh", report.millimetres_per_unit),
    );
    row("template to face", distances(&report.template_to_face));
    row("face to template", distances(&report.face_to_template));
    if let Some(landmarks) = &report.landmarks {
        row("landmarks", distances(landmarks));
    }
    row("coverage", format!("{:.1} %", 100.0 * report.coverage));
    row("folded triangles", report.folded_triangles.to_string());
    row("self-intersections", report.self_intersections.to_string());
    let [least, low, median] = report.triangle_quality;
    row(
        "triangle quality",
        format!("min {least:.2}, 5 % {low:.2}, median {median:.2} (1 = equilateral)"),
    );
    for (name, opening) in [
        ("mouth", &report.openings.mouth),
        ("left eye", &report.openings.eyes[0]),
        ("right eye", &report.openings.eyes[1]),
    ] {
        row(name, opening_text(opening));
    }
    for cut in &report.cuts {
        row(
            "cut",
            format!(
                "{}, {:.1} mm, new vertices from {} on",
                cut.opening, cut.length_mm, cut.first_new_vertex
            ),
        );
    }
    for warning in &report.warnings {
        row("note", warning.clone());
    }
    row("time", format!("{:.2} s", report.total_seconds()));

    let mut figures = Figures::new()?;
    for (image, caption) in pictures {
        figures.push(image, caption)?;
    }
    Ok(page_of(
        &format!("Face report: {}", source.display()),
        &format!("{}<table>\n{rows}</table>", figures.grid(3)),
    ))
}

fn distances(d: &DistanceStatistics) -> String {
    format!(
        "median {:.2}, rms {:.2}, 95 % {:.2}, max {:.2} mm ({} points)",
        d.median, d.rms, d.p95, d.max, d.count
    )
}

/// One opening in words.
pub(super) fn opening_text(opening: &OpeningMeasure) -> String {
    let state = match opening.state {
        OpeningState::Open => "open",
        OpeningState::Closed => "closed",
        OpeningState::Fused => "fused",
    };
    let inside = match opening.inside_mm {
        Some(mm) => format!("{mm:.1} mm of surface behind the seam"),
        None => "nothing joins the sides".to_owned(),
    };
    format!(
        "{state}, gap {:.1} mm, {inside}; seam off by median {:.2}  95% {:.2} mm",
        opening.gap_mm, opening.seam.median, opening.seam.p95
    )
}
