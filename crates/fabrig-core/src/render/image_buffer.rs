//! Pixels: a finished picture, written whole or not at all.

use std::io::Write;
use std::path::Path;

use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Size};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::RenderError;
use crate::atomic_file::write_atomically;

/// Longest side of a picture. (pixels)
const SIDE_LIMIT: u32 = 16_384;

/// A finished picture: 8-bit sRGB, rows from the top, no alpha.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<u8>,
}

impl Image {
    /// A picture of one colour.
    ///
    /// # Errors
    ///
    /// [`RenderError::Size`] when a side is 0 or beyond 16,384.
    pub fn filled(width: u32, height: u32, color: [u8; 3]) -> Result<Self, RenderError> {
        check_size(width, height)?;
        Ok(Self {
            width,
            height,
            pixels: color.repeat(width as usize * height as usize),
        })
    }

    /// A picture from its pixels: red, green, blue, row after row.
    ///
    /// # Errors
    ///
    /// [`RenderError::Size`] as [`Self::filled`], [`RenderError::ByteCount`].
    pub fn from_bytes(width: u32, height: u32, pixels: Vec<u8>) -> Result<Self, RenderError> {
        check_size(width, height)?;
        let expected = 3 * width as usize * height as usize;
        if pixels.len() != expected {
            return Err(RenderError::ByteCount {
                expected,
                found: pixels.len(),
            });
        }
        Ok(Self {
            width,
            height,
            pixels,
        })
    }

    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Red, green, blue of every pixel, row after row.
    pub fn bytes(&self) -> &[u8] {
        &self.pixels
    }

    /// Colour of one pixel; `None` outside.
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 3]> {
        let i = self.index(x, y)?;
        Some([self.pixels[i], self.pixels[i + 1], self.pixels[i + 2]])
    }

    fn index(&self, x: u32, y: u32) -> Option<usize> {
        (x < self.width && y < self.height)
            .then(|| (y as usize * self.width as usize + x as usize) * 3)
    }

    /// Sets one pixel; outside is ignored.
    pub(super) fn set(&mut self, x: u32, y: u32, color: [u8; 3]) {
        if let Some(i) = self.index(x, y) {
            self.pixels[i..i + 3].copy_from_slice(&color);
        }
    }

    /// Copies a picture into this one with its upper left corner at (x, y).
    pub(super) fn paste(&mut self, other: &Self, x: u32, y: u32) {
        for row in 0..other.height {
            for column in 0..other.width {
                if let Some(color) = other.pixel(column, row) {
                    self.set(x + column, y + row, color);
                }
            }
        }
    }

    /// Writes a PNG file.
    ///
    /// # Errors
    ///
    /// [`RenderError::Write`], [`RenderError::Encode`].
    pub fn save_png(&self, path: impl AsRef<Path>) -> Result<(), RenderError> {
        let path = path.as_ref();
        write_whole(path, |out| {
            PngEncoder::new(out).write_image(
                &self.pixels,
                self.width,
                self.height,
                ExtendedColorType::Rgb8,
            )
        })
    }
}

pub(super) fn check_size(width: u32, height: u32) -> Result<(), RenderError> {
    if width == 0 || height == 0 || width.max(height) > SIDE_LIMIT {
        return Err(RenderError::Size {
            width,
            height,
            limit: SIDE_LIMIT,
        });
    }
    Ok(())
}

/// Encodes into a file that appears whole or not at all.
pub(super) fn write_whole(
    path: &Path,
    encode: impl FnOnce(&mut dyn Write) -> Result<(), image::ImageError>,
) -> Result<(), RenderError> {
    write_atomically(path, |out| encode(out).map_err(Failure::Encode)).map_err(|failure| {
        let path = path.to_owned();
        match failure {
            Failure::Write(source) => RenderError::Write { path, source },
            Failure::Encode(source) => RenderError::Encode { path, source },
        }
    })
}

/// What can fail before the file's name is known.
enum Failure {
    Write(std::io::Error),
    Encode(image::ImageError),
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Write(error)
    }
}

impl OriginDimensions for Image {
    fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }
}

impl DrawTarget for Image {
    type Color = Rgb888;
    type Error = std::convert::Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> Result<(), Self::Error>
    where
        I: IntoIterator<Item = Pixel<Self::Color>>,
    {
        for Pixel(at, color) in pixels {
            if let (Ok(x), Ok(y)) = (u32::try_from(at.x), u32::try_from(at.y)) {
                self.set(x, y, [color.r(), color.g(), color.b()]);
            }
        }
        Ok(())
    }
}
