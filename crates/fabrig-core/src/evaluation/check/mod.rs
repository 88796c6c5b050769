//! Whether a rig does on its face what its shapes say: a report a studio can gate on.
//!
//! Every shape is held at weight 1, as the muscles have it or by the cloth and its contact, and
//! looked at vertex by vertex beside the template's own displacement at the same place:
//!
//! - *seams*: lips and lids that move with the wrong side, edges of the mesh that are torn, lips
//!   and lids that pass through each other (the exact test of [`crate::collision`]);
//! - *sides*: what a shape of one side does to the other;
//! - *triangles*: those that turn over where the template's do not, and how areas change;
//! - *amplitude*: how far, and which way, against the template; dead shapes; single muscles that
//!   run against the template's;
//! - *confidence*: how far the mesh is from the registered template, vertex by vertex.
//!
//! Places on the template are found anew from the rig's geometry, so nothing here repeats what
//! the binding believes, but for the labels of lips and lids; those are put to the test by the
//! edges of the mesh, which know no labels.

mod findings;
mod gates;
mod muscles;
mod places;
mod report;
mod run;
mod seams;

pub use gates::{CheckGates, GATES, Gate};
pub use report::{CheckReport, Finding, MuscleCheck, RegionDistance, ShapeCheck};
pub use run::{CheckError, RigCheck, check_rig};
