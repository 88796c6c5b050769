//! The shapes of a rig as morph targets of its skin.
//!
//! A target is the skin under one shape at weight 1 less the skin at rest: held until the cloth
//! has settled, or with the patches right on their muscle shapes. `mouthClose` brings the lips
//! of an open jaw together and means nothing without it, so it is taken on top of `jawOpen`:
//! both at weight 1 add up to the closed lips of the open jaw.

use std::ops::ControlFlow;
use std::sync::Arc;

use rayon::prelude::*;

use super::face::{Placement, Shape};
use super::{ExportError, ShapeSource};
use crate::Vector;
use crate::facs::{ARKIT_SHAPES, JAW_OPEN, MOUTH_CLOSE};
use crate::rig::Rig;
use crate::scene::{Dynamics, FacePose, Scene, SceneError, Simulation, hold_pose};

/// Offsets below this are left out: cloth that has come to rest still moves by as much. (mm)
pub(super) const SMALLEST_OFFSET: f64 = 0.005;

/// Simulations that hold shapes side by side: which of them holds which shape must not depend on
/// how many threads there are. Holding one shape keeps more than one thread busy.
const SIMULATIONS: usize = 4;

/// Names of the shapes in the order of files, ARKit's 52 first, and the index of each in the
/// rig's list; `None` for one of the 52 that the rig does not know.
pub(super) fn shape_order(rig: &Rig) -> Vec<(String, Option<usize>)> {
    let known = ARKIT_SHAPES
        .iter()
        .map(|name| ((*name).to_owned(), rig.shape_index(name)));
    let others = rig.shape_names.iter().enumerate();
    let others = others.filter(|(_, name)| !ARKIT_SHAPES.contains(&name.as_str()));
    known
        .chain(others.map(|(index, name)| (name.clone(), Some(index))))
        .collect()
}

/// Every shape of the rig, in [`shape_order`].
///
/// - `progress`: called with the share that is done
pub(super) fn morph_targets(
    rig: &Arc<Rig>,
    scene: &Scene,
    source: ShapeSource,
    placement: &Placement,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<Shape>, ExportError> {
    let scene = Scene {
        dynamics: match source {
            ShapeSource::Settled => Dynamics::Cloth,
            ShapeSource::Targets => Dynamics::None,
        },
        ..scene.clone()
    };
    let mut simulations = (0..SIMULATIONS)
        .map(|_| Simulation::new(Arc::clone(rig), scene.clone(), None))
        .collect::<Result<Vec<_>, _>>()?;
    let order = shape_order(rig);
    let mut jaw_open: Option<Vec<Vector>> = None;
    let mut shapes = Vec::with_capacity(order.len());
    for first in (0..order.len()).step_by(SIMULATIONS) {
        let batch = first..order.len().min(first + SIMULATIONS);
        let held = batch.clone().into_par_iter().zip(&mut simulations);
        let held = held.map(|(k, simulation)| {
            let Some(index) = order[k].1 else {
                return Ok(Vec::new());
            };
            let jaw = (k == MOUTH_CLOSE).then(|| order[JAW_OPEN].1).flatten();
            let shapes: Vec<usize> = jaw.into_iter().chain([index]).collect();
            posed(simulation, source, &shapes)
        });
        let held: Vec<Result<Vec<Vector>, SceneError>> = held.collect();
        for (k, moved) in batch.zip(held) {
            let moved = moved?;
            let before = jaw_open.as_ref().filter(|_| k == MOUTH_CLOSE);
            let offsets = moved.iter().enumerate().map(|(v, now)| {
                let offset = now - before.map_or(Vector::zeros(), |before| before[v]);
                (v as u32, offset)
            });
            let offsets = offsets
                .filter(|(_, offset)| offset.norm() >= SMALLEST_OFFSET)
                .map(|(v, offset)| (v, placement.offset(&offset)))
                .collect();
            shapes.push(Shape {
                name: order[k].0.clone(),
                offsets,
            });
            if k == JAW_OPEN && order[k].1.is_some() {
                jaw_open = Some(moved);
            }
        }
        if progress(shapes.len() as f64 / order.len() as f64).is_break() {
            return Err(ExportError::Stopped);
        }
    }
    Ok(shapes)
}

/// How far every vertex of the skin is from rest with some shapes at weight 1. (mm)
fn posed(
    simulation: &mut Simulation,
    source: ShapeSource,
    shapes: &[usize],
) -> Result<Vec<Vector>, SceneError> {
    let mut pose = FacePose::neutral(simulation.rig().shape_names.len());
    for &shape in shapes {
        pose.weights[shape] = 1.0;
    }
    match source {
        ShapeSource::Settled => hold_pose(simulation, &pose)?,
        ShapeSource::Targets => simulation.reset(pose)?,
    }
    let pairs = simulation.skin().iter().zip(simulation.rest_skin());
    Ok(pairs.map(|(now, rest)| (now - rest).cast()).collect())
}
