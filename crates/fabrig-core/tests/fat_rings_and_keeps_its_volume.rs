//! Fat rings at the frequency and with the damping that its material says, follows a shaken head
//! as an oscillator does, and keeps its volume however the head lies.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::f64::consts::TAU;
use std::sync::Arc;

use fabrig_core::cloth::{
    Cloth, ClothOptions, ClothPatch, FrameInput, GridShape, HeadMotion, Material, PatchMotion,
};
use fabrig_core::edit::Edits;
use fabrig_core::evaluation::{
    Oscillation, gravity_directions, oscillation, pad_rings, pad_volumes,
};
use fabrig_core::scene::Scene;
use nalgebra::{Point3, Vector3};

const STEP: f64 = 1.0 / 240.0;

/// A pad that is stitched to nothing: all of it swings as one.
struct FreePad {
    cloth: Cloth,
    rest: Vec<Point3<f32>>,
    targets: [PatchMotion; 1],
}

impl FreePad {
    fn new(material: Material) -> Self {
        let shape = GridShape {
            u_count: 12,
            v_count: 10,
            is_periodic: false,
        };
        let rest: Vec<Point3<f32>> = (0..120)
            .map(|i| Point3::new((i % 12) as f32 * 2.0, (i / 12) as f32 * 2.0, 0.0))
            .collect();
        let patch = ClothPatch {
            shape,
            rest: rest.clone(),
            material,
            attachments: vec![],
            variations: vec![],
        };
        Self {
            cloth: Cloth::new(&[patch], &ClothOptions::default()).unwrap(),
            targets: [PatchMotion::still(&rest)],
            rest,
        }
    }

    /// One step with the head accelerated along x; mean displacement along it (mm).
    fn step(&mut self, acceleration: f64) -> f64 {
        let input = FrameInput {
            head: HeadMotion {
                linear_acceleration: Vector3::new(acceleration as f32, 0.0, 0.0),
                ..HeadMotion::default()
            },
            ..FrameInput::new(STEP, &self.targets)
        };
        self.cloth.step(&input).unwrap();
        let pairs = self.cloth.positions(0).iter().zip(&self.rest);
        let sum: f64 = pairs.map(|(x, r)| f64::from(x.x - r.x)).sum();
        sum / self.rest.len() as f64
    }
}

/// Rate (1/s) and damping (1/s) of a lone node of a material.
fn spring(material: &Material) -> (f64, f64) {
    let rate = (material.magnet_stiffness() / material.mass).sqrt();
    (rate, material.damping + material.magnet_damping())
}

#[test]
fn a_pad_rings_as_its_material_says() {
    let slow = Material {
        magnet_frequency_hz: 4.0,
        magnet_damping_ratio: 0.2,
        ..Material::FAT
    };
    for material in [Material::FAT, slow] {
        let (rate, damping) = spring(&material);
        let mut pad = FreePad::new(material);
        let mut hung = 0.0;
        for _ in 0..480 {
            hung = pad.step(9810.0);
        }
        let lag = 9810.0 / (rate * rate);
        assert!((hung / -lag - 1.0).abs() < 0.01, "hangs {hung}, {lag}");
        let mut ring = vec![hung];
        ring.extend((0..240).map(|_| pad.step(0.0)));
        let rang = oscillation(&ring, STEP).unwrap();
        let expected = Oscillation::of_spring(rate, damping);
        let frequency = rang.frequency / expected.frequency;
        let ratio = rang.damping_ratio / expected.damping_ratio;
        assert!((frequency - 1.0).abs() < 0.02, "{rang:?}, {expected:?}");
        assert!((ratio - 1.0).abs() < 0.06, "{rang:?}, {expected:?}");
    }
}

#[test]
fn a_shaken_pad_lags_as_a_driven_oscillator() {
    let (rate, damping) = spring(&Material::FAT);
    for shaken in [2.0, 4.0, 9.0] {
        let drive = TAU * shaken;
        let mut pad = FreePad::new(Material::FAT);
        // Steady after two seconds; then its part in and out of phase with the drive.
        let (mut cosine, mut sine) = (0.0, 0.0);
        let frames = (4.0 / STEP) as u32;
        for frame in 1..=frames {
            let t = f64::from(frame) * STEP;
            let x = pad.step(5000.0 * (drive * t).cos());
            if t > 2.0 {
                cosine += x * (drive * t).cos();
                sine += x * (drive * t).sin();
            }
        }
        let count = 0.5 * 2.0 / STEP;
        let amplitude = cosine.hypot(sine) / count;
        let lag = (-sine).atan2(-cosine);
        // x'' + c x' + w^2 x = -a cos(drive t)
        let (real, imaginary) = (rate * rate - drive * drive, damping * drive);
        let expected = 5000.0 / real.hypot(imaginary);
        let phase = imaginary.atan2(real);
        let swing = amplitude / expected;
        assert!(
            (swing - 1.0).abs() < 0.04,
            "{shaken} Hz: {amplitude}, {expected}"
        );
        assert!((lag - phase).abs() < 0.1, "{shaken} Hz: {lag} rad, {phase}");
    }
}

/// On a face pads are stitched to muscles, and what rings is both: as the network of all their
/// masses, springs and dampers does.
#[test]
fn pads_of_a_face_hang_and_ring_as_their_materials_say() {
    let rig = Arc::new(faces::template_rig());
    // To the side, and as in a jump.
    for push in [
        Vector3::new(9810.0, 0.0, 0.0),
        Vector3::new(0.0, 9810.0, 0.0),
    ] {
        let rings = pad_rings(&rig, &Scene::default(), push).unwrap();
        let swung = rings.iter().filter(|ring| ring.lag > 0.3);
        assert!(swung.clone().count() > 6, "{rings:?}");
        for ring in swung {
            let lag = ring.lag / ring.predicted_lag;
            assert!((0.9..1.1).contains(&lag), "{lag} {ring:?}");
            let [frequency, damping] = ring.ratios().expect(&ring.patch);
            assert!((0.9..1.1).contains(&frequency), "{frequency} {ring:?}");
            assert!((0.9..1.1).contains(&damping), "{damping} {ring:?}");
        }
    }
}

/// Pressure counts from the muscle under the pad, wherever that has gone, and stitches keep the two
/// together; without either pads change by several times as much.
#[test]
fn pads_keep_their_volume_however_the_head_lies() {
    let rig = faces::template_rig();
    let directions = gravity_directions();
    assert_eq!(directions.len(), 26);
    let pads = pad_volumes(&Arc::new(rig.clone()), &Scene::default(), &directions).unwrap();
    assert_eq!(pads.len(), 12);
    for pad in &pads {
        assert!(pad.rest > 100.0 && pad.sag > 0.2, "{pad:?}");
        assert!(pad.worst.abs() < 0.03, "{pad:?}");
    }
    let mut slack = rig;
    let edits = Edits::parse("[materials.fat]\npressure = 0.0\n").unwrap();
    edits.apply(&mut slack).unwrap();
    let worst = pads
        .iter()
        .max_by(|a, b| a.worst.abs().total_cmp(&b.worst.abs()));
    let under = |pad: &&fabrig_core::evaluation::PadVolume| pad.patch == "submental_fat";
    let gravity = Vector3::from(pads.iter().find(under).unwrap().worst_gravity);
    let without = pad_volumes(&Arc::new(slack), &Scene::default(), &[gravity, -gravity]).unwrap();
    let lost = without.iter().find(under).unwrap().worst.abs();
    assert!(lost > 2.0 * worst.unwrap().worst.abs(), "{lost}");
}
