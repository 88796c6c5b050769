//! A pose held until still settles on its muscle shapes within 0.3 mm RMS at default
//! settings, and nothing has to step in for it.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::sync::Arc;

use fabrig_core::scene::{Scene, Simulation};

#[test]
fn held_shapes_settle_on_their_muscle_shapes() {
    let rig = &faces::demo().rig;
    let poses: [&[(&str, f32)]; 6] = [
        &[("jawOpen", 1.0)],
        &[("mouthSmileLeft", 1.0), ("mouthSmileRight", 1.0)],
        &[("eyeBlinkLeft", 1.0), ("eyeBlinkRight", 1.0)],
        &[("mouthPucker", 1.0)],
        &[("cheekPuff", 1.0)],
        &[("browInnerUp", 1.0), ("noseSneerLeft", 1.0)],
    ];
    let mut simulation = Simulation::new(Arc::clone(rig), Scene::default(), None).unwrap();
    for shapes in poses {
        let pose = faces::pose(rig, shapes);
        let mut report = simulation.advance_to(pose.clone(), 1.0 / 60.0).unwrap();
        for _ in 0..90 {
            report = simulation.advance_to(pose.clone(), 1.0 / 60.0).unwrap();
        }
        assert!(
            report.settle_rms < 0.3,
            "{shapes:?} settles {:.3} mm RMS away",
            report.settle_rms
        );
        assert_eq!(report.step.counters.frozen_patches, 0, "{shapes:?}");
    }
}
