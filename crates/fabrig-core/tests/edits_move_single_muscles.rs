//! Edits change one muscle and leave the rest of the face still, beyond what attachments and
//! skin carry; they go out to a mesh and come back, and wrong names are refused.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::sync::Arc;

use fabrig_core::edit::{Edits, export_muscle_shape, import_muscle_shape};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{FacePose, Scene, Simulation, hold_pose};

const MUSCLE: &str = "zygomaticus_major_l";
const SHAPE: &str = "zygomaticus_major_l.mouthSmileLeft";

fn edited(rig: &Rig, text: &str) -> Rig {
    let mut rig = rig.clone();
    Edits::parse(text).unwrap().apply(&mut rig).unwrap();
    rig
}

/// Displacement of every skin vertex on a neutral face. (mm)
fn moved(rig: &Rig, scene: Scene) -> Vec<f32> {
    let mut simulation = Simulation::new(Arc::new(rig.clone()), scene, None).unwrap();
    let pose = FacePose::neutral(rig.shape_names.len());
    hold_pose(&mut simulation, &pose).unwrap();
    let rest = rig.skin_at_rest();
    let skin = simulation.skin().iter().zip(&rest);
    skin.map(|(now, rest)| (now - rest).norm()).collect()
}

#[test]
fn moving_one_muscle_leaves_the_rest_of_the_face_still() {
    let plain = faces::template_rig();
    let rig = edited(&plain, &format!("[shapes.\"{SHAPE}\"]\nweight = 1.0\n"));
    let patch = rig
        .patches
        .iter()
        .position(|p| p.patch.chart.name == MUSCLE)
        .unwrap();
    let first: u32 = rig.binding.node_counts[..patch].iter().sum();
    let own = first..first + rig.binding.node_counts[patch];
    let carried = |v: usize| rig.binding.row(v).any(|(node, _)| own.contains(&node));

    let placed = moved(&rig, Scene::without_dynamics());
    let most = |of: &[f32], is_carried: bool| {
        let of = of
            .iter()
            .enumerate()
            .filter(|(v, _)| carried(*v) == is_carried);
        of.map(|(_, d)| *d).fold(0.0, f32::max)
    };
    assert!(
        most(&placed, true) > 1.0,
        "the muscle moves the skin over it"
    );
    assert_eq!(most(&placed, false), 0.0, "nothing else moves");

    let simulated = moved(&rig, Scene::default());
    let still = moved(&plain, Scene::default());
    assert!(
        still.iter().all(|&d| d < 1e-3),
        "a neutral face stands still"
    );
    // The right half hangs on no patch that is attached to this one.
    let right = (0..simulated.len()).filter(|&v| rig.positions[v].x < -15.0);
    let most_right = right.map(|v| simulated[v]).fold(0.0, f32::max);
    let share = most_right / most(&simulated, true);
    assert!(
        share < 0.02,
        "{most_right} mm on the other side, {share} of what moves"
    );
}

