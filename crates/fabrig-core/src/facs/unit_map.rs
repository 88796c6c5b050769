//! A table of action units bound to shapes, and the weights that intensities give.

use super::action_unit::{ActionUnitTable, FacsError, ShapeCoefficients};
use super::nearest_name;

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

    /// The larger of this and another, side by side.
    pub fn max(self, other: Self) -> Self {
        Self {
            left: self.left.max(other.left),
            right: self.right.max(other.right),
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
                        nearest: nearest_name(name, shapes.iter().copied())
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
        let corrective_actions = actions.split_off(table.units().len());
        let correctives = table.correctives().iter().map(|corrective| {
            let units = corrective.when.iter();
            units
                .filter_map(|code| table.unit_index(code))
                .collect::<Vec<usize>>()
        });
        Ok(Self {
            codes: table.units().iter().map(|u| u.code.clone()).collect(),
            units: actions,
            correctives: correctives.zip(corrective_actions).collect(),
            shape_count: shapes.len(),
        })
    }

    /// Whether a unit moves anything by one side alone.
    ///
    /// # Panics
    ///
    /// If there is no such unit.
    pub fn has_sides(&self, unit: usize) -> bool {
        let action = &self.units[unit];
        !(action.left.is_empty() && action.right.is_empty())
    }

    /// Shapes that the given units can move, correctives of them included, rising.
    pub fn shapes_of(&self, units: &[usize]) -> Vec<usize> {
        let mut shapes: Vec<usize> = Vec::new();
        let mut add = |action: &SparseAction| {
            for list in [&action.left, &action.right, &action.both] {
                shapes.extend(list.iter().map(|&(shape, _)| shape));
            }
        };
        for &unit in units {
            add(&self.units[unit]);
        }
        for (when, action) in &self.correctives {
            if when.iter().all(|unit| units.contains(unit)) {
                add(action);
            }
        }
        shapes.sort_unstable();
        shapes.dedup();
        shapes
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
