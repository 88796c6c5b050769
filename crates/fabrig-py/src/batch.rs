//! Batches: plans and single jobs, for `fabrig.batch` to run here or on a cluster.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use fabrig_core::batch::{
    Hold, Job, Manifest, Outcome, Plan, PlanOptions, RunFacts, RunOptions, Standing, Worker, run,
};
use pyo3::prelude::*;
use serde_json::json;

use crate::arrays;
use crate::errors::{input, to_py};
use crate::progress::{Progress, interruptible, interruptible_with};

/// The jobs of a manifest.
#[pyclass(name = "_BatchPlan", module = "fabrig._fabrig", frozen)]
pub(crate) struct PyBatchPlan {
    plan: Arc<Plan>,
    hold: Mutex<Option<Hold>>,
}

#[pymethods]
impl PyBatchPlan {
    #[new]
    fn new(
        py: Python<'_>,
        manifest: PathBuf,
        out: PathBuf,
        only: Vec<String>,
        verify: bool,
    ) -> PyResult<Self> {
        let plan = interruptible(py, move || {
            let manifest = Manifest::read(manifest)?;
            Plan::new(manifest, &out, &PlanOptions { only, verify })
        })?;
        Ok(Self {
            plan: Arc::new(plan.map_err(to_py)?),
            hold: Mutex::new(None),
        })
    }

    /// Output, stage, needs, standing, text of each job; outcome of those that are not to run.
    fn jobs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.plan.jobs.iter().map(|planned| {
            let (standing, ending) = match &planned.standing {
                Standing::UpToDate(record) => ("up_to_date", json!({ "up_to_date": record })),
                Standing::Lost(failure) => ("lost", json!({ "lost": failure })),
                Standing::Missing => ("missing", json!(null)),
                Standing::Changed => ("changed", json!(null)),
            };
            let output = &planned.job.output;
            json!({
                "output": output,
                "stage": planned.job.stage,
                "needs": planned.job.needs,
                "standing": standing,
                "is_to_run": planned.is_to_run(),
                "size": planned.size,
                "text": planned.job.to_text(),
                "outcome": { "output": output, "ending": ending, "seconds": 0.0 },
            })
        });
        arrays::to_python(py, &rows.collect::<Vec<_>>())
    }

    /// Takes the output folder; returns why nothing can be written there, if so.
    fn hold<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let hold = self.plan.hold().map_err(to_py)?;
        let failure = hold.failure().cloned();
        *self.hold.lock().unwrap_or_else(PoisonError::into_inner) = Some(hold);
        arrays::to_python(py, &failure)
    }

    /// Gives the output folder back.
    fn release(&self) {
        *self.hold.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Runs everything here; returns the report.
    fn run<'py>(
        &self,
        py: Python<'py>,
        workers: usize,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let plan = Arc::clone(&self.plan);
        let options = RunOptions { workers, threads };
        let mut progress = Progress::new(py, progress)?;
        // Not thrown away when it is interrupted: a run that is told to stop leaves whole results.
        let report = py.detach(|| {
            run(&plan, &options, &mut |now| {
                let begun: f64 = now.running.iter().map(|(_, share)| share).sum();
                let share = (now.ended as f64 + begun) / now.total.max(1) as f64;
                progress.report("batch", share)
            })
        });
        progress.finish()?;
        arrays::to_python(py, &report.map_err(to_py)?)
    }

    /// The report of outcomes, as text, that somebody else came to.
    fn report<'py>(
        &self,
        py: Python<'py>,
        outcomes: Vec<String>,
        engine: String,
        workers: usize,
        threads: usize,
        wall_secs: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let outcomes: Result<Vec<Outcome>, _> = outcomes
            .iter()
            .map(|text| serde_json::from_str(text))
            .collect();
        let outcomes = outcomes.map_err(|e| input(format!("outcomes: {e}")))?;
        let facts = RunFacts {
            engine,
            workers,
            threads,
            wall_secs,
            peak_memory_bytes: None,
        };
        let report = fabrig_core::batch::BatchReport::new(&self.plan, outcomes, facts);
        arrays::to_python(py, &report)
    }
}

/// Does one job, given as text, in an output folder; returns its outcome.
#[pyfunction]
#[pyo3(name = "_batch_job", signature = (text, out, threads, progress))]
pub(crate) fn batch_job<'py>(
    py: Python<'py>,
    text: &str,
    out: PathBuf,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let job = Job::from_text(text).map_err(to_py)?;
    let progress = Progress::new(py, progress)?;
    let outcome = interruptible_with(py, progress, move |progress| {
        let mut worker = Worker::new(&out, threads)?;
        Ok::<_, fabrig_core::batch::BatchError>(worker.run(&job, &mut |share| -> ControlFlow<()> {
            progress.report("job", share)
        }))
    })?;
    arrays::to_python(py, &outcome.map_err(to_py)?)
}
