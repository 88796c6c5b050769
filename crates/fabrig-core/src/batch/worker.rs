//! A worker: does jobs, each by the same call that `fabrig rig`, `animate` or `export` makes.

use std::any::Any;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use rayon::ThreadPool;
use serde::Serialize;
use serde_json::Value;

use super::entry::{SceneEntry, TakeEntry, Unit};
use super::failure::{Failure, FailureKind};
use super::hash::measure;
use super::job::{Ending, Job, Outcome, Stage};
use super::record::{JobRecord, OnFraction, forget, partial_of, remove};
use super::{BatchError, dataset};
use crate::Error;
use crate::edit::{Edits, edits_path, load_edited_rig};
use crate::export::{ExportError, ExportOptions, ShapeSource, export};
use crate::mesh::io::read_mesh;
use crate::motion::{self, Clip};
use crate::pipeline::{AnimateOptions, RigFaceOptions, animate, read_own_shapes, rig_face};
use crate::registration::{RegistrationError, read_landmarks};
use crate::rig::Rig;
use crate::scene::{Dynamics, Scene, SceneError};
use crate::template::{Template, human};

/// Why a job has no result.
enum Break {
    Failed(Failure),
    Stopped,
}

impl From<Failure> for Break {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

/// What a stage has to say: simulated time (s) and its report.
type Figures = (f64, Value);

/// Does jobs one after the other, on threads of its own.
pub struct Worker {
    out: PathBuf,
    pool: ThreadPool,
    /// The rig used last: pairs of one face follow each other.
    rig: Option<(String, Arc<Rig>)>,
}

impl Worker {
    /// - `out`: the output folder
    /// - `threads`: of this worker; results do not depend on it
    ///
    /// # Errors
    ///
    /// [`BatchError::Threads`].
    pub fn new(out: &Path, threads: usize) -> Result<Self, BatchError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1));
        Ok(Self {
            out: out.to_owned(),
            pool: pool.build().map_err(|e| BatchError::Threads {
                reason: e.to_string(),
            })?,
            rig: None,
        })
    }

    /// Does a job: its result, then its record.
    ///
    /// - `progress`: gets the share done, 0 to 1; `ControlFlow::Break` stops the job
    pub fn run(
        &mut self,
        job: &Job,
        progress: &mut (dyn FnMut(f64) -> ControlFlow<()> + Send),
    ) -> Outcome {
        let clock = Instant::now();
        let Self { out, pool, rig } = self;
        let mut at_work = AtWork { out, rig, job };
        let ending = pool.install(|| {
            // A face that breaks the program must not take the others with it.
            catch_unwind(AssertUnwindSafe(|| at_work.run(progress)))
        });
        let seconds = clock.elapsed().as_secs_f64();
        let ending = match ending {
            Ok(Ok(record)) => Ending::Done(JobRecord { seconds, ..record }),
            Ok(Err(Break::Stopped)) => Ending::Stopped,
            Ok(Err(Break::Failed(failure))) => Ending::Failed(failure),
            Err(panic) => {
                // Nothing that the job was at is trusted any more.
                self.rig = None;
                Ending::Failed(Failure::new(
                    FailureKind::Crash,
                    &job.output,
                    format!("fabrig failed: {}", text_of(&*panic)),
                ))
            }
        };
        let ending = match ending {
            Ending::Done(record) => match record.save(&self.out, job) {
                Ok(()) => Ending::Done(record),
                Err(error) => Ending::Failed(Failure::of_io(
                    &self.out.join(&job.output),
                    &job.output,
                    &error,
                )),
            },
            other => {
                remove(&partial_of(&self.out.join(&job.output)));
                other
            }
        };
        Outcome {
            output: job.output.clone(),
            ending,
            seconds,
        }
    }
}

fn text_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().cloned();
    text.or_else(|| panic.downcast_ref::<&str>().map(|&s| s.to_owned()))
        .unwrap_or_else(|| "without a word".to_owned())
}

struct AtWork<'a> {
    out: &'a Path,
    rig: &'a mut Option<(String, Arc<Rig>)>,
    job: &'a Job,
}

