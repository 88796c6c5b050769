//! `fabrig animate`: a rig and a take become a recording.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail, ensure};
use fabrig_core::collision::{PairMask, Stickiness, read_colliders};
use fabrig_core::edit::{apply_preset, edits_path, load_edited_rig};
use fabrig_core::motion::{self, Adjustment, Clip, ClipNotes, ReadOptions};
use fabrig_core::pipeline::{
    AnimateOptions, AnimateProgress, AnimateReport, ContactSummary, EconomySummary, TimeStatistics,
    animate, animate_scene, load_faces,
};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{Dynamics, Scene, SceneError};

use super::viewers::{print_how_to_open, write_viewer_files};
use super::{Outcome, check_output, stem};
use crate::cli::{AnimateArgs, ContactPairs, SceneArgs, TakeArgs};
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &AnimateArgs) -> Result<Outcome> {
    check_output(&args.output)?;
    let scene = scene(&args.scene)?;
    if !scene.faces.is_empty() {
        return run_faces(console, args, scene);
    }
    let (Some(rig_path), Some(motion)) = (&args.rig, &args.motion) else {
        bail!(
            "the scene has no `faces`: give a rig and --motion, or add [[faces]] to it (`fabrig scene \
             show`)"
        );
    };
    let rig = load_rig_for(rig_path, &args.scene)?;
    let clip = read_take(motion, &args.take)?;
    let options = AnimateOptions {
        fps: args.scene.fps,
        rig_name: stem(rig_path),
        take_name: stem(motion),
        recording: args.recording.options(&scene.recording),
    };
    let report = record(console, rig, clip, scene, &args.output, &options)?;
    if args.recording.json {
        console.result(&serde_json::to_string_pretty(&report)?);
    } else {
        print_report(console, &report);
        print_how_to_open(console, &args.output);
    }
    Ok(outcome(console, &report))
}

/// A scene that has its own faces; a rig and a take that are given go before those of a face
/// that is alone.
fn run_faces(console: &Console, args: &AnimateArgs, mut scene: Scene) -> Result<Outcome> {
    let count = scene.faces.len();
    let is_given = args.rig.is_some() || args.motion.is_some();
    ensure!(
        count == 1 || !is_given,
        "the scene has {count} faces: a rig or --motion of the command line could be any's"
    );
    ensure!(
        args.take.resample.is_none(),
        "--resample is for takes of the command line alone; a scene's `fps` says how often it is \
         simulated"
    );
    ensure!(
        args.scene.preset.is_empty(),
        "--preset is for a rig of the command line alone; write `preset = \"...\"` into the edits of \
         a scene's face"
    );
    let face = &mut scene.faces[0];
    if let Some(rig) = &args.rig {
        face.rig = std::path::absolute(rig)?;
        face.edits = None;
    }
    if let Some(motion) = &args.motion {
        face.motion = Some(std::path::absolute(motion)?);
    }
    let faces = load_faces(&scene, &read_options(&args.take), &mut |step| {
        console.share(step.stage, step.fraction)
    });
    console.clear();
    let faces = faces.with_context(|| in_scene(&args.scene))?;
    let options = AnimateOptions {
        fps: args.scene.fps,
        recording: args.recording.options(&scene.recording),
        ..AnimateOptions::default()
    };
    let mut progress = progress(console);
    let report = animate_scene(&scene, faces, &args.output, &options, &mut progress);
    console.clear();
    let report = report.with_context(|| in_scene(&args.scene))?;
    let [(_, first), ..] = &report.faces[..] else {
        bail!("nothing was simulated");
    };
    write_viewer_files(&args.output, &first.foxglove_layout)?;
    if args.recording.json {
        console.result(&if count == 1 {
            serde_json::to_string_pretty(first)?
        } else {
            serde_json::to_string_pretty(&report)?
        });
        return Ok(outcome(console, first));
    }
    for (name, report) in &report.faces {
        if count > 1 {
            console.result(&format!("{:<20}{name}", "face"));
            print_face(console, report);
        }
    }
    if count == 1 {
        print_face(console, first);
    }
    print_recording(console, first);
    print_how_to_open(console, &args.output);
    Ok(outcome(console, first))
}

fn in_scene(args: &SceneArgs) -> String {
    let path = args.file.as_deref().unwrap_or(Path::new("the scene"));
    format!("in {}", path.display())
}

/// Loads a rig with the edits that stand beside it.
pub(super) fn load_rig(path: &Path) -> Result<Rig> {
    load_edited_rig(path).map_err(|error| {
        let culprit = match error {
            fabrig_core::Error::Edit(_) => edits_path(path),
            _ => path.to_owned(),
        };
        anyhow::Error::from(error).context(format!("{} cannot be used", culprit.display()))
    })
}

/// Gives a rig the skin and fat of presets, in their order.
pub(super) fn apply_presets(rig: &mut Rig, names: &[String]) -> Result<()> {
    for name in names {
        apply_preset(rig, name).with_context(|| format!("--preset {name}"))?;
    }
    Ok(())
}

