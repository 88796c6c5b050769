//! Thin-plate refinement at the template's full resolution.
//!
//! A displacement d of every vertex from the coarse result x minimizes
//!
//! ```text
//! E = sum_i w_i A_i |x_i + d_i - u_i|^2 + sum_k w_k A_k |sum_c b_c (x_c + d_c) - q_k|^2
//!   + l^4 d' L M^-1 L d + (l/8)^2 d' L d
//! ```
//!
//! with A the areas, u_i the face's closest place to vertex i, q_k vertices of the face and b
//! their closest places on the template (of both, what the surface is across: along it they are
//! where the coarse result has them), L the cotangent Laplacian and M its lumped mass. The
//! length l falls from round to round: what is finer than l stays as the template has it.
//! Vertices without a counterpart follow by the last two terms alone.
//!
//! Source: Botsch & Sorkine 2008, On Linear Variational Surface Deformation Methods, section 4
//! (thin-plate and membrane energies).

use rayon::prelude::*;

use super::RegistrationError;
use super::face_model::{FaceModel, Role};
use super::nonrigid_icp::Pin;
use super::sparse::SpdSystem;
use super::target::{Target, geman_mcclure, median_and_deviation};
use crate::mesh::{EdgeLaplacian, Surface, vertex_areas, vertex_normals};
use crate::{Point, Vector};

/// Length l (mm) and largest angle between normals (degrees) of each round.
const ROUNDS: [(f64, f64); 12] = [
    (16.0, 55.0),
    (12.0, 55.0),
    (10.0, 52.0),
    (8.0, 50.0),
    (6.5, 50.0),
    (5.5, 48.0),
    (4.5, 48.0),
    (4.0, 46.0),
    (3.5, 45.0),
    (3.0, 45.0),
    (2.7, 45.0),
    (2.5, 45.0),
];
/// Matches within this distance are never outliers, however well the rest fits. (mm)
const MIN_LIMIT_MM: f64 = 4.0;
/// Vertices of the face that pull on the template, at most.
const PULLING_COUNT: usize = 9000;

/// Refines `start` onto the target; see the module.
pub(super) fn refine(
    model: &FaceModel<'_>,
    target: &Target,
    start: &[Point],
    pins: &[Pin],
    mut on_round: impl FnMut(f64) -> Result<(), RegistrationError>,
) -> Result<Vec<Point>, RegistrationError> {
    let count = start.len();
    let energy = Energy::new(model, start);
    let mut system = SpdSystem::new(count, &energy.pattern)?;
    let (plate, membrane) = energy.values(&mut system);
    let pulling = pulling_vertices(target);

    let mut vertices = start.to_vec();
    for (round, (length, angle)) in ROUNDS.into_iter().enumerate() {
        on_round(round as f64 / ROUNDS.len() as f64)?;
        let l4 = length.powi(4);
        let l2 = (length / 8.0).powi(2);
        let values: Vec<f64> = plate
            .iter()
            .zip(&membrane)
            .map(|(p, m)| p * l4 + m * l2)
            .collect();
        system.set_values(&values);
        let mut rhs = vec![0.0; 3 * count];
        let cos_limit = angle.to_radians().cos();
        let normals = vertex_normals(&vertices, &model.triangles);

        for (v, weight, place) in vertex_matches(model, target, &vertices, &normals, cos_limit) {
            let weight = weight * energy.areas[v as usize];
            system.add(v, v, weight);
            let n = normals[v as usize];
            let d = n * n.dot(&(place - start[v as usize]));
            for c in 0..3 {
                rhs[c * count + v as usize] += weight * d[c];
            }
        }
        for pull in pulls(model, target, &pulling, &vertices, &normals, cos_limit)? {
            let corners = model.triangles[pull.triangle as usize];
            let at: Vector = (0..3)
                .map(|k| start[corners[k] as usize].coords * pull.barycentric[k])
                .sum();
            let n = (0..3)
                .map(|k| normals[corners[k] as usize] * pull.barycentric[k])
                .sum::<Vector>();
            // Blended normals are shorter than one.
            let d = n * (n.dot(&(pull.place.coords - at)) / n.norm_squared());
            for i in 0..3 {
                for j in 0..=i {
                    let value = pull.weight * pull.barycentric[i] * pull.barycentric[j];
                    system.add(corners[i], corners[j], value);
                }
                for c in 0..3 {
                    rhs[c * count + corners[i] as usize] +=
                        pull.weight * pull.barycentric[i] * d[c];
                }
            }
        }
        for pin in pins {
            let weight = pin.weight * energy.pin_area;
            let d = pin.place - pin.now(start);
            for (k, &(a, share)) in pin.corners.iter().enumerate() {
                for &(b, other) in &pin.corners[..=k] {
                    // A vertex pinned alone repeats itself with shares of zero.
                    if share != 0.0 && other != 0.0 {
                        system.add(a, b, weight * share * other);
                    }
                }
                for c in 0..3 {
                    rhs[c * count + a as usize] += weight * share * d[c];
                }
            }
        }
        for v in 0..count as u32 {
            system.add(v, v, 1e-9 * energy.pin_area);
        }
        system.solve(&mut rhs)?;
        for (v, p) in vertices.iter_mut().enumerate() {
            *p = start[v] + Vector::new(rhs[v], rhs[count + v], rhs[2 * count + v]);
        }
    }
    Ok(vertices)
}

/// The two smoothness terms on the template's full topology.
struct Energy {
    laplacian: EdgeLaplacian,
    areas: Vec<f64>,
    /// Area that a pin of weight 1 stands for. [mm^2]
    pin_area: f64,
    neighbours: Vec<Vec<(u32, f64)>>,
    pattern: Vec<(u32, u32)>,
}

