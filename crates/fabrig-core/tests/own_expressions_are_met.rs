//! A rig that is fitted to a face's own expressions comes nearer to them, pose by pose, than
//! delta transfer does, and amplitudes fitted to some expressions help with others.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::ops::ControlFlow::Continue;

use fabrig_core::evaluation::{Drive, METHODS, Method, Table3, evaluate_face, synthetic_faces};
use fabrig_core::mesh::Mesh;
use fabrig_core::pipeline::{RigFaceOptions, rig_face};
use fabrig_core::template;
use fabrig_core::transfer::AlphaMode;

#[test]
fn own_expressions_beat_delta_transfer_and_examples_help_poses_that_they_are_not() {
    let template = template::human();
    let face = &synthetic_faces(template, "young_woman carried").unwrap()[0];
    assert!(face.is_synthetic);
    let method = |name: &str| -> Method { *METHODS.iter().find(|m| m.name == name).unwrap() };
    let names = ["delta", "global, size", "global, map", "own shapes"];
    let methods = names.map(method);
    let result = evaluate_face(face, template, &methods, &mut |_| Continue(())).unwrap();
    for error in &result.errors {
        assert!(error.count > 500, "{error:?}");
        assert!(error.mean < 0.5 * error.motion, "{error:?}");
    }
    let table = Table3 {
        faces: vec![result],
        refused: Vec::new(),
    };
    let mean = |name: &str| table.over_faces(name, None, Drive::Units)[0];
    let [delta, size, map, own] = names.map(mean);
    // Examples that are none of the poses.
    assert!(map < 0.95 * size, "{map} mm with examples, {size} without");
    assert!(own < 0.6 * delta, "{own} mm, delta transfer {delta}");
    // A best fit does no worse than the weights that the pose is made of, but that it is the
    // sum of squares that is least, not the mean.
    for name in names {
        let fitted = table.over_faces(name, None, Drive::BestFit)[0];
        assert!(fitted < 1.2 * mean(name), "{name}: {fitted} mm");
    }
}

/// Expressions on one mesh of a face serve another mesh of it, cut off behind the ears.
#[test]
fn expressions_reach_a_face_from_another_mesh_of_it() {
    let template = template::human();
    let face = &synthetic_faces(template, "young_woman carried").unwrap()[0];
    let tip = face
        .neutral
        .positions()
        .iter()
        .map(|p| p.z)
        .fold(f64::MIN, f64::max);
    let is_front = |&v: &u32| face.neutral.positions()[v as usize].z > tip - 110.0;
    let mut index = vec![None; face.neutral.vertex_count()];
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for t in face.neutral.triangles() {
        if t.iter().all(is_front) {
            triangles.push(t.map(|v| {
                *index[v as usize].get_or_insert_with(|| {
                    positions.push(face.neutral.positions()[v as usize]);
                    positions.len() as u32 - 1
                })
            }));
        }
    }
    let front = Mesh::from_triangles(positions, &triangles).unwrap();
    assert!(front.vertex_count() < face.neutral.vertex_count());
    let rig = |mesh: &Mesh, other: Option<&Mesh>| {
        let mut options = RigFaceOptions {
            expressions: face.expressions.clone(),
            expressions_on: other.cloned(),
            ..RigFaceOptions::default()
        };
        options.rig.alpha = AlphaMode::Patch;
        let rigged = rig_face(mesh, template, &options, &mut |_| Continue(())).unwrap();
        let patches = rigged.rig.patches.iter();
        patches.map(|p| p.transfer.alpha).collect::<Vec<f64>>()
    };
    let own = rig(&face.neutral, None);
    let carried = rig(&front, Some(&face.neutral));
    let apart = own.iter().zip(&carried).map(|(a, b)| (a / b - 1.0).abs());
    let apart = apart.sum::<f64>() / own.len() as f64;
    assert!(apart < 0.06, "amplitudes differ by {apart} in the mean");
    let spread = own.iter().fold(0.0f64, |most, a| most.max((a - 1.0).abs()));
    assert!(
        spread > 0.1,
        "all amplitudes are {spread} from 1: nothing was fitted"
    );
}
