//! The cases, in the order of the design's list.

use nalgebra::{Point3, Vector3};

use super::patches::{DT, cloth, contracted, dome, farthest, hold, rms, shifted, step};
use super::random::random_scenes;
use super::{CaseResult, Extent, sides};
use crate::cloth::{
    ClothAttachment, ClothOptions, ClothPatch, FrameInput, Material, Mode, PatchMotion, TIME_UNIT,
};

type Case = Box<dyn Fn() -> CaseResult>;

/// Every case.
pub(super) fn all(extent: Extent) -> Vec<Case> {
    let mut cases: Vec<Case> = vec![
        Box::new(rest_stays),
        Box::new(teleport_keeps_the_shape),
        Box::new(time_steps_agree),
        Box::new(stall),
        Box::new(|| stiffness(Mode::Fast)),
        Box::new(|| stiffness(Mode::Robust)),
        Box::new(coincident_nodes),
        Box::new(inverted),
        Box::new(half_contraction),
        Box::new(no_numbers),
        Box::new(units),
        Box::new(gravity_flips),
        Box::new(sides::mirror),
        Box::new(sides::threads),
        Box::new(few_patches),
        Box::new(move || held(extent.held_frames)),
        Box::new(wrinkles),
        Box::new(mass_ratio),
        Box::new(|| hopeless_stiffness(1e4)),
        Box::new(|| hopeless_stiffness(2e7)),
    ];
    let count = extent.random_scenes;
    // Run once, told twice.
    let results = std::sync::Arc::new(std::sync::OnceLock::<[CaseResult; 2]>::new());
    for index in 0..2 {
        let results = std::sync::Arc::clone(&results);
        cases.push(Box::new(move || {
            results.get_or_init(|| random_scenes(count))[index].clone()
        }));
    }
    cases
}

fn default() -> ClothOptions {
    ClothOptions::default()
}

fn rest_stays() -> CaseResult {
    let patch = dome(21, 20, 1.0, Material::FAT);
    let mut worst = 0.0_f64;
    for mode in [Mode::Fast, Mode::Robust, Mode::Paper] {
        let options = ClothOptions { mode, ..default() };
        let mut c = cloth(std::slice::from_ref(&patch), &options);
        hold(&mut c, &[&patch.rest], 30);
        worst = worst.max(farthest(c.positions(0), &patch.rest));
    }
    CaseResult::new("1 rest stays to the bit, in every mode", worst, 0.0, "mm")
}

fn teleport_keeps_the_shape() -> CaseResult {
    let patch = dome(21, 20, 1.0, Material::FAT);
    let away = shifted(&patch.rest, Vector3::new(1000.0, 0.0, -500.0));
    let mut c = cloth(&[patch], &default());
    c.reset(&[PatchMotion::still(&away)], &[])
        .expect("the targets are sound");
    hold(&mut c, &[&away], 30);
    CaseResult::new(
        "2 a teleport by reset leaves the shape",
        farthest(c.positions(0), &away),
        1e-3,
        "mm",
    )
}

fn time_steps_agree() -> CaseResult {
    let patch = dome(21, 20, 1.0, Material::FAT);
    let pose = contracted(&patch, 0.25, 4.0);
    let settled = |scale: f64| {
        let mut c = cloth(std::slice::from_ref(&patch), &default());
        for _ in 0..(240.0 / scale) as usize {
            step(&mut c, DT * scale, &[PatchMotion::still(&pose)]);
        }
        c.positions(0).to_vec()
    };
    let usual = settled(1.0);
    let worst = [0.125, 0.5, 2.0, 8.0]
        .iter()
        .map(|&scale| farthest(&usual, &settled(scale)))
        .fold(0.0, f64::max);
    CaseResult::new("3 dt x 1/8 to x 8 settle on one pose", worst, 0.02, "mm")
}

fn stall() -> CaseResult {
    let patch = dome(21, 20, 1.0, Material::FAT);
    let pose = contracted(&patch, 0.25, 4.0);
    let mut c = cloth(&[patch], &default());
    let mut frozen = 0;
    for dt in [DT, 1.0, DT, DT] {
        let report = step(&mut c, dt, &[PatchMotion::still(&pose)]);
        frozen += report.counters.frozen_patches;
    }
    let gap = if frozen > 0 {
        f64::INFINITY
    } else {
        rms(&c, 0, &pose)
    };
    CaseResult::new(
        "3 a stall of a second is one frame like another",
        gap,
        0.3,
        "mm RMS",
    )
}

fn with_resistance(resistance: f64) -> Material {
    Material {
        stretch_resistance: resistance,
        compression_resistance: resistance,
        shear_resistance: resistance,
        bend_resistance: resistance,
        pressure: resistance,
        ..Material::FAT
    }
}

