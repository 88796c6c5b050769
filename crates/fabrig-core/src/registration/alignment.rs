//! Automatic alignment: the similarity that takes any face mesh to the template's frame,
//! without landmarks, in any unit and orientation.
//!
//! 1. Guess: the template's nose tip is put on many places of the mesh, its forward axis along
//!    the smoothed normal there (tilted a few ways), with every roll and a range of sizes.
//!    Each guess is judged by how closely a sparse set of template points, with normals, meets
//!    the mesh (voxel grid, template millimetres, so that size plays no part).
//! 2. Settle the better guesses by a few steps of ICP on the same grid.
//! 3. Refine the best of those by trimmed point-to-plane ICP with scale, both ways.
//! 4. Let each of these take the shape of a person, as far as people differ: a heavy brow must
//!    not look like a wrong place.
//! 5. Confidence: the margin of the best over the best that differs from it.

use nalgebra::{DVector, SMatrix, SVector, Similarity3, Translation3, Unit, UnitQuaternion};
use rayon::prelude::*;

use super::RegistrationError;
use super::closest_grid::{ClosestGrid, Sample, sample_surface};
use super::face_model::FaceModel;
use super::identity_fit::{Attraction, Fitting, IdentityFit, fit_identity};
use crate::mesh::Surface;
use crate::{Point, Vector};

/// Distance at which a point counts as entirely off. [mm on the template]
const CUTOFF_MM: f64 = 14.0;
const ROLL_COUNT: usize = 24;
const TILTS_DEGREES: [f64; 3] = [-28.0, 0.0, 28.0];
/// Sizes tried: the diagonal of the mesh's box would be this long. (mm)
const DIAGONALS_MM: [f64; 13] = [
    210.0, 250.0, 300.0, 360.0, 430.0, 520.0, 620.0, 740.0, 900.0, 1150.0, 1500.0, 1900.0, 2400.0,
];
const ANCHOR_COUNT: usize = 700;
/// Samples that normals of anchors are averaged from, at most.
const AVERAGED_COUNT: usize = 100_000;
const SETTLED_COUNT: usize = 2400;
const REFINED_COUNT: usize = 20;
const FITTED_COUNT: usize = 12;
/// How a guess takes the shape of a person.
const FITTING: Fitting = Fitting {
    mode_count: 30,
    rounds: 12,
    sigma: [4.0, 1.5],
    reach: [25.0, 14.0],
    has_own_normals: false,
    thinned_share: 0.0,
};
/// What an unlikely person costs, for each squared standard deviation. (mm)
const UNLIKELY_MM: f64 = 0.01;

/// A similarity that takes the mesh to the head frame, and how much it can be trusted.
#[derive(Debug, Clone)]
pub(super) struct Alignment {
    pub(super) to_head: Similarity3<f64>,
    /// Coefficients of the leading identity modes with which the template fits there.
    pub(super) coefficients: DVector<f64>,
    /// Mean capped distance of template face points. (mm)
    pub(super) residual_mm: f64,
    /// 1 - residual / residual of the best alignment that differs from this one.
    pub(super) confidence: f64,
}

