//! What the chain loses: a template rigged as if it were a user's face should give back its
//! own whole-face shapes.
//!
//! Each shape at weight 1 goes through muscle shapes, patches (with or without cloth) and
//! skin, and is compared, vertex by vertex, with the shape itself.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use serde::Serialize;

use crate::mesh::Topology;
use crate::rig::Rig;
use crate::scene::{FacePose, Scene, SceneError, Simulation};
use crate::template::{RegionId, Template};

/// A vertex moves where a shape displaces it by this much. (mm)
const MOVED: f64 = 0.05;

/// Errors over a set of vertices. (mm)
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct LossFigures {
    /// Vertices in the set.
    pub count: usize,
    /// Mean error.
    pub mean: f64,
    /// 95 % of vertices have at most this error.
    pub percentile_95: f64,
    /// Largest error.
    pub max: f64,
}

impl LossFigures {
    /// Figures of a list of errors; zeros for none.
    pub fn of(mut errors: Vec<f64>) -> Self {
        if errors.is_empty() {
            return Self::default();
        }
        errors.sort_by(f64::total_cmp);
        let count = errors.len();
        let rank = ((count as f64 * 0.95).ceil() as usize).clamp(1, count) - 1;
        Self {
            count,
            mean: errors.iter().sum::<f64>() / count as f64,
            percentile_95: errors[rank],
            max: errors[count - 1],
        }
    }
}

/// What one shape loses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ShapeLoss {
    /// Name of the shape.
    pub shape: String,
    /// Largest displacement of the shape itself. (mm)
    pub amplitude: f64,
    /// Over the vertices that the shape moves.
    pub moved: LossFigures,
    /// Over the vertices of lip and lid contours that it moves.
    pub contours: LossFigures,
    /// Over the vertices that the shape leaves still: what leaks.
    pub still: LossFigures,
    /// Root mean square distance of the patches from their muscle shapes. (mm)
    pub settle_rms: f64,
}

/// Step with which a pose is held. (s)
const HOLD_STEP: f64 = 1.0 / 60.0;
/// Steps from one look at the skin to the next: what creeps shows over several.
const STEPS_BETWEEN_LOOKS: usize = 8;
/// A face holds still once no skin vertex moved this much since the last look: single precision
/// makes cloth that has come to rest tremble by half of it. (mm)
const STILL: f32 = 4e-3;
/// Steps after which a face is taken as it is.
const LONGEST_HOLD: usize = 240;

/// Holds a pose until the face is still, or four seconds long. Everything is modelled, whatever the
/// scene's economy.
///
/// # Errors
///
/// [`SceneError`] where the pose does not fit the rig.
pub fn hold_pose(simulation: &mut Simulation, pose: &FacePose) -> Result<(), SceneError> {
    simulation.without_economy(|simulation| hold(simulation, pose))
}

fn hold(simulation: &mut Simulation, pose: &FacePose) -> Result<(), SceneError> {
    simulation.reset(pose.clone())?;
    let mut before = simulation.skin().to_vec();
    for _ in 0..LONGEST_HOLD / STEPS_BETWEEN_LOOKS {
        for _ in 0..STEPS_BETWEEN_LOOKS {
            simulation.advance_to(pose.clone(), HOLD_STEP)?;
        }
        let moves = before
            .iter()
            .zip(simulation.skin())
            .any(|(a, b)| (a - b).norm() > STILL);
        if !moves {
            break;
        }
        before.copy_from_slice(simulation.skin());
    }
    Ok(())
}

/// Holds each shape of a template on a rig of the template itself and compares.
///
/// The rig's face must be the template's skin, vertex by vertex (registered or not).
///
/// # Errors
///
/// [`SceneError`] where the rig does not fit.
pub fn chain_loss(
    rig: &Arc<Rig>,
    template: &Template,
    scene: &Scene,
) -> Result<Vec<ShapeLoss>, SceneError> {
    let contours = contour_vertices(template);
    let mut simulation = Simulation::new(Arc::clone(rig), scene.clone(), None)?;
    let rest = rig.skin_at_rest();
    (0..template.shapes.len())
        .map(|shape| {
            let mut pose = FacePose::neutral(template.shapes.len());
            pose.weights[shape] = 1.0;
            hold_pose(&mut simulation, &pose)?;
            let mut loss = shape_loss(template, &contours, shape, &rest, simulation.skin());
            loss.settle_rms = simulation.settle_error().0;
            Ok(loss)
        })
        .collect()
}

/// Contours of lips and lids: where the skin of a lip or lid ends at the mouth or the eye.
pub fn contour_vertices(template: &Template) -> Vec<u32> {
    let topology = Topology::from_mesh(&template.skin);
    let regions = &template.regions;
    let name = |id: RegionId| regions.regions[id.0 as usize].name.as_str();
    (0..template.skin.vertex_count() as u32)
        .filter(|&v| {
            let own = name(regions.vertex_regions[v as usize]);
            let inside = if own == "upper_lip" || own == "lower_lip" {
                "mouth_interior"
            } else if own.contains("_lid_") {
                "socket"
            } else {
                return false;
            };
            topology
                .neighbours(v)
                .iter()
                .any(|&n| name(regions.vertex_regions[n as usize]).starts_with(inside))
        })
        .collect()
}

/// Compares one posed skin with the shape it should be.
///
/// - `rest`, `posed`: skin in the template's vertex order (mm)
pub fn shape_loss(
    template: &Template,
    contours: &[u32],
    shape: usize,
    rest: &[Point3<f32>],
    posed: &[Point3<f32>],
) -> ShapeLoss {
    let shape = &template.shapes[shape];
    let wanted = shape.spread(rest.len());
    let error = |v: usize| ((posed[v] - rest[v]).cast::<f64>() - wanted[v]).norm();
    let (moved, still): (Vec<usize>, Vec<usize>) =
        (0..rest.len()).partition(|&v| wanted[v].norm() >= MOVED);
    let on_contours = contours
        .iter()
        .map(|&v| v as usize)
        .filter(|&v| wanted[v].norm() >= MOVED);
    ShapeLoss {
        shape: shape.name.clone(),
        amplitude: wanted.iter().map(Vector3::norm).fold(0.0, f64::max),
        contours: LossFigures::of(on_contours.map(error).collect()),
        moved: LossFigures::of(moved.into_iter().map(error).collect()),
        still: LossFigures::of(still.into_iter().map(error).collect()),
        settle_rms: 0.0,
    }
}
