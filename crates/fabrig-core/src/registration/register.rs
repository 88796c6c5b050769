//! The whole registration, stage by stage.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::Instant;

use nalgebra::{DVector, Similarity3, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::alignment::align;
use super::clean::{CleanMesh, clean, closed_volume};
use super::face_model::{FaceModel, OpeningKind, Role};
use super::identity_fit::shape_to;
use super::mapping::map_vertices;
use super::node_graph::NodeGraph;
use super::nonrigid_icp::{Pin, deform_coarse};
use super::opening_state::{measure_opening, opening_warnings, seam_distances};
use super::openings::{Parting, find_partings, parting_pins};
use super::parts::{RigidComponent, found_eyes, recognise};
use super::refinement::refine;
use super::report::{
    DistanceStatistics, OpeningMeasures, OpeningState, RegistrationReport, StageTime, measure,
};
use super::settling::{settle_hidden, unfold};
use super::similarity::{
    MatchedLandmarks, from_landmarks, match_landmarks, umeyama, useful_landmarks,
};
use super::target::Target;
use super::{CleaningReport, RegistrationError};
use crate::Point;
use crate::mesh::{Mesh, Surface, SurfacePoint, Topology, vertex_normals};
use crate::template::{RegionId, Template};

/// Fewer triangles than this are no face.
const MIN_TRIANGLE_COUNT: usize = 200;
/// Pieces smaller than this share of the largest are not tried as the face.
const PIECE_SHARE: f64 = 0.2;
/// Alignments worse than this are not trusted whatever their margin. (mm)
const MAX_RESIDUAL_MM: f64 = 8.0;

/// What a pin of a seam weighs.
const SEAM_WEIGHT: f64 = 0.5;

/// What to register by.
#[derive(Debug, Clone, PartialEq)]
pub struct RegistrationOptions {
    /// Positions by landmark name in the mesh's own units: none, or at least
    /// [`super::MIN_LANDMARK_COUNT`].
    pub landmarks: BTreeMap<String, Point>,
    /// Millimetres per unit of the mesh, where it is known; otherwise the face is scaled so
    /// that its eyes are as far apart as the template's.
    pub unit_mm: Option<f64>,
    /// Margin below which an automatic alignment is refused, 0 to 1.
    pub min_confidence: f64,
}

impl Default for RegistrationOptions {
    fn default() -> Self {
        Self {
            landmarks: BTreeMap::new(),
            unit_mm: None,
            min_confidence: 0.2,
        }
    }
}

/// How far registration has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Name of the stage.
    pub stage: &'static str,
    /// Share of all work that is done, 0 to 1.
    pub fraction: f64,
}

/// A registered face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Registration {
    /// The user's units to millimetres in the head frame (the template's frame).
    pub to_head: Similarity3<f64>,
    /// The template's vertices on this face. [mm, head frame]
    pub positions: Vec<Point>,
    /// What was measured.
    pub report: RegistrationReport,
    /// For every vertex of the user's mesh its place on the registered template, by side of
    /// lips and lids.
    pub face_points: Vec<SurfacePoint>,
    /// Region of that place, one per vertex of the user's mesh.
    pub face_regions: Vec<RegionId>,
    /// Pieces that are not skin: eyeballs, teeth, tongue.
    pub rigid_components: Vec<RigidComponent>,
}

impl Registration {
    /// For every vertex of the user's mesh whether it is of a piece that is not skin.
    pub fn part_mask(&self) -> Vec<bool> {
        let mut is_part = vec![false; self.face_points.len()];
        for &v in self.rigid_components.iter().flat_map(|c| &c.vertices) {
            is_part[v as usize] = true;
        }
        is_part
    }
}

