//! Takes as CSV: Live Link Face, and other tables with ARKit's shapes as columns.
//!
//! # Columns
//!
//! - time: `Timecode` (hh:mm:ss:ff.sub), `time` / `seconds` / `timestamp` in seconds, or
//!   `frame` with a frame rate from [`ReadOptions`]; none of them needs the rate too
//! - shapes: any spelling that [`match_shape`] knows; absent shapes stay at rest
//! - rotations in radians: `HeadYaw`, `HeadPitch`, `HeadRoll`, `LeftEyeYaw`, `LeftEyePitch`,
//!   `RightEyeYaw`, `RightEyePitch`. Live Link Face writes them for a left-handed frame: its
//!   positive yaw is to the character's right (in a real range-of-motion take LeftEyeYaw
//!   correlates with eyeLookOutLeft at -0.999, LeftEyePitch with eyeLookDownLeft at +0.996),
//!   so yaw and roll change sign on the way in
//! - known but not needed: `BlendShapeCount`, eye rolls
//!
//! Fields are separated by commas, semicolons or tabs, whichever the heading has most of.

use super::read::{ReadOptions, WEIGHT_TOLERANCE};
use super::timecode::{self, Timecode};
use super::{Clip, ClipNotes, ClipTracks, EyeAngles, HeadPose, MotionError};
use crate::facs::{ARKIT_SHAPES, ShapeMatch, match_shape, nearest_name};

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Timecode,
    Seconds,
    Frame,
    /// Index into [`ARKIT_SHAPES`].
    Shape(usize),
    /// Index into [`ANGLES`].
    Angle(usize),
    Unused,
}

/// Rotation columns, in the order of [`Row::angles`].
const ANGLES: [&str; 7] = [
    "HeadYaw",
    "HeadPitch",
    "HeadRoll",
    "LeftEyeYaw",
    "LeftEyePitch",
    "RightEyeYaw",
    "RightEyePitch",
];
const HEAD_ANGLES: std::ops::Range<usize> = 0..3;
const EYE_ANGLES: std::ops::Range<usize> = 3..7;

const OTHER_NAMES: [(&str, Column); 9] = [
    ("Timecode", Column::Timecode),
    ("time", Column::Seconds),
    ("seconds", Column::Seconds),
    ("timestamp", Column::Seconds),
    ("frame", Column::Frame),
    ("FrameNumber", Column::Frame),
    ("BlendShapeCount", Column::Unused),
    ("LeftEyeRoll", Column::Unused),
    ("RightEyeRoll", Column::Unused),
];

fn column_of(heading: &str) -> Option<Column> {
    let is = |name: &str| {
        let letters = heading.chars().filter(char::is_ascii_alphanumeric);
        letters
            .map(|c| c.to_ascii_lowercase())
            .eq(name.chars().map(|c| c.to_ascii_lowercase()))
    };
    if let Some((_, column)) = OTHER_NAMES.iter().find(|(name, _)| is(name)) {
        return Some(*column);
    }
    if let Some(angle) = ANGLES.iter().position(|name| is(name)) {
        return Some(Column::Angle(angle));
    }
    match match_shape(heading) {
        Some(ShapeMatch::One(shape)) => Some(Column::Shape(shape)),
        _ => None,
    }
}

/// Reads a take from CSV text; `name` stands for the file in errors.
///
/// # Errors
///
/// [`MotionError`] with the row and column. Cells that are empty, NaN or infinite are errors;
/// weights beyond [`WEIGHT_TOLERANCE`] outside [0, 1] are, unless the options clamp them.
pub fn parse_csv(text: &str, name: &str, options: &ReadOptions) -> Result<Clip, MotionError> {
    for found in [options.frame_rate, options.timecode_rate]
        .into_iter()
        .flatten()
    {
        if !(found.is_finite() && found > 0.0) {
            return Err(MotionError::BadFrameRate {
                name: name.to_owned(),
                found,
            });
        }
    }
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter(text))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let malformed = |error: csv::Error| MotionError::Csv {
        name: name.to_owned(),
        message: error.to_string(),
    };
    let headings: Vec<String> = reader
        .headers()
        .map_err(malformed)?
        .iter()
        .map(str::to_owned)
        .collect();
    let mut table = Table::new(name, options, headings)?;
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(malformed)? {
        table.add(&record)?;
    }
    table.finish()
}

