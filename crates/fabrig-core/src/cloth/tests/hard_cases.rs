//! What the hard cases of [`crate::cloth::bench::stability`] leave out: errors by their kind, the
//! clamp, and stiffness that does not fight the pose.

use nalgebra::Vector3;

use super::support::*;
use crate::cloth::{
    Cloth, ClothAttachment, ClothError, ClothOptions, ClothPatch, FrameInput, GridShape, Material,
    PatchMotion,
};

#[test]
fn stiffness_that_does_not_fight_the_pose_settles_on_it() {
    for resistance in [0.0, 1e-6, 1e3, 1e9] {
        let material = Material {
            stretch_resistance: resistance,
            compression_resistance: resistance,
            shear_resistance: resistance,
            bend_resistance: resistance,
            pressure: resistance,
            ..Material::FAT
        };
        let patch = dome(21, 20, 10.0, 1.0, material);
        let pose = contracted(&patch, 0.25, 4.0);
        let options = ClothOptions {
            rest_blend: 1.0,
            ..ClothOptions::default()
        };
        let mut cloth = alone(&patch, &options);
        hold(&mut cloth, &[PatchMotion::still(&pose)], 240);
        let gap = rms(&cloth, 0, &pose);
        // At the extreme a sweep passes on motion only slowly.
        let limit = if resistance > 1e6 { 6.0 } else { 0.3 };
        assert!(gap < limit, "resistance {resistance}: {gap} mm");
    }
}

#[test]
fn a_teleport_by_reset_leaves_the_shape_and_one_without_comes_back() {
    let patch = dome(9, 8, 10.0, 1.0, Material::FAT);
    let away = shifted(&patch.rest, Vector3::new(1000.0, 0.0, -500.0));
    let mut cloth = alone(&patch, &ClothOptions::default());
    cloth.reset(&[PatchMotion::still(&away)], &[]).unwrap();
    assert_eq!(cloth.positions(0), away);
    hold(&mut cloth, &[PatchMotion::still(&away)], 5);
    // A metre from the neutral shape positions are rounded to 6e-5 mm.
    assert!(rms(&cloth, 0, &away) < 1e-3);
    let targets = [PatchMotion::still(&patch.rest)];
    let mut clamped = 0;
    for _ in 0..600 {
        let report = cloth.step(&FrameInput::new(DT, &targets)).unwrap();
        clamped += report.counters.clamped_displacements;
    }
    assert!(
        clamped > 0,
        "a metre is further than half an edge per substep"
    );
    assert!(rms(&cloth, 0, &patch.rest) < 0.3);
}

#[test]
fn numbers_that_are_none_are_rejected_and_change_nothing() {
    let patch = dome(5, 4, 10.0, 1.0, Material::FAT);
    let mut cloth = alone(&patch, &ClothOptions::default());
    let mut bad = PatchMotion::still(&patch.rest);
    bad.positions[7].y = f32::NAN;
    let error = cloth
        .step(&FrameInput::new(DT, &[bad.clone()]))
        .unwrap_err();
    assert!(
        matches!(
            error,
            ClothError::MotionValue {
                patch: 0,
                node: 7,
                ..
            }
        ),
        "{error}"
    );
    bad = PatchMotion::still(&patch.rest);
    bad.velocities[3].x = f32::INFINITY;
    assert!(cloth.step(&FrameInput::new(DT, &[bad.clone()])).is_err());
    bad.velocities.pop();
    assert!(matches!(
        cloth.step(&FrameInput::new(DT, &[bad])),
        Err(ClothError::MotionLength {
            expected: 20,
            actual: 19,
            ..
        })
    ));
    let good = [PatchMotion::still(&patch.rest)];
    for dt in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            cloth.step(&FrameInput::new(dt, &good)),
            Err(ClothError::TimeStep { .. })
        ));
    }
    let mut input = FrameInput::new(DT, &good);
    input.wind.z = f32::NAN;
    assert!(matches!(
        cloth.step(&input),
        Err(ClothError::FieldValue { what: "wind", .. })
    ));
    assert!(matches!(
        cloth.step(&FrameInput::new(DT, &[])),
        Err(ClothError::PatchCount {
            expected: 1,
            actual: 0,
            ..
        })
    ));
    assert_eq!(cloth.positions(0), patch.rest);
    cloth.step(&FrameInput::new(DT, &good)).unwrap();
    assert_eq!(cloth.positions(0), patch.rest);
}

#[test]
fn bad_patches_are_rejected_with_their_place() {
    let good = dome(5, 4, 10.0, 1.0, Material::FAT);
    let options = ClothOptions::default();
    let make = |patch: ClothPatch| Cloth::new(&[good.clone(), patch], &options).err();
    let mut short = good.clone();
    short.rest.pop();
    assert!(matches!(
        make(short),
        Some(ClothError::NodeCount {
            patch: 1,
            expected: 20,
            actual: 19,
            ..
        })
    ));
    let mut tiny = good.clone();
    tiny.shape = GridShape {
        u_count: 2,
        v_count: 10,
        is_periodic: true,
    };
    assert!(matches!(make(tiny), Some(ClothError::GridTooSmall { .. })));
    let mut soft = good.clone();
    soft.material.mass = 0.0;
    assert!(matches!(
        make(soft),
        Some(ClothError::Material { patch: 1, .. })
    ));
    for (attachment, name) in [
        (
            ClothAttachment::Anchors {
                nodes: vec![20],
                strength: 1.0,
            },
            "names node 20",
        ),
        (
            ClothAttachment::Patch {
                patch: 9,
                pairs: vec![],
                strength: 1.0,
            },
            "names patch 9",
        ),
        (
            ClothAttachment::Patch {
                patch: 1,
                pairs: vec![],
                strength: 1.0,
            },
            "to itself",
        ),
        (
            ClothAttachment::Anchors {
                nodes: vec![0],
                strength: f64::NAN,
            },
            "strength NaN",
        ),
    ] {
        let mut patch = good.clone();
        patch.attachments.push(attachment);
        let message = make(patch).unwrap().to_string();
        assert!(message.contains(name), "{message}");
    }
}
