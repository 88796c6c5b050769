//! Lips that stick.
//!
//! A bond holds a node of one lip to a place on the other, no further away than they were when
//! it formed. It forms where lips come within a gap, and breaks when it has to pull harder
//! than its strength or is drawn longer than a larger gap: between forming and breaking lies
//! the hysteresis. As the jaw opens, bonds break where the pull is largest, and the lips peel.

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

impl Contact {
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
            if bond.pull * force_of > sticky.strength {
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

    /// At the end of a frame: forgets broken bonds and forms new ones.
    pub(super) fn form_bonds(&mut self) {
        let Some(sticky) = self.options.sticky_lips else {
            return;
        };
        let before = self.bonds.len();
        self.bonds.retain(|b| !b.is_broken);
        self.report.broken_bonds += before - self.bonds.len();
        let Some((part, past)) = self.sticky else {
            return;
        };
        let mut taken: Vec<bool> = vec![false; past as usize];
        for b in &self.bonds {
            taken[b.nodes[0] as usize] = true;
        }
        let first = self.parts[part].first;
        let is_lip = |n: u32| n >= first && n < past;
        // The nearest place for each node.
        let mut best: std::collections::BTreeMap<u32, (f64, Bond)> = Default::default();
        for list in self.lists.iter().filter(|l| l.a == part && l.b == part) {
            for c in &list.candidates {
                if c.kind != PairKind::VertexTriangle
                    || !c.nodes.iter().all(|&n| is_lip(n))
                    || taken[c.nodes[0] as usize]
                {
                    continue;
                }
                let x = c.nodes.map(|n| wide(&self.positions[n as usize]));
                let weights = closest_weights(c.kind, &x);
                let distance = weighted(&weights, &x).norm();
                if distance > f64::from(c.thickness) + sticky.gap {
                    continue;
                }
                let bond = Bond {
                    nodes: c.nodes,
                    weights,
                    length: distance,
                    pull: 0.0,
                    is_broken: false,
                };
                match best.get(&c.nodes[0]) {
                    Some((d, _)) if *d <= distance => {}
                    _ => {
                        best.insert(c.nodes[0], (distance, bond));
                    }
                }
            }
        }
        self.bonds.extend(best.into_values().map(|(_, b)| b));
        self.report.bonds = self.bonds.len();
    }
}
