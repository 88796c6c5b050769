//! What acts on a face from outside: gravity, shaking, wind with gusts, and pushes from points.
//!
//! Everything is a function of place and time alone, so that it is the same for every time step
//! and thread count; everything random comes from a seed of its own.

mod curve;
mod noise;
mod over_time;
mod radial;
mod sum;
mod turbulence;

pub use over_time::{HeadDrive, HeadKey, HeadKeys, Join, Keyed, KeyedValue, OverTime};
pub use radial::{Falloff, FieldFrame, RadialForce};
pub use sum::Fields;
pub use turbulence::{Shake, Turbulence};

pub(super) use curve::Curve;
pub(super) use over_time::keyed_head;
