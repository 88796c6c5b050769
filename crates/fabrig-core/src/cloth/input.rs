//! What a cloth is made of, and what it is told in each frame.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

pub use crate::anatomy::GridShape;

use super::materials::Material;

/// Standing gravity: down at 9.81 m/s^2. (mm/s^2)
pub const STANDING_GRAVITY: [f32; 3] = [0.0, -9810.0, 0.0];

/// A patch of cloth: a grid of nodes, a material, and what it is attached to.
#[derive(Debug, Clone, PartialEq)]
pub struct ClothPatch {
    /// Its grid.
    pub shape: GridShape,
    /// Neutral positions, one per node. [mm, head frame]
    pub rest: Vec<Point3<f32>>,
    /// Its material.
    pub material: Material,
    /// What it is attached to.
    pub attachments: Vec<ClothAttachment>,
    /// How its nodes differ from the material, one per node; or none, where none does.
    pub variations: Vec<NodeVariation>,
}

/// How the cloth about one node differs from its material: a wrinkle map's word. An edge, a
/// diagonal and a bend take the mean of their nodes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NodeVariation {
    /// Factor of the resistances to stretch, compression and shear, 0.001 to 1,000.
    pub stretch: f32,
    /// Factor of the resistance to bending, 0.001 to 1,000.
    pub bend: f32,
    /// Factor of [`ClothOptions::rest_blend`], 0 to 1: with 0 lengths stay neutral, and skin
    /// that is drawn together has to fold.
    pub rest_blend: f32,
}

impl NodeVariation {
    /// As the material says.
    pub const NONE: Self = Self {
        stretch: 1.0,
        bend: 1.0,
        rest_blend: 1.0,
    };
}

/// Nodes held to something (Eq. 5).
#[derive(Debug, Clone, PartialEq)]
pub enum ClothAttachment {
    /// Nodes held to anchors, whose motion is given with every frame.
    Anchors {
        /// Nodes of this patch.
        nodes: Vec<u32>,
        /// Stiffness relative to the patch's stretch stiffness.
        strength: f64,
    },
    /// Nodes held to nodes of another patch, at the offset that their targets have.
    Patch {
        /// Index of the other patch.
        patch: u32,
        /// (node of this patch, node of the other patch).
        pairs: Vec<(u32, u32)>,
        /// Stiffness relative to the smaller stretch stiffness of the two patches.
        strength: f64,
    },
}

/// How a cloth is solved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClothOptions {
    /// Substeps per 1/60 s; longer frames get more in proportion, up to eight times as many.
    pub substeps: u32,
    /// How far rest lengths follow the targets: 0 = not at all (neutral lengths: wrinkles), 1 =
    /// wholly (target shapes are free of stress). In [0, 1].
    pub rest_blend: f64,
    /// Relative variation of `rest_blend` from edge to edge, which decides how a smooth patch
    /// buckles; up to twelve times as much where [`NodeVariation::rest_blend`] makes skin loose. The
    /// same for every patch, so mirror images stay mirror images.
    pub rest_imperfection: f64,
    /// Seed of that variation.
    pub seed: u64,
    /// Gravity under which the neutral shape is at equilibrium. [mm/s^2, head frame]
    pub standing_gravity: Vector3<f32>,
    /// Mass per area of a patch whose nodes have mass 1, against which the wind works: soft
    /// tissue 10 mm deep. [g/mm^2]
    pub areal_density: f64,
    /// Density of the air. [g/mm^3]
    pub air_density: f64,
    /// Drag coefficient of a cell.
    pub drag: f64,
    /// Lift coefficient of a cell.
    pub lift: f64,
    /// How a substep is solved.
    pub mode: Mode,
    /// Sweeps per substep, at least 1. One is what the substeps are made for; more cost as
    /// much as more substeps do and help less.
    pub sweeps: u32,
    /// Order of the time integrator.
    pub integrator: Integrator,
    /// Arithmetic.
    pub precision: Precision,
}

