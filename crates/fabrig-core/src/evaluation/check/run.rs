//! The check itself, shape after shape.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Point3;

use super::findings::{Findings, Seen};
use super::gates::CheckGates;
use super::muscles::compare_muscles;
use super::places::Places;
use super::report::{CheckReport, MuscleCheck, RegionDistance, ShapeCheck};
use super::seams::{Crossed, Seams, torn_edges};
use crate::Vector;
use crate::mesh::SurfaceError;
use crate::registration::{DistanceStatistics, OpeningState, RegistrationReport};
use crate::rig::Rig;
use crate::scene::{Dynamics, FacePose, Scene, SceneError, Simulation, hold_pose};
use crate::template::{RegionId, Template};
use crate::transfer::TransferError;

/// Correctives that are nothing without another shape.
const OVER: [(&str, &str); 1] = [("mouthClose", "jawOpen")];
/// A shape that moves the template's skin by less has no amplitude to compare. (mm)
pub(super) const TELLING: f64 = 0.5;
/// Beyond this from the mid plane of the template a vertex is on one side. (mm)
const SIDE: f64 = 15.0;
/// Shapes that close an eye: 1 the left one, 2 the right one.
const BLINKS: [(&str, usize); 2] = [("eyeBlinkLeft", 1), ("eyeBlinkRight", 2)];
/// Triangles whose normal has more of +Z than this, and of -Y less than of that, look forwards:
/// where the jaw meets the throat skin folds by nature.
const FORWARD: f32 = 0.1;
/// Share of triangles at either end that say nothing of areas.
const ENDS: f64 = 0.001;
/// Muscle shapes are listed outside these.
const LISTED: ([f64; 2], f64) = ([0.5, 2.0], 0.7);

/// What can go wrong with a check itself.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// The rig was made with another template.
    #[error(
        "the rig was made with template '{expected}', not with this version of '{found}': give \
         the template it was made with, or make the rig again"
    )]
    Template {
        /// The rig's.
        expected: String,
        /// The one given.
        found: String,
    },
    /// The rig has no surface.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// The rig cannot be posed.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The rig's patches do not belong to the template.
    #[error(transparent)]
    Transfer(#[from] TransferError),
    /// Stopped by the caller.
    #[error("stopped")]
    Stopped,
}

/// A report, and what it says of single vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct RigCheck {
    /// The figures.
    pub report: CheckReport,
    /// Distance of every vertex of the mesh from the registered template; none for parts that
    /// are no skin. (mm)
    pub distances: Vec<Option<f64>>,
    /// For each shape the vertices that a finding is about, rising.
    pub marked: Vec<Vec<u32>>,
}

/// Checks a rig.
///
/// - `template`: the one that it was made with
/// - `scene`: without dynamics each shape is looked at as the muscles have it; with them it is
///   held until still, contact and all
/// - `progress`: called before each shape with its index; `ControlFlow::Break` stops
///
/// # Errors
///
/// [`CheckError`].
pub fn check_rig(
    rig: &Arc<Rig>,
    template: &Template,
    gates: &CheckGates,
    scene: &Scene,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<RigCheck, CheckError> {
    let places = Places::new(rig, template)?;
    let mut simulation = Simulation::new(Arc::clone(rig), scene.clone(), None)?;
    let mut pose = |shapes: &[usize]| -> Result<Vec<Point3<f32>>, CheckError> {
        let mut pose = FacePose::neutral(rig.shape_names.len());
        shapes.iter().for_each(|&shape| pose.weights[shape] = 1.0);
        match scene.dynamics {
            Dynamics::None => simulation.reset(pose)?,
            Dynamics::Cloth => hold_pose(&mut simulation, &pose)?,
        }
        Ok(simulation.skin().to_vec())
    };
    let rest = pose(&[])?;
    let over: Vec<Option<usize>> = rig
        .shape_names
        .iter()
        .map(|name| {
            let found = OVER.iter().find(|(shape, _)| shape == name);
            found.and_then(|(_, base)| rig.shape_index(base))
        })
        .collect();
    let registration = serde_json::from_str(&rig.registration_report).ok();
    let is_open = openings(registration.as_ref());
    let mut looker = Looker::new(rig, &places, &rest, is_open);
    let mut findings = Findings::new(*gates);
    let mut shapes = Vec::new();
    let mut marked = Vec::new();
    let mut notes = Vec::new();
    for (side, name) in [(1, "left"), (2, "right")] {
        if !is_open[side] {
            notes.push(format!(
                "the {name} eye is shut at rest: its blink has nothing to close, and is not judged"
            ));
        }
    }
    for shape in 0..rig.shape_names.len() {
        if progress(shape).is_break() {
            return Err(CheckError::Stopped);
        }
        let base: Vec<usize> = over[shape].into_iter().collect();
        let whole: Vec<usize> = base.iter().copied().chain([shape]).collect();
        let from = if base.is_empty() {
            rest.clone()
        } else {
            pose(&base)?
        };
        let seen = looker.look(shape, &base, &from, &pose(&whole)?);
        marked.push(findings.of_shape(&seen, looker.in_view, &mut notes));
        shapes.push(seen.check);
    }
    let muscles = compare_muscles(rig, template, &over)?;
    findings.of_muscles(&muscles);
    let (distances, distance, regions) = distances(&places);
    findings.of_distance(&distance, &distances);
    notes.extend(registration.as_ref().map(notes_of).into_iter().flatten());
    let is_listed = |m: &MuscleCheck| {
        let ([least, most], direction) = LISTED;
        m.ratio < least || m.ratio > most || m.direction < direction
    };
    Ok(RigCheck {
        report: CheckReport {
            template: template.name.clone(),
            skin_vertices: places.of_vertex.iter().flatten().count(),
            size: places.size,
            gates: *gates,
            shapes,
            muscles: muscles.into_iter().filter(is_listed).collect(),
            distance,
            regions,
            findings: findings.found,
            notes,
        },
        distances,
        marked,
    })
}

/// What all shapes are compared with.
struct Looker<'a> {
    rig: &'a Rig,
    places: &'a Places<'a>,
    rest: &'a [Point3<f32>],
    seams: Seams,
    normals: Vec<(nalgebra::Vector3<f32>, f32)>,
    /// Where each vertex is on the template, across. (mm)
    across: Vec<Option<f64>>,
    /// Whether each triangle is in view and looks forwards.
    is_in_view: Vec<bool>,
    /// How many do.
    in_view: usize,
    is_open: [bool; 3],
}