/// Loads a rig with its edits, and then the presets of the arguments.
pub(super) fn load_rig_for(path: &Path, args: &SceneArgs) -> Result<Rig> {
    let mut rig = load_rig(path)?;
    apply_presets(&mut rig, &args.preset)?;
    Ok(rig)
}

/// Loads a rig as it was built.
pub(super) fn load_unedited_rig(path: &Path) -> Result<Rig> {
    Rig::load(path).with_context(|| format!("{} cannot be used", path.display()))
}

pub(super) fn read_options(args: &TakeArgs) -> ReadOptions {
    ReadOptions {
        format: args.motion_format.map(Into::into),
        frame_rate: args.motion_fps,
        times_in_milliseconds: args.motion_milliseconds,
        ignore_unknown_columns: args.ignore_unknown_columns,
        clamp_weights: args.clamp_weights,
        adjust: Adjustment {
            swap_sides: args.swap_sides,
            neutral: args.calibrate_neutral,
            gains: args.gain.clone(),
            limit_mouth_close: !args.keep_mouth_close,
        },
        ..ReadOptions::default()
    }
}

/// Reads a take as the arguments say.
pub(super) fn read_take(path: &Path, args: &TakeArgs) -> Result<Clip> {
    let clip = motion::read(path, &read_options(args))?;
    Ok(match args.resample {
        Some(rate) => clip.resampled(rate)?,
        None => clip,
    })
}

/// Shows how many frames are simulated.
fn progress(console: &Console) -> impl FnMut(AnimateProgress) -> ControlFlow<()> {
    |now| {
        let detail = format!("{}/{} frames", now.frame, now.frame_count);
        console.show("simulate", now.frame, now.frame_count, &detail)
    }
}

/// Simulates and records with a progress bar, and writes the viewers' files beside it.
pub(super) fn record(
    console: &Console,
    rig: Rig,
    clip: Clip,
    scene: Scene,
    output: &Path,
    options: &AnimateOptions,
) -> Result<AnimateReport> {
    let rig = Arc::new(rig);
    let report = animate(rig, clip, scene, output, options, &mut progress(console));
    console.clear();
    let report = report?;
    write_viewer_files(output, &report.foxglove_layout)?;
    Ok(report)
}

/// Reads a scene file.
pub(super) fn load_scene(path: &Path) -> Result<Scene> {
    Scene::load(path).map_err(|error| match error {
        SceneError::Read { .. } => anyhow::Error::from(error),
        _ => anyhow::Error::from(error).context(format!("in {}", path.display())),
    })
}

/// The scene that the arguments describe.
pub(super) fn scene(args: &SceneArgs) -> Result<Scene> {
    let mut scene = match &args.file {
        Some(path) => load_scene(path)?,
        None => Scene::default(),
    };
    if let Some(pairs) = args.contact {
        scene.contact.pairs = match pairs {
            ContactPairs::None => PairMask::None,
            ContactPairs::Sphincter => PairMask::Sphincter,
            ContactPairs::All => PairMask::All,
        };
    }
    if args.sticky_lips {
        scene
            .contact
            .sticky_lips
            .get_or_insert_with(Stickiness::default);
    }
    if let Some(path) = &args.colliders {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        scene.colliders =
            read_colliders(&text).with_context(|| format!("in {}", path.display()))?;
    }
    if args.without_dynamics {
        scene.dynamics = Dynamics::None;
    }
    if let Some(tolerance) = args.economy {
        scene.economy.tolerance = tolerance;
    }
    if let Some(substeps) = args.substeps {
        scene.cloth.substeps = substeps;
    }
    if let Some(gravity) = args.gravity {
        scene.gravity = gravity.into();
    }
    if let Some(wind) = args.wind {
        scene.wind = wind.into();
    }
    Ok(scene)
}

pub(super) fn outcome(console: &Console, report: &AnimateReport) -> Outcome {
    if report.is_complete {
        return Outcome::Done;
    }
    console.note(&format!(
        "stopped after {} frames; the recording is whole up to there",
        report.frames
    ));
    Outcome::Partial
}

/// What the animation took and did, for people.
pub(super) fn print_report(console: &Console, report: &AnimateReport) {
    print_face(console, report);
    print_recording(console, report);
}

/// What of a report is of one face.
fn print_face(console: &Console, report: &AnimateReport) {
    let line = |name: &str, value: String| console.result(&format!("{name:<20}{value}"));
    let times = |t: &TimeStatistics| {
        format!(
            "median {:.2}  95% {:.2}  99% {:.2}  max {:.2} ms/frame",
            t.median, t.p95, t.p99, t.max
        )
    };
    print_notes(console, &report.take);
    line(
        "frames",
        format!(
            "{} at {:.3} a second, {:.2} s, {} skin vertices, {} nodes",
            report.frames,
            report.fps,
            report.recording.duration_secs,
            report.vertex_count,
            report.node_count
        ),
    );
    line("simulation", times(&report.simulation_ms));
    line("of which cloth", times(&report.cloth_ms));
    line("recording", times(&report.recording_ms));
    line(
        "guards",
        format!(
            "{} displacements clamped, {} fallbacks to backward Euler, {} to descent, {} patches \
             put back",
            report.guards.clamped_displacements,
            report.guards.euler_fallbacks,
            report.guards.robust_fallbacks,
            report.guards.frozen_patches
        ),
    );
    line(
        "from muscle shapes",
        format!("at most {:.2} mm rms in a frame", report.settle_rms_max),
    );
    if let Some(contact) = &report.contact {
        print_contact(&line, contact);
    }
    print_economy(&line, &report.economy);
}

