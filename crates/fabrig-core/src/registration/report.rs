//! How well a face was registered, in millimetres at true head size.

use serde::{Deserialize, Serialize};

use super::clean::CleaningReport;
use super::cut::SeamCut;
use super::face_model::{FaceModel, Role};
use super::target::Target;
use crate::mesh::{Surface, SurfaceError, self_intersections, triangle_normals, vertex_normals};
use crate::{Point, Vector};

/// Distances of a set of points. (mm)
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct DistanceStatistics {
    /// How many points were measured.
    pub count: usize,
    /// Median.
    pub median: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// 95 % are below this.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl DistanceStatistics {
    /// Of these distances; all zero for none.
    pub fn from_distances(mut distances: Vec<f64>) -> Self {
        if distances.is_empty() {
            return Self::default();
        }
        distances.sort_by(f64::total_cmp);
        let count = distances.len();
        Self {
            count,
            median: distances[count / 2],
            rms: (distances.iter().map(|d| d * d).sum::<f64>() / count as f64).sqrt(),
            p95: distances[(count * 95 / 100).min(count - 1)],
            max: distances[count - 1],
        }
    }
}

/// Time of one stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    /// Name of the stage.
    pub stage: String,
    /// Wall-clock time. (s)
    pub seconds: f64,
}

/// Whether an opening of the template has a counterpart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OpeningState {
    /// One sees a gap between both sides.
    Open,
    /// Both sides touch, but they are two: behind them is a mouth bag, a socket or the end of
    /// the mesh. They part without stretching.
    Closed,
    /// One surface across the seam: both sides stretch when they part, unless it is cut.
    Fused,
}

/// What was measured at one opening. Lengths are at true head size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OpeningMeasure {
    /// What that makes it.
    pub state: OpeningState,
    /// Height of the gap one sees in its middle. (mm)
    pub gap_mm: f64,
    /// Surface behind the seam: the way along it from side to side less the straight line;
    /// `None` where nothing joins them. (mm)
    pub inside_mm: Option<f64>,
    /// Distance of the template's parting from that of the face, both sides.
    pub seam: DistanceStatistics,
}

impl OpeningMeasure {
    /// In millimetres of another size.
    pub(super) fn scaled(mut self, scale: f64) -> Self {
        self.gap_mm *= scale;
        self.inside_mm = self.inside_mm.map(|mm| mm * scale);
        self
    }
}

/// The openings of a face.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OpeningMeasures {
    /// The lips.
    pub mouth: OpeningMeasure,
    /// Left eye, right eye.
    pub eyes: [OpeningMeasure; 2],
}

/// What registration measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegistrationReport {
    /// What cleaning found.
    pub cleaning: CleaningReport,
    /// Whether landmarks fixed the alignment.
    pub used_landmarks: bool,
    /// Margin of the alignment over the best one that differs, 0 to 1; 1 with landmarks.
    pub confidence: f64,
    /// Mean capped distance right after alignment, before the template was deformed. (mm)
    pub alignment_residual_mm: f64,
    /// Millimetres per unit of the user's mesh.
    pub millimetres_per_unit: f64,
    /// Distance of the template's face vertices from the user's surface, where covered.
    pub template_to_face: DistanceStatistics,
    /// Distance of the user's vertices from the template's face, where they lie on it.
    pub face_to_template: DistanceStatistics,
    /// Distance of the given landmarks from where they ended up, if any were given.
    pub landmarks: Option<DistanceStatistics>,
    /// Share of the template's face area that has a counterpart, 0 to 1.
    pub coverage: f64,
    /// Triangles of the template's face that turned against their surroundings.
    pub folded_triangles: usize,
    /// Pairs of triangles of the registered face that pass through each other and do not on the
    /// template itself.
    #[serde(default)]
    pub self_intersections: usize,
    /// Smallest, 5 % and median quality of the face's triangles, 1 = equilateral, 0 = no area.
    pub triangle_quality: [f64; 3],
    /// Lips and lids: whether they can part, and how well their seams were met.
    pub openings: OpeningMeasures,
    /// What was cut open, on request.
    #[serde(default)]
    pub cuts: Vec<SeamCut>,
    /// Time of each stage.
    pub times: Vec<StageTime>,
    /// What a person should know, one sentence each.
    pub warnings: Vec<String>,
}

impl RegistrationReport {
    /// Whether upper and lower lip are one surface in the user's mesh.
    pub fn fused_mouth(&self) -> bool {
        self.openings.mouth.state == OpeningState::Fused
    }

    /// Whether upper and lower lid of an eye are one surface: left, right.
    pub fn fused_eyes(&self) -> [bool; 2] {
        self.openings.eyes.map(|e| e.state == OpeningState::Fused)
    }