/// Aligns triangles, wound counter-clockwise seen from outside, to the template.
///
/// Returns `None` when no guess touches the mesh at all.
///
/// - `on_step`: told the share that is done; its error ends the search
pub(super) fn align(
    model: &FaceModel<'_>,
    positions: &[Point],
    triangles: &[[u32; 3]],
    surface: &Surface,
    on_step: &mut dyn FnMut(f64) -> Result<(), RegistrationError>,
) -> Result<Option<Alignment>, RegistrationError> {
    let (mut low, mut high) = (
        positions[triangles[0][0] as usize],
        positions[triangles[0][0] as usize],
    );
    for &v in triangles.iter().flatten() {
        low = low.inf(&positions[v as usize]);
        high = high.sup(&positions[v as usize]);
    }
    let diagonal = (high - low).norm();
    let samples = sample_surface(positions, triangles, diagonal / 110.0);
    let grid = ClosestGrid::new(samples, diagonal / 120.0, diagonal * 0.12);
    let anchors = anchors(&grid, diagonal);

    let spread = model.spread_vertices(260);
    let points = model.samples(&spread);
    let (coarse, fine) = (
        &points[..18.min(points.len())],
        &points[..140.min(points.len())],
    );
    let nose = model.nose_tip();

    on_step(0.15)?;
    let mut guesses: Vec<Guess> = anchors
        .par_iter()
        .map(|anchor| {
            let mut best: Vec<Guess> = Vec::new();
            for tilt in TILTS_DEGREES {
                for roll in 0..ROLL_COUNT {
                    let roll = roll as f64 / ROLL_COUNT as f64 * std::f64::consts::TAU;
                    // The tip's normal points this far above the forward axis on the template.
                    let turn = UnitQuaternion::rotation_between(&Vector::z(), &anchor.normal)
                        .unwrap_or_else(|| {
                            UnitQuaternion::from_axis_angle(&Vector::x_axis(), std::f64::consts::PI)
                        })
                        * UnitQuaternion::from_axis_angle(&Vector::z_axis(), roll)
                        * UnitQuaternion::from_axis_angle(&Vector::x_axis(), tilt.to_radians());
                    for size in DIAGONALS_MM {
                        let from_head = place(anchor.point, nose, turn, diagonal / size);
                        let score = judge(&grid, coarse, &from_head);
                        keep(&mut best, Guess { score, from_head }, 6);
                    }
                }
            }
            for guess in &mut best {
                guess.score = judge(&grid, fine, &guess.from_head);
            }
            best
        })
        .flatten_iter()
        .collect();
    guesses.sort_by(|a, b| a.score.total_cmp(&b.score));
    guesses.truncate(SETTLED_COUNT);
    on_step(0.5)?;
    let sparse = &points[..70.min(points.len())];
    guesses = guesses
        .par_iter()
        .map(|g| settle(&grid, sparse, fine, &g.from_head))
        .collect();
    guesses.sort_by(|a, b| a.score.total_cmp(&b.score));
    let chosen = distinct(&guesses, REFINED_COUNT, 12.0, 15.0, 1.12);

    on_step(0.7)?;
    let mut refined: Vec<Guess> = chosen
        .par_iter()
        .map(|g| refine(model, surface, grid.samples(), &points, &g.from_head, 14))
        .collect();
    refined.sort_by(|a, b| a.score.total_cmp(&b.score));
    let mut finalists: Vec<Guess> = distinct(&refined, 6, 10.0, 12.0, 1.1)
        .par_iter()
        .map(|g| {
            let further = refine(model, surface, grid.samples(), &points, &g.from_head, 25);
            if further.score < g.score { further } else { *g }
        })
        .collect();
    finalists.extend(
        distinct(&refined, FITTED_COUNT, 10.0, 12.0, 1.1)
            .into_iter()
            .skip(6),
    );
    on_step(0.85)?;
    let mut fitted: Vec<(Guess, DVector<f64>)> = finalists
        .par_iter()
        .map(|g| fit(model, surface, &spread, g))
        .collect();
    fitted.sort_by(|a, b| a.0.score.total_cmp(&b.0.score));
    let Some((best, coefficients)) = fitted.first().cloned() else {
        return Ok(None);
    };
    let rival = fitted
        .iter()
        .filter(|(g, _)| differs(&best.from_head, &g.from_head, 45.0, 25.0, 1.35))
        .map(|(g, _)| g.score)
        .fold(CUTOFF_MM, f64::min);
    Ok(Some(Alignment {
        to_head: best.from_head.inverse(),
        coefficients,
        residual_mm: best.score,
        confidence: (1.0 - best.score / rival).clamp(0.0, 1.0),
    }))
}

/// A place on the template, where it should go, the normal there, and trust; head frame.
type Pair = (Point, Point, Vector, f64);

#[derive(Debug, Clone, Copy)]
struct Guess {
    score: f64,
    /// Template millimetres to mesh units.
    from_head: Similarity3<f64>,
}

fn keep(best: &mut Vec<Guess>, guess: Guess, count: usize) {
    if best.len() == count && best[count - 1].score <= guess.score {
        return;
    }
    let at = best.partition_point(|g| g.score <= guess.score);
    best.insert(at, guess);
    best.truncate(count);
}

/// Puts the template's nose on `anchor`.
fn place(anchor: Point, nose: Point, turn: UnitQuaternion<f64>, scale: f64) -> Similarity3<f64> {
    let translation = anchor.coords - turn * nose.coords * scale;
    Similarity3::from_parts(Translation3::from(translation), turn, scale)
}

