//! The graph of jobs: a rig once a face, then its edits, then what is made of it with every take.
//! Each job's key is made of what it reads: contents of files, settings, and the keys of the jobs
//! before it, so what changes anywhere changes every key after it.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use rayon::prelude::*;

use super::BatchError;
use super::entry::{Content, FaceEntry, SceneEntry, TakeEntry};
use super::failure::{Failure, FailureKind};
use super::hash::{Digest, KeyBuilder, digest_human, digest_input};
use super::job::{Job, Stage, Task};
use super::manifest::{Manifest, Pair};
use super::pattern::{Names, fill, has};
use super::plan::{PlannedJob, Standing};
use super::record::record_path;
use crate::edit::edits_path;
use crate::scene::Scene;

/// What a planner comes to.
pub(super) struct Planned {
    pub(super) jobs: Vec<PlannedJob>,
    /// Edits that an earlier manifest put beside rigs: outputs.
    pub(super) stale: Vec<String>,
}

/// What the jobs of a face share.
#[derive(Clone)]
struct FaceSide {
    /// Where the rig is: from the output folder, or a whole path.
    rig: PathBuf,
    /// What rig and edits depend on.
    key: String,
    /// Jobs that make them.
    needs: Vec<usize>,
    failure: Option<Failure>,
}

/// Turns faces and pairs into jobs.
pub(super) struct Planner<'a> {
    manifest: &'a Manifest,
    out: &'a Path,
    digests: HashMap<PathBuf, Result<Digest, String>>,
    /// Wrinkle maps by the scene file that names them.
    maps: HashMap<PathBuf, Vec<PathBuf>>,
    jobs: Vec<PlannedJob>,
    by_output: HashMap<String, usize>,
    faces: Vec<Option<FaceSide>>,
    stale: Vec<String>,
}

impl<'a> Planner<'a> {
    pub(super) fn new(manifest: &'a Manifest, out: &'a Path) -> Self {
        let mut paths: HashSet<PathBuf> = HashSet::new();
        for face in &manifest.faces {
            paths.insert(face.file.clone());
            let others = [&face.landmarks, &face.edits, &face.shapes, &face.template];
            paths.extend(others.into_iter().flatten().cloned());
            let rig = Self::rig_path(manifest, face);
            let beside = edits_path(&out.join(rig));
            if beside.exists() {
                paths.insert(beside);
            }
        }
        paths.extend(manifest.takes.iter().map(|take| take.file.clone()));
        let scenes = manifest.scenes.iter().filter(|scene| scene.has_file());
        let mut maps: HashMap<PathBuf, Vec<PathBuf>> = HashMap::new();
        for scene in scenes {
            if !maps.contains_key(&scene.file) {
                maps.insert(scene.file.clone(), maps_of(&scene.file));
            }
            paths.insert(scene.file.clone());
        }
        paths.extend(maps.values().flatten().cloned());
        let digests = paths.into_par_iter().map(|path| {
            let digest =
                digest_input(&path).map_err(|e| format!("cannot read {}: {e}", path.display()));
            (path, digest)
        });
        Self {
            manifest,
            out,
            digests: digests.collect(),
            maps,
            jobs: Vec::new(),
            by_output: HashMap::new(),
            faces: vec![None; manifest.faces.len()],
            stale: Vec::new(),
        }
    }

    /// Faces that are in no pair get a rig and their own outputs too.
    pub(super) fn finish(mut self) -> Result<Planned, BatchError> {
        for face in 0..self.manifest.faces.len() {
            self.face(face)?;
        }
        Ok(Planned {
            jobs: self.jobs,
            stale: self.stale,
        })
    }

    /// The rig of a face, from the output folder or whole.
    fn rig_path(manifest: &Manifest, face: &FaceEntry) -> PathBuf {
        if face.is_rig() {
            return face.file.clone();
        }
        let names = Names {
            face: &face.name,
            ..Names::default()
        };
        PathBuf::from(fill(&manifest.rigs, names))
    }

    fn digest(&self, path: &Path) -> Result<Digest, String> {
        match self.digests.get(path) {
            Some(digest) => digest.clone(),
            None => Err(format!("cannot read {}", path.display())),
        }
    }

