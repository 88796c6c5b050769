//! MediaPipe's scores as a table with one row per frame and category.
//!
//! Columns `categoryName` and `score`, with a time (`timestamp_ms`, `timestamp` or `time` in
//! seconds) or a frame number; other columns are not needed. Rows of a frame follow each
//! other.

use std::collections::BTreeMap;

use super::columns::delimiter;
use crate::motion::mediapipe::{ScoreFrame, clip_from_scores};
use crate::motion::{Clip, MotionError, ReadOptions};

/// Reads such a table.
pub(in crate::motion) fn parse_long(
    text: &str,
    name: &str,
    options: &ReadOptions,
) -> Result<Clip, MotionError> {
    let mut reader = ::csv::ReaderBuilder::new()
        .delimiter(delimiter(text))
        .trim(::csv::Trim::All)
        .from_reader(text.as_bytes());
    let malformed = |error: ::csv::Error| MotionError::Csv {
        name: name.to_owned(),
        message: error.to_string(),
    };
    let headings = reader.headers().map_err(malformed)?.clone();
    let place = |names: &[&str]| {
        headings
            .iter()
            .position(|h| names.iter().any(|name| h.eq_ignore_ascii_case(name)))
    };
    let missing = |missing| MotionError::Empty {
        name: name.to_owned(),
        missing,
    };
    let category = place(&["categoryName", "category_name"])
        .ok_or_else(|| missing("there is no column 'categoryName'"))?;
    let score = place(&["score"]).ok_or_else(|| missing("there is no column 'score'"))?;
    let times = [
        (
            place(&["timestamp_ms", "timestampMs", "time_ms"]),
            Some(1e-3),
        ),
        (place(&["timestamp", "time", "seconds"]), Some(1.0)),
        (place(&["frame", "frame_index", "frameNumber"]), None),
    ];
    let (time, unit) = times
        .into_iter()
        .find_map(|(column, unit)| Some((column?, unit)))
        .ok_or_else(|| missing("there is no column 'timestamp_ms', 'time' or 'frame'"))?;
    let unit = match (unit, options.frame_rate) {
        (Some(unit), _) => unit,
        (None, Some(rate)) => 1.0 / rate,
        (None, None) => {
            return Err(MotionError::FrameRateNeeded {
                name: name.to_owned(),
            });
        }
    };

    let mut frames: Vec<ScoreFrame> = Vec::new();
    let mut last_time = f64::NAN;
    let mut record = ::csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(malformed)? {
        let line = record.position().map_or(0, |p| p.line() as usize);
        let number = |column: usize| {
            let cell = record.get(column).unwrap_or_default();
            match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(MotionError::BadCell {
                    name: name.to_owned(),
                    row: line,
                    column: headings.get(column).unwrap_or_default().to_owned(),
                    found: cell.to_owned(),
                    expected: "finite number",
                }),
            }
        };
        let at = number(time)? * unit;
        if at != last_time {
            last_time = at;
            frames.push(ScoreFrame {
                line,
                time: Some(at),
                scores: Some(BTreeMap::new()),
            });
        }
        let category = record.get(category).unwrap_or_default().to_owned();
        if let Some(scores) = frames.last_mut().and_then(|f| f.scores.as_mut()) {
            scores.insert(category, number(score)?);
        }
    }
    clip_from_scores(name, frames, options)
}
