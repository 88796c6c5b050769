//! Poses as text: `jawOpen=0.5,mouthSmile=1`.

use anyhow::{Result, anyhow, ensure};
use fabrig_core::facs::{ShapeMatch, match_shape, named_expressions, nearest_name};

/// The expressions of a sheet of the template's, as names and weights in the order of `shapes`.
pub(super) fn expression_sheet(sheet: &str, shapes: &[String]) -> Result<Vec<(String, Vec<f32>)>> {
    let of_sheet = named_expressions().iter().filter(|e| e.sheet == sheet);
    of_sheet
        .map(|expression| {
            let weights = expression.weights.iter();
            let items: Vec<String> = weights.map(|(name, w)| format!("{name}={w}")).collect();
            let pose = parse_pose(&items.join(","), shapes)?;
            Ok((expression.name.clone(), pose))
        })
        .collect()
}

/// Weights in the order of `shapes`; names in any spelling, without a side for both.
pub(super) fn parse_pose(text: &str, shapes: &[String]) -> Result<Vec<f32>> {
    let mut weights = vec![0.0; shapes.len()];
    for item in text.split(',').map(str::trim).filter(|i| !i.is_empty()) {
        let (name, value) = item
            .split_once('=')
            .ok_or_else(|| anyhow!("'{item}' is not SHAPE=WEIGHT"))?;
        let weight: f32 = value
            .trim()
            .parse()
            .map_err(|_| anyhow!("'{item}': '{value}' is not a number"))?;
        ensure!(
            (0.0..=1.0).contains(&weight),
            "'{item}': weights lie in [0, 1]"
        );
        let names = match_shape(name.trim()).map_or_else(Vec::new, ShapeMatch::names);
        let found: Vec<usize> = names
            .iter()
            .filter_map(|name| shapes.iter().position(|s| s == name))
            .collect();
        ensure!(
            !found.is_empty(),
            "the rig has no shape '{name}' (nearest: '{}')",
            nearest_name(name, shapes.iter().map(String::as_str)).unwrap_or_default()
        );
        for shape in found {
            weights[shape] = weight;
        }
    }
    Ok(weights)
}

#[cfg(test)]
mod tests {
    use fabrig_core::facs::ARKIT_SHAPES;

    use super::*;

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
        let weights = parse_pose("JAW_OPEN=0.25, eyeBlink=1", &shapes).unwrap();
        assert_eq!(weights.iter().sum::<f32>(), 2.25);
        for bad in ["jawOpen", "jawOpen=2", "jawOpen=x", "jawOpne=1"] {
            assert!(parse_pose(bad, &shapes).is_err(), "{bad}");
        }
    }
}