impl Energy {
    fn new(model: &FaceModel<'_>, positions: &[Point]) -> Self {
        let laplacian = EdgeLaplacian::cotangent(positions, &model.triangles, &model.topology);
        let areas = vertex_areas(positions, &model.triangles);
        let mean = areas.iter().sum::<f64>() / areas.len() as f64;
        let mut neighbours = vec![Vec::new(); positions.len()];
        for (&[a, b], &w) in laplacian.edges.iter().zip(&laplacian.weights) {
            neighbours[a as usize].push((b, -w));
            neighbours[b as usize].push((a, -w));
        }
        for (v, list) in neighbours.iter_mut().enumerate() {
            list.push((v as u32, laplacian.row_sums[v]));
        }
        let mut pattern = Vec::new();
        for list in &neighbours {
            for &(a, _) in list {
                for &(b, _) in list {
                    if a <= b {
                        pattern.push((a, b));
                    }
                }
            }
        }
        pattern.sort_unstable();
        pattern.dedup();
        Self {
            laplacian,
            // Slivers must not get unbounded bending stiffness.
            areas: areas.into_iter().map(|a| a.max(0.05 * mean)).collect(),
            pin_area: mean,
            neighbours,
            pattern,
        }
    }

    /// Matrix values of the thin-plate and the membrane term.
    fn values(&self, system: &mut SpdSystem) -> (Vec<f64>, Vec<f64>) {
        system.clear();
        for (v, row) in self.neighbours.iter().enumerate() {
            for (k, &(a, wa)) in row.iter().enumerate() {
                for &(b, wb) in &row[..=k] {
                    system.add(a, b, wa * wb / self.areas[v]);
                }
            }
        }
        let plate = system.values().to_vec();
        system.clear();
        for (&[a, b], &w) in self.laplacian.edges.iter().zip(&self.laplacian.weights) {
            system.add(a, a, w);
            system.add(b, b, w);
            system.add(a, b, -w);
        }
        (plate, system.values().to_vec())
    }
}

/// (vertex, weight, place) for every template vertex with a match.
fn vertex_matches(
    model: &FaceModel<'_>,
    target: &Target,
    vertices: &[Point],
    normals: &[Vector],
    cos_limit: f64,
) -> Vec<(u32, f64, Point)> {
    let found: Vec<(u32, f64, Point, f64)> = (0..vertices.len())
        .into_par_iter()
        .filter_map(|v| {
            let trust = match model.roles[v] {
                Role::Hidden => return None,
                Role::Outlying => 0.2,
                Role::Face => 1.0,
            };
            let m = target.matching(&vertices[v], &normals[v], 10.0, cos_limit)?;
            (!m.is_on_boundary).then_some((v as u32, trust, m.place.point, m.place.distance))
        })
        .collect();
    let distances: Vec<f64> = found.iter().map(|f| f.3).collect();
    let (median, deviation) = median_and_deviation(&distances);
    let limit = (median + 3.0 * deviation).max(MIN_LIMIT_MM);
    let sigma = (3.0 * median).max(0.5 * MIN_LIMIT_MM);
    found
        .into_iter()
        .filter(|f| f.3 <= limit)
        .map(|(v, trust, place, d)| (v, trust * geman_mcclure(d, sigma), place))
        .collect()
}

/// A vertex of the face that pulls on a place of the template.
struct Pull {
    triangle: u32,
    barycentric: [f64; 3],
    place: Point,
    weight: f64,
}

/// (vertex, area it stands for), at most [`PULLING_COUNT`] of them.
fn pulling_vertices(target: &Target) -> Vec<(u32, f64)> {
    let areas = vertex_areas(&target.positions, &target.triangles);
    let used: Vec<u32> = (0..areas.len() as u32)
        .filter(|&v| areas[v as usize] > 0.0)
        .collect();
    let stride = used.len().div_ceil(PULLING_COUNT).max(1);
    used.into_iter()
        .step_by(stride)
        .map(|v| (v, areas[v as usize] * stride as f64))
        .collect()
}

fn pulls(
    model: &FaceModel<'_>,
    target: &Target,
    pulling: &[(u32, f64)],
    vertices: &[Point],
    normals: &[Vector],
    cos_limit: f64,
) -> Result<Vec<Pull>, RegistrationError> {
    let surface = Surface::new(vertices, &model.triangles)?;
    let found: Vec<(Pull, f64)> = pulling
        .par_iter()
        .filter_map(|&(v, area)| {
            let (p, n) = (target.positions[v as usize], target.normals[v as usize]);
            let at = surface.closest_where(&p, 6.0, |at| {
                let m = surface.blend(at, normals);
                let along = m.dot(&n);
                along > 0.0 && along * along > cos_limit * cos_limit * m.norm_squared()
            })?;
            let corners = model.triangles[at.triangle as usize];
            let role = corners.map(|c| model.roles[c as usize]).into_iter().min()?;
            (role == Role::Face).then_some((
                Pull {
                    triangle: at.triangle,
                    barycentric: at.barycentric,
                    place: p,
                    weight: 0.5 * area,
                },
                at.distance,
            ))
        })
        .collect();
    let distances: Vec<f64> = found.iter().map(|f| f.1).collect();
    let (median, deviation) = median_and_deviation(&distances);
    let limit = (median + 3.0 * deviation).max(MIN_LIMIT_MM);
    let sigma = (3.0 * median).max(0.5 * MIN_LIMIT_MM);
    Ok(found
        .into_iter()
        .filter(|f| f.1 <= limit)
        .map(|(mut pull, d)| {
            pull.weight *= geman_mcclure(d, sigma);
            pull
        })
        .collect())
}
