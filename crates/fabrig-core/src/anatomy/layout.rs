//! The text of `patches.toml`: what each patch is, where its fibres run, what it is held to.
//!
//! Only the character's left side and the mid line are written down; right sides are mirrors.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::error::{AnatomyError, nearest_name};
use super::patch::PatchKind;
use crate::template::RigidBody;

/// The layout as written.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Layout {
    /// Where on the skin patches may lie.
    #[serde(default)]
    pub(super) skin: SkinRules,
    /// Named places, each an expression of landmarks and of other named places.
    #[serde(default)]
    pub(super) points: BTreeMap<String, String>,
    /// The patches, in order.
    #[serde(rename = "patch")]
    pub(super) patches: Vec<PatchText>,
}

/// Where on the skin patches may lie.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SkinRules {
    /// Regions that no patch lies on (the inside of the mouth, ...).
    #[serde(default)]
    pub(super) not_on: Vec<String>,
}

/// One patch, or a pair of them.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PatchText {
    /// Name; a pair becomes `name_l` and `name_r`.
    pub(super) name: String,
    /// What it models.
    pub(super) kind: PatchKind,
    /// Whether there is one on each side.
    pub(super) is_pair: bool,
    /// Name of its material.
    pub(super) material: String,
    /// `#rrggbb`
    pub(super) color: String,
    /// Depth under the skin at equal steps along the fibres (linear muscle, fat pad) or from
    /// the margin outwards (sphincter). (mm)
    pub(super) depth: Vec<f64>,
    /// Curves along the fibres, from origin to insertion; u x v points outwards. Of a patch on
    /// the mid line, those on the left and, last, one on the mid line.
    #[serde(default)]
    pub(super) ribs: Vec<Vec<String>>,
    /// Of a sphincter: its innermost ring.
    #[serde(default)]
    pub(super) margin: Option<MarginText>,
    /// Of a sphincter: further rings, inner to outer.
    #[serde(default)]
    pub(super) rings: Vec<RingText>,
    /// Of a sphincter: the regions that its upper and its lower half may not lie on.
    #[serde(default)]
    pub(super) upper_not_on: Vec<String>,
    /// See `upper_not_on`.
    #[serde(default)]
    pub(super) lower_not_on: Vec<String>,
    /// What the first columns are held to.
    #[serde(default)]
    pub(super) origin: Option<HoldText>,
    /// What the last columns are held to.
    #[serde(default)]
    pub(super) insertion: Option<HoldText>,
    /// What the pad lies on: each node is stitched to the nearest node under it.
    #[serde(default)]
    pub(super) over: Option<HoldText>,
    /// Of a sphincter: what its first rings are held to, those around the opening.
    #[serde(default)]
    pub(super) opening: Option<HoldText>,
    /// An eyeball that the patch lies on where it is within reach of it.
    #[serde(default)]
    pub(super) near: Option<HoldText>,
}

/// The closed loop of mesh edges around an opening, through two corners.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MarginText {
    /// Regions inside the opening; left out, the loop is the edge of the skin itself.
    #[serde(default)]
    pub(super) inside: Vec<String>,
    /// Landmarks where upper and lower part meet: towards -X, towards +X. Of a sphincter on
    /// the mid line, the left corner alone.
    pub(super) corners: Vec<String>,
}

/// A closed curve around an opening, as two arcs between the same ends: from the corner
/// towards -X to that towards +X; of a sphincter on the mid line, from the mid line to the
/// left corner.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RingText {
    /// Arc above the opening.
    pub(super) upper: Vec<String>,
    /// Arc below the opening.
    pub(super) lower: Vec<String>,
}

/// What a part of a patch is held to (Eq. 5).
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HoldText {
    /// A rigid body.
    #[serde(default)]
    pub(super) body: Option<RigidBody>,
    /// Other patches; of a pair, that of the same side.
    #[serde(default)]
    pub(super) patches: Vec<String>,
    /// Part of the fibre length that is held, from that end.
    #[serde(default)]
    pub(super) share: f64,
    /// Greatest distance between nodes held together, or from the eyeball. (mm)
    #[serde(default)]
    pub(super) reach: f64,
    /// Stiffness relative to stretch.
    pub(super) strength: f64,
}

