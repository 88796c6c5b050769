//! Candidates: pairs of elements that could meet before they are looked at again.
//!
//! Every part has a reference, the positions at which it was last looked at, and a budget: how
//! far its nodes may go from there. Two elements whose distance at the references exceeds what
//! both budgets and the thickness take together cannot meet, and are no candidates. When a
//! node leaves its budget, its part is looked at anew: O(n) refit, and the hierarchies of the
//! parts that it may collide with are walked.
//!
//! Source: the per-vertex displacement bounds of Chen et al. 2025, *Offset Geometric Contact*,
//! kept per part here, so that one list serves many substeps.

use super::contact::{Contact, PASS_LENGTH};
use super::distance::{PairKind, closest_weights, weighted, wide};
use super::judge::Side;
use crate::Vector;

/// How far projection may move nodes before candidates are collected again. (mm)
pub(super) const MARGIN: f64 = 0.15;
/// Smallest and largest budget. (mm)
const BUDGETS: [f32; 2] = [0.35, 2.5];

/// A pair of elements that may collide.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Candidate {
    pub(crate) nodes: [u32; 4],
    pub(crate) kind: PairKind,
    /// Distance at the references. (mm)
    pub(crate) distance: f32,
    /// Distance to keep. (mm)
    pub(crate) thickness: f32,
}

/// Candidates between two parts, or within one.
#[derive(Debug)]
pub(crate) struct PairList {
    pub(crate) a: usize,
    pub(crate) b: usize,
    pub(crate) friction: f64,
    /// The collider that `b` is of.
    pub(crate) collider: Option<usize>,
    pub(crate) candidates: Vec<Candidate>,
}

impl PairList {
    pub(crate) fn new(a: usize, b: usize, friction: f64, collider: Option<usize>) -> Self {
        Self {
            a,
            b,
            friction,
            collider,
            candidates: Vec::new(),
        }
    }
}

impl Contact {
    /// Measures how far nodes are from their references, and looks at parts anew where that is
    /// too far.
    pub(super) fn refresh_candidates(&mut self) {
        let mut stale = vec![false; self.parts.len()];
        let mut any = false;
        for (index, part) in self.parts.iter().enumerate() {
            let range = part.first as usize..(part.first + part.count) as usize;
            let mut furthest = 0.0_f32;
            let nodes = self.wanted[range.clone()]
                .iter()
                .zip(&self.positions[range.clone()])
                .zip(&self.reference[range.clone()]);
            for (travel, ((w, x), r)) in self.travel[range].iter_mut().zip(nodes) {
                let squared = (w - r).norm_squared().max((x - r).norm_squared());
                *travel = squared.sqrt();
                furthest = furthest.max(*travel);
            }
            if !(furthest <= self.budgets[index]) {
                stale[index] = true;
                any = true;
            }
        }
        if !any {
            return;
        }
        for index in 0..self.parts.len() {
            if stale[index] {
                self.renew(index);
            }
        }
        let mut lists = std::mem::take(&mut self.lists);
        let mut cells = Vec::new();
        for list in &mut lists {
            if stale[list.a] || stale[list.b] {
                self.detect(list, &mut cells);
            }
        }
        self.lists = lists;
    }

    fn renew(&mut self, index: usize) {
        self.report.detections += 1;
        let part = &mut self.parts[index];
        let range = part.first as usize..(part.first + part.count) as usize;
        self.reference[range.clone()].copy_from_slice(&self.positions[range.clone()]);
        let mut furthest = 0.0_f32;
        for i in range {
            let way = (self.wanted[i] - self.positions[i]).norm();
            self.travel[i] = way;
            furthest = furthest.max(way);
        }
        let [least, most] = BUDGETS;
        self.budgets[index] = (3.0 * furthest)
            .clamp(least, most)
            .max(1.01 * furthest + MARGIN as f32);
        part.tree.refit(&part.cells, &self.reference);
    }

    /// How much two elements keep apart at most, over a whole list. (mm)
    fn thickest(&self, list: &PairList) -> f64 {
        if list.collider.is_none() {
            return self.options.thickness;
        }
        let part = &self.parts[list.a];
        let covers = &self.cover[part.first as usize..(part.first + part.count) as usize];
        f64::from(covers.iter().fold(0.0_f32, |m, &c| m.max(c)))
    }

