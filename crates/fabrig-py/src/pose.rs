//! Weights of shapes, by name or in order.

use std::collections::BTreeMap;

use fabrig_core::facs::named_weights;
use pyo3::prelude::*;
use pyo3::types::PyMapping;

use crate::arrays;
use crate::errors::input;

/// Weights in the order of `shapes`: from a mapping of names, or an array of as many numbers.
pub(crate) fn weights_of(
    argument: &str,
    value: &Bound<'_, PyAny>,
    shapes: &[String],
) -> PyResult<Vec<f32>> {
    if let Ok(mapping) = value.cast::<PyMapping>() {
        let items = mapping.items()?;
        let pose: BTreeMap<String, f64> = items
            .iter()
            .map(|item| item.extract::<(String, f64)>())
            .collect::<PyResult<_>>()
            .map_err(|_| input(format!("{argument}: expected names with numbers")))?;
        let pairs = pose.iter().map(|(name, &weight)| (name.as_str(), weight));
        return named_weights(pairs, shapes).map_err(|e| input(format!("{argument}: {e}")));
    }
    let values = arrays::numbers(argument, value)?;
    if values.len() != shapes.len() {
        return Err(input(format!(
            "{argument}: expected shape ({},), got ({},)",
            shapes.len(),
            values.len()
        )));
    }
    if let Some(index) = values.iter().position(|w| !(0.0..=1.0).contains(w)) {
        return Err(input(format!(
            "{argument}: {} at index {index} is outside [0, 1]",
            values[index]
        )));
    }
    Ok(values.into_iter().map(|w| w as f32).collect())
}