impl<'a> Looker<'a> {
    fn new(
        rig: &'a Rig,
        places: &'a Places<'a>,
        rest: &'a [Point3<f32>],
        is_open: [bool; 3],
    ) -> Self {
        let across = places.of_vertex.iter();
        let normals = places.normals_and_areas(rest);
        let triangles = places.triangles.iter().zip(&normals);
        let is_in_view: Vec<bool> = triangles
            .map(|(t, (normal, area))| {
                let is_forward = normal.z > FORWARD.max(-normal.y) && *area > 0.0;
                is_forward && t.iter().all(|&v| places.is_in_view[v as usize])
            })
            .collect();
        Self {
            rig,
            seams: Seams::new(places, rest),
            in_view: is_in_view.iter().filter(|seen| **seen).count(),
            is_in_view,
            is_open,
            normals,
            across: across
                .map(|place| place.as_ref().map(|at| places.on_template(at).x))
                .collect(),
            places,
            rest,
        }
    }

    /// - `base`: shapes that are on besides; `from`: the mesh under them, `now`: with the shape
    fn look(
        &mut self,
        shape: usize,
        base: &[usize],
        from: &[Point3<f32>],
        now: &[Point3<f32>],
    ) -> Seen {
        let places = self.places;
        let drawn = places.drawn(&[shape]);
        let motion = |v: usize| -> Vector { (now[v] - from[v]).cast() };
        let (mut skin, mut parts) = (0.0f64, 0.0f64);
        let (mut dot, mut own, mut wanted) = (0.0, 0.0, 0.0);
        let side = side_of(&self.rig.shape_names[shape]);
        let mut leak = (0.0f64, None);
        for (v, place) in places.of_vertex.iter().enumerate() {
            let m = motion(v);
            let Some(place) = place else {
                parts = parts.max(m.norm());
                continue;
            };
            let d = places.at(place, &drawn);
            skin = skin.max(m.norm());
            dot += m.dot(&d);
            own += m.norm_squared();
            wanted += d.norm_squared();
            let beyond = m.norm() - d.norm();
            let is_across = |sign: f64| self.across[v].is_some_and(|x| x * sign < -SIDE);
            if side.is_some_and(is_across) && beyond > leak.0 {
                leak = (beyond, Some(v as u32));
            }
        }
        let template_mm = drawn.iter().map(|d| d.norm()).fold(0.0, f64::max);
        let name = self.rig.shape_names[shape].as_str();
        let is_of_shut_eye = BLINKS
            .iter()
            .any(|(blink, eye)| *blink == name && !self.is_open[*eye]);
        let is_telling = template_mm >= TELLING && wanted > 0.0 && !is_of_shut_eye;
        let both = base.iter().copied().chain([shape]).collect::<Vec<_>>();
        let drawn = places.drawn(&both);
        let from_rest = |v: u32| -> Vector { (now[v as usize] - self.rest[v as usize]).cast() };
        let wrong_side = self
            .seams
            .wrong_side(self.is_open, places, &drawn, &from_rest);
        let torn: Vec<[u32; 2]> = torn_edges(places, self.rest, now)
            .into_iter()
            .map(|e| places.edges[e])
            .collect();
        let (flipped, area_ratios) = self.triangles(&drawn, now);
        let lips = self.seams.crossed(0, now);
        let eyes = [1, 2].map(|eye| self.seams.crossed(eye, now));
        let deeper = if eyes[1].depth > eyes[0].depth { 1 } else { 0 };
        let lids = Crossed {
            pairs: eyes[0].pairs + eyes[1].pairs,
            ..eyes[deeper]
        };
        Seen {
            check: ShapeCheck {
                shape: self.rig.shape_names[shape].clone(),
                over: base.first().map(|&b| self.rig.shape_names[b].clone()),
                amplitude_mm: skin,
                parts_mm: parts,
                template_mm,
                ratio: is_telling.then(|| dot / wanted),
                direction: is_telling.then(|| {
                    if own > 0.0 {
                        dot / (own * wanted).sqrt()
                    } else {
                        0.0
                    }
                }),
                wrong_side: wrong_side.len(),
                torn_edges: torn.len(),
                leak_mm: side.map(|_| leak.0),
                flipped: flipped.len(),
                area_ratios,
                lip_crossings: lips.pairs,
                lip_depth_mm: lips.depth,
                lid_crossings: lids.pairs,
                lid_depth_mm: lids.depth,
            },
            wrong_side,
            torn,
            flipped,
            leaking: leak.1,
            lips,
            lids,
        }
    }

