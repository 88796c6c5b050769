//! Errors of poses, for every method.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Similarity3;
use serde::Serialize;

use super::delta_transfer::DeltaTransfer;
use super::faces::OwnFace;
use super::methods::{Drive, Method, POSES, Pose};
use crate::registration::{Registration, RegistrationError, RegistrationOptions, register};
use crate::retarget::{
    Controls, FitFrame, FitOptions, ResponseModel, RetargetError, fit_clip, mesh_sites,
};
use crate::rig::{FaceOnTemplate, Rig, RigError, RigOptions, build, carry_expressions};
use crate::scene::{FacePose, Scene, SceneError, Simulation};
use crate::template::Template;
use crate::transfer::{AlphaMode, Example};
use crate::{Point, Vector};

/// Distances of a posed mesh from the face's own, over the vertices that the pose moves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseError {
    /// Name of the method.
    pub method: &'static str,
    /// Name of the pose.
    pub pose: &'static str,
    /// Where the weights come from.
    pub drive: Drive,
    /// Vertices.
    pub count: usize,
    /// Mean motion of the face's own pose. (mm)
    pub motion: f64,
    /// (mm)
    pub mean: f64,
    /// Standard deviation. (mm)
    pub deviation: f64,
    /// (mm)
    pub max: f64,
    /// How far the motion falls short of the face's own, along it, in the mean; negative where it
    /// goes too far. (mm)
    pub short: f64,
    /// How far it goes beside the face's own, in the mean. (mm)
    pub beside: f64,
    /// Mean distances by region of the template, in its order.
    pub regions: Vec<RegionError>,
    /// Distance of every vertex, not a number for those that the pose leaves still; empty for a
    /// best fit. (mm)
    #[serde(skip)]
    pub distances: Vec<f32>,
}

/// Distances in one region.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegionError {
    /// Name of the region.
    pub region: String,
    /// Vertices.
    pub count: usize,
    /// Mean distance. (mm)
    pub mean: f64,
}

/// A face's errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FaceResult {
    /// Name of the face.
    pub face: String,
    /// Whether it was made rather than captured or sculpted.
    pub is_synthetic: bool,
    /// Vertices of its mesh.
    pub vertex_count: usize,
    /// Median distance of the registered template. (mm)
    pub registration_median: f64,
    /// Every pose by every method.
    pub errors: Vec<PoseError>,
    /// From the units of its mesh to the head frame.
    #[serde(skip)]
    pub to_head: Similarity3<f64>,
}

/// The table.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Table3 {
    /// Faces that were rigged.
    pub faces: Vec<FaceResult>,
    /// Faces that were refused, and why.
    pub refused: Vec<(String, String)>,
}

