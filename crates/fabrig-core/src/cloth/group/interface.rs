//! What the solver sees of a group, whatever its lane type.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::ports::{OwnPorts, Ports};
use crate::cloth::input::PatchMotion;
use crate::cloth::report::Energies;

/// One substep, the same for all groups.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Substep {
    /// Duration. (s)
    pub(crate) h: f64,
    /// Duration of the one before. (s)
    pub(crate) previous_h: f64,
    /// Progress through the frame before and after, 0 to 1.
    pub(crate) progress: [f64; 2],
    /// Uniform acceleration. (mm/s^2)
    pub(crate) uniform: [f64; 3],
    /// Angular velocity (rad/s) and acceleration (rad/s^2) of the head frame.
    pub(crate) angular: [[f64; 3]; 2],
    /// Air velocity, half-way through the substeps that share an evaluation of the wind. (mm/s)
    pub(crate) wind: [f64; 3],
    /// Where the wind is to be evaluated for this substep and some that follow: how far to
    /// their middle. (s)
    pub(crate) wind_horizon: Option<f64>,
}

/// What has gone by since a hook was called.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span {
    /// Progress through the frame then and now, 0 to 1.
    pub(crate) progress: [f64; 2],
    /// Substeps since.
    pub(crate) substeps: usize,
    /// Duration of each of them. (s)
    pub(crate) h: f64,
}

impl Span {
    /// Time since then. (s)
    pub(crate) fn elapsed(&self) -> f64 {
        self.h * self.substeps as f64
    }
}

/// The pairs of a group's nodes with nodes of other patches.
#[derive(Debug, Clone, Default)]
pub(crate) struct GroupPairs {
    /// (node, lane) of every node that has pairs: the ports of the group. Those with equally many
    /// partners follow each other.
    pub(crate) nodes: Vec<(u32, u32)>,
    /// Partners of each such node.
    pub(crate) partners: Vec<Vec<Partner>>,
}

/// The other end of a pair.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Partner {
    /// Its index among the ports of all groups.
    pub(crate) port: usize,
    /// k. [mass/s^2]
    pub(crate) stiffness: f64,
}

/// What lies under the nodes of a group's pads, one entry for each node that has a floor.
pub(crate) type GroupFloor = Vec<FloorNode>;

/// What lies under a node of a pad.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FloorNode {
    /// The node, and its lane.
    pub(crate) node: u32,
    pub(crate) lane: u32,
    /// The node of the pad that the floor's node lies under: this one, or the nearest that has
    /// one.
    pub(crate) over: u32,
    /// Patch of the floor, and its node.
    pub(crate) patch: usize,
    pub(crate) patch_node: u32,
    /// Its index among the ports of all groups.
    pub(crate) port: u32,
}

/// What the energy monitor looks at, per patch.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Monitor {
    /// Energies now.
    pub(crate) energies: Energies,
    /// Energy before the frame.
    pub(crate) before: f64,
    /// Square root of the kinetic energy that moving targets and fields can give. It adds to
    /// the square root of the energy there was.
    pub(crate) drive: f64,
    /// Energy by which rest lengths and anchors differ from the targets.
    pub(crate) mismatch: f64,
    /// Rate at which damping takes velocity away. (1/s)
    pub(crate) damping: f64,
    /// Displacements that were held back.
    pub(crate) clamped: u64,
    /// Whether all of the state is finite and near.
    pub(crate) is_sound: bool,
}

/// A group behind its lane type.
pub(crate) trait PatchGroup: Send + Sync {
    /// Patches of the lanes.
    fn patches(&self) -> &[usize];
    /// Replaces the pairs, whose own ends are the ports from `first_port` on.
    fn set_pairs(&mut self, first_port: usize, pairs: GroupPairs);
    /// Replaces what lies under its pads.
    fn set_floor(&mut self, floor: GroupFloor);
    /// Puts the cloth on the targets, moving with them.
    fn reset(&mut self, targets: &[PatchMotion], anchors: &[PatchMotion]);
    /// Starts a frame of `dt` seconds.
    fn begin_frame(&mut self, dt: f64, targets: &[PatchMotion], anchors: &[PatchMotion]);
    /// Before the constraints of a substep: up to the inertial target. Fills `ports`.
    fn predict(&mut self, substep: &Substep, ports: OwnPorts<'_>);
    /// The constraints of a substep. Reads the ports of all groups.
    fn solve(&mut self, substep: &Substep, ports: &Ports);
    /// Whether a hook has the last word on positions from now on.
    fn set_hooked(&mut self, is_hooked: bool);
    /// After the constraints: holds steps back as the end of the substep would without a hook.
    fn hold_back(&mut self);
    /// Where the constraints put the nodes of a patch. [mm, head frame]
    fn write_solution(&self, lane: usize, positions: &mut [Point3<f32>]);
    /// Moves a node between constraints and new state. (mm)
    fn shift(&mut self, lane: usize, node: usize, by: [f64; 3]);
    /// Lets a node that was shifted go on as if it had gone straight there against its target.
    ///
    /// - `from`: where it began the span [mm, head frame]
    fn straighten(&mut self, lane: usize, node: usize, from: Point3<f32>, span: Span);
    /// Lets the monitor know that nodes of a patch were moved from outside by `squared`
    /// altogether (mm^2), and forgets its history where that `stopped` it.
    fn note_shifts(&mut self, lane: usize, squared: f64, stopped: bool);
    /// Effective step (s) and effective mass against the material's, of a patch.
    fn effective_step(&self, lane: usize) -> [f64; 2];
    /// Puts a node at rest against its moving target at an offset. (mm)
    fn place(&mut self, lane: usize, node: usize, offset: [f64; 3]);
    /// After the constraints of a substep: the new state.
    fn finish(&mut self);
    /// [`PatchGroup::finish`], and then [`PatchGroup::predict`] for the substep that follows in
    /// the same frame, in one pass.
    fn turn(&mut self, following: &Substep, ports: OwnPorts<'_>);
    /// Ends the frame: what the monitor sees, per patch.
    fn end_frame(&mut self, monitors: &mut Vec<Monitor>);
    /// Takes backward Euler steps for a patch for `frames` frames, solved by descent if
    /// `is_robust`.
    fn fall_back(&mut self, lane: usize, frames: u32, is_robust: bool);
    /// Tells the other groups that this one's nodes keep their displacement from now on.
    fn fall_asleep(&mut self, ports: [OwnPorts<'_>; 2]);
    /// Wakes at the end of a frame of `dt` seconds that led to `targets`: nodes have kept their
    /// displacement, and move as their targets do.
    fn wake(&mut self, dt: f64, targets: &[PatchMotion], anchors: &[PatchMotion]);
    /// Puts a patch back to its target.
    fn freeze(&mut self, lane: usize);
    /// Writes displacements of a patch from its targets. (mm)
    fn write_displacements(&self, lane: usize, displacements: &mut [Vector3<f32>]);
    /// Writes positions of a patch. [mm, head frame]
    fn write_positions(&self, lane: usize, positions: &mut [Point3<f32>]);
    /// Position and velocity of one node in full precision. [mm, mm/s]
    fn node_state(&self, lane: usize, node: usize) -> ([f64; 3], [f64; 3]);
}

/// All groups in parallel. They are few and unlike, so each is a piece of work of its own.
pub(crate) fn each_group(
    groups: &mut [Box<dyn PatchGroup>],
) -> impl IndexedParallelIterator<Item = &mut Box<dyn PatchGroup>> {
    groups.par_iter_mut().with_max_len(1)
}
