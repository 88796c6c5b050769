//! What a scene models, as plain data.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::Point;
use crate::cloth::{ClothOptions, STANDING_GRAVITY};
use crate::collision::{Collider, ContactOptions, PairMask};
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// Whether patches have mass.
    pub dynamics: Dynamics,
    /// How the cloth is solved.
    pub cloth: ClothOptions,
    /// Gravity in the world. The face was captured under standing gravity, so only what
    /// differs from that, seen from the head, bends it. (mm/s^2)
    pub gravity: Vector3<f32>,
    /// Velocity of the air in the world, added to the take's own wind. (mm/s)
    pub wind: Vector3<f32>,
    /// Whether the take moves the head.
    pub head_motion: bool,
    /// The point that the head turns about. [mm, head frame]
    pub neck_pivot: Point,
    /// What turns the eyeballs.
    pub eyes: EyeSource,
    /// What touches what, and how.
    pub contact: ContactOptions,
    /// Things of the world that the face can touch.
    pub colliders: Vec<Collider>,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            dynamics: Dynamics::default(),
            cloth: ClothOptions::default(),
            gravity: Vector3::from(STANDING_GRAVITY),
            wind: Vector3::zeros(),
            head_motion: true,
            neck_pivot: Point::new(0.0, -45.0, -20.0),
            eyes: EyeSource::default(),
            contact: ContactOptions::default(),
            colliders: Vec::new(),
        }
    }
}

impl Scene {
    /// Whether anything could touch anything in it.
    pub fn has_contact(&self) -> bool {
        let is_asked_for = self.contact.pairs != PairMask::None || !self.colliders.is_empty();
        self.dynamics == Dynamics::Cloth && is_asked_for
    }

    /// Reads a scene from text (TOML); what it leaves out is as by default.
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
    /// [`SceneError::Text`] with line and column, [`SceneError::Collision`] for contact options
    /// or colliders that cannot be.
    pub fn from_toml(text: &str) -> Result<Self, SceneError> {
        let scene = toml::from_str(text).map_err(|e| SceneError::Text {
            reason: e.to_string(),
        })?;
        Self::checked(scene)
    }

    /// As [`Self::from_toml`], from JSON.
    ///
    /// # Errors
    ///
    /// As [`Self::from_toml`].
    pub fn from_json(text: &str) -> Result<Self, SceneError> {
        let scene = serde_json::from_str(text).map_err(|e| SceneError::Text {
            reason: e.to_string(),
        })?;
        Self::checked(scene)
    }

    fn checked(scene: Self) -> Result<Self, SceneError> {
        scene.contact.check()?;
        for (index, collider) in scene.colliders.iter().enumerate() {
            collider.check(index)?;
        }
        Ok(scene)
    }

    /// The default scene without mass: patches stand where the muscle shapes want them.
    pub fn without_dynamics() -> Self {
        Self {
            dynamics: Dynamics::None,
            ..Self::default()
        }
    }
}
