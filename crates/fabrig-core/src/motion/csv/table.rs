//! Takes as CSV, one row a frame: Live Link Face, other tables of ARKit's shapes, MediaPipe's
//! shapes, OpenFace's and py-feat's action units.
//!
//! # Columns
//!
//! - time: `Timecode` (hh:mm:ss:ff.sub), `time` / `seconds` / `timestamp` in seconds,
//!   `timestamp_ms` in milliseconds, or `frame` with a frame rate from [`ReadOptions`]; none
//!   of them needs the rate too
//! - shapes: any spelling that [`match_shape`](crate::facs::match_shape) knows; absent shapes
//!   stay at rest
//! - rotations in radians: `HeadYaw`, `HeadPitch`, `HeadRoll`, `LeftEyeYaw`, `LeftEyePitch`,
//!   `RightEyeYaw`, `RightEyePitch`. Live Link Face writes them for a left-handed frame: its
//!   positive yaw is to the character's right (in a real range-of-motion take LeftEyeYaw
//!   correlates with eyeLookOutLeft at -0.999, LeftEyePitch with eyeLookDownLeft at +0.996),
//!   so yaw and roll change sign on the way in
//! - OpenFace: `AU12_r` intensities from 0 to 5, `pose_Rx`, `pose_Ry`, `pose_Rz` (rad, about
//!   the camera's axes, x right, y down, z forward, applied z first), frames with `success` 0
//!   or a low `confidence` are gaps; everything else is passed over
//! - py-feat: `AU12` intensities from 0 to 1, frames without them are gaps; its head angles,
//!   whose unit differs between its versions, and everything else are passed over
//! - several faces (`face_id`, `Identity`): the first one counts
//! - known but not needed: `BlendShapeCount`, eye rolls, `_neutral`
//!
//! Where a table has both shapes and action units, the shapes count.

use nalgebra::{Rotation3, UnitQuaternion};

use super::columns::{
    ANGLES, CAMERA_ANGLES, Column, EYE_ANGLES, HEAD_ANGLES, column_of, delimiter, known_names,
};
use super::recognize;
use crate::Vector;
use crate::facs::{ARKIT_SHAPES, Side, match_unit, nearest_name};
use crate::motion::frames::{FrameRow, Frames};
use crate::motion::read::WEIGHT_TOLERANCE;
use crate::motion::timecode::{self, Timecode};
use crate::motion::units::UnitChannels;
use crate::motion::{Clip, ClipNotes, EyeAngles, HeadPose, MotionError, ReadOptions, TakeFormat};

/// OpenFace's intensities go from 0 to this.
const OPEN_FACE_SCALE: f64 = 5.0;

/// Frames that a tracker is less sure of are gaps.
const LEAST_CONFIDENCE: f64 = 0.5;

/// Reads a take from CSV text; `name` stands for the file in errors.
///
/// # Errors
///
/// [`MotionError`] with the row and column. Cells that are empty, NaN or infinite are errors,
/// except in the action units of a frame without a face; weights beyond
/// [`WEIGHT_TOLERANCE`] outside [0, 1] are, unless the options clamp them.
pub fn parse_csv(text: &str, name: &str, options: &ReadOptions) -> Result<Clip, MotionError> {
    options.check(name)?;
    let mut reader = ::csv::ReaderBuilder::new()
        .delimiter(delimiter(text))
        .trim(::csv::Trim::All)
        .from_reader(text.as_bytes());
    let malformed = |error: ::csv::Error| MotionError::Csv {
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
    let mut record = ::csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(malformed)? {
        table.add(&record)?;
    }
    options.adjust.apply(table.finish()?, name)
}

/// One row of values in fixed places.
struct Row {
    line: usize,
    /// Seconds, milliseconds or frame number; meaningless with a timecode.
    time: f64,
    timecode: Option<Timecode>,
    angles: [f64; ANGLES.len()],
    camera_angles: [f64; CAMERA_ANGLES.len()],
    /// One weight per shape column.
    weights: Vec<f32>,
    /// One intensity in [0, 1] per unit column.
    units: Vec<f32>,
    is_lost: bool,
}

struct Table<'a> {
    name: &'a str,
    options: &'a ReadOptions,
    format: TakeFormat,
    headings: Vec<String>,
    columns: Vec<Column>,
    rows: Vec<Row>,
    /// Units of the table that the unit columns mean, and their sides.
    units: Vec<(usize, Option<Side>)>,
    unit_channels: Option<UnitChannels>,
    /// Which of several faces is read.
    face: Option<String>,
    notes: ClipNotes,
}

