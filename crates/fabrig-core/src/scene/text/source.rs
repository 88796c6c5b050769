//! Where a scene was read from, so that what turns out wrong later can be placed too.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::scene::{Hint, SceneError, TextPlace};

/// Folder of a scene and places of its keys. All are equal: where a scene came from is no part
/// of what it says.
#[derive(Debug, Clone, Default)]
pub struct SceneSource {
    folder: PathBuf,
    /// By key path: `faces[0].simulate.only[1]`.
    places: BTreeMap<String, TextPlace>,
    /// What goes before the keys of a face's own scene.
    face: Option<String>,
}

impl PartialEq for SceneSource {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl SceneSource {
    pub(super) fn new(folder: &Path, places: BTreeMap<String, TextPlace>) -> Self {
        Self {
            folder: folder.to_owned(),
            places,
            face: None,
        }
    }

    /// Where files are that the scene names.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The source of one face's own scene.
    pub(in crate::scene) fn of_face(&self, index: usize) -> Self {
        Self {
            face: Some(format!("faces[{index}].")),
            ..self.clone()
        }
    }

    /// A key as the text has it, and its place: in a face's table if it is there.
    fn find(&self, key: &str) -> (String, TextPlace) {
        if let Some(prefix) = &self.face {
            let own = format!("{prefix}{key}");
            if let Some(place) = self.places.get(&own) {
                return (own, *place);
            }
        }
        // A key that is left out is placed where its table is.
        let mut outer = key;
        loop {
            if let Some(place) = self.places.get(outer) {
                return (key.to_owned(), *place);
            }
            match outer.rfind(['.', '[']) {
                Some(end) => outer = &outer[..end],
                None => return (key.to_owned(), TextPlace::default()),
            }
        }
    }

    /// An error of another module, at a key.
    pub fn at(&self, key: &str, error: impl Into<SceneError>) -> SceneError {
        let (key, place) = self.find(key);
        SceneError::At {
            place,
            key,
            source: Box::new(error.into()),
        }
    }

    /// A value that cannot be meant so, at a key.
    ///
    /// - `nearest`: the known name that is spelled most like it
    pub fn value(
        &self,
        key: &str,
        expected: String,
        found: String,
        nearest: Option<&str>,
    ) -> SceneError {
        let (key, place) = self.find(key);
        SceneError::Value {
            place,
            key: key.into(),
            expected: expected.into(),
            found: found.into(),
            hint: Hint(nearest.map(Box::from)),
        }
    }
}
