//! Registration of a scan of an expression: a mesh of its own, of a face that is registered
//! already, in the units of its neutral.
//!
//! What the expression should look like on this face is known roughly: its neutral plus the
//! shapes that the scan is named by, as transferred. So
//!
//! 1. place and amplitude: the scan is brought to the head frame by the neutral's similarity, or
//!    found like any face where it stands elsewhere; then a rigid motion M and an amplitude a
//!    minimize `sum w (n . (q - M (p + a d)))^2` over the face, with p the neutral, d the shape
//!    and q, n the closest place of the scan and its normal (point-to-plane ICP);
//! 2. from `p + a d` on, the deformation of a neutral face: coarse, then refined, lips and lids
//!    pinned where they part.
//!
//! As for a neutral face, what cannot be seen in distances (skin that slides along itself) is
//! taken from what one starts from: here the shape.
//!
//! # Source
//!
//! Chen & Medioni 1992, *Object modelling by registration of multiple range images*, for the
//! distance; the deformation is that of [`super::register`].

use std::ops::ControlFlow;

use nalgebra::{Isometry3, SMatrix, SVector, Similarity3, Translation3, UnitQuaternion};
use rayon::prelude::*;

use super::clean::{CleanMesh, clean, closed_volume};
use super::face_model::{FaceModel, Role};
use super::node_graph::NodeGraph;
use super::nonrigid_icp::deform_coarse;
use super::refinement::refine;
use super::register::{Seams, target_of};
use super::report::DistanceStatistics;
use super::settling::{settle_hidden, unfold};
use super::target::{Target, geman_mcclure};
use super::{Progress, Registration, RegistrationError, RegistrationOptions, register};
use crate::mesh::{Mesh, vertex_normals};
use crate::template::Template;
use crate::{Point, Vector};

/// Rounds of place and amplitude, and the distances that count for half. (mm)
///
/// The first [`RIGID_ROUNDS`] leave the amplitude alone: far from its place a scan says nothing of
/// it.
const ROUNDS: [f64; 24] = [
    12.0, 12.0, 10.0, 10.0, 8.0, 8.0, 7.0, 6.0, 5.0, 5.0, 4.0, 4.0, 3.0, 3.0, 3.0, 2.5, 2.5, 2.0,
    2.0, 2.0, 1.5, 1.5, 1.5, 1.5,
];
const RIGID_ROUNDS: usize = 14;
/// A scan further off than this in the median, once placed and at its amplitude, stands elsewhere.
/// (mm)
const ELSEWHERE_MM: f64 = 0.8;
/// Further off than this it is of another face. (mm)
const OTHER_FACE_MM: f64 = 1.5;
/// And so it is where a tenth of the face is further off than this: another face can be laid so
/// that half of it fits. (mm)
const OTHER_FACE_FAR_MM: f64 = 6.0;
/// A scan further off than this in the median once it is deformed to is another face. (mm)
const MOST_RESIDUAL_MM: f64 = 1.0;
/// A registered place this far from the scan is none that it shows. (mm)
const SEEN_MM: f64 = 2.0;
/// Amplitudes of a shape that a scan may show.
const AMPLITUDES: [f64; 2] = [0.2, 2.0];
/// Largest angle between the normals of a place and its match, as a cosine.
const COS_LIMIT: f64 = 0.6;
/// Pulls the amplitude to one, as much as this share of the shape's own evidence.
const PRIOR: f64 = 0.02;

/// A scan of an expression, in the template's topology.
#[derive(Debug, Clone, PartialEq)]
pub struct RegisteredExpression {
    /// The template's vertices on the scan. [mm, head frame of the neutral]
    pub positions: Vec<Point>,
    /// Whether the scan shows a vertex.
    pub is_seen: Vec<bool>,
    /// How far the shape was taken for the start: 1 as transferred.
    pub amplitude: f64,
    /// Distance of the face from the scan. (mm)
    pub distance: DistanceStatistics,
}

