//! Shape-fitted weights.
//!
//! Averaging by a kernel flattens every motion over the width of the kernel: a lip follows
//! its corner, a lid the cheek. Here the weights of each template vertex minimise, over all
//! poses i (each shape at weight 1),
//!
//! `sum_i |sum_j w_j g_ij - d_i|^2 + ridge |w - w_prior|^2`, `w >= 0`, `sum w <= 1`
//!
//! where `g_ij` is what node j alone would do to the vertex in pose i and `d_i` is what the
//! shape does to it. The prior is the kernel at first, and then the mean of the weights of
//! the neighbours, which keeps weights smooth where the shapes do not tell nodes apart.
//! The skull takes what is missing to one.

use nalgebra::{DMatrix, DVector, Point3, Vector3};
use rayon::prelude::*;

use crate::Vector;
use crate::mesh::Topology;
use crate::skin::nonnegative::solve_nonnegative;
use crate::skin::{Candidate, CandidateFinder, NodeAffine, kernel};
use crate::template::Template;

/// How weights are fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitOptions {
    /// No node further away is taken; the kernel ends here. (mm)
    pub reach: f64,
    /// Patches that one vertex may hang on.
    pub patch_limit: usize,
    /// Rings of the grid taken around the nearest node of each of them.
    pub rings: u32,
    /// Nodes that are tried, the nearest.
    pub candidate_limit: usize,
    /// Nodes a vertex keeps in the end.
    pub node_limit: usize,
    /// Pull towards the prior, as a mean squared motion over all poses. [mm^2]
    pub ridge: f64,
    /// Rounds with the neighbours' mean as prior, after the one with the kernel.
    pub smoothing_rounds: usize,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            reach: 18.0,
            patch_limit: 8,
            rings: 2,
            candidate_limit: 64,
            node_limit: 24,
            ridge: 0.3,
            smoothing_rounds: 2,
        }
    }
}

/// One pose to reproduce.
pub struct Pose {
    /// What every candidate body does: all nodes, patch after patch, then the mandible.
    pub affines: Vec<NodeAffine>,
    /// What the skin of the template does. (mm), shape `[vertex_count]`
    pub displacements: Vec<Vector3<f32>>,
}

/// Weights of every template vertex over all nodes and the mandible, sparse by vertex.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplateWeights {
    /// (index over nodes and mandible, weight) per vertex, indices rising.
    pub by_vertex: Vec<Vec<(u32, f32)>>,
}

/// Fits the weights of every vertex of the template.
///
/// - `normals`: vertex normals of the template's neutral skin
/// - `poses`: the motions to reproduce
///
/// The result does not depend on the number of threads.
pub fn fit_to_shapes(
    template: &Template,
    normals: &[Vector],
    finder: &CandidateFinder<'_>,
    poses: &[Pose],
    options: &FitOptions,
) -> TemplateWeights {
    let mandible = finder.node_count() as u32;
    let positions = template.skin.positions();
    let problems: Vec<Problem> = (0..positions.len())
        .into_par_iter()
        .map(|v| {
            let mut candidates = finder.find(v, &normals[v]);
            let distances: Vec<f64> = candidates.iter().map(|c| c.distance).collect();
            let mut prior = kernel::weights(&distances, options.reach);
            candidates.push(Candidate {
                node: mandible,
                distance: 0.0,
            });
            prior.push(0.0);
            Problem::new(&positions[v].cast(), v, candidates, prior, poses)
        })
        .collect();
    let mut weights: Vec<Vec<(u32, f32)>> = problems
        .par_iter()
        .map(|p| p.solve(&p.prior, options.ridge, &[]))
        .collect();
    let topology = Topology::from_mesh(&template.skin);
    for _ in 0..options.smoothing_rounds {
        weights = problems
            .par_iter()
            .enumerate()
            .map(|(v, problem)| {
                let prior = neighbour_mean(template, &topology, v, problem, &weights);
                problem.solve(&prior, options.ridge, &weights[v])
            })
            .collect();
    }
    for vertex in &mut weights {
        keep_largest(vertex, options.node_limit);
    }
    TemplateWeights { by_vertex: weights }
}

/// The least squares of one vertex.
struct Problem {
    candidates: Vec<Candidate>,
    prior: Vec<f64>,
    normal: DMatrix<f64>,
    rhs: DVector<f64>,
}

