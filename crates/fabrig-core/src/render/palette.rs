//! One palette for all frames of an animation, and the dither that hides its steps.
//!
//! A palette of its own for every frame makes still parts flicker. Dithering by a fixed pattern
//! (Bayer's ordered dither) keeps a still part the same pixels, which a GIF then stores once.

use color_quant::NeuQuant;
use rayon::prelude::*;

use super::Image;

/// Colours of the palette; one of GIF's 256 is left for what stays as it was.
const COLORS: usize = 255;
/// The index of what stays as it was.
pub(super) const UNCHANGED: u8 = 255;
/// Pixels that the palette is made from.
const SAMPLES: usize = 400_000;
/// How much of all pixels NeuQuant looks at, 1 (all) to 30.
const SAMPLE_STEP: i32 = 3;
/// Half the span of the dither; about the distance of neighbouring colours of a palette.
const DITHER: i32 = 5;
/// Bits per channel that the table of nearest colours tells apart.
const TABLE_BITS: u32 = 6;

/// Colours, and the nearest of them to any colour.
pub(super) struct Palette {
    colors: Vec<u8>,
    nearest: Vec<u8>,
}

impl Palette {
    /// The colours that frames need most.
    pub(super) fn of(frames: &[Image]) -> Self {
        let count: usize = frames.iter().map(|frame| frame.bytes().len() / 3).sum();
        // An odd step does not fall on the same columns of every row.
        let step = (count / SAMPLES) | 1;
        let samples: Vec<u8> = frames
            .iter()
            .flat_map(|frame| frame.bytes().chunks_exact(3))
            .step_by(step)
            .flat_map(|p| [p[0], p[1], p[2], 255])
            .collect();
        let network = NeuQuant::new(SAMPLE_STEP, COLORS, &samples);
        let colors = network.color_map_rgb();
        let side = 1usize << TABLE_BITS;
        let middle = |k: usize| ((k << (8 - TABLE_BITS)) + (1 << (7 - TABLE_BITS))) as i32;
        let nearest = (0..side * side * side)
            .into_par_iter()
            .map(|i| {
                let color = [i / (side * side), i / side % side, i % side].map(middle);
                nearest(&colors, color)
            })
            .collect();
        Self { colors, nearest }
    }

    /// Red, green and blue of each colour.
    pub(super) fn colors(&self) -> &[u8] {
        &self.colors
    }

    /// The colours of a frame, dithered.
    pub(super) fn indices(&self, frame: &Image) -> Vec<u8> {
        let width = frame.width() as usize;
        let pixels = frame.bytes().par_chunks_exact(3).enumerate();
        pixels
            .map(|(i, pixel)| {
                let shift = dither(i % width, i / width);
                let cell =
                    |c: u8| (i32::from(c) + shift).clamp(0, 255) as usize >> (8 - TABLE_BITS);
                let [r, g, b] = [cell(pixel[0]), cell(pixel[1]), cell(pixel[2])];
                self.nearest[(((r << TABLE_BITS) | g) << TABLE_BITS) | b]
            })
            .collect()
    }
}

/// The first of the nearest colours.
fn nearest(colors: &[u8], [r, g, b]: [i32; 3]) -> u8 {
    let distance = |c: &[u8]| {
        let [dr, dg, db] = [
            i32::from(c[0]) - r,
            i32::from(c[1]) - g,
            i32::from(c[2]) - b,
        ];
        // The eye sees green best and blue least.
        2 * dr * dr + 4 * dg * dg + db * db
    };
    let all = colors.chunks_exact(3).enumerate();
    all.min_by_key(|(_, c)| distance(c))
        .map_or(0, |(i, _)| i as u8)
}

/// Bayer's pattern of 8 by 8, spread over [-DITHER, DITHER].
fn dither(x: usize, y: usize) -> i32 {
    // The bits of x ^ y and y, interleaved from the lowest.
    let level = (0..3).fold(0, |level, bit| {
        let (a, b) = ((x ^ y) >> bit & 1, y >> bit & 1);
        level << 2 | a << 1 | b
    });
    ((2 * level as i32 - 63) * DITHER) / 63
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pattern_has_every_level_once_and_no_bias() {
        let mut levels: Vec<i32> = (0..64)
            .map(|i| {
                (0..3).fold(0, |level, bit| {
                    let (x, y) = (i % 8, i / 8);
                    level << 2 | ((x ^ y) >> bit & 1) << 1 | (y >> bit & 1)
                })
            })
            .collect();
        levels.sort_unstable();
        assert!(levels.iter().copied().eq(0..64));
        let sum: i32 = (0..64).map(|i| dither(i % 8, i / 8)).sum();
        assert_eq!(sum, 0);
    }

    #[test]
    fn a_smooth_gradient_keeps_its_local_mean() {
        let (width, height) = (256, 64);
        let mut image = Image::filled(width, height, [0; 3]).expect("size");
        for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
            image.set(x, y, [200, x as u8, 150 - (x / 2) as u8]);
        }
        let palette = Palette::of(std::slice::from_ref(&image));
        let indices = palette.indices(&image);
        for block in 1..31 {
            let (mut found, mut wanted) = (0.0, 0.0);
            for y in 0..8 {
                for x in 8 * block..8 * block + 8 {
                    let index = usize::from(indices[y * 256 + x]);
                    found += f64::from(palette.colors()[3 * index + 1]) / 64.0;
                    wanted += x as f64 / 64.0;
                }
            }
            assert!((found - wanted).abs() < 2.5, "{block}: {found} {wanted}");
        }
    }
}
