//! Action units of a take as weights of shapes.

use super::MotionError;
use super::read::ReadOptions;
use crate::facs::{
    ARKIT_SHAPES, ActionUnitMap, ActionUnitTable, Side, UnitIntensity, nearest_name,
};

/// The units that a take names, bound to the shapes.
pub(super) struct UnitChannels {
    table: ActionUnitTable,
    map: ActionUnitMap,
    /// Indices into the table, in the order in which they were asked for.
    used: Vec<usize>,
}

impl UnitChannels {
    pub(super) fn new(name: &str, options: &ReadOptions) -> Result<Self, MotionError> {
        let wrong = |source| MotionError::ActionUnits {
            name: name.to_owned(),
            source,
        };
        let table = match &options.action_units {
            Some(table) => table.clone(),
            None => ActionUnitTable::bundled().map_err(wrong)?,
        };
        let map = ActionUnitMap::new(&table, &ARKIT_SHAPES).map_err(wrong)?;
        Ok(Self {
            table,
            map,
            used: Vec::new(),
        })
    }

    /// Index of a unit in the table, which from now on counts as used.
    pub(super) fn unit(&mut self, number: u32) -> Option<usize> {
        let unit = self.table.unit_by_number(number)?;
        if !self.used.contains(&unit) {
            self.used.push(unit);
        }
        Some(unit)
    }

    /// The code of the table that is spelled most like `code`.
    pub(super) fn nearest(&self, code: &str) -> String {
        let codes = self.table.units().iter().map(|u| u.code.as_str());
        nearest_name(code, codes).unwrap_or_default().to_owned()
    }

    /// Shapes that the used units move, rising.
    pub(super) fn shapes(&self) -> Vec<usize> {
        self.map.shapes_of(&self.used)
    }

    /// No unit active.
    pub(super) fn rest(&self) -> Vec<UnitIntensity> {
        vec![UnitIntensity::default(); self.table.units().len()]
    }

    /// Sets a unit on one side, or on both.
    pub(super) fn set(intensity: &mut UnitIntensity, side: Option<Side>, value: f32) {
        if side != Some(Side::Right) {
            intensity.left = value;
        }
        if side != Some(Side::Left) {
            intensity.right = value;
        }
    }

    /// Weights of all of ARKit's shapes for intensities in [0, 1].
    pub(super) fn weights(
        &self,
        name: &str,
        intensities: &[UnitIntensity],
    ) -> Result<Vec<f32>, MotionError> {
        let weights = self.map.weights(intensities);
        weights.map_err(|source| MotionError::ActionUnits {
            name: name.to_owned(),
            source,
        })
    }
}
