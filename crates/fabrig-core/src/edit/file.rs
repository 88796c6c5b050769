//! The text of edits.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::EditError;
use super::preset::one_or_many;
use crate::atomic_file::write_atomically;

/// Edits of a rig, by name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edits {
    /// Presets that come first, in this order: one name or a list.
    #[serde(
        default,
        deserialize_with = "one_or_many",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub preset: Vec<String>,
    /// By muscle shape: `zygomaticus_major_l.mouthSmileLeft`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub shapes: BTreeMap<String, ShapeEdit>,
    /// By patch, with or without its side.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub patches: BTreeMap<String, PatchEdit>,
    /// By material.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub materials: BTreeMap<String, MaterialEdit>,
    /// Wrinkle maps, by names of the artist's own.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub wrinkles: BTreeMap<String, WrinkleEdit>,
    /// Where the files are that edits name: the folder of their own file.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// What changes about one muscle shape.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeEdit {
    /// Held at this weight in [0, 1], whatever the face does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// Factor of its displacements, at least 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
    /// Displacement of nodes added to the shape's own, before its strength [mm, head frame];
    /// keys are node indices, which TOML wants as text.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub moved: BTreeMap<String, [f64; 3]>,
}

/// What changes about one patch.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatchEdit {
    /// Amplitude against the template, alpha of Eq. 3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alpha: Option<f64>,
    /// Name of its material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// How much thicker a fat pad is in its middle, and how much fuller the face over it. (mm)
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness: Option<f64>,
}

/// Where a wrinkle map is, and what it says where it is white.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WrinkleEdit {
    /// A PNG in the mesh's texture coordinates, or a text of one number in [0, 1] per vertex;
    /// beside the edits unless the path is absolute. Without a map, `patches` are white all over,
    /// but for the lids and lips of rings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<PathBuf>,
    /// Patches that it is for, with or without their side; none named means all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub patches: Vec<String>,
    /// The part of the way along the fibres that it is for, 0 to 1; it fades over a tenth of the
    /// way to either side. Of a ring, from its inner corner over the upper half.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<[f64; 2]>,
    /// Factor of the resistances to stretch, compression and shear.
    #[serde(default = "one")]
    pub stretch: f64,
    /// Factor of the resistance to bending: less makes finer wrinkles.
    #[serde(default = "one")]
    pub bend: f64,
    /// Factor of how far lengths follow the muscle shapes: 0 lets skin that is drawn together
    /// fold.
    #[serde(default)]
    pub rest_blend: f64,
    /// How far skin over these patches hangs on the one right under it, 0 to 1, instead of on the
    /// mean of many nodes, which flattens what is finer than they are.
    #[serde(default = "one")]
    pub narrow: f64,
}

impl WrinkleEdit {
    /// Whether it says where.
    pub(super) fn check(&self, name: &str) -> Result<(), EditError> {
        if self.map.is_none() && self.patches.is_empty() {
            return Err(EditError::Syntax {
                message: format!("[wrinkles.{name}] needs a `map`, or `patches` that fold"),
            });
        }
        Ok(())
    }
}

fn one() -> f64 {
    1.0
}

/// A new material, or changes to one that there is.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MaterialEdit {
    /// The material whose numbers it starts from; its own where it exists already.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub like: Option<String>,
    /// Numbers by the names of `materials.toml`.
    #[serde(flatten)]
    pub numbers: BTreeMap<String, f64>,
}

/// Where the edits of a rig stand: `face.edits.toml` beside `face.fabrig`.
pub fn edits_path(rig: &Path) -> PathBuf {
    rig.with_extension("edits.toml")
}

impl Edits {
    /// Reads edits from text.
    ///
    /// # Errors
    ///
    /// [`EditError::Syntax`]. Whether names exist shows in [`Self::apply`].
    pub fn parse(text: &str) -> Result<Self, EditError> {
        let edits: Self = toml::from_str(text).map_err(|error| EditError::Syntax {
            message: error.to_string().trim().replace('\n', " "),
        })?;
        for (name, edit) in &edits.wrinkles {
            edit.check(name)?;
        }
        Ok(edits)
    }

    /// Reads edits from a file.
    ///
    /// # Errors
    ///
    /// [`EditError::Io`], [`EditError::Syntax`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, EditError> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path).map_err(|source| EditError::Io {
            path: path.to_owned(),
            source,
        })?;
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        Ok(Self {
            folder,
            ..Self::parse(&text)?
        })
    }

    /// The edits beside a rig file; `None` where there are none.
    ///
    /// # Errors
    ///
    /// As [`Self::load`], but for a file that is not there.
    pub fn beside(rig: impl AsRef<Path>) -> Result<Option<Self>, EditError> {
        let path = edits_path(rig.as_ref());
        if path.exists() {
            Self::load(path).map(Some)
        } else {
            Ok(None)
        }
    }

    /// As text, in the order of names: equal edits give equal text.
    ///
    /// # Errors
    ///
    /// [`EditError::Syntax`] for numbers that TOML cannot hold.
    pub fn to_text(&self) -> Result<String, EditError> {
        toml::to_string_pretty(self).map_err(|error| EditError::Syntax {
            message: error.to_string(),
        })
    }

    /// Writes the edits to a file; what stood there stays until the new file is whole.
    ///
    /// # Errors
    ///
    /// [`EditError::Io`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), EditError> {
        let path = path.as_ref();
        let text = self.to_text()?;
        write_atomically(path, |file| file.write_all(text.as_bytes())).map_err(|source| {
            EditError::Io {
                path: path.to_owned(),
                source,
            }
        })
    }

    /// Whether nothing is edited.
    pub fn is_empty(&self) -> bool {
        self.says_same_as(&Self::default())
    }

    /// Whether both say the same, wherever their files stand.
    pub fn says_same_as(&self, other: &Self) -> bool {
        let elsewhere = Self {
            folder: self.folder.clone(),
            ..other.clone()
        };
        *self == elsewhere
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_read_and_written() {
        let text = "[shapes.\"a.b\"]\nstrength = 1.5\n\n[shapes.\"a.b\".moved]\n3 = [0.0, 1.0, 0.0]\n\n\
                    [patches.a]\nalpha = 1.2\nmaterial = \"soft\"\n\n\
                    [materials.soft]\nlike = \"fat\"\nmass = 2\n";
        let edits = Edits::parse(text).unwrap();
        assert_eq!(edits.shapes["a.b"].moved["3"], [0.0, 1.0, 0.0]);
        assert_eq!(edits.materials["soft"].numbers["mass"], 2.0);
        assert_eq!(Edits::parse(&edits.to_text().unwrap()).unwrap(), edits);
        let error = Edits::parse("[shapes.\"a.b\"]\nstrenght = 1\n").unwrap_err();
        assert!(error.to_string().contains("strenght"), "{error}");
        assert_eq!(
            edits_path(Path::new("x/face.fabrig")),
            Path::new("x/face.edits.toml")
        );
    }
}
