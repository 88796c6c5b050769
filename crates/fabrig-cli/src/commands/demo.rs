//! `fabrig demo`: the whole line with nothing but the binary.

use anyhow::{Result, ensure};
use fabrig_core::collision::{PairMask, Stickiness, read_colliders};
use fabrig_core::motion::{self, ReadOptions};
use fabrig_core::pipeline::{AnimateOptions, RigFaceOptions};
use fabrig_core::rig::SkinRefinement;
use fabrig_core::scene::Scene;
use fabrig_core::template;
use serde_json::json;

use super::animate::{apply_presets, outcome, print_report, record, scene};
use super::rig;
use super::story_pictures::{CONTACT, PHYSICS, Story, draw};
use super::viewers::print_how_to_open;
use super::{Outcome, check_output};
use crate::cli::{DemoArgs, DemoScene};
use crate::console::Console;

/// Longest edge of the skin that shows wrinkles. (mm)
const FINE_SKIN: f64 = 1.5;
/// What the physics story is played with, unless presets are given.
const PHYSICS_PRESETS: [&str; 1] = ["looser_skin"];

pub(crate) fn run(console: &Console, args: &DemoArgs) -> Result<Outcome> {
    check_output(&args.output)?;
    if let Some(path) = &args.rig {
        check_output(path)?;
    }
    let stories: &[Story] = match args.story {
        DemoScene::Performance => &[],
        DemoScene::Contact => &CONTACT,
        DemoScene::Physics => &PHYSICS,
    };
    ensure!(
        args.pictures.is_none() || !stories.is_empty(),
        "--pictures draws a story; add --story contact or --story physics"
    );
    let face = template::demo_face();
    let (take, name) = match args.story {
        DemoScene::Performance => (template::demo_take(), "demo"),
        DemoScene::Contact => (template::demo_contact_take(), "contact"),
        DemoScene::Physics => (template::demo_physics_take(), "physics"),
    };
    let clip = motion::parse(take, "the bundled take", &ReadOptions::default())?;
    let is_physics = args.story == DemoScene::Physics;
    let options = RigFaceOptions {
        refinement: is_physics.then(|| SkinRefinement::to(FINE_SKIN)),
        ..RigFaceOptions::default()
    };
    let mut rigged = rig::rig(console, &face, &options)?;
    if is_physics && args.scene.preset.is_empty() {
        apply_presets(&mut rigged.rig, &PHYSICS_PRESETS.map(str::to_owned))?;
    }
    apply_presets(&mut rigged.rig, &args.scene.preset)?;
    if let Some(path) = &args.rig {
        rigged.rig.save(path)?;
    }
    if !args.recording.json {
        rig::print_report(console, &rigged);
        console.result("");
    }
    let scene = played_scene(args)?;
    let options = AnimateOptions {
        fps: args.scene.fps,
        rig_name: "demo".to_owned(),
        take_name: name.to_owned(),
        recording: args.recording.options(&scene.recording),
    };
    let registration = rigged.report;
    let (positions, hinge) = (rigged.rig.positions.clone(), rigged.rig.jaw.hinge);
    let report = record(console, rigged.rig, clip, scene, &args.output, &options)?;
    if args.recording.json {
        let both = json!({ "rig": registration, "animation": report });
        console.result(&serde_json::to_string_pretty(&both)?);
    } else {
        print_report(console, &report);
        print_how_to_open(console, &args.output);
    }
    if let Some(folder) = &args.pictures {
        draw(console, &args.output, folder, &positions, &hinge, stories)?;
    }
    Ok(outcome(console, &report))
}

/// The scene of the arguments; the contact story sets what they leave open.
fn played_scene(args: &DemoArgs) -> Result<Scene> {
    let mut scene = scene(&args.scene)?;
    if args.story == DemoScene::Contact {
        if args.scene.contact.is_none() && args.scene.file.is_none() {
            scene.contact.pairs = PairMask::All;
        }
        scene
            .contact
            .sticky_lips
            .get_or_insert_with(Stickiness::default);
        if scene.colliders.is_empty() {
            scene.colliders = read_colliders(template::demo_contact_colliders())?;
        }
    }
    Ok(scene)
}
