//! Text on a picture: names with leader lines, legends, captions.

use embedded_graphics::Drawable;
use embedded_graphics::geometry::Point as PixelPoint;
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle, iso_8859_1};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::primitives::{Circle, Line, Primitive, PrimitiveStyle};
use embedded_graphics::text::{Alignment, Baseline, Text};

use super::{Camera, ColorMap, Image, Rgb};
use crate::Point;

/// A name for a place, written at the left or right margin with a line to the place.
#[derive(Debug, Clone, PartialEq)]
pub struct Label {
    /// The place.
    pub anchor: Point,
    /// The name; characters outside Latin-1 show as `?`.
    pub text: String,
    /// Colour of the line's end, to tie the name to what it names.
    pub color: Rgb,
}

/// A colour bar with numbers at its ends and middle.
#[derive(Debug, Clone, PartialEq)]
pub struct Legend {
    /// The map it explains.
    pub map: ColorMap,
    /// Quantity and unit, such as `distance (mm)`.
    pub title: String,
}

/// The font for text about `height` pixels high.
fn font(height: u32) -> &'static MonoFont<'static> {
    match height {
        0..=9 => &iso_8859_1::FONT_5X8,
        10..=11 => &iso_8859_1::FONT_6X10,
        12 => &iso_8859_1::FONT_6X12,
        13..=14 => &iso_8859_1::FONT_7X13,
        15..=17 => &iso_8859_1::FONT_9X15,
        _ => &iso_8859_1::FONT_10X20,
    }
}

/// Height of text that suits a picture's height. (pixels)
pub(super) fn text_height(picture_height: u32) -> u32 {
    (picture_height / 46).clamp(9, 20)
}

fn pixel_color(color: [u8; 3]) -> Rgb888 {
    Rgb888::new(color[0], color[1], color[2])
}

/// Dark text on light ground and the reverse.
pub(super) fn ink_on(ground: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = ground.map(u32::from);
    if 2 * r + 5 * g + b > 8 * 110 {
        [30, 32, 36]
    } else {
        [232, 234, 238]
    }
}

/// Writes one line; `x` is its left end, middle or right end by `alignment`, `y` its middle.
pub(super) fn write_text(
    image: &mut Image,
    text: &str,
    [x, y]: [i32; 2],
    height: u32,
    color: [u8; 3],
    alignment: Alignment,
) {
    let style = MonoTextStyle::new(font(height), pixel_color(color));
    let mut text = Text::with_alignment(text, PixelPoint::new(x, y), style, alignment);
    text.text_style.baseline = Baseline::Middle;
    let Ok(_) = text.draw(image);
}

/// Width of a line of text. (pixels)
fn text_width(text: &str, height: u32) -> i32 {
    let font = font(height);
    let cell = font.character_size.width + font.character_spacing;
    (text.chars().count() as u32 * cell) as i32
}

/// Spreads sorted heights so that neighbours are at least `gap` apart and all lie in
/// [low, high] where that is possible, each as near its wish as the others allow.
fn spread(wishes: &[f64], gap: f64, low: f64, high: f64) -> Vec<f64> {
    let gap = gap.min((high - low) / wishes.len().max(1) as f64);
    // Pool adjacent violators: a block of crowded names sits around the mean of its wishes.
    let mut blocks: Vec<(f64, usize)> = Vec::new();
    for (i, wish) in wishes.iter().enumerate() {
        blocks.push((wish - gap * i as f64, 1));
        while let [.., (a, m), (b, n)] = blocks[..] {
            if a <= b {
                break;
            }
            blocks.truncate(blocks.len() - 2);
            blocks.push(((a * m as f64 + b * n as f64) / (m + n) as f64, m + n));
        }
    }
    let last = wishes.len().saturating_sub(1) as f64;
    let mut placed = Vec::with_capacity(wishes.len());
    for (base, count) in blocks {
        let base = base.clamp(low, (high - gap * last).max(low));
        for _ in 0..count {
            placed.push(base + gap * placed.len() as f64);
        }
    }
    placed
}

/// Space between a name and the picture's edge, and between it and its line. (pixels)
const NAME_SPACE: i32 = 6;

/// Share of the picture's width that its widest name takes at the margin.
pub(super) fn label_margin(labels: &[Label], width: u32, height: u32) -> f64 {
    let text_size = text_height(height);
    let widths = labels
        .iter()
        .map(|label| text_width(&label.text, text_size));
    let widest = widths.max().map_or(0, |widest| widest + 3 * NAME_SPACE);
    f64::from(widest) / f64::from(width)
}