/// Mean capped distance of template samples from the mesh, plus a penalty for normals that
/// disagree. (mm)
fn judge(grid: &ClosestGrid, samples: &[Sample], from_head: &Similarity3<f64>) -> f64 {
    let scale = from_head.scaling();
    let mut sum = 0.0;
    for s in samples {
        let p = from_head.transform_point(&s.point);
        let n = from_head.isometry.rotation * s.normal;
        let near = grid.closest(&p);
        let distance = ((near.point - p).norm() / scale).min(CUTOFF_MM);
        let disagreement = (1.0 - n.dot(&near.normal)).min(1.0);
        sum += s.weight * (distance + 0.4 * CUTOFF_MM * disagreement).min(CUTOFF_MM);
    }
    sum / samples.iter().map(|s| s.weight).sum::<f64>()
}

/// A few steps of point-to-plane ICP against the grid: guesses are a voxel or two, some
/// degrees and some percent off, which hides a right one among wrong ones.
fn settle(
    grid: &ClosestGrid,
    samples: &[Sample],
    judged: &[Sample],
    start: &Similarity3<f64>,
) -> Guess {
    let mut from_head = *start;
    for _ in 0..8 {
        let to_head = from_head.inverse();
        let pairs: Vec<Pair> = samples
            .iter()
            .filter_map(|s| {
                let near = grid.closest(&from_head.transform_point(&s.point));
                let normal = to_head.isometry.rotation * near.normal;
                let q = to_head.transform_point(&near.point);
                let is_mate = normal.dot(&s.normal) > 0.2
                    && (q - s.point).norm_squared() < 2.5 * CUTOFF_MM * CUTOFF_MM;
                is_mate.then_some((s.point, q, normal, s.weight))
            })
            .collect();
        let Some(step) = similarity_step(&pairs) else {
            break;
        };
        from_head *= step;
    }
    let ratio = from_head.scaling() / start.scaling();
    if !(0.6..1.6).contains(&ratio) {
        from_head = *start;
    }
    Guess {
        score: judge(grid, judged, &from_head),
        from_head,
    }
}

/// Places that could be a nose tip: spread over the mesh, where it bulges outwards, with
/// normals averaged over a neighbourhood of a fortieth of the mesh.
fn anchors(grid: &ClosestGrid, diagonal: f64) -> Vec<Sample> {
    let samples = grid.samples();
    let spread = spread(samples, ANCHOR_COUNT * 2);
    let radius_squared = (diagonal * 0.03).powi(2);
    // A fine mesh has more samples than an average needs.
    let stride = samples.len().div_ceil(AVERAGED_COUNT).max(1);
    let averaged: Vec<&Sample> = samples.iter().step_by(stride).collect();
    let mut bulging: Vec<(f64, Sample)> = spread
        .par_iter()
        .filter_map(|anchor| {
            let mut normal = Vector::zeros();
            let mut middle = Vector::zeros();
            let mut count = 0.0;
            for s in &averaged {
                let d = s.point - anchor.point;
                if d.norm_squared() < radius_squared && s.normal.dot(&anchor.normal) > -0.3 {
                    normal += s.normal;
                    middle += d;
                    count += 1.0;
                }
            }
            let normal = normal.try_normalize(1e-9)?;
            let height = -middle.dot(&normal) / count;
            (height > 0.0).then_some((
                height,
                Sample {
                    point: anchor.point,
                    normal,
                    weight: 1.0,
                },
            ))
        })
        .collect();
    bulging.sort_by(|a, b| b.0.total_cmp(&a.0));
    bulging.truncate(ANCHOR_COUNT);
    bulging.into_iter().map(|(_, s)| s).collect()
}

/// About `count` samples spread evenly: one of each cell of a grid that has that many cells.
fn spread(samples: &[Sample], count: usize) -> Vec<Sample> {
    if samples.len() <= count {
        return samples.to_vec();
    }
    let (mut low, mut high) = (samples[0].point, samples[0].point);
    for s in samples {
        low = low.inf(&s.point);
        high = high.sup(&s.point);
    }
    let size = (high - low).amax().max(f64::MIN_POSITIVE);
    let in_cells = |divisions: f64| {
        let mut at = std::collections::BTreeMap::new();
        for (k, s) in samples.iter().enumerate() {
            let key = [0, 1, 2].map(|c| ((s.point[c] - low[c]) / size * divisions) as u32);
            at.entry(key).or_insert(k);
        }
        at
    };
    let mut divisions = 4.0;
    let mut cells = in_cells(divisions);
    while cells.len() < count && divisions < 200.0 {
        divisions *= 1.25;
        cells = in_cells(divisions);
    }
    cells.into_values().map(|k| samples[k]).collect()
}

