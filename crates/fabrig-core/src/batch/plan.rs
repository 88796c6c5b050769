//! From a manifest to jobs: what each depends on, and which of them are done already.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::BatchError;
use super::entry::{SceneEntry, TakeEntry};
use super::failure::Failure;
use super::job::Job;
use super::manifest::Manifest;
use super::pattern::{STATE_FOLDER, is_wild, matches};
use super::planner::{Planned, Planner};
use super::record::JobRecord;
use super::worker::{read_scene, read_take};
use crate::facs::nearest_name;

/// Where a job stands before the run.
#[derive(Debug, Clone, PartialEq)]
pub enum Standing {
    /// The result is there, and nothing that it depends on has changed.
    UpToDate(JobRecord),
    /// There is no result.
    Missing,
    /// There is one, of something else.
    Changed,
    /// It cannot be done.
    Lost(Failure),
}

/// A job with its place among the others.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedJob {
    /// What to do.
    pub job: Job,
    /// Where it stands.
    pub standing: Standing,
    /// Indices of the jobs that come before it.
    pub needs: Vec<usize>,
    /// What the time it takes goes with: length of its take, or 1. (s)
    pub size: f64,
}

impl PlannedJob {
    /// Whether it is to be run.
    pub fn is_to_run(&self) -> bool {
        matches!(self.standing, Standing::Missing | Standing::Changed)
    }
}

/// What is asked of a plan.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PlanOptions {
    /// Outputs to make, with wildcards; all when empty. What they need is made too.
    pub only: Vec<String>,
    /// Read all results to see whether they are as they were made, instead of trusting their
    /// size.
    pub verify: bool,
}

/// All jobs of a manifest, each after those that it needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The output folder.
    pub out: PathBuf,
    /// The work.
    pub manifest: Manifest,
    /// The jobs.
    pub jobs: Vec<PlannedJob>,
    /// Edits beside rigs that an earlier manifest put there and this one does not: outputs.
    pub(super) stale: Vec<String>,
}

impl Plan {
    /// Looks at every input and result; writes nothing.
    ///
    /// What is wrong with a single input is in the standing of its jobs, not an error.
    ///
    /// # Errors
    ///
    /// [`BatchError::SameOutput`], [`BatchError::NoSuchOutput`].
    pub fn new(manifest: Manifest, out: &Path, options: &PlanOptions) -> Result<Self, BatchError> {
        let out = std::path::absolute(out).map_err(|source| BatchError::Read {
            path: out.to_owned(),
            source,
        })?;
        let mut planner = Planner::new(&manifest, &out);
        for pair in &manifest.pairs {
            planner.outputs_of_pair(pair)?;
        }
        let Planned { mut jobs, stale } = planner.finish()?;
        if !options.only.is_empty() {
            jobs = only(jobs, &options.only)?;
        }
        let standings: Vec<Standing> = jobs
            .par_iter()
            .map(|planned| standing(planned, &out, options.verify))
            .collect();
        for (planned, standing) in jobs.iter_mut().zip(standings) {
            planned.standing = standing;
        }
        let mut plan = Self {
            out,
            manifest,
            jobs,
            stale,
        };
        plan.try_takes_and_scenes();
        plan.pass_on_losses();
        Ok(plan)
    }

    /// The job with this output.
    ///
    /// # Errors
    ///
    /// [`BatchError::NoSuchOutput`]; [`BatchError::NotReady`] where what it needs is not done.
    pub fn single(&self, output: &str) -> Result<&PlannedJob, BatchError> {
        let planned = self
            .jobs
            .iter()
            .find(|planned| planned.job.output == output);
        let Some(planned) = planned else {
            let names = self.jobs.iter().map(|planned| planned.job.output.as_str());
            return Err(no_such(output, names));
        };
        let needs = planned.needs.iter().map(|&need| &self.jobs[need]);
        match needs.into_iter().find(|need| need.is_to_run()) {
            Some(need) => Err(BatchError::NotReady {
                output: output.to_owned(),
                needs: need.job.output.clone(),
            }),
            None => Ok(planned),
        }
    }

