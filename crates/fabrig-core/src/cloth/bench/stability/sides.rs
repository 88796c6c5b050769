//! Both sides of a face: mirrored input, and any number of threads.

use nalgebra::{Point3, Vector3};

use super::CaseResult;
use super::patches::{DT, cloth, contracted, dome, farthest};
use crate::cloth::{ClothAttachment, ClothOptions, ClothPatch, FrameInput, Material, PatchMotion};

/// Left and right muscles and pads, coupled on each side.
fn pair_of_sides(sign: f32) -> Vec<ClothPatch> {
    let mut patches = Vec::new();
    for side in [1.0, -1.0] {
        for material in [Material::LINEAR_MUSCLE, Material::FAT] {
            patches.push(dome(21, 20, sign * side, material));
        }
    }
    for side in [0_usize, 2] {
        patches[side].attachments.push(ClothAttachment::Patch {
            patch: side as u32 + 1,
            pairs: (0..40).map(|i| (i * 7, i * 9)).collect(),
            strength: 0.5,
        });
    }
    patches
}

fn run_sides(sign: f32) -> Vec<Vec<Point3<f32>>> {
    let patches = pair_of_sides(sign);
    let mut c = cloth(&patches, &ClothOptions::default());
    for frame in 1..=10 {
        let share = 0.03 * frame as f32;
        let targets: Vec<_> = patches
            .iter()
            .enumerate()
            .map(|(i, p)| PatchMotion {
                positions: contracted(p, share, i as f32),
                velocities: Vec::new(),
            })
            .collect();
        let mut input = FrameInput::new(DT, &targets);
        input.wind = Vector3::new(sign * 3000.0, 500.0, -4000.0);
        input.head.angular_velocity = Vector3::new(0.5, sign * 2.0, -sign);
        // A case that is well made; a refusal would show as rest.
        let _ = c.step(&input);
    }
    (0..patches.len())
        .map(|p| c.positions(p).to_vec())
        .collect()
}

pub(super) fn mirror() -> CaseResult {
    let (a, b) = (run_sides(1.0), run_sides(-1.0));
    let worst = a
        .iter()
        .zip(&b)
        .map(|(a, b)| {
            let turned: Vec<_> = a.iter().map(|p| Point3::new(-p.x, p.y, p.z)).collect();
            farthest(&turned, b)
        })
        .fold(0.0, f64::max);
    CaseResult::new("16 mirrored input gives mirrored output", worst, 0.0, "mm")
}

pub(super) fn threads() -> CaseResult {
    let run = |count: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build()
            .map(|pool| pool.install(|| run_sides(1.0)))
    };
    let Ok(one) = run(1) else {
        return CaseResult::new("17 threads", f64::INFINITY, 0.0, "mm");
    };
    let mut worst = 0.0_f64;
    for count in [2, 8] {
        let Ok(other) = run(count) else {
            worst = f64::INFINITY;
            continue;
        };
        for (a, b) in one.iter().zip(&other) {
            worst = worst.max(farthest(a, b));
        }
    }
    CaseResult::new("17 1, 2 and 8 threads give equal bits", worst, 0.0, "mm")
}
