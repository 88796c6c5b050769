//! A scene: patches, and what the cloth is told frame by frame.

use nalgebra::Vector3;

use crate::cloth::{Cloth, ClothError, ClothPatch, FrameInput, HeadMotion, PatchMotion};

/// One frame of a scene, as [`FrameInput`] with arrays of its own.
#[derive(Debug, Clone)]
pub struct SceneFrame {
    /// Duration. (s)
    pub dt: f64,
    /// Motion of the targets, one per patch.
    pub targets: Vec<PatchMotion>,
    /// Motion of the anchors, one per patch, or none at all.
    pub anchors: Vec<PatchMotion>,
    /// Gravity in the head frame; none: as it stands. (mm/s^2)
    pub gravity: Option<Vector3<f32>>,
    /// Velocity of the air in the head frame. (mm/s)
    pub wind: Vector3<f32>,
    /// Motion of the head frame.
    pub head: HeadMotion,
}

impl SceneFrame {
    /// What [`Cloth::step`] takes.
    pub fn input(&self) -> FrameInput<'_> {
        FrameInput {
            dt: self.dt,
            targets: &self.targets,
            anchors: &self.anchors,
            gravity: self.gravity,
            wind: self.wind,
            head: self.head,
            substeps: None,
            held: &[],
        }
    }
}

/// Patches and frames.
#[derive(Debug, Clone)]
pub struct BenchScene {
    /// What it is.
    pub name: String,
    /// The patches.
    pub patches: Vec<ClothPatch>,
    /// Where it starts: the cloth is reset to it.
    pub start: SceneFrame,
    /// The frames.
    pub frames: Vec<SceneFrame>,
}

impl BenchScene {
    /// A scene that starts where the first of `frames` ends and goes through the others.
    ///
    /// # Panics
    ///
    /// If there is no frame.
    pub fn new(name: &str, patches: Vec<ClothPatch>, mut frames: Vec<SceneFrame>) -> Self {
        let start = frames.remove(0);
        Self {
            name: name.to_owned(),
            patches,
            start,
            frames,
        }
    }

    /// How many nodes there are.
    pub fn node_count(&self) -> usize {
        self.patches.iter().map(|p| p.rest.len()).sum()
    }

    /// Puts a cloth at its start.
    ///
    /// # Errors
    ///
    /// As [`Cloth::reset`].
    pub fn place(&self, cloth: &mut Cloth) -> Result<(), ClothError> {
        cloth.reset(&self.start.targets, &self.start.anchors)
    }
}
