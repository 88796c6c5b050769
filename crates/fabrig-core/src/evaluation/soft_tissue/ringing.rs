//! How pads ring when the head starts to move and stops.
//!
//! The head is accelerated evenly until the face hangs still against it, and is then let go: the
//! pads swing back and ring. Beside it stands what the materials say: the network of oscillators
//! that the patches are for small motion ([`LinearCloth`]), with every magnet, stitch, anchor,
//! edge, bend and volume, let go from where it hangs. Both rings are measured the same way. On a
//! face a pad rings with the muscles that it is stitched to and not at its own frequency, which
//! is given too: that of a lone node of its material.
//!
//! # Limitations
//!
//! The network is linear: what swings by a tenth of its size rings a few per cent otherwise.

use std::sync::Arc;

use nalgebra::Vector3;
use serde::Serialize;

use super::SoftTissueError;
use super::oscillator::{Oscillation, oscillation};
use super::volume::Pad;
use crate::cloth::LinearCloth;
use crate::rig::Rig;
use crate::scene::{FacePose, Scene, Simulation, cloth_patches};

/// Frames that the load is held, and that the ring is followed.
const HELD_FRAMES: u32 = 180;
const RUNG_FRAMES: u32 = 96;
/// (s)
const STEP: f64 = 1.0 / 240.0;

/// How one pad rang.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PadRing {
    /// The pad.
    pub patch: String,
    /// How far it hung in the mean, along the load. (mm)
    pub lag: f64,
    /// The same of the network. (mm)
    pub predicted_lag: f64,
    /// What was measured; none where it did not swing.
    pub measured: Option<Oscillation>,
    /// What the network did; none where it did not swing.
    pub predicted: Option<Oscillation>,
    /// What its own material says of it, stitched to nothing.
    pub alone: Oscillation,
}

impl PadRing {
    /// Measured frequency and damping against those predicted, where both swung.
    pub fn ratios(&self) -> Option<[f64; 2]> {
        let (rang, said) = (self.measured?, self.predicted?);
        Some([
            rang.frequency / said.frequency,
            rang.damping_ratio / said.damping_ratio,
        ])
    }
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
    let measured = measured_rings(rig, scene, &pads, acceleration)?;
    let patches = cloth_patches(rig)?;
    let network = LinearCloth::new(&patches).map_err(crate::scene::SceneError::from)?;
    let load = -acceleration.cast::<f64>();
    let hung = network.hang(load).ok_or(SoftTissueError::Loose)?;
    let direction = load.normalize();
    let mean = |nodes: &[Vector3<f64>]| -> f64 {
        nodes.iter().map(|u| u.dot(&direction)).sum::<f64>() / nodes.len().max(1) as f64
    };
    let start = pads.iter().map(|pad| vec![mean(&hung[pad.patch])]);
    let mut predicted: Vec<Vec<f64>> = start.collect();
    network.release(&hung, STEP, RUNG_FRAMES, |x| {
        for (ring, pad) in predicted.iter_mut().zip(&pads) {
            ring.push(mean(&x[pad.patch]));
        }
    });
    let rings = measured.iter().zip(&predicted);
    Ok(pads
        .iter()
        .zip(rings)
        .map(|(pad, (measured, predicted))| {
            let material = &patches[pad.patch].material;
            let rate = (material.magnet_stiffness() / material.mass).sqrt();
            PadRing {
                patch: rig.patches[pad.patch].patch.chart.name.clone(),
                lag: measured[0],
                predicted_lag: predicted[0],
                measured: oscillation(measured, STEP),
                predicted: oscillation(predicted, STEP),
                alone: Oscillation::of_spring(rate, material.damping + material.magnet_damping()),
            }
        })
        .collect())
}

/// Mean displacement of every pad along the load, from when the head is let go. (mm)
fn measured_rings(
    rig: &Arc<Rig>,
    scene: &Scene,
    pads: &[Pad],
    acceleration: Vector3<f32>,
) -> Result<Vec<Vec<f64>>, SoftTissueError> {
    let still = FacePose::neutral(rig.shape_names.len());
    let mut pushed = still.clone();
    pushed.head_motion.linear_acceleration = acceleration;
    let mut simulation = Simulation::new(Arc::clone(rig), scene.clone().without_economy(), None)?;
    for _ in 0..HELD_FRAMES {
        simulation.advance_to(pushed.clone(), STEP)?;
    }
    let direction = -acceleration.cast::<f64>().normalize();
    let mean = |simulation: &Simulation, pad: &Pad| -> f64 {
        let nodes = simulation.patch_positions(pad.patch);
        let pairs = nodes.iter().zip(simulation.patch_targets(pad.patch));
        let sum: f64 = pairs
            .map(|(x, t)| (x - t).cast::<f64>().dot(&direction))
            .sum();
        sum / nodes.len().max(1) as f64
    };
    let start = pads.iter().map(|pad| vec![mean(&simulation, pad)]);
    let mut rings: Vec<Vec<f64>> = start.collect();
    for _ in 0..RUNG_FRAMES {
        simulation.advance_to(still.clone(), STEP)?;
        for (ring, pad) in rings.iter_mut().zip(pads) {
            ring.push(mean(&simulation, pad));
        }
    }
    Ok(rings)
}
