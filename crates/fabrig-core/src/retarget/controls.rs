//! What a fit may turn: the shapes of a rig, or action units.

use super::RetargetError;
use crate::facs::{ActionUnitMap, ActionUnitTable, Side, UnitIntensity};
use crate::rig::Rig;

/// One action unit, or one side of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct UnitControl {
    unit: usize,
    side: Option<Side>,
}

/// The controls of a fit, each in [0, 1].
#[derive(Debug, Clone, PartialEq)]
pub struct Controls {
    names: Vec<String>,
    shape_count: usize,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    /// Shapes of the rig, as indices into its weights.
    Shapes(Vec<usize>),
    Units {
        map: ActionUnitMap,
        unit_count: usize,
        controls: Vec<UnitControl>,
    },
}

impl Controls {
    /// All shapes of a rig.
    pub fn shapes(rig: &Rig) -> Self {
        Self {
            names: rig.shape_names.clone(),
            shape_count: rig.shape_names.len(),
            kind: Kind::Shapes((0..rig.shape_names.len()).collect()),
        }
    }

    /// Action units by number, left and right apart where they have sides.
    ///
    /// # Errors
    ///
    /// [`RetargetError::ActionUnits`] where the table moves shapes that the rig has not, and
    /// [`RetargetError::UnknownName`] for a unit that the table has not.
    pub fn units(
        rig: &Rig,
        table: &ActionUnitTable,
        numbers: &[u32],
    ) -> Result<Self, RetargetError> {
        let shapes: Vec<&str> = rig.shape_names.iter().map(String::as_str).collect();
        let map = ActionUnitMap::new(table, &shapes)?;
        let unit_count = table.units().len();
        let mut names = Vec::new();
        let mut controls = Vec::new();
        for &number in numbers {
            let code = format!("AU{number}");
            let unit = table.unit_by_number(number).ok_or_else(|| {
                let codes = table.units().iter().map(|u| u.code.as_str());
                let nearest = crate::facs::nearest_name(&code, codes);
                RetargetError::UnknownName {
                    what: "action unit",
                    found: code.clone(),
                    nearest: nearest.unwrap_or_default().to_owned(),
                }
            })?;
            if map.has_sides(unit) {
                for (side, letter) in [(Side::Left, 'l'), (Side::Right, 'r')] {
                    names.push(format!("{code}.{letter}"));
                    let side = Some(side);
                    controls.push(UnitControl { unit, side });
                }
            } else {
                names.push(code);
                controls.push(UnitControl { unit, side: None });
            }
        }
        Ok(Self {
            names,
            shape_count: shapes.len(),
            kind: Kind::Units {
                map,
                unit_count,
                controls,
            },
        })
    }

    /// Names, in order.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.names.len()
    }

    /// Weights of the rig's shapes for values of the controls.
    ///
    /// # Errors
    ///
    /// [`RetargetError::Count`]; [`RetargetError::ActionUnits`] for intensities outside [0, 1].
    pub fn weights(&self, values: &[f64]) -> Result<Vec<f32>, RetargetError> {
        if values.len() != self.count() {
            return Err(RetargetError::Count {
                what: "values, one per control",
                expected: self.count(),
                found: values.len(),
            });
        }
        match &self.kind {
            Kind::Shapes(shapes) => {
                let mut weights = vec![0.0; self.shape_count];
                for (&shape, &value) in shapes.iter().zip(values) {
                    weights[shape] = value as f32;
                }
                Ok(weights)
            }
            Kind::Units {
                map,
                unit_count,
                controls,
            } => {
                let mut intensities = vec![UnitIntensity::default(); *unit_count];
                for (control, &value) in controls.iter().zip(values) {
                    let intensity = &mut intensities[control.unit];
                    if control.side != Some(Side::Right) {
                        intensity.left = value as f32;
                    }
                    if control.side != Some(Side::Left) {
                        intensity.right = value as f32;
                    }
                }
                Ok(map.weights(&intensities)?)
            }
        }
    }
}