/// Registers a scan of an expression of a registered face.
///
/// - `neutral`: the face at rest
/// - `expected`: the template's vertices in the expression as it is expected on this face
///   [mm, head frame]
/// - `scan`: in the units of the neutral's mesh
/// - `progress`: called between steps; `ControlFlow::Break` cancels
///
/// # Errors
///
/// [`RegistrationError`]: another face than the neutral's, or none; a cancelled run.
pub fn register_expression(
    neutral: &Registration,
    expected: &[Point],
    scan: &Mesh,
    template: &Template,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<RegisteredExpression, RegistrationError> {
    let mut step = |fraction: f64| {
        let at = Progress {
            stage: "expression",
            fraction,
        };
        match progress(at) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(RegistrationError::Cancelled { stage: at.stage }),
        }
    };
    step(0.0)?;
    let model = FaceModel::new(template)?;
    let mut cleaned = clean(scan);
    for piece in &mut cleaned.pieces {
        if closed_volume(&cleaned.positions, &piece.triangles) < 0.0 {
            for t in &mut piece.triangles {
                t.swap(1, 2);
            }
        }
    }
    let start = Start::new(&model, &neutral.positions, expected);
    let mut placed = start.place(&cleaned, &neutral.to_head)?;
    if placed.residual() > ELSEWHERE_MM {
        // It stands elsewhere: found as any face is, at the size that is known.
        let found = register(scan, template, &RegistrationOptions::default(), &mut |at| {
            step(0.4 * at.fraction).map_or(ControlFlow::Break(()), ControlFlow::Continue)
        });
        match found {
            Ok(found) => {
                let again = start.place(&cleaned, &resized(&found, neutral))?;
                if again.residual() < placed.residual() {
                    placed = again;
                }
            }
            Err(error @ RegistrationError::Cancelled { .. }) => return Err(error),
            // What it was, as far as it was found.
            Err(error) if placed.0.is_none() => return Err(error),
            Err(_) => {}
        }
    }
    let residual = placed.residual();
    let is_face = |p: &Placed| residual <= OTHER_FACE_MM && p.far <= OTHER_FACE_FAR_MM;
    let Some(placed) = placed.0.filter(is_face) else {
        return Err(RegistrationError::OtherFace {
            distance_mm: residual,
        });
    };
    step(0.4)?;
    let target = &placed.target;
    let graph = NodeGraph::new(model.positions(), &model.topology, 1);
    let mut seams = Vec::new();
    let coarse = deform_coarse(
        &model,
        &graph,
        target,
        &placed.positions,
        &mut |vertices, is_first_of_stage| {
            if is_first_of_stage {
                seams = Seams::find(&model, target, vertices)?.pins(&model);
            }
            Ok(seams.clone())
        },
        |share| step(0.4 + 0.25 * share),
    )?;
    let pins = Seams::find(&model, target, &coarse)?.pins(&model);
    let mut refined = refine(&model, target, &coarse, &pins, |share| {
        step(0.65 + 0.3 * share)
    })?;
    unfold(&model, &mut refined)?;
    settle_hidden(&model, &mut refined)?;
    unfold(&model, &mut refined)?;
    let distances: Vec<f64> = refined
        .par_iter()
        .map(|p| target.surface.closest(p).distance)
        .collect();
    let of_face = model.face_vertices().map(|v| distances[v as usize]);
    let distance = DistanceStatistics::from_distances(of_face.collect());
    if distance.median > MOST_RESIDUAL_MM {
        return Err(RegistrationError::OtherFace {
            distance_mm: distance.median,
        });
    }
    let roles = model.roles.iter().zip(&distances);
    let is_seen = roles.map(|(role, d)| *role == Role::Face && *d < SEEN_MM);
    step(1.0)?;
    Ok(RegisteredExpression {
        is_seen: is_seen.collect(),
        positions: refined,
        amplitude: placed.amplitude,
        distance,
    })
}

/// Where a face that was found by itself stands, at the size of its neutral.
fn resized(found: &Registration, neutral: &Registration) -> Similarity3<f64> {
    let scale = neutral.to_head.scaling();
    let grown = scale / found.to_head.scaling();
    let isometry = found.to_head.isometry;
    Similarity3::from_parts(
        Translation3::from(isometry.translation.vector * grown),
        isometry.rotation,
        scale,
    )
}

/// The face as it should be, to be placed on a scan.
struct Start<'a> {
    model: &'a FaceModel<'a>,
    neutral: &'a [Point],
    shape: Vec<Vector>,
    /// Vertices of the face.
    vertices: Vec<u32>,
}

/// A scan in the head frame, and the face brought to the amplitude that it shows.
struct Placed {
    target: Target,
    positions: Vec<Point>,
    amplitude: f64,
    /// Median distance. (mm)
    residual: f64,
    /// Distance that a tenth of the face exceeds. (mm)
    far: f64,
}

/// A scan that may not have been found.
struct MaybePlaced(Option<Placed>);

impl MaybePlaced {
    /// Median distance (mm), infinite where it was not found.
    fn residual(&self) -> f64 {
        self.0.as_ref().map_or(f64::INFINITY, |p| p.residual)
    }
}

/// Rigid motion of the face onto the scan, and amplitude of the shape.
#[derive(Debug, Clone, Copy)]
struct Pose {
    motion: Isometry3<f64>,
    amplitude: f64,
}

impl<'a> Start<'a> {
    fn new(model: &'a FaceModel<'a>, neutral: &'a [Point], expected: &[Point]) -> Self {
        Self {
            model,
            neutral,
            shape: expected.iter().zip(neutral).map(|(p, q)| p - q).collect(),
            vertices: model.face_vertices().collect(),
        }
    }

    /// The face at an amplitude.
    fn at(&self, amplitude: f64) -> Vec<Point> {
        let shape = self.neutral.iter().zip(&self.shape);
        shape.map(|(p, d)| p + d * amplitude).collect()
    }

