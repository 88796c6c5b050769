//! Reads a take of any kind.

use std::path::Path;

use super::{Adjustment, Clip, MotionError, csv, face_cap, keys, mediapipe};
use crate::facs::ActionUnitTable;

/// Weights up to this far outside [0, 1] are taken for rounding and clamped (and counted);
/// ARKit itself reports up to 1.0034.
pub const WEIGHT_TOLERANCE: f64 = 0.05;

/// What wrote a take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TakeFormat {
    /// Keyed text that starts with `fabrig-keys`.
    Keys,
    /// A table with ARKit's shapes as columns: Live Link Face and others.
    Arkit,
    /// OpenFace's table of action units.
    OpenFace,
    /// py-feat's table of action units.
    PyFeat,
    /// Text of the Face Cap app.
    FaceCap,
    /// MediaPipe's blendshapes, JSON or a table.
    MediaPipe,
}

/// What a reader may assume.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReadOptions {
    /// What wrote the take; found from its content when `None`.
    pub format: Option<TakeFormat>,
    /// Frames per second of a take that has frame numbers, or no times at all.
    pub frame_rate: Option<f64>,
    /// Frames per second that timecodes count in; found from the numbers when `None`.
    pub timecode_rate: Option<f64>,
    /// Columns that would be seconds (`time`, `timestamp`) are milliseconds.
    pub times_in_milliseconds: bool,
    /// Pass over columns whose names are not known, instead of refusing the file.
    pub ignore_unknown_columns: bool,
    /// Clamp weights however far outside [0, 1] they are, instead of refusing the file.
    pub clamp_weights: bool,
    /// What action units do to the shapes; the bundled table when `None`.
    pub action_units: Option<ActionUnitTable>,
    /// How the take is fitted to its performer.
    pub adjust: Adjustment,
}

impl ReadOptions {
    pub(super) fn check(&self, name: &str) -> Result<(), MotionError> {
        let rates = [self.frame_rate, self.timecode_rate].into_iter().flatten();
        for found in rates {
            if !(found.is_finite() && found > 0.0) {
                return Err(MotionError::BadFrameRate {
                    name: name.to_owned(),
                    found,
                });
            }
        }
        Ok(())
    }
}

/// Reads a take; what it is shows from its content unless the options say it.
///
/// # Errors
///
/// [`MotionError`] with the row and column, the line or the frame.
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
    options.check(name)?;
    let text = text.trim_start_matches('\u{feff}').trim_start();
    let clip = match options.format.unwrap_or_else(|| format_of(text)) {
        TakeFormat::Keys => keys::parse_keys_with(text, name, options),
        TakeFormat::FaceCap => face_cap::parse_face_cap(text, name, options),
        TakeFormat::MediaPipe if is_json(text) => mediapipe::parse_json(text, name, options),
        TakeFormat::MediaPipe if is_long(text) => csv::parse_long(text, name, options),
        TakeFormat::MediaPipe | TakeFormat::Arkit | TakeFormat::OpenFace | TakeFormat::PyFeat => {
            return csv::parse_csv(text, name, options);
        }
    }?;
    options.adjust.apply(clip, name)
}

fn is_json(text: &str) -> bool {
    text.starts_with(['{', '['])
}

fn is_long(text: &str) -> bool {
    let headings = csv::split_heading(text);
    headings
        .iter()
        .any(|h| h.eq_ignore_ascii_case("categoryName") || h.eq_ignore_ascii_case("category_name"))
}

fn format_of(text: &str) -> TakeFormat {
    if text.starts_with(keys::MAGIC) {
        TakeFormat::Keys
    } else if is_json(text) {
        TakeFormat::MediaPipe
    } else if face_cap::is_face_cap(text) {
        TakeFormat::FaceCap
    } else {
        csv::recognize(&csv::split_heading(text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_are_told_apart_by_their_content() {
        let cases = [
            ("fabrig-keys 1\n0 jawOpen=1", TakeFormat::Keys),
            ("[]", TakeFormat::MediaPipe),
            ("{\"frames\":[]}", TakeFormat::MediaPipe),
            ("frame,categoryName,score\n", TakeFormat::MediaPipe),
            ("time,_neutral,jawOpen\n", TakeFormat::MediaPipe),
            ("info,x\nbs,jawOpen\nk,0", TakeFormat::FaceCap),
            ("Timecode,BlendShapeCount,EyeBlinkLeft\n", TakeFormat::Arkit),
            ("time;jawOpen;AU12\n", TakeFormat::Arkit),
            ("frame, timestamp, AU01_r, AU01_c\n", TakeFormat::OpenFace),
            ("frame,AU01,AU12\n", TakeFormat::PyFeat),
            ("frame,AU12_l,AU12_r\n", TakeFormat::PyFeat),
        ];
        for (text, expected) in cases {
            assert_eq!(format_of(text), expected, "{text}");
        }
    }
}