fn stiffness(mode: Mode) -> CaseResult {
    let mut worst = 0.0_f64;
    for resistance in [0.0, 1e-6, 1e3, 1e9] {
        let patch = dome(21, 20, 1.0, with_resistance(resistance));
        let pose = contracted(&patch, 0.25, 4.0);
        let options = ClothOptions { mode, ..default() };
        let mut c = cloth(&[patch], &options);
        hold(&mut c, &[&pose], 240);
        worst = worst.max(rms(&c, 0, &pose));
    }
    let name = if mode == Mode::Fast { "fast" } else { "robust" };
    // Inextensible cloth keeps a tenth of the contraction and buckles.
    CaseResult::new(
        &format!("4 stiffness 0, 1e-6, 1e3, 1e9, {name}: near the pose"),
        worst,
        6.0,
        "mm RMS",
    )
}

fn coincident_nodes() -> CaseResult {
    let mut worst = 0.0_f64;
    let mut patch = dome(9, 8, 1.0, Material::FAT);
    patch.rest[10] = patch.rest[11];
    patch.rest[30] = patch.rest[39];
    let heap = ClothPatch {
        rest: vec![Point3::new(1.0, 2.0, 3.0); 72],
        ..patch.clone()
    };
    for patch in [patch, heap] {
        for mode in [Mode::Fast, Mode::Robust] {
            let pose = contracted(&patch, 0.25, 4.0);
            let options = ClothOptions { mode, ..default() };
            let mut c = cloth(std::slice::from_ref(&patch), &options);
            hold(&mut c, &[&pose], 60);
            worst = worst.max(rms(&c, 0, &pose));
        }
    }
    CaseResult::new(
        "5 zero-length edges and a heap of one point",
        worst,
        2.0,
        "mm RMS",
    )
}

fn inverted() -> CaseResult {
    let patch = dome(21, 20, 1.0, Material::LINEAR_MUSCLE);
    let turned: Vec<_> = patch
        .rest
        .iter()
        .map(|p| Point3::new(60.0 - p.x, p.y, 150.0 - p.z))
        .collect();
    let rest = patch.rest.clone();
    let mut c = cloth(&[patch], &default());
    c.reset(&[PatchMotion::still(&turned)], &[])
        .expect("the targets are sound");
    hold(&mut c, &[&rest], 240);
    CaseResult::new(
        "6 an inverted patch finds back",
        rms(&c, 0, &rest),
        0.3,
        "mm RMS",
    )
}

fn half_contraction() -> CaseResult {
    let mut worst = 0.0_f64;
    for material in [Material::LINEAR_MUSCLE, Material::FAT] {
        let patch = dome(21, 20, 1.0, material);
        let pose = contracted(&patch, 0.5, 0.0);
        let mut c = cloth(&[patch], &default());
        let report = hold(&mut c, &[&pose], 200);
        worst = worst.max(rms(&c, 0, &pose));
        if report.counters.frozen_patches > 0 {
            worst = f64::INFINITY;
        }
    }
    CaseResult::new(
        "7 half contraction in one frame is followed",
        worst,
        1.0,
        "mm RMS",
    )
}

fn no_numbers() -> CaseResult {
    let patch = dome(5, 4, 1.0, Material::FAT);
    let rest = patch.rest.clone();
    let mut c = cloth(&[patch], &default());
    let mut accepted = 0.0;
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
        for which in 0..2 {
            let mut bad = PatchMotion::still(&rest);
            if which == 0 {
                bad.positions[7].y = value;
            } else {
                bad.velocities[7].y = value;
            }
            if c.step(&FrameInput::new(DT, &[bad])).is_ok() {
                accepted += 1.0;
            }
        }
    }
    for dt in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        if c.step(&FrameInput::new(dt, &[PatchMotion::still(&rest)]))
            .is_ok()
        {
            accepted += 1.0;
        }
    }
    accepted += farthest(c.positions(0), &rest);
    CaseResult::new(
        "9 what is no number is refused and changes nothing",
        accepted,
        0.0,
        "accepted",
    )
}

fn units() -> CaseResult {
    let mut worst = 0.0_f64;
    for scale in [1e-3_f32, 1e3] {
        let mut patch = dome(9, 8, 1.0, Material::FAT);
        for p in &mut patch.rest {
            *p *= scale;
        }
        let pose: Vec<_> = patch.rest.iter().map(|p| p * 0.9).collect();
        let mut c = cloth(&[patch], &default());
        hold(&mut c, &[&pose], 300);
        worst = worst.max(rms(&c, 0, &pose) / f64::from(scale));
    }
    CaseResult::new(
        "12 units x 1e-3 and x 1e3 only scale",
        worst,
        0.5,
        "mm RMS, scaled",
    )
}

