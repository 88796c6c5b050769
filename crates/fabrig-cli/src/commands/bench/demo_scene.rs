//! The bundled face on the bundled take, for benchmarks.

use std::ops::Range;
use std::sync::Arc;

use anyhow::Result;
use fabrig_core::motion::{self, Clip, ReadOptions};
use fabrig_core::pipeline::RigFaceOptions;
use fabrig_core::rig::Rig;
use fabrig_core::template;

use crate::commands::rig;
use crate::console::Console;

/// Frames per second of the simulation.
pub(super) const FPS: f64 = 60.0;

/// The bundled take.
pub(super) fn take() -> Result<Clip> {
    Ok(motion::parse(
        template::demo_take(),
        "the bundled take",
        &ReadOptions::default(),
    )?)
}

/// The rig of the bundled face.
pub(super) fn demo_rig(console: &Console) -> Result<Arc<Rig>> {
    let rigged = rig::rig(console, &template::demo_face(), &RigFaceOptions::default())?;
    Ok(Arc::new(rigged.rig))
}

/// All frames of a take.
pub(super) fn all_frames(clip: &Clip) -> Range<usize> {
    0..(clip.duration() * FPS).floor() as usize
}

/// The `count` frames on end in which the weights change most.
pub(super) fn liveliest(clip: &Clip, count: usize) -> Range<usize> {
    let all = all_frames(clip);
    let start = clip.times()[0];
    let mut previous = clip.sample(start).weights;
    // Sums of change up to each frame.
    let mut sums = vec![0.0_f64];
    for frame in 1..=all.end {
        let weights = clip.sample(start + frame as f64 / FPS).weights;
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
