//! Speed beside error of the cloth solver on a face-sized scene.
//!
//! `cargo run --release -p fabrig-core --example cloth_pareto`; set `RAYON_NUM_THREADS=1` for
//! one thread.
#![allow(clippy::print_stdout, reason = "printing is what this program does")]

use fabrig_core::cloth::bench::{BenchScene, difference, run};
use fabrig_core::cloth::{ClothOptions, Integrator, Precision};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = BenchScene::face();
    let frames = 30;
    let with = |substeps, integrator, precision| ClothOptions {
        substeps,
        integrator,
        precision,
        ..ClothOptions::default()
    };
    let reference = run(
        &scene,
        &with(192, Integrator::Bdf2, Precision::Double),
        frames,
        3,
    )?;
    let finer = run(
        &scene,
        &with(96, Integrator::Bdf2, Precision::Double),
        frames,
        3,
    )?;
    let own = difference(&scene, &finer, &reference);
    println!(
        "{} nodes, {} threads; reference: f64, 192 substeps; 96 differ by {:.1e}",
        scene.node_count(),
        rayon::current_num_threads(),
        own.relative
    );
    println!("integrator      substeps  median ms  p95 ms   RMS mm   max mm  relative  guards");
    for integrator in [Integrator::Bdf2, Integrator::BackwardEuler] {
        for substeps in [1, 2, 3, 4, 6, 8, 12, 16, 32] {
            let options = with(substeps, integrator, Precision::Single);
            let result = run(&scene, &options, frames, 3)?;
            let timed = run(&scene, &options, 120, 0)?;
            let d = difference(&scene, &result, &reference);
            println!(
                "{:14}  {substeps:8}  {:9.3}  {:6.3}  {:7.4}  {:7.4}  {:8.2e}  {}",
                format!("{integrator:?}"),
                timed.quantile_ms(0.5),
                timed.quantile_ms(0.95),
                d.rms,
                d.max,
                d.relative,
                timed.counters.clamped_displacements
                    + timed.counters.euler_fallbacks
                    + timed.counters.frozen_patches,
            );
        }
    }
    Ok(())
}