fn delimiter(text: &str) -> u8 {
    let heading = text.lines().next().unwrap_or_default();
    let count = |d: u8| heading.bytes().filter(|&b| b == d).count();
    // The first of equals wins, so a single column is read as commas.
    [b';', b'\t', b',']
        .into_iter()
        .max_by_key(|&d| count(d))
        .unwrap_or(b',')
}

/// One row of values in fixed places.
struct Row {
    line: usize,
    /// Seconds or frame number; meaningless with a timecode.
    time: f64,
    timecode: Option<Timecode>,
    angles: [f64; ANGLES.len()],
    /// One weight per shape column.
    weights: Vec<f32>,
}

struct Table<'a> {
    name: &'a str,
    options: &'a ReadOptions,
    headings: Vec<String>,
    columns: Vec<Column>,
    rows: Vec<Row>,
    notes: ClipNotes,
}

impl<'a> Table<'a> {
    fn new(
        name: &'a str,
        options: &'a ReadOptions,
        headings: Vec<String>,
    ) -> Result<Self, MotionError> {
        let mut columns: Vec<Column> = Vec::with_capacity(headings.len());
        let mut notes = ClipNotes::default();
        for (index, heading) in headings.iter().enumerate() {
            let column = match column_of(heading) {
                Some(column) => column,
                None if options.ignore_unknown_columns => {
                    notes.ignored_columns.push(heading.clone());
                    Column::Unused
                }
                None => {
                    return Err(MotionError::UnknownColumn {
                        name: name.to_owned(),
                        column: index + 1,
                        found: heading.clone(),
                        nearest: nearest_name(heading, known_names())
                            .unwrap_or_default()
                            .to_owned(),
                    });
                }
            };
            let earlier = columns
                .iter()
                .position(|&c| c == column && column != Column::Unused);
            if let Some(first) = earlier {
                return Err(MotionError::DuplicateColumn {
                    name: name.to_owned(),
                    first: first + 1,
                    second: index + 1,
                    meaning: match column {
                        Column::Shape(shape) => ARKIT_SHAPES[shape].to_owned(),
                        _ => headings[first].clone(),
                    },
                });
            }
            columns.push(column);
        }
        if !columns.iter().any(|c| matches!(c, Column::Shape(_))) {
            return Err(MotionError::Empty {
                name: name.to_owned(),
                missing: "no column is named after a shape",
            });
        }
        Ok(Self {
            name,
            options,
            headings,
            columns,
            rows: Vec::new(),
            notes,
        })
    }

    fn add(&mut self, record: &csv::StringRecord) -> Result<(), MotionError> {
        let line = record.position().map_or(0, |p| p.line() as usize);
        let mut row = Row {
            line,
            time: 0.0,
            timecode: None,
            angles: [0.0; ANGLES.len()],
            weights: Vec::new(),
        };
        for (index, cell) in record.iter().enumerate() {
            let column = self.columns[index];
            match column {
                Column::Unused => {}
                Column::Timecode => {
                    let timecode = Timecode::parse(cell);
                    row.timecode =
                        Some(timecode.ok_or_else(|| self.bad_cell(line, index, cell, "timecode"))?);
                }
                Column::Seconds | Column::Frame => row.time = self.number(line, index, cell)?,
                Column::Angle(angle) => row.angles[angle] = self.number(line, index, cell)?,
                Column::Shape(_) => {
                    let weight = self.number(line, index, cell)?;
                    row.weights.push(self.weight(line, index, weight)?);
                }
            }
        }
        self.rows.push(row);
        Ok(())
    }