    /// Time of all stages. (s)
    pub fn total_seconds(&self) -> f64 {
        self.times.iter().map(|t| t.seconds).sum()
    }
}

/// What is measured on the registered positions.
pub(super) struct Measures {
    pub(super) template_to_face: DistanceStatistics,
    pub(super) face_to_template: DistanceStatistics,
    pub(super) coverage: f64,
    pub(super) folded_triangles: usize,
    pub(super) self_intersections: usize,
    pub(super) triangle_quality: [f64; 3],
}

/// Distances beyond this mean that there is no counterpart. (mm)
const COUNTERPART_MM: f64 = 6.0;

/// Measures `registered` against the target.
pub(super) fn measure(
    model: &FaceModel<'_>,
    target: &Target,
    registered: &[Point],
) -> Result<Measures, SurfaceError> {
    let normals = vertex_normals(registered, &model.triangles);
    let areas = crate::mesh::vertex_areas(registered, &model.triangles);
    let cos_limit = 75f64.to_radians().cos();
    let mut forth = Vec::new();
    let (mut covered, mut total) = (0.0, 0.0);
    for v in (0..registered.len()).filter(|&v| model.roles[v] == Role::Face) {
        total += areas[v];
        let mate = target.matching(&registered[v], &normals[v], COUNTERPART_MM, cos_limit);
        if let Some(m) = mate.filter(|m| !m.is_on_boundary) {
            covered += areas[v];
            forth.push(m.place.distance);
        }
    }
    let surface = Surface::new(registered, &model.triangles)?;
    let back = target
        .positions
        .iter()
        .zip(&target.normals)
        .filter_map(|(p, n)| {
            let at = surface.closest_where(p, COUNTERPART_MM, |at| {
                surface.blend(at, &normals).dot(n) > 0.25
            })?;
            let is_face = model.triangles[at.triangle as usize]
                .iter()
                .all(|&v| model.roles[v as usize] == Role::Face);
            is_face.then_some(at.distance)
        })
        .collect();

    let mut qualities: Vec<f64> = model
        .triangles
        .iter()
        .filter(|t| is_face_triangle(model, t))
        .map(|t| {
            let [a, b, c] = t.map(|v| registered[v as usize]);
            let sides = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
            if sides > 0.0 {
                // 4 sqrt(3) area / sum of squared sides.
                2.0 * 3f64.sqrt() * (b - a).cross(&(c - a)).norm() / sides
            } else {
                0.0
            }
        })
        .collect();
    qualities.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let k = (qualities.len() as f64 * share) as usize;
        qualities
            .get(k.min(qualities.len().saturating_sub(1)))
            .copied()
            .unwrap_or(0.0)
    };
    Ok(Measures {
        template_to_face: DistanceStatistics::from_distances(forth),
        face_to_template: DistanceStatistics::from_distances(back),
        coverage: if total > 0.0 { covered / total } else { 0.0 },
        folded_triangles: folded_triangles(model, registered).len(),
        self_intersections: new_self_intersections(model, registered),
        triangle_quality: [at(0.0), at(0.05), at(0.5)],
    })
}

/// Pairs of the face's triangles that pass through each other here and not on the template.
fn new_self_intersections(model: &FaceModel<'_>, registered: &[Point]) -> usize {
    let face: Vec<[u32; 3]> = model
        .triangles
        .iter()
        .filter(|t| is_face_triangle(model, t))
        .copied()
        .collect();
    let own = self_intersections(model.positions(), &face);
    self_intersections(registered, &face)
        .iter()
        .filter(|pair| own.binary_search(pair).is_err())
        .count()
}

fn is_face_triangle(model: &FaceModel<'_>, t: &[u32; 3]) -> bool {
    t.iter().all(|&v| model.roles[v as usize] == Role::Face)
}

/// Triangles of the face that are turned against the normals around them, and are not so on
/// the template itself.
pub(super) fn folded_triangles(model: &FaceModel<'_>, positions: &[Point]) -> Vec<u32> {
    let normals = vertex_normals(positions, &model.triangles);
    let own = triangle_normals(positions, &model.triangles);
    let own_before = triangle_normals(model.positions(), &model.triangles);
    (0..model.triangles.len() as u32)
        .filter(|&k| {
            let t = &model.triangles[k as usize];
            let turn = |normals: &[Vector], own: &[Vector]| {
                let around: Vector = t.iter().map(|&v| normals[v as usize]).sum();
                own[k as usize].dot(&around)
            };
            is_face_triangle(model, t)
                && turn(&normals, &own) < 0.0
                && turn(&model.normals, &own_before) > 0.0
        })
        .collect()
}
