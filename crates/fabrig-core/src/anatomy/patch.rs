//! The patch: a grid of nodes charted on the template and laid under a face.

use serde::{Deserialize, Serialize};

use crate::Point;
use crate::template::RigidBody;

/// What a patch models; materials and constraints differ by kind (paper, Table 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PatchKind {
    /// A muscle that pulls from origin to insertion.
    LinearMuscle,
    /// A ring muscle around an opening.
    Sphincter,
    /// A pad of fat, held by pressure.
    FatPad,
}

/// Which side of the face a patch lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The character's left, +X; names end in `_l`.
    Left,
    /// The character's right, -X; names end in `_r`.
    Right,
    /// On the mid plane.
    Mid,
}

/// Size and topology of a grid. Node (u, v) stands at index `v * u_count + u`.
///
/// u runs along the fibres from origin to insertion (around the opening for a sphincter,
/// where it is periodic), v across them (from the opening outwards for a sphincter).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct GridShape {
    /// Nodes along the fibres.
    pub u_count: u32,
    /// Nodes across the fibres.
    pub v_count: u32,
    /// Whether column `u_count - 1` is followed by column 0.
    pub is_periodic: bool,
}

impl GridShape {
    /// How many nodes there are.
    pub fn node_count(self) -> usize {
        self.u_count as usize * self.v_count as usize
    }

    /// Index of node (u, v).
    pub fn index(self, u: u32, v: u32) -> usize {
        (v * self.u_count + u) as usize
    }

    /// Quads of the grid as node indices, counter-clockwise when u x v points outwards.
    pub fn quads(self) -> Vec<[u32; 4]> {
        let columns = if self.is_periodic {
            self.u_count
        } else {
            self.u_count.saturating_sub(1)
        };
        let mut quads = Vec::new();
        for v in 0..self.v_count.saturating_sub(1) {
            for u in 0..columns {
                let next = (u + 1) % self.u_count;
                quads.push([
                    v * self.u_count + u,
                    v * self.u_count + next,
                    (v + 1) * self.u_count + next,
                    (v + 1) * self.u_count + u,
                ]);
            }
        }
        quads
    }
}

/// A point under the template's skin: a place on a triangle, and a depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SurfaceNode {
    /// Triangle of [`crate::mesh::Mesh::triangles`] of the template's skin.
    pub triangle: u32,
    /// Barycentric coordinates on it.
    pub barycentric: [f64; 3],
    /// Depth under the skin along the inward normal. [mm on the template]
    pub depth: f64,
}

/// Nodes of a patch that are held to something else (Eq. 5).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Attachment {
    /// Nodes held to a rigid body where they lie at rest.
    Body {
        /// The body.
        body: RigidBody,
        /// Node indices of this patch.
        nodes: Vec<u32>,
        /// Stiffness relative to stretch, 0 = none, 1 = as stiff as the fibre.
        strength: f64,
    },
    /// Nodes held to places on another patch, keeping the offset at rest.
    Patch {
        /// Index of the other patch.
        patch: u32,
        /// (node of this patch, node of the other patch).
        pairs: Vec<(u32, u32)>,
        /// Stiffness relative to stretch.
        strength: f64,
    },
}

/// A patch on the template: what every face shares.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PatchChart {
    /// `zygomaticus_major_l`, `orbicularis_oris`, `malar_fat_r`, ...
    pub name: String,
    /// What it models.
    pub kind: PatchKind,
    /// Where it lies.
    pub side: Side,
    /// Its grid.
    pub grid: GridShape,
    /// One node per grid point.
    pub nodes: Vec<SurfaceNode>,
    /// Name of its material in `materials.toml`.
    pub material: String,
    /// What it is held to.
    pub attachments: Vec<Attachment>,
    /// sRGB colour for pictures and viewers.
    pub color: [u8; 3],
    /// Index of its mirror image; itself for a midline patch.
    pub mirror: u32,
}

/// A patch laid under one face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Patch {
    /// The chart it comes from.
    pub chart: PatchChart,
    /// Neutral positions b_0 (Eq. 1), one per grid node. [mm, head frame]
    pub neutral: Vec<Point>,
}
