//! A rig that is fitted to a face's own expressions comes nearer to them, pose by pose, than
//! delta transfer does, and amplitudes fitted to some expressions help with others.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::ops::ControlFlow::Continue;

use fabrig_core::evaluation::{Drive, METHODS, Method, Table3, evaluate_face, synthetic_faces};
use fabrig_core::template;

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
