//! What a run did: counts, what went wrong in one line each, time, figures of quality.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::dataset::SCHEMA;
use super::failure::{Failure, FailureKind};
use super::job::{Ending, Outcome, Stage};
use super::plan::{Plan, PlannedJob};
use super::record::JobRecord;
use super::worker::read_scene;
use crate::atomic_file::write_atomically;
use crate::scene::Dynamics;

/// How jobs ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// All of them.
    pub jobs: usize,
    /// Made in this run.
    pub done: usize,
    /// There already.
    pub up_to_date: usize,
    /// Went wrong.
    pub failed: usize,
    /// Not begun, because of something that went wrong.
    pub lost: usize,
    /// Not begun or not finished, because the run was stopped.
    pub stopped: usize,
}

impl Counts {
    fn add(&mut self, ending: &Ending) {
        self.jobs += 1;
        match ending {
            Ending::Done(_) => self.done += 1,
            Ending::UpToDate(_) => self.up_to_date += 1,
            Ending::Failed(_) => self.failed += 1,
            Ending::Lost(_) => self.lost += 1,
            Ending::Stopped => self.stopped += 1,
        }
    }
}

/// The jobs of one stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageRow {
    /// The stage.
    pub stage: Stage,
    /// How its jobs ended.
    pub counts: Counts,
    /// Time of workers in this run. (s)
    pub seconds: f64,
}

/// One thing that went wrong.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FailureRow {
    /// What it is.
    #[serde(flatten)]
    pub failure: Failure,
    /// Outputs that are missing for it.
    pub outputs: Vec<String>,
}

/// How finely a scene is simulated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AccuracyRow {
    /// The scene.
    pub scene: String,
    /// Whether the cloth is simulated at all.
    pub has_dynamics: bool,
    /// Substeps of the cloth per 1/60 s.
    pub substeps: u32,
    /// Frames a second; the takes' own where there is none. (1/s)
    pub fps: Option<f64>,
}

/// Figures of a face.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FaceRow {
    /// The face.
    pub face: String,
    /// Its rig, where there is one.
    pub rig: Option<PathBuf>,
    /// Distance of the template from the face: median, 95 %, largest. (mm)
    pub template_to_face_mm: Option<[f64; 3]>,
    /// Distance of the face from the template: median, 95 %, largest. (mm)
    pub face_to_template_mm: Option<[f64; 3]>,
    /// Margin of its alignment, 0 to 1.
    pub confidence: Option<f64>,
    /// Triangles that turned over.
    pub folded_triangles: Option<u64>,
    /// What registration says besides.
    pub notes: Vec<String>,
    /// Its outputs that are there, and all of them.
    pub outputs: [usize; 2],
}

/// Figures of a simulated take on a face.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PairRow {
    /// The face.
    pub face: String,
    /// The take.
    pub take: String,
    /// The scene.
    pub scene: String,
    /// The output.
    pub output: String,
    /// What it is.
    pub stage: Stage,
    /// Simulated time. (s)
    pub simulated_secs: f64,
    /// Time it took a worker, now or when it was made. (s)
    pub seconds: f64,
    /// Largest root mean square distance of a frame's nodes from their muscle shapes, where it is
    /// measured. (mm)
    pub settle_rms_max: Option<f64>,
    /// How often guards of the solver acted, where it is counted.
    pub guards: Option<u64>,
    /// SHA-256 of the output.
    pub sha256: String,
}

/// Who ran a batch, and how long.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunFacts {
    /// `local` or `ray`.
    pub engine: String,
    /// Jobs at a time.
    pub workers: usize,
    /// Threads of each.
    pub threads: usize,
    /// Time by the clock on the wall. (s)
    pub wall_secs: f64,
    /// Largest memory of the process, where the system tells. (bytes)
    pub peak_memory_bytes: Option<u64>,
}