/// Writes every name at the margin on its side of the picture. The names of a side end at one
/// line towards the middle, so that no leader crosses a name.
pub(super) fn draw_labels(image: &mut Image, labels: &[Label], camera: &Camera) {
    let (width, height) = (image.width(), image.height());
    let text_size = text_height(height);
    let mut sides: [Vec<(&Label, [f64; 2])>; 2] = [Vec::new(), Vec::new()];
    let mut seen: Vec<(&Label, [f64; 2])> = labels
        .iter()
        .filter_map(|label| Some((label, camera.project(&label.anchor, width, height)?)))
        .collect();
    seen.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    // The half further left goes left; names on one side stay in the order of their places.
    let split = seen
        .iter()
        .filter(|(_, at)| at[0] < f64::from(width) / 2.0)
        .count()
        .clamp(seen.len() / 3, seen.len() - seen.len() / 3);
    for (i, item) in seen.into_iter().enumerate() {
        sides[usize::from(i >= split)].push(item);
    }
    for (side, mut items) in sides.into_iter().enumerate() {
        items.sort_by(|a, b| a.1[1].total_cmp(&b.1[1]));
        let gap = f64::from(text_size) * 1.25;
        let widths = items
            .iter()
            .map(|(label, _)| text_width(&label.text, text_size));
        let column = NAME_SPACE + widths.max().unwrap_or(0);
        let wishes: Vec<f64> = items.iter().map(|(_, at)| at[1]).collect();
        let heights = spread(&wishes, gap, gap, f64::from(height) - gap);
        for ((label, at), y) in items.into_iter().zip(heights) {
            draw_label(image, label, at, [f64::from(column), y], side == 1);
        }
    }
}

fn draw_label(
    image: &mut Image,
    label: &Label,
    at: [f64; 2],
    [column, y]: [f64; 2],
    is_right: bool,
) {
    let width = image.width() as i32;
    let text_size = text_height(image.height());
    let column = column as i32;
    let (x, line_x, alignment) = if is_right {
        let x = width - column;
        (x, x - NAME_SPACE, Alignment::Left)
    } else {
        (column, column + NAME_SPACE, Alignment::Right)
    };
    let y = y.round() as i32;
    let ground = image
        .pixel(x.clamp(0, width - 1) as u32, y.max(0) as u32)
        .unwrap_or([255; 3]);
    let ink = ink_on(ground);
    let color = pixel_color(label.color.to_srgb());
    let end = PixelPoint::new(at[0].round() as i32, at[1].round() as i32);
    let Ok(()) = Line::new(PixelPoint::new(line_x, y), end)
        .into_styled(PrimitiveStyle::with_stroke(color, 1))
        .draw(image);
    let Ok(()) = Circle::with_center(end, 7)
        .into_styled(PrimitiveStyle::with_fill(pixel_color([20, 20, 22])))
        .draw(image);
    let Ok(()) = Circle::with_center(end, 5)
        .into_styled(PrimitiveStyle::with_fill(color))
        .draw(image);
    write_text(image, &label.text, [x, y], text_size, ink, alignment);
}

/// Draws the colour bar along the lower edge.
pub(super) fn draw_legend(image: &mut Image, legend: &Legend) {
    let (width, height) = (image.width(), image.height());
    let text_size = text_height(height);
    let bar_width = width * 2 / 5;
    let bar_height = (text_size * 2 / 3).max(5);
    let left = (width - bar_width) / 2;
    let top = height.saturating_sub(bar_height + text_size * 2);
    let span = legend.map.high - legend.map.low;
    for x in 0..bar_width {
        let value = legend.map.low + span * f64::from(x) / f64::from(bar_width.max(2) - 1);
        let color = legend.map.color(value).to_srgb();
        for y in 0..bar_height {
            image.set(left + x, top + y, color);
        }
    }
    let ground = image.pixel(2, height - 2).unwrap_or([255; 3]);
    let ink = ink_on(ground);
    let below = (top + bar_height + text_size * 2 / 3) as i32;
    for k in 0..3u32 {
        let value = legend.map.low + span * f64::from(k) / 2.0;
        let x = (left + bar_width * k / 2) as i32;
        let text = format!("{value:.2}");
        write_text(image, &text, [x, below], text_size, ink, Alignment::Center);
    }
    let above = top as i32 - (text_size * 2 / 3) as i32;
    let middle = (width / 2) as i32;
    write_text(
        image,
        &legend.title,
        [middle, above],
        text_size,
        ink,
        Alignment::Center,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_their_order_and_distance() {
        let placed = spread(&[10.0, 11.0, 12.0, 80.0], 8.0, 5.0, 95.0);
        assert!(
            placed.windows(2).all(|w| w[1] - w[0] >= 8.0 - 1e-9),
            "{placed:?}"
        );
        assert!((placed[3] - 80.0).abs() < 1e-9);
        assert!((placed[1] - 11.0).abs() < 2.1, "{placed:?}");
    }

    #[test]
    fn too_many_names_share_the_room_there_is() {
        let placed = spread(&[50.0; 20], 10.0, 0.0, 100.0);
        assert!(placed[0] >= 0.0 && placed[19] <= 100.0, "{placed:?}");
        assert!(placed.windows(2).all(|w| w[1] > w[0]));
    }
}
