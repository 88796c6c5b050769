//! Lips slammed shut in one frame, lids shut over the eyeballs: nothing that may collide
//! crosses, by an exact test that shares nothing with contact.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::sync::Arc;

use fabrig_core::collision::PairMask;
use fabrig_core::scene::{Scene, Simulation};

#[test]
fn lips_and_lids_do_not_cross_however_fast_they_close() {
    let rig = &faces::demo().rig;
    let mut scene = Scene::default();
    scene.contact.pairs = PairMask::Sphincter;
    let mut simulation = Simulation::new(Arc::clone(rig), scene, None).unwrap();
    let poses: [&[(&str, f32)]; 4] = [
        &[("jawOpen", 1.0)],
        &[
            ("mouthPucker", 1.0),
            ("mouthPressLeft", 1.0),
            ("mouthPressRight", 1.0),
        ],
        &[
            ("eyeBlinkLeft", 1.0),
            ("eyeBlinkRight", 1.0),
            ("mouthRollLower", 1.0),
        ],
        &[],
    ];
    let mut contacts = 0;
    for shapes in poses {
        let pose = faces::pose(rig, shapes);
        for frame in 0..6 {
            simulation.advance_to(pose.clone(), 1.0 / 60.0).unwrap();
            let verdict = simulation.judge_contact().unwrap().unwrap();
            assert_eq!(verdict.cloth, 0, "{shapes:?}, frame {frame}");
            contacts += simulation.contact_report().unwrap().contacts;
        }
    }
    assert!(contacts > 0, "the lids touch");
}
