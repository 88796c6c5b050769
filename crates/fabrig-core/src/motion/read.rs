//! Reads a take of either kind.

use std::path::Path;

use super::{Clip, MotionError, csv_take, keys};

/// Weights up to this far outside [0, 1] are taken for rounding and clamped (and counted);
/// ARKit itself reports up to 1.0034.
pub const WEIGHT_TOLERANCE: f64 = 0.05;

/// What a reader may assume.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReadOptions {
    /// Frames per second of a CSV that has frame numbers, or no times at all.
    pub frame_rate: Option<f64>,
    /// Frames per second that timecodes count in; found from the numbers when `None`.
    pub timecode_rate: Option<f64>,
    /// Pass over columns whose names are not known, instead of refusing the file.
    pub ignore_unknown_columns: bool,
    /// Clamp weights however far outside [0, 1] they are, instead of refusing the file.
    pub clamp_weights: bool,
}

/// Reads a take: keyed text if it starts with `fabrig-keys`, CSV otherwise.
///
/// # Errors
///
/// [`MotionError`] with the row and column, or the line.
pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Clip, MotionError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|source| MotionError::Read {
        path: path.to_owned(),
        source,
    })?;
    parse(
        &String::from_utf8_lossy(&bytes),
        &path.display().to_string(),
        options,
    )
}

/// [`read`] from text in memory; `name` stands for the file in errors.
///
/// # Errors
///
/// See [`read`].
pub fn parse(text: &str, name: &str, options: &ReadOptions) -> Result<Clip, MotionError> {
    let text = text.trim_start_matches('\u{feff}');
    if text.trim_start().starts_with(keys::MAGIC) {
        keys::parse_keys(text, name)
    } else {
        csv_take::parse_csv(text, name, options)
    }
}