    fn bad_cell(
        &self,
        row: usize,
        column: usize,
        cell: &str,
        expected: &'static str,
    ) -> MotionError {
        MotionError::BadCell {
            name: self.name.to_owned(),
            row,
            column: self.headings[column].clone(),
            found: cell.to_owned(),
            expected,
        }
    }

    fn number(&self, row: usize, column: usize, cell: &str) -> Result<f64, MotionError> {
        match cell.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.bad_cell(row, column, cell, "finite number")),
        }
    }

    fn weight(&mut self, row: usize, column: usize, found: f64) -> Result<f32, MotionError> {
        let clamped = found.clamp(0.0, 1.0);
        if clamped != found {
            if !self.options.clamp_weights && (found - clamped).abs() > WEIGHT_TOLERANCE {
                return Err(MotionError::WeightOutOfRange {
                    name: self.name.to_owned(),
                    row,
                    column: self.headings[column].clone(),
                    found,
                });
            }
            self.notes.clamped_weights += 1;
        }
        Ok(clamped as f32)
    }

    /// Seconds since the first row.
    fn times(&self) -> Result<Vec<f64>, MotionError> {
        let rate_needed = || MotionError::FrameRateNeeded {
            name: self.name.to_owned(),
        };
        let timecodes: Vec<Timecode> = self.rows.iter().filter_map(|r| r.timecode).collect();
        if !timecodes.is_empty() {
            let rate = self.options.timecode_rate;
            let rate = rate.or_else(|| timecode::infer_rate(&timecodes));
            return Ok(timecode::seconds(&timecodes, rate.ok_or_else(rate_needed)?));
        }
        let start = self.rows.first().map_or(0.0, |row| row.time);
        if self.columns.contains(&Column::Seconds) {
            return Ok(self.rows.iter().map(|row| row.time - start).collect());
        }
        let rate = self.options.frame_rate.ok_or_else(rate_needed)?;
        Ok(if self.columns.contains(&Column::Frame) {
            let frames = self.rows.iter().map(|row| row.time - start);
            frames.map(|frame| frame / rate).collect()
        } else {
            (0..self.rows.len()).map(|i| i as f64 / rate).collect()
        })
    }

    fn finish(mut self) -> Result<Clip, MotionError> {
        if self.rows.is_empty() {
            return Err(MotionError::Empty {
                name: self.name.to_owned(),
                missing: "there are no rows below the heading",
            });
        }
        let times = self.times()?;
        let kept = self.kept_rows(&times)?;
        let times: Vec<f64> = kept.iter().map(|&i| times[i]).collect();
        self.notes.dropped_frames = dropped_frames(&times);

        let has = |angles: std::ops::Range<usize>| {
            let is_there = |c: &Column| matches!(c, Column::Angle(a) if angles.contains(a));
            self.columns.iter().any(is_there)
        };
        let mut tracks = ClipTracks::default();
        let mut weights = Vec::new();
        for row in kept.iter().map(|&i| &self.rows[i]) {
            weights.extend_from_slice(&row.weights);
            let [
                yaw,
                pitch,
                roll,
                left_yaw,
                left_pitch,
                right_yaw,
                right_pitch,
            ] = row.angles;
            if has(HEAD_ANGLES) {
                tracks.head.push(HeadPose {
                    yaw: -yaw,
                    pitch,
                    roll: -roll,
                    ..HeadPose::default()
                });
            }
            if has(EYE_ANGLES) {
                let eye = |yaw: f64, pitch| EyeAngles { yaw: -yaw, pitch };
                tracks
                    .eyes
                    .push([eye(left_yaw, left_pitch), eye(right_yaw, right_pitch)]);
            }
        }
        let channels = self.columns.iter().filter_map(|column| match column {
            Column::Shape(shape) => Some(ARKIT_SHAPES[*shape].to_owned()),
            _ => None,
        });
        let clip = Clip::new(times, channels.collect(), weights);
        let clip = clip.and_then(|clip| clip.with_tracks(tracks));
        let clip = clip.map_err(|source| MotionError::Clip {
            name: self.name.to_owned(),
            source,
        })?;
        Ok(clip.with_notes(self.notes))
    }

    /// Rows in rising time; of rows at the same time the last.
    fn kept_rows(&mut self, times: &[f64]) -> Result<Vec<usize>, MotionError> {
        let mut kept: Vec<usize> = Vec::with_capacity(times.len());
        for (i, &time) in times.iter().enumerate() {
            match kept.last().map(|&k| times[k]) {
                Some(previous) if time < previous => {
                    return Err(MotionError::TimeBackwards {
                        name: self.name.to_owned(),
                        row: self.rows[i].line,
                        time,
                        previous,
                    });
                }
                Some(previous) if time == previous => {
                    kept.pop();
                    self.notes.duplicate_rows += 1;
                }
                _ => {}
            }
            kept.push(i);
        }
        Ok(kept)
    }
}