#[test]
fn a_muscle_shape_goes_out_and_comes_back() {
    let plain = faces::template_rig();
    let mut mesh = export_muscle_shape(&plain, SHAPE).unwrap();
    let mut positions = mesh.positions().to_vec();
    positions[40].y += 0.7;
    positions[41].z -= 0.3;
    mesh = mesh.with_positions(positions).unwrap();
    let mut edits = Edits::parse(&format!("[shapes.\"{SHAPE}\"]\nstrength = 0.5\n")).unwrap();
    assert_eq!(
        import_muscle_shape(&plain, SHAPE, &mesh, &mut edits).unwrap(),
        2
    );
    assert_eq!(
        edits.shapes[SHAPE].strength,
        Some(0.5),
        "what was edited before stays"
    );

    edits.shapes.get_mut(SHAPE).unwrap().strength = None;
    let mut rig = plain.clone();
    edits.apply(&mut rig).unwrap();
    let back = export_muscle_shape(&rig, SHAPE).unwrap();
    for (a, b) in back.positions().iter().zip(mesh.positions()) {
        assert!((a - b).norm() < 2e-3, "{a} {b}");
    }
    // Hinged and lid shapes come back too.
    for name in [
        "orbicularis_oris.jawOpen",
        "orbicularis_oculi_l.eyeBlinkLeft",
    ] {
        let mesh = export_muscle_shape(&plain, name).unwrap();
        let mut positions = mesh.positions().to_vec();
        positions[10].z += 0.5;
        let mesh = mesh.with_positions(positions).unwrap();
        let mut edits = Edits::default();
        import_muscle_shape(&plain, name, &mesh, &mut edits).unwrap();
        let mut rig = plain.clone();
        edits.apply(&mut rig).unwrap();
        let back = export_muscle_shape(&rig, name).unwrap();
        let error = (back.positions()[10] - mesh.positions()[10]).norm();
        assert!(error < 0.1, "{name}: {error} mm");
    }
    let small = fabrig_core::template::demo_face();
    let error = import_muscle_shape(&plain, SHAPE, &small, &mut edits).unwrap_err();
    assert!(error.to_string().contains("vertices"), "{error}");
}

#[test]
fn strength_alpha_and_materials_take_effect() {
    let plain = faces::template_rig();
    let rig = edited(
        &plain,
        &format!(
            "[shapes.\"{SHAPE}\"]\nstrength = 2.0\n[patches.malar_fat_l]\nalpha = 1.5\n\
             material = \"soft\"\n[materials.soft]\nlike = \"fat\"\nbend_resistance = 1.0\n"
        ),
    );
    let reach = |rig: &Rig| {
        let rest = &rig
            .patches
            .iter()
            .find(|p| p.patch.chart.name == MUSCLE)
            .unwrap()
            .patch
            .neutral;
        let at = export_muscle_shape(rig, SHAPE).unwrap();
        let moved = at.positions().iter().zip(rest);
        moved.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    };
    assert!((reach(&rig) / reach(&plain) - 2.0).abs() < 0.01);
    let fat = rig
        .patches
        .iter()
        .find(|p| p.patch.chart.name == "malar_fat_l")
        .unwrap();
    assert_eq!(
        (fat.transfer.alpha, fat.patch.chart.material.as_str()),
        (1.5, "soft")
    );
    let materials = fabrig_core::cloth::Materials::parse(&rig.materials).unwrap();
    assert_eq!(materials.get("soft").unwrap().bend_resistance, 1.0);
}

#[test]
fn wrong_edits_are_refused_and_change_nothing() {
    let plain = faces::template_rig();
    let cases = [
        (
            "[shapes.\"zygomaticus_major_l.mouthSmileLeftt\"]\nweight = 1\n",
            SHAPE,
        ),
        ("[patches.molar_fat]\nalpha = 1\n", "malar_fat_"),
        ("[patches.malar_fat_l]\nmaterial = \"fatt\"\n", "'fat'"),
        ("[materials.soft]\nlike = \"fet\"\n", "'fat'"),
        ("[materials.fat]\nmass = -1\n", "not valid"),
        ("[materials.fat]\nmasss = 1\n", "not valid"),
        ("[patches.malar_fat_l]\nalpha = nan\n", "alpha"),
        (
            "[shapes.\"zygomaticus_major_l.mouthSmileLeft\"]\nweight = 2\n",
            "from 0 to 1",
        ),
        (
            "[shapes.\"zygomaticus_major_l.mouthSmileLeft\".moved]\n9999 = [0, 0, 1]\n",
            "9999",
        ),
    ];
    for (text, part) in cases {
        let mut rig = plain.clone();
        let error = Edits::parse(text)
            .unwrap()
            .apply(&mut rig)
            .unwrap_err()
            .to_string();
        assert!(error.contains(part), "{text}: {error}");
        assert!(rig == plain, "a refused edit changed the rig");
    }
}
