//! The template shaped like the face by what is known of how people differ.
//!
//! With S a similarity, b_v the template's vertices, m_kv the modes and c their coefficients, the
//! shape x_v = S(b_v + sum_k c_k m_kv) is fitted to closest places q_v with normals n_v:
//!
//! ```text
//! E = sum_v w_v ( (n_v . (q_v - x_v))^2 + t |q_v - x_v|^2 ) / sigma^2 + |c|^2
//! ```
//!
//! Places mostly bind along their normals: where along the surface a vertex belongs is left to
//! what people are like. What sigma allows falls from round to round.
//!
//! Source: Blanz & Vetter 1999, A Morphable Model for the Synthesis of 3D Faces; plane distances
//! after Chen & Medioni 1992.

use nalgebra::{DMatrix, DVector, Matrix3, Similarity3, Translation3, Unit, UnitQuaternion};
use rayon::prelude::*;

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
const TANGENTIAL: f64 = 0.03;

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

/// A fitted shape.
#[derive(Debug, Clone)]
pub(super) struct IdentityFit {
    /// From the template's frame to the head frame it is fitted in.
    pub(super) similarity: Similarity3<f64>,
    /// Standard deviations of each mode.
    pub(super) coefficients: DVector<f64>,
}

impl IdentityFit {
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

/// Fits the shape at `vertices` (weighted) to what `closest` finds.
///
/// - `pulled`: further places found from the face's side, given the fit so far
/// - `pins`: places that are known whatever is closest
pub(super) fn fit_identity(
    model: &FaceModel<'_>,
    vertices: &[(u32, f64)],
    closest: &Closest<'_>,
    pulled: &dyn Fn(&IdentityFit, f64) -> Vec<Pulled>,
    pins: &[Pin],
    start: Similarity3<f64>,
    fitting: &Fitting,
) -> IdentityFit {
    let mode_count = fitting.mode_count.min(model.template.identity_modes.len());
    let mut fit = IdentityFit {
        similarity: start,
        coefficients: DVector::zeros(mode_count),
    };
    for round in 0..fitting.rounds {
        let share = round as f64 / (fitting.rounds.max(2) - 1) as f64;
        let between = |[a, b]: [f64; 2]| a * (b / a).powf(share);
        let (sigma, reach) = (between(fitting.sigma), between(fitting.reach));
        let mut places: Vec<Pulled> = vertices
            .par_iter()
            .filter_map(|&(v, weight)| {
                let at = fit.vertex(model, v as usize);
                let n = fit.similarity.isometry.rotation * model.normals[v as usize];
                let (place, normal) = closest(&at, &n, reach)?;
                Some(Pulled {
                    corners: [(v, 1.0), (v, 0.0), (v, 0.0)],
                    place,
                    normal,
                    weight,
                })
            })
            .collect();
        places.extend(pulled(&fit, reach));
        if places.len() < 30 {
            break;
        }
        let distances: Vec<f64> = places
            .iter()
            .map(|p| (p.place - now(model, &fit, &p.corners)).norm())
            .collect();
        let (median, _) = median_and_deviation(&distances);
        // What no person's shape explains is no reason to make an unlikely one.
        let mut off: Vec<f64> = places
            .iter()
            .map(|p| {
                (p.place - now(model, &fit, &p.corners))
                    .dot(&p.normal)
                    .abs()
            })
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
        let mut system = System::new(mode_count);
        for p in &places {
            let metric = p.normal * p.normal.transpose() + Matrix3::identity() * TANGENTIAL;
            system.add(
                model,
                &fit,
                &p.corners,
                &p.place,
                &(metric * (p.weight * unit)),
            );
        }
        let pin_unit = PIN_COUNT / (sigma * sigma);
        for pin in pins {
            let metric = Matrix3::identity() * pin_unit;
            system.add(model, &fit, &pin.corners, &pin.place, &metric);
        }
        if !system.step(&mut fit) {
            break;
        }
    }
    fit
}

fn now(model: &FaceModel<'_>, fit: &IdentityFit, corners: &[(u32, f64); 3]) -> Point {
    let sum: Vector = corners
        .iter()
        .filter(|(_, share)| *share != 0.0)
        .map(|&(v, share)| fit.vertex(model, v as usize).coords * share)
        .sum();
    Point::from(sum)
}

/// Normal equations in the coefficients (whole) and a small similarity (increment).
struct System {
    mode_count: usize,
    a: DMatrix<f64>,
    b: DVector<f64>,
    /// Rows of the Jacobian, one vector of millimetres for each unknown.
    columns: Vec<Vector>,
    weighted: Vec<Vector>,
}

impl System {
    fn new(mode_count: usize) -> Self {
        let size = mode_count + 7;
        Self {
            mode_count,
            a: DMatrix::zeros(size, size),
            b: DVector::zeros(size),
            columns: vec![Vector::zeros(); size],
            weighted: vec![Vector::zeros(); size],
        }
    }

