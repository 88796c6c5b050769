//! The rig file: a mark, a version, length and checksum, then the rig compressed.
//!
//! ```text
//! 0   8  "FABRIG\r\n"
//! 8   4  format version, little endian
//! 12  8  bytes of the content
//! 20  4  CRC-32 of the content
//! 24  .  zstd of the rig in postcard encoding
//! ```
//!
//! Equal rigs give equal bytes. Version 4 added the materials and pictures of the face and how
//! nodes differ from their material, at the end; version 3 is read as a face without.

use std::path::Path;

use crate::atomic_file::write_atomically;
use crate::rig::{Rig, RigError};

/// Version of the format that this build writes.
pub const FORMAT_VERSION: u32 = 4;
/// Oldest version that this build reads: it ends before appearance and variations, and reads as a
/// face without them.
pub const OLDEST_VERSION: u32 = 3;

const MARK: &[u8; 8] = b"FABRIG\r\n";
const HEADER_LENGTH: usize = 24;
const COMPRESSION_LEVEL: i32 = 9;
/// Postcard's `None` for the appearance, and its empty list of variations.
const NEITHER: [u8; 2] = [0, 0];
/// No honest rig decompresses to more. (bytes)
const LARGEST_CONTENT: usize = 4 << 30;

impl Rig {
    /// The rig as the bytes of a file.
    ///
    /// # Errors
    ///
    /// [`RigError::Content`] where it cannot be encoded.
    pub fn to_bytes(&self) -> Result<Vec<u8>, RigError> {
        let plain = postcard::to_allocvec(self).map_err(content)?;
        let packed = zstd::bulk::compress(&plain, COMPRESSION_LEVEL).map_err(content)?;
        let mut bytes = Vec::with_capacity(HEADER_LENGTH + packed.len());
        bytes.extend_from_slice(MARK);
        bytes.extend_from_slice(&FORMAT_VERSION.to_le_bytes());
        bytes.extend_from_slice(&(packed.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&crc32fast::hash(&packed).to_le_bytes());
        bytes.extend_from_slice(&packed);
        Ok(bytes)
    }

    /// Reads what [`Self::to_bytes`] wrote.
    ///
    /// # Errors
    ///
    /// [`RigError`]: not a rig, another version, cut, damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, RigError> {
        let mark = &bytes[..bytes.len().min(MARK.len())];
        if mark.is_empty() || !MARK.starts_with(mark) {
            return Err(RigError::NotARig);
        }
        let Some((header, packed)) = bytes.split_at_checked(HEADER_LENGTH) else {
            return Err(RigError::Length {
                expected: HEADER_LENGTH as u64,
                found: bytes.len() as u64,
            });
        };
        let version = u32::from_le_bytes(array(header, 8));
        if !(OLDEST_VERSION..=FORMAT_VERSION).contains(&version) {
            return Err(RigError::Version {
                oldest: OLDEST_VERSION,
                expected: FORMAT_VERSION,
                found: version,
            });
        }
        let length = u64::from_le_bytes(array(header, 12));
        if length != packed.len() as u64 {
            return Err(RigError::Length {
                expected: length,
                found: packed.len() as u64,
            });
        }
        let expected = u32::from_le_bytes(array(header, 20));
        let found = crc32fast::hash(packed);
        if expected != found {
            return Err(RigError::Checksum { expected, found });
        }
        let capacity = zstd::zstd_safe::get_frame_content_size(packed)
            .ok()
            .flatten()
            .and_then(|size| usize::try_from(size).ok())
            .filter(|&size| size <= LARGEST_CONTENT)
            .ok_or_else(|| content("the compressed part does not say how large it is"))?;
        let mut plain = zstd::bulk::decompress(packed, capacity).map_err(content)?;
        if version < FORMAT_VERSION {
            plain.extend(NEITHER);
        }
        let rig: Self = postcard::from_bytes(&plain).map_err(content)?;
        if let Some(appearance) = &rig.appearance {
            appearance.check(rig.face.face_count())?;
        }
        Ok(rig)
    }

    /// Writes the rig to a file; what stood there stays until the new file is whole.
    ///
    /// # Errors
    ///
    /// [`RigError::Io`], [`RigError::Content`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), RigError> {
        let path = path.as_ref();
        let bytes = self.to_bytes()?;
        write_atomically(path, |file| file.write_all(&bytes)).map_err(|source| RigError::Io {
            path: path.to_owned(),
            source,
        })
    }

    /// Reads a rig from a file.
    ///
    /// # Errors
    ///
    /// [`RigError`]: cannot be read, not a rig, another version, cut, damaged.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, RigError> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|source| RigError::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::from_bytes(&bytes)
    }
}

fn content(reason: impl std::fmt::Display) -> RigError {
    RigError::Content {
        reason: reason.to_string(),
    }
}

fn array<const N: usize>(bytes: &[u8], start: usize) -> [u8; N] {
    std::array::from_fn(|i| bytes[start + i])
}
