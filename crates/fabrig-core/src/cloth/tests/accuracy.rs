//! Convergence in time, and single precision against the double-precision reference.

use super::support::*;
use crate::cloth::{Cloth, ClothOptions, FrameInput, Integrator, Material, PatchMotion, Precision};

/// Positions of a swinging patch at the end of every frame, in full precision.
fn run(material: Material, options: ClothOptions, frames: usize) -> Vec<Vec<[f64; 3]>> {
    let patch = dome(21, 20, 10.0, 1.0, material);
    let pose = contracted(&patch, 0.25, 4.0);
    let mut cloth = alone(&patch, &options);
    (1..=frames)
        .map(|frame| {
            let targets = [swing(&patch, &pose, frame as f64 * DT)];
            cloth.step(&FrameInput::new(DT, &targets)).unwrap();
            (0..patch.rest.len())
                .map(|i| cloth.node_state(0, i).0.into())
                .collect()
        })
        .collect()
}

/// Largest RMS difference over frames, relative to the largest RMS motion.
fn error(a: &[Vec<[f64; 3]>], b: &[Vec<[f64; 3]>]) -> f64 {
    let distance = |x: &[[f64; 3]], y: &[[f64; 3]]| {
        let sum: f64 = x
            .iter()
            .zip(y)
            .map(|(p, q)| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>())
            .sum();
        (sum / x.len() as f64).sqrt()
    };
    let worst = a
        .iter()
        .zip(b)
        .map(|(x, y)| distance(x, y))
        .fold(0.0, f64::max);
    let start = dome(21, 20, 10.0, 1.0, Material::FAT).rest;
    let start: Vec<[f64; 3]> = start
        .iter()
        .map(|p| p.coords.map(f64::from).into())
        .collect();
    let motion = b.iter().map(|y| distance(&start, y)).fold(0.0, f64::max);
    worst / motion
}

fn options(substeps: u32, integrator: Integrator, precision: Precision) -> ClothOptions {
    ClothOptions {
        substeps,
        integrator,
        precision,
        ..ClothOptions::default()
    }
}

#[test]
fn default_settings_are_within_one_percent_of_the_reference() {
    for material in [Material::LINEAR_MUSCLE, Material::FAT] {
        let frames = 24;
        let reference = run(
            material,
            options(128, Integrator::Bdf2, Precision::Double),
            frames,
        );
        let finer = run(
            material,
            options(256, Integrator::Bdf2, Precision::Double),
            frames,
        );
        let uncertainty = error(&reference, &finer);
        assert!(
            uncertainty < 3e-4,
            "reference differs from itself by {uncertainty}"
        );
        let default = run(material, ClothOptions::default(), frames);
        let e = error(&default, &finer);
        println!("default error {e:.2e}, reference's own {uncertainty:.2e}");
        assert!(e < 0.01, "{e}");
    }
}

#[test]
fn bdf2_converges_at_second_order_and_euler_at_first() {
    for (integrator, low, high) in [
        (Integrator::BackwardEuler, 0.7, 1.3),
        (Integrator::Bdf2, 1.6, 2.6),
    ] {
        let material = Material {
            // Soft enough for the sweep's own error to be small at these steps.
            stretch_resistance: 2.0,
            compression_resistance: 2.0,
            shear_resistance: 1.0,
            // One sweep applies stretch damping to first order only.
            stretch_damping: 0.0,
            ..Material::LINEAR_MUSCLE
        };
        let at = |n| run(material, options(n, integrator, Precision::Double), 16);
        let finest = run(
            material,
            options(512, Integrator::Bdf2, Precision::Double),
            16,
        );
        let (coarse, fine) = (error(&at(16), &finest), error(&at(64), &finest));
        let order = (coarse / fine).log2() / 2.0;
        println!("{integrator:?}: {coarse:.2e} -> {fine:.2e}, order {order:.2}");
        assert!(order > low && order < high, "{integrator:?}: order {order}");
    }
}

#[test]
fn rounding_is_far_below_the_time_error() {
    let single = run(Material::FAT, ClothOptions::default(), 24);
    let double = run(
        Material::FAT,
        ClothOptions {
            precision: Precision::Double,
            ..ClothOptions::default()
        },
        24,
    );
    let e = error(&single, &double);
    assert!(e < 1e-4, "{e}");
}

#[test]
fn a_held_pose_settles_within_three_tenths_of_a_millimetre() {
    for material in [Material::LINEAR_MUSCLE, Material::SPHINCTER, Material::FAT] {
        let patch = dome(21, 20, 10.0, 1.0, material);
        for (contraction, lift) in [(0.3, 6.0), (-0.3, 3.0), (0.2, -4.0)] {
            let pose = contracted(&patch, contraction, lift);
            let mut cloth = alone(&patch, &ClothOptions::default());
            let report = hold(&mut cloth, &[PatchMotion::still(&pose)], 180);
            let gap = rms(&cloth, 0, &pose);
            println!("{contraction} {lift}: {gap:.4} mm");
            assert!(gap < 0.3, "{gap} mm at contraction {contraction}");
            assert!(report.energies.kinetic < 1e-2, "still moving");
        }
    }
}

#[test]
fn a_jump_of_a_micrometre_moves_the_result_little_at_default_settings() {
    let patch = dome(21, 20, 10.0, 1.0, Material::FAT);
    let mut nudged = patch.clone();
    for (i, p) in nudged.rest.iter_mut().enumerate() {
        p.z += if i % 3 == 0 { 1e-3 } else { 0.0 };
    }
    let pose = contracted(&patch, 0.3, 6.0);
    let run = |patch| {
        let mut cloth = Cloth::new(&[patch], &ClothOptions::default()).unwrap();
        hold(&mut cloth, &[PatchMotion::still(&pose)], 120);
        cloth.positions(0).to_vec()
    };
    let (a, b) = (run(patch), run(nudged));
    let worst = a
        .iter()
        .zip(&b)
        .map(|(p, q)| (p - q).norm())
        .fold(0.0, f32::max);
    println!("1 um at rest moves a held pose by {worst} mm");
    assert!(worst < 0.1, "{worst}");
}
