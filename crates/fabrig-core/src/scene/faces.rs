//! Faces of a scene: what is theirs alone.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

use super::fields::HeadDrive;
use super::{Scene, SceneError};
use crate::edit::{EditError, Edits, MaterialEdit, WrinkleEdit};
use crate::recording::{RecordedKind, RecordingOptions};
use crate::rig::Rig;

/// Where a face stands in the world.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Placement {
    /// Of the origin of the head frame. (mm)
    pub position: Vector3<f64>,
    /// Turn about that origin: an axis times an angle. `[-1.5708, 0, 0]` lies the face on its
    /// back. (rad)
    pub turn: Vector3<f64>,
}

impl Default for Placement {
    fn default() -> Self {
        Self {
            position: Vector3::zeros(),
            turn: Vector3::zeros(),
        }
    }
}

impl Placement {
    /// From where the face was captured to the world; none where that is the same.
    pub(super) fn to_world(self) -> Option<Isometry3<f64>> {
        (self != Self::default()).then(|| Isometry3::new(self.position, self.turn))
    }
}

/// Which patches are cloth. The others stand exactly where the muscle shapes want them and touch
/// nothing; what is attached to them is held where its own shapes want it.
///
/// A name may hold `*` for any letters: `frontalis_*`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Simulate {
    /// Only these; all where none is named.
    pub only: Vec<String>,
    /// Not these.
    pub except: Vec<String>,
}

impl Simulate {
    /// Whether each of these patches is cloth.
    ///
    /// # Errors
    ///
    /// The first name that no patch has: in which list it stands, and where.
    pub(super) fn choose(&self, patches: &[&str]) -> Result<Vec<bool>, (&'static str, usize)> {
        for (list, names) in [("only", &self.only), ("except", &self.except)] {
            let fits_none = |name: &String| !patches.iter().any(|patch| fits(name, patch));
            if let Some(index) = names.iter().position(fits_none) {
                return Err((list, index));
            }
        }
        let is_in = |names: &[String], patch: &str| names.iter().any(|name| fits(name, patch));
        let chosen = patches.iter().map(|patch| {
            (self.only.is_empty() || is_in(&self.only, patch)) && !is_in(&self.except, patch)
        });
        Ok(chosen.collect())
    }
}

/// Whether a name fits a pattern, in which `*` stands for any letters.
fn fits(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| name.strip_prefix(first)) else {
        return false;
    };
    let Some(last) = pattern.contains('*').then(|| parts.next_back()).flatten() else {
        return rest.is_empty();
    };
    for part in parts {
        let Some(at) = rest.find(part) else {
            return false;
        };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

/// What is recorded, where a scene says it; the rest is as by default.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordingChoice {
    /// Only these things; the usual ones when not said.
    pub record: Option<Vec<RecordedKind>>,
    /// Skin meshes, 0 for none. (1/s)
    pub skin_hz: Option<f64>,
    /// Patch meshes, 0 for none. (1/s)
    pub patches_hz: Option<f64>,
    /// Point clouds, 0 for none. (1/s)
    pub points_hz: Option<f64>,
    /// Patch meshes coloured by their stretch, 0 for none. (1/s)
    pub strain_hz: Option<f64>,
}

impl RecordingChoice {
    /// This choice, and what it leaves open as `other` says.
    #[must_use]
    pub fn or(self, other: &Self) -> Self {
        Self {
            record: self.record.or_else(|| other.record.clone()),
            skin_hz: self.skin_hz.or(other.skin_hz),
            patches_hz: self.patches_hz.or(other.patches_hz),
            points_hz: self.points_hz.or(other.points_hz),
            strain_hz: self.strain_hz.or(other.strain_hz),
        }
    }

