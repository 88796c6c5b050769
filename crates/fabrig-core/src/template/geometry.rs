//! The binary half of a pack: meshes, labels and shapes, small and exact.
//!
//! Layout: 8 bytes magic, then little-endian u32 format version, u32 CRC-32 of what follows
//! the header, u64 length of what follows, then zstd-compressed postcard. Lengths are kept in
//! whole steps of 2^-10 mm, so mirror images are exact negatives of each other and rounding is
//! below half a micrometre. Right-hand shapes are not stored: they are mirrors of left ones.

use serde::{Deserialize, Serialize};

use super::{EyeSocket, JawHinge, RigidBody, TemplateError};
use crate::{Point, Vector};

const MAGIC: [u8; 8] = *b"FABRIGT\n";
const VERSION: u32 = 1;
const HEADER_LENGTH: usize = 24;
const STEPS_PER_MILLIMETRE: f64 = 1024.0;
/// More than any pack needs; keeps a forged length from exhausting memory.
const LARGEST_CONTENTS: usize = 256 << 20;

/// Three lengths in steps of 2^-10 mm.
pub(super) type Steps = [i32; 3];

/// A mesh in steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct StoredMesh {
    pub(super) positions: Vec<Steps>,
    pub(super) faces: Vec<Vec<u32>>,
}

/// A part that is not skin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct StoredPart {
    pub(super) name: String,
    pub(super) follows: RigidBody,
    pub(super) mesh: StoredMesh,
}

/// What a shape moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum StoredShape {
    /// (gap to the last moved vertex, delta), vertex after vertex.
    Deltas(Vec<(u32, Steps)>),
    /// The mirror image of another shape.
    MirrorOf(u32),
}

/// Everything in the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct StoredGeometry {
    pub(super) skin: StoredMesh,
    pub(super) mirror: Vec<u32>,
    pub(super) vertex_regions: Vec<u8>,
    pub(super) parts: Vec<StoredPart>,
    pub(super) shapes: Vec<(String, StoredShape)>,
    pub(super) part_deltas: Vec<(u32, u32, Vec<Steps>)>,
    pub(super) jaw: JawHinge,
    pub(super) eyes: [EyeSocket; 2],
}

/// Nearest step, halves away from zero (so negation commutes with it).
pub(super) fn to_steps(v: &Vector) -> Steps {
    [v.x, v.y, v.z].map(|c| (c * STEPS_PER_MILLIMETRE).round() as i32)
}

/// Back to millimetres, exactly.
pub(super) fn to_vector(s: &Steps) -> Vector {
    Vector::new(f64::from(s[0]), f64::from(s[1]), f64::from(s[2])) / STEPS_PER_MILLIMETRE
}

/// Back to millimetres, exactly.
pub(super) fn to_point(s: &Steps) -> Point {
    Point::from(to_vector(s))
}

/// The bytes of a geometry file.
pub(super) fn encode(geometry: &StoredGeometry) -> Result<Vec<u8>, TemplateError> {
    pack(geometry)
}

/// Reads the bytes of a geometry file.
pub(super) fn decode(bytes: &[u8]) -> Result<StoredGeometry, TemplateError> {
    unpack(bytes)
}

/// Header, checksum and compression around any contents.
pub(super) fn pack<T: Serialize>(contents: &T) -> Result<Vec<u8>, TemplateError> {
    let failed = |reason: String| TemplateError::Decode { reason };
    let raw = postcard::to_stdvec(contents).map_err(|e| failed(e.to_string()))?;
    let body = zstd::bulk::compress(&raw, 19).map_err(|e| failed(e.to_string()))?;
    let mut bytes = Vec::with_capacity(HEADER_LENGTH + body.len());
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&VERSION.to_le_bytes());
    bytes.extend_from_slice(&crc32fast::hash(&body).to_le_bytes());
    bytes.extend_from_slice(&(body.len() as u64).to_le_bytes());
    bytes.extend_from_slice(&body);
    Ok(bytes)
}

/// Undoes [`pack`], checking everything on the way.
pub(super) fn unpack<T: for<'de> Deserialize<'de>>(bytes: &[u8]) -> Result<T, TemplateError> {
    let magic = &bytes[..bytes.len().min(MAGIC.len())];
    if magic != MAGIC {
        return Err(TemplateError::WrongMagic {
            found: magic.to_vec(),
            expected: MAGIC,
        });
    }
    if bytes.len() < HEADER_LENGTH {
        return Err(TemplateError::Truncated {
            found: bytes.len(),
            expected: HEADER_LENGTH,
        });
    }
    let word =
        |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    if word(8) != VERSION {
        return Err(TemplateError::WrongVersion {
            found: word(8),
            expected: VERSION,
        });
    }
    let body = &bytes[HEADER_LENGTH..];
    let length = u64::from(word(16)) | (u64::from(word(20)) << 32);
    if body.len() as u64 != length {
        return Err(TemplateError::Truncated {
            found: bytes.len(),
            expected: usize::try_from(length)
                .unwrap_or(usize::MAX)
                .saturating_add(HEADER_LENGTH),
        });
    }
    let found = crc32fast::hash(body);
    if found != word(12) {
        return Err(TemplateError::Checksum {
            found,
            expected: word(12),
        });
    }
    let failed = |reason: String| TemplateError::Decode { reason };
    let capacity = zstd::zstd_safe::get_frame_content_size(body)
        .ok()
        .flatten()
        .and_then(|n| usize::try_from(n).ok())
        .filter(|&n| n <= LARGEST_CONTENTS)
        .ok_or_else(|| failed("the compressed frame states no usable size".to_owned()))?;
    let raw = zstd::bulk::decompress(body, capacity).map_err(|e| failed(e.to_string()))?;
    postcard::from_bytes(&raw).map_err(|e| failed(e.to_string()))
}
