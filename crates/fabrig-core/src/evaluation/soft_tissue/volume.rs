//! The volume between a fat pad and what lies under it.
//!
//! Every node of a pad stands on the node of another patch that is nearest to it at rest, among
//! the patches that it is stitched to. Pad, ground and the walls between their rims are a closed
//! surface; its volume is that of the pad, with no regard to how the solver counts it.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use serde::Serialize;

use super::SoftTissueError;
use crate::anatomy::{Attachment, GridShape, PatchKind};
use crate::cloth::STANDING_GRAVITY;
use crate::rig::Rig;
use crate::scene::fields::OverTime;
use crate::scene::{FacePose, Scene, Simulation};

/// Frames that a face is held under each gravity; fat that rings at 5 Hz has died away.
const HELD_FRAMES: u32 = 60;
/// (s)
const STEP: f64 = 1.0 / 60.0;

/// What one pad did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PadVolume {
    /// The pad.
    pub patch: String,
    /// Volume at rest. (mm^3)
    pub rest: f64,
    /// Largest change under any gravity, as a share of the volume at rest.
    pub worst: f64,
    /// The gravity it changed most under. (mm/s^2)
    pub worst_gravity: [f32; 3],
    /// How far the pad went at most, as a mean of its nodes. (mm)
    pub sag: f64,
}

/// The 26 directions to the neighbours of a cube among cubes, at the strength of gravity.
/// (mm/s^2)
pub fn gravity_directions() -> Vec<Vector3<f32>> {
    let strength = Vector3::from(STANDING_GRAVITY).norm();
    let mut directions = Vec::new();
    for x in -1i8..=1 {
        for y in -1i8..=1 {
            for z in -1i8..=1 {
                let d = Vector3::new(f32::from(x), f32::from(y), f32::from(z));
                if d.norm() > 0.5 {
                    directions.push(d.normalize() * strength);
                }
            }
        }
    }
    directions
}

/// Holds the neutral face under each gravity and measures every pad.
///
/// - `gravities`: in the head frame (mm/s^2)
///
/// # Errors
///
/// [`SoftTissueError`] where the rig has no fat, or cannot be simulated.
pub fn pad_volumes(
    rig: &Arc<Rig>,
    scene: &Scene,
    gravities: &[Vector3<f32>],
) -> Result<Vec<PadVolume>, SoftTissueError> {
    let pads = Pad::all(rig);
    if pads.is_empty() {
        return Err(SoftTissueError::NoPads);
    }
    let mut simulation = Simulation::new(Arc::clone(rig), scene.clone().without_economy(), None)?;
    let pose = FacePose::neutral(rig.shape_names.len());
    let at_rest: Vec<f64> = pads.iter().map(|pad| pad.volume(&simulation)).collect();
    let mut found: Vec<PadVolume> = pads
        .iter()
        .zip(&at_rest)
        .map(|(pad, &rest)| PadVolume {
            patch: rig.patches[pad.patch].patch.chart.name.clone(),
            rest,
            worst: 0.0,
            worst_gravity: [0.0; 3],
            sag: 0.0,
        })
        .collect();
    for gravity in gravities {
        let scene = Scene {
            gravity: OverTime::Constant(*gravity),
            ..scene.clone()
        };
        simulation = Simulation::new(Arc::clone(rig), scene.without_economy(), None)?;
        for _ in 0..HELD_FRAMES {
            simulation.advance_to(pose.clone(), STEP)?;
        }
        for (pad, found) in pads.iter().zip(&mut found) {
            let change = pad.volume(&simulation) / found.rest - 1.0;
            if change.abs() > found.worst.abs() {
                found.worst = change;
                found.worst_gravity = (*gravity).into();
            }
            found.sag = found.sag.max(pad.sag(&simulation));
        }
    }
    Ok(found)
}

/// A pad and what it stands on.
pub(super) struct Pad {
    pub(super) patch: usize,
    grid: GridShape,
    /// For each node (patch, node) that it stands on.
    ground: Vec<(usize, usize)>,
}

impl Pad {
    /// Every fat pad that is stitched to something.
    pub(super) fn all(rig: &Rig) -> Vec<Self> {
        let patches = rig.patches.iter().enumerate();
        patches
            .filter(|(_, p)| p.patch.chart.kind == PatchKind::FatPad)
            .filter_map(|(patch, p)| {
                let mut under = Vec::new();
                for attachment in &p.patch.chart.attachments {
                    if let Attachment::Patch { patch, .. } = attachment {
                        let nodes = 0..rig.patches[*patch as usize].patch.neutral.len();
                        under.extend(nodes.map(|node| (*patch as usize, node)));
                    }
                }
                let place = |&(q, node): &(usize, usize)| rig.patches[q].patch.neutral[node];
                let nodes = p.patch.neutral.iter();
                let ground: Option<Vec<(usize, usize)>> = nodes
                    .map(|x| {
                        let distance = |at: &(usize, usize)| (place(at) - x).norm_squared();
                        let near = under
                            .iter()
                            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
                        near.copied()
                    })
                    .collect();
                Some(Self {
                    patch,
                    grid: p.patch.chart.grid,
                    ground: ground?,
                })
            })
            .collect()
    }

    /// (mm^3)
    fn volume(&self, simulation: &Simulation) -> f64 {
        let top = |n: u32| -> Vector3<f64> {
            let nodes = simulation.patch_positions(self.patch);
            nodes[n as usize].coords.cast()
        };
        let floor = |n: u32| -> Vector3<f64> {
            let (patch, node) = self.ground[n as usize];
            simulation.patch_positions(patch)[node].coords.cast()
        };
        let mut sixfold = 0.0;
        let mut face = |a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>| {
            sixfold += a.dot(&b.cross(&c));
        };
        for [a, b, c, d] in self.grid.quads() {
            face(top(a), top(b), top(c));
            face(top(a), top(c), top(d));
            face(floor(a), floor(c), floor(b));
            face(floor(a), floor(d), floor(c));
        }
        for [a, b] in self.rim() {
            face(top(b), top(a), floor(a));
            face(top(b), floor(a), floor(b));
        }
        (sixfold / 6.0).abs()
    }

    /// Edges around an open grid, in the sense of its quads.
    fn rim(&self) -> Vec<[u32; 2]> {
        let GridShape {
            u_count, v_count, ..
        } = self.grid;
        let at = |u: u32, v: u32| v * u_count + u;
        let (last_u, last_v) = (u_count - 1, v_count - 1);
        let mut rim = Vec::new();
        for u in 0..last_u {
            rim.push([at(u, 0), at(u + 1, 0)]);
            rim.push([at(u + 1, last_v), at(u, last_v)]);
        }
        for v in 0..last_v {
            rim.push([at(last_u, v), at(last_u, v + 1)]);
            rim.push([at(0, v + 1), at(0, v)]);
        }
        rim
    }

    /// How far the nodes are from their muscle shapes, in the mean. (mm)
    fn sag(&self, simulation: &Simulation) -> f64 {
        let nodes = simulation.patch_positions(self.patch);
        let targets = simulation.patch_targets(self.patch);
        let pairs = nodes.iter().zip(targets);
        let sum: f64 = pairs
            .map(|(x, t): (&Point3<f32>, _)| f64::from((x - t).norm()))
            .sum();
        sum / nodes.len().max(1) as f64
    }
}