    fn add(
        &mut self,
        model: &FaceModel<'_>,
        fit: &IdentityFit,
        corners: &[(u32, f64); 3],
        place: &Point,
        metric: &Matrix3<f64>,
    ) {
        let blend = |of: &dyn Fn(usize) -> Vector| -> Vector {
            corners
                .iter()
                .filter(|(_, share)| *share != 0.0)
                .map(|&(v, share)| of(v as usize) * share)
                .sum()
        };
        let base = Point::from(blend(&|v| model.positions()[v].coords));
        let turn = fit.similarity.isometry.rotation;
        let scale = fit.similarity.scaling();
        let mut moved = Vector::zeros();
        for (k, mode) in model.template.identity_modes[..self.mode_count]
            .iter()
            .enumerate()
        {
            let m = turn * blend(&|v| mode[v]) * scale;
            moved += m * fit.coefficients[k];
            self.columns[k] = m;
        }
        let mean = fit.similarity.transform_point(&base);
        let at = mean + moved;
        let arm = at.coords / 100.0;
        let axes = [Vector::x(), Vector::y(), Vector::z()];
        for (k, axis) in axes.iter().enumerate() {
            self.columns[self.mode_count + k] = *axis;
            self.columns[self.mode_count + 3 + k] = axis.cross(&arm);
        }
        self.columns[self.mode_count + 6] = arm;
        let residual = place - mean;
        for (w, c) in self.weighted.iter_mut().zip(&self.columns) {
            *w = metric * c;
        }
        for (i, c) in self.columns.iter().enumerate() {
            self.b[i] += self.weighted[i].dot(&residual);
            // Lower triangle, down the column.
            let mut column = self.a.column_mut(i);
            for (j, w) in self.weighted.iter().enumerate().skip(i) {
                column[j] += w.dot(c);
            }
        }
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

/// Rounds of the whole face; see [`shape_to`].
const WHOLE: Fitting = Fitting {
    mode_count: 60,
    rounds: 16,
    sigma: [3.0, 0.5],
    reach: [22.0, 8.0],
};
/// Vertices of the face that pull on the shape, at most.
const PULLING_COUNT: usize = 1500;

/// The template shaped like `target`, about where it stands in the head frame; see the module.
///
/// - `pins`: places that are known
pub(super) fn shape_to(model: &FaceModel<'_>, target: &Target, pins: &[Pin]) -> Vec<Point> {
    let areas = vertex_areas(model.positions(), &model.triangles);
    let mean = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
    // Lips and lids have many small triangles and tell more than their area.
    let vertices: Vec<(u32, f64)> = model
        .face_vertices()
        .map(|v| (v, (areas[v as usize] / mean).sqrt()))
        .collect();
    let closest = |p: &Point, n: &Vector, reach: f64| {
        let m = target.matching(p, n, reach, 0.5)?;
        let normal = target.surface.blend(&m.place, &target.normals);
        (!m.is_on_boundary).then_some((m.place.point, normal.try_normalize(0.0)?))
    };
    let pulled = |fit: &IdentityFit, reach: f64| pulled_by(model, target, fit, 0.5 * reach);
    fit_identity(
        model,
        &vertices,
        &closest,
        &pulled,
        pins,
        Similarity3::identity(),
        &WHOLE,
    )
    .vertices(model)
}

/// Vertices of the target with their closest places on the shape.
fn pulled_by(model: &FaceModel<'_>, target: &Target, fit: &IdentityFit, reach: f64) -> Vec<Pulled> {
    let vertices = fit.vertices(model);
    let Ok(surface) = Surface::new(&vertices, &model.triangles) else {
        return Vec::new();
    };
    let normals = vertex_normals(&vertices, &model.triangles);
    let stride = (target.positions.len() / PULLING_COUNT).max(1);
    let all: Vec<usize> = (0..target.positions.len()).step_by(stride).collect();
    let found: Vec<Pulled> = all
        .par_iter()
        .filter_map(|&v| {
            let (p, n) = (target.positions[v], target.normals[v]);
            let at =
                surface.closest_where(&p, reach, |at| surface.blend(at, &normals).dot(&n) > 0.5)?;
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
    let own: f64 = model.face_vertices().count() as f64;
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
            coefficients: DVector::from_fn(12, |k, _| if k % 2 == 0 { 1.0 } else { -0.7 }),
        };
        let places = truth.vertices(&model);
        let surface = Surface::new(&places, &model.triangles).expect("surface");
        let normals = crate::mesh::vertex_normals(&places, &model.triangles);
        let vertices: Vec<(u32, f64)> = model.face_vertices().map(|v| (v, 1.0)).collect();
        let fit = fit_identity(
            &model,
            &vertices,
            &|p, n, reach| {
                let at = surface
                    .closest_where(p, reach, |at| surface.blend(at, &normals).dot(n) > 0.3)?;
                Some((at.point, surface.blend(&at, &normals).normalize()))
            },
            &|_, _| Vec::new(),
            &[],
            Similarity3::identity(),
            &Fitting {
                mode_count: 12,
                rounds: 20,
                sigma: [3.0, 0.3],
                reach: [20.0, 6.0],
            },
        );
        let mut off: Vec<f64> = vertices
            .iter()
            .map(|&(v, _)| (fit.vertex(&model, v as usize) - places[v as usize]).norm())
            .collect();
        off.sort_by(f64::total_cmp);
        assert!(
            off[off.len() * 19 / 20] < 0.6,
            "{}",
            off[off.len() * 19 / 20]
        );
    }
}