/// What a run did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BatchReport {
    /// Version of fabrig.
    pub fabrig: &'static str,
    /// The manifest.
    pub manifest: PathBuf,
    /// The output folder.
    pub out: PathBuf,
    /// Whether everything that was asked for is there.
    pub is_complete: bool,
    /// How the jobs ended.
    pub counts: Counts,
    /// By stage.
    pub stages: Vec<StageRow>,
    /// What went wrong, each thing once.
    pub failures: Vec<FailureRow>,
    /// Who ran it.
    #[serde(flatten)]
    pub run: RunFacts,
    /// Time of all workers together. (s)
    pub worker_secs: f64,
    /// Time simulated in this run. (s)
    pub simulated_secs: f64,
    /// Simulated seconds per second, rigs and exports included; none where nothing was simulated.
    pub throughput: Option<f64>,
    /// What it was simulated with.
    pub accuracy: Vec<AccuracyRow>,
    /// Figures of faces.
    pub faces: Vec<FaceRow>,
    /// Figures of pairs that are there.
    pub pairs: Vec<PairRow>,
    /// What a person should know besides.
    pub notes: Vec<String>,
}

fn distances(report: &Value, name: &str) -> Option<[f64; 3]> {
    let of = |figure: &str| report[name][figure].as_f64();
    Some([of("median")?, of("p95")?, of("max")?])
}

impl BatchReport {
    /// Of the outcomes of a plan's jobs; a job without an outcome was not begun. Where there are
    /// datasets, also writes their list beside them.
    pub fn new(plan: &Plan, outcomes: Vec<Outcome>, run: RunFacts) -> Self {
        let mut by_output: BTreeMap<String, Outcome> = outcomes
            .into_iter()
            .map(|outcome| (outcome.output.clone(), outcome))
            .collect();
        let outcomes: Vec<(&PlannedJob, Outcome)> = plan
            .jobs
            .iter()
            .map(|planned| {
                let found = by_output.remove(&planned.job.output);
                let outcome = found.unwrap_or_else(|| Outcome {
                    output: planned.job.output.clone(),
                    ending: Ending::Stopped,
                    seconds: 0.0,
                });
                (planned, outcome)
            })
            .collect();
        let mut counts = Counts::default();
        let mut stages: BTreeMap<Stage, StageRow> = BTreeMap::new();
        let mut failures: BTreeMap<Failure, Vec<String>> = BTreeMap::new();
        let mut faces: Vec<FaceRow> = Vec::new();
        let mut pairs = Vec::new();
        let mut simulated_secs = 0.0;
        for (planned, outcome) in &outcomes {
            let job = &planned.job;
            counts.add(&outcome.ending);
            let row = stages.entry(job.stage).or_insert_with(|| StageRow {
                stage: job.stage,
                counts: Counts::default(),
                seconds: 0.0,
            });
            row.counts.add(&outcome.ending);
            row.seconds += outcome.seconds;
            if let Ending::Failed(failure) | Ending::Lost(failure) = &outcome.ending {
                let outputs = failures.entry(failure.clone()).or_default();
                outputs.push(job.output.clone());
            }
            if let Ending::Done(record) = &outcome.ending {
                simulated_secs += record.simulated_secs;
            }
            let record = record_of(&outcome.ending);
            add_to_face(&mut faces, planned, record);
            pairs.extend(record.and_then(|record| pair_row(planned, record)));
        }
        let is_complete = counts.failed + counts.lost + counts.stopped == 0;
        let mut report = Self {
            fabrig: env!("CARGO_PKG_VERSION"),
            manifest: plan.manifest.path.clone(),
            out: plan.out.clone(),
            is_complete,
            counts,
            worker_secs: stages.values().map(|row| row.seconds).sum(),
            stages: stages.into_values().collect(),
            failures: failures
                .into_iter()
                .map(|(failure, outputs)| FailureRow { failure, outputs })
                .collect(),
            simulated_secs,
            throughput: (simulated_secs > 0.0).then(|| simulated_secs / run.wall_secs),
            run,
            accuracy: accuracy(plan),
            faces,
            pairs,
            notes: Vec::new(),
        };
        report.list_dataset(&outcomes);
        report
    }

