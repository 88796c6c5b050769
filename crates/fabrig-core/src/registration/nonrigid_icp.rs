//! Optimal-step non-rigid ICP on the coarse level: an affine map at every node, neighbours kept
//! alike by a stiffness that falls step by step.
//!
//! Unknowns of node i, for each output coordinate: a row of A_i and t_i. With rest places g,
//!
//! ```text
//! E = sum_i w_i |g_i + t_i - u_i|^2
//!   + alpha sum_ij ( |A_i e_ij + t_i - t_j - e_ij|^2 + |A_j e_ji + t_j - t_i - e_ji|^2
//!                  + l_ij^2 |A_i - A_j|^2 ),   e_ij = g_j - g_i
//! ```
//!
//! At rest every A_i is the identity. Any global affine map costs nothing, so size and
//! proportions adapt before detail does. Places u_i are the closest ones as far as the surface
//! is across; along it they stay at g_i, where the identity fit has put them, but for pins.
//!
//! Source: Amberg, Romdhani & Vetter 2007, Optimal Step Nonrigid ICP Algorithms for Surface
//! Registration; edge term after Sumner, Schmid & Pauly 2007, Embedded Deformation.

use rayon::prelude::*;

use super::RegistrationError;
use super::face_model::{FaceModel, Role};
use super::node_graph::NodeGraph;
use super::sparse::SpdSystem;
use super::target::{Target, geman_mcclure, median_and_deviation};
use crate::mesh::vertex_normals;
use crate::{Point, Vector};

/// A place on the template that should come to another, whatever the closest point says.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pin {
    /// Template vertices and barycentric weights.
    pub(super) corners: [(u32, f64); 3],
    pub(super) place: Point,
    pub(super) weight: f64,
}

impl Pin {
    /// Of one vertex.
    pub(super) fn of_vertex(vertex: u32, place: Point, weight: f64) -> Self {
        Self {
            corners: [(vertex, 1.0), (vertex, 0.0), (vertex, 0.0)],
            place,
            weight,
        }
    }

    /// Where the pinned place is at these template positions.
    pub(super) fn now(&self, vertices: &[Point]) -> Point {
        let sum: Vector = self
            .corners
            .iter()
            .map(|&(v, share)| vertices[v as usize].coords * share)
            .sum();
        Point::from(sum)
    }
}

/// Stiffness of each stage, and the largest angle between normals. (degrees)
const STAGES: [(f64, f64); 4] = [(25.0, 54.0), (10.0, 51.0), (4.0, 48.0), (1.5, 45.0)];
/// How far away the first stage looks; later ones trust near matches only. (mm)
const FIRST_REACH_MM: f64 = 10.0;
const ROUNDS_PER_STAGE: usize = 3;
/// Matches within this distance are never outliers. (mm)
const MIN_LIMIT_MM: f64 = 8.0;

/// The pins at these positions of all vertices; the flag says whether a stage begins.
pub(super) type PinsAt<'a> = dyn FnMut(&[Point], bool) -> Result<Vec<Pin>, RegistrationError> + 'a;

/// Deforms the template onto the target; `pins` gives the pins for the current positions, and
/// is told where a stage begins.
///
/// Returns positions of all template vertices. [mm, head frame]
pub(super) fn deform_coarse(
    model: &FaceModel<'_>,
    graph: &NodeGraph,
    target: &Target,
    start: &[Point],
    pins: &mut PinsAt<'_>,
    mut on_round: impl FnMut(f64) -> Result<(), RegistrationError>,
) -> Result<Vec<Point>, RegistrationError> {
    let rest: Vec<Point> = graph.nodes.iter().map(|&v| start[v as usize]).collect();
    let node_count = rest.len();
    let mut pattern = Vec::new();
    let pin_pattern = |pattern: &mut Vec<(u32, u32)>, a: u32, b: u32| {
        for i in 0..4 {
            for j in 0..4 {
                pattern.push((4 * a + i, 4 * b + j));
            }
        }
    };
    for k in 0..node_count as u32 {
        pin_pattern(&mut pattern, k, k);
    }
    for &(a, b) in &graph.edges {
        pin_pattern(&mut pattern, a, b);
    }
    let mut system = SpdSystem::new(4 * node_count, &pattern)?;
    let (stiffness, stiffness_rhs) = stiffness_of(&mut system, &rest, &graph.edges);

    let mut vertices = start.to_vec();
    let total = (STAGES.len() * ROUNDS_PER_STAGE) as f64;
    for (stage, (alpha, angle)) in STAGES.into_iter().enumerate() {
        for round in 0..ROUNDS_PER_STAGE {
            on_round((stage * ROUNDS_PER_STAGE + round) as f64 / total)?;
            let normals = vertex_normals(&vertices, &model.triangles);
            let data = node_matches(model, graph, target, (&vertices, &normals), angle, stage);
            let values: Vec<f64> = stiffness.iter().map(|v| v * alpha).collect();
            system.set_values(&values);
            let mut rhs: Vec<f64> = stiffness_rhs.iter().map(|v| v * alpha).collect();
            let mut attract = |node: u32, weight: f64, place: &Point| {
                let t = 4 * node + 3;
                system.add(t, t, weight);
                let d = place - rest[node as usize];
                for c in 0..3 {
                    rhs[c * 4 * node_count + t as usize] += weight * d[c];
                }
            };
            for (node, weight, place) in data {
                let n = normals[graph.nodes[node as usize] as usize];
                let own = rest[node as usize];
                attract(node, weight, &(own + n * n.dot(&(place - own))));
            }
            for pin in pins(&vertices, round == 0)? {
                // A pin moves the nodes around it by as much as it lacks.
                let lack = pin.place - pin.now(&vertices);
                for (vertex, corner_share) in pin.corners {
                    for &(node, share) in &graph.blends[vertex as usize] {
                        let at = vertices[graph.nodes[node as usize] as usize] + lack;
                        attract(node, pin.weight * corner_share * share, &at);
                    }
                }
            }
            for k in 0..node_count as u32 {
                // Keeps nodes without any data bound; far below every other term.
                for c in 0..4 {
                    system.add(4 * k + c, 4 * k + c, 1e-7);
                }
            }
            system.solve(&mut rhs)?;
            apply(graph, &rest, start, &rhs, &mut vertices);
        }
    }
    Ok(vertices)
}