    fn detect(&self, list: &mut PairList, cells: &mut Vec<[u32; 2]>) {
        list.candidates.clear();
        let (a, b) = (&self.parts[list.a], &self.parts[list.b]);
        let slack = f64::from(self.budgets[list.a] + self.budgets[list.b]) + 2.0 * MARGIN;
        let reach = self.thickest(list) + slack;
        let own = list.a == list.b;
        if own {
            a.tree.near_own_cells(reach as f32, cells);
        } else {
            a.tree.near_cells(&b.tree, reach as f32, cells);
        }
        let is_cloth = list.collider.is_none();
        let out = &mut list.candidates;
        let mut offer = |kind: PairKind, nodes: [u32; 4]| {
            let (first, second) = nodes.split_at(kind.first_count());
            if own && self.rules.side(a, first, second) != Side::Apart {
                return;
            }
            let at = nodes.map(|n| wide(&self.reference[n as usize]));
            let thickness = if is_cloth {
                self.options.thickness
            } else {
                self.covered(&nodes)
            };
            let limit = thickness + slack;
            if boxes_apart(kind, &at, limit) {
                return;
            }
            let distance = weighted(&closest_weights(kind, &at), &at).norm();
            if distance > limit {
                return;
            }
            let thickness = if is_cloth {
                self.at_most_rest(kind, &nodes)
            } else {
                thickness
            };
            out.push(Candidate {
                nodes,
                kind,
                distance: distance as f32,
                thickness: thickness as f32,
            });
        };
        for &[ca, cb] in cells.iter() {
            let (ca, cb) = (&a.cells[ca as usize], &b.cells[cb as usize]);
            for &v in &ca.nodes {
                for &[x, y, z] in &cb.triangles {
                    offer(PairKind::VertexTriangle, [v, x, y, z]);
                }
            }
            for &v in &cb.nodes {
                for &[x, y, z] in &ca.triangles {
                    offer(PairKind::VertexTriangle, [v, x, y, z]);
                }
            }
            for &[p, q] in &ca.edges {
                for &[r, s] in &cb.edges {
                    offer(PairKind::EdgeEdge, [p, q, r, s]);
                }
            }
        }
    }

    /// What covers the cloth's nodes of a pair with a collider, at least. (mm)
    fn covered(&self, nodes: &[u32; 4]) -> f64 {
        nodes
            .iter()
            .filter(|&&n| (n as usize) < self.cloth_count)
            .map(|&n| f64::from(self.cover[n as usize]))
            .fold(f64::INFINITY, f64::min)
    }

    /// The thickness, or nearly the distance at rest where that is less. (mm)
    fn at_most_rest(&self, kind: PairKind, nodes: &[u32; 4]) -> f64 {
        let at = nodes.map(|n| wide(&self.rest[n as usize]));
        let rest = weighted(&closest_weights(kind, &at), &at).norm();
        self.options.thickness.min(0.9 * rest)
    }

    /// Candidates that may come nearer than their thickness on the way to `wanted`.
    pub(super) fn collect(&mut self) {
        self.actives.clear();
        for (index, list) in self.lists.iter().enumerate() {
            for c in &list.candidates {
                let [t0, t1, t2, t3] = c.nodes.map(|n| self.travel[n as usize]);
                let travel = match c.kind {
                    PairKind::VertexTriangle => t0 + t1.max(t2).max(t3),
                    PairKind::EdgeEdge => t0.max(t1) + t2.max(t3),
                };
                let limit = c.thickness + 2.0 * MARGIN as f32;
                if c.distance - travel > limit {
                    continue;
                }
                let at = c.nodes.map(|n| wide(&self.positions[n as usize]));
                let weights = closest_weights(c.kind, &at);
                let r = weighted(&weights, &at);
                let distance = r.norm();
                let to = c.nodes.map(|n| wide(&self.wanted[n as usize]));
                if distance - approach(c.kind, &at, &to) > f64::from(limit) {
                    continue;
                }
                self.actives.push(super::project::Active {
                    nodes: c.nodes,
                    kind: c.kind,
                    weights,
                    normal: r / distance.max(1e-12),
                    distance,
                    thickness: f64::from(c.thickness),
                    list: index as u32,
                    push: 0.0,
                });
            }
        }
    }
}

/// How much nearer two elements can come when their nodes go straight from `at` to `to`: what
/// they move in common does not count. (mm)
pub(super) fn approach(kind: PairKind, at: &[Vector; 4], to: &[Vector; 4]) -> f64 {
    let moves: [Vector; 4] = std::array::from_fn(|i| to[i] - at[i]);
    let mean = (moves[0] + moves[1] + moves[2] + moves[3]) * 0.25;
    let squared = moves.map(|m| (m - mean).norm_squared());
    let first = kind.first_count();
    let largest = |s: &[f64]| s.iter().fold(0.0, |m: f64, &x| m.max(x)).sqrt();
    largest(&squared[..first]) + largest(&squared[first..])
}

fn boxes_apart(kind: PairKind, at: &[Vector; 4], limit: f64) -> bool {
    let (first, second) = at.split_at(kind.first_count());
    (0..3).any(|k| {
        let range = |s: &[Vector]| {
            s.iter()
                .fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])))
        };
        let ((la, ha), (lb, hb)) = (range(first), range(second));
        la - hb > limit || lb - ha > limit
    })
}

// A part is renewed with a budget above the longest pass, so that it stays within it.
const _: () = assert!(PASS_LENGTH < BUDGETS[1] as f64);
