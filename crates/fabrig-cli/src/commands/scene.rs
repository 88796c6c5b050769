//! `fabrig scene`: what a scene would model, and what keys there are.

use anyhow::{Context, Result};
use fabrig_core::motion::ReadOptions;
use fabrig_core::pipeline::{edits_of, frame_count, load_faces, scene_duration, scene_rate};
use fabrig_core::scene::{Scene, Simulation, annotated_scene};
use serde::Serialize;

use super::Outcome;
use super::animate::load_scene;
use crate::cli::{SceneCheckArgs, SceneCommand};
use crate::console::Console;

pub(crate) fn run(console: &Console, command: &SceneCommand) -> Result<Outcome> {
    match command {
        SceneCommand::Show => {
            console.result(annotated_scene().trim_end());
            Ok(Outcome::Done)
        }
        SceneCommand::Check(args) => check(console, args),
    }
}

/// What a scene would model.
#[derive(Debug, Serialize)]
struct Summary {
    /// Of the simulation (1/s); the take's own where it has no faces and does not say.
    fps: Option<f64>,
    /// (s)
    duration: Option<f64>,
    frames: Option<u64>,
    faces: Vec<FaceSummary>,
    /// What acts on the faces.
    fields: Vec<String>,
    /// Which patches collide.
    contact_pairs: String,
    colliders: Vec<String>,
}

#[derive(Debug, Serialize)]
struct FaceSummary {
    name: String,
    rig: String,
    edits: Option<String>,
    motion: Option<String>,
    vertices: usize,
    nodes: usize,
    patches: usize,
    /// Patches that are cloth.
    simulated: usize,
    materials: Vec<String>,
    wrinkles: Vec<String>,
}

fn check(console: &Console, args: &SceneCheckArgs) -> Result<Outcome> {
    let scene = load_scene(&args.scene)?;
    let summary =
        summary(console, &scene).with_context(|| format!("in {}", args.scene.display()))?;
    if args.json {
        console.result(&serde_json::to_string_pretty(&summary)?);
    } else {
        print(console, &summary);
    }
    Ok(Outcome::Done)
}

/// Goes as far as a simulation's first frame, so that everything a scene names is looked for.
fn summary(console: &Console, scene: &Scene) -> Result<Summary> {
    let staged = load_faces(scene, &ReadOptions::default(), &mut |step| {
        console.share(step.stage, step.fraction)
    })?;
    console.clear();
    let pairs = serde_json::to_value(scene.contact.pairs)?;
    let mut summary = Summary {
        fps: scene.fps,
        duration: scene.duration,
        frames: None,
        faces: Vec::new(),
        fields: fields(scene),
        contact_pairs: pairs.as_str().unwrap_or_default().to_owned(),
        colliders: scene.colliders.iter().map(|c| c.name.clone()).collect(),
    };
    if !staged.is_empty() {
        let (fps, duration) = (scene_rate(scene, &staged), scene_duration(scene, &staged)?);
        (summary.fps, summary.duration) = (Some(fps), Some(duration));
        summary.frames = Some(frame_count(duration, fps));
    }
    for (index, face) in staged.into_iter().enumerate() {
        let own = &scene.faces[index];
        let mut found = FaceSummary {
            name: face.name,
            rig: own.rig.display().to_string(),
            edits: edits_of(scene, index).map(|path| path.display().to_string()),
            motion: own.motion.as_ref().map(|path| path.display().to_string()),
            vertices: face.rig.face.vertex_count(),
            nodes: face.rig.patches.iter().map(|p| p.patch.neutral.len()).sum(),
            patches: face.rig.patches.len(),
            simulated: 0,
            materials: face.scene.materials.keys().cloned().collect(),
            wrinkles: face.scene.wrinkles.keys().cloned().collect(),
        };
        let simulation = Simulation::new(face.rig, face.scene, face.clip)?;
        found.simulated = simulation.simulated_patches();
        summary.faces.push(found);
    }
    Ok(summary)
}

/// What acts on the faces, in words.
fn fields(scene: &Scene) -> Vec<String> {
    let usual = Scene::default();
    let mut found = Vec::new();
    if scene.gravity != usual.gravity {
        found.push("gravity of its own".to_owned());
    }
    if scene.wind != usual.wind {
        found.push("wind".to_owned());
    }
    if let Some(t) = &scene.turbulence {
        found.push(format!(
            "gusts of {} mm/s over {} mm and {} s, seed {}",
            t.intensity, t.length, t.time, t.seed
        ));
    }
    if let Some(s) = &scene.shake {
        found.push(format!(
            "a shake of {} mm/s^2 over {} s, seed {}",
            s.intensity, s.time, s.seed
        ));
    }
    let forces = scene.forces.iter();
    found.extend(forces.map(|force| format!("push '{}' within {} mm", force.name, force.reach)));
    found
}

fn print(console: &Console, summary: &Summary) {
    let line = |name: &str, value: String| console.result(&format!("{name:<20}{value}"));
    match (summary.fps, summary.duration, summary.frames) {
        (Some(fps), Some(duration), Some(frames)) => line(
            "frames",
            format!("{frames} at {fps} a second, {duration:.2} s"),
        ),
        _ => line(
            "faces",
            "none of its own: `fabrig animate RIG --motion TAKE --scene ...` gives one".to_owned(),
        ),
    }
    for face in &summary.faces {
        let motion = face.motion.as_deref().unwrap_or("no take");
        line("face", format!("{}: {}, {motion}", face.name, face.rig));
        line(
            "",
            format!(
                "{} vertices, {} nodes, {} of {} patches are cloth",
                face.vertices, face.nodes, face.simulated, face.patches
            ),
        );
        for (what, names) in [("materials", &face.materials), ("wrinkles", &face.wrinkles)] {
            if !names.is_empty() {
                line("", format!("{what}: {}", names.join(", ")));
            }
        }
        if let Some(edits) = &face.edits {
            line("", format!("edits: {edits}"));
        }
    }
    for field in &summary.fields {
        line("field", field.clone());
    }
    line("contact", format!("pairs: {}", summary.contact_pairs));
    for collider in &summary.colliders {
        line("collider", collider.clone());
    }
}
