//! What collides, and how.

use serde::{Deserialize, Serialize};

use super::CollisionError;

/// Which patches collide with each other and with themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PairMask {
    /// None.
    #[default]
    None,
    /// The ring muscles with themselves: lips with lips, lids with lids and eyeballs.
    Sphincter,
    /// All patches, except pairs that are attached to each other or cross at rest: these are
    /// one tissue.
    All,
}

/// Lips that stick: bonds between them, until a pull or a gap breaks them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Stickiness {
    /// Bonds form where the skin of the lips comes nearer than this. (mm)
    pub gap: f64,
    /// Bonds break when they are drawn this much longer than when they formed. (mm)
    pub break_gap: f64,
    /// Bonds break when they pull harder than this: newtons of one node of a face whose
    /// patches weigh the cloth's areal density. With the default a jaw that opens at the speed
    /// of speech tears the middle of the demo's lips when they should be some 5 mm apart. (N)
    pub strength: f64,
    /// Rows of the ring, from the margin outwards, that can stick.
    pub rows: u32,
}

impl Default for Stickiness {
    fn default() -> Self {
        Self {
            gap: 0.5,
            break_gap: 6.0,
            strength: 0.0022,
            rows: 3,
        }
    }
}

/// How contact is solved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContactOptions {
    /// Which patches collide.
    pub pairs: PairMask,
    /// Distance that colliding patches keep, or what they have at rest where that is less.
    /// (mm)
    pub thickness: f64,
    /// Coulomb's friction coefficient between patches; wet inner lips and lids slide easily.
    pub friction: f64,
    /// Friction coefficient of lids on eyeballs, and of lips and cheeks on teeth and gums.
    pub eye_friction: f64,
    /// Whether eyeballs, teeth and gums hold patches out.
    pub bones: bool,
    /// Substeps from one pass of contact to the next, at most: every frame ends with one, and
    /// what goes far in them is followed in several. The cloth between is solved without.
    pub every: u32,
    /// Whether lips stick, and how; none: they do not.
    pub sticky_lips: Option<Stickiness>,
}

impl Default for ContactOptions {
    fn default() -> Self {
        Self {
            pairs: PairMask::None,
            thickness: 0.3,
            friction: 0.2,
            eye_friction: 0.05,
            bones: true,
            every: 3,
            sticky_lips: None,
        }
    }
}

impl ContactOptions {
    /// Checks ranges.
    ///
    /// # Errors
    ///
    /// [`CollisionError::Option`].
    pub fn check(&self) -> Result<(), CollisionError> {
        let mut ranges = vec![
            ("thickness", self.thickness, 1e-3, 2.0),
            ("friction", self.friction, 0.0, 10.0),
            ("eye_friction", self.eye_friction, 0.0, 10.0),
            ("every", f64::from(self.every), 1.0, 64.0),
        ];
        if let Some(s) = &self.sticky_lips {
            ranges.extend([
                ("sticky_lips.gap", s.gap, 0.0, 5.0),
                ("sticky_lips.break_gap", s.break_gap, s.gap, 20.0),
                ("sticky_lips.strength", s.strength, 0.0, 1e3),
            ]);
        }
        for (name, value, low, high) in ranges {
            // Written so that NaN is out of range.
            if !(value >= low && value <= high) {
                return Err(CollisionError::Option {
                    name,
                    value,
                    low,
                    high,
                });
            }
        }
        Ok(())
    }
}
