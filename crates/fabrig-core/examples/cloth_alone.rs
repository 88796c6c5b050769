//! The cloth solver without a face: grids, targets and materials in, positions out.
//!
//! `cargo run --release -p fabrig-core --example cloth_alone`
#![allow(clippy::print_stdout, reason = "printing is what this program does")]

use fabrig_core::cloth::{
    Cloth, ClothAttachment, ClothOptions, ClothPatch, FrameInput, GridShape, Material, PatchMotion,
};
use nalgebra::{Point3, Vector3};

const DT: f64 = 1.0 / 60.0;

/// A flat sheet of 21 x 20 nodes, 2 mm apart, at a height.
fn sheet(height: f32, material: Material) -> ClothPatch {
    let shape = GridShape {
        u_count: 21,
        v_count: 20,
        is_periodic: false,
    };
    let rest = (0..shape.node_count())
        .map(|i| Point3::new((i % 21) as f32 * 2.0, (i / 21) as f32 * 2.0, height))
        .collect();
    ClothPatch {
        shape,
        rest,
        material,
        attachments: Vec::new(),
        variations: Vec::new(),
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A muscle whose first column is held to bone, with a pad of fat stitched onto it.
    let mut muscle = sheet(0.0, Material::LINEAR_MUSCLE);
    muscle.attachments.push(ClothAttachment::Anchors {
        nodes: (0..20).map(|row| row * 21).collect(),
        strength: 1.0,
    });
    let mut fat = sheet(3.0, Material::FAT);
    fat.attachments.push(ClothAttachment::Patch {
        patch: 0,
        pairs: (0..420).step_by(5).map(|i| (i, i)).collect(),
        strength: 0.2,
    });
    let patches = [muscle, fat];
    let mut cloth = Cloth::new(&patches, &ClothOptions::default())?;

    // The muscle contracts by a fifth over a quarter of a second and holds.
    let mut guards = 0;
    for frame in 1..=240 {
        let t = (f64::from(frame) / 15.0).min(1.0);
        let share = 0.2 * t * t * (3.0 - 2.0 * t);
        let rate = if t < 1.0 {
            0.2 * 6.0 * t * (1.0 - t) * 4.0
        } else {
            0.0
        };
        let targets: Vec<PatchMotion> = patches
            .iter()
            .map(|patch| PatchMotion {
                positions: patch
                    .rest
                    .iter()
                    .map(|p| Point3::new(p.x * (1.0 - share as f32), p.y, p.z))
                    .collect(),
                velocities: patch
                    .rest
                    .iter()
                    .map(|p| Vector3::new(-p.x * rate as f32, 0.0, 0.0))
                    .collect(),
            })
            .collect();
        let report = cloth.step(&FrameInput::new(DT, &targets))?;
        guards += report.counters.total();
        if frame % 20 == 0 {
            let end = cloth.positions(1)[20];
            println!(
                "{:.2} s: the fat's corner is at {:.3} mm",
                f64::from(frame) * DT,
                end.x
            );
        }
    }
    let end = cloth.positions(1)[20].x;
    assert!((end - 32.0).abs() < 0.1, "40 mm less a fifth, not {end}");
    assert_eq!(guards, 0, "nothing had to step in");
    Ok(())
}
