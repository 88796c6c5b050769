//! Takes of the Face Cap app: text whose lines begin with what they hold.
//!
//! ```text
//! info,...                       about the recording; not needed
//! bs,browInnerUp,browDown_L,...  names of the shapes
//! k,t,x,y,z,rx,ry,rz,lx,ly,rx,ry,w,...
//! ```
//!
//! A key holds the time (ms), position and Euler angles of the head (degrees), the two angles
//! of the left eye and of the right eye (degrees), and one weight per shape. The app does not
//! document the axes of its rotations and no recording with known motion was at hand, so they
//! are left out, and said to be: heads and eyes are at rest, eyes follow their shapes.

use super::frames::{FrameRow, Frames};
use super::read::WEIGHT_TOLERANCE;
use super::{Clip, ClipNotes, MotionError, ReadOptions};
use crate::facs::{ARKIT_SHAPES, ShapeMatch, match_shape, nearest_name};

/// Numbers of a key before its weights: time, head position and rotation, two eyes.
const LEADING: usize = 11;

/// Whether a text is one of these takes.
pub(super) fn is_face_cap(text: &str) -> bool {
    let lines = text.lines().map(str::trim).filter(|l| !l.is_empty());
    lines
        .take_while(|line| line.starts_with("info,") || line.starts_with("bs,"))
        .any(|line| line.starts_with("bs,"))
}

/// Reads a take of the app.
pub(super) fn parse_face_cap(
    text: &str,
    name: &str,
    options: &ReadOptions,
) -> Result<Clip, MotionError> {
    let mut shapes: Vec<Option<usize>> = Vec::new();
    let mut notes = ClipNotes {
        ignored_columns: ["head", "eyes"].map(str::to_owned).to_vec(),
        ..ClipNotes::default()
    };
    let mut rows = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let mut cells = line.trim().split(',').map(str::trim);
        match cells.next() {
            Some("bs") => {
                shapes = names(name, cells, options, &mut notes)?;
            }
            Some("k") => {
                let cells: Vec<&str> = cells.collect();
                let expected = LEADING + shapes.len();
                if shapes.is_empty() || cells.len() != expected {
                    return Err(MotionError::CellCount {
                        name: name.to_owned(),
                        row: index + 1,
                        expected,
                        found: cells.len(),
                    });
                }
                rows.push(key(name, index + 1, &cells, &shapes, options, &mut notes)?);
            }
            _ => {}
        }
    }
    let used = shapes.iter().flatten();
    Frames {
        name,
        channels: used.map(|&shape| ARKIT_SHAPES[shape].to_owned()).collect(),
        rows,
        notes,
    }
    .into_clip()
}

fn names<'a>(
    name: &str,
    cells: impl Iterator<Item = &'a str>,
    options: &ReadOptions,
    notes: &mut ClipNotes,
) -> Result<Vec<Option<usize>>, MotionError> {
    let mut shapes: Vec<Option<usize>> = Vec::new();
    for (index, cell) in cells.enumerate() {
        let shape = match match_shape(cell) {
            Some(ShapeMatch::One(shape)) => Some(shape),
            _ if options.ignore_unknown_columns => {
                notes.ignored_columns.push(cell.to_owned());
                None
            }
            _ => {
                return Err(MotionError::UnknownColumn {
                    name: name.to_owned(),
                    column: index + 2,
                    found: cell.to_owned(),
                    nearest: nearest_name(cell, ARKIT_SHAPES)
                        .unwrap_or_default()
                        .to_owned(),
                });
            }
        };
        if let Some(first) = shapes.iter().position(|s| shape.is_some() && *s == shape) {
            return Err(MotionError::DuplicateColumn {
                name: name.to_owned(),
                first: first + 2,
                second: index + 2,
                meaning: cell.to_owned(),
            });
        }
        shapes.push(shape);
    }
    Ok(shapes)
}

fn key(
    name: &str,
    line: usize,
    cells: &[&str],
    shapes: &[Option<usize>],
    options: &ReadOptions,
    notes: &mut ClipNotes,
) -> Result<FrameRow, MotionError> {
    let number = |column: &str, cell: &str| match cell.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(MotionError::BadCell {
            name: name.to_owned(),
            row: line,
            column: column.to_owned(),
            found: cell.to_owned(),
            expected: "finite number",
        }),
    };
    let time = 1e-3 * number("time", cells[0])?;
    let mut weights = Vec::with_capacity(shapes.len());
    for (shape, cell) in shapes.iter().zip(&cells[LEADING..]) {
        let Some(shape) = *shape else { continue };
        let found = number(ARKIT_SHAPES[shape], cell)?;
        let clamped = found.clamp(0.0, 1.0);
        if clamped != found {
            if !options.clamp_weights && (found - clamped).abs() > WEIGHT_TOLERANCE {
                return Err(MotionError::WeightOutOfRange {
                    name: name.to_owned(),
                    row: line,
                    column: ARKIT_SHAPES[shape].to_owned(),
                    found,
                });
            }
            notes.clamped_weights += 1;
        }
        weights.push(clamped as f32);
    }
    Ok(FrameRow {
        line,
        time,
        weights,
        ..FrameRow::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Clip, MotionError> {
        crate::motion::parse(text, "fc.txt", &ReadOptions::default())
    }

    #[test]
    fn keys_become_frames() {
        let clip = parse(
            "info,Device,iPhone\n\nbs,browInnerUp,browDown_L,jawOpen\n\
             k,100,0,0,0,1,2,3,4,5,6,7,0.5,0.25,0\nk,133.3,0,0,0,1,2,3,4,5,6,7,0.75,0,1.01\n",
        )
        .unwrap();
        assert_eq!(clip.channels(), ["browInnerUp", "browDownLeft", "jawOpen"]);
        assert_eq!(clip.weights(), [0.5, 0.25, 0.0, 0.75, 0.0, 1.0]);
        assert!((clip.duration() - 0.0333).abs() < 1e-9);
        assert_eq!(clip.notes().clamped_weights, 1);
        assert_eq!(clip.notes().ignored_columns, ["head", "eyes"]);
    }

    #[test]
    fn keys_that_do_not_fit_are_refused() {
        let key = "k,0,0,0,0,0,0,0,0,0,0,0";
        assert!(matches!(
            parse(&format!("bs,jawOpen\n{key}\n")),
            Err(MotionError::CellCount {
                row: 2,
                expected: 12,
                found: 11,
                ..
            })
        ));
        assert!(matches!(
            parse(&format!("bs,jawOpen\n{key},x\n")),
            Err(MotionError::BadCell { row: 2, .. })
        ));
        assert!(matches!(
            parse(&format!("bs,jawOpne\n{key},1\n")),
            Err(MotionError::UnknownColumn { column: 2, .. })
        ));
        assert!(matches!(
            parse("bs,jawOpen\n"),
            Err(MotionError::Empty { .. })
        ));
    }
}
