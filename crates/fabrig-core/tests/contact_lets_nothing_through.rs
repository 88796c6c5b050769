//! Lips slammed shut in one frame, lids shut over the eyeballs, a finger on the cheek: nothing
//! that may collide crosses, by an exact test that shares nothing with contact, and skin is in
//! nothing that its patches are not in.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::sync::Arc;

use fabrig_core::collision::{Collider, ColliderFrame, ColliderShape, PairMask, Stickiness};
use fabrig_core::mesh::Surface;
use fabrig_core::motion::{self, ReadOptions};
use fabrig_core::scene::{Scene, Simulation};
use fabrig_core::template::{self, RigidBody};
use fabrig_core::{Point, Vector};
use nalgebra::{Isometry3, Unit};

#[test]
fn lips_and_lids_do_not_cross_however_fast_they_close() {
    let rig = &faces::demo().rig;
    let mut scene = Scene::default();
    scene.contact.pairs = PairMask::Sphincter;
    let mut simulation = Simulation::new(Arc::clone(rig), scene, None).unwrap();
    let poses: [&[(&str, f32)]; 4] = [
        &[("jawOpen", 1.0)],
        &[
            ("mouthPucker", 1.0),
            ("mouthPressLeft", 1.0),
            ("mouthPressRight", 1.0),
        ],
        &[
            ("eyeBlinkLeft", 1.0),
            ("eyeBlinkRight", 1.0),
            ("mouthRollLower", 1.0),
        ],
        &[],
    ];
    let mut contacts = 0;
    for shapes in poses {
        let pose = faces::pose(rig, shapes);
        for frame in 0..6 {
            simulation.advance_to(pose.clone(), 1.0 / 60.0).unwrap();
            let verdict = simulation.judge_contact().unwrap().unwrap();
            assert_eq!(verdict.cloth, 0, "{shapes:?}, frame {frame}");
            contacts += simulation.contact_report().unwrap().contacts;
            let skin = simulation.skin_contact_report();
            assert!(
                skin.deepest_after < 0.02,
                "{shapes:?}, frame {frame}: {skin:?}"
            );
        }
    }
    assert!(contacts > 0, "the lids touch");
}

/// A finger in the head frame, or in the world.
fn finger(frame: ColliderFrame, position: Vector) -> Collider {
    let shape = ColliderShape::Capsule {
        half_length: 20.0,
        radius: RADIUS,
    };
    Collider {
        frame,
        ..Collider::at("finger", shape, position)
    }
}

const RADIUS: f64 = 7.0;

/// How deep the skin is in the finger at most, measured by its axis alone. (mm)
fn depth(simulation: &Simulation) -> f64 {
    let pose = simulation.collider_poses()[0];
    let loose = &simulation.rig().parts;
    let is_skin = |v: &usize| {
        !loose
            .iter()
            .any(|p| p.vertices.binary_search(&(*v as u32)).is_ok())
    };
    let skin = simulation.skin();
    (0..skin.len())
        .filter(|&v| (skin[v].cast::<f64>() - Point::from(pose.translation.vector)).norm() < 40.0)
        .filter(is_skin)
        .map(|v| {
            let local = pose.inverse() * skin[v].cast::<f64>();
            let along = local.y.clamp(-20.0, 20.0);
            RADIUS - (local - Point::new(0.0, along, 0.0)).norm()
        })
        .fold(0.0, f64::max)
}

/// The foremost place of the skin near (x, y).
fn front_at(simulation: &Simulation, x: f32, y: f32) -> Vector {
    let near = simulation.skin().iter();
    let near = near.filter(|p| (p.x - x).hypot(p.y - y) < 5.0);
    let front = near.max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    front.coords.cast()
}

#[test]
fn a_finger_on_the_cheek_is_not_in_the_skin_nor_is_a_head_that_jumps_onto_it() {
    let rig = &faces::demo().rig;
    let rest = Simulation::new(Arc::clone(rig), Scene::without_dynamics(), None).unwrap();
    let touch = front_at(&rest, 40.0, -40.0) + Vector::new(0.0, 0.0, RADIUS);
    let mut scene = Scene::default();
    scene.contact.pairs = PairMask::Sphincter;
    let far = touch + Vector::new(0.0, 0.0, 50.0);
    scene.colliders = vec![finger(ColliderFrame::World, far)];
    let mut simulation = Simulation::new(Arc::clone(rig), scene, None).unwrap();
    assert_eq!(simulation.contact_report().unwrap().started_inside, 0);
    let press = |depth: f64| Isometry3::from(touch - Vector::new(0.0, 0.0, depth));
    let pose = faces::pose(rig, &[]);
    for step in 0..8 {
        simulation
            .set_collider_pose(0, press(-10.0 + 2.0 * f64::from(step)))
            .unwrap();
        simulation.advance_to(pose.clone(), 1.0 / 60.0).unwrap();
        assert!(
            depth(&simulation) < 0.02,
            "step {step}: {} mm",
            depth(&simulation)
        );
    }
    let report = simulation.contact_report().unwrap();
    assert!(
        report.contacts > 0 && report.forces[0].z > 0.0,
        "{report:?}"
    );
    assert!(simulation.skin_contact_report().corrected > 0);
    // The head comes towards the finger in one frame.
    let mut jumped = pose;
    jumped.head = Isometry3::translation(0.0, 0.0, 4.0);
    simulation.advance_to(jumped, 1.0 / 60.0).unwrap();
    assert_eq!(simulation.judge_contact().unwrap().unwrap().colliders, 0);
    assert!(depth(&simulation) < 0.05, "{} mm", depth(&simulation));
}

