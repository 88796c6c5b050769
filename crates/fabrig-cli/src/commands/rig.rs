//! `fabrig rig`: a mesh becomes a rig.

use anyhow::{Context, Result};
use fabrig_core::mesh::Mesh;
use fabrig_core::mesh::io::{read_mesh, write_obj};
use fabrig_core::pipeline::{OwnShapes, RigFaceOptions, RiggedFace, read_own_shapes, rig_face};
use fabrig_core::registration::{CutSeams, DistanceStatistics, LandmarkOrder, read_landmarks};
use fabrig_core::rig::SkinRefinement;
use fabrig_core::template::{Template, human};

use super::animate::apply_presets;
use super::{Outcome, check_output, report, template_of};
use crate::cli::{Order, RigArgs, Seam};
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &RigArgs) -> Result<Outcome> {
    check_output(&args.output)?;
    for path in [&args.normalized, &args.skin, &args.report]
        .into_iter()
        .flatten()
    {
        check_output(path)?;
    }
    let mut options = RigFaceOptions {
        source: Some(args.face.clone()),
        ..RigFaceOptions::default()
    };
    options.registration.unit_mm = args.unit.map(crate::cli::Unit::millimetres);
    if let Some(path) = &args.landmarks {
        let order = args.landmarks_order.map(|order| match order {
            Order::Ibug68 => LandmarkOrder::Ibug68,
            Order::Mediapipe => LandmarkOrder::MediaPipe,
        });
        options.registration.landmarks = read_landmarks(path, order)?;
    }
    options.cut_seams = CutSeams {
        mouth: args.cut_seams.contains(&Seam::Mouth),
        eyes: args.cut_seams.contains(&Seam::Eyes),
    };
    let face = read_mesh(&args.face)?;
    let template = template_of(args.template.as_deref())?;
    if let Some(offsets) = args.offsets {
        options.rig.offsets = offsets.into();
    }
    options.rig.alpha = args.alpha.into();
    options.rig.resolution = args.resolution.unwrap_or_default().resolution();
    options.refinement = args.refine_skin.map(SkinRefinement::to);
    let own = match &args.shapes {
        Some(source) => Some(read_own_shapes(source, &face, &template)?),
        None => None,
    };
    if let Some(own) = &own {
        options.expressions.clone_from(&own.expressions);
        options.expressions_on.clone_from(&own.neutral);
        options.scans.clone_from(&own.scans);
    }
    let mut rigged = rig_on(console, &face, &template, &options)
        .with_context(|| format!("{} was not rigged", args.face.display()))?;
    apply_presets(&mut rigged.rig, &args.preset)?;
    rigged.rig.save(&args.output)?;
    if let Some(path) = &args.normalized {
        write_obj(path, &rigged.normalized)?;
    }
    if let Some(path) = &args.report {
        report::write(path, &args.face, &rigged)?;
    }
    if let Some(path) = &args.skin {
        write_obj(path, &rigged.rig.face)?;
    }
    if args.json {
        console.result(&serde_json::to_string_pretty(&rigged.report)?);
    } else {
        print_report(console, &rigged);
        if let Some(own) = &own {
            print_own_shapes(console, own, &template, &rigged);
        }
        console.result(&format!("{:<20}{}", "rig", args.output.display()));
    }
    Ok(Outcome::Done)
}

/// Rigs with the bundled template and a progress bar.
pub(super) fn rig(console: &Console, face: &Mesh, options: &RigFaceOptions) -> Result<RiggedFace> {
    rig_on(console, face, human(), options)
}

/// Rigs with a template and a progress bar.
fn rig_on(
    console: &Console,
    face: &Mesh,
    template: &Template,
    options: &RigFaceOptions,
) -> Result<RiggedFace> {
    let rigged = rig_face(face, template, options, &mut |step| {
        console.share(step.stage, step.fraction)
    });
    console.clear();
    Ok(rigged?)
}

