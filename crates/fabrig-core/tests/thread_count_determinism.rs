//! Rigs and simulations have the same bits for 1, 2 and 8 threads.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::sync::Arc;

use fabrig_core::scene::{Scene, Simulation};

fn run(threads: usize) -> (Vec<u8>, Vec<[u32; 3]>) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        let rig = Arc::new(faces::template_rig());
        let bytes = rig.to_bytes().unwrap();
        let mut simulation = Simulation::new(Arc::clone(&rig), Scene::default(), None).unwrap();
        let pose = faces::pose(&rig, &[("jawOpen", 0.7), ("mouthSmileLeft", 0.9)]);
        for _ in 0..5 {
            simulation.advance_to(pose.clone(), 1.0 / 30.0).unwrap();
        }
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
