//! FACS action units as weights of shapes.
//!
//! w = clamp(A a + products of correctives, 0, 1), where `a` holds an intensity per unit and
//! side and `A` is sparse, read from a table like this:
//!
//! ```toml
//! [AU12]
//! name = "Lip Corner Puller"
//! left = { mouthSmileLeft = 1.0 }      # times the left intensity
//! right = { mouthSmileRight = 1.0 }    # times the right intensity
//!
//! [AU26]
//! name = "Jaw Drop"
//! both = { jawOpen = 0.5 }             # times the mean of both
//!
//! [[corrective]]                       # times the product of the units' intensities
//! when = ["AU6", "AU12"]
//! left = { eyeSquintLeft = 0.2 }       # may be negative
//! right = { eyeSquintRight = 0.2 }
//! ```
//!
//! Source: Ekman, Friesen & Hager, *Facial Action Coding System*, 2002, for the units.

use std::collections::BTreeMap;

use serde::Deserialize;

/// An action unit table is wrong, or does not fit the shapes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FacsError {
    /// The text is not TOML of the table's form.
    #[error("the action unit table does not parse: {message}")]
    Syntax {
        /// What the parser says, with the line.
        message: String,
    },
    /// A corrective names a unit that the table does not have.
    #[error("corrective {corrective} names {unit}, which the table does not define")]
    UnknownUnit {
        /// Index of the corrective, from 0.
        corrective: usize,
        /// The name it gives.
        unit: String,
    },
    /// A coefficient is NaN or infinite.
    #[error("{unit} gives {shape} the coefficient {coefficient}, which is not finite")]
    NotFinite {
        /// The unit, or `corrective n`.
        unit: String,
        /// The shape.
        shape: String,
        /// Its coefficient.
        coefficient: f32,
    },
    /// The table moves a shape that there is not.
    #[error("{unit} moves the shape '{shape}', which does not exist (nearest: '{nearest}')")]
    UnknownShape {
        /// The unit, or `corrective n`.
        unit: String,
        /// The shape it names.
        shape: String,
        /// The most similar shape that there is.
        nearest: String,
    },
    /// A pose names a shape that there is not.
    #[error("there is no shape '{found}' (nearest: '{nearest}')")]
    UnknownName {
        /// The name.
        found: String,
        /// The most similar shape that there is.
        nearest: String,
    },
    /// A weight of a pose is NaN, infinite, or outside [0, 1].
    #[error("'{shape}' has the weight {found}; weights lie in [0, 1]")]
    WeightOutOfRange {
        /// The shape.
        shape: String,
        /// Its weight.
        found: f64,
    },
    /// The intensities do not fit the table.
    #[error("expected {expected} intensities, one per action unit, got {found}")]
    IntensityCount {
        /// Units of the table.
        expected: usize,
        /// Intensities given.
        found: usize,
    },
    /// An intensity is NaN, infinite, or outside [0, 1].
    #[error("{unit} has the intensity {found}; intensities lie in [0, 1]")]
    IntensityOutOfRange {
        /// The unit.
        unit: String,
        /// Its intensity.
        found: f32,
    },
}

/// Coefficients of shapes: (shape name, coefficient), by name.
pub(super) type ShapeCoefficients = BTreeMap<String, f32>;

/// What one side, the other, or both of an action do to the shapes.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
pub(super) struct Action {
    #[serde(default)]
    pub(super) left: ShapeCoefficients,
    #[serde(default)]
    pub(super) right: ShapeCoefficients,
    #[serde(default)]
    pub(super) both: ShapeCoefficients,
}

/// One action unit of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct ActionUnit {
    /// `AU12`, ...
    pub code: String,
    /// `Lip Corner Puller`, ...
    pub name: String,
    action: Action,
}

impl ActionUnit {
    /// Names of the shapes that it moves, in order of side (left, right, both) and name.
    pub fn shapes(&self) -> impl Iterator<Item = &str> {
        let Action { left, right, both } = &self.action;
        [left, right, both]
            .into_iter()
            .flat_map(|side| side.keys().map(String::as_str))
    }
}

/// Weights that are added when several units act together.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrective {
    /// Codes of the units.
    pub when: Vec<String>,
    action: Action,
}

