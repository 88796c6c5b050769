//! What a check found.

use serde::Serialize;

use super::CheckGates;
use crate::registration::DistanceStatistics;

/// What one shape does.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ShapeCheck {
    /// Name.
    pub shape: String,
    /// Shape that it is held together with, of whose pose it is the difference.
    pub over: Option<String>,
    /// Largest motion of the skin. (mm)
    pub amplitude_mm: f64,
    /// Largest motion of eyeballs, teeth and tongue. (mm)
    pub parts_mm: f64,
    /// Largest motion of the template's skin. (mm)
    pub template_mm: f64,
    /// Amplitude against the template's at the face's size, in the least squares sense; `None`
    /// where the template moves no skin.
    pub ratio: Option<f64>,
    /// Cosine of the motion with the template's; `None` likewise.
    pub direction: Option<f64>,
    /// Vertices of lips and lids that move with the other side.
    pub wrong_side: usize,
    /// Edges that are torn.
    pub torn_edges: usize,
    /// Motion of the other side beyond the template's; `None` for a shape of both. (mm)
    pub leak_mm: Option<f64>,
    /// Triangles in view that turn by more than 90 degrees where the template's do not.
    pub flipped: usize,
    /// Least and largest area of a triangle in view against rest, all but a thousandth at
    /// either end.
    pub area_ratios: [f64; 2],
    /// Pairs of an edge and a triangle of upper and lower lip that pass through each other and
    /// do not at rest.
    pub lip_crossings: usize,
    /// How deep. (mm)
    pub lip_depth_mm: f64,
    /// The same of upper and lower lids.
    pub lid_crossings: usize,
    /// How deep. (mm)
    pub lid_depth_mm: f64,
}

/// A muscle shape beside the template's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MuscleCheck {
    /// Name, such as `zygomaticus_major_l.mouthSmileLeft`.
    pub name: String,
    /// Largest motion of a node on the template. (mm)
    pub template_mm: f64,
    /// Amplitude against the template's, in the least squares sense.
    pub ratio: f64,
    /// Cosine of the motion with the template's; zero where it does not move.
    pub direction: f64,
}

/// Distances of the mesh from the registered template in one region.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegionDistance {
    /// Name of the region.
    pub region: String,
    /// (mm)
    pub distance: DistanceStatistics,
}

/// A gate that does not hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// The gate.
    pub gate: &'static str,
    /// The shape or muscle shape, where it is about one.
    pub shape: Option<String>,
    /// What was found.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// A vertex of the user's mesh where it shows, counted from 0.
    pub vertex: Option<u32>,
    /// One sentence.
    pub text: String,
}

/// Everything that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CheckReport {
    /// Name of the template.
    pub template: String,
    /// Vertices of the mesh that are skin.
    pub skin_vertices: usize,
    /// Size of the face against the template.
    pub size: f64,
    /// The limits.
    pub gates: CheckGates,
    /// Every shape, in the rig's order.
    pub shapes: Vec<ShapeCheck>,
    /// Muscle shapes that move the template by half a millimetre or more and here by less than
    /// half or more than twice as much, or another way (cosine below 0.7).
    pub muscles: Vec<MuscleCheck>,
    /// Distances of the face from the registered template, mouth and sockets, neck and scalp
    /// left out. (mm)
    pub distance: DistanceStatistics,
    /// Distances region by region.
    pub regions: Vec<RegionDistance>,
    /// Gates that do not hold; none where the rig passes.
    pub findings: Vec<Finding>,
    /// What a person should know that no gate is about.
    pub notes: Vec<String>,
}

impl CheckReport {
    /// Whether every gate holds.
    pub fn passes(&self) -> bool {
        self.findings.is_empty()
    }
}
