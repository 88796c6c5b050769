//! Edits by name: looser and firmer skin, more fat and less.
//!
//! # Source
//!
//! Zhu & Joslin 2024, section 6: faces by age and body mass, as materials of the same patches.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize};

use super::{EditError, Edits};
use crate::facs::nearest_name;
use crate::rig::Rig;

const TEXT: &str = include_str!("presets.toml");

/// Presets that name each other go no deeper than this.
const DEEPEST: u32 = 4;

/// A preset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Preset {
    /// What it makes of a face, in a line.
    pub about: String,
    /// What it changes.
    pub edits: Edits,
}

/// Every preset by its name.
///
/// # Errors
///
/// [`EditError::Syntax`]: never with the presets that this build brings, as tests see to.
pub fn presets() -> Result<BTreeMap<String, Preset>, EditError> {
    toml::from_str(TEXT).map_err(|error| EditError::Syntax {
        message: error.to_string(),
    })
}

/// Applies a preset to a rig.
///
/// # Errors
///
/// [`EditError::UnknownPreset`], and what its edits say of a rig of another template.
pub fn apply_preset(rig: &mut Rig, name: &str) -> Result<(), EditError> {
    apply_to_depth(rig, name, 0)
}

pub(super) fn apply_to_depth(rig: &mut Rig, name: &str, depth: u32) -> Result<(), EditError> {
    let presets = presets()?;
    let unknown = || {
        let names = presets.keys().map(String::as_str);
        EditError::UnknownPreset {
            found: name.to_owned(),
            nearest: nearest_name(name, names).unwrap_or_default().to_owned(),
            known: presets.keys().cloned().collect::<Vec<_>>().join(", "),
        }
    };
    let preset = presets.get(name).ok_or_else(unknown)?;
    if depth > DEEPEST {
        return Err(unknown());
    }
    preset.edits.apply_at(rig, depth + 1)
}

/// One name, or a list of them.
pub(super) fn one_or_many<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Names {
        One(String),
        Many(Vec<String>),
    }
    Ok(match Names::deserialize(from)? {
        Names::One(name) => vec![name],
        Names::Many(names) => names,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_read_and_name_each_other() {
        let presets = presets().unwrap();
        for name in ["looser_skin", "firmer_skin", "more_fat", "less_fat", "aged"] {
            assert!(!presets[name].about.is_empty());
        }
        for preset in presets.values().flat_map(|p| &p.edits.preset) {
            assert!(presets.contains_key(preset));
        }
        let one = Edits::parse("preset = \"aged\"\n").unwrap();
        assert_eq!(one, Edits::parse("preset = [\"aged\"]\n").unwrap());
        assert_eq!(Edits::parse(&one.to_text().unwrap()).unwrap(), one);
    }
}
