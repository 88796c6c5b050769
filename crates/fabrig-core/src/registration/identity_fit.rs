//! The template shaped like the face by what is known of how people differ.
//!
//! With S a similarity, b_v the template's vertices, m_kv the modes and c their coefficients, the
//! shape x_v = S(b_v + sum_k c_k m_kv) is fitted to closest places q_v with normals n_v:
//!
//! ```text
//! E = sum_v w_v ( (n_v . (q_v - x_v))^2 + t |q_v - x_v|^2 ) / sigma^2 + |c|^2
//! ```
//!
//! Over the whole face q_v is the place most alike in place and in normal: the closest one says
//! nothing of where along the surface a vertex belongs. What sigma allows falls from round to
//! round.
//!
//! Source: Blanz & Vetter 1999, A Morphable Model for the Synthesis of 3D Faces; plane distances
//! after Chen & Medioni 1992.

use nalgebra::{DMatrix, DVector, Similarity3, Translation3, Unit, UnitQuaternion};
use rayon::prelude::*;

use super::RegistrationError;
use super::face_model::{FaceModel, Role};
use super::nonrigid_icp::Pin;
use super::target::{Target, geman_mcclure, median_and_deviation};
use crate::mesh::{Surface, vertex_areas, vertex_normals};
use crate::{Point, Vector};

/// What many correlated places tell is worth this many independent ones.
const INDEPENDENT_COUNT: f64 = 40.0;
/// A pin is worth this many.
const PIN_COUNT: f64 = 3.0;
/// Share of distances along the surface.
const TANGENTIAL: f64 = 1.0;
/// One of so many places takes part in a thinned round, another one each round.
const THINNED_STRIDE: usize = 4;
/// Places whose equations are set up together.
const BLOCK: usize = 48;

/// How closely, and with what, a shape is fitted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fitting {
    /// Modes that take part, at most.
    pub(super) mode_count: usize,
    /// Rounds of closest places.
    pub(super) rounds: usize,
    /// Sigma of the first and of the last round. (mm)
    pub(super) sigma: [f64; 2],
    /// How far closest places may be in the first and in the last round. (mm)
    pub(super) reach: [f64; 2],
    /// Whether normals are those of the shape so far, or the template's own.
    pub(super) has_own_normals: bool,
    /// Share of the rounds, from the first, in which a part of the places will do.
    pub(super) thinned_share: f64,
}

/// Something to fit to, in the head frame: closest place to (point, normal) within a reach.
pub(super) type Closest<'a> = dyn Fn(&Point, &Vector, f64) -> Option<(Point, Vector)> + Sync + 'a;

/// A place of the template on the face, found from the face's side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pulled {
    pub(super) corners: [(u32, f64); 3],
    pub(super) place: Point,
    pub(super) normal: Vector,
    pub(super) weight: f64,
}

/// What pulls on a shape with these vertices and normals, within a reach.
/// Of its candidates those take part whose number passes.
pub(super) type Pulling<'a> =
    dyn Fn(&[Point], &[Vector], f64, &(dyn Fn(usize) -> bool + Sync)) -> Vec<Pulled> + 'a;

/// A fitted shape.
#[derive(Debug, Clone)]
pub(super) struct IdentityFit {
    /// From the template's frame to the head frame it is fitted in.
    pub(super) similarity: Similarity3<f64>,
    /// Standard deviations of each mode.
    pub(super) coefficients: DVector<f64>,
}

impl IdentityFit {
    /// The template as it is.
    pub(super) fn template() -> Self {
        Self {
            similarity: Similarity3::identity(),
            coefficients: DVector::zeros(0),
        }
    }

    /// A vertex of the shape.
    pub(super) fn vertex(&self, model: &FaceModel<'_>, v: usize) -> Point {
        let mut p = model.positions()[v];
        for (c, mode) in self.coefficients.iter().zip(&model.template.identity_modes) {
            p += mode[v] * *c;
        }
        self.similarity.transform_point(&p)
    }

    /// The whole shape.
    pub(super) fn vertices(&self, model: &FaceModel<'_>) -> Vec<Point> {
        (0..model.positions().len())
            .into_par_iter()
            .map(|v| self.vertex(model, v))
            .collect()
    }
}

/// What a shape is fitted to.
pub(super) struct Attraction<'a> {
    /// Vertices that look for a place, weighted.
    pub(super) vertices: &'a [(u32, f64)],
    /// What they find.
    pub(super) closest: &'a Closest<'a>,
    /// Further places found from the face's side; asked where [`Fitting::has_own_normals`].
    pub(super) pulled: &'a Pulling<'a>,
    /// Places that are known whatever is closest.
    pub(super) pins: &'a [Pin],
}