impl AtWork<'_> {
    fn run(&mut self, progress: OnFraction<'_>) -> Result<JobRecord, Break> {
        let path = self.out.join(&self.job.output);
        let written = |error: std::io::Error| Failure::of_io(&path, &self.job.output, &error);
        forget(self.out, &self.job.output).map_err(written)?;
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(written)?;
        }
        let (simulated_secs, figures) = match self.job.stage {
            Stage::Rig => self.make_rig(&path, progress)?,
            Stage::Edits => self.put_edits(&path)?,
            Stage::Record => self.record(&path, progress)?,
            Stage::Export => self.export(&path, progress)?,
            Stage::Dataset => self.dataset(&path, progress)?,
            Stage::Topology => {
                let rig = self.load_rig()?;
                let face = &self.job.task.face.name;
                dataset::write_topology(&path, &rig, face).map_err(written)?;
                (0.0, Value::Null)
            }
        };
        let (sha256, bytes) = measure(&path).map_err(written)?;
        Ok(JobRecord {
            key: self.job.key.clone(),
            bytes,
            sha256,
            seconds: 0.0,
            simulated_secs,
            figures,
        })
    }

    fn make_rig(&self, path: &Path, progress: OnFraction<'_>) -> Result<Figures, Break> {
        let face = &self.job.task.face;
        let of_face = |error: Error| Failure::of(FailureKind::Face, &face.name, &error);
        let mut options = RigFaceOptions {
            source: Some(face.file.clone()),
            ..RigFaceOptions::default()
        };
        options.registration.unit_mm = face.unit.map(Unit::millimetres);
        if let Some(landmarks) = &face.landmarks {
            let order = face.landmarks_order.map(Into::into);
            let found = read_landmarks(landmarks, order);
            options.registration.landmarks = found.map_err(|e| of_face(e.into()))?;
        }
        options.cut_seams = face.seams();
        if let Some(offsets) = face.offsets {
            options.rig.offsets = offsets.into();
        }
        if let Some(alpha) = face.alpha {
            options.rig.alpha = alpha.into();
        }
        let mesh = read_mesh(&face.file).map_err(|e| of_face(e.into()))?;
        let own;
        let template = match &face.template {
            Some(folder) => {
                own = Template::load(folder).map_err(|e| of_face(e.into()))?;
                &own
            }
            None => human(),
        };
        if let Some(shapes) = &face.shapes {
            let found = read_own_shapes(shapes, &mesh, template).map_err(|e| of_face(e.into()))?;
            options.expressions = found.expressions;
            options.expressions_on = found.neutral;
        }
        let rigged = rig_face(&mesh, template, &options, &mut |step| {
            progress(step.fraction)
        });
        let rigged = match rigged {
            Err(Error::Registration(RegistrationError::Cancelled { .. })) => {
                return Err(Break::Stopped);
            }
            rigged => rigged.map_err(of_face)?,
        };
        rigged.rig.save(path).map_err(|e| self.not_written(&e))?;
        Ok((0.0, value(&rigged.report)))
    }

    /// Edits are tried before they go beside the rig: what is wrong with them is said once.
    fn put_edits(&self, path: &Path) -> Result<Figures, Break> {
        let face = &self.job.task.face;
        let of_edits = |error: Error| Failure::of(FailureKind::Edits, &face.name, &error);
        let from = face.edits.clone().unwrap_or_default();
        let edits = Edits::load(&from).map_err(|e| of_edits(e.into()))?;
        let mut rig = Rig::load(self.rig_path()).map_err(|e| of_edits(e.into()))?;
        edits.apply(&mut rig).map_err(|e| of_edits(e.into()))?;
        edits.save(path).map_err(|e| self.not_written(&e))?;
        Ok((0.0, Value::Null))
    }

    fn record(&mut self, path: &Path, progress: OnFraction<'_>) -> Result<Figures, Break> {
        let rig = self.load_rig()?;
        let (clip, scene) = (self.take()?, self.scene()?);
        let task = &self.job.task;
        let output = task.output.clone().unwrap_or_default();
        let options = AnimateOptions {
            fps: scene.fps,
            rig_name: task.face.name.clone(),
            take_name: self.take_name(),
            recording: output.recording(&scene.recording),
        };
        let report = animate(rig, clip, scene, path, &options, &mut |now| {
            progress(now.frame as f64 / now.frame_count as f64)
        });
        let report = report.map_err(|error| match error {
            Error::Recording(error) => self.not_written(&error),
            error => self.not_simulated(&error),
        })?;
        if !report.is_complete {
            // Whole, but not what was asked for.
            remove(path);
            return Err(Break::Stopped);
        }
        Ok((report.recording.duration_secs, value(&report)))
    }

    fn export(&mut self, path: &Path, progress: OnFraction<'_>) -> Result<Figures, Break> {
        let rig = self.load_rig()?;
        let task = &self.job.task;
        let output = task.output.clone().unwrap_or_default();
        let (usual, scene) = (ExportOptions::default(), self.scene()?);
        let options = ExportOptions {
            name: task.face.name.clone(),
            unit: output.unit.map(Into::into),
            shapes: if output.without_dynamics {
                ShapeSource::Targets
            } else {
                ShapeSource::Settled
            },
            motion: match task.take {
                Some(_) => Some(self.take()?),
                None => None,
            },
            motion_name: self.take_name(),
            baked: output.baked,
            fps: scene.fps,
            still_head: output.still_head,
            basis_tolerance: output.tolerance.unwrap_or(usual.basis_tolerance),
            scene,
            check_sum: output.check,
            ..usual
        };
        // A folder is replaced whole, or files of another run would stay in it.
        if path.is_dir() {
            remove(path);
        }
        let report = export(&rig, path, &options, &mut |step| progress(step.fraction));
        let report = match report {
            Err(ExportError::Stopped) => return Err(Break::Stopped),
            Err(ExportError::Scene(error)) => return Err(self.not_simulated(&error).into()),
            report => report.map_err(|e| self.not_written(&e))?,
        };
        let simulated_secs = if report.linear.is_none() && report.shapes.is_empty() {
            report.seconds
        } else {
            0.0
        };
        Ok((simulated_secs, value(&report)))
    }

    fn dataset(&mut self, path: &Path, progress: OnFraction<'_>) -> Result<Figures, Break> {
        let rig = self.load_rig()?;
        let (clip, scene) = (self.take()?, self.scene()?);
        let task = &self.job.task;
        let names = dataset::Names {
            face: &task.face.name,
            take: &self.take_name(),
            scene: task.scene.as_ref().map_or("", |scene| &scene.name),
        };
        let report = dataset::write_pair(path, rig, clip, scene, names, progress);
        let report = match report {
            Err(dataset::PairError::Stopped) => return Err(Break::Stopped),
            Err(dataset::PairError::Scene(error)) => {
                return Err(self.not_simulated(&error).into());
            }
            Err(dataset::PairError::Io(error)) => {
                return Err(Failure::of_io(path, &self.job.output, &error).into());
            }
            Ok(report) => report,
        };
        Ok((report.seconds, value(&report)))
    }

    fn rig_path(&self) -> PathBuf {
        self.out.join(&self.job.task.rig)
    }

    fn load_rig(&mut self) -> Result<Arc<Rig>, Failure> {
        let key = &self.job.task.rig_key;
        if let Some((_, rig)) = self.rig.as_ref().filter(|(loaded, _)| loaded == key) {
            return Ok(Arc::clone(rig));
        }
        // The one before goes first: two rigs at once are never needed.
        *self.rig = None;
        let path = self.rig_path();
        let rig = load_edited_rig(&path).map_err(|error| {
            let (kind, culprit) = match error {
                Error::Edit(_) => (FailureKind::Edits, edits_path(&path)),
                _ => (FailureKind::Face, path.clone()),
            };
            let mut failure = Failure::of(kind, &self.job.task.face.name, &error);
            failure.message = format!("{}: {}", culprit.display(), failure.message);
            failure
        })?;
        let rig = Arc::new(rig);
        *self.rig = Some((key.clone(), Arc::clone(&rig)));
        Ok(rig)
    }

    fn take_name(&self) -> String {
        let take = self.job.task.take.as_ref();
        take.map_or_else(String::new, |take| take.name.clone())
    }

    fn take(&self) -> Result<Clip, Failure> {
        let entry = self.job.task.take.clone().unwrap_or_default();
        read_take(&entry)
    }

    fn scene(&self) -> Result<Scene, Failure> {
        let entry = self.job.task.scene.clone().unwrap_or_default();
        read_scene(&entry)
    }

    fn not_written(&self, error: &(dyn std::error::Error + 'static)) -> Failure {
        Failure::of(FailureKind::Output, &self.job.output, error)
    }

    fn not_simulated(&self, error: &(dyn std::error::Error + 'static)) -> Failure {
        let scene = self.job.task.scene.as_ref();
        Failure::of(
            FailureKind::Scene,
            scene.map_or("default", |scene| &scene.name),
            error,
        )
    }
}

/// Reads a take as its entry says.
pub(super) fn read_take(entry: &TakeEntry) -> Result<Clip, Failure> {
    let of_take = |error: motion::MotionError| Failure::of(FailureKind::Take, &entry.name, &error);
    let of_clip = |error: motion::ClipError| Failure::of(FailureKind::Take, &entry.name, &error);
    let mut clip = motion::read(&entry.file, &entry.read_options()).map_err(of_take)?;
    if entry.from.is_some() || entry.to.is_some() {
        let from = entry.from.unwrap_or(f64::NEG_INFINITY);
        let to = entry.to.unwrap_or(f64::INFINITY);
        clip = clip.cut(from, to).map_err(of_clip)?;
    }
    match entry.resample {
        Some(rate) => clip.resampled(rate).map_err(of_clip),
        None => Ok(clip),
    }
}

/// Reads a scene as its entry says.
pub(super) fn read_scene(entry: &SceneEntry) -> Result<Scene, Failure> {
    let mut scene = Scene::default();
    if entry.has_file() {
        let fail = |error: &(dyn std::error::Error + 'static)| {
            let mut failure = Failure::of(FailureKind::Scene, &entry.name, error);
            failure.message = format!("{}: {}", entry.file.display(), failure.message);
            failure
        };
        scene = Scene::load(&entry.file).map_err(|e| fail(&e))?;
        if !scene.faces.is_empty() {
            let count = scene.faces.len();
            return Err(fail(&SceneError::HasFaces { count }));
        }
    }
    scene.fps = entry.fps.or(scene.fps);
    if let Some(substeps) = entry.substeps {
        scene.cloth.substeps = substeps;
    }
    if entry.without_dynamics {
        scene.dynamics = Dynamics::None;
    }
    Ok(scene)
}

fn value(report: &impl Serialize) -> Value {
    // Reports are plain structs; a figure that is no number becomes null.
    serde_json::to_value(report).unwrap_or_default()
}
