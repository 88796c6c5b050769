//! Poses as text: `jawOpen=0.5,mouthSmile=1`.

use anyhow::{Result, anyhow, ensure};
use fabrig_core::facs::{ShapeMatch, match_shape, nearest_name};

/// The expressions of the sheet that `fabrig render --expressions` draws.
pub(super) const EXPRESSIONS: [(&str, &str); 12] = [
    ("smile", "mouthSmile=1,cheekSquint=0.7,eyeSquint=0.3"),
    ("jaw open", "jawOpen=1"),
    ("blink", "eyeBlink=1"),
    ("brows up", "browInnerUp=1,browOuterUp=1,eyeWide=0.6"),
    ("brows down", "browDown=1,eyeSquint=0.5,mouthPress=0.4"),
    ("sneer", "noseSneer=1,mouthUpperUp=0.7,browDown=0.4"),
    ("pucker", "mouthPucker=1"),
    ("funnel", "mouthFunnel=1,jawOpen=0.2"),
    ("frown", "mouthFrown=1,mouthShrugLower=0.5,browInnerUp=0.5"),
    ("puff", "cheekPuff=1"),
    (
        "disgust",
        "noseSneerLeft=1,mouthUpperUpLeft=0.8,eyeSquintLeft=0.6,browDown=0.5,mouthFrown=0.4",
    ),
    (
        "grimace",
        "mouthStretch=1,mouthLowerDown=0.8,jawOpen=0.15,browInnerUp=0.6",
    ),
];

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
        for (name, text) in EXPRESSIONS {
            let weights = parse_pose(text, &shapes).unwrap();
            assert!(weights.iter().any(|&w| w > 0.5), "{name}");
        }
        let weights = parse_pose("JAW_OPEN=0.25, eyeBlink=1", &shapes).unwrap();
        assert_eq!(weights.iter().sum::<f32>(), 2.25);
        for bad in ["jawOpen", "jawOpen=2", "jawOpen=x", "jawOpne=1"] {
            assert!(parse_pose(bad, &shapes).is_err(), "{bad}");
        }
    }
}
