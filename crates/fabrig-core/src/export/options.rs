//! How a face is exported.

use std::path::PathBuf;

use crate::motion::Clip;
use crate::scene::Scene;

/// Length of one unit of what is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LengthUnit {
    /// That of the user's mesh: numbers stay as they are.
    Own,
    /// Millimetres.
    Millimetre,
    /// Centimetres.
    Centimetre,
    /// Metres.
    Metre,
    /// Inches.
    Inch,
}

impl LengthUnit {
    /// Its length; `own` for that of the user's mesh. (mm)
    pub(super) fn millimetres(self, own: f64) -> f64 {
        match self {
            Self::Own => own,
            Self::Millimetre => 1.0,
            Self::Centimetre => 10.0,
            Self::Metre => 1000.0,
            Self::Inch => 25.4,
        }
    }
}

/// What a morph target is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeSource {
    /// The skin once the cloth has settled on the shape: what a simulation holds.
    #[default]
    Settled,
    /// The skin with the patches right on their muscle shapes: much quicker.
    Targets,
}

/// How a rig is exported.
#[derive(Debug, Clone)]
pub struct ExportOptions {
    /// Name of the face in the file.
    pub name: String,
    /// Unit of lengths; the usual one of the format when `None`: metres for glTF, the user's
    /// own elsewhere.
    pub unit: Option<LengthUnit>,
    /// What morph targets are taken from.
    pub shapes: ShapeSource,
    /// The mesh that the rig was made from, for its materials and textures.
    pub source: Option<PathBuf>,
    /// A take, which becomes an animation.
    pub motion: Option<Clip>,
    /// Name of the take in the file.
    pub motion_name: String,
    /// Whether the take is simulated and the vertices of every frame are written, instead of
    /// the weights of the shapes.
    pub baked: bool,
    /// Frames a second of the animation; the scene's or else the take's own when `None`. (1/s)
    pub fps: Option<f64>,
    /// Whether head motion is left out.
    pub still_head: bool,
    /// Morph targets that a baked glTF gets; as many as [`Self::basis_tolerance`] needs when
    /// `None`.
    pub components: Option<usize>,
    /// Largest root mean square error over a frame of a baked glTF. (mm)
    pub basis_tolerance: f64,
    /// What is modelled when a take is simulated.
    pub scene: Scene,
    /// Whether the sum of morph targets is compared with the simulation, over the take or the
    /// bundled one.
    pub check_sum: bool,
}

impl Default for ExportOptions {
    fn default() -> Self {
        Self {
            name: "face".to_owned(),
            unit: None,
            shapes: ShapeSource::default(),
            source: None,
            motion: None,
            motion_name: "take".to_owned(),
            baked: false,
            fps: None,
            still_head: false,
            components: None,
            basis_tolerance: 0.02,
            scene: Scene::default(),
            check_sum: true,
        }
    }
}