#[test]
fn a_scene_that_begins_with_a_finger_in_the_cheek_lets_it_out_and_says_so() {
    let rig = &faces::demo().rig;
    let rest = Simulation::new(Arc::clone(rig), Scene::without_dynamics(), None).unwrap();
    let inside = front_at(&rest, 40.0, -40.0) - Vector::new(0.0, 0.0, 4.0);
    let scene = Scene {
        colliders: vec![finger(ColliderFrame::Head, inside)],
        ..Scene::default()
    };
    let mut simulation = Simulation::new(Arc::clone(rig), scene, None).unwrap();
    let started = simulation.contact_report().unwrap().clone();
    assert!(
        started.started_inside > 0 && started.started_depth > 1.0,
        "{started:?}"
    );
    let pose = faces::pose(rig, &[]);
    for frame in 0..6 {
        let report = simulation.advance_to(pose.clone(), 1.0 / 60.0).unwrap();
        assert!(
            report.settle_max < 40.0,
            "frame {frame}: {} mm",
            report.settle_max
        );
        assert_eq!(simulation.judge_contact().unwrap().unwrap().colliders, 0);
        assert!(
            depth(&simulation) < 0.05,
            "frame {frame}: {} mm",
            depth(&simulation)
        );
    }
}

#[test]
fn sealed_lips_stay_sealed_until_the_jaw_pulls_them_apart() {
    let rig = &faces::demo().rig;
    let mut scene = Scene::default();
    scene.contact.pairs = PairMask::Sphincter;
    scene.contact.sticky_lips = Some(Stickiness::default());
    let mut simulation = Simulation::new(Arc::clone(rig), scene, None).unwrap();
    let press = [
        ("mouthPressLeft", 0.7),
        ("mouthPressRight", 0.7),
        ("mouthRollLower", 0.15),
        ("mouthRollUpper", 0.15),
    ];
    let mut play = |shapes: &[(&str, f32)], frames: usize| {
        let pose = faces::pose(rig, shapes);
        let mut broken = 0;
        for _ in 0..frames {
            simulation.advance_to(pose.clone(), 1.0 / 60.0).unwrap();
            broken += simulation.contact_report().unwrap().broken_bonds;
        }
        (simulation.contact_report().unwrap().bonds, broken)
    };
    let (sealed, _) = play(&press, 20);
    assert!(sealed >= 10, "{sealed} bonds");
    let (held, broken) = play(&press, 60);
    assert!(
        held >= sealed && broken == 0,
        "{held} bonds, {broken} broken in a held press"
    );
    let (open, broken) = play(&[("jawOpen", 0.9)], 40);
    assert!(broken * 4 > sealed * 3, "{broken} of {sealed} broken");
    // The corners stay together.
    assert!(open * 3 < sealed, "{open} of {sealed} bonds left");
    let (again, _) = play(&[("jawOpen", 0.3)], 10);
    assert!(
        again * 3 < sealed,
        "lips that do not touch do not stick again: {again}"
    );
}

