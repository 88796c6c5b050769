//! `fabrig rig --report`: what was measured on a face, with pictures, as one HTML or PNG file.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result, bail};
use fabrig_core::Point;
use fabrig_core::atomic_file::write_atomically;
use fabrig_core::mesh::{Mesh, Surface};
use fabrig_core::pipeline::RiggedFace;
use fabrig_core::registration::{DistanceStatistics, OpeningMeasure, OpeningState};
use fabrig_core::render::{
    ColorMap, FaceLook, Image, Layer, Legend, Paint, Picture, Sheet, View, mesh_layers,
};

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
            let text = page(source, rigged, &pictures)?;
            write_atomically(path, |out| out.write_all(text.as_bytes()))
                .with_context(|| format!("cannot write {}", path.display()))?;
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
    let positions: Vec<Point> = rig
        .face
        .positions()
        .iter()
        .map(|p| rig.to_head * p)
        .collect();
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

    let mut figures = String::new();
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let file = folder.path().join("picture.png");
    for (image, caption) in pictures {
        image.save_png(&file)?;
        let bytes = std::fs::read(&file).context("cannot read a picture back")?;
        let _ = writeln!(
            figures,
            "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}\
             </figcaption></figure>",
            escape(caption),
            base64(&bytes)
        );
    }
    Ok(format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\n\
         <style>body{{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:1100px;\
         padding:0 1em;color:#222;background:#fafbfc}}h1{{font-size:1.3em}}\
         .pictures{{display:grid;grid-template-columns:repeat(3,1fr);gap:8px}}\
         figure{{margin:0}}img{{width:100%}}figcaption{{font-size:.85em;color:#555}}\
         table{{border-collapse:collapse;margin-top:1.5em}}th,td{{text-align:left;\
         padding:.25em .9em .25em 0;border-bottom:1px solid #ddd;vertical-align:top}}\
         th{{white-space:nowrap;font-weight:600}}</style></head>\n\
         <body><h1>{title}</h1>\n<div class=\"pictures\">\n{figures}</div>\n\
         <table>\n{rows}</table></body></html>\n",
        title = escape(&format!("Face report: {}", source.display()))
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

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let at = |k: usize| u32::from(chunk.get(k).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        for k in 0..4 {
            if k <= chunk.len() {
                let digit = bits >> (18 - 6 * k) & 63;
                text.push(char::from(DIGITS[digit as usize]));
            } else {
                text.push('=');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_pads_as_the_standard_says() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }
}
