//! What contact reports.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::Vector;

/// One place where something touches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPoint {
    /// Where. [mm, head frame]
    pub position: Point3<f32>,
    /// From the second element to the first: from the collider to the face.
    pub normal: Vector,
    /// Push between them. (N)
    pub force: f64,
    /// The collider; none between patches.
    pub collider: Option<usize>,
}

/// What contact did in a frame.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactReport {
    /// Pairs near enough to be looked at in every substep.
    pub candidates: usize,
    /// Pairs that pushed each other in the last substep.
    pub contacts: usize,
    /// Bonds between lips at the end of the frame.
    pub bonds: usize,
    /// Bonds that broke in the frame.
    pub broken_bonds: usize,
    /// Hardest that a bond pulled in the frame. (N)
    pub bond_force: f64,
    /// Times that the candidates of a patch were found anew.
    pub detections: usize,
    /// Steps that were cut short, so that nothing crossed.
    pub held: usize,
    /// Nodes that were carried along by a collider, because there was no way aside.
    pub carried: usize,
    /// Pairs that could not be kept apart, caught between colliders.
    pub pinched: usize,
    /// Force of the face on each collider at the end of the frame. [N, head frame]
    ///
    /// Of a face whose patches weigh `areal_density` (see
    /// [`crate::cloth::ClothOptions::areal_density`]).
    pub forces: Vec<Vector>,
    /// Nodes that stood inside a collider when the scene began or was cut.
    pub started_inside: usize,
    /// How deep the deepest of them was. (mm)
    pub started_depth: f64,
}