/// What was modelled and what was not, with what that may cost and what it saved.
fn print_economy(line: &impl Fn(&str, String), economy: &EconomySummary) {
    if economy.tolerance == 0.0 {
        line("economy", "none: everything was modelled".to_owned());
        return;
    }
    let modelled = |spared: f64| {
        format!(
            "{:>6.1} %   {:>6.1} %",
            100.0 - 100.0 * spared,
            100.0 * spared
        )
    };
    line("economy", "modelled    skipped".to_owned());
    line(
        "  cloth",
        format!(
            "{}  of {} patches in {} frames",
            modelled(economy.slept),
            economy.patches,
            economy.frames
        ),
    );
    line("  substeps", modelled(economy.substeps_spared));
    line("  muscle shapes", modelled(economy.not_evaluated));
    line("  skin", modelled(economy.skin_left));
    line(
        "  bound",
        format!(
            "{:.3} mm rms of any patch against the full model ({:.3} tolerated), {:.2} where one snaps \
             into another fold",
            economy.estimate, economy.tolerance, economy.bound
        ),
    );
    if economy.storm_frames > 0 {
        line(
            "  storm",
            format!(
                "{} frames modelled whole, as patches buckle in them",
                economy.storm_frames
            ),
        );
    }
    line(
        "  time saved",
        match economy.time_saved {
            Some(share) => format!(
                "{:.0} % of simulating, by {} frames that were modelled whole",
                100.0 * share,
                economy.whole_frames
            ),
            None => "not known: too few frames were modelled whole".to_owned(),
        },
    );
}

/// What of a report is of the recording, whose faces share it.
fn print_recording(console: &Console, report: &AnimateReport) {
    let line = |name: &str, value: String| console.result(&format!("{name:<20}{value}"));
    for topic in &report.recording.topics {
        line(
            "topic",
            format!(
                "{:<17} {:>6} messages, {:>7.1} MB before compression",
                topic.topic,
                topic.messages,
                topic.raw_bytes as f64 / 1e6
            ),
        );
    }
    line(
        "file",
        format!(
            "{:.1} MB, {:.2} a second; rounded: positions at most {:.1} um off, normals {:.4}",
            report.recording.bytes as f64 / 1e6,
            report.recording.bytes as f64 / 1e6 / report.recording.duration_secs.max(1e-9),
            report.recording.position_error_um,
            report.recording.normal_error
        ),
    );
    line("time", format!("{:.2} s", report.wall_secs));
}

fn print_contact(line: &impl Fn(&str, String), contact: &ContactSummary) {
    line(
        "contact",
        format!(
            "median {} of {} candidates touch, at most {}; {} steps cut short, {} pairs pinched",
            contact.contacts_median,
            contact.candidates_median,
            contact.contacts_max,
            contact.held,
            contact.pinched
        ),
    );
    if contact.bonds_max > 0 {
        line(
            "sticky lips",
            format!(
                "at most {} bonds, {} broke, the hardest pull {:.4} N",
                contact.bonds_max, contact.broken_bonds, contact.bond_force_max
            ),
        );
    }
    line(
        "skin in contact",
        format!(
            "at most {:.3} mm inside, {:.3} mm before it was corrected",
            contact.skin_depth, contact.skin_depth_before
        ),
    );
    if contact.started_inside > 0 {
        line(
            "started inside",
            format!(
                "{} nodes, the deepest {:.2} mm",
                contact.started_inside, contact.started_depth
            ),
        );
    }
    for force in &contact.forces {
        line(
            "force",
            format!("at most {:.3} N on {}", force.newtons, force.name),
        );
    }
}

/// What reading a take had to decide, for people.
pub(super) fn print_notes(console: &Console, take: &ClipNotes) {
    let lost: usize = take.gaps.iter().map(|gap| gap.frames).sum();
    for (count, what) in [
        (take.clamped_weights, "weights just outside [0, 1] clamped"),
        (take.duplicate_rows, "rows at a repeated time replaced"),
        (
            take.dropped_frames,
            "frames missing from the capture bridged",
        ),
        (lost, "frames without a face filled"),
        (take.other_faces, "rows of other faces passed over"),
        (take.ignored_columns.len(), "columns passed over"),
        (take.neutral.len(), "shapes freed of the neutral face"),
        (take.saturated_weights, "weights taken to 1 by a gain"),
        (
            take.limited_mouth_close,
            "weights of mouthClose lowered to jawOpen's",
        ),
    ] {
        if count > 0 {
            console.result(&format!("{:<20}{count} {what}", "take"));
        }
    }
}
