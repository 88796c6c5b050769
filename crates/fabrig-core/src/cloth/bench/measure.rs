//! Timed runs and differences between them.

use std::time::Instant;

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::scene::BenchScene;
use crate::cloth::{Cloth, ClothError, ClothOptions, Counters};

/// A run of a scene.
#[derive(Debug, Clone)]
pub struct Run {
    /// Wall time of [`Cloth::step`] for each frame, warm-up left out. (ms)
    pub frame_ms: Vec<f64>,
    /// Positions of all nodes of all patches, for every kept frame. (mm)
    pub frames: Vec<Vec<Point3<f64>>>,
    /// Guards that acted.
    pub counters: Counters,
    /// Largest energy at the end of a frame. [mass mm^2/s^2]
    pub peak_energy: f64,
}

impl Run {
    /// The time that a share of the frames does not exceed, 0.5 for the median. (ms)
    pub fn quantile_ms(&self, share: f64) -> f64 {
        let mut sorted = self.frame_ms.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        sorted
            .get((last as f64 * share).round() as usize)
            .copied()
            .unwrap_or(f64::NAN)
    }
}

/// Runs the first `frames` frames of a scene. Every `keep`-th frame's positions are kept
/// (0: none).
///
/// # Errors
///
/// As [`Cloth::new`] and [`Cloth::step`].
pub fn run(
    scene: &BenchScene,
    options: &ClothOptions,
    frames: usize,
    keep: usize,
) -> Result<Run, ClothError> {
    let mut cloth = Cloth::new(&scene.patches, options)?;
    scene.place(&mut cloth)?;
    let mut out = Run {
        frame_ms: Vec::new(),
        frames: Vec::new(),
        counters: Counters::default(),
        peak_energy: 0.0,
    };
    for (index, frame) in scene.frames.iter().take(frames).enumerate() {
        let start = Instant::now();
        let report = cloth.step(&frame.input())?;
        out.frame_ms.push(start.elapsed().as_secs_f64() * 1e3);
        out.counters += report.counters;
        out.peak_energy = out.peak_energy.max(report.energies.total());
        if keep > 0 && (index + 1) % keep == 0 {
            let mut all = Vec::with_capacity(scene.node_count());
            for (index, patch) in scene.patches.iter().enumerate() {
                all.extend((0..patch.rest.len()).map(|node| cloth.node_state(index, node).0));
            }
            out.frames.push(all);
        }
    }
    // The first frames warm caches.
    let warm_up = (out.frame_ms.len() / 2).min(5);
    out.frame_ms.drain(..warm_up);
    Ok(out)
}

/// How far a run is from a reference.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Largest RMS over frames. (mm)
    pub rms: f64,
    /// Largest difference of any node in any frame. (mm)
    pub max: f64,
    /// `rms` over the reference's largest RMS displacement from rest.
    pub relative: f64,
}

/// Difference of two runs that kept the same frames.
pub fn difference(scene: &BenchScene, run: &Run, reference: &Run) -> Difference {
    let rest: Vec<Point3<f64>> = scene
        .patches
        .iter()
        .flat_map(|p| p.rest.iter().map(|x| x.map(f64::from)))
        .collect();
    let rms = |a: &[Point3<f64>], b: &[Point3<f64>]| {
        let sum: f64 = a.iter().zip(b).map(|(p, q)| (p - q).norm_squared()).sum();
        (sum / a.len() as f64).sqrt()
    };
    let mut out = Difference::default();
    let mut motion = 0.0_f64;
    for (a, b) in run.frames.iter().zip(&reference.frames) {
        out.rms = out.rms.max(rms(a, b));
        motion = motion.max(rms(b, &rest));
        for (p, q) in a.iter().zip(b) {
            out.max = out.max.max((p - q).norm());
        }
    }
    out.relative = out.rms / motion;
    out
}

/// The scene with every third node of the neutral shapes moved by a micrometre.
pub fn nudged(scene: &BenchScene) -> BenchScene {
    let mut scene = scene.clone();
    for patch in &mut scene.patches {
        for p in patch.rest.iter_mut().step_by(3) {
            p.z += 1e-3;
        }
    }
    scene
}
