//! The report of a batch as a page: counts, what went wrong, a picture of every face.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use fabrig_core::batch::BatchReport;
use fabrig_core::edit::load_edited_rig;
use fabrig_core::render::{FaceLook, Image, Picture, simulation_layers};
use fabrig_core::scene::{FacePose, Scene, Simulation};

use super::html::{Figures, escape, page_of, table, write_page};
use crate::console::Console;

/// Pixels of a face's picture.
const SIZE: u32 = 220;
/// Faces that are drawn; the rest is in the table.
const MOST_PICTURES: usize = 400;

pub(super) fn write(console: &Console, path: &Path, report: &BatchReport) -> Result<()> {
    let mut body = summary(report);
    body += &pictures(console, report)?;
    body += "<h2>Faces</h2>\n<div class=\"wide\">";
    let or_none = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
    body += &table(
        &[
            "face",
            "outputs",
            "template to face: median mm",
            "95 % mm",
            "largest mm",
            "confidence",
            "folds",
            "notes",
        ],
        report.faces.iter().map(|face| {
            let to_face = |k: usize| or_none(face.template_to_face_mm.map(|mm| mm[k]));
            [
                face.face.clone(),
                format!("{} of {}", face.outputs[0], face.outputs[1]),
                to_face(0),
                to_face(1),
                to_face(2),
                or_none(face.confidence),
                face.folded_triangles
                    .map_or("-".to_owned(), |n| n.to_string()),
                face.notes.join("; "),
            ]
        }),
        |row| {
            let mut ends = row[1].split(" of ");
            ends.next() != ends.next()
        },
    );
    body += "</div>\n<h2>Takes</h2>\n<div class=\"wide\">";
    body += &table(
        &[
            "output",
            "face",
            "take",
            "scene",
            "simulated s",
            "took s",
            "from muscle shapes, mm rms",
            "guards",
        ],
        report.pairs.iter().map(|pair| {
            [
                pair.output.clone(),
                pair.face.clone(),
                pair.take.clone(),
                pair.scene.clone(),
                format!("{:.2}", pair.simulated_secs),
                format!("{:.2}", pair.seconds),
                or_none(pair.settle_rms_max),
                pair.guards.map_or("-".to_owned(), |n| n.to_string()),
            ]
        }),
        |_| false,
    );
    body += "</div>\n";
    let title = format!("Batch: {}", report.manifest.display());
    write_page(path, &page_of(&title, &body))
}

fn summary(report: &BatchReport) -> String {
    let counts = &report.counts;
    let class = if report.is_complete {
        ""
    } else {
        " class=\"bad\""
    };
    let throughput = report.throughput.map_or(String::new(), |rate| {
        format!(" {rate:.2} simulated seconds per second.")
    });
    let accuracy: Vec<String> = report
        .accuracy
        .iter()
        .map(|row| {
            let cloth = if row.has_dynamics {
                format!("{} substeps per 1/60 s", row.substeps)
            } else {
                "without dynamics".to_owned()
            };
            format!("{}: {cloth}", escape(&row.scene))
        })
        .collect();
    let mut body = format!(
        "<p{class}>{} of {} outputs: {} made, {} up to date, {} failed, {} lost, {} stopped.</p>\n\
         <p>{:.1} s with {} workers ({}).{throughput} {}</p>\n",
        counts.done + counts.up_to_date,
        counts.jobs,
        counts.done,
        counts.up_to_date,
        counts.failed,
        counts.lost,
        counts.stopped,
        report.run.wall_secs,
        report.run.workers,
        escape(&report.run.engine),
        accuracy.join("; ")
    );
    body += &table(
        &["went wrong", "what", "outputs lost"],
        report.failures.iter().map(|row| {
            [
                row.failure.subject.clone(),
                row.failure.message.clone(),
                row.outputs.join(", "),
            ]
        }),
        |_| true,
    );
    body
}

/// Every face that has a rig, at rest.
fn pictures(console: &Console, report: &BatchReport) -> Result<String> {
    let mut figures = Figures::new()?;
    let faces = report
        .faces
        .iter()
        .filter_map(|face| Some((face, face.rig.as_ref()?)));
    let faces: Vec<_> = faces.take(MOST_PICTURES).collect();
    for (index, (face, rig)) in faces.iter().enumerate() {
        let stop = console.show("pictures", index as u64, faces.len() as u64, &face.face);
        if stop.is_break() {
            break;
        }
        let class = if face.outputs[0] == face.outputs[1] {
            ""
        } else {
            "bad"
        };
        let image = picture(&report.out.join(rig))
            .with_context(|| format!("{} cannot be drawn", face.face))?;
        figures.push_as(&image, &face.face, class)?;
    }
    console.clear();
    Ok(figures.grid(6))
}

fn picture(rig: &Path) -> Result<Image> {
    let rig = Arc::new(load_edited_rig(rig)?);
    let focus = rig.positions.clone();
    let pose = FacePose::neutral(rig.shape_names.len());
    let mut simulation = Simulation::new(rig, Scene::without_dynamics(), None)?;
    simulation.reset(pose)?;
    let picture = Picture::new(SIZE, SIZE)
        .with_focus(focus)
        .with_layers(simulation_layers(&simulation, &FaceLook::default())?);
    Ok(picture.render()?)
}
