//! Patches, targets and runs that the tests share.

use nalgebra::Point3;

use crate::cloth::{
    Cloth, ClothOptions, ClothPatch, FrameInput, GridShape, Material, PatchMotion, StepReport,
};

pub(super) use crate::cloth::bench::stability::patches::{
    DT, contracted, dome_at as dome, rms, shifted,
};

/// A ring of 48 x 15 about (0, -40, 70).
pub(super) fn ring(material: Material) -> ClothPatch {
    let mut rest = Vec::new();
    for v in 0..15 {
        for u in 0..48 {
            let angle = (u as f32 + 0.5) / 48.0 * std::f32::consts::TAU;
            let radius = 12.0 + 1.5 * v as f32;
            let x = 1.4 * radius * angle.cos();
            let y = radius * angle.sin() - 40.0;
            rest.push(Point3::new(
                x,
                y,
                90.0 - 0.01 * (x * x + 0.3 * radius * radius),
            ));
        }
    }
    ClothPatch {
        shape: GridShape {
            u_count: 48,
            v_count: 15,
            is_periodic: true,
        },
        rest,
        material,
        attachments: Vec::new(),
        variations: Vec::new(),
    }
}

/// Targets that go smoothly between rest and a pose, at `frame`, with a period of 40 frames
/// (positions and velocities).
pub(super) fn swing(patch: &ClothPatch, pose: &[Point3<f32>], t: f64) -> PatchMotion {
    let rate = std::f64::consts::TAU / 0.66;
    let (s, c) = (rate * t).sin_cos();
    let weight = 0.5 - 0.5 * c;
    let speed = 0.5 * rate * s;
    let mut motion = PatchMotion::default();
    for (a, b) in patch.rest.iter().zip(pose) {
        let d = b - a;
        motion.positions.push(a + d * weight as f32);
        motion.velocities.push(d * speed as f32);
    }
    motion
}

/// Steps a cloth on fixed targets.
pub(super) fn hold(cloth: &mut Cloth, targets: &[PatchMotion], frames: usize) -> StepReport {
    let mut last = StepReport::default();
    for _ in 0..frames {
        last = cloth.step(&FrameInput::new(DT, targets)).unwrap();
    }
    last
}

/// A cloth of one patch.
pub(super) fn alone(patch: &ClothPatch, options: &ClothOptions) -> Cloth {
    Cloth::new(std::slice::from_ref(patch), options).unwrap()
}

/// A material whose constraints are all off but for the magnet.
pub(super) fn magnet_only(frequency: f64, ratio: f64) -> Material {
    Material {
        stretch_resistance: 0.0,
        compression_resistance: 0.0,
        shear_resistance: 0.0,
        bend_resistance: 0.0,
        damping: 0.0,
        stretch_damping: 0.0,
        pressure: 0.0,
        magnet_frequency_hz: frequency,
        magnet_damping_ratio: ratio,
        ..Material::FAT
    }
}

/// One node at the origin.
pub(super) fn single(material: Material) -> ClothPatch {
    ClothPatch {
        shape: GridShape {
            u_count: 1,
            v_count: 1,
            is_periodic: false,
        },
        rest: vec![Point3::origin()],
        material,
        attachments: Vec::new(),
        variations: Vec::new(),
    }
}