fn known_names() -> impl Iterator<Item = &'static str> {
    let others = OTHER_NAMES.iter().map(|(name, _)| *name);
    ARKIT_SHAPES.into_iter().chain(ANGLES).chain(others)
}

/// Frames missing from a capture with an even step, judged by the median step.
fn dropped_frames(times: &[f64]) -> usize {
    let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    let gaps = steps.clone();
    steps.sort_by(f64::total_cmp);
    let Some(&usual) = steps.get(steps.len().saturating_sub(1) / 2) else {
        return 0;
    };
    gaps.iter()
        .map(|gap| (gap / usual).round() as usize)
        .map(|missed| missed.saturating_sub(1))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Clip, MotionError> {
        parse_csv(text, "take.csv", &ReadOptions::default())
    }

    #[test]
    fn live_link_columns_become_channels_tracks_and_times() {
        let clip = parse(
            "Timecode,BlendShapeCount,EyeBlinkLeft,JAWOPEN,HeadYaw,HeadPitch,HeadRoll,\
             LeftEyeYaw,LeftEyePitch,LeftEyeRoll,RightEyeYaw,RightEyePitch,RightEyeRoll\n\
             10:00:00:57.5,61,0.25,1.002,0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.8,0.9\n\
             10:00:00:59.5,61,0.5,0,0,0,0,0,0,0,0,0,0\n\
             10:00:01:03.5,61,0.5,0,0,0,0,0,0,0,0,0,0\n",
        )
        .unwrap();
        assert_eq!(clip.channels(), ["eyeBlinkLeft", "jawOpen"]);
        assert_eq!(&clip.weights()[..2], [0.25, 1.0]);
        assert_eq!(clip.notes().clamped_weights, 1);
        assert_eq!(clip.notes().dropped_frames, 1);
        assert!((clip.times()[1] - 2.0 / 60.0).abs() < 1e-9);
        assert!((clip.duration() - 6.0 / 60.0).abs() < 1e-9);
        let head = clip.tracks().head[0];
        assert_eq!((head.yaw, head.pitch, head.roll), (-0.1, 0.2, -0.3));
        let [left, right] = clip.tracks().eyes[0];
        assert_eq!(
            (left.yaw, left.pitch, right.yaw, right.pitch),
            (-0.4, 0.5, -0.7, 0.8)
        );
    }

    #[test]
    fn times_may_be_seconds_or_frames_with_a_rate() {
        let clip = parse("time;mouthSmile_L\n2.5;0\n3;1\n").unwrap();
        assert_eq!(clip.times(), [0.0, 0.5]);
        assert_eq!(clip.channels(), ["mouthSmileLeft"]);
        for text in [
            "frame,jawOpen\n10,0\n11,0.5\n13,1\n",
            "jawOpen\n0\n0.5\n0.5\n1\n",
        ] {
            assert!(matches!(
                parse(text),
                Err(MotionError::FrameRateNeeded { .. })
            ));
            let options = ReadOptions {
                frame_rate: Some(10.0),
                ..ReadOptions::default()
            };
            let clip = parse_csv(text, "take.csv", &options).unwrap();
            assert!((clip.duration() - 0.3).abs() < 1e-12);
        }
    }

    #[test]
    fn unknown_columns_are_named_with_the_nearest_known_one() {
        let text = "time,jawOpn\n0,1\n";
        match parse(text) {
            Err(MotionError::UnknownColumn {
                column: 2,
                found,
                nearest,
                ..
            }) => assert_eq!((found.as_str(), nearest.as_str()), ("jawOpn", "jawOpen")),
            other => panic!("{other:?}"),
        }
        let options = ReadOptions {
            ignore_unknown_columns: true,
            ..ReadOptions::default()
        };
        let clip = parse_csv("time,mood,jawOpen\n0,happy,1\n", "x", &options).unwrap();
        assert_eq!(clip.notes().ignored_columns, ["mood"]);
        assert!(matches!(
            parse("time,jawOpen,JAW_OPEN\n0,1,1\n"),
            Err(MotionError::DuplicateColumn {
                first: 2,
                second: 3,
                ..
            })
        ));
    }

    #[test]
    fn bad_cells_are_named_by_row_and_column() {
        for cell in ["nan", "inf", "", "x"] {
            match parse(&format!("time,jawOpen\n0,0\n1,{cell}\n")) {
                Err(MotionError::BadCell {
                    row: 3,
                    column,
                    found,
                    ..
                }) => assert_eq!((column.as_str(), found.as_str()), ("jawOpen", cell)),
                other => panic!("{cell}: {other:?}"),
            }
        }
        assert!(matches!(
            parse("time,jawOpen\n0,1.2\n"),
            Err(MotionError::WeightOutOfRange { row: 2, .. })
        ));
        assert!(matches!(
            parse("timecode,jawOpen\n1:2,0\n"),
            Err(MotionError::BadCell {
                expected: "timecode",
                ..
            })
        ));
        assert!(matches!(
            parse("time,jawOpen\n0,0\n1\n"),
            Err(MotionError::Csv { .. })
        ));
    }

    #[test]
    fn repeated_times_replace_and_time_never_runs_backwards() {
        let clip = parse("time,jawOpen\n0,0\n1,0.25\n1,0.5\n2,1\n").unwrap();
        assert_eq!(clip.weights(), [0.0, 0.5, 1.0]);
        assert_eq!(clip.notes().duplicate_rows, 1);
        assert!(matches!(
            parse("time,jawOpen\n0,0\n2,0\n1,0\n"),
            Err(MotionError::TimeBackwards { row: 4, .. })
        ));
    }

    #[test]
    fn takes_without_anything_are_refused() {
        for text in ["", "time,jawOpen\n", "time,HeadYaw\n0,0\n"] {
            assert!(matches!(parse(text), Err(MotionError::Empty { .. })));
        }
        for frame_rate in [0.0, -1.0, f64::NAN] {
            let options = ReadOptions {
                frame_rate: Some(frame_rate),
                ..ReadOptions::default()
            };
            assert!(matches!(
                parse_csv("jawOpen\n0\n", "x", &options),
                Err(MotionError::BadFrameRate { .. })
            ));
        }
    }

    #[test]
    fn a_real_take_is_read() {
        let Some(shared) = std::env::var_os("FABRIG_SHARED") else {
            return;
        };
        let path = std::path::Path::new(&shared).join("mocap/livelinkface_rom.csv");
        let clip = crate::motion::read(path, &ReadOptions::default()).unwrap();
        assert_eq!((clip.frame_count(), clip.channels().len()), (4030, 52));
        assert!(clip.frame_rate().is_some_and(|f| (f - 30.0).abs() < 0.05));
        assert!((clip.duration() - 134.38).abs() < 0.05);
        assert_eq!(clip.notes().dropped_frames, 3);
        assert_eq!(clip.notes().clamped_weights, 1);
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "(time,|jawOpen|,|\n|[0-9.:;\"-]|nan|\t){0,60}") {
            let _ = crate::motion::parse(&text, "x", &ReadOptions::default());
        }
    }
}
