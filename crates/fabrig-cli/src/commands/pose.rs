//! Poses as text: `jawOpen=0.5,mouthSmile=1`.

use anyhow::{Context, Result, anyhow};
use fabrig_core::facs::named_weights;

/// Weights in the order of `shapes`; names in any spelling, without a side for both.
pub(super) fn parse_pose(text: &str, shapes: &[String]) -> Result<Vec<f32>> {
    let items = text.split(',').map(str::trim).filter(|i| !i.is_empty());
    let pose: Vec<(&str, f64)> = items
        .map(|item| {
            let (name, value) = item
                .split_once('=')
                .ok_or_else(|| anyhow!("'{item}' is not SHAPE=WEIGHT"))?;
            let weight = value
                .trim()
                .parse()
                .map_err(|_| anyhow!("'{item}': '{value}' is not a number"))?;
            Ok((name.trim(), weight))
        })
        .collect::<Result<_>>()?;
    named_weights(pose, shapes).with_context(|| format!("'{text}' is no pose"))
}

#[cfg(test)]
mod tests {
    use fabrig_core::facs::ARKIT_SHAPES;

    use super::*;

    #[test]
    fn poses_are_read_from_text() {
        let shapes = ARKIT_SHAPES.map(str::to_owned);
        let weights = parse_pose("JAW_OPEN=0.25, eyeBlink=1", &shapes).unwrap();
        assert_eq!(weights.iter().sum::<f32>(), 2.25);
        for bad in ["jawOpen", "jawOpen=2", "jawOpen=x", "jawOpne=1"] {
            assert!(parse_pose(bad, &shapes).is_err(), "{bad}");
        }
    }
}
