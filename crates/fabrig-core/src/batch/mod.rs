//! Many faces times many takes.
//!
//! A [`Manifest`] says what there is and what is wanted of it; a [`Plan`] turns it into jobs, each
//! with a key over everything that its result depends on; [`run`] does those whose result is
//! missing or has another key, as many at a time as there are workers; a [`BatchReport`] says what
//! came of it. A result counts once its record stands in the folder `.fabrig` of the output
//! folder, which is written after it: whatever kills a run, the next one goes on from there.
//!
//! Jobs are [`Job`]s that can be written down and done by another process ([`Worker`]); each is
//! the same call as `fabrig rig`, `animate` or `export` makes, and its bytes do not depend on who
//! does it.
//!
//! ```no_run
//! use std::{ops::ControlFlow::Continue, path::Path};
//! use fabrig_core::batch::{Manifest, Plan, PlanOptions, RunOptions, run};
//!
//! # fn main() -> Result<(), fabrig_core::batch::BatchError> {
//! let manifest = Manifest::read("work.toml")?;
//! let plan = Plan::new(manifest, Path::new("out"), &PlanOptions::default())?;
//! let report = run(&plan, &RunOptions::default(), &mut |_| Continue(()))?;
//! assert!(report.is_complete);
//! # Ok(())
//! # }
//! ```

mod bench;
mod dataset;
mod entry;
mod error;
mod estimate;
mod failure;
mod hash;
mod job;
mod keys;
mod manifest;
mod pattern;
mod plan;
mod planner;
mod record;
mod report;
mod resolve;
mod run;
mod table;
#[cfg(test)]
mod tests;
mod worker;

pub use bench::{BenchWork, write_bench_work};
pub use dataset::{PairReport, SCHEMA};
pub use entry::{
    Alpha, Content, FaceEntry, Offsets, Order, OutputEntry, PairEntry, SceneEntry, Seam, TakeEntry,
    Unit,
};
pub use error::BatchError;
pub use failure::{Failure, FailureKind};
pub use job::{Ending, Job, Outcome, Stage, Task};
pub use manifest::{Manifest, Pair};
pub use plan::{Plan, PlanOptions, PlannedJob, Standing};
pub use record::JobRecord;
pub use report::{
    AccuracyRow, BatchReport, Counts, DATASET_LIST, FaceRow, FailureRow, PairRow, RunFacts,
    StageRow,
};
pub use run::{Hold, RunOptions, RunProgress, run, run_single};
pub use worker::Worker;
