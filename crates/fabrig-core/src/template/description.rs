//! `template.toml`: what a pack is called, its landmarks and regions, and how it is built.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::TemplateError;

/// The text of `template.toml`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Description {
    /// Name of the pack.
    pub(super) name: String,
    /// Version of the pack's contents.
    pub(super) version: u32,
    /// Whose work it stands on.
    pub(super) credit: String,
    /// How it is made from source data; absent in a pack that is not built here.
    pub(super) build: Option<BuildRecipe>,
    /// Named points, by name; those that end in `_l` are mirrored to `_r`.
    pub(super) landmarks: BTreeMap<String, LandmarkEntry>,
    /// Labelled parts, painted in this order, later over earlier.
    pub(super) regions: Vec<RegionEntry>,
}

/// A named point of the skin.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LandmarkEntry {
    /// Vertex of the skin.
    pub(super) vertex: u32,
    /// Where it is, in words.
    pub(super) meaning: String,
}

/// A labelled part of the skin and the rule that says where it is.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RegionEntry {
    /// Name; one that ends in `_l` is mirrored to `_r`.
    pub(super) name: String,
    /// Regions that it must never be matched or bridged to.
    #[serde(default)]
    pub(super) apart_from: Vec<String>,
    /// Landmarks of a closed outline, joined by the shortest ways along edges. Empty: the
    /// whole skin.
    #[serde(default)]
    pub(super) outline: Vec<String>,
    /// A landmark inside the outline: the region spreads from it along edges up to the outline.
    pub(super) inside: Option<String>,
    /// Whether the outline's own vertices belong to the region.
    #[serde(default)]
    pub(super) with_outline: bool,
}

/// How a pack is made from the MakeHuman base mesh and its targets.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BuildRecipe {
    /// Source vertex on the mid plane at the front of the neck where the head is cut off; the
    /// cut follows the edge loop through it.
    pub(super) neck_vertex: u32,
    /// Length of one source unit. (mm)
    pub(super) millimetres_per_unit: f64,
    /// Landmark pair whose midpoint is the origin of the head frame.
    pub(super) origin: String,
    /// Angles of eyeLookUp, eyeLookDown, eyeLookIn and eyeLookOut at weight 1. (degrees)
    pub(super) look_degrees: [f64; 4],
    /// Names of the whole-face shapes in the pack's order.
    pub(super) shapes: Vec<String>,
    /// Shapes that open the jaw, push it forward and to the left.
    pub(super) jaw_shapes: [String; 3],
    /// Shape that puts the tongue out.
    pub(super) tongue_shape: String,
    /// Shapes that are made stronger or weaker than in the source, and by how much.
    #[serde(default)]
    pub(super) gain: BTreeMap<String, f64>,
    /// How the lids are put right.
    pub(super) lids: LidRecipe,
    /// Half the width of the blend between shapes of the left and of the right. (mm)
    pub(super) side_blend: f64,
    /// How shapes are smoothed.
    pub(super) fairing: FairingRecipe,
    /// How wide the lips stand open.
    pub(super) aperture: ApertureRecipe,
    /// How the lips are put right.
    pub(super) lips: LipRecipe,
    /// How inner skin is kept still.
    pub(super) linings: LiningRecipe,
    /// Targets and how much of each makes the identity.
    pub(super) identity: BTreeMap<String, f64>,
}

/// How shapes are corrected at the lids.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LidRecipe {
    /// Shapes under which the lids meet.
    pub(super) closing: Vec<String>,
    /// What stays open between closed lids. (mm)
    pub(super) gap: f64,
    /// Lids keep the distance from the eyeball that they have at rest, up to this. (mm)
    pub(super) clearance: f64,
    /// How far from the margin corrections reach. (mm)
    pub(super) reach: f64,
    /// Shapes whose lids are smoothed, and the length below which waves go. (mm)
    pub(super) smoothing: BTreeMap<String, f64>,
    /// How much nearer to the eyeball's centre the next ring of the margin must be. (mm)
    pub(super) ring_step: f64,
}

