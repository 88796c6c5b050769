//! Where something outside the cloth may move its nodes: contact.

use nalgebra::Point3;

/// One substep as a [`SubstepHook`] sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HookSubstep {
    /// Progress through the frame before and after, 0 to 1.
    pub progress: [f64; 2],
    /// Duration. (s)
    pub h: f64,
    /// Effective step that turns a change of position into one of velocity. (s)
    pub h_e: f64,
    /// Mass of a node against that of the material, with what damping and magnet add to it.
    pub effective_mass: f64,
}

/// Moves nodes at the end of every substep, after all constraints of the cloth.
///
/// Nodes are those of [`SubstepHook::patches`], patch after patch. A hook runs on one thread;
/// what it does must depend on its input alone.
pub trait SubstepHook {
    /// Patches whose nodes it sees, rising.
    fn patches(&self) -> &[usize];

    /// Puts nodes where they may be at the start: `wanted` are the targets that the cloth was
    /// reset to [mm, head frame].
    fn reset(&mut self, wanted: &mut [Point3<f32>]);

    /// Says where nodes may be that the constraints put at `nodes` [mm, head frame]: see
    /// [`SubstepHook::moved`].
    fn correct(&mut self, substep: &HookSubstep, nodes: &[Point3<f32>]);

    /// Nodes that the last call moved, as indices into what it was given, rising, and where they
    /// are now. [mm, head frame]
    fn moved(&self) -> &[(u32, Point3<f32>)];

    /// For each of [`SubstepHook::patches`] whether the last call stopped something short in it,
    /// so that its history does not tell how it moves on.
    fn stopped(&self) -> &[bool];
}
