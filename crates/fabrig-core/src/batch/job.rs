//! One job as it is told to a worker, and how it ended.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::BatchError;
use super::entry::{FaceEntry, OutputEntry, SceneEntry, TakeEntry};
use super::failure::Failure;
use super::record::JobRecord;

/// A step of the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// A mesh becomes a rig.
    Rig,
    /// Edits go beside the rig.
    Edits,
    /// A take is simulated and recorded.
    Record,
    /// A rig, or a take on it, is written for another program.
    Export,
    /// A take is simulated and written for learning.
    Dataset,
    /// What all takes of a face in a dataset share.
    Topology,
}

impl Stage {
    /// Its name: `rig`, `record`, ...
    pub fn name(self) -> &'static str {
        match self {
            Self::Rig => "rig",
            Self::Edits => "edits",
            Self::Record => "record",
            Self::Export => "export",
            Self::Dataset => "dataset",
            Self::Topology => "topology",
        }
    }
}

/// What a job does beside its stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// The face.
    pub face: FaceEntry,
    /// The rig, from the output folder or whole; what the job writes in [`Stage::Rig`].
    pub rig: PathBuf,
    /// What the rig and its edits depend on.
    pub rig_key: String,
    /// The take, where there is one.
    pub take: Option<TakeEntry>,
    /// The scene, where something is simulated.
    pub scene: Option<SceneEntry>,
    /// The output, as the manifest has it.
    pub output: Option<OutputEntry>,
}

/// One result to make. It can be written down, and done by another process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Its result, from the output folder, with `/` between folders; no two jobs have the same.
    pub output: String,
    /// What it does.
    pub stage: Stage,
    /// What its result depends on.
    pub key: String,
    /// Outputs of the jobs that come before it.
    pub needs: Vec<String>,
    /// The rest.
    pub task: Task,
}

impl Job {
    /// As text, for [`Job::from_text`].
    pub fn to_text(&self) -> String {
        // Plain structs of numbers, texts and lists are always JSON.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Reads what [`Job::to_text`] wrote.
    ///
    /// # Errors
    ///
    /// [`BatchError::Text`].
    pub fn from_text(text: &str) -> Result<Self, BatchError> {
        serde_json::from_str(text).map_err(|e| BatchError::Text {
            reason: e.to_string(),
        })
    }

    /// Whom it is for: `ann, hello, wind`.
    pub fn subject(&self) -> String {
        let task = &self.task;
        let mut text = task.face.name.clone();
        if let (Some(take), Some(scene)) = (&task.take, &task.scene) {
            text = format!("{text}, {}, {}", take.name, scene.name);
        }
        text
    }
}

/// How a job ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// The result is there.
    Done(JobRecord),
    /// It was there already.
    UpToDate(JobRecord),
    /// It went wrong.
    Failed(Failure),
    /// It was not begun, because of something else that went wrong.
    Lost(Failure),
    /// It was not begun or not finished, because the run was stopped.
    Stopped,
}

/// A job and how it ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Its result.
    pub output: String,
    /// How it ended.
    pub ending: Ending,
    /// Time it took a worker. (s)
    pub seconds: f64,
}
