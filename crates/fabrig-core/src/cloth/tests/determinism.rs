//! Same bits for any number of threads and any lane width; mirrored in, mirrored out.

use nalgebra::{Point3, Vector3};

use super::support::*;
use crate::cloth::{
    Cloth, ClothAttachment, ClothOptions, ClothPatch, FrameInput, Material, PatchMotion, Precision,
};
use crate::machine::with_baseline;

/// Left and right muscles and pads with a ring between, all coupled.
fn scene() -> Vec<ClothPatch> {
    let mut patches = Vec::new();
    for sign in [1.0, -1.0] {
        for k in 0..5 {
            patches.push(dome(21, 20, 12.0 + k as f32, sign, Material::LINEAR_MUSCLE));
        }
        patches.push(dome(21, 20, 11.5, sign, Material::FAT));
    }
    patches.push(ring(Material::SPHINCTER));
    for side in [0, 6] {
        for k in 0..5 {
            patches[side + k].attachments = vec![
                ClothAttachment::Anchors {
                    nodes: (0..20).map(|v| v * 21).collect(),
                    strength: 1.0,
                },
                ClothAttachment::Patch {
                    patch: side as u32 + 5,
                    pairs: (0..40).map(|i| (i * 7 + k as u32, i * 9)).collect(),
                    strength: 0.5,
                },
            ];
        }
    }
    patches
}

fn run(patches: &[ClothPatch], precision: Precision, sign: f32, frames: usize) -> Cloth {
    let options = ClothOptions {
        precision,
        ..ClothOptions::default()
    };
    let mut cloth = Cloth::new(patches, &options).unwrap();
    for frame in 1..=frames {
        let targets: Vec<_> = patches
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let pose = contracted(p, 0.05 * (i % 6) as f32, 2.0);
                swing(p, &pose, frame as f64 * DT)
            })
            .collect();
        let mut input = FrameInput::new(DT, &targets);
        input.wind = Vector3::new(sign * 3000.0, 500.0, -4000.0);
        input.head.linear_acceleration = Vector3::new(sign * 2000.0, 0.0, 900.0);
        input.head.angular_velocity = Vector3::new(0.5, sign * 2.0, -sign);
        input.head.angular_acceleration = Vector3::new(5.0, sign * 20.0, sign * -10.0);
        cloth.step(&input).unwrap();
    }
    cloth
}

#[test]
fn bits_are_equal_for_any_thread_count() {
    let patches = scene();
    let reference = run(&patches, Precision::Single, 1.0, 6);
    for threads in [1, 2, 8] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let cloth = pool.install(|| run(&patches, Precision::Single, 1.0, 6));
        for patch in 0..patches.len() {
            assert_eq!(cloth.positions(patch), reference.positions(patch));
        }
    }
}

#[test]
fn bits_are_equal_in_and_out_of_lanes() {
    let patches = scene();
    let lanes = run(&patches, Precision::Single, 1.0, 6);
    let scalar = run(&patches, Precision::SingleScalar, 1.0, 6);
    for patch in 0..patches.len() {
        assert_eq!(lanes.positions(patch), scalar.positions(patch));
        for node in [0, 100, 300] {
            assert_eq!(
                lanes.node_state(patch, node),
                scalar.node_state(patch, node)
            );
        }
    }
}

#[test]
fn bits_are_equal_for_any_vector_instructions() {
    let patches = scene();
    let widest = run(&patches, Precision::Single, 1.0, 6);
    let baseline = with_baseline(|| run(&patches, Precision::Single, 1.0, 6));
    for patch in 0..patches.len() {
        assert_eq!(widest.positions(patch), baseline.positions(patch));
    }
}

#[test]
fn mirrored_input_gives_mirrored_output_to_the_bit() {
    let patches = scene();
    let mirror = |p: &Point3<f32>| Point3::new(-p.x, p.y, p.z);
    let mirrored: Vec<ClothPatch> = patches
        .iter()
        .map(|p| ClothPatch {
            rest: p.rest.iter().map(mirror).collect(),
            ..p.clone()
        })
        .collect();
    let a = run(&patches, Precision::Single, 1.0, 10);
    let b = run(&mirrored, Precision::Single, -1.0, 10);
    for patch in 0..patches.len() {
        let turned: Vec<_> = a.positions(patch).iter().map(mirror).collect();
        assert_eq!(turned, b.positions(patch), "patch {patch}");
        let moved = rms(&a, patch, &patches[patch].rest);
        assert!(moved > 0.05, "patch {patch} hardly moves: {moved}");
    }
}

#[test]
fn left_and_right_patches_of_one_cloth_mirror_each_other() {
    let patches = scene();
    let mut cloth = Cloth::new(&patches, &ClothOptions::default()).unwrap();
    for frame in 1..=10 {
        let targets: Vec<PatchMotion> = patches
            .iter()
            .map(|p| swing(p, &contracted(p, 0.2, 3.0), f64::from(frame) * DT))
            .collect();
        cloth.step(&FrameInput::new(DT, &targets)).unwrap();
    }
    for patch in 0..6 {
        for (l, r) in cloth
            .positions(patch)
            .iter()
            .zip(cloth.positions(patch + 6))
        {
            assert_eq!([l.x, l.y, l.z], [-r.x, r.y, r.z], "patch {patch}");
        }
    }
}
