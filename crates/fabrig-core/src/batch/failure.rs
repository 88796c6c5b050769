//! What went wrong with single jobs.

use std::error::Error as StdError;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Whose fault it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FailureKind {
    /// A mesh, its landmarks or shapes, or a rig.
    Face,
    /// Edits.
    Edits,
    /// A take.
    Take,
    /// A scene.
    Scene,
    /// Something cannot be written.
    Output,
    /// Nothing more can be written: the disk is full, read-only or not there. No further jobs are
    /// begun.
    Disk,
    /// A worker was lost, and trying again did not help.
    Worker,
    /// A fault of fabrig itself.
    Crash,
}

/// Why a job has no result.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Failure {
    /// Whose fault it is.
    pub kind: FailureKind,
    /// Name of the face, take or scene; path of the output.
    pub subject: String,
    /// What is wrong, in one line.
    pub message: String,
}

impl Failure {
    pub(super) fn new(kind: FailureKind, subject: &str, message: impl Into<String>) -> Self {
        Self {
            kind,
            subject: subject.to_owned(),
            message: message.into(),
        }
    }

    /// Of an error with all its causes. Errors of a disk that takes nothing more are told apart
    /// from errors of one output.
    pub(super) fn of(kind: FailureKind, subject: &str, error: &(dyn StdError + 'static)) -> Self {
        let kind = if is_of_disk(error) {
            FailureKind::Disk
        } else {
            kind
        };
        Self::new(kind, subject, one_line(error))
    }

    pub(super) fn of_io(path: &Path, subject: &str, error: &io::Error) -> Self {
        let kind = if is_of_disk(error) {
            FailureKind::Disk
        } else {
            FailureKind::Output
        };
        Self::new(
            kind,
            subject,
            format!("cannot write {}: {error}", path.display()),
        )
    }
}

/// The whole chain of causes, each said once.
pub(super) fn one_line(error: &(dyn StdError + 'static)) -> String {
    let mut line = String::new();
    let mut cause = Some(error);
    while let Some(error) = cause {
        let text = error.to_string();
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        if !line.ends_with(&text) {
            if !line.is_empty() {
                line.push_str(": ");
            }
            line.push_str(&text);
        }
        cause = error.source();
    }
    line
}

/// Whether nothing more can be written, whatever the file.
fn is_of_disk(error: &(dyn StdError + 'static)) -> bool {
    let mut cause = Some(error);
    while let Some(error) = cause {
        if let Some(io) = error.downcast_ref::<io::Error>() {
            return matches!(
                io.kind(),
                io::ErrorKind::StorageFull
                    | io::ErrorKind::QuotaExceeded
                    | io::ErrorKind::ReadOnlyFilesystem
            );
        }
        cause = error.source();
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::ExportError;

    #[test]
    fn a_full_disk_is_told_from_a_bad_path() {
        let fails = |kind| {
            let error = ExportError::Io {
                path: "a.npz".into(),
                source: io::Error::from(kind),
            };
            Failure::of(FailureKind::Output, "a.npz", &error)
        };
        let full = fails(io::ErrorKind::StorageFull);
        assert_eq!(full.kind, FailureKind::Disk);
        assert!(full.message.starts_with("cannot write a.npz: "), "{full:?}");
        assert_eq!(fails(io::ErrorKind::NotFound).kind, FailureKind::Output);
    }
}
