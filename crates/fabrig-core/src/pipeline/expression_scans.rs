//! Scans of expressions, each with a mesh of its own, as examples for a rig.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::Similarity3;
use serde::{Deserialize, Serialize};

use crate::mesh::Mesh;
use crate::registration::{
    DistanceStatistics, Progress, Registration, RegistrationError, register_expression,
};
use crate::rig::{FaceOnTemplate, Rig, RigOptions, build, places_of_self};
use crate::scene::{FacePose, Scene, Simulation};
use crate::template::Template;
use crate::transfer::Example;
use crate::{Error, Point};

/// A scan of a face in an expression, on a mesh of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpressionScan {
    /// Name, for reports.
    pub name: String,
    /// Weights of the template's shapes that make the expression.
    pub weights: Vec<f32>,
    /// The scan, in the units of the neutral mesh; it may stand elsewhere.
    pub mesh: Mesh,
    /// The file that it is from.
    pub path: PathBuf,
}

/// What came of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScanReport {
    /// Name of the expression.
    pub name: String,
    /// The file that it is from.
    pub path: PathBuf,
    /// The amplitude that the scan shows, 1 being the template's on a face of this size; none
    /// where it is not used.
    pub amplitude: Option<f64>,
    /// Distance of the registered expression from the scan (mm), where it is used.
    pub distance: Option<DistanceStatistics>,
    /// Why it is not used.
    pub problem: Option<String>,
}

/// A displacement that neither the shape expects nor the scan clearly shows is noise. (mm)
const EXPECTED: f64 = 0.05;
const SHOWN: f64 = 0.4;

/// Registers scans and gives what can be used of them as examples.
///
/// # Errors
///
/// [`Error::Registration`] where it is cancelled, [`Error::Rig`], [`Error::Scene`]; a scan that
/// cannot be used is told in its report.
pub(super) fn examples_of_scans(
    scans: &[ExpressionScan],
    registration: &Registration,
    template: &Template,
    options: &RigOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(Vec<Example>, Vec<ScanReport>), Error> {
    if scans.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    let mut expectation = Expectation::new(registration, template, options)?;
    let (mut examples, mut reports) = (Vec::new(), Vec::new());
    for (index, scan) in scans.iter().enumerate() {
        let expected = expectation.of(&scan.weights)?;
        let found =
            register_expression(registration, &expected, &scan.mesh, template, &mut |step| {
                progress(Progress {
                    stage: step.stage,
                    fraction: (index as f64 + step.fraction) / scans.len() as f64,
                })
            });
        let mut report = ScanReport {
            name: scan.name.clone(),
            path: scan.path.clone(),
            amplitude: None,
            distance: None,
            problem: None,
        };
        match found {
            Ok(found) => {
                let neutral = &registration.positions;
                let shown = found.positions.iter().zip(neutral).zip(&expected);
                let is_seen = shown.zip(&found.is_seen).map(|(((p, q), e), is_seen)| {
                    *is_seen && ((e - q).norm() > EXPECTED || (p - q).norm() > SHOWN)
                });
                let moved = found.positions.iter().zip(neutral);
                examples.push(Example {
                    name: scan.name.clone(),
                    weights: scan.weights.clone(),
                    is_seen: is_seen.collect(),
                    deltas: moved.map(|(p, q)| p - q).collect(),
                });
                report.amplitude = Some(found.amplitude);
                report.distance = Some(found.distance);
            }
            Err(error @ RegistrationError::Cancelled { .. }) => return Err(error.into()),
            Err(error) => report.problem = Some(error.to_string()),
        }
        reports.push(report);
    }
    Ok((examples, reports))
}

/// What expressions are expected to look like: those of a rig of the registered face in the
/// template's topology, amplitudes by size.
struct Expectation {
    rig: Arc<Rig>,
    simulation: Simulation,
}

impl Expectation {
    fn new(
        registration: &Registration,
        template: &Template,
        options: &RigOptions,
    ) -> Result<Self, Error> {
        let places = places_of_self(template);
        let face = template
            .skin
            .with_positions(registration.positions.clone())?;
        let on_template = FaceOnTemplate {
            face: &face,
            to_head: Similarity3::identity(),
            positions: &registration.positions,
            places: &places,
            rigid: &[],
            examples: &[],
            report: String::new(),
        };
        let rig = Arc::new(build(&on_template, template, options)?);
        let simulation = Simulation::new(Arc::clone(&rig), Scene::without_dynamics(), None)?;
        Ok(Self { rig, simulation })
    }

    /// The template's vertices at these weights. [mm, head frame]
    fn of(&mut self, weights: &[f32]) -> Result<Vec<Point>, Error> {
        let mut pose = FacePose::neutral(self.rig.shape_names.len());
        pose.weights.copy_from_slice(weights);
        self.simulation.reset(pose)?;
        Ok(self.simulation.skin().iter().map(|p| p.cast()).collect())
    }
}
