//! Takes: weights of shapes, head and eye rotation and wind over time.
//!
//! [`read`] takes a file of any kind ([`TakeFormat`]) to a [`Clip`], fitted to its performer
//! by an [`Adjustment`]; [`Clip::sample`] gives the values between its frames, [`write_csv`]
//! writes it down again.

mod adjust;
mod clip;
mod csv;
mod error;
mod face_cap;
mod frames;
mod interpolate;
mod keys;
mod markers;
mod mediapipe;
mod pose;
mod read;
mod timecode;
mod units;
mod write;

pub use adjust::Adjustment;
pub use clip::{Clip, ClipError, ClipNotes, ClipTracks, Gap, Sample};
pub use csv::parse_csv;
pub use error::MotionError;
pub use keys::parse_keys;
pub use markers::MarkerTake;
pub use pose::{EyeAngles, HeadPose};
pub use read::{ReadOptions, TakeFormat, WEIGHT_TOLERANCE, parse, read};
pub use write::write_csv;