    /// Writes which face and pair of a dataset is in which file.
    fn list_dataset(&mut self, outcomes: &[(&PlannedJob, Outcome)]) {
        let of = |stage: Stage| {
            let found = outcomes
                .iter()
                .filter(move |(planned, _)| planned.job.stage == stage);
            found.filter_map(|(planned, outcome)| Some((*planned, record_of(&outcome.ending)?)))
        };
        let pairs: Vec<Value> = of(Stage::Dataset)
            .map(|(planned, record)| {
                let task = &planned.job.task;
                json!({
                    "face": task.face.name,
                    "take": task.take.as_ref().map(|take| &take.name),
                    "scene": task.scene.as_ref().map(|scene| &scene.name),
                    "file": planned.job.output,
                    "frames": record.figures["frames"],
                    "fps": record.figures["fps"],
                    "vertices": record.figures["vertices"],
                    "sha256": record.sha256,
                })
            })
            .collect();
        if pairs.is_empty() {
            return;
        }
        let faces: Vec<Value> = of(Stage::Topology)
            .map(|(planned, _)| {
                json!({ "face": planned.job.task.face.name, "file": planned.job.output })
            })
            .collect();
        let list = json!({ "schema": SCHEMA, "unit": "mm", "faces": faces, "pairs": pairs });
        let text = format!("{list:#}\n");
        let path = self.out.join(DATASET_LIST);
        // As it is already: a finished dataset may be where nobody can write.
        if std::fs::read(&path).is_ok_and(|old| old == text.as_bytes()) {
            return;
        }
        let written = write_atomically(&path, |file| file.write_all(text.as_bytes()));
        if let Err(error) = written {
            let failure = Failure::of_io(&path, DATASET_LIST, &error);
            self.is_complete = false;
            self.failures.push(FailureRow {
                failure: Failure {
                    kind: FailureKind::Output,
                    ..failure
                },
                outputs: vec![DATASET_LIST.to_owned()],
            });
        }
    }
}

/// The list of a dataset's files, in the output folder.
pub const DATASET_LIST: &str = "dataset.json";

fn record_of(ending: &Ending) -> Option<&JobRecord> {
    match ending {
        Ending::Done(record) | Ending::UpToDate(record) => Some(record),
        _ => None,
    }
}

fn add_to_face(faces: &mut Vec<FaceRow>, planned: &PlannedJob, record: Option<&JobRecord>) {
    let job = &planned.job;
    let name = &job.task.face.name;
    // Jobs of a face follow each other, but for what a face in no pair gets.
    let place = faces.iter().rposition(|row| row.face == *name);
    let place = place.unwrap_or_else(|| {
        faces.push(FaceRow {
            face: name.clone(),
            rig: job.task.face.is_rig().then(|| job.task.rig.clone()),
            template_to_face_mm: None,
            face_to_template_mm: None,
            confidence: None,
            folded_triangles: None,
            notes: Vec::new(),
            outputs: [0, 0],
        });
        faces.len() - 1
    });
    let row = &mut faces[place];
    row.outputs[0] += usize::from(record.is_some());
    row.outputs[1] += 1;
    if let (Stage::Rig, Some(record)) = (job.stage, record) {
        let figures = &record.figures;
        row.rig = Some(job.task.rig.clone());
        row.template_to_face_mm = distances(figures, "template_to_face");
        row.face_to_template_mm = distances(figures, "face_to_template");
        row.confidence = figures["confidence"].as_f64();
        row.folded_triangles = figures["folded_triangles"].as_u64();
        let notes = figures["warnings"].as_array().into_iter().flatten();
        let notes = notes.filter_map(|note| note.as_str().map(str::to_owned));
        row.notes = notes.collect();
    }
}

fn pair_row(planned: &PlannedJob, record: &JobRecord) -> Option<PairRow> {
    let job = &planned.job;
    let (take, scene) = (job.task.take.as_ref()?, job.task.scene.as_ref()?);
    let figures = &record.figures;
    let guards = figures["guards"].as_object().map(|guards| {
        let counts = guards.values().filter_map(Value::as_u64);
        counts.sum()
    });
    Some(PairRow {
        face: job.task.face.name.clone(),
        take: take.name.clone(),
        scene: scene.name.clone(),
        output: job.output.clone(),
        stage: job.stage,
        simulated_secs: record.simulated_secs,
        seconds: record.seconds,
        settle_rms_max: figures["settle_rms_max"].as_f64(),
        guards,
        sha256: record.sha256.clone(),
    })
}

fn accuracy(plan: &Plan) -> Vec<AccuracyRow> {
    let mut rows = Vec::new();
    for entry in &plan.manifest.scenes {
        // A scene that cannot be read is among the failures.
        let Ok(scene) = read_scene(entry) else {
            continue;
        };
        rows.push(AccuracyRow {
            scene: entry.name.clone(),
            has_dynamics: scene.dynamics != Dynamics::None,
            substeps: scene.cloth.substeps,
            fps: entry.fps,
        });
    }
    rows
}
