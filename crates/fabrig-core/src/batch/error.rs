//! What can be wrong with a batch as a whole; what goes wrong with single jobs is a
//! [`super::Failure`] and stops nothing else.

use std::io;
use std::path::PathBuf;

/// A batch could not be read or planned.
#[derive(Debug, thiserror::Error)]
pub enum BatchError {
    /// The manifest could not be read at all.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The manifest is neither TOML nor a table.
    #[error(
        "{}: a manifest is a .toml or .csv file, not '{extension}'",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// Its extension, without the dot.
        extension: String,
    },
    /// The text is malformed, or a value is of the wrong kind.
    #[error("{}:{line}: {message}", path.display())]
    Syntax {
        /// The manifest.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong there.
        message: String,
    },
    /// A key that is not known.
    #[error(
        "{}:{line}: '{key}' is no key of {section} (nearest: '{nearest}'; known: {known})",
        path.display()
    )]
    UnknownKey {
        /// The manifest.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The key.
        key: String,
        /// Where it stands: `the manifest`, `[[faces]]`, ...
        section: &'static str,
        /// The known key that is spelled most like it.
        nearest: String,
        /// All known keys, separated by commas.
        known: String,
    },
    /// An entry that cannot be meant so.
    #[error("{}: {entry}: {problem}", path.display())]
    Entry {
        /// The manifest.
        path: PathBuf,
        /// Which entry: `[[faces]] 2 (faces/*.obj)`.
        entry: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// Two faces, takes or scenes have one name.
    #[error(
        "two {what} are called '{name}' ({} and {}): names go into outputs; give one of them another \
         `name`",
        first.display(), second.display()
    )]
    SameName {
        /// `faces`, `takes`, `scenes`.
        what: &'static str,
        /// The name.
        name: String,
        /// The first's file.
        first: PathBuf,
        /// The second's file.
        second: PathBuf,
    },
    /// Two jobs would write one file.
    #[error(
        "'{output}' would be written for {first} and for {second}: the pattern needs {missing}"
    )]
    SameOutput {
        /// The output, relative to the folder.
        output: String,
        /// Whom the first job is for.
        first: String,
        /// Whom the second is for.
        second: String,
        /// What tells them apart: `{scene}`.
        missing: &'static str,
    },
    /// `only` or a job's name fits nothing.
    #[error("no output is called '{pattern}' (nearest: '{nearest}')")]
    NoSuchOutput {
        /// What was asked for.
        pattern: String,
        /// The output that is spelled most like it.
        nearest: String,
    },
    /// What a single job needs is not there yet.
    #[error("{output} needs {needs}, which is missing or out of date: run that first")]
    NotReady {
        /// The job.
        output: String,
        /// What it needs.
        needs: String,
    },
    /// A job or an outcome handed over as text cannot be read.
    #[error("not a job or outcome of this version: {reason}")]
    Text {
        /// What is wrong with it.
        reason: String,
    },
    /// Another run writes to the same folder.
    #[error("another batch is running in {}: wait for it, or give another folder", path.display())]
    Busy {
        /// The folder.
        path: PathBuf,
    },
    /// Worker threads cannot be started.
    #[error("cannot start threads: {reason}")]
    Threads {
        /// What the system said.
        reason: String,
    },
}
