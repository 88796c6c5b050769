//! Marker trajectories: where points on a face were, frame by frame.
//!
//! C3D (binary, [c3d.org](https://www.c3d.org)'s format) and TRC (Motion Analysis' text) are
//! read. What is needed of C3D is small, the points and how they are stored; the crate there
//! is for it panics on damaged files, so it is read here.

mod c3d;
mod trc;

use std::path::Path;

use super::MotionError;
use crate::Point;

/// Named points over time.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerTake {
    /// Names of the markers.
    pub names: Vec<String>,
    /// Times of the frames, from 0. (s)
    pub times: Vec<f64>,
    /// Positions (mm), `None` where a marker was not seen, row-major, shape
    /// [frame_count, marker_count].
    pub positions: Vec<Option<Point>>,
}

impl MarkerTake {
    /// Reads C3D or TRC, by content.
    ///
    /// # Errors
    ///
    /// [`MotionError::Read`], [`MotionError::Markers`] with the place in the file.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, MotionError> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|source| MotionError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&bytes, &path.display().to_string())
    }

    /// [`Self::read`] from memory; `name` stands for the file in errors.
    ///
    /// # Errors
    ///
    /// [`MotionError::Markers`].
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self, MotionError> {
        let take = if c3d::is_c3d(bytes) {
            c3d::parse(bytes)
        } else {
            match std::str::from_utf8(bytes) {
                Ok(text) => trc::parse(text),
                Err(_) => Err("it is neither C3D nor TRC".to_owned()),
            }
        };
        let problem = |problem| MotionError::Markers {
            name: name.to_owned(),
            problem,
        };
        let take = take.map_err(problem)?;
        if take.names.is_empty() || take.times.is_empty() {
            return Err(problem("it has no markers or no frames".to_owned()));
        }
        Ok(take)
    }

    /// Positions of all markers in one frame.
    pub fn frame(&self, frame: usize) -> &[Option<Point>] {
        let count = self.names.len();
        &self.positions[frame * count..(frame + 1) * count]
    }
}

/// Millimetres of a unit by its name.
fn unit_in_mm(unit: &str) -> Result<f64, String> {
    match unit.trim().to_ascii_lowercase().as_str() {
        "mm" | "" => Ok(1.0),
        "cm" => Ok(10.0),
        "m" | "meters" | "metres" => Ok(1000.0),
        "in" | "inch" | "inches" => Ok(25.4),
        other => Err(format!(
            "the unit '{other}' is not known; mm, cm, m and in are"
        )),
    }
}
