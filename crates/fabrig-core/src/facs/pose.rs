//! A pose by the names of its shapes.

use super::{FacsError, ShapeMatch, match_shape, named_expressions, nearest_name};

/// Weights in the order of `shapes` from pairs of a name and a weight: names in any spelling
/// that [`match_shape`] knows, without a side for both; shapes that are not named rest.
///
/// ```
/// use fabrig_core::facs::named_weights;
///
/// let shapes = ["jawOpen", "mouthSmileLeft", "mouthSmileRight"].map(str::to_owned);
/// let pose = named_weights([("jaw_open", 0.25), ("mouthSmile", 1.0)], &shapes)?;
/// assert_eq!(pose, [0.25, 1.0, 1.0]);
/// # Ok::<(), fabrig_core::facs::FacsError>(())
/// ```
///
/// # Errors
///
/// [`FacsError::UnknownName`], [`FacsError::WeightOutOfRange`].
pub fn named_weights<'a>(
    pose: impl IntoIterator<Item = (&'a str, f64)>,
    shapes: &[String],
) -> Result<Vec<f32>, FacsError> {
    let mut weights = vec![0.0; shapes.len()];
    for (name, weight) in pose {
        if !(0.0..=1.0).contains(&weight) {
            return Err(FacsError::WeightOutOfRange {
                shape: name.to_owned(),
                found: weight,
            });
        }
        // A template of one's own may have shapes that ARKit has not.
        let own = shapes.iter().position(|shape| shape == name);
        let names = match_shape(name).map_or_else(Vec::new, ShapeMatch::names);
        let matched = names
            .iter()
            .filter_map(|name| shapes.iter().position(|s| s == name));
        let found: Vec<usize> = match own {
            Some(shape) => vec![shape],
            None => matched.collect(),
        };
        if found.is_empty() {
            let known = shapes.iter().map(String::as_str);
            return Err(FacsError::UnknownName {
                found: name.to_owned(),
                nearest: nearest_name(name, known).unwrap_or_default().to_owned(),
            });
        }
        for shape in found {
            weights[shape] = weight as f32;
        }
    }
    Ok(weights)
}

/// The expressions of a sheet of the bundled template's (`motion`, `emotions`), as names and
/// weights in the order of `shapes`; none for a sheet that there is not.
///
/// # Errors
///
/// As [`named_weights`], where `shapes` lack one.
pub fn expression_sheet(
    sheet: &str,
    shapes: &[String],
) -> Result<Vec<(String, Vec<f32>)>, FacsError> {
    let of_sheet = named_expressions().iter().filter(|e| e.sheet == sheet);
    of_sheet
        .map(|expression| {
            let pose = expression.weights.iter();
            let pose = pose.map(|(name, &w)| (name.as_str(), f64::from(w)));
            Ok((expression.name.clone(), named_weights(pose, shapes)?))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facs::ARKIT_SHAPES;

    #[test]
    fn poses_name_shapes_in_any_spelling() {
        let shapes = ARKIT_SHAPES.map(str::to_owned);
        for sheet in ["motion", "emotions"] {
            let poses = expression_sheet(sheet, &shapes).unwrap();
            assert_eq!(poses.len(), 12);
            for (name, weights) in poses {
                assert!(weights.iter().any(|&w| w >= 0.5), "{name}");
            }
        }
        let weights = named_weights([("JAW_OPEN", 0.25), ("eyeBlink", 1.0)], &shapes).unwrap();
        assert_eq!(weights.iter().sum::<f32>(), 2.25);
        let error = |name, weight| named_weights([(name, weight)], &shapes).unwrap_err();
        assert!(matches!(
            error("jawOpne", 1.0),
            FacsError::UnknownName { nearest, .. } if nearest == "jawOpen"
        ));
        for bad in [2.0, -0.1, f64::NAN] {
            assert!(matches!(
                error("jawOpen", bad),
                FacsError::WeightOutOfRange { .. }
            ));
        }
    }
}
