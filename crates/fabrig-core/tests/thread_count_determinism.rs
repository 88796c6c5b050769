//! Rigs and simulations have the same bits for 1, 2 and 8 threads, with everything touching.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::sync::Arc;

use fabrig_core::Vector;
use fabrig_core::collision::{Collider, ColliderKey, ColliderShape, PairMask, Stickiness};
use fabrig_core::scene::{Scene, Simulation};

/// A scene in which lips stick, patches touch each other and a ball touches the brow.
fn touched() -> Scene {
    let mut scene = Scene::default();
    scene.contact.pairs = PairMask::All;
    scene.contact.sticky_lips = Some(Stickiness::default());
    let shape = ColliderShape::Ball { radius: 15.0 };
    let mut ball = Collider::at("ball", shape, Vector::new(0.0, 50.0, 130.0));
    ball.keys.push(ColliderKey {
        time: 0.1,
        position: Vector::new(0.0, 50.0, 100.0),
        rotation: Vector::zeros(),
    });
    scene.colliders = vec![ball];
    scene
}

fn run(threads: usize) -> (Vec<u8>, Vec<[u32; 3]>) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        let rig = Arc::new(faces::template_rig());
        let bytes = rig.to_bytes().unwrap();
        let mut simulation = Simulation::new(Arc::clone(&rig), touched(), None).unwrap();
        let pose = faces::pose(&rig, &[("jawOpen", 0.7), ("mouthSmileLeft", 0.9)]);
        let mut contacts = 0;
        for _ in 0..5 {
            simulation.advance_to(pose.clone(), 1.0 / 30.0).unwrap();
            contacts += simulation.contact_report().unwrap().contacts;
        }
        assert!(contacts > 0);
        let bits = simulation
            .skin()
            .iter()
            .map(|p| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits()])
            .collect();
        (bytes, bits)
    })
}

#[test]
fn one_two_and_eight_threads_give_equal_bits() {
    let one = run(1);
    for threads in [2, 8] {
        let other = run(threads);
        assert!(one.0 == other.0, "the rig differs with {threads} threads");
        assert!(one.1 == other.1, "the skin differs with {threads} threads");
    }
}
