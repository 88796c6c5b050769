//! The work as a person writes it down: a TOML file, or a table with a row a pair.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::entry::{FaceEntry, OutputEntry, PairEntry, SceneEntry, TakeEntry, is_a};
use super::keys::{check_keys, syntax};
use super::{BatchError, resolve, table};

/// Where rigs go when a manifest does not say it.
pub(super) const DEFAULT_RIGS: &str = "rigs/{face}.fabrig";

/// The text of a manifest.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ManifestText {
    pub(super) rigs: Option<String>,
    pub(super) faces: Vec<FaceEntry>,
    pub(super) takes: Vec<TakeEntry>,
    pub(super) scenes: Vec<SceneEntry>,
    pub(super) pairs: Vec<PairEntry>,
    pub(super) outputs: Vec<OutputEntry>,
}

/// A face with a take in a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pair {
    /// Index of the face.
    pub face: usize,
    /// Index of the take.
    pub take: usize,
    /// Index of the scene.
    pub scene: usize,
    /// Indices of the outputs that it gets.
    pub outputs: Vec<usize>,
}

/// What there is to do: every wildcard replaced, every file by its whole path, every name given.
/// Whether the files are there shows when the work is planned.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    /// The file.
    pub path: PathBuf,
    /// Where rigs go: a pattern with `{face}`.
    pub rigs: String,
    /// Faces.
    pub faces: Vec<FaceEntry>,
    /// Takes.
    pub takes: Vec<TakeEntry>,
    /// Scenes; at least one.
    pub scenes: Vec<SceneEntry>,
    /// Outputs, one for each format.
    pub outputs: Vec<OutputEntry>,
    /// Faces with takes, in order.
    pub pairs: Vec<Pair>,
}

impl Manifest {
    /// Reads a manifest, `.toml` or `.csv`; paths in it start from its own folder.
    ///
    /// # Errors
    ///
    /// [`BatchError`], with the line where there is one.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, BatchError> {
        let path = path.as_ref();
        let is_csv = is_a(path, "csv");
        if !is_csv && !is_a(path, "toml") {
            return Err(BatchError::UnknownFormat {
                path: path.to_owned(),
                extension: path
                    .extension()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .into_owned(),
            });
        }
        let read = |source| BatchError::Read {
            path: path.to_owned(),
            source,
        };
        let text = std::fs::read_to_string(path).map_err(read)?;
        // Jobs may run elsewhere: on another machine that sees the same folders.
        let path = &std::path::absolute(path).map_err(read)?;
        if is_csv {
            table::parse(&text, path)
        } else {
            Self::from_toml(&text, path)
        }
    }

    /// Reads a manifest from text.
    ///
    /// - `path`: for messages, and for where its paths start
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn from_toml(text: &str, path: &Path) -> Result<Self, BatchError> {
        check_keys(text, path)?;
        let parsed = toml::from_str(text).map_err(|error| syntax(text, path, &error))?;
        resolve::resolve(parsed, path)
    }

    /// Reads a table from text: a row a pair.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn from_csv(text: &str, path: &Path) -> Result<Self, BatchError> {
        table::parse(text, path)
    }
}