/// Action units and correctives, as read from a pack's `action_units.toml`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ActionUnitTable {
    units: Vec<ActionUnit>,
    correctives: Vec<Corrective>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UnitText {
    name: String,
    #[serde(default)]
    left: ShapeCoefficients,
    #[serde(default)]
    right: ShapeCoefficients,
    #[serde(default)]
    both: ShapeCoefficients,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CorrectiveText {
    when: Vec<String>,
    #[serde(default)]
    left: ShapeCoefficients,
    #[serde(default)]
    right: ShapeCoefficients,
    #[serde(default)]
    both: ShapeCoefficients,
}

#[derive(Deserialize)]
struct TableText {
    #[serde(default)]
    corrective: Vec<CorrectiveText>,
    #[serde(flatten)]
    units: BTreeMap<String, UnitText>,
}

/// Text of the table that comes with the crate.
const BUNDLED: &str = include_str!("../../../../templates/human/action_units.toml");

impl ActionUnitTable {
    /// The table of the bundled template.
    ///
    /// # Errors
    ///
    /// As [`Self::parse`]; not for the table that the crate was built with.
    pub fn bundled() -> Result<Self, FacsError> {
        Self::parse(BUNDLED)
    }

    /// Reads a table; units come out in the order of their numbers.
    ///
    /// # Errors
    ///
    /// [`FacsError`] for malformed text, a coefficient that is not finite, or a corrective of
    /// a unit that is not there. Whether the shapes exist shows in [`ActionUnitMap::new`](super::ActionUnitMap::new).
    pub fn parse(text: &str) -> Result<Self, FacsError> {
        let table: TableText = toml::from_str(text).map_err(|error| FacsError::Syntax {
            message: error.to_string().trim().replace('\n', " "),
        })?;
        let mut units: Vec<ActionUnit> = table
            .units
            .into_iter()
            .map(|(code, unit)| ActionUnit {
                code,
                name: unit.name,
                action: Action {
                    left: unit.left,
                    right: unit.right,
                    both: unit.both,
                },
            })
            .collect();
        units.sort_by_key(|unit| {
            let digits = unit.code.trim_start_matches(|c: char| !c.is_ascii_digit());
            (digits.parse::<u32>().unwrap_or(u32::MAX), unit.code.clone())
        });
        let correctives: Vec<Corrective> = table
            .corrective
            .into_iter()
            .map(|c| Corrective {
                when: c.when,
                action: Action {
                    left: c.left,
                    right: c.right,
                    both: c.both,
                },
            })
            .collect();
        let table = Self { units, correctives };
        table.check()?;
        Ok(table)
    }

    fn check(&self) -> Result<(), FacsError> {
        for (label, action) in self.actions() {
            for (shape, &coefficient) in action.left.iter().chain(&action.right).chain(&action.both)
            {
                if !coefficient.is_finite() {
                    return Err(FacsError::NotFinite {
                        unit: label,
                        shape: shape.clone(),
                        coefficient,
                    });
                }
            }
        }
        for (corrective, c) in self.correctives.iter().enumerate() {
            if let Some(unit) = c.when.iter().find(|unit| self.unit_index(unit).is_none()) {
                return Err(FacsError::UnknownUnit {
                    corrective,
                    unit: unit.clone(),
                });
            }
        }
        Ok(())
    }

    pub(super) fn actions(&self) -> impl Iterator<Item = (String, &Action)> {
        let units = self.units.iter().map(|u| (u.code.clone(), &u.action));
        let correctives = self.correctives.iter().enumerate();
        units.chain(correctives.map(|(i, c)| (format!("corrective {i}"), &c.action)))
    }

    /// The units, by number.
    pub fn units(&self) -> &[ActionUnit] {
        &self.units
    }

    /// The correctives, in the table's order.
    pub fn correctives(&self) -> &[Corrective] {
        &self.correctives
    }

    /// Index of the unit called `code`, in any case.
    pub fn unit_index(&self, code: &str) -> Option<usize> {
        self.units
            .iter()
            .position(|unit| unit.code.eq_ignore_ascii_case(code))
    }

    /// Index of the unit with this number: 12 for `AU12`.
    pub fn unit_by_number(&self, number: u32) -> Option<usize> {
        self.unit_index(&format!("AU{number}"))
    }

    /// Codes of the units that move `shape`: the way from shapes back to action units.
    pub fn units_of_shape(&self, shape: &str) -> Vec<&str> {
        self.units
            .iter()
            .filter(|unit| unit.shapes().any(|s| s == shape))
            .map(|unit| unit.code.as_str())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facs::{ARKIT_SHAPES, ActionUnitMap, UnitIntensity};

    const TABLE: &str = r#"
        [AU12]
        name = "Lip Corner Puller"
        left = { mouthSmileLeft = 1.0 }
        right = { mouthSmileRight = 1.0 }
        [AU6]
        name = "Cheek Raiser"
        left = { cheekSquintLeft = 1.0 }
        right = { cheekSquintRight = 1.0 }
        [AU26]
        name = "Jaw Drop"
        both = { jawOpen = 0.5 }
        [AU27]
        name = "Mouth Stretch"
        both = { jawOpen = 1.0 }
        [[corrective]]
        when = ["AU6", "au12"]
        left = { eyeSquintLeft = 0.5, mouthSmileLeft = -0.25 }
    "#;

    #[test]
    fn weights_are_the_sparse_product_with_correctives_clamped() {
        let table = ActionUnitTable::parse(TABLE).unwrap();
        let codes: Vec<_> = table.units().iter().map(|u| u.code.as_str()).collect();
        assert_eq!(codes, ["AU6", "AU12", "AU26", "AU27"]);
        let map = ActionUnitMap::new(&table, &ARKIT_SHAPES).unwrap();
        let intensities = [
            UnitIntensity::both(1.0),
            UnitIntensity {
                left: 0.8,
                right: 0.4,
            },
            UnitIntensity::both(1.0),
            UnitIntensity::both(1.0),
        ];
        let weights = map.weights(&intensities).unwrap();
        let weight = |name: &str| weights[ARKIT_SHAPES.iter().position(|s| *s == name).unwrap()];
        assert_eq!(weight("mouthSmileLeft"), 0.8 - 0.25 * 0.8);
        assert_eq!(weight("mouthSmileRight"), 0.4);
        assert_eq!(weight("eyeSquintLeft"), 0.5 * 0.8);
        assert_eq!(weight("jawOpen"), 1.0, "0.5 + 1.0 is clamped");
        assert_eq!(table.units_of_shape("jawOpen"), ["AU26", "AU27"]);
    }

    #[test]
    fn errors_name_the_unit_and_the_nearest_shape() {
        let syntax = ActionUnitTable::parse("[AU1]\nname = 3\n").unwrap_err();
        assert!(matches!(syntax, FacsError::Syntax { .. }));
        let field = ActionUnitTable::parse("[AU1]\nname = \"x\"\nmiddle = {}\n").unwrap_err();
        assert!(field.to_string().contains("middle"), "{field}");
        assert!(matches!(
            ActionUnitTable::parse("[[corrective]]\nwhen = [\"AU9\"]\n"),
            Err(FacsError::UnknownUnit { corrective: 0, .. })
        ));
        assert!(matches!(
            ActionUnitTable::parse("[AU1]\nname = \"x\"\nboth = { jawOpen = nan }\n"),
            Err(FacsError::NotFinite { .. })
        ));
        let table =
            ActionUnitTable::parse("[AU1]\nname = \"x\"\nboth = { jawOpne = 1.0 }\n").unwrap();
        match ActionUnitMap::new(&table, &ARKIT_SHAPES) {
            Err(FacsError::UnknownShape { unit, nearest, .. }) => {
                assert_eq!((unit.as_str(), nearest.as_str()), ("AU1", "jawOpen"));
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn intensities_are_checked() {
        let table = ActionUnitTable::parse(TABLE).unwrap();
        let map = ActionUnitMap::new(&table, &ARKIT_SHAPES).unwrap();
        assert!(matches!(
            map.weights(&[]),
            Err(FacsError::IntensityCount {
                expected: 4,
                found: 0
            })
        ));
        for bad in [f32::NAN, -0.1, 1.1, f32::INFINITY] {
            let mut intensities = [UnitIntensity::default(); 4];
            intensities[2].right = bad;
            assert!(matches!(
                map.weights(&intensities),
                Err(FacsError::IntensityOutOfRange { .. })
            ));
        }
    }
}