/// Fits the shape to what attracts it, from `start`.
///
/// - `on_round`: told the share that is done; its error ends the fit
pub(super) fn fit_identity(
    model: &FaceModel<'_>,
    attraction: &Attraction<'_>,
    start: &IdentityFit,
    fitting: &Fitting,
    on_round: &mut dyn FnMut(f64) -> Result<(), RegistrationError>,
) -> Result<IdentityFit, RegistrationError> {
    let Attraction {
        vertices,
        closest,
        pulled,
        pins,
    } = attraction;
    let mode_count = fitting.mode_count.min(model.template.identity_modes.len());
    let mut fit = IdentityFit {
        similarity: start.similarity,
        coefficients: start
            .coefficients
            .clone()
            .resize_vertically(mode_count, 0.0),
    };
    for round in 0..fitting.rounds {
        on_round(round as f64 / fitting.rounds as f64)?;
        let share = round as f64 / (fitting.rounds.max(2) - 1) as f64;
        let between = |[a, b]: [f64; 2]| a * (b / a).powf(share);
        let (sigma, reach) = (between(fitting.sigma), between(fitting.reach));
        let shape = fitting.has_own_normals.then(|| {
            let shape = fit.vertices(model);
            let normals = vertex_normals(&shape, &model.triangles);
            (shape, normals)
        });
        // On the way, a part of the places each time.
        let stride = if share < fitting.thinned_share {
            THINNED_STRIDE
        } else {
            1
        };
        let takes_part = |k: usize| k % stride == round % stride;
        let mut places: Vec<Pulled> = vertices
            .par_iter()
            .enumerate()
            .filter(|(k, _)| takes_part(*k))
            .filter_map(|(_, &(v, weight))| {
                let (at, n) = match &shape {
                    Some((shape, normals)) => (shape[v as usize], normals[v as usize]),
                    None => (
                        fit.vertex(model, v as usize),
                        fit.similarity.isometry.rotation * model.normals[v as usize],
                    ),
                };
                let (place, normal) = closest(&at, &n, reach)?;
                Some(Pulled {
                    corners: [(v, 1.0), (v, 0.0), (v, 0.0)],
                    place,
                    normal,
                    weight,
                })
            })
            .collect();
        if let Some((shape, normals)) = &shape {
            places.extend(pulled(shape, normals, reach, &takes_part));
        }
        if places.len() < 30 {
            break;
        }
        let gaps: Vec<Vector> = places
            .iter()
            .map(|p| p.place - now(model, &fit, shape.as_ref().map(|s| &s.0[..]), &p.corners))
            .collect();
        let distances: Vec<f64> = gaps.iter().map(Vector::norm).collect();
        let (median, _) = median_and_deviation(&distances);
        // What no person's shape explains is no reason to make an unlikely one.
        let mut off: Vec<f64> = places
            .iter()
            .zip(&gaps)
            .map(|(p, gap)| gap.dot(&p.normal).abs())
            .collect();
        let middle = off.len() / 2;
        let spread = 1.4826 * *off.select_nth_unstable_by(middle, f64::total_cmp).1;
        let sigma = sigma.max(spread);
        let robust = (3.0 * median).max(2.0 * sigma);
        let mut sum = 0.0;
        for (p, d) in places.iter_mut().zip(&distances) {
            p.weight *= geman_mcclure(*d, robust);
            sum += p.weight;
        }
        let unit = INDEPENDENT_COUNT / (sum.max(1e-9) * sigma * sigma);
        let mut bonds: Vec<Bond> = places
            .iter()
            .map(|p| Bond {
                corners: p.corners,
                place: p.place,
                normal: p.normal,
                across: p.weight * unit * (1.0 + TANGENTIAL),
                along: p.weight * unit * TANGENTIAL,
            })
            .collect();
        let pin_unit = PIN_COUNT / (sigma * sigma);
        bonds.extend(pins.iter().map(|pin| Bond {
            corners: pin.corners,
            place: pin.place,
            normal: Vector::z(),
            across: pin_unit,
            along: pin_unit,
        }));
        let system = System::new(model, &fit, &bonds);
        if !system.step(&mut fit) {
            break;
        }
    }
    Ok(fit)
}

/// Where the corners' place is, by the whole shape where that is known.
fn now(
    model: &FaceModel<'_>,
    fit: &IdentityFit,
    shape: Option<&[Point]>,
    corners: &[(u32, f64); 3],
) -> Point {
    let sum: Vector = corners
        .iter()
        .filter(|(_, share)| *share != 0.0)
        .map(|&(v, share)| {
            let at = shape.map_or_else(|| fit.vertex(model, v as usize), |s| s[v as usize]);
            at.coords * share
        })
        .sum();
    Point::from(sum)
}

/// A place that draws a place of the template.
struct Bond {
    corners: [(u32, f64); 3],
    place: Point,
    normal: Vector,
    /// How strongly along the normal.
    across: f64,
    /// How strongly along the surface.
    along: f64,
}