impl Layout {
    /// Reads and checks the text; names of points and regions are checked against the
    /// template when patches are charted.
    pub(super) fn parse(text: &str) -> Result<Self, AnatomyError> {
        let layout: Self = toml::from_str(text).map_err(|source| AnatomyError::Syntax {
            source: Box::new(source),
        })?;
        for (index, patch) in layout.patches.iter().enumerate() {
            if layout.patches[..index].iter().any(|p| p.name == patch.name) {
                return Err(AnatomyError::DuplicatePatch {
                    name: patch.name.clone(),
                });
            }
            patch.check(&layout)?;
        }
        Ok(layout)
    }
}

impl PatchText {
    fn check(&self, layout: &Layout) -> Result<(), AnatomyError> {
        if self.depth.is_empty() || self.depth.iter().any(|d| !(*d > 0.0 && *d < 50.0)) {
            return Err(self.bad_value("depth", "one or more depths in mm above 0", &self.depth));
        }
        self.rgb()?;
        if self.kind == PatchKind::Sphincter {
            if self.margin.is_none() || self.rings.is_empty() {
                let found = (self.margin.is_some(), self.rings.len());
                return Err(self.bad_value("rings", "a margin and at least one ring", &found));
            }
        } else {
            if self.ribs.len() < 2 {
                return Err(self.bad_value("ribs", "at least 2 ribs", &self.ribs.len()));
            }
            if let Some(rib) = self.ribs.iter().find(|r| r.len() < 2) {
                return Err(self.bad_value("ribs", "at least 2 points in each rib", rib));
            }
        }
        for ring in &self.rings {
            if ring.upper.len() < 2 || ring.lower.len() < 2 {
                return Err(self.bad_value("rings", "at least 2 points in each arc", ring));
            }
        }
        let holds = [
            ("origin", &self.origin),
            ("insertion", &self.insertion),
            ("over", &self.over),
            ("opening", &self.opening),
            ("near", &self.near),
        ];
        if let Some(hold) = &self.near {
            let is_eye = matches!(hold.body, Some(RigidBody::EyeLeft | RigidBody::EyeRight));
            if !is_eye || !hold.patches.is_empty() {
                return Err(self.bad_value("near", "`body` an eyeball, and no patches", hold));
            }
        }
        if let (Some(hold), true) = (&self.opening, self.kind != PatchKind::Sphincter) {
            return Err(self.bad_value("opening", "a sphincter; others have none", hold));
        }
        for (key, hold) in holds {
            let Some(hold) = hold else { continue };
            if hold.body.is_none() && hold.patches.is_empty() {
                return Err(self.bad_value(key, "a body or patches", hold));
            }
            if !hold.patches.is_empty() && hold.reach.is_nan() || hold.reach < 0.0 {
                return Err(self.bad_value(key, "a reach in mm", &hold.reach));
            }
            if !(0.0..=1.0).contains(&hold.share) || !(0.0..=100.0).contains(&hold.strength) {
                return Err(self.bad_value(key, "a share in [0, 1] and a strength >= 0", hold));
            }
            for name in &hold.patches {
                if !layout.patches.iter().any(|p| &p.name == name) {
                    let known = layout.patches.iter().map(|p| p.name.as_str());
                    return Err(AnatomyError::UnknownPatch {
                        patch: self.name.clone(),
                        key: key.to_owned(),
                        name: name.clone(),
                        nearest: nearest_name(name, known),
                    });
                }
            }
        }
        Ok(())
    }

    /// The colour as sRGB bytes.
    pub(super) fn rgb(&self) -> Result<[u8; 3], AnatomyError> {
        let digits = self.color.strip_prefix('#').filter(|d| d.len() == 6);
        digits
            .and_then(|d| u32::from_str_radix(d, 16).ok())
            .map(|n| [(n >> 16) as u8, (n >> 8) as u8, n as u8])
            .ok_or_else(|| self.bad_value("color", "`#rrggbb`", &self.color))
    }

    /// [`AnatomyError::BadValue`] for a key of this patch.
    pub(super) fn bad_value(
        &self,
        key: &str,
        expected: &str,
        found: &dyn std::fmt::Debug,
    ) -> AnatomyError {
        AnatomyError::BadValue {
            patch: self.name.clone(),
            key: key.to_owned(),
            expected: expected.to_owned(),
            found: format!("{found:?}"),
        }
    }
}