/// The best guesses that differ from each other.
fn distinct(
    sorted: &[Guess],
    count: usize,
    angle_degrees: f64,
    distance_mm: f64,
    scale_ratio: f64,
) -> Vec<Guess> {
    let mut chosen: Vec<Guess> = Vec::new();
    for g in sorted {
        if chosen.iter().all(|c| {
            differs(
                &c.from_head,
                &g.from_head,
                angle_degrees,
                distance_mm,
                scale_ratio,
            )
        }) {
            chosen.push(*g);
            if chosen.len() == count {
                break;
            }
        }
    }
    chosen
}

fn differs(
    a: &Similarity3<f64>,
    b: &Similarity3<f64>,
    angle_degrees: f64,
    distance_mm: f64,
    scale_ratio: f64,
) -> bool {
    let angle = a
        .isometry
        .rotation
        .angle_to(&b.isometry.rotation)
        .to_degrees();
    let ratio = (a.scaling() / b.scaling()).max(b.scaling() / a.scaling());
    // Compared at the middle of the face, where both place it best.
    let middle = Point::new(0.0, 0.0, 20.0);
    let apart = (a.transform_point(&middle) - b.transform_point(&middle)).norm()
        / a.scaling().min(b.scaling());
    angle > angle_degrees || ratio > scale_ratio || apart > distance_mm
}

/// Trimmed point-to-plane ICP with scale, from the template to the mesh and back.
fn refine(
    model: &FaceModel<'_>,
    surface: &Surface,
    mesh_samples: &[Sample],
    points: &[Sample],
    start: &Similarity3<f64>,
    rounds: usize,
) -> Guess {
    let stride = (mesh_samples.len() / 1500).max(1);
    let mut from_head = *start;
    for round in 0..rounds {
        let scale = from_head.scaling();
        let to_head = from_head.inverse();
        let reach = if round < rounds / 2 { 25.0 } else { 12.0 };
        let mut pairs: Vec<Pair> = Vec::new();
        for s in points {
            let p = from_head.transform_point(&s.point);
            let n = from_head.isometry.rotation * s.normal;
            let found = surface.closest_where(&p, reach * scale, |at| {
                facing(surface, at.triangle, &n) > 0.4
            });
            if let Some(at) = found {
                let normal = to_head.isometry.rotation * unit_normal(surface, at.triangle);
                pairs.push((
                    s.point,
                    to_head.transform_point(&at.point),
                    normal,
                    s.weight,
                ));
            }
        }
        for s in mesh_samples.iter().step_by(stride) {
            let q = to_head.transform_point(&s.point);
            let n = to_head.isometry.rotation * s.normal;
            if let Some(p) = model.closest_on_face(&q, reach * 0.6, &n) {
                pairs.push((p, q, n, 0.4));
            }
        }
        let Some(step) = similarity_step(&pairs) else {
            break;
        };
        from_head *= step;
        // A template blown up or shrunk beyond reason has run away.
        let ratio = from_head.scaling() / start.scaling();
        if !(0.5..2.0).contains(&ratio) {
            return Guess {
                score: CUTOFF_MM,
                from_head: *start,
            };
        }
    }
    Guess {
        score: score(surface, points, &from_head),
        from_head,
    }
}

/// A guess whose template is shaped like a person, judged by that shape, and the shape's
/// coefficients.
fn fit(
    model: &FaceModel<'_>,
    surface: &Surface,
    spread: &[(u32, f64)],
    guess: &Guess,
) -> (Guess, DVector<f64>) {
    let unshaped = (*guess, DVector::zeros(0));
    let from_head = guess.from_head;
    let to_head = from_head.inverse();
    let closest = |p: &Point, n: &Vector, reach: f64| {
        let n = from_head.isometry.rotation * n;
        let at = surface.closest_where(
            &from_head.transform_point(p),
            reach * from_head.scaling(),
            |at| facing(surface, at.triangle, &n) > 0.3,
        )?;
        let normal = to_head.isometry.rotation * unit_normal(surface, at.triangle);
        Some((to_head.transform_point(&at.point), normal))
    };
    let Ok(shaped) = fit_identity(
        model,
        &Attraction {
            vertices: spread,
            closest: &closest,
            pulled: &|_, _, _, _| Vec::new(),
            pins: &[],
        },
        &IdentityFit::template(),
        &FITTING,
        &mut |_| Ok(()),
    ) else {
        return unshaped;
    };
    let ratio = shaped.similarity.scaling();
    if !(0.6..1.6).contains(&ratio) {
        return unshaped;
    }
    // Back where the similarity takes them from.
    let own = shaped.similarity.inverse();
    let samples: Vec<Sample> = spread
        .iter()
        .map(|&(v, weight)| Sample {
            point: own.transform_point(&shaped.vertex(model, v as usize)),
            normal: model.normals[v as usize],
            weight,
        })
        .collect();
    let placed = from_head * shaped.similarity;
    let score =
        score(surface, &samples, &placed) + UNLIKELY_MM * shaped.coefficients.norm_squared();
    if score < guess.score {
        let from_head = placed;
        (Guess { score, from_head }, shaped.coefficients)
    } else {
        unshaped
    }
}

