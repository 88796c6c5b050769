//! Hard cases that need a whole face; the cloth's own are in [`crate::cloth::bench::stability`].

use std::sync::Arc;

use super::{FacePose, Scene, SceneError, Simulation};
use crate::cloth::bench::CaseResult;
use crate::rig::Rig;

/// Frames per second of the simulation.
const FPS: f64 = 60.0;

/// Runs them all.
///
/// # Errors
///
/// [`SceneError`] where the rig cannot be simulated.
pub fn face_cases(rig: &Arc<Rig>) -> Result<Vec<CaseResult>, SceneError> {
    Ok(vec![all_shapes(rig)?, far_from_the_origin(rig)?])
}

/// Every shape of the face at weight 1, antagonists together, from one frame to the next.
fn all_shapes(rig: &Arc<Rig>) -> Result<CaseResult, SceneError> {
    let mut simulation =
        Simulation::new(Arc::clone(rig), Scene::default().without_economy(), None)?;
    let mut pose = FacePose::neutral(rig.shape_names.len());
    pose.weights.fill(1.0);
    let mut frozen = 0;
    let mut settle = f64::INFINITY;
    for _ in 0..120 {
        let report = simulation.advance_to(pose.clone(), 1.0 / FPS)?;
        frozen += report.step.counters.frozen_patches;
        settle = report.settle_rms;
    }
    let worst = if frozen > 0 { f64::INFINITY } else { settle };
    Ok(CaseResult::new(
        "8 all shapes at 1, antagonists together: the face settles on them",
        worst,
        1.0,
        "mm RMS",
    ))
}

/// The same pose with the head at the origin and a kilometre away.
fn far_from_the_origin(rig: &Arc<Rig>) -> Result<CaseResult, SceneError> {
    let run = |away: f64| -> Result<_, SceneError> {
        let mut simulation =
            Simulation::new(Arc::clone(rig), Scene::default().without_economy(), None)?;
        let mut pose = FacePose::neutral(rig.shape_names.len());
        for (i, weight) in pose.weights.iter_mut().enumerate() {
            *weight = if i % 3 == 0 { 0.5 } else { 0.0 };
        }
        (pose.head.translation.x, pose.head.translation.y) = (away, away);
        for _ in 0..20 {
            simulation.advance_to(pose.clone(), 1.0 / FPS)?;
        }
        Ok(simulation.skin().to_vec())
    };
    let (here, there) = (run(0.0)?, run(1e6)?);
    let worst = here
        .iter()
        .zip(&there)
        .map(|(a, b)| f64::from((a - b).norm()))
        .fold(0.0, f64::max);
    Ok(CaseResult::new(
        "13 a head one kilometre away moves as one at the origin",
        worst,
        1e-3,
        "mm",
    ))
}
