//! Rest is an equilibrium, to the bit; held targets do not drift.

use nalgebra::Vector3;

use super::support::*;
use crate::cloth::{
    Cloth, ClothAttachment, ClothOptions, FrameInput, Material, PatchMotion, Precision,
};

#[test]
fn the_rest_pose_stays_to_the_bit() {
    for precision in [
        Precision::Single,
        Precision::SingleScalar,
        Precision::Double,
    ] {
        let mut patches = vec![
            dome(21, 20, 10.0, 1.0, Material::LINEAR_MUSCLE),
            dome(21, 20, 10.3, -1.0, Material::LINEAR_MUSCLE),
            dome(13, 9, 3.7, 1.0, Material::FAT),
            ring(Material::SPHINCTER),
        ];
        patches[0].attachments = vec![
            ClothAttachment::Anchors {
                nodes: (0..20).map(|v| v * 21).collect(),
                strength: 1.0,
            },
            ClothAttachment::Patch {
                patch: 2,
                pairs: vec![(40, 3), (41, 4), (40, 5)],
                strength: 1.0,
            },
        ];
        let options = ClothOptions {
            precision,
            ..ClothOptions::default()
        };
        let mut cloth = Cloth::new(&patches, &options).unwrap();
        let targets: Vec<_> = patches
            .iter()
            .map(|p| PatchMotion::still(&p.rest))
            .collect();
        let mut anchors = vec![PatchMotion::default(); 4];
        let held: Vec<_> = (0..20).map(|v| patches[0].rest[v * 21]).collect();
        anchors[0] = PatchMotion::still(&held);
        for _ in 0..20 {
            let mut input = FrameInput::new(DT, &targets);
            input.anchors = &anchors;
            let report = cloth.step(&input).unwrap();
            assert_eq!(report.counters, Default::default());
            assert_eq!(report.energies.total(), 0.0);
            for (i, patch) in patches.iter().enumerate() {
                assert_eq!(cloth.positions(i), patch.rest);
            }
        }
    }
}

#[test]
fn standing_gravity_moves_nothing_and_flipped_gravity_keeps_the_volume_above_the_base() {
    let patch = dome(21, 20, 10.0, 1.0, Material::FAT);
    let targets = [PatchMotion::still(&patch.rest)];
    let mut cloth = alone(&patch, &ClothOptions::default());
    let mut input = FrameInput::new(DT, &targets);
    input.gravity = Some(ClothOptions::default().standing_gravity);
    cloth.step(&input).unwrap();
    assert_eq!(cloth.positions(0), patch.rest);

    let lift = |pressure: f64| {
        let mut patch = patch.clone();
        patch.material.pressure = pressure;
        let mut cloth = alone(&patch, &ClothOptions::default());
        // Away from the face, through the pad's normals.
        let mut input = FrameInput::new(DT, &targets);
        let g = ClothOptions::default().standing_gravity;
        input.gravity = Some(g + Vector3::new(0.0, 0.0, 9810.0));
        for _ in 0..120 {
            cloth.step(&input).unwrap();
        }
        rms(&cloth, 0, &patch.rest)
    };
    let (free, held) = (lift(0.0), lift(3.0));
    assert!(
        held < 0.6 * free,
        "pressure holds the pad: {held} against {free}"
    );
}

#[test]
fn twenty_thousand_frames_on_a_held_target_do_not_drift() {
    let patch = dome(7, 6, 30.0, 1.0, Material::FAT);
    let pose = contracted(&patch, 0.2, 2.0);
    let targets = [PatchMotion::still(&pose)];
    let mut cloth = alone(&patch, &ClothOptions::default());
    hold(&mut cloth, &targets, 600);
    let settled = cloth.positions(0).to_vec();
    let report = hold(&mut cloth, &targets, 20_000);
    let drift = rms(&cloth, 0, &settled);
    assert!(drift < 1e-4, "{drift} mm");
    assert_eq!(report.counters, Default::default());
}

#[test]
fn targets_that_move_as_a_rigid_body_take_the_cloth_along() {
    // A steady translation is an inertial frame: after the start there is nothing to feel.
    let material = Material {
        damping: 0.0,
        ..Material::LINEAR_MUSCLE
    };
    let patch = dome(9, 8, 10.0, 1.0, material);
    let mut cloth = alone(&patch, &ClothOptions::default());
    let speed = Vector3::new(120.0, -60.0, 30.0);
    let at = |frame: usize| PatchMotion {
        positions: shifted(&patch.rest, speed * (frame as f32 * DT as f32)),
        velocities: vec![speed; patch.rest.len()],
    };
    cloth.reset(&[at(0)], &[]).unwrap();
    for frame in 1..60 {
        let targets = [at(frame)];
        cloth.step(&FrameInput::new(DT, &targets)).unwrap();
        assert!(rms(&cloth, 0, &targets[0].positions) < 1e-4);
    }
}