/// Values of the stiffness term at alpha = 1 and its right-hand side.
fn stiffness_of(
    system: &mut SpdSystem,
    rest: &[Point],
    edges: &[(u32, u32)],
) -> (Vec<f64>, Vec<f64>) {
    let size = 4 * rest.len();
    let mut rhs = vec![0.0; 3 * size];
    system.clear();
    for &(a, b) in edges {
        for (i, j) in [(a, b), (b, a)] {
            let e = rest[j as usize] - rest[i as usize];
            // Unknowns and coefficients of A_i e + t_i - t_j = e.
            let terms = [
                (4 * i, e.x),
                (4 * i + 1, e.y),
                (4 * i + 2, e.z),
                (4 * i + 3, 1.0),
                (4 * j + 3, -1.0),
            ];
            for (p, &(up, cp)) in terms.iter().enumerate() {
                for &(uq, cq) in &terms[..=p] {
                    system.add(up, uq, cp * cq);
                }
                for c in 0..3 {
                    rhs[c * size + up as usize] += cp * e[c];
                }
            }
        }
        let length_squared = (rest[b as usize] - rest[a as usize]).norm_squared();
        for c in 0..3 {
            let (p, q) = (4 * a + c, 4 * b + c);
            system.add(p, p, length_squared);
            system.add(q, q, length_squared);
            system.add(p, q, -length_squared);
        }
    }
    (system.values().to_vec(), rhs)
}

/// (node, weight, place) of every node that has a match.
fn node_matches(
    model: &FaceModel<'_>,
    graph: &NodeGraph,
    target: &Target,
    (vertices, normals): (&[Point], &[Vector]),
    angle_degrees: f64,
    stage: usize,
) -> Vec<(u32, f64, Point)> {
    let cos_limit = angle_degrees.to_radians().cos();
    let reach = FIRST_REACH_MM / (1.0 + 0.25 * stage as f64);
    let found: Vec<(u32, f64, Point, f64)> = (0..graph.nodes.len())
        .into_par_iter()
        .filter_map(|k| {
            let v = graph.nodes[k] as usize;
            let trust = match model.roles[v] {
                Role::Hidden => return None,
                Role::Outlying => 0.3,
                Role::Face => 1.0,
            };
            let m = target.matching(&vertices[v], &normals[v], reach.max(6.0), cos_limit)?;
            (!m.is_on_boundary).then_some((k as u32, trust, m.place.point, m.place.distance))
        })
        .collect();
    let distances: Vec<f64> = found.iter().map(|f| f.3).collect();
    let (median, deviation) = median_and_deviation(&distances);
    // Most of a face fits soon; what lags behind (a longer nose) is no outlier yet.
    let limit = (median + 3.0 * deviation).max(MIN_LIMIT_MM);
    let sigma = (3.0 * median).max(0.5 * MIN_LIMIT_MM);
    found
        .into_iter()
        .filter(|f| f.3 <= limit)
        .map(|(k, trust, place, d)| (k, trust * geman_mcclure(d, sigma), place))
        .collect()
}

/// Blends the nodes' maps at every vertex.
fn apply(graph: &NodeGraph, rest: &[Point], start: &[Point], x: &[f64], vertices: &mut [Point]) {
    let size = 4 * rest.len();
    for (v, blend) in graph.blends.iter().enumerate() {
        let mut sum = Vector::zeros();
        for &(node, weight) in blend {
            let g = rest[node as usize];
            let arm = start[v] - g;
            let at = 4 * node as usize;
            let mapped = Vector::from_fn(|c, _| {
                let row = &x[c * size + at..c * size + at + 4];
                row[0] * arm.x + row[1] * arm.y + row[2] * arm.z + row[3]
            });
            sum += (g.coords + mapped) * weight;
        }
        vertices[v] = Point::from(sum);
    }
}