/// Mean capped distance, exact, with the penalty for normals of [`judge`]. (mm)
fn score(surface: &Surface, points: &[Sample], from_head: &Similarity3<f64>) -> f64 {
    let scale = from_head.scaling();
    let sum: f64 = points
        .iter()
        .map(|s| {
            let p = from_head.transform_point(&s.point);
            let n = from_head.isometry.rotation * s.normal;
            let Some(at) = surface.closest_where(&p, CUTOFF_MM * scale, |_| true) else {
                return s.weight * CUTOFF_MM;
            };
            let disagreement = (1.0 - facing(surface, at.triangle, &n)).min(1.0);
            s.weight * (at.distance / scale + 0.4 * CUTOFF_MM * disagreement).min(CUTOFF_MM)
        })
        .sum();
    sum / points.iter().map(|s| s.weight).sum::<f64>()
}

fn unit_normal(surface: &Surface, triangle: u32) -> Vector {
    let [a, b, c] = surface.corners(triangle);
    (b - a)
        .cross(&(c - a))
        .try_normalize(0.0)
        .unwrap_or_else(Vector::zeros)
}

fn facing(surface: &Surface, triangle: u32, normal: &Vector) -> f64 {
    unit_normal(surface, triangle).dot(normal)
}

/// One Gauss-Newton step of point-to-plane distances (with a tenth of point-to-point, which
/// keeps flat parts from sliding), robust by Geman-McClure weights at the median.
fn similarity_step(pairs: &[Pair]) -> Option<Similarity3<f64>> {
    if pairs.len() < 30 {
        return None;
    }
    let mut distances: Vec<f64> = pairs.iter().map(|(p, q, ..)| (q - p).norm()).collect();
    let middle = distances.len() / 2;
    let (_, median, _) = distances.select_nth_unstable_by(middle, f64::total_cmp);
    let sigma_squared = (2.0 * *median).max(0.5).powi(2);
    let mut a = SMatrix::<f64, 7, 7>::zeros();
    let mut b = SVector::<f64, 7>::zeros();
    for (p, q, n, trust) in pairs {
        let d = q - p;
        let w = trust * (sigma_squared / (sigma_squared + d.norm_squared())).powi(2);
        // x -> x + t + omega x p + s p, rotation and scale per 100 mm to balance the system.
        let arm = p.coords / 100.0;
        let mut add = |direction: &Vector, weight: f64| {
            let moment = arm.cross(direction);
            let row = SVector::<f64, 7>::from([
                direction.x,
                direction.y,
                direction.z,
                moment.x,
                moment.y,
                moment.z,
                arm.dot(direction),
            ]);
            a += row * row.transpose() * weight;
            b += row * (d.dot(direction) * weight);
        };
        add(n, w);
        for axis in [Vector::x(), Vector::y(), Vector::z()] {
            add(&axis, 0.05 * w);
        }
    }
    let x = a.cholesky()?.solve(&b);
    let turn = Vector::new(x[3], x[4], x[5]) / 100.0;
    let rotation = Unit::try_new_and_get(turn, 1e-12)
        .map_or_else(UnitQuaternion::identity, |(axis, angle)| {
            UnitQuaternion::from_axis_angle(&axis, angle)
        });
    let scale = (1.0 + x[6] / 100.0).clamp(0.8, 1.25);
    Some(Similarity3::from_parts(
        Translation3::new(x[0], x[1], x[2]),
        rotation,
        scale,
    ))
}
