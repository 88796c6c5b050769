//! Action units.

use std::collections::BTreeMap;

use fabrig_core::facs::{
    ARKIT_SHAPES, ActionUnitMap, ActionUnitTable, Side, UnitIntensity, match_unit, nearest_name,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{input, to_py};

/// FACS action units that the bundled table knows: code -> name.
///
/// >>> fabrig.action_units()["AU12"]
/// 'Lip Corner Puller'
#[pyfunction]
pub(crate) fn action_units(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let table = ActionUnitTable::bundled().map_err(to_py)?;
    let units = PyDict::new(py);
    for unit in table.units() {
        units.set_item(&unit.code, &unit.name)?;
    }
    Ok(units)
}

/// Weights of ARKit's shapes from intensities of action units; shapes at rest are left out.
///
/// - `units`: code -> intensity in [0, 1]: "AU12" on both sides, "AU12.l", "AU12_r" on one
///
/// >>> smile = fabrig.weights_of_units({"AU6": 0.7, "AU12.l": 1.0})
/// >>> smile["mouthSmileLeft"]
/// 1.0
/// >>> rig = fabrig.rig(fabrig.demo_face())
/// >>> report = fabrig.Simulation(rig).step(1 / 60, weights=smile)
#[pyfunction]
pub(crate) fn weights_of_units(units: BTreeMap<String, f64>) -> PyResult<BTreeMap<String, f64>> {
    let table = ActionUnitTable::bundled().map_err(to_py)?;
    let map = ActionUnitMap::new(&table, &ARKIT_SHAPES).map_err(to_py)?;
    let mut intensities = vec![UnitIntensity::default(); table.units().len()];
    for (name, intensity) in units {
        let found = match_unit(&name);
        let unit = found.and_then(|unit| Some((table.unit_by_number(unit.number)?, unit.side)));
        let Some((unit, side)) = unit else {
            let codes = table.units().iter().map(|u| u.code.as_str());
            let nearest = nearest_name(&name, codes).unwrap_or_default();
            return Err(input(format!(
                "units: '{name}' is no action unit of the table (nearest: '{nearest}')"
            )));
        };
        if side != Some(Side::Right) {
            intensities[unit].left = intensity as f32;
        }
        if side != Some(Side::Left) {
            intensities[unit].right = intensity as f32;
        }
    }
    let weights = map
        .weights(&intensities)
        .map_err(|e| input(format!("units: {e}")))?;
    let named = ARKIT_SHAPES.iter().zip(weights);
    Ok(named
        .filter(|(_, weight)| *weight > 0.0)
        .map(|(name, weight)| ((*name).to_owned(), f64::from(weight)))
        .collect())
}
