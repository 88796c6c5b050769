//! What fat does: whether it keeps its volume however the head lies, and how it rings.
//!
//! [`pad_volumes`] holds the neutral face under gravity from every side and measures what each fat
//! pad encloses with the muscles under it. [`pad_rings`] pushes the head, lets it go, and compares
//! how pads hang and ring with the network of oscillators that their materials say they are.

mod error;
mod oscillator;
mod ringing;
mod volume;

pub use error::SoftTissueError;
pub use oscillator::{Oscillation, oscillation};
pub use ringing::{PadRing, pad_rings};
pub use volume::{PadVolume, gravity_directions, pad_volumes};