/// Registers `face`, any mesh of a head or face, to `template`.
///
/// - `progress`: called between steps; `ControlFlow::Break` cancels
///
/// # Errors
///
/// [`RegistrationError`]: landmarks that do not fit, an alignment that does not stand out (with
/// the landmarks to give), too little surface, a cancelled run.
pub fn register(
    face: &Mesh,
    template: &Template,
    options: &RegistrationOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Registration, RegistrationError> {
    check(options)?;
    let mut clock = Clock {
        progress,
        times: Vec::new(),
        started: Instant::now(),
    };
    clock.step("clean", 0.0)?;
    let model = FaceModel::new(template)?;
    let landmarks = match_landmarks(template, &options.landmarks)?;
    let mut cleaned = clean(face);
    let mut warnings = Vec::new();
    let triangle_count = cleaned.pieces.first().map_or(0, |p| p.triangles.len());
    if triangle_count < MIN_TRIANGLE_COUNT {
        return Err(RegistrationError::TooFewTriangles {
            triangle_count,
            expected: MIN_TRIANGLE_COUNT,
        });
    }
    clock.finish("clean");

    clock.step("align", 0.05)?;
    let start = align_face(&model, &mut cleaned, &landmarks, options, &mut |share| {
        clock.step("align", 0.05 + 0.3 * share)
    })?;
    clock.finish("align");

    clock.step("shape", 0.35)?;
    let piece = &cleaned.pieces[start.piece];
    let target = target_of(&cleaned, start.piece, &start.to_head)?;
    let graph = NodeGraph::new(model.positions(), &model.topology, 1);
    let pins = Pins::new(&landmarks, &start.to_head);
    let shaped = shape_to(
        &model,
        &target,
        &pins.landmarks(4.0),
        &start.coefficients,
        &mut |share| clock.step("shape", 0.35 + 0.05 * share),
    )?;
    clock.finish("shape");

    clock.step("deform", 0.4)?;
    let mut seams = Vec::new();
    let coarse = deform_coarse(
        &model,
        &graph,
        &target,
        &shaped,
        &mut |vertices, is_first_of_stage| {
            if is_first_of_stage {
                seams = Seams::find(&model, &target, vertices)?.pins(&model);
            }
            Ok([pins.landmarks(4.0), seams.clone()].concat())
        },
        |share| clock.step("deform", 0.4 + 0.25 * share),
    )?;
    clock.finish("deform");

    clock.step("refine", 0.65)?;
    let found = Seams::find(&model, &target, &coarse)?;
    let mut refined = refine(
        &model,
        &target,
        &coarse,
        &[pins.landmarks(40.0), found.pins(&model)].concat(),
        |share| clock.step("refine", 0.65 + 0.25 * share),
    )?;
    unfold(&model, &mut refined)?;
    settle_hidden(&model, &mut refined)?;
    // What has settled turns the normals beside it.
    unfold(&model, &mut refined)?;
    clock.finish("refine");

    clock.step("map", 0.9)?;
    let topology = Topology::from_triangles(target.positions.len(), &target.triangles);
    let measured = OpeningKind::ALL.map(|kind| {
        let parting = found.face.iter().find(|p| p.kind == kind);
        measure_opening(&target, &topology, parting)
    });
    let has_open_eyes = measured[1..].iter().all(|m| m.state == OpeningState::Open);
    let eye_places = found_eyes(&model, &cleaned, &start.to_head, &refined, has_open_eyes);
    let to_true_size = true_size(
        &model,
        &refined,
        &start.to_head,
        options.unit_mm,
        eye_places,
    );
    let to_head = to_true_size * start.to_head;
    let positions: Vec<Point> = refined
        .iter()
        .map(|p| to_true_size.transform_point(p))
        .collect();
    let face_positions: Vec<Point> = face
        .positions()
        .iter()
        .map(|p| to_head.transform_point(p))
        .collect();
    let mut triangles = face.triangles();
    if cleaned.report.was_inside_out {
        for t in &mut triangles {
            t.swap(1, 2);
        }
    }
    let normals = vertex_normals(&face_positions, &triangles);
    let (face_points, face_regions) =
        map_vertices(&model, face, &face_positions, &normals, &positions)?;
    let clean_positions: Vec<Point> = cleaned
        .positions
        .iter()
        .map(|p| to_head.transform_point(p))
        .collect();
    let rigid_components = recognise(&model, &cleaned, start.piece, &clean_positions, &positions);
    clock.finish("map");

    let target = target_of(&cleaned, start.piece, &to_head)?;
    let measures = measure(&model, &target, &positions)?;
    let mut openings = measured.map(|m| m.scaled(to_true_size.scaling()));
    let found = Seams::find(&model, &target, &positions)?;
    for (opening, kind) in openings.iter_mut().zip(OpeningKind::ALL) {
        let of = |partings: &[Parting]| partings.iter().find(|p| p.kind == kind).cloned();
        opening.seam = seam_distances(of(&found.own).as_ref(), of(&found.face).as_ref());
    }
    let [mouth, left_eye, right_eye] = openings;
    let openings = OpeningMeasures {
        mouth,
        eyes: [left_eye, right_eye],
    };
    let landmark_distances = (!landmarks.names.is_empty()).then(|| {
        DistanceStatistics::from_distances(
            landmarks
                .face
                .iter()
                .zip(&landmarks.vertices)
                .map(|(p, &v)| (to_head.transform_point(p) - positions[v as usize]).norm())
                .collect(),
        )
    });
    warn(&cleaned.report, piece.triangles.len(), &mut warnings);
    if measures.folded_triangles > 0 {
        warnings.push(format!(
            "{} triangles of the registered face are folded over",
            measures.folded_triangles
        ));
    }
    warnings.extend(opening_warnings(&openings));
    clock.finish("report");
    let report = RegistrationReport {
        cleaning: cleaned.report.clone(),
        used_landmarks: !landmarks.names.is_empty(),
        confidence: start.confidence,
        alignment_residual_mm: start.residual_mm,
        millimetres_per_unit: to_head.scaling(),
        template_to_face: measures.template_to_face,
        face_to_template: measures.face_to_template,
        landmarks: landmark_distances,
        coverage: measures.coverage,
        folded_triangles: measures.folded_triangles,
        self_intersections: measures.self_intersections,
        triangle_quality: measures.triangle_quality,
        openings,
        cuts: Vec::new(),
        times: std::mem::take(&mut clock.times),
        warnings,
    };
    clock.step("done", 1.0)?;
    Ok(Registration {
        to_head,
        positions,
        report,
        face_points,
        face_regions,
        rigid_components,
    })
}

fn check(options: &RegistrationOptions) -> Result<(), RegistrationError> {
    if !(0.0..=1.0).contains(&options.min_confidence) {
        return Err(RegistrationError::BadOption {
            name: "min_confidence",
            value: options.min_confidence,
            expected: "a number from 0 to 1",
        });
    }
    if let Some(value) = options.unit_mm
        && !(value.is_finite() && value > 0.0)
    {
        return Err(RegistrationError::BadOption {
            name: "unit_mm",
            value,
            expected: "a positive number of millimetres",
        });
    }
    Ok(())
}

/// Progress, cancellation and times.
struct Clock<'a> {
    progress: &'a mut dyn FnMut(Progress) -> ControlFlow<()>,
    times: Vec<StageTime>,
    started: Instant,
}

