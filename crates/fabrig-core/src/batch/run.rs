//! A batch on this machine: workers take jobs whose needs are done, one after the other.
//!
//! Pairs run beside each other with one thread each, which wastes less than many threads in one
//! pair do; so memory is that of as many jobs as there are workers.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::ops::ControlFlow;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::BatchError;
use super::estimate::{Progressing, remaining_secs};
use super::failure::{Failure, FailureKind};
use super::job::{Ending, Outcome};
use super::plan::{Plan, Standing, state_folder};
use super::record::{forget, remove, sweep};
use super::report::{BatchReport, RunFacts};
use super::worker::Worker;
use crate::registration::bench::peak_memory_bytes;

/// How a batch is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunOptions {
    /// Jobs at a time; as many as there are processors for 0.
    pub workers: usize,
    /// Threads of each. Results do not depend on it.
    pub threads: usize,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            workers: 0,
            threads: 1,
        }
    }
}

/// How far a run has come.
#[derive(Debug, Clone, PartialEq)]
pub struct RunProgress {
    /// Jobs that have ended, of those that were to run.
    pub ended: usize,
    /// Jobs that were to run.
    pub total: usize,
    /// Those of them that have no result.
    pub without_result: usize,
    /// What is being made, and how much of it is (0 to 1).
    pub running: Vec<(String, f64)>,
    /// Time since the start. (s)
    pub elapsed_secs: f64,
    /// Time that the rest will take; `None` until one job of each kind that is left has said how
    /// long it takes. (s)
    pub remaining_secs: Option<f64>,
}

/// The output folder of a plan, held for one run.
#[derive(Debug)]
pub struct Hold {
    /// Unlocked when it is closed, also by the death of the process.
    _lock: Option<File>,
    /// Why nothing can be written there.
    pub(super) failure: Option<Failure>,
}

impl Hold {
    /// Why nothing can be written to the output folder, if so: then every job is lost.
    pub fn failure(&self) -> Option<&Failure> {
        self.failure.as_ref()
    }
}

impl Plan {
    /// Takes the output folder for a run, and takes away what killed runs left half written. A plan
    /// with nothing to run touches nothing.
    ///
    /// # Errors
    ///
    /// [`BatchError::Busy`].
    pub fn hold(&self) -> Result<Hold, BatchError> {
        let outputs: Vec<&str> = self
            .jobs
            .iter()
            .filter(|planned| planned.is_to_run())
            .map(|planned| planned.job.output.as_str())
            .collect();
        if outputs.is_empty() && self.stale.is_empty() {
            return Ok(Hold {
                _lock: None,
                failure: None,
            });
        }
        let state = state_folder(&self.out);
        let path = state.join("lock");
        let opened = std::fs::create_dir_all(&state).and_then(|()| File::create(&path));
        let lock = match opened {
            Ok(lock) => lock,
            Err(error) => {
                let mut failure = Failure::of_io(&path, &self.out.display().to_string(), &error);
                failure.kind = FailureKind::Disk;
                return Ok(Hold {
                    _lock: None,
                    failure: Some(failure),
                });
            }
        };
        // Some shared folders know no locks; then nobody can be told from another.
        if let Err(TryLockError::WouldBlock) = lock.try_lock() {
            return Err(BatchError::Busy {
                path: self.out.clone(),
            });
        }
        self.put_away_stale();
        sweep(&self.out, &outputs);
        Ok(Hold {
            _lock: Some(lock),
            failure: None,
        })
    }

    /// Edits that the manifest no longer has must not be applied to its rigs.
    pub(super) fn put_away_stale(&self) {
        for output in &self.stale {
            remove(&self.out.join(output));
            // What is left shows as a changed key the next time.
            let _ = forget(&self.out, output);
        }
    }
}

/// Who does what.
struct Board<'a> {
    plan: &'a Plan,
    /// For each job how many of its needs are not done.
    waiting: Vec<usize>,
    /// For each job who needs it.
    dependents: Vec<Vec<usize>>,
    ready: BTreeSet<usize>,
    /// For each worker its job, how much of it is done, and since when.
    slots: Vec<Option<(usize, f64, Instant)>>,
    endings: Vec<Option<Outcome>>,
    is_stopped: bool,
}

