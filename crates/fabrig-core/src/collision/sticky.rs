//! Lips that stick.
//!
//! A bond holds a node of one lip to a place on the other, no further away than they were when
//! it formed. It forms where the skin of the lips touches, which is told by who moves the skin:
//! the patches lie some millimetres inside. It breaks when it has to pull harder than its
//! strength or is drawn longer than a larger gap: between forming and breaking lies the
//! hysteresis. As the jaw opens, bonds break where the pull is largest, and the lips peel.

use super::contact::Contact;
use super::distance::{PairKind, closest_weights, weighted, wide};
use super::project::narrow;

/// A node held to a place on a triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bond {
    pub(crate) nodes: [u32; 4],
    weights: [f64; 4],
    /// Length up to which it does not pull. (mm)
    length: f64,
    /// What it pulled in this pass. (mm)
    pub(crate) pull: f64,
    is_broken: bool,
}

/// One of the two lips.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lip {
    /// The upper one.
    Upper,
    /// The lower one.
    Lower,
}

impl Contact {
    /// Which lip each node of the ring that may stick belongs to: those of its first
    /// [`Stickiness::rows`](super::Stickiness::rows) rows, row after row.
    pub fn set_lips(&mut self, lip_of: &[Lip]) {
        let Some((part, past)) = self.sticky else {
            return;
        };
        let count = (past - self.parts[part].first) as usize;
        self.lip_of = lip_of.iter().copied().take(count).collect();
        self.touching = vec![None; self.lip_of.len()];
    }

    /// Says at which of these nodes the skin of the lips touches now, when it was moved after a
    /// frame: there bonds form.
    pub fn set_touching(&mut self, is_touching: impl IntoIterator<Item = bool>) {
        for ((slot, lip), is_touching) in
            self.touching.iter_mut().zip(&self.lip_of).zip(is_touching)
        {
            *slot = is_touching.then_some(*lip);
        }
        self.form_bonds();
    }

    /// One sweep over all bonds; those that are overstretched break.
    pub(super) fn pull_bonds(&mut self, force_per_shift: f64) {
        let Some(sticky) = self.options.sticky_lips else {
            return;
        };
        let mut bonds = std::mem::take(&mut self.bonds);
        for bond in &mut bonds {
            if bond.is_broken {
                continue;
            }
            let x = bond.nodes.map(|n| wide(&self.wanted[n as usize]));
            let r = weighted(&bond.weights, &x);
            let distance = r.norm();
            if distance > bond.length + sticky.break_gap {
                bond.is_broken = true;
                continue;
            }
            let excess = distance - bond.length;
            if excess <= 0.0 {
                continue;
            }
            let sum: f64 = bond.weights.iter().map(|w| w * w).sum();
            let force_of = self.node_mass[bond.nodes[0] as usize] * force_per_shift / sum;
            bond.pull += excess;
            let force = bond.pull * force_of;
            self.report.bond_force = self.report.bond_force.max(force);
            if force > sticky.strength {
                bond.is_broken = true;
                continue;
            }
            for k in 0..4 {
                let by = r * (-bond.weights[k] * excess / (distance * sum));
                self.wanted[bond.nodes[k] as usize] = narrow(&(x[k] + by));
            }
        }
        self.bonds = bonds;
    }

    /// At the end of a frame: forgets broken bonds.
    pub(super) fn drop_broken(&mut self) {
        let before = self.bonds.len();
        self.bonds.retain(|b| !b.is_broken);
        self.report.broken_bonds += before - self.bonds.len();
        self.report.bonds = self.bonds.len();
    }

    /// Forms bonds where the skin of the lips touches.
    fn form_bonds(&mut self) {
        let Some((part, past)) = self.sticky else {
            return;
        };
        let first = self.parts[part].first;
        let mut is_taken = vec![false; (past - first) as usize];
        for b in &self.bonds {
            is_taken[(b.nodes[0] - first) as usize] = true;
        }
        let triangles: Vec<[u32; 3]> = self.parts[part]
            .triangles()
            .filter(|t| t.iter().all(|&n| n < past))
            .collect();
        for (slot, lip) in self.touching.iter().enumerate() {
            let (Some(lip), false) = (lip, is_taken[slot]) else {
                continue;
            };
            // The nearest place on the other lip.
            let node = first + slot as u32;
            let is_other = |n: u32| self.lip_of[(n - first) as usize] != *lip;
            let places = triangles.iter().filter(|t| t.iter().all(|&n| is_other(n)));
            let places = places.map(|&[a, b, c]| {
                let nodes = [node, a, b, c];
                let x = nodes.map(|n| wide(&self.positions[n as usize]));
                let weights = closest_weights(PairKind::VertexTriangle, &x);
                (weighted(&weights, &x).norm(), nodes, weights)
            });
            let nearest = places.min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((length, nodes, weights)) = nearest {
                self.bonds.push(Bond {
                    nodes,
                    weights,
                    length,
                    pull: 0.0,
                    is_broken: false,
                });
            }
        }
        self.report.bonds = self.bonds.len();
    }
}
