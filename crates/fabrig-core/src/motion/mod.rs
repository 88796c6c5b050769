//! Takes: weights of shapes, head and eye rotation and wind over time.
//!
//! [`read`] takes a file (Live Link Face or other ARKit CSV, or the keyed text format of
//! [`parse_keys`]) to a [`Clip`]; [`Clip::sample`] gives the values between its frames.

mod clip;
mod csv_take;
mod error;
mod interpolate;
mod keys;
mod pose;
mod read;
mod timecode;

pub use clip::{Clip, ClipError, ClipNotes, ClipTracks, Sample};
pub use csv_take::parse_csv;
pub use error::MotionError;
pub use keys::parse_keys;
pub use pose::{EyeAngles, HeadPose};
pub use read::{ReadOptions, WEIGHT_TOLERANCE, parse, read};
