//! The robust mode: vertex block descent with a checked decrease of energy.
//!
//! An implicit step minimizes, over the positions of a patch,
//!
//! `G(x) = sum 1/(2w) |x - x^|^2 + h_e^2 (E_stretch + E_shear + E_bend + E_pressure + D)`
//!
//! with the inertial target x^, in which the diagonal terms are folded, and the stretch damping
//! D as a quadratic of this substep. A pass goes over the nodes and moves each to the minimum
//! of a quadratic that bounds G from its own 3 x 3 derivatives, the geometric stiffness of
//! compressed edges left out, so that every block is positive definite. After each pass G is
//! evaluated; where it has risen, the pass is halved, and taken back if that does not help. So
//! G never rises, whatever stiffness, step or shape.
//!
//! Source: Chen, Liu, Yang & Yuksel 2024, *Vertex block descent*.

use super::interface::Substep;
use super::state::Group;
use crate::cloth::constraints::bend::{BendCompliance, bend_energy};
use crate::cloth::constraints::grid_lists::GridLists;
use crate::cloth::constraints::pressure::{PadFaces, pad_volume};
use crate::cloth::constraints::shear::shear_energy;
use crate::cloth::constraints::stretch::stretch_energy;
use crate::machine::{Real, Vec3};

/// Passes for each sweep asked for.
const PASSES: u32 = 4;

/// Halvings of a pass before it is taken back.
const HALVINGS: usize = 4;

/// Lengths below this are taken for this. (mm)
const SHORTEST: f64 = 1e-9;

/// Constraints by node.
#[derive(Debug, Clone)]
pub(super) struct Incidence {
    /// (edge, other node) of each node.
    edges: Vec<Vec<[u32; 2]>>,
    /// (diagonal, other node) of each node.
    diagonals: Vec<Vec<[u32; 2]>>,
    /// Triples of each node, and whether it is the middle.
    triples: Vec<Vec<(u32, bool)>>,
}

impl Incidence {
    pub(super) fn new(lists: &GridLists, node_count: usize) -> Self {
        let mut out = Self {
            edges: vec![Vec::new(); node_count],
            diagonals: vec![Vec::new(); node_count],
            triples: vec![Vec::new(); node_count],
        };
        for (pairs, by_node) in [
            (&lists.edges, &mut out.edges),
            (&lists.diagonals, &mut out.diagonals),
        ] {
            for (index, &[i, j]) in pairs.iter().enumerate() {
                by_node[i as usize].push([index as u32, j]);
                by_node[j as usize].push([index as u32, i]);
            }
        }
        for (index, &[i, j, k]) in lists.triples.iter().enumerate() {
            for (node, is_middle) in [(i, false), (j, true), (k, false)] {
                out.triples[node as usize].push((index as u32, is_middle));
            }
        }
        out
    }
}

/// A gradient and a symmetric matrix of second derivatives: xx, yy, zz, xy, xz, yz.
struct Block<R> {
    gradient: Vec3<R>,
    matrix: [R; 6],
}

impl<R: Real> Block<R> {
    /// Adds `a I + b d d^T`.
    #[inline(always)]
    fn add(&mut self, a: R, b: R, d: Vec3<R>) {
        let [xx, yy, zz, xy, xz, yz] = &mut self.matrix;
        let e = d * b;
        *xx += a + e.x * d.x;
        *yy += a + e.y * d.y;
        *zz += a + e.z * d.z;
        *xy += e.x * d.y;
        *xz += e.x * d.z;
        *yz += e.y * d.z;
    }

    /// The step to the minimum, by Cholesky's LDL^T: the matrix is positive definite, as the
    /// node's mass is in it.
    #[inline(always)]
    fn step(&self) -> Vec3<R> {
        let one = R::splat(1.0);
        let [xx, yy, zz, xy, xz, yz] = self.matrix;
        let g = self.gradient;
        let inv_x = one / xx;
        let (ly, lz) = (xy * inv_x, xz * inv_x);
        let inv_y = one / (yy - ly * xy);
        let mixed = yz - ly * xz;
        let lyz = mixed * inv_y;
        let inv_z = one / (zz - lz * xz - lyz * mixed);
        let gy = g.y - ly * g.x;
        let gz = g.z - lz * g.x - lyz * gy;
        let z = gz * inv_z;
        let y = gy * inv_y - lyz * z;
        let x = g.x * inv_x - ly * y - lz * z;
        Vec3::new(-x, -y, -z)
    }
}

