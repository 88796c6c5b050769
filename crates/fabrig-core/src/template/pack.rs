//! What a template pack holds once it is in memory.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::mesh::Mesh;
use crate::{Point, Vector};

/// Names of points on the template's skin: name -> vertex index.
///
/// Names are `snake_case`, with `_l` / `_r` for the character's left (+X) and right.
pub type Landmarks = BTreeMap<String, u32>;

/// Index of a region in [`Regions::regions`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct RegionId(pub u8);

/// A labelled part of the skin.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Region {
    /// `upper_lip`, `lower_lip`, `upper_lid_l`, `lower_lid_l`, `socket_l`, `mouth_interior`,
    /// `jaw`, `ear_l`, `neck`, `scalp`, `face`, ...
    pub name: String,
    /// Regions that this one must never be matched, bound or bridged to (the other lip, the
    /// other lid of the same eye).
    pub apart_from: Vec<RegionId>,
}

/// A label for every vertex of the skin.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Regions {
    /// The regions there are.
    pub regions: Vec<Region>,
    /// Region of each skin vertex, length = vertex count.
    pub vertex_regions: Vec<RegionId>,
}

impl Regions {
    /// The region called `name`.
    pub fn find(&self, name: &str) -> Option<RegionId> {
        self.regions
            .iter()
            .position(|r| r.name == name)
            .map(|i| RegionId(i as u8))
    }

    /// Whether two regions must never be matched or bridged.
    pub fn are_apart(&self, a: RegionId, b: RegionId) -> bool {
        self.regions[a.0 as usize].apart_from.contains(&b)
            || self.regions[b.0 as usize].apart_from.contains(&a)
    }
}

/// A rigid body of the head that other things hang on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RigidBody {
    /// The head itself; moves with the head motion only.
    Skull,
    /// The lower jaw; turns about the hinge of [`JawHinge`].
    Mandible,
    /// The left eyeball (+X).
    EyeLeft,
    /// The right eyeball (-X).
    EyeRight,
}

impl RigidBody {
    /// The body on the other side of the head.
    pub fn mirrored(self) -> Self {
        match self {
            Self::Skull | Self::Mandible => self,
            Self::EyeLeft => Self::EyeRight,
            Self::EyeRight => Self::EyeLeft,
        }
    }
}

/// A part that is not skin: eyeball, teeth, tongue.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigidPart {
    /// `eye_l`, `eye_r`, `upper_teeth`, `lower_teeth`, `tongue`.
    pub name: String,
    /// What it moves with.
    pub follows: RigidBody,
    /// Its surface at rest. (mm)
    pub mesh: Mesh,
}

/// The temporomandibular hinge: the mandible turns about this axis by `open_angle * jawOpen`
/// and slides by the translations of `jawForward`, `jawLeft` and `jawRight`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct JawHinge {
    /// A point on the axis, in the mid plane. (mm)
    pub center: Point,
    /// Unit direction, +X for an upright symmetric head; turning by a positive angle about it
    /// opens the mouth (right-hand rule: +Y towards +Z, so the chin goes down and back is a
    /// positive turn).
    pub axis: Vector,
    /// Angle at `jawOpen` = 1. (rad)
    pub open_angle: f64,
    /// Translation of the mandible at `jawForward` = 1. (mm)
    pub forward: Vector,
    /// Translation of the mandible at `jawLeft` = 1; `jawRight` is its mirror. (mm)
    pub left: Vector,
}

/// The sphere that an eyeball is, and how far it turns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EyeSocket {
    /// Centre of rotation. (mm)
    pub center: Point,
    /// Radius of the fitted sphere. (mm)
    pub radius: f64,
    /// Angles at weight 1 of eyeLookUp, eyeLookDown, eyeLookIn, eyeLookOut. (rad)
    pub look_angles: [f64; 4],
}

/// A whole-face shape, as differences from the neutral skin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WholeFaceShape {
    /// ARKit name (`jawOpen`, ...) or the pack's own.
    pub name: String,
    /// Vertices that move and by how much at weight 1, vertex indices rising. (mm)
    pub deltas: Vec<(u32, Vector)>,
}

impl WholeFaceShape {
    /// The displacement of every vertex of a skin of so many. (mm)
    pub fn spread(&self, vertex_count: usize) -> Vec<Vector> {
        let mut deltas = vec![Vector::zeros(); vertex_count];
        for &(vertex, delta) in &self.deltas {
            deltas[vertex as usize] = delta;
        }
        deltas
    }
}

/// A template: skin, labels, rigid parts, shapes. Patch layout, action units and materials
/// are read by the modules that use them from the text beside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Template {
    /// Name of the pack.
    pub name: String,
    /// Version of the pack's contents.
    pub version: u32,
    /// Whose work the pack stands on, and under which licence.
    pub credit: String,
    /// Neutral skin; its polygon fans are exact mirrors of each other. (mm)
    pub skin: Mesh,
    /// For each skin vertex its mirror image at (-x, y, z); itself on the mid plane (x = 0).
    pub mirror: Vec<u32>,
    /// A label for every skin vertex.
    pub regions: Regions,
    /// Named points of the skin.
    pub landmarks: Landmarks,
    /// Where each landmark is, in words, by name; left ones speak for their mirror images.
    pub landmark_meanings: BTreeMap<String, String>,
    /// How people differ, largest first, mirror symmetric: one vector per skin vertex each; may
    /// be empty. (mm per standard deviation)
    pub identity_modes: Vec<Vec<Vector>>,
    /// Eyeballs, teeth, tongue.
    pub rigid_parts: Vec<RigidPart>,
    /// Whole-face shapes in the pack's order (ARKit's 52 first).
    pub shapes: Vec<WholeFaceShape>,
    /// Deltas of each shape on the rigid parts that deform (tongueOut moves the tongue):
    /// (shape index, part index, one vector per part vertex). (mm)
    pub part_deltas: Vec<(u32, u32, Vec<Vector>)>,
    /// The jaw.
    pub jaw: JawHinge,
    /// Left eye, right eye.
    pub eyes: [EyeSocket; 2],
    /// Text of `patches.toml`: outlines and fibre directions of every patch.
    pub patch_layout: String,
    /// Text of `action_units.toml`: FACS action units as weights of the shapes.
    pub action_units: String,
    /// Text of `materials.toml`: cloth materials by name.
    pub materials: String,
    /// Bytes of `skin_weights.bin`: skin weights fitted beforehand; empty where the pack has
    /// none.
    pub skin_weights: Vec<u8>,
}

impl Template {
    /// Position of a landmark on the neutral template. (mm)
    pub fn landmark(&self, name: &str) -> Option<Point> {
        self.landmarks
            .get(name)
            .map(|&v| self.skin.positions()[v as usize])
    }

    /// One vertex of each mirrored pair, and those on the mid plane, rising.
    pub fn one_half(&self) -> Vec<usize> {
        (0..self.mirror.len())
            .filter(|&v| v <= self.mirror[v] as usize)
            .collect()
    }

    /// Index of the shape called `name`.
    pub fn shape_index(&self, name: &str) -> Option<usize> {
        self.shapes.iter().position(|s| s.name == name)
    }
}
