//! Known keys of a manifest. `serde` alone would list all of them where one is misspelt; here the
//! nearest is named, with its line.

use std::ops::Range;
use std::path::Path;

use toml::de::{DeTable, DeValue};

use super::BatchError;
use crate::facs::nearest_name;

const MANIFEST: [&str; 6] = ["rigs", "faces", "takes", "scenes", "pairs", "outputs"];

pub(super) const FACE: [&str; 11] = [
    "file",
    "name",
    "landmarks",
    "landmarks_order",
    "edits",
    "shapes",
    "alpha",
    "offsets",
    "template",
    "unit",
    "cut_seams",
];

pub(super) const TAKE: [&str; 14] = [
    "file",
    "name",
    "from",
    "to",
    "format",
    "fps",
    "milliseconds",
    "ignore_unknown_columns",
    "clamp_weights",
    "calibrate_neutral",
    "gain",
    "swap_sides",
    "keep_mouth_close",
    "resample",
];

pub(super) const SCENE: [&str; 5] = ["file", "name", "fps", "substeps", "without_dynamics"];

pub(super) const PAIR: [&str; 3] = ["faces", "takes", "scenes"];

pub(super) const OUTPUT: [&str; 14] = [
    "path",
    "formats",
    "content",
    "topology",
    "baked",
    "without_dynamics",
    "check",
    "still_head",
    "unit",
    "tolerance",
    "skin_hz",
    "patches_hz",
    "points_hz",
    "strain_hz",
];

/// Keys of the tables in a list of this name.
fn keys_in(list: &str) -> Option<(&'static str, &'static [&'static str])> {
    Some(match list {
        "faces" => ("[[faces]]", &FACE),
        "takes" => ("[[takes]]", &TAKE),
        "scenes" => ("[[scenes]]", &SCENE),
        "pairs" => ("[[pairs]]", &PAIR),
        "outputs" => ("[[outputs]]", &OUTPUT),
        _ => return None,
    })
}

/// The line of a place in a text, from 1.
pub(super) fn line_of(text: &str, place: Option<Range<usize>>) -> usize {
    let start = place.map_or(0, |range| range.start.min(text.len()));
    1 + text.as_bytes()[..start]
        .iter()
        .filter(|b| **b == b'\n')
        .count()
}

/// Refuses keys that are not known.
pub(super) fn check_keys(text: &str, path: &Path) -> Result<(), BatchError> {
    let document = DeTable::parse(text).map_err(|error| syntax(text, path, &error))?;
    let checked = Text { text, path };
    checked.table(document.get_ref(), "the manifest", &MANIFEST)?;
    for (key, value) in document.get_ref() {
        let Some((section, known)) = keys_in(key.get_ref()) else {
            continue;
        };
        let DeValue::Array(entries) = value.get_ref() else {
            continue;
        };
        for entry in entries {
            if let DeValue::Table(table) = entry.get_ref() {
                checked.table(table, section, known)?;
            }
        }
    }
    Ok(())
}

pub(super) fn syntax(text: &str, path: &Path, error: &toml::de::Error) -> BatchError {
    BatchError::Syntax {
        path: path.to_owned(),
        line: line_of(text, error.span()),
        message: error.message().trim().replace('\n', " "),
    }
}

struct Text<'a> {
    text: &'a str,
    path: &'a Path,
}

impl Text<'_> {
    fn table(
        &self,
        table: &DeTable<'_>,
        section: &'static str,
        known: &[&str],
    ) -> Result<(), BatchError> {
        for (key, _) in table {
            if known.contains(&key.get_ref().as_ref()) {
                continue;
            }
            return Err(unknown(
                self.path,
                line_of(self.text, Some(key.span())),
                key.get_ref(),
                section,
                known,
            ));
        }
        Ok(())
    }
}

pub(super) fn unknown(
    path: &Path,
    line: usize,
    key: &str,
    section: &'static str,
    known: &[&str],
) -> BatchError {
    BatchError::UnknownKey {
        path: path.to_owned(),
        line,
        key: key.to_owned(),
        section,
        nearest: nearest_name(key, known.iter().copied())
            .unwrap_or_default()
            .to_owned(),
        known: known.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::entry::{FaceEntry, OutputEntry, PairEntry, SceneEntry, TakeEntry};

    /// The lists above are those of the types: `serde` lists the fields when one is unknown.
    fn fields<T: serde::de::DeserializeOwned + std::fmt::Debug>() -> Vec<String> {
        let error = toml::from_str::<T>("no_such_key = 1").unwrap_err();
        let listed = error.message().split("expected one of").nth(1).unwrap();
        let names = listed.split('`').skip(1).step_by(2);
        names.map(str::to_owned).collect()
    }

    #[test]
    fn lists_are_complete() {
        assert_eq!(fields::<FaceEntry>(), FACE);
        assert_eq!(fields::<TakeEntry>(), TAKE);
        assert_eq!(fields::<SceneEntry>(), SCENE);
        assert_eq!(fields::<PairEntry>(), PAIR);
        assert_eq!(fields::<OutputEntry>(), OUTPUT);
    }

    #[test]
    fn a_misspelt_key_is_named_with_its_line() {
        let text = "rigs = \"x\"\n\n[[faces]]\nfile = \"a.obj\"\nlandmark = \"b\"\n";
        let error = check_keys(text, Path::new("m.toml")).unwrap_err();
        assert!(
            matches!(&error, BatchError::UnknownKey { line: 5, key, nearest, .. }
                if key == "landmark" && nearest == "landmarks"),
            "{error}"
        );
        let error = check_keys("face = []\n", Path::new("m.toml")).unwrap_err();
        assert!(error.to_string().contains("nearest: 'faces'"), "{error}");
        let error = check_keys("a = 1\nfaces = [\n", Path::new("m.toml")).unwrap_err();
        assert!(matches!(error, BatchError::Syntax { .. }), "{error}");
    }
}
