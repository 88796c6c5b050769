//! A manifest as a table: a row a pair, in the order of the rows.
//!
//! Columns: `face` (a file; needed), `take`, `scene`, `landmarks`, `edits`, `shapes`, `template`,
//! `unit`, `output` (a pattern). Cells may be empty.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::BatchError;
use super::entry::{FaceEntry, OutputEntry, SceneEntry, TakeEntry};
use super::keys::unknown;
use super::manifest::{Manifest, Pair};
use super::resolve::resolve_listed;

const COLUMNS: [&str; 9] = [
    "face",
    "take",
    "scene",
    "landmarks",
    "edits",
    "shapes",
    "template",
    "unit",
    "output",
];

/// Where a recording goes when a table does not say it.
const DEFAULT_OUTPUT: &str = "{face}/{take}.mcap";

pub(super) fn parse(text: &str, path: &Path) -> Result<Manifest, BatchError> {
    let at = |line: usize, message: String| BatchError::Syntax {
        path: path.to_owned(),
        line,
        message,
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let heads = reader.headers().map_err(|e| at(1, e.to_string()))?.clone();
    if let Some(key) = heads.iter().find(|head| !COLUMNS.contains(head)) {
        return Err(unknown(path, 1, key, "the table's columns", &COLUMNS));
    }
    let mut rows = Rows::default();
    for record in reader.records() {
        let record = record.map_err(|e| {
            let line = e.position().map_or(1, csv::Position::line);
            at(line as usize, e.to_string())
        })?;
        let line = record.position().map_or(1, csv::Position::line) as usize;
        let cell = |name: &str| {
            let column = heads.iter().position(|head| head == name)?;
            record.get(column).filter(|text| !text.is_empty())
        };
        rows.push(&cell).map_err(|message| at(line, message))?;
    }
    let Rows {
        faces,
        takes,
        scenes,
        outputs,
        pairs,
        ..
    } = rows;
    let scenes = scenes.into_iter().map(|scene| scene.unwrap_or_default());
    resolve_listed(faces, takes, scenes.collect(), outputs, pairs, path)
}

#[derive(Default)]
struct Rows {
    faces: Vec<FaceEntry>,
    takes: Vec<TakeEntry>,
    /// `None` is the default scene.
    scenes: Vec<Option<SceneEntry>>,
    outputs: Vec<OutputEntry>,
    pairs: Vec<Pair>,
    face_of: HashMap<PathBuf, usize>,
    take_of: HashMap<PathBuf, usize>,
    pair_of: HashMap<(usize, usize, usize), usize>,
}

impl Rows {
    fn push<'a>(&mut self, cell: &impl Fn(&str) -> Option<&'a str>) -> Result<(), String> {
        let file = |name: &str| cell(name).map(PathBuf::from);
        let one = |name: &str| -> Result<PathBuf, String> {
            let path = file(name).unwrap_or_default();
            if super::pattern::is_wild(&path.to_string_lossy()) {
                return Err(format!(
                    "'{}': a table has no wildcards; write a manifest in TOML",
                    path.display()
                ));
            }
            Ok(path)
        };
        let face = FaceEntry {
            file: one("face")?,
            landmarks: file("landmarks"),
            edits: file("edits"),
            shapes: file("shapes"),
            template: file("template"),
            unit: cell("unit").map(|text| word("unit", text)).transpose()?,
            ..FaceEntry::default()
        };
        if face.file.as_os_str().is_empty() {
            return Err("the row has no face".to_owned());
        }
        let index = *self
            .face_of
            .entry(face.file.clone())
            .or_insert(self.faces.len());
        match self.faces.get(index) {
            None => self.faces.push(face),
            Some(other) if *other == face => {}
            Some(other) => {
                return Err(format!(
                    "{} is here with other landmarks, edits, shapes, template or unit than above",
                    other.file.display()
                ));
            }
        }
        let face = index;
        let take = one("take")?;
        if take.as_os_str().is_empty() {
            return Ok(());
        }
        let index = *self.take_of.entry(take.clone()).or_insert(self.takes.len());
        if index == self.takes.len() {
            self.takes.push(TakeEntry {
                file: take,
                ..TakeEntry::default()
            });
        }
        let take = index;
        let scene = one("scene")?;
        let scene = (!scene.as_os_str().is_empty()).then_some(SceneEntry {
            file: scene,
            ..SceneEntry::default()
        });
        let scene = index_of(&mut self.scenes, scene);
        let output = index_of(
            &mut self.outputs,
            OutputEntry {
                path: cell("output").unwrap_or(DEFAULT_OUTPUT).to_owned(),
                ..OutputEntry::default()
            },
        );
        let places = self.pair_of.entry((face, take, scene));
        let index = *places.or_insert(self.pairs.len());
        match self.pairs.get_mut(index) {
            Some(pair) if pair.outputs.contains(&output) => {}
            Some(pair) => pair.outputs.push(output),
            None => self.pairs.push(Pair {
                face,
                take,
                scene,
                outputs: vec![output],
            }),
        }
        Ok(())
    }
}

/// The value of a word, as the manifest would have it.
fn word<T: DeserializeOwned>(column: &str, text: &str) -> Result<T, String> {
    let value = toml::Value::String(text.to_owned());
    value
        .try_into()
        .map_err(|error: toml::de::Error| format!("{column}: {}", error.message()))
}

fn index_of<T: PartialEq>(list: &mut Vec<T>, item: T) -> usize {
    match list.iter().position(|other| *other == item) {
        Some(index) => index,
        None => {
            list.push(item);
            list.len() - 1
        }
    }
}