    /// One corner of every triangle in view that turns over and does not on the template, and
    /// the ends of area ratios.
    fn triangles(&self, drawn: &[Vector], now: &[Point3<f32>]) -> (Vec<u32>, [f64; 2]) {
        let places = self.places;
        let after = places.normals_and_areas(now);
        let mut flipped = Vec::new();
        let mut ratios = Vec::new();
        let triangles = places.triangles.iter().zip(self.normals.iter().zip(&after));
        for ((t, ((rest, area), (turned, now_area))), is_in_view) in triangles.zip(&self.is_in_view)
        {
            if !is_in_view {
                continue;
            }
            ratios.push(f64::from(now_area / area));
            if rest.dot(turned) >= 0.0 {
                continue;
            }
            // What the template itself does to this very triangle.
            let [a, b, c] = t.map(|v| {
                let rest = self.rest[v as usize].cast::<f64>();
                let place = places.of_vertex[v as usize].as_ref();
                place.map_or(rest, |place| rest + places.at(place, drawn))
            });
            if (b - a).cross(&(c - a)).dot(&rest.cast()) >= 0.0 {
                flipped.push(t[0]);
            }
        }
        ratios.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let index = (ratios.len() as f64 * share) as usize;
            let last = ratios.len().saturating_sub(1);
            ratios.get(index.min(last)).copied().unwrap_or(1.0)
        };
        (flipped, [at(ENDS), at(1.0 - ENDS)])
    }
}

/// Whether mouth, left eye and right eye have sides that can part; lips always have.
fn openings(registration: Option<&RegistrationReport>) -> [bool; 3] {
    let is_open = |eye: usize| {
        registration.is_none_or(|report| report.openings.eyes[eye].state == OpeningState::Open)
    };
    [true, is_open(0), is_open(1)]
}

/// The sign of x on the side that a shape of one side belongs to.
fn side_of(shape: &str) -> Option<f64> {
    // These move jaw and mouth as a whole to one side.
    if shape.starts_with("jaw") || shape == "mouthLeft" || shape == "mouthRight" {
        return None;
    }
    match shape {
        _ if shape.ends_with("Left") => Some(1.0),
        _ if shape.ends_with("Right") => Some(-1.0),
        _ => None,
    }
}

/// Distances by vertex, of the face, and by region.
fn distances(places: &Places<'_>) -> (Vec<Option<f64>>, DistanceStatistics, Vec<RegionDistance>) {
    let of_vertex = places.of_vertex.iter();
    let distances: Vec<Option<f64>> = of_vertex.map(|at| Some(at.as_ref()?.distance)).collect();
    let of = |is_in: &dyn Fn(usize) -> bool| {
        let all = distances.iter().enumerate();
        let some = all.filter(|(v, _)| is_in(*v)).filter_map(|(_, d)| *d);
        DistanceStatistics::from_distances(some.collect())
    };
    let face = of(&|v| places.is_in_view[v]);
    let regions = places.template.regions.regions.iter().enumerate();
    let by_region = regions
        .map(|(r, region)| RegionDistance {
            region: region.name.clone(),
            distance: of(&|v| places.regions[v] == Some(RegionId(r as u8))),
        })
        .filter(|region| region.distance.count > 0)
        .collect();
    (distances, face, by_region)
}

/// What registration said that explains findings.
fn notes_of(report: &RegistrationReport) -> Vec<String> {
    let is_cut = |name: &str| report.cuts.iter().any(|cut| cut.opening.contains(name));
    let openings = [
        ("lips", "mouth", "mouth", &report.openings.mouth),
        ("left lids", "eye", "eyes", &report.openings.eyes[0]),
        ("right lids", "eye", "eyes", &report.openings.eyes[1]),
    ];
    openings
        .into_iter()
        .filter(|(_, name, _, opening)| opening.state == OpeningState::Fused && !is_cut(name))
        .map(|(what, _, seam, _)| {
            format!("the {what} are one surface: rig the face with --cut-seams {seam}")
        })
        .collect()
}