impl Clock<'_> {
    fn step(&mut self, stage: &'static str, fraction: f64) -> Result<(), RegistrationError> {
        match (self.progress)(Progress { stage, fraction }) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(RegistrationError::Cancelled { stage }),
        }
    }

    fn finish(&mut self, stage: &str) {
        self.times.push(StageTime {
            stage: stage.to_owned(),
            seconds: self.started.elapsed().as_secs_f64(),
        });
        self.started = Instant::now();
    }
}

/// The similarity to start from, and which piece is the face.
struct Start {
    piece: usize,
    to_head: Similarity3<f64>,
    /// Coefficients of identity modes that fit there.
    coefficients: DVector<f64>,
    confidence: f64,
    residual_mm: f64,
}

/// Chooses the piece that is the face, turns its winding outwards, and aligns it.
fn align_face(
    model: &FaceModel<'_>,
    cleaned: &mut CleanMesh,
    landmarks: &MatchedLandmarks,
    options: &RegistrationOptions,
    on_step: &mut dyn FnMut(f64) -> Result<(), RegistrationError>,
) -> Result<Start, RegistrationError> {
    let largest = cleaned.pieces[0].area;
    let mut candidates: Vec<usize> = (0..cleaned.pieces.len())
        .filter(|&k| {
            let p = &cleaned.pieces[k];
            p.sphere.is_none()
                && p.area >= PIECE_SHARE * largest
                && p.triangles.len() >= MIN_TRIANGLE_COUNT
        })
        .take(4)
        .collect();
    if candidates.is_empty() {
        candidates.push(0);
    }
    let mut was_inside_out = vec![false; cleaned.pieces.len()];
    for &k in &candidates {
        if closed_volume(&cleaned.positions, &cleaned.pieces[k].triangles) < 0.0 {
            was_inside_out[k] = true;
            for t in &mut cleaned.pieces[k].triangles {
                t.swap(1, 2);
            }
        }
    }

    let start = if landmarks.names.is_empty() {
        let mut best: Option<Start> = None;
        for (n, &k) in candidates.iter().enumerate() {
            let piece = &cleaned.pieces[k];
            let surface = Surface::new(&cleaned.positions, &piece.triangles)?;
            let found = align(
                model,
                &cleaned.positions,
                &piece.triangles,
                &surface,
                &mut |share| on_step((n as f64 + share) / candidates.len() as f64),
            )?;
            let Some(found) = found else {
                continue;
            };
            if best
                .as_ref()
                .is_none_or(|b| found.residual_mm < b.residual_mm)
            {
                best = Some(Start {
                    piece: k,
                    to_head: found.to_head,
                    coefficients: found.coefficients,
                    confidence: found.confidence,
                    residual_mm: found.residual_mm,
                });
            }
        }
        let uncertain = |confidence| RegistrationError::AlignmentUncertain {
            confidence,
            threshold: options.min_confidence,
            landmarks: useful_landmarks(model.template),
        };
        let best = best.ok_or_else(|| uncertain(0.0))?;
        if best.confidence < options.min_confidence {
            return Err(uncertain(best.confidence));
        }
        if best.residual_mm > MAX_RESIDUAL_MM {
            return Err(uncertain(0.0));
        }
        best
    } else {
        let to_head = from_landmarks(model.template, landmarks)?;
        // The face is the piece that the landmarks lie on.
        let mut best = (f64::INFINITY, candidates[0]);
        for &k in &candidates {
            let surface = Surface::new(&cleaned.positions, &cleaned.pieces[k].triangles)?;
            let sum: f64 = landmarks
                .face
                .iter()
                .map(|p| surface.closest(p).distance)
                .sum();
            if sum < best.0 {
                best = (sum, k);
            }
        }
        Start {
            piece: best.1,
            to_head,
            coefficients: DVector::zeros(0),
            confidence: 1.0,
            residual_mm: landmark_rms(model, landmarks, &to_head),
        }
    };
    cleaned.report.was_inside_out = was_inside_out[start.piece];
    Ok(start)
}

