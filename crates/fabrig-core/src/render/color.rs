//! Colours: linear light inside, sRGB at the border, and maps from a number to a colour.

use std::ops::{Add, AddAssign, Mul};

/// A colour in linear light, Rec. 709 primaries; 1 is a fully lit white surface.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Rgb(pub [f32; 3]);

impl Rgb {
    /// Black.
    pub const BLACK: Self = Self([0.0; 3]);
    /// White.
    pub const WHITE: Self = Self([1.0; 3]);

    /// From the three bytes that an image editor shows.
    pub fn from_srgb(bytes: [u8; 3]) -> Self {
        Self(bytes.map(|b| {
            let c = f32::from(b) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        }))
    }

    /// To the three bytes of a picture; light above 1 is clipped.
    pub fn to_srgb(self) -> [u8; 3] {
        self.0.map(|c| (encode(c) * 255.0 + 0.5) as u8)
    }

    /// `self` at t = 0, `other` at t = 1.
    pub fn mix(self, other: Self, t: f32) -> Self {
        self * (1.0 - t) + other * t
    }

    /// Channel by channel.
    pub(super) fn filter(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] * other.0[i]))
    }

    /// How far apart two colours look, as the largest difference of encoded channels.
    pub(super) fn contrast(self, other: Self) -> f32 {
        (0..3)
            .map(|i| (encode(self.0[i]) - encode(other.0[i])).abs())
            .fold(0.0, f32::max)
    }
}

/// The sRGB transfer function on [0, 1].
fn encode(c: f32) -> f32 {
    let c = c.clamp(0.0, 1.0);
    if c <= 0.003_130_8 {
        12.92 * c
    } else {
        1.055 * c.powf(1.0 / 2.4) - 0.055
    }
}

impl Add for Rgb {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl AddAssign for Rgb {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<f32> for Rgb {
    type Output = Self;
    fn mul(self, s: f32) -> Self {
        Self(self.0.map(|c| c * s))
    }
}

/// A map from a number to a colour, for errors and other quantities on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColorMap {
    /// Value at the first colour.
    pub low: f64,
    /// Value at the last colour.
    pub high: f64,
    /// Colours in sRGB, evenly spaced from low to high.
    stops: &'static [[u8; 3]],
}

/// Dark blue over green to yellow: monotone in lightness, readable in grey and to most
/// colour-blind eyes.
const SEQUENTIAL: &[[u8; 3]] = &[
    [48, 36, 94],
    [52, 86, 139],
    [36, 132, 141],
    [56, 174, 120],
    [156, 206, 66],
    [250, 228, 60],
];

/// Blue for below, pale for the middle, red for above.
const DIVERGING: &[[u8; 3]] = &[
    [38, 84, 160],
    [125, 168, 214],
    [236, 236, 232],
    [224, 144, 116],
    [166, 38, 46],
];

impl ColorMap {
    /// For quantities that start at zero or a floor (distances, errors).
    pub fn sequential(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            stops: SEQUENTIAL,
        }
    }

    /// For quantities with a sign; give -x, x to keep zero in the middle.
    pub fn diverging(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            stops: DIVERGING,
        }
    }

    /// Colour of a value; values outside the range take the colour of its end, a value that is
    /// not a number takes magenta.
    pub fn color(&self, value: f64) -> Rgb {
        if value.is_nan() {
            return Rgb::from_srgb([255, 0, 255]);
        }
        let span = (self.high - self.low).max(f64::MIN_POSITIVE);
        let x = ((value - self.low) / span).clamp(0.0, 1.0) * (self.stops.len() - 1) as f64;
        let i = (x as usize).min(self.stops.len() - 2);
        Rgb::from_srgb(self.stops[i]).mix(Rgb::from_srgb(self.stops[i + 1]), (x - i as f64) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_survive_the_way_through_linear_light() {
        for b in 0..=255u8 {
            let c = [b, 255 - b, b / 2];
            assert_eq!(Rgb::from_srgb(c).to_srgb(), c);
        }
    }

    #[test]
    fn the_ends_of_a_map_are_its_colours() {
        let map = ColorMap::sequential(1.0, 3.0);
        assert_eq!(map.color(-5.0).to_srgb(), SEQUENTIAL[0]);
        assert_eq!(map.color(9.0).to_srgb(), SEQUENTIAL[5]);
        let zero = ColorMap::diverging(-2.0, 2.0).color(0.0);
        assert_eq!(zero.to_srgb(), DIVERGING[2]);
    }
}
