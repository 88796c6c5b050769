//! Nodes that differ from their material.

use super::support::*;
use crate::cloth::{
    Cloth, ClothError, ClothOptions, ClothPatch, Material, Mode, NodeVariation, PatchMotion,
};

fn options(mode: Mode, sweeps: u32) -> ClothOptions {
    ClothOptions {
        mode,
        sweeps,
        rest_blend: 0.3,
        ..ClothOptions::default()
    }
}

#[test]
fn a_variation_of_every_node_is_another_material() {
    let plain = dome(9, 8, 10.0, 1.0, Material::FAT);
    let scaled = dome(
        9,
        8,
        10.0,
        1.0,
        Material {
            stretch_resistance: 3.0 * Material::FAT.stretch_resistance,
            compression_resistance: 3.0 * Material::FAT.compression_resistance,
            shear_resistance: 3.0 * Material::FAT.shear_resistance,
            bend_resistance: 0.5 * Material::FAT.bend_resistance,
            ..Material::FAT
        },
    );
    let varied = ClothPatch {
        variations: vec![
            NodeVariation {
                stretch: 3.0,
                bend: 0.5,
                rest_blend: 1.0,
            };
            plain.rest.len()
        ],
        ..plain.clone()
    };
    let pose = contracted(&plain, 0.2, 3.0);
    for (mode, sweeps) in [
        (Mode::Fast, 1),
        (Mode::Fast, 3),
        (Mode::Robust, 1),
        // Shares of several sweeps are no stiffness that a factor could scale.
        (Mode::Paper, 1),
    ] {
        let options = options(mode, sweeps);
        let mut cloths = [&plain, &scaled, &varied].map(|patch| alone(patch, &options));
        for frame in 1..=40 {
            let target = [swing(&plain, &pose, f64::from(frame) * DT)];
            let step = |cloth: &mut Cloth| {
                let input = crate::cloth::FrameInput::new(DT, &target);
                cloth.step(&input).unwrap().energies.total()
            };
            let [_, a, b] = cloths.each_mut().map(step);
            assert!((a - b).abs() < 1e-3 * a.max(1.0), "{mode:?}: {a} {b}");
        }
        let [plain, scaled, varied] = &cloths;
        let apart = rms(varied, 0, scaled.positions(0));
        let changed = rms(varied, 0, plain.positions(0));
        assert!(
            apart < 1e-3 && changed > 50.0 * apart,
            "{mode:?}: {apart} mm of {changed} mm"
        );
    }
}

#[test]
fn skin_folds_where_its_lengths_stay_and_as_widely_as_its_stiffness_says() {
    let (u_count, v_count) = (61_u32, 12_u32);
    let patch = dome(u_count, v_count, 10.0, 1.0, Material::LINEAR_MUSCLE);
    let (loose, half) = (
        NodeVariation {
            stretch: 4.0,
            bend: 16.0,
            rest_blend: 0.0,
        },
        u_count / 2,
    );
    let variations = (0..u_count * v_count)
        .map(|i| {
            if i % u_count < half {
                loose
            } else {
                NodeVariation::NONE
            }
        })
        .collect();
    let patch = ClothPatch {
        variations,
        ..patch
    };
    let pose = contracted(&patch, 0.1, 0.0);
    let mut cloth = alone(&patch, &ClothOptions::default());
    hold(&mut cloth, &[PatchMotion::still(&pose)], 240);
    let row: Vec<f32> = (0..u_count)
        .map(|u| (v_count / 2 * u_count + u) as usize)
        .map(|i| cloth.positions(0)[i].z - pose[i].z)
        .collect();
    let depth = |nodes: &[f32]| nodes.iter().fold(0.0_f32, |most, z| most.max(z.abs()));
    // Two bends' reach past the border.
    let (folded, smooth) = row.split_at(half as usize);
    let (folded, smooth) = (&folded[4..folded.len() - 4], &smooth[4..]);
    assert!(
        depth(folded) > 0.5 && depth(smooth) < 0.2,
        "{} {}",
        depth(folded),
        depth(smooth)
    );
    // On the grid a fold of phase t an edge costs (B x^2 + K) / x with x = 2 - 2 cos t, least
    // at x = sqrt(K / B); bending's dropoff takes its share of B off.
    let material = Material::LINEAR_MUSCLE;
    let bend =
        material.bend_stiffness() * f64::from(loose.bend) * (1.0 - material.bend_angle_dropoff);
    let x = (material.magnet_stiffness() / bend).sqrt();
    let expected = std::f64::consts::TAU / (1.0 - x / 2.0).acos();
    let turns = folded
        .windows(3)
        .filter(|w| (w[1] - w[0]) * (w[2] - w[1]) < 0.0);
    let turns = turns.count();
    let wavelength = 2.0 * folded.len() as f64 / turns as f64;
    assert!(
        (wavelength / expected - 1.0).abs() < 0.2,
        "{wavelength} edges, expected {expected}"
    );
}

#[test]
fn variations_that_cannot_be_are_refused() {
    let patch = dome(4, 4, 10.0, 1.0, Material::FAT);
    let refused = |variations: Vec<NodeVariation>| {
        let patch = ClothPatch {
            variations,
            ..patch.clone()
        };
        let error = Cloth::new(&[patch], &ClothOptions::default())
            .err()
            .unwrap();
        match error {
            ClothError::Variation { node, .. } => node,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(vec![NodeVariation::NONE; 3]), 3);
    let mut one = vec![NodeVariation::NONE; 16];
    one[5].bend = f32::NAN;
    assert_eq!(refused(one.clone()), 5);
    one[5] = NodeVariation {
        rest_blend: 1.5,
        ..NodeVariation::NONE
    };
    assert_eq!(refused(one), 5);
}
