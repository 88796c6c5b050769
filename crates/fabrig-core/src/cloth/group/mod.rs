//! A group: patches of one grid shape in the lanes of one register, and one substep of them.
//!
//! Everything a substep needs is kept as arrays of one entry per node (or edge), each entry
//! holding that node of every patch. Nothing is allocated while stepping.

mod descent;
mod dispatch;
mod frame;
mod interface;
mod pairs;
mod paper;
mod solve;
mod state;
mod substep;
mod sweeps;

pub(crate) use dispatch::{Widest, vectorized};
pub(crate) use interface::{GroupPairs, Monitor, Partner, PatchGroup, Substep};
pub(crate) use state::Group;