#[test]
fn lips_and_cheeks_rest_on_teeth_and_gums() {
    let rig = &faces::demo().rig;
    let rest = rig.skin_at_rest();
    let mut is_teeth = vec![false; rest.len()];
    let is_jaw = |body| matches!(body, RigidBody::Skull | RigidBody::Mandible);
    let jaws = rig.parts.iter().filter(|p| is_jaw(p.follows));
    for &v in jaws
        .filter(|p| p.name != "tongue")
        .flat_map(|p| &p.vertices)
    {
        is_teeth[v as usize] = true;
    }
    let mut triangles = rig.face.triangles();
    triangles.retain(|t| t.iter().all(|&v| is_teeth[v as usize]));
    let places: Vec<Point> = rest.iter().map(|p| p.cast()).collect();
    let teeth = Surface::new(&places, &triangles).unwrap();
    // How far something is behind the teeth that was before them.
    let behind = |from: Point, to: Point| {
        let (direction, length) = Unit::try_new_and_get(to - from, 1e-6)?;
        let hit = teeth.cast_ray(&from, &direction, length)?;
        Some(length - hit.distance)
    };
    // Three times its weight presses the face against its teeth.
    let pressed = |bones: bool| {
        let text =
            format!("gravity = [0, -9810, -30000]\n[contact]\npairs = \"all\"\nbones = {bones}\n");
        let scene = Scene::from_toml(&text).unwrap();
        let mut simulation = Simulation::new(Arc::clone(rig), scene, None).unwrap();
        for _ in 0..40 {
            simulation.advance(1.0 / 60.0).unwrap();
        }
        let nodes = rig.patches.iter().enumerate().flat_map(|(p, patch)| {
            let now = simulation.patch_positions(p).iter();
            patch.patch.neutral.iter().zip(now).collect::<Vec<_>>()
        });
        let nodes: Vec<f64> = nodes
            .filter_map(|(from, to)| behind(*from, to.cast()))
            .collect();
        let skin = rest.iter().zip(simulation.skin()).zip(&is_teeth);
        let skin = skin.filter(|(_, is_teeth)| !**is_teeth);
        let skin = skin.filter_map(|((from, to), _)| behind(from.cast(), to.cast()));
        (nodes, skin.fold(0.0, f64::max))
    };
    let (nodes, skin) = pressed(false);
    assert!(
        nodes.len() > 50 && skin > 1.0,
        "{} nodes, {skin} mm",
        nodes.len()
    );
    let (nodes, skin) = pressed(true);
    let deepest = nodes.iter().copied().fold(0.0, f64::max);
    assert!(deepest < 0.1, "{} nodes, {deepest} mm", nodes.len());
    assert!(skin < 0.1, "{skin} mm of skin");
}

/// Every frame of the demo's story: lips that stick and peel, a finger and a ball, blinks.
#[test]
fn nothing_crosses_in_the_contact_story() {
    let rig = &faces::demo().rig;
    let options = ReadOptions::default();
    let clip = motion::parse(template::demo_contact_take(), "story", &options).unwrap();
    let colliders = template::demo_contact_colliders();
    let text = format!("[contact]\npairs = \"all\"\nsticky_lips = {{}}\n{colliders}");
    let scene = Scene::from_toml(&text).unwrap();
    let frames = (clip.duration() * 60.0) as usize;
    let mut simulation = Simulation::new(Arc::clone(rig), scene, Some(clip)).unwrap();
    let mut forces = [0.0_f64; 2];
    for frame in 0..frames {
        let report = simulation.advance(1.0 / 60.0).unwrap();
        let verdict = simulation.judge_contact().unwrap().unwrap();
        let crossed = verdict.cloth + verdict.colliders;
        assert_eq!(crossed, 0, "frame {frame}: {verdict:?}");
        let skin = report.skin_contact.deepest_after;
        assert!(skin < 0.05, "frame {frame}: {skin} mm of skin inside");
        let contact = simulation.contact_report().unwrap();
        assert_eq!(contact.pinched, 0, "frame {frame}");
        for (most, force) in forces.iter_mut().zip(&contact.forces) {
            *most = most.max(force.norm());
        }
    }
    assert!(forces.iter().all(|f| *f > 0.0), "{forces:?}");
}

/// Every frame of the real take with everything that may touch, judged; minutes.
#[test]
fn nothing_crosses_in_the_whole_real_take() {
    let Some(shared) = std::env::var_os("FABRIG_SHARED") else {
        return;
    };
    let take = std::path::Path::new(&shared).join("mocap/livelinkface_rom.csv");
    let clip = motion::read(&take, &ReadOptions::default()).unwrap();
    let rig = &faces::demo().rig;
    let mut scene = Scene::default();
    scene.contact.pairs = PairMask::All;
    let frames = (clip.duration() * 30.0) as usize;
    let mut simulation = Simulation::new(Arc::clone(rig), scene, Some(clip)).unwrap();
    let (mut deepest, mut contacts) = (0.0_f64, 0);
    for frame in 0..frames {
        let report = simulation.advance(1.0 / 30.0).unwrap();
        let verdict = simulation.judge_contact().unwrap().unwrap();
        assert_eq!(verdict.cloth, 0, "frame {frame}: {verdict:?}");
        deepest = deepest.max(report.skin_contact.deepest_after);
        contacts += simulation.contact_report().unwrap().contacts;
    }
    assert!(contacts > 0);
    assert!(deepest < 0.05, "{deepest} mm of skin inside");
}