/// Normal equations in the coefficients (whole) and a small similarity (increment).
struct System {
    mode_count: usize,
    a: DMatrix<f64>,
    b: DVector<f64>,
}

impl System {
    fn new(model: &FaceModel<'_>, fit: &IdentityFit, bonds: &[Bond]) -> Self {
        let mode_count = fit.coefficients.len();
        let size = mode_count + 7;
        let blocks: Vec<(DMatrix<f64>, DVector<f64>)> = bonds
            .par_chunks(BLOCK)
            .map(|bonds| {
                // A column for each equation.
                let mut rows = DMatrix::zeros(size, 3 * bonds.len());
                let mut residuals = DVector::zeros(3 * bonds.len());
                let mut changes = vec![Vector::zeros(); size];
                for (k, bond) in bonds.iter().enumerate() {
                    let residual = changes_at(model, fit, bond, &mut changes);
                    let [t, b] = tangents(&bond.normal);
                    let directions = [(bond.normal, bond.across), (t, bond.along), (b, bond.along)];
                    for (i, (direction, weight)) in directions.into_iter().enumerate() {
                        let direction = direction * weight.sqrt();
                        residuals[3 * k + i] = residual.dot(&direction);
                        for (r, change) in rows.column_mut(3 * k + i).iter_mut().zip(&changes) {
                            *r = change.dot(&direction);
                        }
                    }
                }
                (&rows * rows.transpose(), rows * residuals)
            })
            .collect();
        let mut a = DMatrix::zeros(size, size);
        let mut b = DVector::zeros(size);
        for (own_a, own_b) in blocks {
            a += own_a;
            b += own_b;
        }
        Self { mode_count, a, b }
    }

    /// Solves with the prior and applies the step; `false` where nothing is determined.
    fn step(mut self, fit: &mut IdentityFit) -> bool {
        for k in 0..self.mode_count {
            self.a[(k, k)] += 1.0;
        }
        for k in self.mode_count..self.mode_count + 7 {
            self.a[(k, k)] += 1e-9;
        }
        let Some(factor) = self.a.cholesky() else {
            return false;
        };
        let x = factor.solve(&self.b);
        fit.coefficients.copy_from(&x.rows(0, self.mode_count));
        let s = &x.as_slice()[self.mode_count..];
        let turn = Vector::new(s[3], s[4], s[5]) / 100.0;
        let rotation = Unit::try_new_and_get(turn, 1e-12)
            .map_or_else(UnitQuaternion::identity, |(axis, angle)| {
                UnitQuaternion::from_axis_angle(&axis, angle)
            });
        let scale = (1.0 + s[6] / 100.0).clamp(0.8, 1.25);
        let step = Similarity3::from_parts(Translation3::new(s[0], s[1], s[2]), rotation, scale);
        fit.similarity = step * fit.similarity;
        true
    }
}

/// How a place moves with each unknown; returns what it lacks with all coefficients at zero.
fn changes_at(
    model: &FaceModel<'_>,
    fit: &IdentityFit,
    bond: &Bond,
    changes: &mut [Vector],
) -> Vector {
    let blend = |of: &dyn Fn(usize) -> Vector| -> Vector {
        bond.corners
            .iter()
            .filter(|(_, share)| *share != 0.0)
            .map(|&(v, share)| of(v as usize) * share)
            .sum()
    };
    let base = Point::from(blend(&|v| model.positions()[v].coords));
    let to_head = fit
        .similarity
        .isometry
        .rotation
        .to_rotation_matrix()
        .into_inner()
        * fit.similarity.scaling();
    let mode_count = fit.coefficients.len();
    let mut moved = Vector::zeros();
    for (k, mode) in model.template.identity_modes[..mode_count]
        .iter()
        .enumerate()
    {
        let m = to_head * blend(&|v| mode[v]);
        moved += m * fit.coefficients[k];
        changes[k] = m;
    }
    let mean = fit.similarity.transform_point(&base);
    let arm = (mean + moved).coords / 100.0;
    let axes = [Vector::x(), Vector::y(), Vector::z()];
    for (k, axis) in axes.iter().enumerate() {
        changes[mode_count + k] = *axis;
        changes[mode_count + 3 + k] = axis.cross(&arm);
    }
    changes[mode_count + 6] = arm;
    bond.place - mean
}

/// Two directions at right angles to `normal` and to each other.
fn tangents(normal: &Vector) -> [Vector; 2] {
    let mut axis = Vector::zeros();
    axis[normal.iamin()] = 1.0;
    let t = normal.cross(&axis).normalize();
    [t, normal.cross(&t)]
}

