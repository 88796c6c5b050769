//! The bundled face on the bundled take, for benchmarks.

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