/// How shapes are smoothed.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FairingRecipe {
    /// Shapes and the length below which waves in them go. (mm)
    pub(super) lengths: BTreeMap<String, f64>,
    /// How much the lips count against other skin.
    pub(super) lips: f64,
    /// Shapes whose lips are smoothed like other skin.
    pub(super) free_lips: Vec<String>,
    /// Over which distance from the lips that fades. (mm)
    pub(super) lips_reach: f64,
    /// How much the mouth cavity counts: little, so that it follows the lips smoothly.
    pub(super) cavity: f64,
    /// Shapes that push skin together, and how high it rises where all its area is lost. (mm)
    pub(super) bulge: BTreeMap<String, f64>,
    /// The length below which waves in such a bulge go. (mm)
    pub(super) bulge_length: f64,
}

/// How far the lips stand apart under the shapes, seen from the front.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ApertureRecipe {
    /// Shapes under which the lips are closed.
    pub(super) seal: Vec<String>,
    /// Shapes under which they stand open no wider than at rest.
    pub(super) keep: Vec<String>,
    /// Shapes that open the lips up to the corners: the opening at a share f of the way there
    /// is (1 - f^2)^power of that in the middle, or more.
    pub(super) open: BTreeMap<String, f64>,
    /// How far from where the lips meet the correction reaches. (mm)
    pub(super) reach: f64,
    /// Rounds.
    pub(super) rounds: u32,
}

/// How shapes are corrected on inner skin.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LiningRecipe {
    /// Distances from the lids up to which a socket's skin moves fully, and from which not at
    /// all. (mm)
    pub(super) socket: [f64; 2],
    /// Beginnings of the names of shapes that do not move the mouth cavity.
    pub(super) leave_mouth_still: Vec<String>,
    /// Shapes under which the mouth cavity moves with the flesh around it.
    pub(super) follow_flesh: Vec<String>,
    /// How far apart outer skin is mixed for that. (mm)
    pub(super) flesh_blur: f64,
    /// Distances from outer skin up to which the lining moves fully, and from which not at all.
    /// (mm)
    pub(super) flesh_depth: [f64; 2],
    /// Distances from the lips up to which the lining moves as drawn, and from which with the
    /// flesh. (mm)
    pub(super) flesh_from: [f64; 2],
}

/// How shapes are corrected at the lips.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LipRecipe {
    /// Shapes that only make sense on top of another: name -> the other. Both have no side.
    pub(super) over: BTreeMap<String, String>,
    /// How far the surroundings follow. (mm)
    pub(super) blur: f64,
    /// How deep the lining counts, behind the corner of the mouth. (mm)
    pub(super) lining: f64,
    /// Crossings that may stay. (mm)
    pub(super) tolerance: f64,
    /// Deeper overlaps are another part of the mouth, not a crossing. (mm)
    pub(super) deepest: f64,
    /// Rounds at most.
    pub(super) rounds: u32,
}

impl Description {
    /// Reads the text of a `template.toml`.
    ///
    /// # Errors
    ///
    /// [`TemplateError::Text`] with line and column.
    pub(super) fn parse(text: &str) -> Result<Self, TemplateError> {
        toml::from_str(text).map_err(|source| TemplateError::Text {
            file: "template.toml",
            source: Box::new(source),
        })
    }
}

/// The name on the other side: `_l` for `_r` and back, `Left` for `Right` and back; `None` for
/// a name that has no side.
pub(super) fn mirrored_name(name: &str) -> Option<String> {
    for (a, b) in [
        ("_l", "_r"),
        ("_r", "_l"),
        ("Left", "Right"),
        ("Right", "Left"),
    ] {
        if let Some(stem) = name.strip_suffix(a) {
            return Some(format!("{stem}{b}"));
        }
    }
    None
}
