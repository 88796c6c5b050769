//! Contact sheets: pictures of one size in a grid, each with a caption.

use embedded_graphics::text::Alignment;

use super::annotation::{ink_on, text_height, write_text};
use super::{Image, RenderError};

/// Pictures with captions, set row after row.
#[derive(Debug, Clone, Default)]
pub struct Sheet {
    panels: Vec<(Image, String)>,
    title: Option<String>,
}

/// Colour between panels.
const GROUND: [u8; 3] = [246, 247, 249];

impl Sheet {
    /// An empty sheet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Writes a line above all panels.
    pub fn with_title(mut self, title: impl Into<String>) -> Self {
        self.title = Some(title.into());
        self
    }

    /// Adds a panel.
    pub fn push(&mut self, image: Image, caption: impl Into<String>) {
        self.panels.push((image, caption.into()));
    }

    /// Sets the panels into rows of `columns` (at least 1).
    ///
    /// # Errors
    ///
    /// [`RenderError::NoFrames`], [`RenderError::FrameSize`] when panels differ in size, and
    /// [`RenderError::Size`] when the sheet becomes too large.
    pub fn compose(&self, columns: u32) -> Result<Image, RenderError> {
        let (first, _) = self.panels.first().ok_or(RenderError::NoFrames)?;
        let (width, height) = (first.width(), first.height());
        check_same_size(self.panels.iter().map(|(image, _)| image))?;
        let columns = columns.clamp(1, self.panels.len() as u32);
        let rows = (self.panels.len() as u32).div_ceil(columns);
        let text = text_height(height).max(12);
        let band = text + text / 2;
        let gap = 6;
        let head = if self.title.is_some() { band + gap } else { 0 };
        let mut sheet = Image::filled(
            columns.saturating_mul(width + gap) + gap,
            rows.saturating_mul(height + band + gap) + gap + head,
            GROUND,
        )?;
        let ink = ink_on(GROUND);
        if let Some(title) = &self.title {
            let at = [(sheet.width() / 2) as i32, (gap + band / 2) as i32];
            write_text(&mut sheet, title, at, text + 2, ink, Alignment::Center);
        }
        for (i, (image, caption)) in self.panels.iter().enumerate() {
            let x = gap + (i as u32 % columns) * (width + gap);
            let y = gap + head + (i as u32 / columns) * (height + band + gap);
            sheet.paste(image, x, y);
            let at = [(x + width / 2) as i32, (y + height + band / 2) as i32];
            write_text(&mut sheet, caption, at, text, ink, Alignment::Center);
        }
        Ok(sheet)
    }
}

pub(super) fn check_same_size<'a>(
    images: impl IntoIterator<Item = &'a Image>,
) -> Result<(), RenderError> {
    let mut expected = None;
    for (frame, image) in images.into_iter().enumerate() {
        let found = (image.width(), image.height());
        let expected = *expected.get_or_insert(found);
        if found != expected {
            return Err(RenderError::FrameSize {
                frame,
                expected,
                found,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_stand_where_the_grid_says() {
        let mut sheet = Sheet::new();
        for shade in [10u8, 80, 200] {
            let panel = Image::filled(30, 20, [shade; 3]).expect("size");
            sheet.push(panel, format!("{shade}"));
        }
        let image = sheet.compose(2).expect("composed");
        assert_eq!(image.width(), 2 * 36 + 6);
        assert_eq!(image.pixel(7, 7), Some([10; 3]));
        assert_eq!(image.pixel(43, 7), Some([80; 3]));
        sheet.push(Image::filled(31, 20, [0; 3]).expect("size"), "odd");
        assert!(matches!(
            sheet.compose(2),
            Err(RenderError::FrameSize { frame: 3, .. })
        ));
        assert!(matches!(
            Sheet::new().compose(2),
            Err(RenderError::NoFrames)
        ));
    }
}
