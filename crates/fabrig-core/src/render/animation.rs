//! Moving pictures as GIF files.

use std::path::Path;

use gif::{DisposalMethod, Encoder, Frame, Repeat};
use image::ImageError;
use image::error::{EncodingError, ImageFormatHint};

use super::image_buffer::write_whole;
use super::palette::{Palette, UNCHANGED};
use super::sheet::check_same_size;
use super::{Image, RenderError};

/// Writes frames as an endless GIF with one palette for all of them.
///
/// - `frame_secs`: time each frame stays (s); GIF counts hundredths, and most viewers slow
///   anything below 0.02 s down.
///
/// # Errors
///
/// [`RenderError::NoFrames`], [`RenderError::FrameSize`] when frames differ in size, and
/// [`RenderError::Write`] or [`RenderError::Encode`].
pub fn write_gif(
    path: impl AsRef<Path>,
    frames: &[Image],
    frame_secs: f64,
) -> Result<(), RenderError> {
    if frames.is_empty() {
        return Err(RenderError::NoFrames);
    }
    check_same_size(frames)?;
    let hundredths = (frame_secs * 100.0).round().clamp(1.0, 6000.0) as u16;
    let [width, height] = [frames[0].width(), frames[0].height()].map(|side| side as u16);
    let palette = Palette::of(frames);
    write_whole(path.as_ref(), |out| {
        let mut encoder = Encoder::new(out, width, height, palette.colors()).map_err(encoding)?;
        encoder.set_repeat(Repeat::Infinite).map_err(encoding)?;
        let mut shown: Vec<u8> = Vec::new();
        for frame in frames {
            let indices = palette.indices(frame);
            let changed = |(&now, &before): (&u8, &u8)| if now == before { UNCHANGED } else { now };
            let buffer = if shown.is_empty() {
                indices.clone()
            } else {
                indices.iter().zip(&shown).map(changed).collect()
            };
            shown = indices;
            encoder
                .write_frame(&Frame {
                    delay: hundredths,
                    dispose: DisposalMethod::Keep,
                    transparent: Some(UNCHANGED),
                    width,
                    height,
                    buffer: buffer.into(),
                    ..Frame::default()
                })
                .map_err(encoding)?;
        }
        Ok(())
    })
}

fn encoding(error: gif::EncodingError) -> ImageError {
    match error {
        gif::EncodingError::Io(error) => ImageError::IoError(error),
        other => ImageError::Encoding(EncodingError::new(
            ImageFormatHint::Exact(image::ImageFormat::Gif),
            other,
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::AnimationDecoder;

    #[test]
    fn frames_come_back_from_the_file() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("two.gif");
        let frames = [
            Image::filled(9, 7, [250, 10, 10]).expect("size"),
            Image::filled(9, 7, [10, 10, 250]).expect("size"),
        ];
        write_gif(&path, &frames, 0.05).expect("written");
        let file = std::io::BufReader::new(std::fs::File::open(&path).expect("open"));
        let decoder = image::codecs::gif::GifDecoder::new(file).expect("gif");
        let found = decoder.into_frames().collect_frames().expect("frames");
        assert_eq!(found.len(), 2);
        let [r, _, b, _] = found[1].buffer().get_pixel(4, 4).0;
        assert!(b > 200 && r < 60);
        assert!(matches!(
            write_gif(&path, &[], 0.1),
            Err(RenderError::NoFrames)
        ));
    }
}
