//! Closed-form answers: oscillators, free fall, hanging springs, momentum, volume.

use nalgebra::{Point3, Vector3};

use super::support::*;
use crate::cloth::materials::PRESSURE_SHARE;
use crate::cloth::{
    Cloth, ClothAttachment, ClothOptions, ClothPatch, FrameInput, GridShape, Material, PatchMotion,
    Precision, TIME_UNIT,
};

fn fine() -> ClothOptions {
    ClothOptions {
        substeps: 256,
        precision: Precision::Double,
        ..ClothOptions::default()
    }
}

/// Gravity that differs from the standing one by `by`.
fn extra_gravity(by: [f32; 3]) -> Option<Vector3<f32>> {
    Some(ClothOptions::default().standing_gravity + Vector3::from(by))
}

#[test]
fn a_node_rings_about_its_target_at_the_magnet_frequency_and_damping() {
    let (frequency, ratio) = (7.0, 0.12);
    let mut cloth = alone(&single(magnet_only(frequency, ratio)), &fine());
    let up = [Point3::new(0.0, 0.4, 0.0)];
    let mut targets = [PatchMotion::still(&up)];
    // The target jumps within one very short frame, then stays.
    targets[0].velocities.clear();
    let mut input = FrameInput::new(1e-6, &targets);
    cloth.step(&input).unwrap();
    let still = [PatchMotion::still(&up)];
    input = FrameInput::new(1e-3, &still);
    let w = std::f64::consts::TAU * frequency;
    let wd = w * (1.0_f64 - ratio * ratio).sqrt();
    let mut worst = 0.0_f64;
    for k in 1..=400 {
        cloth.step(&input).unwrap();
        let t = f64::from(k) * 1e-3;
        // Released at -0.4 from the target; the damping gives it the target's velocity,
        // integrated over the jump: 2 ratio w 0.4.
        let v0 = 2.0 * ratio * w * 0.4;
        let u = (-ratio * w * t).exp()
            * (-0.4 * (wd * t).cos() + (v0 - 0.4 * ratio * w) / wd * (wd * t).sin());
        let actual = cloth.node_state(0, 0).0.y - 0.4;
        worst = worst.max((actual - u).abs());
    }
    assert!(worst < 0.004, "{worst}");
}

#[test]
fn a_free_node_falls_as_galileo_says() {
    let mut cloth = alone(&single(magnet_only(0.0, 0.0)), &ClothOptions::default());
    let target = [PatchMotion::still(&[Point3::origin()])];
    let mut input = FrameInput::new(1.0 / 60.0, &target);
    input.gravity = extra_gravity([0.0, -10.0, 0.0]);
    for _ in 0..61 {
        cloth.step(&input).unwrap();
    }
    // Gravity comes in over the first frame: v = g (t - dt/2).
    let (x, v) = cloth.node_state(0, 0);
    let t = 1.0 + DT / 2.0;
    assert!((v.y + 10.0 * t).abs() < 0.01, "{v}");
    assert!((x.y + 5.0 * t * t).abs() < 0.02, "{x}");
}

#[test]
fn overall_damping_gives_the_terminal_velocity() {
    let material = Material {
        damping: 2.0,
        ..magnet_only(0.0, 0.0)
    };
    let mut cloth = alone(&single(material), &ClothOptions::default());
    let target = [PatchMotion::still(&[Point3::origin()])];
    let mut input = FrameInput::new(1.0 / 60.0, &target);
    input.gravity = extra_gravity([0.0, 0.0, 6.0]);
    for _ in 0..600 {
        cloth.step(&input).unwrap();
    }
    let v = cloth.node_state(0, 0).1.z;
    assert!((v - 3.0).abs() < 0.03, "{v}");
}

/// A chain of `count` links of 2 mm hanging down from an anchor.
fn chain(count: u32, resistance: f64) -> ClothPatch {
    ClothPatch {
        shape: GridShape {
            u_count: count + 1,
            v_count: 1,
            is_periodic: false,
        },
        rest: (0..=count)
            .map(|i| Point3::new(0.0, -2.0 * i as f32, 0.0))
            .collect(),
        material: Material {
            stretch_resistance: resistance,
            compression_resistance: resistance,
            damping: 12.0,
            ..magnet_only(0.0, 0.0)
        },
        variations: Vec::new(),
        attachments: vec![ClothAttachment::Anchors {
            nodes: vec![0],
            strength: 1e4,
        }],
    }
}

