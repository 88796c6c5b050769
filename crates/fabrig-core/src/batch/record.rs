//! What is known of a finished job: a small file in the batch's own folder, written after the
//! result itself. A result without it does not count.

use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::hash::measure;
use super::job::Job;
use super::pattern::STATE_FOLDER;
use crate::atomic_file::write_atomically;

/// A finished job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobRecord {
    /// What the result depends on: inputs, settings, versions.
    pub key: String,
    /// Size of the result. (bytes)
    pub bytes: u64,
    /// SHA-256 of the file; of names and contents for a folder.
    pub sha256: String,
    /// Time it took a worker. (s)
    pub seconds: f64,
    /// Simulated time. (s)
    pub simulated_secs: f64,
    /// The report of the stage: registration, animation, export.
    pub figures: Value,
}

/// Where the record of an output is.
pub(super) fn record_path(out: &Path, output: &str) -> PathBuf {
    let mut name = out.join(STATE_FOLDER).join(output).into_os_string();
    name.push(".json");
    name.into()
}

impl JobRecord {
    /// The record of an output; `None` where there is none that can be read.
    pub(super) fn load(out: &Path, output: &str) -> Option<Self> {
        let text = std::fs::read(record_path(out, output)).ok()?;
        serde_json::from_slice(&text).ok()
    }

    /// Whether the output is there as this record has it. Its size stands for its content; with
    /// `is_thorough` all of it is read.
    pub(super) fn holds(&self, out: &Path, output: &str, is_thorough: bool) -> bool {
        let path = out.join(output);
        if is_thorough {
            return measure(&path)
                .is_ok_and(|(sha256, bytes)| (sha256, bytes) == (self.sha256.clone(), self.bytes));
        }
        size(&path).is_ok_and(|bytes| bytes == self.bytes)
    }

    /// Writes it.
    pub(super) fn save(&self, out: &Path, job: &Job) -> io::Result<()> {
        let path = record_path(out, &job.output);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let text = serde_json::to_vec_pretty(self)?;
        write_atomically(&path, |file| file.write_all(&text))
    }
}

/// Takes the record of an output away, so that what is written next does not count until it has
/// its own.
pub(super) fn forget(out: &Path, output: &str) -> io::Result<()> {
    match std::fs::remove_file(record_path(out, output)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

fn size(path: &Path) -> io::Result<u64> {
    let about = std::fs::metadata(path)?;
    if !about.is_dir() {
        return Ok(about.len());
    }
    let mut total = 0;
    for entry in std::fs::read_dir(path)? {
        total += size(&entry?.path())?;
    }
    Ok(total)
}

/// Takes away what killed jobs left half written: temporary files beside outputs.
pub(super) fn sweep(out: &Path, outputs: &[&str]) {
    let mut folders: Vec<PathBuf> = Vec::new();
    for output in outputs {
        let path = out.join(output);
        folders.extend(path.parent().map(Path::to_owned));
        folders.extend(record_path(out, output).parent().map(Path::to_owned));
        remove(&partial_of(&path));
    }
    folders.sort();
    folders.dedup();
    for folder in folders {
        let Ok(entries) = std::fs::read_dir(&folder) else {
            continue;
        };
        for entry in entries.flatten() {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if name.starts_with(".fabrig-") && name.ends_with(".partial") {
                remove(&entry.path());
            }
        }
    }
}

/// The name under which a recording grows.
pub(super) fn partial_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    name.into()
}

/// Removes a file or folder that may not be there.
pub(super) fn remove(path: &Path) {
    let is_folder = path.is_dir();
    // What cannot be removed was not made by this run, or shows when the job writes.
    let _ = if is_folder {
        std::fs::remove_dir_all(path)
    } else {
        std::fs::remove_file(path)
    };
}

/// How a job says how far it is (0 to 1), and is stopped.
pub(super) type OnFraction<'a> = &'a mut (dyn FnMut(f64) -> ControlFlow<()> + Send);
