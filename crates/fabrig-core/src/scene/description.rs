//! What a scene models, as plain data.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::economy::Economy;
use super::faces::{Placement, RecordingChoice, SceneFace, Simulate};
use super::fields::{HeadDrive, OverTime, RadialForce, Shake, Turbulence};
use super::text::{self, SceneSource};
use crate::Point;
use crate::cloth::{ClothOptions, STANDING_GRAVITY};
use crate::collision::{Collider, ContactOptions, PairMask};
use crate::edit::{MaterialEdit, WrinkleEdit};
use crate::scene::SceneError;

/// Whether patches have mass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dynamics {
    /// Patches are cloth that is drawn to the muscle shapes.
    #[default]
    Cloth,
    /// Patches stand where the muscle shapes want them.
    None,
}

/// What turns the eyeballs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EyeSource {
    /// The weights of the eyeLook shapes, which also move the lids.
    #[default]
    Shapes,
    /// The eye rotations of the take, where it has them; the shapes where it has not.
    Tracked,
}

/// What to model around a rig and its motion.
///
/// Every field is a key of the text, with its meaning and range in `text/schema/`.
///
/// Times are on the scene's axis: seconds from the start of the scene where it has
/// [`faces`](Self::faces), the take's own time where rig and take are given by the caller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// Whether patches have mass.
    pub dynamics: Dynamics,
    /// How the cloth is solved.
    pub cloth: ClothOptions,
    /// Gravity in the world. The face was captured under standing gravity, so only what
    /// differs from that, seen from the head, bends it. (mm/s^2)
    pub gravity: OverTime<Vector3<f32>>,
    /// Velocity of the air in the world, added to the take's own wind. (mm/s)
    pub wind: OverTime<Vector3<f32>>,
    /// Gusts in the wind.
    pub turbulence: Option<Turbulence>,
    /// A shaking of everything around the face.
    pub shake: Option<Shake>,
    /// Pushes away from points, and pulls towards them.
    pub forces: Vec<RadialForce>,
    /// What moves the head: the take, keys, or nothing.
    pub head_motion: HeadDrive,
    /// The point that the head turns about. [mm, head frame]
    pub neck_pivot: Point,
    /// Where the face stands in the world before the head moves.
    pub place: Placement,
    /// What turns the eyeballs.
    pub eyes: EyeSource,
    /// What touches what, and how.
    pub contact: ContactOptions,
    /// Things of the world that the face can touch.
    pub colliders: Vec<Collider>,
    /// Width (standard deviation) over which skin averages what patches do beyond their muscle
    /// shapes, as [`SheetFilter`](crate::skin::SheetFilter) says; 0: not at all. (mm)
    pub skin_smoothing: f64,
    /// Which patches are cloth.
    pub simulate: Simulate,
    /// What may be left out, and how far the result may then be off.
    pub economy: Economy,
    /// Changes to the materials of the rig, and materials of the scene's own, by name.
    pub materials: BTreeMap<String, MaterialEdit>,
    /// Wrinkle maps, by names of the artist's own.
    pub wrinkles: BTreeMap<String, WrinkleEdit>,
    /// Frames a second of the simulation; the take's own when not said. (1/s)
    pub fps: Option<f64>,
    /// How long is simulated; until the last take ends when not said. (s)
    pub duration: Option<f64>,
    /// What is recorded.
    pub recording: RecordingChoice,
    /// Faces with their takes; none where the caller gives rig and take.
    pub faces: Vec<SceneFace>,
    /// Where it was read from; no part of what it says.
    #[serde(skip)]
    pub source: SceneSource,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            dynamics: Dynamics::default(),
            cloth: ClothOptions::default(),
            gravity: STANDING_GRAVITY.into(),
            wind: [0.0; 3].into(),
            turbulence: None,
            shake: None,
            forces: Vec::new(),
            head_motion: HeadDrive::Take(true),
            neck_pivot: Point::new(0.0, -45.0, -20.0),
            place: Placement::default(),
            eyes: EyeSource::default(),
            contact: ContactOptions::default(),
            colliders: Vec::new(),
            skin_smoothing: 3.5,
            simulate: Simulate::default(),
            economy: Economy::default(),
            materials: BTreeMap::new(),
            wrinkles: BTreeMap::new(),
            fps: None,
            duration: None,
            recording: RecordingChoice::default(),
            faces: Vec::new(),
            source: SceneSource::default(),
        }
    }
}

impl Scene {
    /// Whether anything could touch anything in it.
    pub fn has_contact(&self) -> bool {
        let is_asked_for = self.contact.pairs != PairMask::None || !self.colliders.is_empty();
        self.dynamics == Dynamics::Cloth && is_asked_for
    }

    /// Reads a scene from text (TOML); what it leaves out is as by default, and files that it
    /// names are looked for in the working folder.
    ///
    /// ```
    /// let text = "gravity = [0, 0, 0]\n[contact]\npairs = \"all\"\nsticky_lips = {}\n";
    /// let scene = fabrig_core::scene::Scene::from_toml(text)?;
    /// assert!(scene.has_contact());
    /// # Ok::<(), fabrig_core::scene::SceneError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`SceneError::Text`], [`SceneError::UnknownKey`] and [`SceneError::Value`] with line and
    /// column, [`SceneError::At`] around what another module refuses.
    pub fn from_toml(text: &str) -> Result<Self, SceneError> {
        text::from_toml(text, Path::new(""))
    }

    /// As [`Self::from_toml`], from JSON, whose places are the paths of keys.
    ///
    /// # Errors
    ///
    /// As [`Self::from_toml`].
    pub fn from_json(text: &str) -> Result<Self, SceneError> {
        text::from_json(text)
    }

    /// Reads a scene file (TOML); files that it names are looked for beside it.
    ///
    /// # Errors
    ///
    /// [`SceneError::Read`]; as [`Self::from_toml`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path).map_err(|source| SceneError::Read {
            path: path.to_owned(),
            source,
        })?;
        text::from_toml(&text, path.parent().unwrap_or(Path::new("")))
    }

    /// The scene with everything modelled: for measurements of the solver.
    pub fn without_economy(self) -> Self {
        Self {
            economy: Economy::OFF,
            ..self
        }
    }

    /// The default scene without mass: patches stand where the muscle shapes want them.
    pub fn without_dynamics() -> Self {
        Self {
            dynamics: Dynamics::None,
            ..Self::default()
        }
    }
}