    /// What is written how often.
    pub fn options(&self) -> RecordingOptions {
        let mut options = RecordingOptions::default();
        for (asked, rate) in [
            (self.skin_hz, &mut options.skin_hz),
            (self.patches_hz, &mut options.patches_hz),
            (self.points_hz, &mut options.points_hz),
            (self.strain_hz, &mut options.strain_hz),
        ] {
            *rate = asked.unwrap_or(*rate);
        }
        match &self.record {
            Some(kinds) => options.only(kinds),
            None => options,
        }
    }
}

/// A face of a scene: its rig, its take, and what differs from the rest of the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneFace {
    /// Its name, one of its kind in the scene; that of the rig's file when empty.
    pub name: String,
    /// The rig, as `fabrig rig` makes it, or a mesh, which is rigged first as that does by itself;
    /// beside the scene file unless the path is absolute.
    pub rig: PathBuf,
    /// How fine the patches of a mesh become, as [`PatchDetail`](crate::pipeline::PatchDetail) reads
    /// it: `standard`, `0.3mm`, `900px`.
    pub resolution: Option<String>,
    /// The take; without one the face is at rest but for what acts on it.
    pub motion: Option<PathBuf>,
    /// Edits of the rig; those beside the rig when not said.
    pub edits: Option<PathBuf>,
    /// Where its head frame's origin stands in the world. (mm)
    pub position: Vector3<f64>,
    /// Turn about that: an axis times an angle. (rad)
    pub turn: Vector3<f64>,
    /// When the take begins on the scene's axis; before that its first frame holds, and after its
    /// end the last. (s)
    pub start: f64,
    /// How fast the take is played: 0.5 takes twice as long.
    pub speed: f64,
    /// What moves its head; the scene's when not said.
    pub head_motion: Option<HeadDrive>,
    /// Which of its patches are cloth; the scene's when not said.
    pub simulate: Option<Simulate>,
    /// Changes to its materials, after the scene's.
    pub materials: BTreeMap<String, MaterialEdit>,
    /// Wrinkle maps of its own, besides the scene's.
    pub wrinkles: BTreeMap<String, WrinkleEdit>,
}

impl Default for SceneFace {
    fn default() -> Self {
        let Placement { position, turn } = Placement::default();
        Self {
            name: String::new(),
            rig: PathBuf::new(),
            resolution: None,
            motion: None,
            edits: None,
            position,
            turn,
            start: 0.0,
            speed: 1.0,
            head_motion: None,
            simulate: None,
            materials: BTreeMap::new(),
            wrinkles: BTreeMap::new(),
        }
    }
}

impl SceneFace {
    /// Its name, or that of the rig's file.
    pub fn display_name(&self) -> String {
        if !self.name.is_empty() {
            return self.name.clone();
        }
        let stem = self.rig.file_stem().map(|stem| stem.to_string_lossy());
        stem.unwrap_or_default().into_owned()
    }
}

impl Scene {
    /// The scene as one of its faces sees it: with that face's own settings, and no others.
    pub fn for_face(&self, index: usize) -> Self {
        let mut own = Self {
            faces: Vec::new(),
            ..self.clone()
        };
        let Some(face) = self.faces.get(index) else {
            return own;
        };
        own.source = self.source.of_face(index);
        own.place = Placement {
            position: face.position,
            turn: face.turn,
        };
        if let Some(head) = &face.head_motion {
            own.head_motion = head.clone();
        }
        if let Some(simulate) = &face.simulate {
            own.simulate = simulate.clone();
        }
        for (name, edit) in &face.materials {
            let kept = own.materials.entry(name.clone()).or_default();
            kept.like = edit.like.clone().or_else(|| kept.like.take());
            kept.numbers.extend(edit.numbers.clone());
        }
        own.wrinkles.extend(face.wrinkles.clone());
        own
    }