#[test]
fn a_hanging_chain_stretches_by_the_weight_below_each_link() {
    let (count, resistance, gravity) = (10, 10.0, 981.0_f64);
    let patch = chain(count, resistance);
    // One sweep per substep softens a spring by about 2 k h_e^2/m: fine steps for a stiff chain.
    let options = ClothOptions {
        substeps: 128,
        precision: Precision::Double,
        ..ClothOptions::default()
    };
    let mut cloth = alone(&patch, &options);
    let target = [PatchMotion::still(&patch.rest)];
    let mut input = FrameInput::new(DT, &target);
    input.gravity = extra_gravity([0.0, -981.0, 0.0]);
    for _ in 0..300 {
        cloth.step(&input).unwrap();
    }
    let k = resistance / (TIME_UNIT * TIME_UNIT);
    let elongation = |i: u32| f64::from(count - i) * gravity / k;
    let expected: f64 = 2.0 * f64::from(count) + (0..count).map(elongation).sum::<f64>();
    let length = -cloth.node_state(0, count as usize).0.y;
    let top = cloth.node_state(0, 0).0.y;
    let relative = (length + top - expected).abs() / (expected - 20.0);
    println!("length {length}, expected {expected}, off by {relative:.2e} of the elongation");
    assert!(relative < 0.01, "{length} {expected}");
}

#[test]
fn a_free_patch_keeps_its_momentum() {
    let mut material = magnet_only(0.0, 0.0);
    material.stretch_resistance = 10.0;
    material.compression_resistance = 6.0;
    material.shear_resistance = 5.0;
    material.bend_resistance = 5.0;
    material.stretch_damping = 0.2;
    let patch = dome(9, 8, 5.0, 1.0, material);
    let mut cloth = alone(
        &patch,
        &ClothOptions {
            rest_blend: 1.0,
            ..fine()
        },
    );
    // The rest lengths shrink with the target, which sets the patch in motion from inside.
    let small: Vec<_> = patch
        .rest
        .iter()
        .map(|p| (p.coords * 0.98).into())
        .collect();
    let targets = [PatchMotion::still(&small)];
    let n = patch.rest.len();
    for _ in 0..10 {
        cloth.step(&FrameInput::new(DT, &targets)).unwrap();
    }
    let (mut total, mut size) = (Vector3::zeros(), 0.0);
    for i in 0..n {
        let v = cloth.node_state(0, i).1;
        total += v;
        size += v.norm();
    }
    assert!(size > 1.0, "nothing moves");
    assert!(total.norm() < 1e-3 * size, "{total} of {size}");
}

#[test]
fn pairs_keep_momentum_and_make_two_nodes_swing_as_one() {
    // A light and a heavy node with magnets of 5 Hz and 10 Hz, held together.
    let light = Material {
        mass: 1.0,
        stretch_resistance: 10.0,
        ..magnet_only(5.0, 0.0)
    };
    let heavy = Material {
        mass: 3.0,
        stretch_resistance: 10.0,
        ..magnet_only(10.0, 0.0)
    };
    let mut a = single(light);
    a.attachments.push(ClothAttachment::Patch {
        patch: 1,
        pairs: vec![(0, 0)],
        strength: 1e3,
    });
    let mut cloth = Cloth::new(&[a, single(heavy)], &fine()).unwrap();
    let targets = vec![PatchMotion::still(&[Point3::origin()]); 2];
    let mut input = FrameInput::new(1e-3, &targets);
    input.gravity = extra_gravity([0.0, 0.0, 1000.0]);
    let w2 = std::f64::consts::TAU.powi(2) * (25.0 + 3.0 * 100.0) / 4.0;
    let (mut highest, mut sum, count) = (0.0_f64, 0.0, 1000);
    for _ in 0..count {
        cloth.step(&input).unwrap();
        let (za, zb) = (cloth.node_state(0, 0).0.z, cloth.node_state(1, 0).0.z);
        assert!((za - zb).abs() < 1e-3, "{za} {zb}");
        highest = highest.max(za);
        sum += za;
    }
    let sag = 1000.0 / w2;
    assert!(
        (highest / (2.0 * sag) - 1.0).abs() < 0.02,
        "{highest} {sag}"
    );
    assert!((sum / f64::from(count) / sag - 1.0).abs() < 0.05);
}