impl Default for ClothOptions {
    fn default() -> Self {
        Self {
            substeps: 9,
            rest_blend: 0.9,
            rest_imperfection: 0.02,
            seed: 0,
            standing_gravity: Vector3::from(STANDING_GRAVITY),
            areal_density: 0.01,
            air_density: 1.2e-6,
            drag: 1.1,
            lift: 0.3,
            mode: Mode::Fast,
            sweeps: 1,
            integrator: Integrator::Bdf2,
            precision: Precision::Single,
        }
    }
}

/// How a substep is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// XPBD: every constraint is projected in turn.
    Fast,
    /// Vertex block descent, four passes per sweep, in which the energy of a step never rises.
    /// Several times as dear.
    Robust,
    /// Position-based dynamics, Algorithm 1 of the paper: a baseline, whose stiffness depends
    /// on the substeps and whose time stepping is backward Euler.
    Paper,
}

/// How time is stepped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// Backward Euler: first order, damps.
    BackwardEuler,
    /// BDF2, with one backward Euler step at the start and after resets: second order.
    Bdf2,
}

/// Arithmetic of the solver. All compute the same text; single precision has the same bits
/// whatever the lane width and the instruction set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// f32, patches of one shape side by side in SIMD lanes. Positions are rounded to some
    /// 1e-6 mm a substep, whose share in velocities grows as substeps get shorter: cloth that
    /// nothing damps, in 256 of them a frame, is shaken by it as much as by its targets. More
    /// than 64 are a case for [`Precision::Double`].
    Single,
    /// f32, patch by patch.
    SingleScalar,
    /// f64, patches of one shape side by side: the reference.
    Double,
}

/// Where the targets (or the anchors) of one patch are at the end of a frame; the start is
/// where the frame before ended. In between they follow cubic Hermite segments.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PatchMotion {
    /// Positions, one per node (or per anchor). [mm, head frame]
    pub positions: Vec<Point3<f32>>,
    /// Velocities there, as many; or none, for motion straight to the positions. (mm/s)
    pub velocities: Vec<Vector3<f32>>,
}

impl PatchMotion {
    /// At rest in `positions`.
    pub fn still(positions: &[Point3<f32>]) -> Self {
        Self {
            positions: positions.to_vec(),
            velocities: vec![Vector3::zeros(); positions.len()],
        }
    }
}

/// Motion of the head frame at the end of a frame, in its own axes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct HeadMotion {
    /// Acceleration of the origin. (mm/s^2)
    pub linear_acceleration: Vector3<f32>,
    /// (rad/s)
    pub angular_velocity: Vector3<f32>,
    /// (rad/s^2)
    pub angular_acceleration: Vector3<f32>,
}

/// One frame. Gravity, wind and head motion are those at its end; during the frame they go
/// there straight from what they were.
#[derive(Debug, Clone, Copy)]
pub struct FrameInput<'a> {
    /// Duration. (s)
    pub dt: f64,
    /// Motion of the targets, one per patch.
    pub targets: &'a [PatchMotion],
    /// Motion of the anchors, one per patch with the anchors of its attachments in their
    /// order; or none at all, when no anchor moves.
    pub anchors: &'a [PatchMotion],
    /// Gravity in the head frame; none: as it stands. (mm/s^2)
    pub gravity: Option<Vector3<f32>>,
    /// Velocity of the air in the head frame. (mm/s)
    pub wind: Vector3<f32>,
    /// Motion of the head frame.
    pub head: HeadMotion,
    /// Substeps per 1/60 s of this frame alone; none: [`ClothOptions::substeps`].
    pub substeps: Option<u32>,
    /// One per patch, or none at all: patches that may keep their displacement from their targets
    /// through this frame. Where all that share a register may, they sleep: no substep is taken,
    /// and where no target moves nothing is done at all. Without effect where a hook moves nodes.
    pub held: &'a [bool],
}

impl<'a> FrameInput<'a> {
    /// A frame with nothing but targets.
    pub fn new(dt: f64, targets: &'a [PatchMotion]) -> Self {
        Self {
            dt,
            targets,
            anchors: &[],
            gravity: None,
            wind: Vector3::zeros(),
            head: HeadMotion::default(),
            substeps: None,
            held: &[],
        }
    }
}
