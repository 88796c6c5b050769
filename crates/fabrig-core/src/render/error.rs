//! What can go wrong when a picture is made.

use std::path::PathBuf;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The picture has no pixels, or more than memory should hold.
    #[error(
        "a picture of {width} x {height} pixels cannot be made; each side must be 1 to {limit}"
    )]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The longest side allowed.
        limit: u32,
    },
    /// Pixels do not fill a picture.
    #[error("expected {expected} bytes, three per pixel, got {found}")]
    ByteCount {
        /// How many are needed.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// Nothing was added, so there is nothing to frame.
    #[error("the picture shows nothing: no layer has a triangle and no points were added")]
    Empty,
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle} references vertex {vertex}, but the layer has {vertex_count} vertices"
    )]
    IndexOutOfRange {
        /// Index of the triangle, from 0.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("{what} {index} has a coordinate that is not a finite number")]
    NotFinite {
        /// `vertex`, `point` or `label`.
        what: &'static str,
        /// Index, from 0.
        index: usize,
    },
    /// Colours do not fit what they colour.
    #[error("expected {expected} colours, one per {per}, got {found}")]
    ColorCount {
        /// `vertex` or `triangle`.
        per: &'static str,
        /// How many are needed.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// A view's name is not known.
    #[error(
        "unknown view `{name}`; use front, three_quarter, three_quarter_right, side, side_right, \
         back, top, below, or YAW,PITCH in degrees"
    )]
    UnknownView {
        /// What was given.
        name: String,
    },
    /// An animation has no frames, or frames of different sizes.
    #[error("frame {frame} is {found:?} pixels, but the first is {expected:?}")]
    FrameSize {
        /// Index of the frame, from 0.
        frame: usize,
        /// Width and height of the first frame.
        expected: (u32, u32),
        /// Width and height of this one.
        found: (u32, u32),
    },
    /// An animation or sheet has nothing in it.
    #[error("no frames were given")]
    NoFrames,
    /// A file could not be written.
    #[error("cannot write `{path}`")]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The pixels could not be encoded.
    #[error("cannot encode `{path}`")]
    Encode {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: image::ImageError,
    },
}