    /// Brings the piece of a scan that fits best to the head frame.
    fn place(
        &self,
        scan: &CleanMesh,
        to_head: &Similarity3<f64>,
    ) -> Result<MaybePlaced, RegistrationError> {
        let mut best: Option<([f64; 2], usize, Pose)> = None;
        for piece in 0..scan.pieces.len().min(3) {
            if scan.pieces[piece].area < 0.2 * scan.pieces[0].area {
                break;
            }
            let target = target_of(scan, piece, to_head)?;
            let pose = self.settle(&target);
            let distances = self.distances(&target, &pose);
            if best.as_ref().is_none_or(|b| distances[0] < b.0[0]) {
                best = Some((distances, piece, pose));
            }
        }
        let Some(([residual, far], piece, pose)) = best.filter(|b| b.0[0].is_finite()) else {
            return Ok(MaybePlaced(None));
        };
        let to_head = pose.motion.inverse() * to_head;
        Ok(MaybePlaced(Some(Placed {
            target: target_of(scan, piece, &to_head)?,
            positions: self.at(pose.amplitude),
            amplitude: pose.amplitude,
            residual,
            far,
        })))
    }

    /// Rigid motion and amplitude by point-to-plane ICP.
    fn settle(&self, target: &Target) -> Pose {
        let mut pose = Pose {
            motion: Isometry3::identity(),
            amplitude: 1.0,
        };
        for (round, sigma) in ROUNDS.into_iter().enumerate() {
            let positions = self.at(pose.amplitude);
            let normals = vertex_normals(&positions, &self.model.triangles);
            let rows: Vec<Option<Row>> = self
                .vertices
                .par_iter()
                .map(|&v| self.row(target, &pose, (&positions, &normals), v, sigma))
                .collect();
            let mut matrix = SMatrix::<f64, 7, 7>::zeros();
            let mut rhs = SVector::<f64, 7>::zeros();
            // In the order of vertices, whatever the threads.
            for row in rows.into_iter().flatten() {
                matrix += row.gradient * row.gradient.transpose() * row.weight;
                rhs += row.gradient * (row.weight * row.distance);
            }
            let evidence = matrix[(6, 6)];
            let is_rigid = round < RIGID_ROUNDS;
            let pull = if is_rigid { 1e9 } else { PRIOR } * evidence + 1e-9;
            matrix[(6, 6)] += pull;
            rhs[6] += pull * (1.0 - pose.amplitude);
            for k in 0..6 {
                matrix[(k, k)] += 1e-9;
            }
            let Some(change) = matrix.cholesky().map(|c| c.solve(&rhs)) else {
                break;
            };
            let turn = UnitQuaternion::from_scaled_axis(change.fixed_rows::<3>(0).into_owned());
            let shift = Translation3::from(change.fixed_rows::<3>(3).into_owned());
            pose.motion = Isometry3::from_parts(shift, turn) * pose.motion;
            pose.amplitude = (pose.amplitude + change[6]).clamp(AMPLITUDES[0], AMPLITUDES[1]);
        }
        pose
    }

    fn row(
        &self,
        target: &Target,
        pose: &Pose,
        (positions, normals): (&[Point], &[Vector]),
        vertex: u32,
        sigma: f64,
    ) -> Option<Row> {
        let v = vertex as usize;
        let place = pose.motion * positions[v];
        let normal = pose.motion * normals[v];
        let found = target.matching(&place, &normal, 3.0 * sigma, COS_LIMIT)?;
        if found.is_on_boundary {
            return None;
        }
        let q = target
            .surface
            .point_at(found.place.triangle, found.place.barycentric);
        let n = target.surface.blend(&found.place, &target.normals);
        let n = n.try_normalize(1e-12)?;
        let distance = n.dot(&(q - place));
        let turning = place.coords.cross(&n);
        let growing = n.dot(&(pose.motion * self.shape[v]));
        Some(Row {
            gradient: SVector::from([turning.x, turning.y, turning.z, n.x, n.y, n.z, growing]),
            distance,
            weight: geman_mcclure(distance.abs(), sigma),
        })
    }

    /// Distances of the face from the scan: the median, and what a tenth exceeds. (mm)
    fn distances(&self, target: &Target, pose: &Pose) -> [f64; 2] {
        let positions = self.at(pose.amplitude);
        let mut distances: Vec<f64> = self
            .vertices
            .par_iter()
            .map(|&v| {
                target
                    .surface
                    .closest(&(pose.motion * positions[v as usize]))
                    .distance
            })
            .collect();
        distances.sort_by(f64::total_cmp);
        let at = |tenths: usize| distances.get(distances.len() * tenths / 10);
        [5, 9].map(|tenths| at(tenths).copied().unwrap_or(f64::INFINITY))
    }
}

/// What one vertex says of place and amplitude: turns about x, y, z, shifts, amplitude.
struct Row {
    gradient: SVector<f64, 7>,
    distance: f64,
    weight: f64,
}
