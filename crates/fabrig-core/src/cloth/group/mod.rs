//! A group: patches of one grid shape in the lanes of one register, and one substep of them.
//!
//! Everything a substep needs is kept as arrays of one entry per node (or edge), each entry
//! holding that node of every patch. Nothing is allocated while stepping.

mod anchors;
mod descent;
mod dispatch;
mod floor;
mod frame;
mod interface;
mod pairs;
mod paper;
mod ports;
mod solve;
mod state;
mod substep;
mod sweeps;

pub(crate) use interface::{
    FloorNode, GroupFloor, GroupPairs, Monitor, Partner, PatchGroup, Span, Substep, each_group,
};
pub(crate) use ports::{OwnPorts, Ports};
pub(crate) use state::Group;
