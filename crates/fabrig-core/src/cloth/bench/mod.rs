//! Speed beside error: a face-sized scene, timed runs, and their difference to a reference.
//!
//! The scene has the sizes of the default face rig (41 grids of 21 x 20 and 3 rings of 48 x 15,
//! 19,380 nodes) and moves like one, but is made of domes and rings, so that it needs nothing
//! but the solver.

mod measure;
mod scene;

pub use measure::{Difference, Run, difference, run};
pub use scene::BenchScene;
