//! Where something outside the cloth may move its nodes: contact.

use nalgebra::Point3;

/// One or several substeps as a [`SubstepHook`] sees them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HookSubstep {
    /// Progress through the frame at the call before, or the frame's start, and now, 0 to 1.
    pub progress: [f64; 2],
    /// Time from there to here. (s)
    pub h: f64,
    /// Effective step: a force that acts all the while moves a node by `force h_e^2 / mass`, with
    /// the mass below. (s)
    pub h_e: f64,
    /// Mass of a node against that of the material, with what damping and magnet add to it.
    pub effective_mass: f64,
}

/// A node that a [`SubstepHook`] moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovedNode {
    /// Its index among the nodes that the hook sees.
    pub node: u32,
    /// Where the call before left it. [mm, head frame]
    pub from: Point3<f32>,
    /// Where it is now. [mm, head frame]
    pub to: Point3<f32>,
}

/// Moves nodes at the end of substeps, after all constraints of the cloth.
///
/// Nodes are those of [`SubstepHook::patches`], patch after patch. A hook runs on one thread;
/// what it does must depend on its input alone.
pub trait SubstepHook {
    /// Patches whose nodes it sees, rising.
    fn patches(&self) -> &[usize];

    /// Substeps from one call to the next, at most. Every frame ends with a call.
    ///
    /// After more than one, nodes that a call moves go on as if they had gone straight from where
    /// the call before left them: what was in their way stopped them somewhere in between, and
    /// taking that for a push in the last substep would be a kick.
    fn stride(&self) -> u32 {
        1
    }

    /// Puts nodes where they may be at the start: `wanted` are the targets that the cloth was
    /// reset to [mm, head frame].
    fn reset(&mut self, wanted: &mut [Point3<f32>]);

    /// Says where nodes may be that the constraints put at `nodes` [mm, head frame]: see
    /// [`SubstepHook::moved`].
    fn correct(&mut self, substep: &HookSubstep, nodes: &[Point3<f32>]);

    /// Nodes that the last call moved, rising.
    fn moved(&self) -> &[MovedNode];

    /// For each of [`SubstepHook::patches`] whether the last call stopped something short in it,
    /// so that its history does not tell how it moves on.
    fn stopped(&self) -> &[bool];
}
