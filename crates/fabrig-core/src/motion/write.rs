//! Writes a take as CSV.

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use super::Clip;
use crate::atomic_file::write_atomically;

impl Clip {
    /// The clip as CSV that [`super::parse_csv`] reads back: `time` (s), the shapes, and head
    /// and eye rotation as Live Link Face has them.
    pub fn to_csv(&self) -> String {
        let tracks = self.tracks();
        let mut text = String::from("time");
        for channel in self.channels() {
            text.push(',');
            text.push_str(channel);
        }
        if !tracks.head.is_empty() {
            text.push_str(",HeadYaw,HeadPitch,HeadRoll");
        }
        if !tracks.eyes.is_empty() {
            text.push_str(",LeftEyeYaw,LeftEyePitch,RightEyeYaw,RightEyePitch");
        }
        text.push('\n');
        let count = self.channels().len();
        for (frame, time) in self.times().iter().enumerate() {
            // Writing to a string does not fail.
            let _ = write!(text, "{time:.6}");
            for weight in &self.weights()[frame * count..(frame + 1) * count] {
                let _ = write!(text, ",{weight:.6}");
            }
            if let Some(head) = tracks.head.get(frame) {
                let angles = [-head.yaw, head.pitch, -head.roll];
                let _ = write!(text, ",{:.6},{:.6},{:.6}", angles[0], angles[1], angles[2]);
            }
            for eye in tracks.eyes.get(frame).into_iter().flatten() {
                let _ = write!(text, ",{:.6},{:.6}", -eye.yaw, eye.pitch);
            }
            text.push('\n');
        }
        text
    }
}

/// Writes a clip as CSV; what stood there stays until the new file is whole.
///
/// # Errors
///
/// What the system says.
pub fn write_csv(clip: &Clip, path: impl AsRef<Path>) -> io::Result<()> {
    let text = clip.to_csv();
    write_atomically(path.as_ref(), |file| file.write_all(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use crate::motion::{ReadOptions, parse_csv};

    #[test]
    fn what_is_written_is_read_back() {
        let text = "time,jawOpen,HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,LeftEyePitch,RightEyeYaw,\
                    RightEyePitch\n0.000000,0.250000,0.1,0.2,0.3,0.4,0.5,0.6,0.7\n\
                    0.500000,1.000000,0,0,0,0,0,0,0\n";
        let clip = parse_csv(text, "x", &ReadOptions::default()).unwrap();
        let back = parse_csv(&clip.to_csv(), "y", &ReadOptions::default()).unwrap();
        assert_eq!(clip, back);
    }
}