impl<'a> Board<'a> {
    fn new(plan: &'a Plan, workers: usize) -> Self {
        let count = plan.jobs.len();
        let mut board = Self {
            plan,
            waiting: vec![0; count],
            dependents: vec![Vec::new(); count],
            ready: BTreeSet::new(),
            slots: vec![None; workers],
            endings: vec![None; count],
            is_stopped: false,
        };
        for (index, planned) in plan.jobs.iter().enumerate() {
            let ending = match &planned.standing {
                Standing::UpToDate(record) => Some(Ending::UpToDate(record.clone())),
                Standing::Lost(failure) => Some(Ending::Lost(failure.clone())),
                Standing::Missing | Standing::Changed => None,
            };
            if let Some(ending) = ending {
                board.put(index, ending, 0.0);
                continue;
            }
            for &need in &planned.needs {
                if plan.jobs[need].is_to_run() {
                    board.waiting[index] += 1;
                    board.dependents[need].push(index);
                }
            }
            if board.waiting[index] == 0 {
                board.ready.insert(index);
            }
        }
        board
    }

    fn put(&mut self, index: usize, ending: Ending, seconds: f64) {
        self.endings[index] = Some(Outcome {
            output: self.plan.jobs[index].job.output.clone(),
            ending,
            seconds,
        });
    }

    /// Takes down how a job ended, and what follows from it.
    fn end(&mut self, index: usize, outcome: Outcome) {
        if let Ending::Failed(failure) = &outcome.ending {
            let failure = failure.clone();
            if failure.kind == FailureKind::Disk {
                self.lose_all(&failure);
            }
            self.lose_dependents(index, &failure);
        }
        if let Ending::Done(_) = outcome.ending {
            for dependent in std::mem::take(&mut self.dependents[index]) {
                self.waiting[dependent] -= 1;
                if self.waiting[dependent] == 0 && self.endings[dependent].is_none() {
                    self.ready.insert(dependent);
                }
            }
        }
        self.endings[index] = Some(outcome);
    }

    fn lose_dependents(&mut self, index: usize, failure: &Failure) {
        for dependent in std::mem::take(&mut self.dependents[index]) {
            self.put(dependent, Ending::Lost(failure.clone()), 0.0);
            self.lose_dependents(dependent, failure);
        }
    }

    /// Nothing that is not begun will be.
    fn lose_all(&mut self, failure: &Failure) {
        self.ready.clear();
        let begun: Vec<usize> = self.slots.iter().flatten().map(|slot| slot.0).collect();
        for index in 0..self.endings.len() {
            if self.endings[index].is_none() && !begun.contains(&index) {
                self.put(index, Ending::Lost(failure.clone()), 0.0);
            }
        }
    }

    fn is_over(&self) -> bool {
        let is_idle = self.slots.iter().all(Option::is_none);
        is_idle && (self.is_stopped || self.ready.is_empty())
    }

    fn progress(&self, start: Instant) -> RunProgress {
        let to_run = self.plan.jobs.iter().enumerate();
        let to_run: Vec<usize> = to_run
            .filter(|(_, planned)| planned.is_to_run())
            .map(|(index, _)| index)
            .collect();
        let ended = to_run.iter().filter_map(|&i| self.endings[i].as_ref());
        let (mut count, mut without_result) = (0, 0);
        for outcome in ended {
            count += 1;
            without_result += usize::from(!matches!(outcome.ending, Ending::Done(_)));
        }
        let running = self.slots.iter().flatten();
        let jobs = to_run.iter().map(|&index| {
            let planned = &self.plan.jobs[index];
            let slot = self.slots.iter().flatten().find(|slot| slot.0 == index);
            let (done, seconds) = match (&self.endings[index], slot) {
                (Some(outcome), _) => (1.0, outcome.seconds),
                (None, Some(slot)) => (slot.1, slot.2.elapsed().as_secs_f64()),
                (None, None) => (0.0, 0.0),
            };
            Progressing {
                stage: planned.job.stage,
                size: planned.size,
                done,
                seconds,
            }
        });
        RunProgress {
            ended: count,
            total: to_run.len(),
            without_result,
            remaining_secs: remaining_secs(jobs, self.slots.len()),
            running: running
                .map(|slot| (self.plan.jobs[slot.0].job.output.clone(), slot.1))
                .collect(),
            elapsed_secs: start.elapsed().as_secs_f64(),
        }
    }
}

