//! A face on its take as a scene for the cloth's benchmarks.

use std::ops::Range;
use std::sync::Arc;

use super::simulation::{Simulation, cloth_patches};
use super::{Scene, SceneError};
use crate::cloth::bench::BenchScene;
use crate::motion::Clip;
use crate::rig::Rig;

/// What the cloth of `rig` is told in the frames of `range` (counted from the take's start, at
/// `fps` a second), under the head's motion, gravity and wind of `scene`.
///
/// # Errors
///
/// [`SceneError`] where the rig does not fit the scene.
pub fn face_bench_scene(
    rig: &Arc<Rig>,
    clip: &Clip,
    scene: &Scene,
    fps: f64,
    range: Range<usize>,
) -> Result<BenchScene, SceneError> {
    let placed = Scene {
        dynamics: super::Dynamics::None,
        ..scene.clone()
    };
    let start = clip.times()[0] + range.start as f64 / fps;
    let dt = 1.0 / fps;
    let mut simulation = Simulation::new(Arc::clone(rig), placed, Some(clip.clone()))?;
    let pose = simulation.pose_at(start);
    simulation.reset(pose)?;
    let mut frames = vec![simulation.cloth_frame(dt)];
    for frame in 1..=range.len() {
        let time = start + frame as f64 * dt;
        let pose = simulation.pose_at(time);
        simulation.pose_to(pose, time)?;
        frames.push(simulation.cloth_frame(dt));
    }
    Ok(BenchScene::new(
        &format!("frames {} to {} of the take", range.start, range.end),
        cloth_patches(rig)?,
        frames,
    ))
}

/// All frames of a take at `fps` a second.
pub fn all_frames(clip: &Clip, fps: f64) -> Range<usize> {
    0..(clip.duration() * fps).floor() as usize
}

/// The `count` frames on end, at `fps` a second, in which the weights change most.
pub fn liveliest_frames(clip: &Clip, fps: f64, count: usize) -> Range<usize> {
    let all = all_frames(clip, fps);
    let start = clip.times()[0];
    let mut previous = clip.sample(start).weights;
    // Sums of change up to each frame.
    let mut sums = vec![0.0_f64];
    for frame in 1..=all.end {
        let weights = clip.sample(start + frame as f64 / fps).weights;
        let change: f32 = weights
            .iter()
            .zip(&previous)
            .map(|(a, b)| (a - b).abs())
            .sum();
        sums.push(sums[frame - 1] + f64::from(change));
        previous = weights;
    }
    let count = count.min(all.end);
    let first = (0..=all.end - count)
        .max_by(|&a, &b| (sums[a + count] - sums[a]).total_cmp(&(sums[b + count] - sums[b])))
        .unwrap_or(0);
    first..first + count
}
