//! The shapes of a rig as morph targets of its skin.
//!
//! A target is the skin under one shape at weight 1 less the skin at rest: held until the cloth
//! has settled, or with the patches right on their muscle shapes. `mouthClose` brings the lips
//! of an open jaw together and means nothing without it, so it is taken on top of `jawOpen`:
//! both at weight 1 add up to the closed lips of the open jaw.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::face::{Placement, Shape};
use super::{ExportError, ShapeSource};
use crate::Vector;
use crate::facs::{ARKIT_SHAPES, JAW_OPEN, MOUTH_CLOSE};
use crate::rig::Rig;
use crate::scene::{Dynamics, FacePose, Scene, Simulation, hold_pose};

/// Offsets below this are left out: cloth that has come to rest still moves by as much. (mm)
pub(super) const SMALLEST_OFFSET: f64 = 0.005;

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
    let mut simulation = Simulation::new(Arc::clone(rig), scene, None)?;
    let mut posed = |shapes: &[usize]| -> Result<Vec<Vector>, ExportError> {
        let mut pose = FacePose::neutral(rig.shape_names.len());
        for &shape in shapes {
            pose.weights[shape] = 1.0;
        }
        match source {
            ShapeSource::Settled => hold_pose(&mut simulation, &pose)?,
            ShapeSource::Targets => simulation.reset(pose)?,
        }
        let pairs = simulation.skin().iter().zip(simulation.rest_skin());
        Ok(pairs.map(|(now, rest)| (now - rest).cast()).collect())
    };
    let order = shape_order(rig);
    let mut held: HashMap<usize, Vec<Vector>> = HashMap::new();
    let mut shapes = Vec::with_capacity(order.len());
    for (k, (name, index)) in order.iter().enumerate() {
        let mut offsets = Vec::new();
        if let Some(index) = *index {
            let jaw = (k == MOUTH_CLOSE).then(|| order[JAW_OPEN].1).flatten();
            let (now, before) = match jaw {
                Some(jaw) => (posed(&[jaw, index])?, held.get(&jaw)),
                None => (posed(&[index])?, None),
            };
            let moved = now.iter().enumerate().map(|(v, now)| {
                let offset = now - before.map_or(Vector::zeros(), |before| before[v]);
                (v as u32, offset)
            });
            offsets = moved
                .filter(|(_, offset)| offset.norm() >= SMALLEST_OFFSET)
                .map(|(v, offset)| (v, placement.offset(&offset)))
                .collect();
            if k == JAW_OPEN {
                held.insert(index, now);
            }
        }
        shapes.push(Shape {
            name: name.clone(),
            offsets,
        });
        if progress((k + 1) as f64 / order.len() as f64).is_break() {
            return Err(ExportError::Stopped);
        }
    }
    Ok(shapes)
}
