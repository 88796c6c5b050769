//! Pairs: what a group tells the others of its paired nodes, and what it hears from them.

use super::interface::{GroupPairs, Ports};
use super::state::Group;
use crate::cloth::constraints::attachment::{OrderFreeSum, PairEnd, PairVector, pair_share};
use crate::machine::Real;

/// Marks versions of masses that do not yield.
const SLEEPING: u64 = 1 << 40;

/// The pairs of a group, made ready for substeps: one row of partners after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct PairTable {
    /// Index of the group itself.
    group: usize,
    /// (node, lane) of every node that has pairs.
    nodes: Vec<(u32, u32)>,
    /// First partner of each node, and the end.
    starts: Vec<u32>,
    /// (group, port) of each partner.
    partners: Vec<(u32, u32)>,
    /// k of each. [mass/s^2]
    stiffnesses: Vec<f64>,
    /// Share of the distance that the own node goes for each partner.
    shares: Vec<f64>,
    /// Where each node is moved to. (mm)
    moved: Vec<PairVector>,
    /// Versions of all groups' masses that the shares are for, summed.
    version: Option<u64>,
}

impl PairTable {
    pub(super) fn new(group: usize, pairs: &GroupPairs) -> Self {
        let mut out = Self {
            group,
            moved: vec![PairVector::default(); pairs.nodes.len()],
            nodes: pairs.nodes.clone(),
            starts: vec![0],
            ..Self::default()
        };
        for partners in &pairs.partners {
            for partner in partners {
                out.partners
                    .push((partner.group as u32, partner.port as u32));
                out.stiffnesses.push(partner.stiffness);
            }
            out.starts.push(out.partners.len() as u32);
        }
        out
    }

    /// First partner of a node and the end.
    fn row(&self, node: usize) -> std::ops::Range<usize> {
        self.starts[node] as usize..self.starts[node + 1] as usize
    }
}

impl<R: Real> Group<R> {
    #[inline(always)]
    pub(super) fn write_ports(&self, ports: &mut Ports) {
        let pairs = &self.pairs;
        ports.displacements.clear();
        ports
            .displacements
            .extend(pairs.nodes.iter().map(|&(node, lane)| {
                let x = &self.solution[node as usize];
                let [x, y, z] = x.lane(lane as usize);
                [x, y, z, 0.0]
            }));
        if ports.version != self.masses_version || ports.ends.len() != pairs.nodes.len() {
            ports.version = self.masses_version;
            ports.ends.clear();
            for (k, &(node, lane)) in pairs.nodes.iter().enumerate() {
                ports.ends.push(PairEnd {
                    inv_mass: self.inv_masses[node as usize].lane(lane as usize),
                    pair_count: pairs.row(k).len() as f64,
                });
            }
        }
    }

    /// What partners see of a group that sleeps: nodes that keep their displacement.
    pub(super) fn write_sleeping_ports(&self, ports: &mut Ports) {
        let pairs = &self.pairs;
        ports.displacements.clear();
        ports.ends.clear();
        for (k, &(node, lane)) in pairs.nodes.iter().enumerate() {
            let [x, y, z] = self.displacements[node as usize].lane(lane as usize);
            ports.displacements.push([x, y, z, 0.0]);
            ports.ends.push(PairEnd {
                inv_mass: 0.0,
                pair_count: pairs.row(k).len() as f64,
            });
        }
        ports.version = SLEEPING + self.masses_version;
    }

    /// Projects all pairs of the group's nodes from what `ports` say, its own among them.
    #[inline(always)]
    pub(super) fn solve_pairs(&mut self, ports: &[Ports]) {
        if self.pairs.nodes.is_empty() {
            return;
        }
        let version = ports.iter().map(|p| p.version).sum();
        if self.pairs.version != Some(version) {
            self.pairs.version = Some(version);
            self.refresh_shares(ports);
        }
        let pairs = &mut self.pairs;
        // From the ports too: they lie side by side, the nodes do not.
        let owns = &ports[pairs.group].displacements;
        let rows = pairs.starts.iter().zip(&pairs.starts[1..]);
        // All four components are stored, so that they stay in one register.
        for ((moved, own), (&first, &end)) in pairs.moved.iter_mut().zip(owns).zip(rows) {
            let row = first as usize..end as usize;
            let mut sum = OrderFreeSum::default();
            for (&(group, port), &share) in
                pairs.partners[row.clone()].iter().zip(&pairs.shares[row])
            {
                let other = &ports[group as usize].displacements[port as usize];
                sum.add(own, other, share);
            }
            *moved = sum.from(own);
        }
        for (&(node, lane), moved) in pairs.nodes.iter().zip(&pairs.moved) {
            let [x, y, z, _] = *moved;
            self.solution[node as usize].set_lane(lane as usize, [x, y, z]);
        }
    }

    /// Shares change only with the masses, so hardly ever within a frame.
    #[inline(never)]
    fn refresh_shares(&mut self, ports: &[Ports]) {
        let pairs = &mut self.pairs;
        pairs.shares.clear();
        for k in 0..pairs.nodes.len() {
            let (node, lane) = pairs.nodes[k];
            let h_e = self.h_e.lane(lane as usize);
            let row = pairs.row(k);
            let own = PairEnd {
                inv_mass: self.inv_masses[node as usize].lane(lane as usize),
                pair_count: row.len() as f64,
            };
            for partner in row {
                let (group, port) = pairs.partners[partner];
                let other = &ports[group as usize].ends[port as usize];
                let compliance = 1.0 / (pairs.stiffnesses[partner] * h_e * h_e);
                pairs.shares.push(pair_share(&own, other, compliance));
            }
        }
    }
}