impl Problem {
    fn new(
        point: &Point3<f32>,
        vertex: usize,
        candidates: Vec<Candidate>,
        prior: Vec<f64>,
        poses: &[Pose],
    ) -> Self {
        let count = candidates.len();
        let mut normal = DMatrix::zeros(count, count);
        let mut rhs = DVector::zeros(count);
        let mut motions = vec![Vector3::<f64>::zeros(); count];
        for pose in poses {
            let mut moves = false;
            for (motion, candidate) in motions.iter_mut().zip(&candidates) {
                let displacement = pose.affines[candidate.node as usize].displacement(point);
                moves |= displacement.norm_squared() > 1e-10;
                *motion = displacement.cast();
            }
            if !moves {
                continue;
            }
            let wanted = pose.displacements[vertex].cast::<f64>();
            for i in 0..count {
                rhs[i] += motions[i].dot(&wanted);
                for j in 0..=i {
                    normal[(i, j)] += motions[i].dot(&motions[j]);
                }
            }
        }
        for i in 0..count {
            for j in 0..i {
                normal[(j, i)] = normal[(i, j)];
            }
        }
        Self {
            candidates,
            prior,
            normal,
            rhs,
        }
    }

    /// - `last`: the answer of the round before, to start from
    fn solve(&self, prior: &[f64], ridge: f64, last: &[(u32, f32)]) -> Vec<(u32, f32)> {
        let count = self.candidates.len();
        let mut normal = self.normal.clone();
        let mut rhs = self.rhs.clone();
        for i in 0..count {
            normal[(i, i)] += ridge;
            rhs[i] += ridge * prior[i];
        }
        let mut start = DVector::zeros(count);
        for &(node, weight) in last {
            if let Ok(i) = self.candidates.binary_search_by_key(&node, |c| c.node) {
                start[i] = f64::from(weight);
            }
        }
        let mut weights = solve_nonnegative(&normal, &rhs, start);
        let total = weights.sum();
        if total > 1.0 {
            // Hold the sum at one by a stiff row, then exactly by scaling.
            let stiff = 1e3 * normal.diagonal().max().max(1.0);
            for i in 0..count {
                rhs[i] += stiff;
                for j in 0..count {
                    normal[(i, j)] += stiff;
                }
            }
            let start = weights / total;
            weights = solve_nonnegative(&normal, &rhs, start);
            let total = weights.sum();
            if total > 1.0 {
                weights /= total;
            }
        }
        self.candidates
            .iter()
            .zip(weights.iter())
            .filter(|(_, w)| **w > 1e-4)
            .map(|(c, w)| (c.node, *w as f32))
            .collect()
    }
}

/// Mean of the neighbours' weights and the vertex's own, on the vertex's candidates.
fn neighbour_mean(
    template: &Template,
    topology: &Topology,
    vertex: usize,
    problem: &Problem,
    weights: &[Vec<(u32, f32)>],
) -> Vec<f64> {
    let regions = &template.regions;
    let own = regions.vertex_regions[vertex];
    let mut mean = vec![0.0; problem.candidates.len()];
    let mut count = 0.0;
    let ring = topology
        .neighbours(vertex as u32)
        .iter()
        .map(|&n| n as usize)
        .filter(|&n| !regions.are_apart(own, regions.vertex_regions[n]));
    for n in ring.chain([vertex]) {
        count += 1.0;
        for &(node, weight) in &weights[n] {
            if let Ok(i) = problem.candidates.binary_search_by_key(&node, |c| c.node) {
                mean[i] += f64::from(weight);
            }
        }
    }
    mean.iter_mut().for_each(|m| *m /= count);
    mean
}

/// Keeps the largest weights and hands what the others held to them.
fn keep_largest(weights: &mut Vec<(u32, f32)>, limit: usize) {
    if weights.len() <= limit {
        return;
    }
    let before: f32 = weights.iter().map(|w| w.1).sum();
    weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    weights.truncate(limit);
    let after: f32 = weights.iter().map(|w| w.1).sum();
    for weight in weights.iter_mut() {
        weight.1 *= before / after;
    }
    weights.sort_by_key(|w| w.0);
}
