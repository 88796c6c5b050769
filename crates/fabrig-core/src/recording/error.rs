//! What can go wrong with a recording.

use std::path::PathBuf;

/// Why a recording could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// A file could not be opened, written, renamed or read.
    #[error("cannot {action} `{path}`")]
    Io {
        /// `create`, `write`, `rename`, `open` or `read`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The container is not sound.
    #[error("`{path}` is not a sound MCAP file, after {frames} whole frames")]
    Container {
        /// The file.
        path: PathBuf,
        /// Frames that could be read before.
        frames: usize,
        /// What is wrong.
        #[source]
        source: mcap::McapError,
    },
    /// The file ends before its closing record.
    #[error(
        "`{path}` is cut off after {frames} whole frames; read it with recovery to use what is there"
    )]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Frames that could be read before.
        frames: usize,
    },
    /// The file is an MCAP file, but not one of a face.
    #[error("`{path}` is not a recording of a face: {reason}")]
    NotARecording {
        /// The file.
        path: PathBuf,
        /// What is missing or wrong.
        reason: String,
    },
    /// A recording has several faces of which none was chosen.
    #[error("`{path}` has several faces; choose one of: {faces}")]
    SeveralFaces {
        /// The file.
        path: PathBuf,
        /// Their names.
        faces: String,
    },
    /// A recording has no face of this name.
    #[error("`{path}` has no face called '{found}'; it has: {faces}")]
    NoSuchFace {
        /// The file.
        path: PathBuf,
        /// What was asked for.
        found: String,
        /// The faces that it has; `one without a name` where it has one.
        faces: String,
    },
    /// A message does not follow its schema.
    #[error("message {sequence} on `{topic}` of `{path}` cannot be decoded")]
    Message {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Sequence number on its topic.
        sequence: u32,
        /// Why.
        #[source]
        source: prost::DecodeError,
    },
    /// A frame does not fit what the recording was opened with.
    #[error("frame {frame} has {found} {what}, but the recording was opened with {expected}")]
    FrameShape {
        /// Index of the frame, from 0.
        frame: u64,
        /// What was counted.
        what: String,
        /// How many were announced.
        expected: usize,
        /// How many came.
        found: usize,
    },
    /// A coordinate, weight or statistic is NaN or infinite.
    #[error("frame {frame} has a value that is not a finite number: {what} {index}")]
    NotFinite {
        /// Index of the frame, from 0.
        frame: u64,
        /// What it is in.
        what: String,
        /// Index in it.
        index: usize,
    },
    /// Something announced at the start makes no sense.
    #[error("a recording cannot be opened: {reason}")]
    Info {
        /// What is wrong with it.
        reason: String,
    },
}
