//! Recordings of a moving face as MCAP files that Foxglove, Lichtblick and Rerun open.
//!
//! [`McapRecorder`] takes one borrowed [`Frame`] at a time and writes Foxglove's protobuf
//! messages, as [`FrameEncoder`] makes them for any receiver; [`RecordingReader`] gives the frames
//! back, [`MessageReader`] the messages as they are. [`frame`](Frame) owns the topics, the
//! rates and what a recording says of itself.
//!
//! # Units, axes and rounding
//!
//! Messages carry **decimetres**, because viewers start with a camera some metres away and cut
//! off what is nearer than half a unit. Positions are rounded to 2^-13 dm = **12.2 um** and
//! normals to 1/64 (at most 6.1 um and 0.008 off): neither can be seen, and both halve the file. Topology goes along
//! with every mesh, as the viewers want it, and is stored once a chunk. Geometry stands in the frame
//! `head` (+Y up); `/tf` places `head` in `rig`, and `rig` in `world`, which has +Z up as the
//! viewers want it.
//!
//! # Time
//!
//! Log time is simulation time from zero, in steps of one frame rounded up to a nanosecond, so
//! equal inputs give equal bytes.
//!
//! # Limitations
//!
//! A recording is a record of what moved, not an exchange format: it has neither texture
//! coordinates nor the rig. Viewers read the shaded meshes at 30 frames a second or less.

mod background;
mod choice;
mod chunk;
mod contact;
mod container;
mod encode;
mod error;
mod frame;
mod frame_encoder;
mod layout;
mod mcap_recorder;
mod message_reader;
mod messages;
mod reader;
mod schema;
mod strain;

pub use choice::RecordedKind;
pub use contact::{ContactArrow, ContactFrame};
pub use error::RecordingError;
pub(crate) use frame::is_name_of_several;
pub use frame::{
    Frame, LogEvent, LogLevel, RecordingInfo, RecordingOptions, RecordingReport, SurfaceInfo,
    TopicReport, UNITS_PER_MM, topics,
};
pub use frame_encoder::{FrameEncoder, MessageSink, TopicInfo};
pub use layout::{RERUN_SCRIPT, foxglove_layout};
pub use mcap_recorder::McapRecorder;
pub use message_reader::{MessageReader, RecordedMessage, RecordedTopic};
pub use reader::{RecordedFrame, RecordedSurface, RecordingReader};