/// What can go wrong with a face.
#[derive(Debug, thiserror::Error)]
pub enum Table3Error {
    /// It could not be registered.
    #[error(transparent)]
    Registration(#[from] RegistrationError),
    /// It could not be rigged.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// It could not be posed.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Weights could not be fitted.
    #[error(transparent)]
    Fit(#[from] RetargetError),
    /// It lacks a shape of every pose.
    #[error("{face} has none of the shapes that the poses need, such as {example}")]
    NoPose {
        /// Name of the face.
        face: String,
        /// A shape of the first pose.
        example: &'static str,
    },
    /// Stopped by the caller.
    #[error("stopped")]
    Stopped,
}

/// A vertex takes part in a pose where the face's own shapes move it by this much. (mm)
const MOVED: f64 = 0.1;
/// A best fit looks at every so many vertices at most.
const FIT_SITES: usize = 2000;

/// Rigs a face by every method and compares all poses that it has.
///
/// - `progress`: called before each method
///
/// # Errors
///
/// [`Table3Error`].
pub fn evaluate_face(
    face: &OwnFace,
    template: &Template,
    methods: &[Method],
    progress: &mut dyn FnMut(&Method) -> ControlFlow<()>,
) -> Result<FaceResult, Table3Error> {
    let registration = register(
        &face.neutral,
        template,
        &RegistrationOptions::default(),
        &mut |_| ControlFlow::Continue(()),
    )?;
    let poses = own_poses(face, template, &registration);
    if poses.is_empty() {
        return Err(Table3Error::NoPose {
            face: face.name.clone(),
            example: POSES[0].shapes[0],
        });
    }
    let examples = carry_expressions(&face.neutral, &registration, template, &face.expressions)?;
    let mut errors = Vec::new();
    for method in methods {
        if progress(method).is_break() {
            return Err(Table3Error::Stopped);
        }
        let seen: Vec<Example> = examples
            .iter()
            .filter(|e| method.sees_poses || !is_of_pose(&e.name))
            .cloned()
            .collect();
        errors.extend(match method.offsets {
            None => by_delta_transfer(face, template, &registration, &poses, method)?,
            Some(offsets) => {
                let mut on_template =
                    FaceOnTemplate::from_registration(&face.neutral, &registration)?;
                on_template.examples = &seen;
                let options = RigOptions {
                    offsets,
                    alpha: method.alpha,
                    ..RigOptions::default()
                };
                let rig = build(&on_template, template, &options)?;
                by_rig(Arc::new(rig), &poses, method)?
            }
        });
    }
    Ok(FaceResult {
        face: face.name.clone(),
        is_synthetic: face.is_synthetic,
        vertex_count: face.neutral.vertex_count(),
        registration_median: registration.report.template_to_face.median,
        errors,
        to_head: registration.to_head,
    })
}

/// Shapes that a pose needs, and `mouthClose`, which makes no sense without the open jaw.
fn is_of_pose(name: &str) -> bool {
    name == "mouthClose" || POSES.iter().any(|pose| pose.shapes.contains(&name))
}

/// A pose as the face itself makes it.
struct OwnPose {
    pose: Pose,
    weights: Vec<f32>,
    /// Displacement of every vertex. (mm)
    displacements: Vec<Vector>,
    /// Vertices of the skin that move.
    moved: Vec<usize>,
    /// The same by region.
    regions: Vec<(String, Vec<usize>)>,
}

fn own_poses(face: &OwnFace, template: &Template, registration: &Registration) -> Vec<OwnPose> {
    let is_part = registration.part_mask();
    let mut poses = Vec::new();
    for pose in POSES {
        let mut weights = vec![0.0; template.shapes.len()];
        let mut displacements = vec![Vector::zeros(); face.neutral.vertex_count()];
        let mut is_whole = true;
        for name in pose.shapes {
            let found = face.expressions.iter().find(|e| e.name == *name);
            let (Some(own), Some(shape)) = (found, template.shape_index(name)) else {
                is_whole = false;
                break;
            };
            weights[shape] = 1.0;
            for (sum, d) in displacements
                .iter_mut()
                .zip(moves(face, registration, &own.positions))
            {
                *sum += d;
            }
        }
        if !is_whole {
            continue;
        }
        let moved: Vec<usize> = (0..displacements.len())
            .filter(|&v| !is_part[v] && displacements[v].norm() >= MOVED)
            .collect();
        let regions = template.regions.regions.iter().enumerate();
        let by_region = regions.map(|(r, region)| {
            let is_of = |v: &&usize| registration.face_regions[**v].0 as usize == r;
            let vertices: Vec<usize> = moved.iter().filter(is_of).copied().collect();
            (region.name.clone(), vertices)
        });
        let regions = by_region.filter(|(_, of)| !of.is_empty()).collect();
        poses.push(OwnPose {
            pose,
            weights,
            displacements,
            moved,
            regions,
        });
    }
    poses
}

/// Displacements in the head frame. (mm)
fn moves<'a>(
    face: &'a OwnFace,
    registration: &'a Registration,
    posed: &'a [Point],
) -> impl Iterator<Item = Vector> + 'a {
    let to_head = registration.to_head;
    let rest = face.neutral.positions().iter();
    posed
        .iter()
        .zip(rest)
        .map(move |(p, rest)| to_head * p - to_head * rest)
}

fn by_delta_transfer(
    face: &OwnFace,
    template: &Template,
    registration: &Registration,
    poses: &[OwnPose],
    method: &Method,
) -> Result<Vec<PoseError>, Table3Error> {
    let mut transfer =
        DeltaTransfer::new(template, &registration.positions, &registration.face_points);
    if method.alpha != AlphaMode::Size {
        let others = face.expressions.iter().filter(|e| !is_of_pose(&e.name));
        let examples: Vec<(&[f32], Vec<Vector>)> = others
            .map(|e| {
                let wanted = moves(face, registration, &e.positions).collect();
                (e.weights.as_slice(), wanted)
            })
            .collect();
        let examples: Vec<(&[f32], &[Vector])> =
            examples.iter().map(|(w, d)| (*w, d.as_slice())).collect();
        transfer.scale = transfer.fitted_scale(&examples);
    }
    let mut errors = Vec::new();
    for own in poses {
        errors.push(compare(
            own,
            method,
            Drive::Units,
            &transfer.displacements(&own.weights),
        ));
        let stride = own.moved.len().div_ceil(FIT_SITES).max(1);
        let sites: Vec<usize> = own.moved.iter().copied().step_by(stride).collect();
        let weights = transfer.best_fit(&own.displacements, &sites)?;
        let fitted = transfer.displacements(&weights);
        errors.push(compare(own, method, Drive::BestFit, &fitted));
    }
    Ok(errors)
}

