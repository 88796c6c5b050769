//! `fabrig export`: a rig in the formats of other programs.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, bail};
use fabrig_core::export::{
    ExportError, ExportFormat, ExportOptions, ExportReport, LengthUnit, ShapeSource, export,
};
use fabrig_core::registration::Progress;

use super::animate::{load_rig_for, read_take, scene};
use super::{Outcome, check_output, stem};
use crate::cli::{ExportArgs, LayoutArgs, Unit};
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &ExportArgs) -> Result<Outcome> {
    check_target(&args.output)?;
    let rig = Arc::new(load_rig_for(&args.rig, &args.scene)?);
    let scene = scene(&args.scene)?;
    let mut options = ExportOptions {
        shapes: if args.scene.without_dynamics {
            ShapeSource::Targets
        } else {
            ShapeSource::Settled
        },
        baked: args.baked,
        fps: args.scene.fps,
        check_sum: !args.skip_check,
        scene,
        ..layout(&args.layout, &args.rig)
    };
    if let Some(path) = &args.motion {
        options.motion = Some(read_take(path, &args.take)?);
        options.motion_name = stem(path);
    }
    let report = export(&rig, &args.output, &options, &mut progress(console));
    finish(console, report, &args.output, args.json)
}

/// What is asked of the file, whatever it is made from; its name is that of `source`.
pub(super) fn layout(args: &LayoutArgs, source: &Path) -> ExportOptions {
    ExportOptions {
        name: args.name.clone().unwrap_or_else(|| stem(source)),
        unit: args.unit.map(|unit| match unit {
            Unit::Mm => LengthUnit::Millimetre,
            Unit::Cm => LengthUnit::Centimetre,
            Unit::M => LengthUnit::Metre,
            Unit::In => LengthUnit::Inch,
        }),
        source: args.face.clone(),
        still_head: args.still_head,
        components: args.components.map(|n| n as usize),
        basis_tolerance: args.tolerance,
        ..ExportOptions::default()
    }
}

/// Refuses an output before anything is computed for it; a folder may be there already.
pub(super) fn check_target(output: &Path) -> Result<()> {
    if ExportFormat::of(output)? != ExportFormat::Obj {
        return check_output(output);
    }
    if output.is_file() {
        bail!(
            "cannot write {}: a folder is needed, and it is a file",
            output.display()
        );
    }
    match output.parent() {
        Some(parent) if !parent.as_os_str().is_empty() && !parent.is_dir() => bail!(
            "cannot write {}: the folder {} does not exist",
            output.display(),
            parent.display()
        ),
        _ => Ok(()),
    }
}

pub(super) fn progress(console: &Console) -> impl FnMut(Progress) -> ControlFlow<()> + '_ {
    |step| console.share(step.stage, step.fraction)
}

/// Says what was written, or that it was stopped.
pub(super) fn finish(
    console: &Console,
    report: Result<ExportReport, ExportError>,
    output: &Path,
    as_json: bool,
) -> Result<Outcome> {
    console.clear();
    let report = match report {
        Err(ExportError::Stopped) => {
            console.note("stopped; nothing was written");
            return Ok(Outcome::Partial);
        }
        report => report?,
    };
    if as_json {
        console.result(&serde_json::to_string_pretty(&report)?);
    } else {
        print_report(console, &report, output);
    }
    Ok(Outcome::Done)
}

fn print_report(console: &Console, report: &ExportReport, output: &Path) {
    let line = |name: &str, value: String| console.result(&format!("{name:<20}{value}"));
    let split = if report.written_vertices == report.vertices {
        String::new()
    } else {
        format!(
            " ({} more at texture seams, after them)",
            report.written_vertices - report.vertices
        )
    };
    line(
        "face",
        format!(
            "{} vertices{split}, {} polygons, {} mm per unit",
            report.vertices, report.polygons, report.millimetres_per_unit
        ),
    );
    line("materials", report.materials.join(", "));
    if !report.shapes.is_empty() {
        line("shapes", report.shapes.len().to_string());
    }
    if !report.still_shapes.is_empty() {
        line(
            "note",
            format!(
                "{} moves nothing on this face",
                report.still_shapes.join(", ")
            ),
        );
    }
    if let Some(fps) = report.fps {
        line(
            "frames",
            format!(
                "{} at {fps:.3} a second, {:.2} s",
                report.frames, report.seconds
            ),
        );
    }
    if let Some(basis) = &report.basis {
        line(
            "morph basis",
            format!(
                "{} targets, off by {:.3} mm rms, {:.3} in the worst frame, at most {:.2} mm",
                basis.components, basis.rms_mm, basis.worst_frame_rms_mm, basis.max_mm
            ),
        );
    }
    if let Some(linear) = &report.linear {
        line(
            "sum of shapes",
            format!(
                "off the simulated skin by {:.2} mm rms, at most {:.1} mm ({:.2} s), where it \
                 moves {:.2} mm rms: {} frames of {}",
                linear.rms_mm,
                linear.max_mm,
                linear.max_at_secs,
                linear.motion_rms_mm,
                linear.frames,
                linear.take
            ),
        );
    }
    for note in &report.notes {
        line("note", note.clone());
    }
    let files = if report.files == 1 {
        String::new()
    } else {
        format!(" in {} files", report.files)
    };
    line(
        "written",
        format!(
            "{}, {:.2} MB{files}, in {:.1} s",
            output.display(),
            report.bytes as f64 / 1e6,
            report.wall_secs
        ),
    );
}
