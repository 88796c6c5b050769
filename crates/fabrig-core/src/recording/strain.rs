//! Stretch as colour.

/// Stretch that has the full colour: 0.4 is 40 % longer or shorter than at rest.
pub(super) const FULL_SCALE: f32 = 0.4;
/// Steps on either side of rest; few enough that a still node keeps its colour.
const STEPS: f32 = 20.0;
const SHORTENED: [f32; 3] = [38.0, 90.0, 190.0];
const AT_REST: [f32; 3] = [222.0, 220.0, 216.0];
const STRETCHED: [f32; 3] = [196.0, 40.0, 28.0];

/// Blue where shortened, grey at rest, red where stretched. sRGB and opacity.
pub(super) fn strain_color(strain: f32) -> [u8; 4] {
    let share = (strain / FULL_SCALE).clamp(-1.0, 1.0);
    let share = (share * STEPS).round() / STEPS;
    let end = if share < 0.0 { SHORTENED } else { STRETCHED };
    let [r, g, b] = [0, 1, 2].map(|k| {
        let value = AT_REST[k] + (end[k] - AT_REST[k]) * share.abs();
        value.round() as u8
    });
    [r, g, b, 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rest_is_grey_and_the_ends_are_held() {
        assert_eq!(strain_color(0.0), [222, 220, 216, 255]);
        assert_eq!(strain_color(-2.0), [38, 90, 190, 255]);
        assert_eq!(strain_color(0.4), strain_color(9.0));
        assert_eq!(strain_color(0.0001), strain_color(-0.0001));
        let [r, _, b, _] = strain_color(0.2);
        assert!(r > b);
    }
}