/// What all threads share.
struct Shared<'a> {
    board: Mutex<Board<'a>>,
    changed: Condvar,
}

impl<'a> Shared<'a> {
    fn lock(&self) -> MutexGuard<'_, Board<'a>> {
        // Nobody panics while he holds it; the board is whole in any case.
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self, slot: usize, worker: &mut Worker) {
        let plan = self.lock().plan;
        loop {
            let mut board = self.lock();
            let index = loop {
                if board.is_stopped || board.is_over() {
                    drop(board);
                    self.changed.notify_all();
                    return;
                }
                if let Some(index) = board.ready.pop_first() {
                    break index;
                }
                board = self
                    .changed
                    .wait(board)
                    .unwrap_or_else(PoisonError::into_inner);
            };
            board.slots[slot] = Some((index, 0.0, Instant::now()));
            drop(board);
            let outcome = worker.run(&plan.jobs[index].job, &mut |fraction| {
                let mut board = self.lock();
                if let Some(slot) = &mut board.slots[slot] {
                    slot.1 = fraction;
                }
                if board.is_stopped {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            let mut board = self.lock();
            board.slots[slot] = None;
            board.end(index, outcome);
            drop(board);
            self.changed.notify_all();
        }
    }
}

/// How often a run says how far it is.
const PERIOD: Duration = Duration::from_millis(200);

/// Runs what is not up to date.
///
/// - `progress`: called about five times a second; `ControlFlow::Break` stops the run, which
///   then leaves whole results and nothing else, so that it goes on from there
///
/// What goes wrong with jobs is in the report.
///
/// # Errors
///
/// [`BatchError::Busy`], [`BatchError::Threads`].
pub fn run(
    plan: &Plan,
    options: &RunOptions,
    progress: &mut dyn FnMut(&RunProgress) -> ControlFlow<()>,
) -> Result<BatchReport, BatchError> {
    let start = Instant::now();
    let hold = plan.hold()?;
    let count = match options.workers {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        count => count,
    };
    let mut board = Board::new(plan, count);
    if let Some(failure) = &hold.failure {
        board.lose_all(failure);
    }
    let shared = Shared {
        board: Mutex::new(board),
        changed: Condvar::new(),
    };
    let mut workers = Vec::new();
    for _ in 0..count {
        workers.push(Worker::new(&plan.out, options.threads)?);
    }
    std::thread::scope(|scope| {
        for (slot, worker) in workers.iter_mut().enumerate() {
            let shared = &shared;
            scope.spawn(move || shared.work(slot, worker));
        }
        loop {
            let board = shared.lock();
            let is_over = board.is_over();
            let now = board.progress(start);
            drop(board);
            if progress(&now).is_break() {
                shared.lock().is_stopped = true;
            }
            if is_over {
                shared.changed.notify_all();
                return;
            }
            let board = shared.lock();
            let waited = shared.changed.wait_timeout(board, PERIOD);
            drop(waited.unwrap_or_else(PoisonError::into_inner));
        }
    });
    let endings = shared
        .board
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner)
        .endings;
    let facts = RunFacts {
        engine: "local".to_owned(),
        workers: count,
        threads: options.threads,
        wall_secs: start.elapsed().as_secs_f64(),
        peak_memory_bytes: peak_memory_bytes(),
    };
    Ok(BatchReport::new(
        plan,
        endings.into_iter().flatten().collect(),
        facts,
    ))
}

/// Does the one job with this output, whose needs must be done.
///
/// # Errors
///
/// As [`Plan::single`], and [`BatchError::Threads`].
pub fn run_single(
    plan: &Plan,
    output: &str,
    threads: usize,
    progress: &mut (dyn FnMut(f64) -> ControlFlow<()> + Send),
) -> Result<Outcome, BatchError> {
    let planned = plan.single(output)?;
    let ending = match &planned.standing {
        Standing::UpToDate(record) => Ending::UpToDate(record.clone()),
        Standing::Lost(failure) => Ending::Lost(failure.clone()),
        Standing::Missing | Standing::Changed => {
            plan.put_away_stale();
            return Ok(Worker::new(&plan.out, threads)?.run(&planned.job, progress));
        }
    };
    Ok(Outcome {
        output: output.to_owned(),
        ending,
        seconds: 0.0,
    })
}