fn gravity_flips() -> CaseResult {
    // What the pad's outer face moves along its normal, against a pad without pressure.
    let sag = |pressure: f64| {
        let material = Material {
            pressure,
            ..Material::FAT
        };
        let mut patch = dome(21, 20, 1.0, material);
        for p in &mut patch.rest {
            p.z = 0.0;
        }
        let rest = patch.rest.clone();
        let mut c = cloth(&[patch], &default());
        let targets = [PatchMotion::still(&rest)];
        let mut input = FrameInput::new(DT, &targets);
        input.gravity = Some(default().standing_gravity + Vector3::new(0.0, 0.0, -9810.0));
        for _ in 0..240 {
            if c.step(&input).is_err() {
                return f64::INFINITY;
            }
        }
        let sum: f64 = c.positions(0).iter().map(|p| f64::from(p.z)).sum();
        (sum / rest.len() as f64).abs()
    };
    CaseResult::new(
        "14 under a flipped gravity pressure keeps fat's volume, against none",
        sag(Material::FAT.pressure) / sag(0.0),
        0.9,
        "of the sag",
    )
}

fn few_patches() -> CaseResult {
    let mut none = cloth(&[], &default());
    let energy = step(&mut none, DT, &[]).energies.total();
    let patch = dome(21, 20, 1.0, Material::FAT);
    let rest = patch.rest.clone();
    let mut one = cloth(&[patch], &default());
    hold(&mut one, &[&rest], 10);
    CaseResult::new(
        "18 no patch and one patch",
        energy + farthest(one.positions(0), &rest),
        0.0,
        "mm",
    )
}

fn held(frames: usize) -> CaseResult {
    let patch = dome(7, 6, 1.0, Material::FAT);
    let pose = contracted(&patch, 0.2, 2.0);
    let mut c = cloth(&[patch], &default());
    hold(&mut c, &[&pose], 600);
    let settled = c.positions(0).to_vec();
    hold(&mut c, &[&pose], frames);
    CaseResult::new(
        &format!("21 {frames} frames at a held target do not drift"),
        rms(&c, 0, &settled),
        1e-4,
        "mm RMS",
    )
}

fn wrinkles() -> CaseResult {
    let patch = dome(21, 20, 1.0, Material::LINEAR_MUSCLE);
    let pose = contracted(&patch, 0.25, 0.0);
    let depths: Vec<f64> = (0..6)
        .map(|seed| {
            // The imperfection varies what rest lengths take from the target, so they must take
            // something.
            let options = ClothOptions {
                rest_blend: 0.2,
                rest_imperfection: 0.5,
                seed,
                ..default()
            };
            let mut c = cloth(std::slice::from_ref(&patch), &options);
            hold(&mut c, &[&pose], 240);
            rms(&c, 0, &pose)
        })
        .collect();
    let most = depths.iter().copied().fold(0.0, f64::max);
    let least = depths.iter().copied().fold(f64::INFINITY, f64::min);
    CaseResult::new(
        "22 the depth of wrinkles is much the same for six seeds",
        // Seeds that all give one depth are not seeds.
        if most > least {
            most / least
        } else {
            f64::INFINITY
        },
        1.25,
        "deepest over shallowest",
    )
}

fn mass_ratio() -> CaseResult {
    let light = dome(9, 8, 1.0, Material::FAT);
    let heavy_material = Material {
        mass: 1e4,
        ..Material::FAT
    };
    let mut heavy = dome(9, 8, 1.0, heavy_material);
    heavy.attachments.push(ClothAttachment::Patch {
        patch: 0,
        pairs: (0..72).map(|i| (i, i)).collect(),
        strength: 10.0,
    });
    let poses = [contracted(&light, 0.2, 2.0), contracted(&heavy, 0.1, 3.0)];
    let mut c = cloth(&[light, heavy], &default());
    let report = hold(&mut c, &[&poses[0], &poses[1]], 240);
    let gap = if report.counters.frozen_patches > 0 {
        f64::INFINITY
    } else {
        rms(&c, 1, &poses[1])
    };
    CaseResult::new(
        "23 a mass ratio of 1e4 is held together",
        gap,
        0.5,
        "mm RMS",
    )
}

fn hopeless_stiffness(ratio: f64) -> CaseResult {
    let resistance = ratio * Material::FAT.magnet_stiffness() * TIME_UNIT * TIME_UNIT;
    let material = Material {
        stretch_resistance: resistance,
        compression_resistance: resistance,
        ..Material::FAT
    };
    let patch = dome(9, 8, 1.0, material);
    let rest = patch.rest.clone();
    let mut worst = 0.0_f64;
    for mode in [Mode::Fast, Mode::Robust] {
        let options = ClothOptions { mode, ..default() };
        let mut c = cloth(std::slice::from_ref(&patch), &options);
        let mut peak = 0.0_f64;
        for frame in 0..600 {
            let share = if frame < 60 { 0.4 } else { 0.0 };
            let pose = contracted(&patch, share, 4.0);
            let target = if frame < 60 { &pose } else { &rest };
            let report = step(&mut c, DT, &[PatchMotion::still(target)]);
            let energy = report.energies.total();
            if frame < 120 {
                peak = peak.max(energy);
            } else if energy.is_nan() || energy > peak {
                worst = f64::INFINITY;
            }
        }
        worst = worst.max(rms(&c, 0, &rest));
    }
    CaseResult::new(
        &format!("a stiffness ratio of {ratio:e}: energy is bounded, back at rest"),
        worst,
        1.0,
        "mm RMS",
    )
}
