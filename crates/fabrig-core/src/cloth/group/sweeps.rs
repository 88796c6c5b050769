//! Several sweeps in one substep, with multipliers that are carried from sweep to sweep.
//!
//! The first sweep is the same as a single one; without the multipliers a second one would
//! pull again towards the whole constraint, and stiffness would grow with the count.
//!
//! Source: Macklin, Müller & Chentanez 2016, *XPBD*, eqs. 18 and 26.

use super::interface::Substep;
use super::state::Group;
use crate::cloth::constraints::pressure::{PadFaces, pad_volume};
use crate::cloth::constraints::stretch::RestLengths;
use crate::machine::{Real, Vec3};

/// Lengths below this are taken for this. (mm)
const SHORTEST: f64 = 1e-12;

/// One multiplier per constraint.
#[derive(Debug, Clone)]
pub(super) struct Multipliers<R> {
    edges: Vec<R>,
    diagonals: Vec<R>,
    triples: Vec<Vec3<R>>,
}

impl<R> Default for Multipliers<R> {
    fn default() -> Self {
        Self {
            edges: Vec::new(),
            diagonals: Vec::new(),
            triples: Vec::new(),
        }
    }
}

/// Compliances of distance constraints, damped or not.
struct Compliance<R> {
    stretch: R,
    compression: R,
    gamma: R,
}

impl<R: Real> Group<R> {
    /// The sweep, `count` times.
    #[inline(always)]
    pub(super) fn sweep_lanes(&mut self, substep: &Substep, count: u32) {
        let h_e2 = self.h_e * self.h_e;
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let mut kept = std::mem::take(&mut self.multipliers);
        kept.edges.clear();
        kept.edges.resize(self.lists.edges.len(), zero);
        kept.diagonals.clear();
        kept.diagonals.resize(self.lists.diagonals.len(), zero);
        kept.triples.clear();
        kept.triples.resize(self.lists.triples.len(), Vec3::zero());
        let mut pressure = zero;
        let progress = R::splat(substep.progress[1]);
        let stretch = Compliance {
            stretch: one / (self.stretch[0] * h_e2),
            compression: one / (self.stretch[1] * h_e2),
            gamma: self.stretch_damping_time / self.h_e,
        };
        let shear = one / (self.shear * h_e2);
        let shear = Compliance {
            stretch: shear,
            compression: shear,
            gamma: zero,
        };
        for sweep in 0..count {
            if sweep > 0 {
                for (x, target) in self.solution.iter_mut().zip(&self.targets) {
                    *x -= *target;
                }
            }
            if self.has_pressure {
                self.sweep_pressure(one / (self.pressure * h_e2), &mut pressure);
            }
            self.sweep_bend(one / (self.bend * h_e2), &mut kept.triples);
            for (x, target) in self.solution.iter_mut().zip(&self.targets) {
                *x = *target + *x;
            }
            sweep_lengths(
                &self.lists.diagonals,
                &mut self.solution,
                &self.inv_masses,
                (&self.diagonal_lengths, progress),
                &self.resting,
                &shear,
                &mut kept.diagonals,
            );
            sweep_lengths(
                &self.lists.edges,
                &mut self.solution,
                &self.inv_masses,
                (&self.edge_lengths, progress),
                &self.resting,
                &stretch,
                &mut kept.edges,
            );
        }
        self.multipliers = kept;
    }

    #[inline(always)]
    fn sweep_pressure(&mut self, compliance: R, multiplier: &mut R) {
        let faces = PadFaces {
            cells: &self.lists.cells,
            targets: &self.targets,
            heights: &self.floor.heights,
        };
        let gained = pad_volume(&faces, &self.solution, &mut self.gradient) - self.floor.rest;
        let compliance = compliance.max(R::splat(1e-30));
        // Without pressure the compliance is infinite, and so would be its product with zero.
        let is_on = R::select_less(compliance, R::splat(1e30), R::splat(1.0), R::splat(0.0));
        let held = R::select_less(R::splat(0.0), is_on, compliance * *multiplier, *multiplier);
        let mut bottom = compliance;
        for (g, &w) in self.gradient.iter().zip(&self.inv_masses) {
            bottom += g.dot(*g) * w;
        }
        let change = -((gained + held) / bottom);
        *multiplier += change * is_on;
        let nodes = self.solution.iter_mut().zip(&self.gradient);
        for ((x, g), &w) in nodes.zip(&self.inv_masses) {
            *x += *g * (change * w);
        }
    }

    #[inline(always)]
    fn sweep_bend(&mut self, compliance: R, multipliers: &mut [Vec3<R>]) {
        let (one, two, four) = (R::splat(1.0), R::splat(2.0), R::splat(4.0));
        let x = &mut self.solution;
        let triples = self.lists.triples.iter().zip(multipliers);
        for (index, (&[i, j, k], multiplier)) in triples.enumerate() {
            let (i, j, k) = (i as usize, j as usize, k as usize);
            let s = x[i] + x[k] - x[j] - x[j];
            let turned = one + s.dot(s) * self.inv_edge_squared;
            let turned = turned * turned;
            // Everything times the share of the stiffness that the dropoff leaves, so that no
            // stiffness is no infinity.
            let part = (turned - self.bend_dropoff) / turned;
            let compliance = match self.bend_softness.get(index) {
                Some(&softness) => compliance * softness,
                None => compliance,
            };
            let soft = R::select_less(compliance, R::splat(1e30), compliance, R::splat(1e30));
            let sum = self.inv_masses[i] + self.inv_masses[k] + four * self.inv_masses[j];
            let change = (s * part + *multiplier * soft) * -(one / (sum * part + soft));
            *multiplier += change;
            x[i] += change * self.inv_masses[i];
            x[j] += change * -(two * self.inv_masses[j]);
            x[k] += change * self.inv_masses[k];
        }
    }
}

/// Projects edges or diagonals with their multipliers.
#[inline(always)]
fn sweep_lengths<R: Real>(
    edges: &[[u32; 2]],
    x: &mut [Vec3<R>],
    inv_masses: &[R],
    (rest, progress): (&RestLengths<R>, R),
    resting: &[Vec3<R>],
    compliance: &Compliance<R>,
    multipliers: &mut [R],
) {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    for (edge, (&[i, j], multiplier)) in edges.iter().zip(multipliers).enumerate() {
        let (i, j) = (i as usize, j as usize);
        let d = x[i] - x[j];
        let length = d.dot(d).sqrt().max(R::splat(SHORTEST));
        let c = length - rest.at(edge, progress);
        let alpha = R::select_less(c, zero, compliance.compression, compliance.stretch)
            * rest.softness(edge);
        let alpha = R::select_less(alpha, R::splat(1e30), alpha, R::splat(1e30));
        let drift = compliance.gamma * (d.dot(d - (resting[i] - resting[j])) / length);
        let bottom = (inv_masses[i] + inv_masses[j]) * (one + compliance.gamma) + alpha;
        let change = -((c + drift + alpha * *multiplier) / bottom);
        *multiplier += change;
        let along = d * (change / length);
        x[i] += along * inv_masses[i];
        x[j] += along * -inv_masses[j];
    }
}
