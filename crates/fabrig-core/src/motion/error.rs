//! What can be wrong with a take.

use std::io;
use std::path::PathBuf;

use super::ClipError;

/// A take could not be read.
#[derive(Debug, thiserror::Error)]
pub enum MotionError {
    /// The file could not be read at all.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The text is not well-formed CSV.
    #[error("{name}: not well-formed CSV: {message}")]
    Csv {
        /// Name of the take.
        name: String,
        /// What the CSV reader says, with the line.
        message: String,
    },
    /// A column is neither a shape nor anything else that is known.
    #[error(
        "{name}: column {column} is called '{found}', which is not known (nearest: '{nearest}'); \
         rename it, or ask for unknown columns to be ignored"
    )]
    UnknownColumn {
        /// Name of the take.
        name: String,
        /// The column, from 1.
        column: usize,
        /// Its heading.
        found: String,
        /// The known name that is spelled most like it.
        nearest: String,
    },
    /// Two columns mean the same.
    #[error("{name}: columns {first} and {second} both mean '{meaning}'")]
    DuplicateColumn {
        /// Name of the take.
        name: String,
        /// The first of them, from 1.
        first: usize,
        /// The second, from 1.
        second: usize,
        /// What both mean.
        meaning: String,
    },
    /// There is nothing to animate.
    #[error("{name}: {missing}")]
    Empty {
        /// Name of the take.
        name: String,
        /// What is missing.
        missing: &'static str,
    },
    /// Rows count frames, or nothing at all, and no frame rate was given.
    #[error(
        "{name}: it has no times (columns 'timecode', 'time'); give the number of frames per second"
    )]
    FrameRateNeeded {
        /// Name of the take.
        name: String,
    },
    /// A frame rate makes no sense.
    #[error("{name}: {found} is not a frame rate; it must be finite and above 0")]
    BadFrameRate {
        /// Name of the take.
        name: String,
        /// The rate. (1/s)
        found: f64,
    },
    /// A cell does not parse as what its column holds.
    #[error("{name}: row {row}, column '{column}': '{found}' is not a {expected}")]
    BadCell {
        /// Name of the take.
        name: String,
        /// The line of the file, from 1.
        row: usize,
        /// Heading of the column.
        column: String,
        /// The text of the cell.
        found: String,
        /// `finite number` or `timecode`.
        expected: &'static str,
    },
    /// A weight is too far outside [0, 1] to be noise.
    #[error(
        "{name}: row {row}, column '{column}': the weight {found} is outside [0, 1]; \
         rescale it, or ask for weights to be clamped"
    )]
    WeightOutOfRange {
        /// Name of the take.
        name: String,
        /// The line of the file, from 1.
        row: usize,
        /// Heading of the column.
        column: String,
        /// The weight.
        found: f64,
    },
    /// Time runs backwards.
    #[error("{name}: row {row} is at {time:.4} s, before the row above it at {previous:.4} s")]
    TimeBackwards {
        /// Name of the take.
        name: String,
        /// The line of the file, from 1.
        row: usize,
        /// Its time. (s)
        time: f64,
        /// The time of the row before it. (s)
        previous: f64,
    },
    /// The times make no take.
    #[error(
        "{name}: its times make {found:.4} frames per second, a take has 1 to 240; if they are \
         milliseconds, ask for that"
    )]
    RateOutOfRange {
        /// Name of the take.
        name: String,
        /// The usual rate. (1/s)
        found: f64,
    },
    /// A line has not as many cells as the heading says.
    #[error("{name}: row {row} has {found} cells where {expected} are expected")]
    CellCount {
        /// Name of the take.
        name: String,
        /// The line of the file, from 1.
        row: usize,
        /// Cells that there should be.
        expected: usize,
        /// Cells that there are.
        found: usize,
    },
    /// JSON is not of the form that is read.
    #[error("{name}: frame {frame}: {problem}")]
    Json {
        /// Name of the take.
        name: String,
        /// The frame, from 1; 0 for the document as a whole.
        frame: usize,
        /// What is wrong.
        problem: String,
    },
    /// A frame scores something that is no shape.
    #[error(
        "{name}: frame {frame} scores '{found}', which is not known (nearest: '{nearest}'); ask \
         for unknown columns to be ignored to pass over it"
    )]
    UnknownCategory {
        /// Name of the take.
        name: String,
        /// The frame or line, from 1.
        frame: usize,
        /// The category.
        found: String,
        /// The known name that is spelled most like it.
        nearest: String,
    },
    /// Action units do not become weights.
    #[error("{name}: its action units cannot be used")]
    ActionUnits {
        /// Name of the take.
        name: String,
        /// Why.
        #[source]
        source: crate::facs::FacsError,
    },
    /// Marker trajectories cannot be read.
    #[error("{name}: {problem}")]
    Markers {
        /// Name of the take.
        name: String,
        /// What is wrong, with the line or byte.
        problem: String,
    },
    /// Something is asked of a take that it cannot do.
    #[error("{name}: {problem}")]
    Adjust {
        /// Name of the take.
        name: String,
        /// What is wrong, and what would be right.
        problem: String,
    },
    /// A line of a keyed take is wrong.
    #[error("{name}:{line}: {problem}")]
    Keys {
        /// Name of the take.
        name: String,
        /// The line, from 1.
        line: usize,
        /// What is wrong there.
        problem: String,
    },
    /// The frames do not make a clip.
    #[error("{name}: the take is not valid")]
    Clip {
        /// Name of the take.
        name: String,
        /// What is wrong with it.
        #[source]
        source: ClipError,
    },
}
