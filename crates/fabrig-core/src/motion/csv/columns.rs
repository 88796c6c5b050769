//! What the headings of a table mean.

use crate::facs::{ARKIT_SHAPES, ShapeMatch, Side, match_shape, match_unit};
use crate::motion::TakeFormat;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Column {
    Timecode,
    Seconds,
    Milliseconds,
    Frame,
    /// Index into [`ARKIT_SHAPES`].
    Shape(usize),
    /// Index into [`ANGLES`].
    Angle(usize),
    /// A FACS action unit and the side that it acts on; both without one.
    Unit(u32, Option<Side>),
    /// Index into [`CAMERA_ANGLES`].
    CameraAngle(usize),
    /// Whether the face was found, 0 or 1.
    Success,
    /// How sure the tracker is, 0 to 1.
    Confidence,
    /// Which face of several.
    Face,
    Unused,
}

/// Rotation columns of Live Link Face.
pub(super) const ANGLES: [&str; 7] = [
    "HeadYaw",
    "HeadPitch",
    "HeadRoll",
    "LeftEyeYaw",
    "LeftEyePitch",
    "RightEyeYaw",
    "RightEyePitch",
];
pub(super) const HEAD_ANGLES: std::ops::Range<usize> = 0..3;
pub(super) const EYE_ANGLES: std::ops::Range<usize> = 3..7;

/// Rotation columns of OpenFace, about the camera's axes.
pub(super) const CAMERA_ANGLES: [&str; 3] = ["pose_Rx", "pose_Ry", "pose_Rz"];

const OTHER_NAMES: [(&str, Column); 17] = [
    ("Timecode", Column::Timecode),
    ("time", Column::Seconds),
    ("seconds", Column::Seconds),
    ("timestamp", Column::Seconds),
    ("timestamp_ms", Column::Milliseconds),
    ("time_ms", Column::Milliseconds),
    ("frame", Column::Frame),
    ("FrameNumber", Column::Frame),
    ("frame_index", Column::Frame),
    ("BlendShapeCount", Column::Unused),
    ("LeftEyeRoll", Column::Unused),
    ("RightEyeRoll", Column::Unused),
    // MediaPipe's score for a face at rest.
    ("_neutral", Column::Unused),
    ("success", Column::Success),
    ("confidence", Column::Confidence),
    ("face_id", Column::Face),
    ("Identity", Column::Face),
];

/// The meaning of one heading in a table of the given kind; `None` where it is not known.
pub(super) fn column_of(heading: &str, format: TakeFormat) -> Option<Column> {
    let is = |name: &str| {
        let letters = heading.chars().filter(char::is_ascii_alphanumeric);
        let others = name.chars().filter(char::is_ascii_alphanumeric);
        letters
            .map(|c| c.to_ascii_lowercase())
            .eq(others.map(|c| c.to_ascii_lowercase()))
    };
    if let Some((_, column)) = OTHER_NAMES.iter().find(|(name, _)| is(name)) {
        return Some(*column);
    }
    match format {
        TakeFormat::OpenFace => Some(open_face_column(heading)),
        TakeFormat::PyFeat => Some(match match_unit(heading) {
            Some(unit) => Column::Unit(unit.number, unit.side),
            None => Column::Unused,
        }),
        _ => {
            if let Some(angle) = ANGLES.iter().position(|name| is(name)) {
                return Some(Column::Angle(angle));
            }
            match match_shape(heading) {
                Some(ShapeMatch::One(shape)) => Some(Column::Shape(shape)),
                _ => None,
            }
        }
    }
}

/// Hundreds of OpenFace's columns are landmarks; only what is named here is of use.
fn open_face_column(heading: &str) -> Column {
    if let Some(axis) = CAMERA_ANGLES.iter().position(|name| *name == heading) {
        return Column::CameraAngle(axis);
    }
    match match_unit(heading) {
        // `_r` is regression, an intensity; `_c` classification, yes or no.
        Some(unit) if unit.suffix == "r" => Column::Unit(unit.number, None),
        _ => Column::Unused,
    }
}

/// The kind of a table, from its headings.
pub(in crate::motion) fn recognize(headings: &[String]) -> TakeFormat {
    let units = || headings.iter().filter_map(|h| match_unit(h));
    let is_shape = |h: &String| matches!(match_shape(h), Some(ShapeMatch::One(_)));
    let has = |name: &str| headings.iter().any(|h| h.eq_ignore_ascii_case(name));
    if has("categoryName") || has("category_name") || headings.iter().any(|h| h == "_neutral") {
        TakeFormat::MediaPipe
    } else if headings.iter().any(is_shape) {
        TakeFormat::Arkit
    } else if units().any(|u| u.suffix == "r") && units().all(|u| matches!(u.suffix, "r" | "c")) {
        TakeFormat::OpenFace
    } else if units().next().is_some() {
        TakeFormat::PyFeat
    } else {
        TakeFormat::Arkit
    }
}

/// Fields are separated by commas, semicolons or tabs, whichever the first line has most of.
pub(super) fn delimiter(text: &str) -> u8 {
    let heading = text.lines().next().unwrap_or_default();
    let count = |d: u8| heading.bytes().filter(|&b| b == d).count();
    // The last of equals wins, so a single column is read as commas.
    [b';', b'\t', b',']
        .into_iter()
        .max_by_key(|&d| count(d))
        .unwrap_or(b',')
}

/// Headings of a table without their white space.
pub(in crate::motion) fn split_heading(text: &str) -> Vec<String> {
    let separator = char::from(delimiter(text));
    let line = text.lines().next().unwrap_or_default();
    line.split(separator)
        .map(|h| h.trim().trim_matches('"').to_owned())
        .collect()
}

pub(super) fn known_names() -> impl Iterator<Item = &'static str> {
    let others = OTHER_NAMES.iter().map(|(name, _)| *name);
    ARKIT_SHAPES.into_iter().chain(ANGLES).chain(others)
}
