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
use super::project::Active;
use crate::Vector;

/// How far projection may move nodes before candidates are collected again. (mm)
pub(super) const MARGIN: f64 = 0.15;
/// Smallest and largest budget. (mm)
const BUDGETS: [f32; 2] = [0.3, 2.5];

/// Within this a cell of the default resolution turns by less than 40 degrees. (mm)
const SMALL_BUDGET: f32 = 0.6;

/// Share of the distance at rest that is kept, where that is less than the thickness.
const REST_SHARE: f64 = 0.5;

/// What is kept from the mesh inside a round collider, which only stops cells that are
/// stretched across it: nodes are held out by its round surface. (mm)
const GUARD_THICKNESS: f64 = 0.05;

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
    /// Smallest distance at the references beyond the thickness, of all candidates. (mm)
    pub(crate) spare: f32,
}

impl PairList {
    pub(crate) fn new(a: usize, b: usize, friction: f64, collider: Option<usize>) -> Self {
        Self {
            a,
            b,
            friction,
            collider,
            candidates: Vec::new(),
            spare: f32::INFINITY,
        }
    }
}

impl Contact {
    /// Measures how far nodes are from their references, and looks at parts anew where that is
    /// too far.
    pub(super) fn refresh_candidates(&mut self) {
        let mut stale = vec![false; self.parts.len()];
        let mut any = false;
        for c in &self.world {
            if let (true, Some(part)) = (c.is_away, c.part)
                && self.budgets[part] >= 0.0
            {
                self.budgets[part] = -1.0;
                any = true;
            }
        }
        for (index, part) in self.parts.iter().enumerate() {
            if self.is_away(index) {
                continue;
            }
            let range = part.first as usize..(part.first + part.count) as usize;
            let mut squared = 0.0_f32;
            let reference = &self.reference[range.clone()];
            for (w, r) in self.wanted[range.clone()].iter().zip(reference) {
                squared = squared.max((w - r).norm_squared());
            }
            // Where nothing was pushed, nodes are where they were wanted in the pass before.
            let mut furthest = squared.sqrt().max(self.last_furthest[index]);
            if self.is_pushed[index] {
                let now = self.positions[range].iter().zip(reference);
                let most = now.fold(0.0_f32, |m, (x, r)| m.max((x - r).norm_squared()));
                furthest = furthest.max(most.sqrt());
            }
            self.last_furthest[index] = squared.sqrt();
            self.furthest[index] = furthest;
            if furthest > self.budgets[index] {
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
            if self.is_away(list.b) {
                list.candidates.clear();
                list.spare = f32::INFINITY;
            } else if stale[list.a] || stale[list.b] {
                self.detect(list, &mut cells);
            }
        }
        self.lists = lists;
    }

    /// Whether a part is that of a collider which cannot meet anything now.
    fn is_away(&self, part: usize) -> bool {
        let own = self.world.iter().find(|c| c.part == Some(part));
        own.is_some_and(|c| c.is_away)
    }

    fn renew(&mut self, index: usize) {
        self.report.detections += 1;
        let part = &mut self.parts[index];
        let range = part.first as usize..(part.first + part.count) as usize;
        self.reference[range.clone()].copy_from_slice(&self.positions[range.clone()]);
        let mut furthest = 0.0_f32;
        for i in range {
            let way = (self.wanted[i] - self.positions[i]).norm();
            furthest = furthest.max(way);
        }
        self.furthest[index] = furthest;
        self.last_furthest[index] = furthest;
        let [least, most] = BUDGETS;
        self.budgets[index] = (2.5 * furthest)
            .clamp(least, most)
            .max(1.01 * furthest + MARGIN as f32);
        part.refit(&self.reference);
    }

    /// How much two elements keep apart at most, over a whole list. (mm)
    fn thickest(&self, list: &PairList) -> f64 {
        match list.collider {
            None => return self.options.thickness,
            Some(c) if self.world[c].shape.is_round => return GUARD_THICKNESS,
            Some(_) => {}
        }
        let part = &self.parts[list.a];
        let covers = &self.cover[part.first as usize..(part.first + part.count) as usize];
        f64::from(covers.iter().fold(0.0_f32, |m, &c| m.max(c)))
    }

    fn detect(&self, list: &mut PairList, cells: &mut Vec<[u32; 2]>) {
        list.candidates.clear();
        let is_slow = self.budgets[list.a] <= SMALL_BUDGET;
        if list.a == list.b && is_slow && self.parts[list.a].is_flat() {
            list.spare = f32::INFINITY;
            return;
        }
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
        let is_round = list.collider.is_some_and(|c| self.world[c].shape.is_round);
        let (out, spare) = (&mut list.candidates, &mut list.spare);
        *spare = f32::INFINITY;
        let mut offer = |kind: PairKind, nodes: [u32; 4]| {
            let at = nodes.map(|n| wide(&self.reference[n as usize]));
            let thickness = if is_cloth {
                self.options.thickness
            } else if is_round {
                GUARD_THICKNESS
            } else {
                self.covered(&nodes)
            };
            let limit = thickness + slack;
            if boxes_apart(kind, &at, limit) {
                return;
            }
            let (first, second) = nodes.split_at(kind.first_count());
            if own && self.rules.side(a, first, second) != Side::Apart {
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
            *spare = spare.min((distance - thickness) as f32);
            out.push(Candidate {
                nodes,
                kind,
                distance: distance as f32,
                thickness: thickness as f32,
            });
        };
        for &[ca, cb] in cells.iter() {
            if own && a.are_next_cells(ca, cb)
                || a.are_apart(ca, b, cb, reach as f32, &self.reference)
            {
                continue;
            }
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

    /// The thickness, or half the distance at rest where that is less. (mm)
    fn at_most_rest(&self, kind: PairKind, nodes: &[u32; 4]) -> f64 {
        let at = nodes.map(|n| wide(&self.rest[n as usize]));
        let rest = weighted(&closest_weights(kind, &at), &at).norm();
        self.options.thickness.min(REST_SHARE * rest)
    }

    /// Finds candidates that may come nearer than their thickness on the way to `wanted`.
    ///
    /// First without allowance, to see which parts are in contact at all; then, for these, with
    /// what pushing them apart may add. `everything` takes all parts for that.
    pub(super) fn collect(&mut self, everything: bool) {
        self.actives.clear();
        self.is_pushed.fill(everything);
        for s in &self.smooth {
            self.is_pushed[self.part_of[s.node as usize] as usize] = true;
        }
        for b in &self.bonds {
            self.is_pushed[self.part_of[b.nodes[0] as usize] as usize] = true;
        }
        let mut has_travel = vec![false; self.parts.len()];
        let lists = std::mem::take(&mut self.lists);
        if !everything {
            for list in &lists {
                if self.is_pushed[list.a] && self.is_pushed[list.b] || self.is_far(list, 0.0) {
                    continue;
                }
                self.measure_travel(list.a, &mut has_travel);
                self.measure_travel(list.b, &mut has_travel);
                if list
                    .candidates
                    .iter()
                    .any(|c| self.may_close(c, 0.0).is_some())
                {
                    self.is_pushed[list.a] = true;
                    self.is_pushed[list.b] = true;
                }
            }
        }
        for (index, list) in lists.iter().enumerate() {
            let is_pushed = self.is_pushed[list.a] || self.is_pushed[list.b];
            if !is_pushed || self.is_far(list, 2.0 * MARGIN) {
                continue;
            }
            self.measure_travel(list.a, &mut has_travel);
            self.measure_travel(list.b, &mut has_travel);
            for c in &list.candidates {
                let Some((weights, r)) = self.may_close(c, 2.0 * MARGIN) else {
                    continue;
                };
                let distance = r.norm();
                self.actives.push(Active {
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
        self.lists = lists;
    }

    /// Whether nothing in a list can come within `more` of its thickness.
    fn is_far(&self, list: &PairList, more: f64) -> bool {
        list.spare - self.furthest[list.a] - self.furthest[list.b] > more as f32
    }

    /// Measures how far each node of a part is from its reference, now and as wanted.
    fn measure_travel(&mut self, index: usize, has_travel: &mut [bool]) {
        if std::mem::replace(&mut has_travel[index], true) {
            return;
        }
        let part = &self.parts[index];
        for i in part.first as usize..(part.first + part.count) as usize {
            let r = &self.reference[i];
            let squared = (self.wanted[i] - r)
                .norm_squared()
                .max((self.positions[i] - r).norm_squared());
            self.travel[i] = squared.sqrt();
        }
    }

    /// Weights and vector between the closest points of a candidate, if it may come within
    /// `more` of its thickness on the way.
    #[inline]
    fn may_close(&self, c: &Candidate, more: f64) -> Option<([f64; 4], Vector)> {
        let [t0, t1, t2, t3] = c.nodes.map(|n| self.travel[n as usize]);
        let travel = match c.kind {
            PairKind::VertexTriangle => t0 + t1.max(t2).max(t3),
            PairKind::EdgeEdge => t0.max(t1) + t2.max(t3),
        };
        let limit = c.thickness + more as f32;
        if c.distance - travel > limit {
            return None;
        }
        let at = c.nodes.map(|n| wide(&self.positions[n as usize]));
        let to = c.nodes.map(|n| wide(&self.wanted[n as usize]));
        let weights = closest_weights(c.kind, &at);
        let r = weighted(&weights, &at);
        (r.norm() - approach(c.kind, &at, &to) <= f64::from(limit)).then_some((weights, r))
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
