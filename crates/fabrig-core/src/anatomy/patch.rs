//! The patch: a grid of nodes charted on the template and laid under a face.

use serde::{Deserialize, Serialize};

use crate::template::RigidBody;
use crate::{Point, Vector};

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

impl SurfaceNode {
    /// Values at the skin's vertices blended at this node.
    ///
    /// Terms are added by falling weight, so that a node and its mirror image round alike.
    pub fn blend(&self, triangles: &[[u32; 3]], values: &[Vector]) -> Vector {
        let corners = triangles[self.triangle as usize];
        let mut order = [0, 1, 2];
        order.sort_by(|&a: &usize, &b| self.barycentric[b].total_cmp(&self.barycentric[a]));
        order
            .iter()
            .map(|&k| values[corners[k] as usize] * self.barycentric[k])
            .sum()
    }
}

/// How many nodes the grids have.
///
/// Counts across are even and counts around an opening multiples of four, so that no node
/// lies on the mid plane and every node has a mirror image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Resolution {
    /// Nodes along and across the fibres of linear muscles and fat pads.
    pub sheet: [u32; 2],
    /// Nodes around and outwards of sphincters.
    pub ring: [u32; 2],
}

impl Resolution {
    /// 2,010 nodes with the default layout.
    pub const COARSE: Self = Self {
        sheet: [7, 6],
        ring: [16, 6],
    };
    /// 19,380 nodes with the default layout, as the paper has.
    pub const STANDARD: Self = Self {
        sheet: [21, 20],
        ring: [48, 15],
    };
    /// 50,080 nodes with the default layout.
    pub const FINE: Self = Self {
        sheet: [34, 32],
        ring: [76, 24],
    };
    /// 200,320 nodes with the default layout.
    pub const FINEST: Self = Self {
        sheet: [68, 64],
        ring: [152, 48],
    };

    /// The grid of a patch of this kind.
    pub fn grid(self, kind: PatchKind) -> GridShape {
        let is_periodic = kind == PatchKind::Sphincter;
        let [u_count, v_count] = if is_periodic { self.ring } else { self.sheet };
        GridShape {
            u_count,
            v_count,
            is_periodic,
        }
    }
}

impl Default for Resolution {
    fn default() -> Self {
        Self::STANDARD
    }
}

/// Nodes of a patch that are held to something else (Eq. 5).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Attachment {
    /// Nodes held to a rigid body where they lie at rest; those that the muscle shapes draw
    /// along the bone are held where the shapes put them (told on each face by its scene).
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
///
/// The right patch of a pair has the same (u, v) as the left, mirrored: its quads, as
/// [`GridShape::quads`] lists them, wind clockwise seen from outside; see [`Self::quads`].
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

impl PatchChart {
    /// The node of the mirror image (of patch [`Self::mirror`]) that is this node's image.
    pub fn mirror_node(&self, node: usize) -> usize {
        if self.side != Side::Mid {
            return node;
        }
        let (u_count, v_count) = (self.grid.u_count as usize, self.grid.v_count as usize);
        let (u, v) = (node % u_count, node / u_count);
        if self.grid.is_periodic {
            v * u_count + (u_count + u_count / 2 - 1 - u) % u_count
        } else {
            (v_count - 1 - v) * u_count + u
        }
    }

    /// Quads of the grid, counter-clockwise seen from outside on either side.
    pub fn quads(&self) -> Vec<[u32; 4]> {
        let mut quads = self.grid.quads();
        if self.side == Side::Right {
            for quad in &mut quads {
                quad.reverse();
            }
        }
        quads
    }
}

/// A patch laid under one face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Patch {
    /// The chart it comes from.
    pub chart: PatchChart,
    /// Neutral positions b_0 (Eq. 1), one per grid node. [mm, head frame]
    pub neutral: Vec<Point>,
}