impl<R: Real> Group<R> {
    /// Descends from the inertial target in `solution` (displacements), leaving positions.
    #[inline(always)]
    pub(super) fn descend_lanes(&mut self, substep: &Substep, sweeps: u32) {
        let progress = R::splat(substep.progress[1]);
        let incidence = self
            .incidence
            .take()
            .unwrap_or_else(|| Box::new(Incidence::new(&self.lists, self.solution.len())));
        for (x, target) in self.solution.iter_mut().zip(&self.targets) {
            *x = *target + *x;
        }
        let mut inertial = std::mem::take(&mut self.inertial);
        inertial.clone_from(&self.solution);
        let mut before = std::mem::take(&mut self.trial);
        let mut energy = self.objective(&inertial, progress);
        for _ in 0..PASSES * sweeps {
            before.clone_from(&self.solution);
            self.pass(&incidence, &inertial, progress);
            let mut after = self.objective(&inertial, progress);
            for halving in 0..=HALVINGS {
                // Written so that what is no number counts as risen.
                let share = if halving < HALVINGS { 0.5 } else { 0.0 };
                let kept = R::select_less(
                    energy,
                    after,
                    R::splat(share),
                    R::select_less(
                        after,
                        energy + energy.max(R::splat(1e-30)),
                        R::splat(1.0),
                        R::splat(share),
                    ),
                );
                if !R::any_less(kept, R::splat(1.0)) {
                    break;
                }
                for (x, old) in self.solution.iter_mut().zip(&before) {
                    *x = Vec3::new(
                        blend(old.x, x.x, kept),
                        blend(old.y, x.y, kept),
                        blend(old.z, x.z, kept),
                    );
                }
                after = self.objective(&inertial, progress);
            }
            energy = after;
        }
        self.inertial = inertial;
        self.trial = before;
        self.incidence = Some(incidence);
    }

    /// One pass over the nodes.
    #[inline(always)]
    fn pass(&mut self, incidence: &Incidence, inertial: &[Vec3<R>], progress: R) {
        let h_e2 = self.h_e * self.h_e;
        let (zero, one, two, four) = (R::splat(0.0), R::splat(1.0), R::splat(2.0), R::splat(4.0));
        let mut volume = zero;
        if self.has_pressure {
            volume = self.volume();
        }
        let stiff = [self.stretch[0] * h_e2, self.stretch[1] * h_e2];
        let shear = [self.shear * h_e2; 2];
        let gamma = self.stretch_damping_time / self.h_e;
        let bend = self.bend * h_e2;
        let pressure = self.pressure * h_e2;
        for i in 0..self.solution.len() {
            let x = self.solution[i];
            let mass = one / self.inv_masses[i];
            let mut block = Block {
                gradient: (x - inertial[i]) * mass,
                matrix: [mass, mass, mass, zero, zero, zero],
            };
            for &[edge, other] in &incidence.edges[i] {
                let d = x - self.solution[other as usize];
                let rest = self.edge_lengths.at(edge as usize, progress);
                let softness = self.edge_lengths.softness(edge as usize);
                let k = spring(&mut block, d, rest, stiff.map(|k| k / softness));
                let resting = self.resting[i] - self.resting[other as usize];
                let inv = one / d.dot(d).max(R::splat(SHORTEST * SHORTEST));
                let drag = k * gamma * inv;
                block.gradient += d * (drag * d.dot(d - resting));
                block.add(zero, drag, d);
            }
            for &[diagonal, other] in &incidence.diagonals[i] {
                let d = x - self.solution[other as usize];
                let rest = self.diagonal_lengths.at(diagonal as usize, progress);
                let softness = self.diagonal_lengths.softness(diagonal as usize);
                spring(&mut block, d, rest, shear.map(|k| k / softness));
            }
            for &(triple, is_middle) in &incidence.triples[i] {
                let [a, b, c] = self.lists.triples[triple as usize];
                let (a, b, c) = (a as usize, b as usize, c as usize);
                let ua = self.solution[a] - self.targets[a];
                let ub = self.solution[b] - self.targets[b];
                let uc = self.solution[c] - self.targets[c];
                let s = ua + uc - ub * two;
                let turned = one + s.dot(s) * self.inv_edge_squared;
                let stiff = match self.bend_softness.get(triple as usize) {
                    Some(&softness) => bend / softness,
                    None => bend,
                };
                let k = stiff * (one - self.bend_dropoff / (turned * turned));
                if is_middle {
                    block.gradient += s * -(two * k);
                    // Without the dropoff it bounds the energy's second derivative.
                    block.add(four * stiff, zero, s);
                } else {
                    block.gradient += s * k;
                    block.add(stiff, zero, s);
                }
            }
            if self.has_pressure {
                let g = self.gradient[i];
                block.gradient += g * (pressure * volume);
                block.add(zero, pressure, g);
            }
            let step = block.step();
            self.solution[i] = x + step;
            if self.has_pressure {
                volume += self.gradient[i].dot(step);
            }
        }
    }

