//! What can be wrong with a template pack or with the data it is built from.

use std::path::PathBuf;

use crate::mesh::MeshError;

/// A pack that cannot be read or built, and where.
#[derive(Debug, thiserror::Error)]
pub enum TemplateError {
    /// A file of the pack or of the source data cannot be read.
    #[error("cannot read {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: std::io::Error,
    },
    /// A file of the pack cannot be written.
    #[error("cannot write {path}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: std::io::Error,
    },
    /// A text file of the pack does not parse.
    #[error("{file} does not parse")]
    Text {
        /// Name of the file.
        file: &'static str,
        /// Line, column and reason.
        #[source]
        source: Box<toml::de::Error>,
    },
    /// The file does not start like a pack's geometry.
    #[error(
        "not a template's geometry: the file starts with {found:02x?}, expected {expected:02x?}"
    )]
    WrongMagic {
        /// First bytes of the file.
        found: Vec<u8>,
        /// First bytes of every geometry file.
        expected: [u8; 8],
    },
    /// The file was written by another version of the format.
    #[error("template geometry has format version {found}, this build reads version {expected}")]
    WrongVersion {
        /// Version in the file.
        found: u32,
        /// Version that is read.
        expected: u32,
    },
    /// The file ends too early.
    #[error("template geometry is truncated: {found} bytes, expected {expected}")]
    Truncated {
        /// Bytes there are.
        found: usize,
        /// Bytes there should be.
        expected: usize,
    },
    /// The file's contents changed since it was written.
    #[error("template geometry is corrupt: checksum {found:08x}, expected {expected:08x}")]
    Checksum {
        /// Checksum of the bytes.
        found: u32,
        /// Checksum in the file.
        expected: u32,
    },
    /// The compressed contents do not decode.
    #[error("template geometry does not decode: {reason}")]
    Decode {
        /// What the decoder says.
        reason: String,
    },
    /// A mesh of the pack is not one.
    #[error("{part} is not a valid mesh")]
    Mesh {
        /// `skin` or the part's name.
        part: String,
        /// What is wrong.
        #[source]
        source: MeshError,
    },
    /// A list does not have one entry per vertex.
    #[error("{what} has {found} entries, the mesh it belongs to has {expected} vertices")]
    Length {
        /// Which list.
        what: String,
        /// Entries there are.
        found: usize,
        /// Vertices there are.
        expected: usize,
    },
    /// An index points past the end.
    #[error("{what} names {found}, but there are {count}")]
    OutOfRange {
        /// Who names it.
        what: String,
        /// The index.
        found: usize,
        /// How many there are.
        count: usize,
    },
    /// Mirroring twice does not lead back, or not to the mirrored place.
    #[error(
        "the mirror image of vertex {vertex} is given as {mirror}, which is not its mirror image"
    )]
    Mirror {
        /// The vertex.
        vertex: u32,
        /// Its image.
        mirror: u32,
    },
    /// A name that something needs is not in the pack.
    #[error("{what} needs {name:?}, which the pack does not have")]
    Missing {
        /// Who needs it.
        what: String,
        /// The name.
        name: String,
    },
    /// A name that must be single is there twice.
    #[error("{what} {name:?} is defined twice")]
    Duplicate {
        /// Landmark, region, shape.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A line of a source file cannot be understood.
    #[error("{path}, line {line}: {reason}")]
    SourceLine {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// The source data does not have the shape that the recipe expects.
    #[error("the source data does not fit the recipe: {reason}")]
    Source {
        /// What is wrong.
        reason: String,
    },
}