/// Rounds of the whole face; see [`shape_to`].
const WHOLE: Fitting = Fitting {
    mode_count: usize::MAX,
    rounds: 60,
    sigma: [6.0, 0.7],
    reach: [22.0, 8.0],
    has_own_normals: true,
    thinned_share: 0.85,
};
/// What a difference of one between normals is worth. (mm)
const NORMAL_MM: f64 = 15.0;
/// Vertices of the face that pull on the shape, at most.
const PULLING_COUNT: usize = 1500;

/// The template shaped like `target`, about where it stands in the head frame; see the module.
///
/// - `pins`: places that are known
/// - `likely`: coefficients to start from
pub(super) fn shape_to(
    model: &FaceModel<'_>,
    target: &Target,
    pins: &[Pin],
    likely: &DVector<f64>,
    on_round: &mut dyn FnMut(f64) -> Result<(), RegistrationError>,
) -> Result<Vec<Point>, RegistrationError> {
    let areas = vertex_areas(model.positions(), &model.triangles);
    let mean = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
    // Lips and lids have many small triangles and tell more than their area.
    let vertices: Vec<(u32, f64)> = model
        .face_vertices()
        .map(|v| (v, (areas[v as usize] / mean).sqrt()))
        .collect();
    let closest = |p: &Point, n: &Vector, reach: f64| {
        let m = target.matching(p, n, reach, 0.5)?;
        if m.is_on_boundary {
            return None;
        }
        let (place, normal) = target.most_alike(p, n, m.place.triangle, NORMAL_MM);
        Some((place, normal.try_normalize(0.0)?))
    };
    let pulled = |shape: &[Point],
                  normals: &[Vector],
                  reach: f64,
                  takes_part: &(dyn Fn(usize) -> bool + Sync)| {
        pulled_by(model, target, (shape, normals), 0.5 * reach, takes_part)
    };
    let fit = fit_identity(
        model,
        &Attraction {
            vertices: &vertices,
            closest: &closest,
            pulled: &pulled,
            pins,
        },
        &IdentityFit {
            similarity: Similarity3::identity(),
            coefficients: likely.clone(),
        },
        &WHOLE,
        on_round,
    )?;
    Ok(fit.vertices(model))
}

/// Vertices of the target with their closest places on the shape.
fn pulled_by(
    model: &FaceModel<'_>,
    target: &Target,
    (shape, normals): (&[Point], &[Vector]),
    reach: f64,
    takes_part: &(dyn Fn(usize) -> bool + Sync),
) -> Vec<Pulled> {
    let Ok(surface) = Surface::new(shape, &model.triangles) else {
        return Vec::new();
    };
    let stride = (target.positions.len() / PULLING_COUNT).max(1);
    let all: Vec<usize> = (0..target.positions.len())
        .step_by(stride)
        .enumerate()
        .filter(|(k, _)| takes_part(*k))
        .map(|(_, v)| v)
        .collect();
    let found: Vec<Pulled> = all
        .par_iter()
        .filter_map(|&v| {
            let (p, n) = (target.positions[v], target.normals[v]);
            let at =
                surface.closest_where(&p, reach, |at| surface.blend(at, normals).dot(&n) > 0.5)?;
            let corners = model.triangles[at.triangle as usize];
            (model.triangle_roles[at.triangle as usize] == Role::Face).then_some(Pulled {
                corners: [0, 1, 2].map(|k| (corners[k], at.barycentric[k])),
                place: p,
                normal: n,
                weight: 1.0,
            })
        })
        .collect();
    // All together weigh half of what the template's own vertices do.
    let own = model
        .face_vertices()
        .enumerate()
        .filter(|(k, _)| takes_part(*k))
        .count() as f64;
    let weight = 0.5 * own / found.len().max(1) as f64;
    found.into_iter().map(|p| Pulled { weight, ..p }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template::human;

    #[test]
    fn a_shape_of_the_modes_comes_back_from_its_surface() {
        let template = human();
        let model = FaceModel::new(template).expect("model");
        let truth = IdentityFit {
            similarity: Similarity3::new(
                Vector::new(1.0, -2.0, 1.5),
                Vector::new(0.03, 0.0, 0.02),
                1.02,
            ),
            coefficients: DVector::from_fn(12, |k, _| if k % 2 == 0 { 0.5 } else { -0.35 }),
        };
        let places = truth.vertices(&model);
        let target = Target::new(places.clone(), model.triangles.clone()).expect("target");
        let found =
            shape_to(&model, &target, &[], &DVector::zeros(0), &mut |_| Ok(())).expect("a fit");
        let mut off: Vec<f64> = model
            .face_vertices()
            .map(|v| (found[v as usize] - places[v as usize]).norm())
            .collect();
        off.sort_by(f64::total_cmp);
        assert!(
            off[off.len() * 19 / 20] < 0.6,
            "{}",
            off[off.len() * 19 / 20]
        );
    }
}