    fn add(
        &mut self,
        job: Job,
        needs: Vec<usize>,
        failure: Option<Failure>,
    ) -> Result<usize, BatchError> {
        let index = self.jobs.len();
        if let Some(other) = self.by_output.insert(job.output.clone(), index) {
            let other = &self.jobs[other].job;
            let differs = |name: &str, of: fn(&Job) -> Option<String>| {
                (of(other) != of(&job)).then(|| name.to_owned())
            };
            let missing = differs("{face}", |job| Some(job.task.face.name.clone()))
                .or_else(|| differs("{take}", |job| Some(job.task.take.clone()?.name)))
                .or_else(|| differs("{scene}", |job| Some(job.task.scene.clone()?.name)));
            return Err(BatchError::SameOutput {
                output: job.output.clone(),
                first: format!("{} ({})", other.subject(), other.stage.name()),
                second: format!("{} ({})", job.subject(), job.stage.name()),
                missing: match missing.as_deref() {
                    Some("{face}") => "{face}",
                    Some("{take}") => "{take}",
                    Some("{scene}") => "{scene}",
                    _ => "another name",
                },
            });
        }
        self.jobs.push(PlannedJob {
            job,
            standing: failure.map_or(Standing::Missing, Standing::Lost),
            needs,
            size: 1.0,
        });
        Ok(index)
    }

    /// The jobs of a face alone, once.
    fn face(&mut self, index: usize) -> Result<FaceSide, BatchError> {
        if let Some(side) = &self.faces[index] {
            return Ok(side.clone());
        }
        let face = &self.manifest.faces[index];
        let rig = Self::rig_path(self.manifest, face);
        let mut side = if face.is_rig() {
            let digest = self.digest(&face.file);
            FaceSide {
                rig: rig.clone(),
                key: digest.clone().unwrap_or_default(),
                needs: Vec::new(),
                failure: digest
                    .err()
                    .map(|message| Failure::new(FailureKind::Face, &face.name, message)),
            }
        } else {
            self.rig_job(face, &rig)?
        };
        self.edits(face, &rig, &mut side)?;
        self.faces[index] = Some(side.clone());
        let all = 0..self.manifest.outputs.len();
        for output in all.filter(|&o| !has(&self.manifest.outputs[o].path, "take")) {
            self.export(output, &side, face, None, None)?;
        }
        Ok(side)
    }

    fn rig_job(&mut self, face: &FaceEntry, rig: &Path) -> Result<FaceSide, BatchError> {
        let mut key = KeyBuilder::new("rig").with_settings("settings", &face.settings());
        let mut failure = None;
        let inputs = [
            ("mesh", Some(&face.file)),
            ("landmarks", face.landmarks.as_ref()),
            ("shapes", face.shapes.as_ref()),
            ("template", face.template.as_ref()),
        ];
        for (name, path) in inputs {
            let Some(path) = path else { continue };
            match self.digest(path) {
                Ok(digest) => key = key.with(name, &digest),
                Err(message) => {
                    failure.get_or_insert(Failure::new(FailureKind::Face, &face.name, message));
                }
            }
        }
        if face.template.is_none() {
            key = key.with("template", human_digest());
        }
        let key = key.finish();
        let job = Job {
            output: slashes(rig),
            stage: Stage::Rig,
            key: key.clone(),
            needs: Vec::new(),
            task: Task {
                face: face.clone(),
                rig: rig.to_owned(),
                rig_key: key.clone(),
                take: None,
                scene: None,
                output: None,
            },
        };
        let made = self.add(job, Vec::new(), failure.clone())?;
        Ok(FaceSide {
            rig: rig.to_owned(),
            key,
            needs: vec![made],
            failure,
        })
    }

    /// Edits of the manifest go beside the rig; those that a person put there count too.
    fn edits(
        &mut self,
        face: &FaceEntry,
        rig: &Path,
        side: &mut FaceSide,
    ) -> Result<(), BatchError> {
        let beside = edits_path(rig);
        let Some(from) = &face.edits else {
            let place = self.out.join(&beside);
            let is_ours = !face.is_rig() && record_path(self.out, &slashes(&beside)).exists();
            if is_ours {
                self.stale.push(slashes(&beside));
            } else if let Some(Ok(digest)) = self.digests.get(&place) {
                side.key = KeyBuilder::new("edited")
                    .with("rig", &side.key)
                    .with("edits", digest)
                    .finish();
            }
            return Ok(());
        };
        let digest = self.digest(from);
        let edited = KeyBuilder::new("edited")
            .with("rig", &side.key)
            .with("edits", digest.as_deref().unwrap_or_default())
            .finish();
        let failure = digest
            .err()
            .map(|message| Failure::new(FailureKind::Edits, &face.name, message));
        let failure = side.failure.clone().or(failure);
        let job = Job {
            output: slashes(&beside),
            stage: Stage::Edits,
            key: edited.clone(),
            needs: self.outputs(&side.needs),
            task: Task {
                face: face.clone(),
                rig: rig.to_owned(),
                rig_key: side.key.clone(),
                take: None,
                scene: None,
                output: None,
            },
        };
        let put = self.add(job, side.needs.clone(), failure.clone())?;
        side.key = edited;
        side.needs.push(put);
        side.failure = failure;
        Ok(())
    }

