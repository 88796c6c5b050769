//! Random scenes: materials within three decades, random weights, time steps from an eighth to
//! eight frames, teleports, wind and a turning head.

use nalgebra::Vector3;

use super::CaseResult;
use super::patches::{DT, contracted, dome, rms, shifted};
use crate::cloth::{
    Cloth, ClothAttachment, ClothOptions, FrameInput, Material, PatchMotion, StepReport,
};

/// Numbers in [0, 1) from a counter (SplitMix64).
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A factor within so many decades, half of them to either side.
    fn decades(&mut self, decades: f64) -> f64 {
        10.0_f64.powf((self.roll() - 0.5) * decades)
    }
}

/// How one random scene ended.
#[derive(Debug, Clone, Copy, Default)]
struct Ending {
    /// RMS distance from the targets. (mm)
    away: f64,
    /// Kinetic energy over the highest that there was.
    moving: f64,
}

/// Runs random scenes 0 to `count`: 40 wild frames, then 400 calm ones.
pub fn random_scenes(count: u64) -> [CaseResult; 2] {
    let (mut worst, mut away_seed, mut moving_seed) = (Ending::default(), 0, 0);
    for seed in 0..count {
        let end = scene(seed);
        if end.away > worst.away || end.away.is_nan() {
            (worst.away, away_seed) = (end.away, seed);
        }
        if end.moving > worst.moving || end.moving.is_nan() {
            (worst.moving, moving_seed) = (end.moving, seed);
        }
    }
    [
        CaseResult::new(
            &format!("{count} random scenes end near their targets (worst: {away_seed})"),
            worst.away,
            1.0,
            "mm RMS",
        ),
        CaseResult::new(
            &format!("{count} random scenes calm down (worst: {moving_seed})"),
            worst.moving,
            1e-3,
            "of the highest energy",
        ),
    ]
}

fn scene(seed: u64) -> Ending {
    let mut dice = Dice(seed);
    let base = if dice.roll() < 0.5 {
        Material::FAT
    } else {
        Material::LINEAR_MUSCLE
    };
    let material = Material {
        mass: base.mass * dice.decades(3.0),
        stretch_resistance: base.stretch_resistance * dice.decades(3.0),
        compression_resistance: base.compression_resistance * dice.decades(3.0),
        shear_resistance: base.shear_resistance * dice.decades(3.0),
        bend_resistance: base.bend_resistance * dice.decades(3.0),
        damping: base.damping * dice.decades(3.0),
        stretch_damping: base.stretch_damping * dice.decades(3.0),
        pressure: base.pressure * dice.decades(3.0),
        ..base
    };
    let mut a = dome(9, 8, 1.0, material);
    let b = dome(9, 8, 1.0, base);
    a.attachments.push(ClothAttachment::Patch {
        patch: 1,
        pairs: (0..9).map(|i| (i * 8, i * 7)).collect(),
        strength: dice.decades(3.0),
    });
    let options = ClothOptions {
        rest_blend: dice.roll(),
        ..ClothOptions::default()
    };
    let patches = [a, b];
    let mut cloth = super::patches::cloth(&patches, &options);
    let mut peak = 0.0_f64;
    for _ in 0..40 {
        let report = frame(&mut cloth, &patches, &mut dice, false);
        let energy = report.energies.total();
        peak = if energy <= peak { peak } else { energy };
    }
    let mut last = StepReport::default();
    for _ in 0..400 {
        last = frame(&mut cloth, &patches, &mut dice, true);
    }
    let away = [0, 1].map(|i| rms(&cloth, i, &patches[i].rest));
    Ending {
        away: away[0].max(away[1]),
        moving: (last.energies.kinetic - 1.0).max(0.0) / peak.max(1.0),
    }
}

fn frame(
    cloth: &mut Cloth,
    patches: &[crate::cloth::ClothPatch],
    dice: &mut Dice,
    is_calm: bool,
) -> StepReport {
    let amount = if is_calm { 0.0 } else { 1.0 };
    let share = (0.4 * dice.roll() * amount) as f32;
    let jump = if dice.roll() < 0.1 * amount {
        200.0
    } else {
        0.0
    };
    let targets: Vec<_> = patches
        .iter()
        .map(|p| PatchMotion {
            positions: shifted(
                &contracted(p, share, 4.0 * share),
                Vector3::new(jump, 0.0, 0.0),
            ),
            velocities: Vec::new(),
        })
        .collect();
    let dt = if is_calm { DT } else { DT * dice.decades(1.8) };
    let mut input = FrameInput::new(dt, &targets);
    if !is_calm {
        input.wind = Vector3::new(0.0, 0.0, -2e4 * dice.roll() as f32);
        input.head.angular_velocity = Vector3::new(0.0, 8.0 * dice.roll() as f32, 0.0);
    }
    cloth.step(&input).expect("the frame is well made")
}
