//! Moving pictures as GIF files.

use std::path::Path;

use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, ImageBuffer, Rgba};

use super::image_buffer::write_whole;
use super::sheet::check_same_size;
use super::{Image, RenderError};

/// Writes frames as an endless GIF.
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
    let hundredths = (frame_secs * 100.0).round().clamp(1.0, 6000.0) as u32;
    write_whole(path.as_ref(), |out| {
        let mut encoder = GifEncoder::new_with_speed(out, 10);
        encoder.set_repeat(Repeat::Infinite)?;
        for frame in frames {
            let opaque = frame.bytes().chunks_exact(3);
            let rgba: Vec<u8> = opaque.flat_map(|p| [p[0], p[1], p[2], 255]).collect();
            let buffer = ImageBuffer::<Rgba<u8>, _>::from_raw(frame.width(), frame.height(), rgba)
                .unwrap_or_default();
            let delay = Delay::from_numer_denom_ms(hundredths * 10, 1);
            encoder.encode_frame(Frame::from_parts(buffer, 0, 0, delay))?;
        }
        Ok(())
    })
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
