//! Registration against known truth: people in the template's topology, warped, remeshed, cut,
//! holed, noised, scaled and turned; registration sees the mesh alone, its result is compared
//! vertex by vertex. Surface distances cannot show sliding along the surface; this does.
//!
//! `specimen` makes the meshes and keeps their truth, `cases` lists them with what is expected,
//! `run` registers and judges. Time against size is measured in [`crate::pipeline::cost`].

mod cases;
mod run;
mod specimen;

pub use cases::{Bars, Case, Expectation, cases};
pub use run::{CaseResult, Found, Outcome, peak_memory_bytes, run_case};
pub use specimen::Specimen;