    /// A rig with the scene's materials and wrinkle maps; the rig itself where it has none.
    ///
    /// # Errors
    ///
    /// [`SceneError::At`] around what is wrong with a material or a map.
    pub(super) fn dressed(&self, rig: Arc<Rig>) -> Result<Arc<Rig>, SceneError> {
        if self.materials.is_empty() && self.wrinkles.is_empty() {
            return Ok(rig);
        }
        let mut dressed = Rig::clone(&rig);
        // One by one, so that what is wrong can be placed.
        let materials = self.materials.iter().map(|(name, edit)| {
            let mut edits = Edits::default();
            edits.materials.insert(name.clone(), edit.clone());
            (format!("materials.{name}"), edits)
        });
        let wrinkles = self.wrinkles.iter().map(|(name, edit)| {
            let mut edits = Edits::default();
            edits.wrinkles.insert(name.clone(), edit.clone());
            (format!("wrinkles.{name}"), edits)
        });
        for (key, mut edits) in materials.chain(wrinkles) {
            edits.folder = self.source.folder().to_owned();
            edits
                .apply(&mut dressed)
                .map_err(|error| self.source.at(&key, error))?;
        }
        Ok(Arc::new(dressed))
    }

    /// A path that the scene names, from where it was read.
    pub fn path_of(&self, path: &Path) -> PathBuf {
        self.source.folder().join(path)
    }
}

impl From<EditError> for SceneError {
    fn from(error: EditError) -> Self {
        Self::Edit(Box::new(error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_fit_names() {
        for (pattern, name, expected) in [
            ("frontalis_l", "frontalis_l", true),
            ("frontalis_l", "frontalis_lr", false),
            ("frontalis_*", "frontalis_r", true),
            ("*_l", "frontalis_l", true),
            ("*_l", "frontalis_r", false),
            ("*fat*", "malar_fat_l", true),
            ("*", "", true),
            ("a*a", "a", false),
            ("a*b*a", "axxbya", true),
            ("", "a", false),
        ] {
            assert_eq!(fits(pattern, name), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn patches_are_chosen_by_name() {
        let patches = ["frontalis_l", "frontalis_r", "malar_fat_l"];
        let choose = |only: &[&str], except: &[&str]| {
            let words = |list: &[&str]| list.iter().map(|&n| n.to_owned()).collect();
            Simulate {
                only: words(only),
                except: words(except),
            }
            .choose(&patches)
        };
        assert_eq!(choose(&[], &[]), Ok(vec![true; 3]));
        assert_eq!(
            choose(&["frontalis_*"], &["*_r"]),
            Ok(vec![true, false, false])
        );
        assert_eq!(choose(&["malar_fat_l", "nose"], &[]), Err(("only", 1)));
        assert_eq!(choose(&[], &["*_x"]), Err(("except", 0)));
    }

    #[test]
    fn a_face_sees_its_own_settings_over_those_of_the_scene() {
        let text = "[materials.fat]\nstretch_resistance = 4\nmass = 2\n\
                    [[faces]]\nrig = \"ann.fabrig\"\nposition = [100, 0, 0]\n\
                    head_motion = false\nsimulate = { only = [\"a\"] }\n\
                    materials = { fat = { mass = 3 } }\n[[faces]]\nrig = \"bob.fabrig\"\n";
        let scene = Scene::from_toml(text).unwrap();
        let [ann, bob] = [0, 1].map(|face| scene.for_face(face));
        assert_eq!(ann.materials["fat"].numbers["mass"], 3.0);
        assert_eq!(ann.materials["fat"].numbers["stretch_resistance"], 4.0);
        assert_eq!(bob.materials["fat"].numbers["mass"], 2.0);
        assert_eq!(ann.head_motion, HeadDrive::Take(false));
        assert_eq!(bob.head_motion, HeadDrive::Take(true));
        assert_eq!(ann.place.position.x, 100.0);
        assert_eq!(bob.place.to_world(), None);
        assert_eq!((ann.simulate.only.len(), bob.simulate.only.len()), (1, 0));
        assert_eq!(scene.faces[0].display_name(), "ann");
    }
}
