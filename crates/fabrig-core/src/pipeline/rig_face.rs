//! From a mesh to a rig.

use std::ops::ControlFlow;
use std::time::Instant;

use crate::Error;
use crate::mesh::Mesh;
use crate::registration::{Progress, RegistrationOptions, RegistrationReport, StageTime, register};
use crate::rig::{FaceOnTemplate, Rig, RigOptions, build};
use crate::template::Template;

/// How a face is rigged.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RigFaceOptions {
    /// How it is registered to the template.
    pub registration: RegistrationOptions,
    /// How the rig is built on it.
    pub rig: RigOptions,
}

/// A face with its rig.
#[derive(Debug, Clone)]
pub struct RiggedFace {
    /// The rig.
    pub rig: Rig,
    /// The face in the template's topology, in the head frame. [mm]
    pub normalized: Mesh,
    /// What registration measured; the time of building the rig is its last stage.
    pub report: RegistrationReport,
}

/// Share of the work that registration is.
const REGISTRATION_SHARE: f64 = 0.7;

/// Registers `face` to `template` and builds its rig.
///
/// - `progress`: called between steps; `ControlFlow::Break` cancels
///
/// # Errors
///
/// [`Error::Registration`] and [`Error::Rig`].
pub fn rig_face(
    face: &Mesh,
    template: &Template,
    options: &RigFaceOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<RiggedFace, Error> {
    let registration = register(face, template, &options.registration, &mut |step| {
        progress(Progress {
            fraction: REGISTRATION_SHARE * step.fraction,
            ..step
        })
    })?;
    let is_cancelled = progress(Progress {
        stage: "build",
        fraction: REGISTRATION_SHARE,
    });
    if is_cancelled.is_break() {
        return Err(crate::registration::RegistrationError::Cancelled { stage: "build" }.into());
    }
    let clock = Instant::now();
    let normalized = template
        .skin
        .with_positions(registration.positions.clone())?;
    let on_template = FaceOnTemplate::from_registration(face, &registration)?;
    let rig = build(&on_template, template, &options.rig)?;
    let mut report = registration.report;
    report.times.push(StageTime {
        stage: "build".to_owned(),
        seconds: clock.elapsed().as_secs_f64(),
    });
    Ok(RiggedFace {
        rig,
        normalized,
        report,
    })
}
