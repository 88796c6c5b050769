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
type ShapeCoefficients = BTreeMap<String, f32>;

/// What one side, the other, or both of an action do to the shapes.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
struct Action {
    #[serde(default)]
    left: ShapeCoefficients,
    #[serde(default)]
    right: ShapeCoefficients,
    #[serde(default)]
    both: ShapeCoefficients,
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

impl ActionUnitTable {
    /// Reads a table; units come out in the order of their numbers.
    ///
    /// # Errors
    ///
    /// [`FacsError`] for malformed text, a coefficient that is not finite, or a corrective of
    /// a unit that is not there. Whether the shapes exist shows in [`ActionUnitMap::new`].
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

    fn actions(&self) -> impl Iterator<Item = (String, &Action)> {
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

    /// Codes of the units that move `shape`: the way from shapes back to action units.
    pub fn units_of_shape(&self, shape: &str) -> Vec<&str> {
        self.units
            .iter()
            .filter(|unit| unit.shapes().any(|s| s == shape))
            .map(|unit| unit.code.as_str())
            .collect()
    }
}

/// Intensity of one unit on each side, in [0, 1].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct UnitIntensity {
    /// On the character's left.
    pub left: f32,
    /// On the character's right.
    pub right: f32,
}

impl UnitIntensity {
    /// The same on both sides.
    pub fn both(intensity: f32) -> Self {
        Self {
            left: intensity,
            right: intensity,
        }
    }

    fn mean(self) -> f32 {
        0.5 * (self.left + self.right)
    }
}

/// Coefficients of one action with shapes as indices.
#[derive(Debug, Clone, PartialEq)]
struct SparseAction {
    left: Vec<(usize, f32)>,
    right: Vec<(usize, f32)>,
    both: Vec<(usize, f32)>,
}

impl SparseAction {
    fn add_to(&self, intensity: UnitIntensity, weights: &mut [f32]) {
        for (coefficients, amount) in [
            (&self.left, intensity.left),
            (&self.right, intensity.right),
            (&self.both, intensity.mean()),
        ] {
            for &(shape, coefficient) in coefficients {
                weights[shape] += coefficient * amount;
            }
        }
    }
}

/// A table bound to a list of shapes: A and the correctives as indices.
#[derive(Debug, Clone, PartialEq)]
pub struct ActionUnitMap {
    codes: Vec<String>,
    units: Vec<SparseAction>,
    correctives: Vec<(Vec<usize>, SparseAction)>,
    shape_count: usize,
}

impl ActionUnitMap {
    /// Binds `table` to shapes, whose order is then the order of the weights.
    ///
    /// # Errors
    ///
    /// [`FacsError::UnknownShape`] where the table names a shape that is not among them.
    pub fn new(table: &ActionUnitTable, shapes: &[&str]) -> Result<Self, FacsError> {
        let bind = |label: &str, coefficients: &ShapeCoefficients| {
            coefficients
                .iter()
                .map(|(name, &coefficient)| {
                    let shape = shapes.iter().position(|s| s == name);
                    let shape = shape.ok_or_else(|| FacsError::UnknownShape {
                        unit: label.to_owned(),
                        shape: name.clone(),
                        nearest: super::nearest_name(name, shapes.iter().copied())
                            .unwrap_or_default()
                            .to_owned(),
                    })?;
                    Ok((shape, coefficient))
                })
                .collect::<Result<Vec<_>, FacsError>>()
        };
        let mut actions = table
            .actions()
            .map(|(label, action)| {
                Ok(SparseAction {
                    left: bind(&label, &action.left)?,
                    right: bind(&label, &action.right)?,
                    both: bind(&label, &action.both)?,
                })
            })
            .collect::<Result<Vec<_>, FacsError>>()?;
        let corrective_actions = actions.split_off(table.units.len());
        let correctives = table.correctives.iter().map(|corrective| {
            let units = corrective.when.iter();
            units
                .filter_map(|code| table.unit_index(code))
                .collect::<Vec<usize>>()
        });
        Ok(Self {
            codes: table.units.iter().map(|u| u.code.clone()).collect(),
            units: actions,
            correctives: correctives.zip(corrective_actions).collect(),
            shape_count: shapes.len(),
        })
    }

    /// Weights of the shapes for one intensity per unit of the table.
    ///
    /// # Errors
    ///
    /// [`FacsError`] when the count is wrong or an intensity is not in [0, 1].
    pub fn weights(&self, intensities: &[UnitIntensity]) -> Result<Vec<f32>, FacsError> {
        if intensities.len() != self.units.len() {
            return Err(FacsError::IntensityCount {
                expected: self.units.len(),
                found: intensities.len(),
            });
        }
        for (code, intensity) in self.codes.iter().zip(intensities) {
            for found in [intensity.left, intensity.right] {
                if !(0.0..=1.0).contains(&found) {
                    return Err(FacsError::IntensityOutOfRange {
                        unit: code.clone(),
                        found,
                    });
                }
            }
        }
        let mut weights = vec![0.0; self.shape_count];
        for (unit, &intensity) in self.units.iter().zip(intensities) {
            unit.add_to(intensity, &mut weights);
        }
        for (units, action) in &self.correctives {
            let product =
                units
                    .iter()
                    .fold(UnitIntensity::both(1.0), |product, &u| UnitIntensity {
                        left: product.left * intensities[u].left,
                        right: product.right * intensities[u].right,
                    });
            action.add_to(product, &mut weights);
        }
        for weight in &mut weights {
            *weight = weight.clamp(0.0, 1.0);
        }
        Ok(weights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facs::ARKIT_SHAPES;

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