    /// Volume gained, with its gradient in `gradient`. [mm^3]
    #[inline(always)]
    fn volume(&mut self) -> R {
        for i in 0..self.solution.len() {
            self.scratch[i] = self.solution[i] - self.targets[i];
        }
        let faces = PadFaces {
            cells: &self.lists.cells,
            targets: &self.targets,
            heights: &self.floor.heights,
        };
        pad_volume(&faces, &self.scratch, &mut self.gradient) - self.floor.rest
    }

    /// G, lane by lane.
    #[inline(always)]
    fn objective(&mut self, inertial: &[Vec3<R>], progress: R) -> R {
        let half = R::splat(0.5);
        let h_e2 = self.h_e * self.h_e;
        let volume = self.volume();
        let x = &self.solution;
        let mut sum = R::splat(0.0);
        for i in 0..x.len() {
            let away = x[i] - inertial[i];
            sum += away.dot(away) / self.inv_masses[i];
        }
        let [stretch, compression] = stretch_energy(
            &self.lists.edges,
            x,
            (&self.edge_lengths, progress),
            self.stretch,
        );
        let diagonals = (&self.diagonal_lengths, progress);
        let shear = shear_energy(&self.lists.diagonals, x, diagonals, self.shear);
        let bend = BendCompliance {
            compliance: R::splat(1.0),
            dropoff: self.bend_dropoff,
            inv_edge_squared: self.inv_edge_squared,
        };
        let bend = bend_energy(
            &self.lists.triples,
            &self.scratch,
            self.bend,
            &bend,
            &self.bend_softness,
        );
        let mut elastic = stretch + compression + shear + bend;
        if self.has_pressure {
            elastic += half * self.pressure * volume * volume;
        }
        let damping = self.damping_objective(progress);
        half * sum + h_e2 * (elastic + damping)
    }

    /// D: half of gamma k times the square of each edge's rate. [mass mm^2/s^2]
    #[inline(always)]
    fn damping_objective(&self, progress: R) -> R {
        let gamma = self.stretch_damping_time / self.h_e;
        let mut sum = R::splat(0.0);
        for (edge, &[i, j]) in self.lists.edges.iter().enumerate() {
            let (i, j) = (i as usize, j as usize);
            let d = self.solution[i] - self.solution[j];
            let squared = d.dot(d).max(R::splat(SHORTEST * SHORTEST));
            let rate = d.dot(d - (self.resting[i] - self.resting[j]));
            let rest = self.edge_lengths.at(edge, progress);
            let k = R::select_less(squared, rest * rest, self.stretch[1], self.stretch[0]);
            sum += k * rate * rate / (squared * self.edge_lengths.softness(edge));
        }
        R::splat(0.5) * gamma * sum
    }
}

/// Adds a spring of stiffness `k` (stretched, compressed) to a node's block. Returns which k.
#[inline(always)]
fn spring<R: Real>(block: &mut Block<R>, d: Vec3<R>, rest: R, k: [R; 2]) -> R {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let squared = d.dot(d).max(R::splat(SHORTEST * SHORTEST));
    let length = squared.sqrt();
    let c = length - rest;
    let k = R::select_less(c, zero, k[1], k[0]);
    let inv = one / squared;
    // Across the edge only a stretched spring is stiff.
    let across = (c / length).max(zero);
    block.gradient += d * (k * c / length);
    block.add(k * across, k * (one - across) * inv, d);
    k
}

/// `old + share (new - old)`, and exactly `new` or `old` at the ends.
#[inline(always)]
fn blend<R: Real>(old: R, new: R, share: R) -> R {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let mixed = old + share * (new - old);
    let started = R::select_less(zero, share, mixed, old);
    R::select_less(share, one, started, new)
}

/// What the fast solve and the descent share out: lanes in trouble take the descent's answer.
pub(super) fn merge<R: Real>(fast: &mut [Vec3<R>], robust: &[Vec3<R>], is_robust: &[bool]) {
    for (a, b) in fast.iter_mut().zip(robust) {
        for (lane, &is_robust) in is_robust.iter().enumerate() {
            if is_robust {
                a.set_lane(lane, b.lane(lane));
            }
        }
    }
}