    /// Reads the takes and scenes of jobs that are to run: what is wrong with one is known before
    /// anything is simulated, and how long a take is.
    fn try_takes_and_scenes(&mut self) {
        let mut takes: BTreeMap<String, TakeEntry> = BTreeMap::new();
        let mut scenes: BTreeMap<String, SceneEntry> = BTreeMap::new();
        for planned in self.jobs.iter().filter(|planned| planned.is_to_run()) {
            let task = &planned.job.task;
            let take = task.take.iter();
            takes.extend(take.map(|take| (take.name.clone(), take.clone())));
            let scene = task.scene.iter();
            scenes.extend(scene.map(|scene| (scene.name.clone(), scene.clone())));
        }
        let takes: HashMap<String, Result<f64, Failure>> = takes
            .into_par_iter()
            .map(|(name, take)| (name, read_take(&take).map(|clip| clip.duration())))
            .collect();
        let scenes: HashMap<String, Result<(), Failure>> = scenes
            .into_par_iter()
            .map(|(name, scene)| (name, read_scene(&scene).map(|_| ())))
            .collect();
        for planned in self.jobs.iter_mut().filter(|planned| planned.is_to_run()) {
            let task = &planned.job.task;
            let scene = task
                .scene
                .as_ref()
                .and_then(|scene| scenes.get(&scene.name));
            if let Some(Err(failure)) = scene {
                planned.standing = Standing::Lost(failure.clone());
            }
            match task.take.as_ref().and_then(|take| takes.get(&take.name)) {
                Some(Ok(duration)) => planned.size = duration.max(0.01),
                Some(Err(failure)) => planned.standing = Standing::Lost(failure.clone()),
                None => {}
            }
        }
    }

    /// What needs something that cannot be had cannot be had either.
    fn pass_on_losses(&mut self) {
        for index in 0..self.jobs.len() {
            let lost =
                self.jobs[index]
                    .needs
                    .iter()
                    .find_map(|&need| match &self.jobs[need].standing {
                        Standing::Lost(failure) => Some(failure.clone()),
                        _ => None,
                    });
            if let (Some(failure), true) = (lost, self.jobs[index].is_to_run()) {
                self.jobs[index].standing = Standing::Lost(failure);
            }
        }
    }
}

fn standing(planned: &PlannedJob, out: &Path, verify: bool) -> Standing {
    if let Standing::Lost(_) = planned.standing {
        return planned.standing.clone();
    }
    let output = &planned.job.output;
    match JobRecord::load(out, output) {
        Some(record) if record.key != planned.job.key => Standing::Changed,
        Some(record) if record.holds(out, output, verify) => Standing::UpToDate(record),
        Some(_) if out.join(output).exists() => Standing::Changed,
        _ => Standing::Missing,
    }
}

fn no_such<'a>(asked: &str, outputs: impl Iterator<Item = &'a str>) -> BatchError {
    BatchError::NoSuchOutput {
        pattern: asked.to_owned(),
        nearest: nearest_name(asked, outputs).unwrap_or_default().to_owned(),
    }
}

/// The jobs whose outputs the patterns fit, with all that they need.
fn only(jobs: Vec<PlannedJob>, patterns: &[String]) -> Result<Vec<PlannedJob>, BatchError> {
    let mut is_kept = vec![false; jobs.len()];
    for asked in patterns {
        let mut is_found = false;
        for (kept, planned) in is_kept.iter_mut().zip(&jobs) {
            let output = &planned.job.output;
            if output == asked || is_wild(asked) && matches(asked, output) {
                (*kept, is_found) = (true, true);
            }
        }
        if !is_found {
            return Err(no_such(asked, jobs.iter().map(|p| p.job.output.as_str())));
        }
    }
    for index in (0..jobs.len()).rev() {
        if is_kept[index] {
            jobs[index]
                .needs
                .iter()
                .for_each(|&need| is_kept[need] = true);
        }
    }
    let mut place = vec![0; jobs.len()];
    let mut kept = Vec::new();
    for (index, mut planned) in jobs.into_iter().enumerate() {
        if is_kept[index] {
            place[index] = kept.len();
            planned
                .needs
                .iter_mut()
                .for_each(|need| *need = place[*need]);
            kept.push(planned);
        }
    }
    Ok(kept)
}

/// Where a batch keeps its own state.
pub(super) fn state_folder(out: &Path) -> PathBuf {
    out.join(STATE_FOLDER)
}