impl<'a> Table<'a> {
    fn new(
        name: &'a str,
        options: &'a ReadOptions,
        headings: Vec<String>,
    ) -> Result<Self, MotionError> {
        let format = options.format.unwrap_or_else(|| recognize(&headings));
        let mut columns: Vec<Column> = Vec::with_capacity(headings.len());
        let mut notes = ClipNotes::default();
        for (index, heading) in headings.iter().enumerate() {
            let column = match column_of(heading, format) {
                Some(column) => column,
                // Shapes are there, or this would be a table of units.
                None if options.ignore_unknown_columns || match_unit(heading).is_some() => {
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
        let (units, unit_channels) = bind_units(name, options, &headings, &columns)?;
        if unit_channels.is_none() && !columns.iter().any(|c| matches!(c, Column::Shape(_))) {
            return Err(MotionError::Empty {
                name: name.to_owned(),
                missing: match format {
                    TakeFormat::OpenFace => "no column is an intensity like 'AU12_r'",
                    TakeFormat::PyFeat => "no column is an action unit like 'AU12'",
                    _ => "no column is named after a shape",
                },
            });
        }
        Ok(Self {
            name,
            options,
            format,
            headings,
            columns,
            rows: Vec::new(),
            units,
            unit_channels,
            face: None,
            notes,
        })
    }

    fn add(&mut self, record: &::csv::StringRecord) -> Result<(), MotionError> {
        let line = record.position().map_or(0, |p| p.line() as usize);
        let mut row = Row {
            line,
            time: 0.0,
            timecode: None,
            angles: [0.0; ANGLES.len()],
            camera_angles: [0.0; CAMERA_ANGLES.len()],
            weights: Vec::new(),
            units: Vec::new(),
            is_lost: false,
        };
        if let Some(face) = self.columns.iter().position(|&c| c == Column::Face) {
            let face = record.get(face).unwrap_or_default();
            // A frame without a face has no face's name either.
            let is_named = !face.is_empty() && !face.eq_ignore_ascii_case("nan");
            if is_named && self.face.get_or_insert_with(|| face.to_owned()) != face {
                self.notes.other_faces += 1;
                return Ok(());
            }
        }
        for (index, cell) in record.iter().enumerate() {
            let column = self.columns[index];
            match column {
                Column::Unused | Column::Face => {}
                Column::Timecode => {
                    let timecode = Timecode::parse(cell);
                    row.timecode =
                        Some(timecode.ok_or_else(|| self.bad_cell(line, index, cell, "timecode"))?);
                }
                Column::Seconds | Column::Milliseconds | Column::Frame => {
                    row.time = self.number(line, index, cell)?;
                }
                Column::Success => row.is_lost |= self.number(line, index, cell)? == 0.0,
                Column::Confidence => {
                    row.is_lost |= self.number(line, index, cell)? < LEAST_CONFIDENCE;
                }
                Column::Angle(angle) => row.angles[angle] = self.number(line, index, cell)?,
                Column::CameraAngle(axis) => {
                    row.camera_angles[axis] = self.number(line, index, cell)?;
                }
                Column::Shape(_) => {
                    let weight = self.number(line, index, cell)?;
                    row.weights.push(self.weight(line, index, weight)?);
                }
                Column::Unit(..) => {
                    if cell.is_empty() || cell.eq_ignore_ascii_case("nan") {
                        row.is_lost = true;
                        row.units.push(0.0);
                        continue;
                    }
                    let scale = match self.format {
                        TakeFormat::OpenFace => OPEN_FACE_SCALE,
                        _ => 1.0,
                    };
                    let intensity = self.number(line, index, cell)? / scale;
                    row.units.push(self.weight(line, index, intensity)?);
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

    /// Time of every row. (s)
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
        let scaled = |unit: f64| self.rows.iter().map(|row| row.time * unit).collect();
        if self.columns.contains(&Column::Seconds) {
            let is_milliseconds = self.options.times_in_milliseconds;
            return Ok(scaled(if is_milliseconds { 1e-3 } else { 1.0 }));
        }
        if self.columns.contains(&Column::Milliseconds) {
            return Ok(scaled(1e-3));
        }
        let rate = self.options.frame_rate.ok_or_else(rate_needed)?;
        Ok(if self.columns.contains(&Column::Frame) {
            let start = self.rows.first().map_or(0.0, |row| row.time);
            let frames = self.rows.iter().map(|row| row.time - start);
            frames.map(|frame| frame / rate).collect()
        } else {
            (0..self.rows.len()).map(|i| i as f64 / rate).collect()
        })
    }

    fn finish(self) -> Result<Clip, MotionError> {
        if self.rows.is_empty() {
            return Err(MotionError::Empty {
                name: self.name.to_owned(),
                missing: "there are no rows below the heading",
            });
        }
        let times = self.times()?;
        let has = |angles: std::ops::Range<usize>| {
            let is_there = |c: &Column| matches!(c, Column::Angle(a) if angles.contains(a));
            self.columns.iter().any(is_there)
        };
        let has_camera = (self.columns.iter()).any(|c| matches!(c, Column::CameraAngle(_)));
        let (has_head, has_eyes) = (has(HEAD_ANGLES), has(EYE_ANGLES));
        let shapes = self.shapes();
        let mut rows = Vec::with_capacity(self.rows.len());
        for (row, time) in self.rows.iter().zip(times) {
            let head = if has_camera {
                Some(camera_head(row.camera_angles))
            } else {
                has_head.then(|| HeadPose {
                    yaw: -row.angles[0],
                    pitch: row.angles[1],
                    roll: -row.angles[2],
                    ..HeadPose::default()
                })
            };
            let eye = |k: usize| EyeAngles {
                yaw: -row.angles[k],
                pitch: row.angles[k + 1],
            };
            rows.push(FrameRow {
                line: row.line,
                time,
                is_lost: row.is_lost,
                weights: self.row_weights(row, &shapes)?,
                head,
                eyes: has_eyes.then(|| [eye(EYE_ANGLES.start), eye(EYE_ANGLES.start + 2)]),
            });
        }
        Frames {
            name: self.name,
            channels: shapes.iter().map(|&s| ARKIT_SHAPES[s].to_owned()).collect(),
            rows,
            notes: self.notes,
        }
        .into_clip()
    }

    /// Shapes that the take moves.
    fn shapes(&self) -> Vec<usize> {
        match &self.unit_channels {
            Some(units) => units.shapes(),
            None => (self.columns.iter())
                .filter_map(|column| match column {
                    Column::Shape(shape) => Some(*shape),
                    _ => None,
                })
                .collect(),
        }
    }

    fn row_weights(&self, row: &Row, shapes: &[usize]) -> Result<Vec<f32>, MotionError> {
        let Some(channels) = &self.unit_channels else {
            return Ok(row.weights.clone());
        };
        let mut intensities = channels.rest();
        for (&(unit, side), &intensity) in self.units.iter().zip(&row.units) {
            UnitChannels::set(&mut intensities[unit], side, intensity);
        }
        let all = channels.weights(self.name, &intensities)?;
        Ok(shapes.iter().map(|&shape| all[shape]).collect())
    }
}

/// The units that the columns mean, in the order of the columns.
type BoundUnits = (Vec<(usize, Option<Side>)>, Option<UnitChannels>);

fn bind_units(
    name: &str,
    options: &ReadOptions,
    headings: &[String],
    columns: &[Column],
) -> Result<BoundUnits, MotionError> {
    let mut bound = Vec::new();
    let mut channels: Option<UnitChannels> = None;
    for (index, column) in columns.iter().enumerate() {
        let Column::Unit(number, side) = *column else {
            continue;
        };
        let channels = match &mut channels {
            Some(channels) => channels,
            none => none.insert(UnitChannels::new(name, options)?),
        };
        let Some(unit) = channels.unit(number) else {
            return Err(MotionError::UnknownColumn {
                name: name.to_owned(),
                column: index + 1,
                found: headings[index].clone(),
                nearest: channels.nearest(&headings[index]),
            });
        };
        bound.push((unit, side));
    }
    Ok((bound, channels))
}

/// Head pose from OpenFace's angles: R = Rx Ry Rz about the camera's axes, whose y and z point
/// against the world's.
fn camera_head([x, y, z]: [f64; 3]) -> HeadPose {
    let about = |axis: nalgebra::UnitVector3<f64>, angle| Rotation3::from_axis_angle(&axis, angle);
    let rotation =
        about(Vector::x_axis(), x) * about(Vector::y_axis(), -y) * about(Vector::z_axis(), -z);
    HeadPose::from_rotation(&UnitQuaternion::from_rotation_matrix(&rotation))
}
