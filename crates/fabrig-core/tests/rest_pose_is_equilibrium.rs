//! With all weights zero and no field but the gravity a face was captured under, nothing
//! moves: the skin is the input mesh, in the head frame and in its own units.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::sync::Arc;

use fabrig_core::scene::{Scene, Simulation};

#[test]
fn the_neutral_face_is_the_input_bit_for_bit_without_dynamics() {
    let demo = faces::demo();
    let scene = Scene::without_dynamics();
    let mut simulation = Simulation::new(Arc::clone(&demo.rig), scene, None).unwrap();
    simulation.advance(1.0 / 60.0).unwrap();
    assert_eq!(simulation.skin(), demo.rig.skin_at_rest());
    assert_eq!(simulation.skin_in_own_units(), demo.mesh.positions());
}

#[test]
fn the_neutral_face_stays_at_rest_as_cloth() {
    let demo = faces::demo();
    let mut simulation = Simulation::new(Arc::clone(&demo.rig), Scene::default(), None).unwrap();
    for _ in 0..60 {
        let report = simulation.advance(1.0 / 60.0).unwrap();
        assert!(
            report.settle_max < 0.01,
            "a node drifts by {} mm",
            report.settle_max
        );
    }
    let largest = demo
        .rig
        .skin_at_rest()
        .iter()
        .zip(simulation.skin())
        .map(|(rest, now)| (now - rest).norm())
        .fold(0.0, f32::max);
    assert!(largest < 0.01, "the skin moves by {largest} mm");
}
