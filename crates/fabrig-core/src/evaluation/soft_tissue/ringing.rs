//! How pads ring when the head starts to move and stops.
//!
//! The head is accelerated evenly until the face hangs still against it, and is then let go: the
//! pads swing back and ring. Rayleigh's quotient of the shape they hung in,
//! `w^2 = sum m a . u / sum m u . u`, says how fast from nothing but how far they hung: the work
//! of the load is that of the springs. Their damping is that of the materials weighed by how much
//! each patch swings, `c = sum m c u^2 / sum m u^2`: an upper bound, as muscles are damped more
//! and their part of the swing dies first, and without what stretching edges add.
//!
//! # Limitations
//!
//! One frequency stands for a pad and all that it is stitched to. Pads that swing apart from their
//! muscles ring up to half as fast again.

use std::sync::Arc;

use nalgebra::Vector3;
use serde::Serialize;

use super::SoftTissueError;
use super::oscillator::{Oscillation, oscillation};
use super::volume::Pad;
use crate::rig::Rig;
use crate::scene::{FacePose, Scene, Simulation, cloth_patches};

/// Frames that the load is held, and that the ring is followed.
const HELD_FRAMES: u32 = 240;
const RUNG_FRAMES: u32 = 240;
/// (s)
const STEP: f64 = 1.0 / 240.0;

/// How one pad rang.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PadRing {
    /// The pad.
    pub patch: String,
    /// How far it hung in the mean. (mm)
    pub lag: f64,
    /// What was measured; none where it did not swing.
    pub measured: Option<Oscillation>,
    /// What how far it hung and the materials say of the pad and what it is stitched to.
    pub predicted: Oscillation,
    /// What its own material says of it, stitched to nothing.
    pub alone: Oscillation,
}

/// Accelerates the head, lets it go, and measures every pad.
///
/// - `acceleration`: of the head, in its own axes (mm/s^2)
///
/// # Errors
///
/// [`SoftTissueError`] where the rig has no fat, or cannot be simulated.
pub fn pad_rings(
    rig: &Arc<Rig>,
    scene: &Scene,
    acceleration: Vector3<f32>,
) -> Result<Vec<PadRing>, SoftTissueError> {
    let pads = Pad::all(rig);
    if pads.is_empty() {
        return Err(SoftTissueError::NoPads);
    }
    let materials: Vec<_> = cloth_patches(rig)?
        .into_iter()
        .map(|p| p.material)
        .collect();
    let still = FacePose::neutral(rig.shape_names.len());
    let mut pushed = still.clone();
    pushed.head_motion.linear_acceleration = acceleration;
    let mut simulation = Simulation::new(Arc::clone(rig), scene.clone(), None)?;
    for _ in 0..HELD_FRAMES {
        simulation.advance_to(pushed.clone(), STEP)?;
    }
    let load = -acceleration.cast::<f64>();
    // Of each patch: sums of m a.u, m u.u and m c u.u.
    let sums: Vec<[f64; 3]> = (0..rig.patches.len())
        .map(|patch| {
            let material = &materials[patch];
            let nodes = simulation.patch_positions(patch);
            let mut sums = [0.0; 3];
            for (x, target) in nodes.iter().zip(simulation.patch_targets(patch)) {
                let u: Vector3<f64> = (x - target).cast();
                let squared = material.mass * u.norm_squared();
                sums[0] += material.mass * load.dot(&u);
                sums[1] += squared;
                sums[2] += (material.damping + material.magnet_damping()) * squared;
            }
            sums
        })
        .collect();
    let direction = load.normalize();
    let mean = |simulation: &Simulation, patch: usize| -> f64 {
        let nodes = simulation.patch_positions(patch);
        let pairs = nodes.iter().zip(simulation.patch_targets(patch));
        let sum: f64 = pairs
            .map(|(x, t)| (x - t).cast::<f64>().dot(&direction))
            .sum();
        sum / nodes.len().max(1) as f64
    };
    let lags: Vec<f64> = pads.iter().map(|p| mean(&simulation, p.patch)).collect();
    let mut rings: Vec<Vec<f64>> = lags.iter().map(|&lag| vec![lag]).collect();
    for _ in 0..RUNG_FRAMES {
        simulation.advance_to(still.clone(), STEP)?;
        for (ring, pad) in rings.iter_mut().zip(&pads) {
            ring.push(mean(&simulation, pad.patch));
        }
    }
    Ok(pads
        .iter()
        .zip(rings)
        .zip(lags)
        .map(|((pad, ring), lag)| {
            let mut total = [0.0; 3];
            for patch in pad.swinging_with(rig) {
                for (total, part) in total.iter_mut().zip(sums[patch]) {
                    *total += part;
                }
            }
            let [work, squared, damped] = total;
            let material = &materials[pad.patch];
            let own_rate = (material.magnet_stiffness() / material.mass).sqrt();
            PadRing {
                patch: rig.patches[pad.patch].patch.chart.name.clone(),
                lag,
                measured: oscillation(&ring, STEP),
                predicted: Oscillation::of_spring((work / squared).sqrt(), damped / squared),
                alone: Oscillation::of_spring(
                    own_rate,
                    material.damping + material.magnet_damping(),
                ),
            }
        })
        .collect())
}