#[test]
fn pressure_stiffens_a_pad_that_is_lifted_as_a_whole() {
    // Pressed along its normal, a flat pad feels magnet and pressure: u = a / (w^2 + k), of which
    // k is as much as in 0.3/T^2.
    let material = Material {
        pressure: 0.3 / PRESSURE_SHARE,
        damping: 20.0,
        ..magnet_only(7.0, 0.1)
    };
    let mut patch = dome(11, 10, 0.0, 1.0, material);
    for p in &mut patch.rest {
        p.z = 0.0;
    }
    let mut cloth = alone(&patch, &ClothOptions::default());
    let targets = [PatchMotion::still(&patch.rest)];
    let mut input = FrameInput::new(DT, &targets);
    input.gravity = extra_gravity([0.0, 0.0, -2000.0]);
    for _ in 0..300 {
        cloth.step(&input).unwrap();
    }
    let volume: f64 = (0..patch.rest.len())
        .map(|i| cloth.node_state(0, i).0.z)
        .sum::<f64>();
    let mean = volume / patch.rest.len() as f64;
    let w2 = material.magnet_stiffness();
    // Nodes at the border carry less of the area: the mean lies between the pad's rigid
    // answer and the magnet's alone, near the former.
    let rigid = -2000.0 / (w2 + 0.3 / (TIME_UNIT * TIME_UNIT));
    let free = -2000.0 / w2;
    assert!(
        mean < 0.9 * rigid && mean > 0.7 * rigid + 0.3 * free,
        "{mean} {rigid} {free}"
    );
}

#[test]
fn a_steady_spin_stretches_the_magnet_by_the_centrifugal_force() {
    let patch = ClothPatch {
        rest: vec![Point3::new(100.0, 0.0, 0.0)],
        ..single(Material {
            damping: 30.0,
            ..magnet_only(10.0, 0.5)
        })
    };
    let mut cloth = alone(&patch, &ClothOptions::default());
    let targets = [PatchMotion::still(&patch.rest)];
    let mut input = FrameInput::new(DT, &targets);
    input.head.angular_velocity = Vector3::new(0.0, 5.0, 0.0);
    for _ in 0..300 {
        cloth.step(&input).unwrap();
    }
    let w2 = (std::f64::consts::TAU * 10.0).powi(2);
    let expected = 25.0 * 100.0 / (w2 - 25.0);
    let actual = cloth.node_state(0, 0).0.x - 100.0;
    assert!(
        (actual / expected - 1.0).abs() < 1e-3,
        "{actual} {expected}"
    );
}

#[test]
fn wind_pushes_a_pad_downwind_by_its_drag() {
    let mut patch = dome(11, 10, 0.0, 1.0, magnet_only(7.0, 0.5));
    for p in &mut patch.rest {
        p.z = 0.0;
    }
    let options = ClothOptions::default();
    let mut cloth = alone(&patch, &options);
    let targets = [PatchMotion::still(&patch.rest)];
    let mut input = FrameInput::new(DT, &targets);
    input.wind = Vector3::new(0.0, 0.0, -800.0);
    for _ in 0..200 {
        cloth.step(&input).unwrap();
    }
    let mean: f64 = (0..110).map(|i| cloth.node_state(0, i).0.z).sum::<f64>() / 110.0;
    let pressure = 0.5 * options.air_density * 800.0_f64.powi(2) * options.drag;
    let expected = -pressure / options.areal_density / patch.material.magnet_stiffness();
    assert!((mean / expected - 1.0).abs() < 0.02, "{mean} {expected}");
}
