//! From a rig to a file.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::face::{ExportFace, Placement, Shape};
use super::look;
use super::shapes::morph_targets;
use super::take::{SimulatedTake, linear_error, rate, weights_of_take};
use super::writer::Writer;
use super::{ExportError, ExportFormat, ExportOptions, ExportReport, LengthUnit};
use crate::motion::{Clip, parse_keys};
use crate::registration::Progress;
use crate::rig::Rig;
use crate::template::demo_take;

/// How an export says how far it is, and is stopped.
pub(super) type OnProgress<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

/// Writes a rig with its shapes, or simulated through a take.
///
/// - `output`: `.glb`, `.gltf`, `.usda`, `.npz`, `.pc2`, `.mdd`, or a folder for OBJ files
/// - `progress`: called between steps; `ControlFlow::Break` stops it
///
/// # Errors
///
/// [`ExportError`]; then nothing is left at `output` that was not there before.
pub fn export(
    rig: &Arc<Rig>,
    output: &Path,
    options: &ExportOptions,
    progress: OnProgress<'_>,
) -> Result<ExportReport, ExportError> {
    let clock = Instant::now();
    let format = ExportFormat::of(output)?;
    if options.motion.is_none() && (format.is_point_cache() || options.baked) {
        return Err(ExportError::NoMotion {
            path: output.to_owned(),
            format: format.name(),
        });
    }
    check(options)?;
    let unit = options.unit.unwrap_or(match format {
        ExportFormat::Glb | ExportFormat::Gltf => LengthUnit::Metre,
        _ => LengthUnit::Own,
    });
    let placement = Placement::new(rig.to_head, unit);
    let mut notes = Vec::new();
    let appearance = look::appearance(rig, options.source.as_deref(), &mut notes)?;
    let face = ExportFace::new(&options.name, &rig.face, placement, appearance);
    // Points alone, or as many OBJ files as there are frames: always simulated.
    let is_baked = options.baked
        || format.is_point_cache()
        || format == ExportFormat::Obj && options.motion.is_some();
    let mut writer = Writer::new(output, format, &face, notes);
    if let (true, Some(clip)) = (is_baked, &options.motion) {
        let fps = rate(clip, options)?;
        let mut frames = SimulatedTake::new(rig, clip, &options.scene, fps, placement)?;
        writer.write_frames(&mut frames, options, progress)?;
    } else {
        let shapes = morph_targets(
            rig,
            &options.scene,
            options.shapes,
            &placement,
            &mut |fraction| {
                progress(Progress {
                    stage: "shapes",
                    fraction,
                })
            },
        )?;
        let animation = options.motion.as_ref().map(|clip| {
            let fps = rate(clip, options)?;
            let name = &options.motion_name;
            weights_of_take(rig, clip, name, fps, options.still_head, &placement)
        });
        let animation = animation.transpose()?;
        writer.write_shapes(&shapes, animation.as_ref())?;
        if options.check_sum {
            writer.report.linear = Some(compare(rig, options, &placement, &shapes, progress)?);
        }
    }
    let mut report = writer.finish();
    report.wall_secs = clock.elapsed().as_secs_f64();
    Ok(report)
}

fn check(options: &ExportOptions) -> Result<(), ExportError> {
    if options.components == Some(0) {
        return Err(ExportError::Option {
            name: "components",
            expected: "at least 1",
            found: 0.0,
        });
    }
    let tolerance = options.basis_tolerance;
    if !(tolerance > 0.0 && tolerance.is_finite()) {
        return Err(ExportError::Option {
            name: "tolerance",
            expected: "a length above 0 mm",
            found: tolerance,
        });
    }
    Ok(())
}

/// The sum of the morph targets against the simulation, over the take or the bundled one.
fn compare(
    rig: &Arc<Rig>,
    options: &ExportOptions,
    placement: &Placement,
    shapes: &[Shape],
    progress: OnProgress<'_>,
) -> Result<super::LinearError, ExportError> {
    let bundled;
    let (clip, name): (&Clip, &str) = match &options.motion {
        Some(clip) => (clip, &options.motion_name),
        None => {
            bundled = match parse_keys(demo_take(), "demo") {
                Ok(clip) => clip,
                // Part of the binary and read by tests.
                Err(error) => panic!("the bundled take is damaged: {error}"),
            };
            (&bundled, "the bundled take")
        }
    };
    let fps = rate(clip, options)?;
    let animation = weights_of_take(rig, clip, name, fps, true, placement)?;
    let mut frames = SimulatedTake::new(rig, clip, &options.scene, fps, *placement)?;
    linear_error(&animation, shapes, &mut frames, &mut |fraction| {
        progress(Progress {
            stage: "compare",
            fraction,
        })
    })
}