fn by_rig(
    rig: Arc<Rig>,
    poses: &[OwnPose],
    method: &Method,
) -> Result<Vec<PoseError>, Table3Error> {
    let mut simulation = Simulation::new(Arc::clone(&rig), Scene::without_dynamics(), None)?;
    let mut pose_skin = |weights: &[f32]| -> Result<Vec<Vector>, Table3Error> {
        let mut pose = FacePose::neutral(weights.len());
        pose.weights.copy_from_slice(weights);
        simulation.reset(pose)?;
        let pairs = simulation.skin().iter().zip(simulation.rest_skin());
        Ok(pairs.map(|(now, rest)| (now - rest).cast()).collect())
    };
    let controls = Controls::shapes(&rig);
    let mut model = ResponseModel::new(Arc::clone(&rig), controls, mesh_sites(&rig))?;
    let options = FitOptions {
        typical_rate: 0.0,
        ..FitOptions::default()
    };
    let mut errors = Vec::new();
    for own in poses {
        let posed = pose_skin(&own.weights)?;
        errors.push(compare(own, method, Drive::Units, &posed));
        let is_moved = |v: u32| own.moved.binary_search(&(v as usize)).is_ok();
        let sites = model.sites().iter();
        let frame = FitFrame {
            time: 0.0,
            displacements: sites
                .map(|site| {
                    let v = site.vertices[0];
                    is_moved(v).then(|| own.displacements[v as usize])
                })
                .collect(),
        };
        let fitted = fit_clip(&mut model, &[frame], &options)?;
        let weights: Vec<f32> = fitted.values.iter().map(|w| *w as f32).collect();
        errors.push(compare(own, method, Drive::BestFit, &pose_skin(&weights)?));
    }
    Ok(errors)
}

fn compare(own: &OwnPose, method: &Method, drive: Drive, posed: &[Vector]) -> PoseError {
    let over = |vertices: &[usize], of: &dyn Fn(usize) -> f64| -> f64 {
        vertices.iter().map(|&v| of(v)).sum::<f64>() / vertices.len().max(1) as f64
    };
    let distance = |v: usize| (posed[v] - own.displacements[v]).norm();
    // Every vertex that takes part moves, so its motion has a direction.
    let along = |v: usize| posed[v].dot(&own.displacements[v].normalize());
    let mean = over(&own.moved, &distance);
    let mut distances = Vec::new();
    if drive == Drive::Units {
        distances.resize(posed.len(), f32::NAN);
        own.moved
            .iter()
            .for_each(|&v| distances[v] = distance(v) as f32);
    }
    PoseError {
        method: method.name,
        pose: own.pose.name,
        drive,
        count: own.moved.len(),
        motion: over(&own.moved, &|v| own.displacements[v].norm()),
        mean,
        deviation: over(&own.moved, &|v| (distance(v) - mean).powi(2)).sqrt(),
        max: own.moved.iter().map(|&v| distance(v)).fold(0.0, f64::max),
        short: over(&own.moved, &|v| own.displacements[v].norm() - along(v)),
        beside: over(&own.moved, &|v| {
            (posed[v].norm_squared() - along(v).powi(2)).max(0.0).sqrt()
        }),
        regions: own
            .regions
            .iter()
            .map(|(region, vertices)| RegionError {
                region: region.clone(),
                count: vertices.len(),
                mean: over(vertices, &distance),
            })
            .collect(),
        distances,
    }
}

impl FaceResult {
    /// Mean over poses of a method's mean errors, or that of one pose; `None` where the face
    /// has none. (mm)
    pub fn mean(&self, method: &str, pose: Option<&str>, drive: Drive) -> Option<f64> {
        let errors = self
            .errors
            .iter()
            .filter(|e| e.method == method && e.drive == drive && pose.is_none_or(|p| p == e.pose));
        let means: Vec<f64> = errors.map(|e| e.mean).collect();
        (!means.is_empty()).then(|| means.iter().sum::<f64>() / means.len() as f64)
    }

    /// A pose by a method.
    pub fn error(&self, method: &str, pose: &str, drive: Drive) -> Option<&PoseError> {
        let mut errors = self.errors.iter();
        errors.find(|e| e.method == method && e.pose == pose && e.drive == drive)
    }

    /// Where a method is further from the face's own pose than another: regions, with what each
    /// adds to the difference of the means, largest first. (mm)
    pub fn losses(&self, method: &str, other: &str, pose: &str) -> Vec<(String, f64)> {
        let of = |method| self.error(method, pose, Drive::Units);
        let (Some(own), Some(other)) = (of(method), of(other)) else {
            return Vec::new();
        };
        let pairs = own.regions.iter().zip(&other.regions);
        let mut losses: Vec<(String, f64)> = pairs
            .map(|(a, b)| {
                let share = a.count as f64 / own.count.max(1) as f64;
                (a.region.clone(), share * (a.mean - b.mean))
            })
            .filter(|(_, loss)| *loss > 0.0)
            .collect();
        losses.sort_by(|a, b| b.1.total_cmp(&a.1));
        losses
    }
}

impl Table3 {
    /// Mean and standard deviation over faces of [`FaceResult::mean`]. (mm)
    pub fn over_faces(&self, method: &str, pose: Option<&str>, drive: Drive) -> [f64; 2] {
        let faces = self.faces.iter();
        let means: Vec<f64> = faces.filter_map(|f| f.mean(method, pose, drive)).collect();
        let count = means.len().max(1) as f64;
        let mean = means.iter().sum::<f64>() / count;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / count;
        [mean, variance.sqrt()]
    }
}