    fn outputs(&self, needs: &[usize]) -> Vec<String> {
        let needs = needs.iter();
        needs
            .map(|&need| self.jobs[need].job.output.clone())
            .collect()
    }

    pub(super) fn outputs_of_pair(&mut self, pair: &Pair) -> Result<(), BatchError> {
        let side = self.face(pair.face)?;
        let manifest = self.manifest;
        let face = &manifest.faces[pair.face];
        let (take, scene) = (&manifest.takes[pair.take], &manifest.scenes[pair.scene]);
        for &output in &pair.outputs {
            if has(&manifest.outputs[output].path, "take") {
                self.export(output, &side, face, Some(take), Some(scene))?;
            }
        }
        Ok(())
    }

    /// The job of an output, and of the topology that goes with a dataset.
    fn export(
        &mut self,
        output: usize,
        side: &FaceSide,
        face: &FaceEntry,
        take: Option<&TakeEntry>,
        scene: Option<&SceneEntry>,
    ) -> Result<(), BatchError> {
        let output = &self.manifest.outputs[output];
        let stage = match output.content() {
            Content::Recording => Stage::Record,
            Content::Export => Stage::Export,
            Content::Dataset => Stage::Dataset,
        };
        let names = Names {
            face: &face.name,
            take: take.map_or("", |take| &take.name),
            scene: scene.map_or("", |scene| &scene.name),
            format: "",
        };
        if stage == Stage::Dataset {
            self.topology(&fill(&output.topology, names), side, face)?;
        }
        let mut failure = side.failure.clone();
        let mut key = KeyBuilder::new(stage.name())
            .with("rig", &side.key)
            .with("face", names.face)
            .with("take", names.take)
            .with("scene", names.scene)
            .with_settings("output", &output.settings());
        if let Some(take) = take {
            key = key.with_settings("take settings", &take.settings());
            match self.digest(&take.file) {
                Ok(digest) => key = key.with("take file", &digest),
                Err(message) => {
                    failure.get_or_insert(Failure::new(FailureKind::Take, &take.name, message));
                }
            }
        }
        if let Some(scene) = scene {
            key = key.with_settings("scene settings", &scene.settings());
            if scene.has_file() {
                for map in self.maps.get(&scene.file).into_iter().flatten() {
                    // What is wrong with a map the job says itself.
                    let digest = self.digest(map).unwrap_or_default();
                    key = key.with("wrinkle map", &digest);
                }
                match self.digest(&scene.file) {
                    Ok(digest) => key = key.with("scene file", &digest),
                    Err(message) => {
                        failure.get_or_insert(Failure::new(
                            FailureKind::Scene,
                            &scene.name,
                            message,
                        ));
                    }
                }
            }
        }
        let job = Job {
            output: fill(&output.path, names),
            stage,
            key: key.finish(),
            needs: self.outputs(&side.needs),
            task: Task {
                face: face.clone(),
                rig: side.rig.clone(),
                rig_key: side.key.clone(),
                take: take.cloned(),
                scene: scene.cloned(),
                output: Some(output.clone()),
            },
        };
        self.add(job, side.needs.clone(), failure)?;
        Ok(())
    }

    /// Once a face.
    fn topology(
        &mut self,
        output: &str,
        side: &FaceSide,
        face: &FaceEntry,
    ) -> Result<(), BatchError> {
        let is_there = self.by_output.get(output).is_some_and(|&index| {
            let other = &self.jobs[index].job;
            other.stage == Stage::Topology && other.task.face.name == face.name
        });
        if is_there {
            return Ok(());
        }
        let job = Job {
            output: output.to_owned(),
            stage: Stage::Topology,
            key: KeyBuilder::new("topology")
                .with("rig", &side.key)
                .with("face", &face.name)
                .finish(),
            needs: self.outputs(&side.needs),
            task: Task {
                face: face.clone(),
                rig: side.rig.clone(),
                rig_key: side.key.clone(),
                take: None,
                scene: None,
                output: None,
            },
        };
        self.add(job, side.needs.clone(), side.failure.clone())?;
        Ok(())
    }
}

fn human_digest() -> &'static str {
    static DIGEST: LazyLock<String> = LazyLock::new(digest_human);
    &DIGEST
}

/// A path with `/` between folders, on every system.
fn slashes(path: &Path) -> String {
    let parts = path
        .components()
        .map(|part| part.as_os_str().to_string_lossy());
    parts.collect::<Vec<_>>().join("/")
}

/// The wrinkle maps that a scene file names; none of one that cannot be read.
fn maps_of(scene: &Path) -> Vec<PathBuf> {
    Scene::load(scene).map_or_else(
        |_| Vec::new(),
        |scene| {
            let maps = scene.wrinkles.values().map(|edit| &edit.map);
            maps.flatten().map(|map| scene.path_of(map)).collect()
        },
    )
}