fn landmark_rms(
    model: &FaceModel<'_>,
    landmarks: &MatchedLandmarks,
    to_head: &Similarity3<f64>,
) -> f64 {
    let sum: f64 = landmarks
        .face
        .iter()
        .zip(&landmarks.vertices)
        .map(|(p, &v)| (to_head.transform_point(p) - model.positions()[v as usize]).norm_squared())
        .sum();
    (sum / landmarks.names.len() as f64).sqrt()
}

/// The chosen piece alone, in the head frame.
pub(super) fn target_of(
    cleaned: &CleanMesh,
    piece: usize,
    to_head: &Similarity3<f64>,
) -> Result<Target, RegistrationError> {
    let piece = &cleaned.pieces[piece];
    let mut local = vec![u32::MAX; cleaned.positions.len()];
    let positions = piece
        .vertices
        .iter()
        .enumerate()
        .map(|(k, &v)| {
            local[v as usize] = k as u32;
            to_head.transform_point(&cleaned.positions[v as usize])
        })
        .collect();
    let triangles = piece
        .triangles
        .iter()
        .map(|t| t.map(|v| local[v as usize]))
        .collect();
    Ok(Target::new(positions, triangles)?)
}

/// What the user says of single places.
struct Pins {
    landmarks: Vec<(u32, Point)>,
}