/// What the face's own expressions were good for.
fn print_own_shapes(console: &Console, own: &OwnShapes, template: &Template, rigged: &RiggedFace) {
    let mut alphas: Vec<f64> = rigged
        .rig
        .patches
        .iter()
        .map(|patch| patch.transfer.alpha)
        .collect();
    alphas.sort_by(f64::total_cmp);
    let open = rigged.rig.jaw.hinge.open_angle / template.jaw.open_angle;
    console.result(&format!(
        "{:<20}{}, amplitudes of the patches {:.2} to {:.2}, median {:.2}; the jaw opens {:.2} times \
         as far",
        "own shapes",
        own.expressions.len() + rigged.scans.iter().filter(|s| s.problem.is_none()).count(),
        alphas.first().unwrap_or(&1.0),
        alphas.last().unwrap_or(&1.0),
        alphas.get(alphas.len() / 2).unwrap_or(&1.0),
        open,
    ));
    for scan in &rigged.scans {
        let (Some(amplitude), Some(distance)) = (scan.amplitude, &scan.distance) else {
            continue;
        };
        console.result(&format!(
            "{:<20}{}: {} at {amplitude:.2} times the template's amplitude, median {:.2}  95% \
             {:.2} mm from it",
            "scan",
            scan.path.display(),
            scan.name,
            distance.median,
            distance.p95,
        ));
    }
    for (path, reason) in &own.skipped {
        console.result(&format!(
            "{:<20}{} passed over: {reason}",
            "note",
            path.display()
        ));
    }
}

/// What registration measured, for people.
pub(super) fn print_report(console: &Console, rigged: &RiggedFace) {
    let report = &rigged.report;
    let line = |name: &str, value: String| console.result(&format!("{name:<20}{value}"));
    let distances = |d: &DistanceStatistics| {
        format!(
            "median {:.2}  rms {:.2}  95% {:.2}  max {:.2} mm  ({} points)",
            d.median, d.rms, d.p95, d.max, d.count
        )
    };
    let patches = &rigged.rig.patches;
    let nodes: usize = patches.iter().map(|p| p.patch.neutral.len()).sum();
    line(
        "face",
        format!(
            "{} vertices, {} polygons, {:.4} mm per unit",
            rigged.rig.face.vertex_count(),
            rigged.rig.face.face_count(),
            report.millimetres_per_unit
        ),
    );
    line(
        "alignment",
        format!(
            "{}, residual {:.2} mm",
            if report.used_landmarks {
                "by landmarks".to_owned()
            } else {
                format!("automatic, confidence {:.2}", report.confidence)
            },
            report.alignment_residual_mm
        ),
    );
    line("template to face", distances(&report.template_to_face));
    line("face to template", distances(&report.face_to_template));
    if let Some(landmarks) = &report.landmarks {
        line("landmarks", distances(landmarks));
    }
    for (name, opening) in [
        ("mouth", &report.openings.mouth),
        ("left eye", &report.openings.eyes[0]),
        ("right eye", &report.openings.eyes[1]),
    ] {
        line(name, super::report::opening_text(opening));
    }
    for cut in &report.cuts {
        line(
            "cut",
            format!(
                "{}, {:.1} mm long; from vertex {} on: {} on the cut, {} of lining, {} of an \
                 eyeball; {} polygons split",
                cut.opening,
                cut.length_mm,
                cut.first_new_vertex,
                cut.seam_vertices,
                cut.lining_vertices,
                cut.eyeball_vertices,
                cut.split_faces
            ),
        );
    }
    line(
        "quality",
        format!(
            "coverage {:.1} %, {} folded triangles, {} self-intersections, triangle quality min {:.2} \
             median {:.2}",
            100.0 * report.coverage,
            report.folded_triangles,
            report.self_intersections,
            report.triangle_quality[0],
            report.triangle_quality[2]
        ),
    );
    line("patches", format!("{} with {nodes} nodes", patches.len()));
    if let Some(look) = &rigged.rig.appearance {
        let bytes: usize = look.pictures.iter().map(|p| p.bytes.len()).sum();
        line(
            "materials",
            format!(
                "{}; {} pictures, {:.1} MB",
                look.names().join(", "),
                look.pictures.len(),
                bytes as f64 / 1e6
            ),
        );
    }
    let stages: Vec<String> = report
        .times
        .iter()
        .map(|t| format!("{} {:.2}", t.stage, t.seconds))
        .collect();
    line(
        "time",
        format!("{:.2} s ({})", report.total_seconds(), stages.join(", ")),
    );
    for warning in &report.warnings {
        line("note", warning.clone());
    }
}
