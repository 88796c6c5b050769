//! Shape-fitted weights.
//!
//! Averaging by a kernel flattens every motion over the width of the kernel: a lip follows
//! its corner, a lid the cheek. Here the weights of each template vertex minimise, over all
//! poses i (each shape at weight 1),
//!
//! `sum_i c_i |sum_j w_j g_ij - d_i|^2 + ridge |w - w_prior|^2`, `w >= 0`, `sum w <= 1`
//!
//! where `g_ij` is what node j alone would do to the vertex in pose i, `d_i` is what the shape
//! does to it, and `c_i` is larger where that is nothing, since skin that drifts is seen
//! sooner than skin that lags. The prior is the kernel at first, and then the mean of the
//! weights of the neighbours, which keeps weights smooth where the shapes do not tell nodes
//! apart. The skull takes what is missing to one.
//!
//! Inner skin (the lining of mouth and sockets) lies under the patches, outside the hull of
//! their nodes: what it does is found by going on inwards from what they do, and that is a
//! difference of nodes. Its weights may have either sign, each at a price that keeps them few.
//!
//! Left and right are fitted once and mirrored.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Vector;
use crate::anatomy::PatchChart;
use crate::mesh::Topology;
use crate::skin::vertex_fit::Choice;
use crate::skin::{Candidate, CandidateFinder, NodeAffine, NodeMirror};
use crate::template::Template;

/// How weights are fitted.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
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
    /// Nodes a vertex of inner skin keeps in the end.
    pub inner_node_limit: usize,
    /// Pull towards the prior, as a mean squared motion over all poses. [mm^2]
    pub ridge: f64,
    /// Price of a weight of inner skin, against squared motion summed over all poses. [mm^2]
    pub inner_price: f64,
    /// How many times a pose counts for a vertex that it leaves still.
    pub still_factor: f64,
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
            inner_node_limit: 48,
            ridge: 0.3,
            inner_price: 0.6,
            still_factor: 4.0,
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
/// - `charts`: the patches that `finder` knows
/// - `normals`: vertex normals of the template's neutral skin
/// - `poses`: the motions to reproduce
///
/// Weights are whole steps of [`TemplateWeights::STEP`]. The result does not depend on the
/// number of threads.
pub fn fit_to_shapes(
    template: &Template,
    charts: &[PatchChart],
    normals: &[Vector],
    finder: &CandidateFinder<'_>,
    poses: &[Pose],
    options: &FitOptions,
) -> TemplateWeights {
    let mandible = finder.node_count() as u32;
    let positions = template.skin.positions();
    let mirror = NodeMirror::new(charts);
    let choices: Vec<(usize, Choice)> = template
        .one_half()
        .into_par_iter()
        .map(|v| {
            let is_inner = finder.is_cavity(template.regions.vertex_regions[v]);
            let candidates = finder.find(v, &normals[v]);
            let point = positions[v].cast();
            let choice = Choice::new(v, point, candidates, mandible, is_inner, options);
            (v, choice)
        })
        .collect();
    let on_both_sides = |half: Vec<Vec<(u32, f32)>>| {
        let mut weights = vec![Vec::new(); positions.len()];
        for ((v, _), row) in choices.iter().zip(half) {
            weights[template.mirror[*v] as usize] = mirror.row(&row);
            weights[*v] = row;
        }
        weights
    };
    let half = choices
        .par_iter()
        .map(|(_, c)| c.fit(poses, &c.prior, &[], options))
        .collect();
    let mut weights = on_both_sides(half);
    let topology = Topology::from_mesh(&template.skin);
    for _ in 0..options.smoothing_rounds {
        let half = choices
            .par_iter()
            .map(|(v, choice)| {
                let prior = neighbour_mean(template, &topology, *v, &choice.candidates, &weights);
                choice.fit(poses, &prior, &weights[*v], options)
            })
            .collect();
        weights = on_both_sides(half);
    }
    let half = choices
        .iter()
        .map(|(v, choice)| {
            let mut row = std::mem::take(&mut weights[*v]);
            choice.keep_largest(&mut row, options);
            if template.mirror[*v] as usize == *v {
                row = mirror.symmetric_row(&row);
            }
            row
        })
        .collect();
    TemplateWeights {
        by_vertex: on_both_sides(half),
    }
    .in_steps()
}

/// Mean of the neighbours' weights and the vertex's own, on the vertex's candidates.
fn neighbour_mean(
    template: &Template,
    topology: &Topology,
    vertex: usize,
    candidates: &[Candidate],
    weights: &[Vec<(u32, f32)>],
) -> Vec<f64> {
    let regions = &template.regions;
    let own = regions.vertex_regions[vertex];
    let mut mean = vec![0.0; candidates.len()];
    let mut count = 0.0;
    let ring = topology
        .neighbours(vertex as u32)
        .iter()
        .map(|&n| n as usize)
        .filter(|&n| !regions.are_apart(own, regions.vertex_regions[n]));
    for n in ring.chain([vertex]) {
        count += 1.0;
        for &(node, weight) in &weights[n] {
            if let Ok(i) = candidates.binary_search_by_key(&node, |c| c.node) {
                mean[i] += f64::from(weight);
            }
        }
    }
    mean.iter_mut().for_each(|m| *m /= count);
    mean
}