impl Pins {
    fn new(landmarks: &MatchedLandmarks, to_head: &Similarity3<f64>) -> Self {
        Self {
            landmarks: landmarks
                .vertices
                .iter()
                .zip(&landmarks.face)
                .map(|(&v, p)| (v, to_head.transform_point(p)))
                .collect(),
        }
    }

    fn landmarks(&self, weight: f64) -> Vec<Pin> {
        self.landmarks
            .iter()
            .map(|&(vertex, place)| Pin::of_vertex(vertex, place, weight))
            .collect()
    }
}

/// Where one sees lips and lids part.
pub(super) struct Seams {
    /// On the template as far as it has been deformed.
    own: Vec<Parting>,
    /// On the face.
    face: Vec<Parting>,
}

impl Seams {
    pub(super) fn find(
        model: &FaceModel<'_>,
        target: &Target,
        vertices: &[Point],
    ) -> Result<Self, RegistrationError> {
        let own = Surface::new(vertices, &model.triangles)?;
        Ok(Self {
            own: find_partings(&model.openings, &own, vertices),
            face: find_partings(&model.openings, &target.surface, vertices),
        })
    }

    pub(super) fn pins(&self, model: &FaceModel<'_>) -> Vec<Pin> {
        parting_pins(model, &self.own, &self.face, SEAM_WEIGHT)
    }
}

/// From the frame of the first alignment to the head frame proper, turned and placed for the
/// least distance between the registered face and the template's. The size is that of the unit
/// the user gave; else eyes as far apart as the template's, by the user's eyeballs or by open
/// lids; else the size that fits best (closed lids tell little of where eyes are).
fn true_size(
    model: &FaceModel<'_>,
    registered: &[Point],
    to_head: &Similarity3<f64>,
    unit_mm: Option<f64>,
    eyes: Option<[Point; 2]>,
) -> Similarity3<f64> {
    let face: Vec<usize> = (0..registered.len())
        .filter(|&v| model.roles[v] == Role::Face)
        .collect();
    let from: Vec<Point> = face.iter().map(|&v| registered[v]).collect();
    let to: Vec<Point> = face.iter().map(|&v| model.positions()[v]).collect();
    let weights = vec![1.0; face.len()];
    let Some(fitted) = umeyama(&from, &to, &weights) else {
        return Similarity3::identity();
    };
    let scale = match (unit_mm, eyes) {
        (Some(unit), _) => unit / to_head.scaling(),
        (None, Some([left, right])) => {
            let [own_left, own_right] = model.template.eyes.map(|e| e.center);
            (own_left - own_right).norm() / (left - right).norm()
        }
        (None, None) => fitted.scaling(),
    };
    let rotation: UnitQuaternion<f64> = fitted.isometry.rotation;
    let middle = |points: &[Point]| {
        points.iter().map(|p| p.coords).sum::<crate::Vector>() / points.len() as f64
    };
    let translation = middle(&to) - rotation * middle(&from) * scale;
    Similarity3::from_parts(Translation3::from(translation), rotation, scale)
}

fn warn(report: &CleaningReport, triangle_count: usize, warnings: &mut Vec<String>) {
    if report.was_inside_out {
        warnings.push(
            "the face is wound inside out: its triangles are clockwise, or the mesh is a mirror \
             image (then left and right are swapped)"
                .to_owned(),
        );
    }
    if report.non_manifold_edges > 0 {
        warnings.push(format!(
            "{} edges have more than two triangles",
            report.non_manifold_edges
        ));
    }
    if triangle_count < 1500 {
        warnings.push(format!(
            "the face has only {triangle_count} triangles: fine detail cannot be matched"
        ));
    }
}
