//! Pairs: what a group tells the others of its paired nodes, and what it hears from them.

use std::ops::Range;

use super::interface::GroupPairs;
use super::ports::{OwnPorts, Ports};
use super::state::Group;
use crate::cloth::constraints::attachment::{OrderFreeSum, PairEnd, PairVector, pair_share};
use crate::machine::{Real, Vec3};

/// Marks versions of masses that do not yield.
const SLEEPING: u64 = 1 << 40;

/// Nodes whose corrections are summed up before they are written: registers that are taken apart
/// into lanes go through memory, and this much of it stays near.
const TILE: usize = 64;

/// The pairs of a group, made ready for substeps: one row of partners after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct PairTable {
    /// The group's own ports, one for each of `nodes`.
    own: Range<usize>,
    /// (node, lane) of every node that has pairs.
    nodes: Vec<(u32, u32)>,
    /// Nodes with equally many partners, one after the other.
    runs: Vec<Run>,
    /// Port of each partner.
    partners: Vec<u32>,
    /// k of each. [mass/s^2]
    stiffnesses: Vec<f64>,
    /// Share of the distance that the own node goes for each partner.
    shares: Vec<f64>,
    /// Versions of all groups' masses that the shares are for, summed.
    version: Option<u64>,
}

/// Nodes that have the same number of partners.
#[derive(Debug, Clone)]
struct Run {
    nodes: Range<usize>,
    /// Partners of all of them.
    partners: Range<usize>,
    /// Partners of each.
    count: usize,
}

impl PairTable {
    /// - `first_port`: the port of the first of the nodes
    pub(super) fn new(first_port: usize, pairs: &GroupPairs) -> Self {
        let mut out = Self {
            own: first_port..first_port + pairs.nodes.len(),
            nodes: pairs.nodes.clone(),
            ..Self::default()
        };
        for rows in pairs.partners.chunk_by(|a, b| a.len() == b.len()) {
            let first = out.runs.last().map_or(0, |run| run.nodes.end);
            let partners = rows.iter().flatten();
            out.partners.extend(partners.clone().map(|p| p.port as u32));
            out.stiffnesses.extend(partners.map(|p| p.stiffness));
            let count = rows[0].len();
            out.runs.push(Run {
                nodes: first..first + rows.len(),
                partners: out.partners.len() - count * rows.len()..out.partners.len(),
                count,
            });
        }
        out
    }

    /// Each node's index, and where its partners are.
    fn rows(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        self.runs.iter().flat_map(|run| {
            run.nodes.clone().enumerate().map(|(k, node)| {
                let first = run.partners.start + k * run.count;
                (node, first..first + run.count)
            })
        })
    }
}

impl<R: Real> Group<R> {
    #[inline(always)]
    pub(super) fn write_ports(&self, ports: OwnPorts<'_>) {
        let pairs = &self.pairs;
        for (out, &(node, lane)) in ports.displacements.iter_mut().zip(&pairs.nodes) {
            let [x, y, z] = self.solution[node as usize].lane(lane as usize);
            *out = [x, y, z, 0.0];
        }
        if *ports.version == self.masses_version {
            return;
        }
        *ports.version = self.masses_version;
        for (k, row) in pairs.rows() {
            let (node, lane) = pairs.nodes[k];
            ports.ends[k] = PairEnd {
                inv_mass: self.inv_masses[node as usize].lane(lane as usize),
                pair_count: row.len() as f64,
            };
        }
    }

    /// What partners see of a group that sleeps: nodes that keep their displacement.
    pub(super) fn write_sleeping_ports(&self, ports: OwnPorts<'_>) {
        let pairs = &self.pairs;
        for (k, row) in pairs.rows() {
            let (node, lane) = pairs.nodes[k];
            let [x, y, z] = self.displacements[node as usize].lane(lane as usize);
            ports.displacements[k] = [x, y, z, 0.0];
            ports.ends[k] = PairEnd {
                inv_mass: 0.0,
                pair_count: row.len() as f64,
            };
        }
        *ports.version = SLEEPING + self.masses_version;
    }

    /// Projects all pairs of the group's nodes from what `ports` say, its own among them.
    #[inline(always)]
    pub(super) fn solve_pairs(&mut self, ports: &Ports) {
        if self.pairs.nodes.is_empty() {
            return;
        }
        let version = ports.versions.iter().sum();
        if self.pairs.version != Some(version) {
            self.pairs.version = Some(version);
            self.refresh_shares(ports);
        }
        let pairs = &self.pairs;
        // From the ports too: they lie side by side, the nodes do not.
        let owns = &ports.displacements[pairs.own.clone()];
        for run in &pairs.runs {
            let row = Rows {
                nodes: &pairs.nodes[run.nodes.clone()],
                owns: &owns[run.nodes.clone()],
                partners: &pairs.partners[run.partners.clone()],
                shares: &pairs.shares[run.partners.clone()],
            };
            // Most have one or two; a number that is known needs no loop.
            match run.count {
                1 => row.solve(1, &ports.displacements, &mut self.solution),
                2 => row.solve(2, &ports.displacements, &mut self.solution),
                count => row.solve(count, &ports.displacements, &mut self.solution),
            }
        }
    }

    /// Shares change only with the masses, so hardly ever within a frame.
    #[inline(never)]
    fn refresh_shares(&mut self, ports: &Ports) {
        let mut shares = std::mem::take(&mut self.pairs.shares);
        shares.clear();
        let pairs = &self.pairs;
        for (k, row) in pairs.rows() {
            let (node, lane) = pairs.nodes[k];
            let h_e = self.h_e.lane(lane as usize);
            let own = PairEnd {
                inv_mass: self.inv_masses[node as usize].lane(lane as usize),
                pair_count: row.len() as f64,
            };
            for partner in row {
                let other = &ports.ends[pairs.partners[partner] as usize];
                let compliance = 1.0 / (pairs.stiffnesses[partner] * h_e * h_e);
                shares.push(pair_share(&own, other, compliance));
            }
        }
        self.pairs.shares = shares;
    }
}

/// Nodes with equally many partners, and what belongs to them.
struct Rows<'a> {
    nodes: &'a [(u32, u32)],
    owns: &'a [PairVector],
    partners: &'a [u32],
    shares: &'a [f64],
}

impl Rows<'_> {
    /// Moves the nodes.
    ///
    /// - `count`: partners of each
    /// - `displacements`: of all ports (mm)
    #[inline(always)]
    fn solve<R: Real>(&self, count: usize, displacements: &[PairVector], solution: &mut [Vec3<R>]) {
        let tiles = self.nodes.chunks(TILE).zip(self.owns.chunks(TILE));
        let partners = self.partners.chunks(TILE * count);
        let partners = partners.zip(self.shares.chunks(TILE * count));
        for ((nodes, owns), (partners, shares)) in tiles.zip(partners) {
            let mut moved = [PairVector::default(); TILE];
            let rows = partners.chunks_exact(count).zip(shares.chunks_exact(count));
            for ((moved, own), (partners, shares)) in moved.iter_mut().zip(owns).zip(rows) {
                let mut sum = OrderFreeSum::default();
                for (&port, &share) in partners.iter().zip(shares) {
                    sum.add(own, &displacements[port as usize], share);
                }
                // All four components are stored, so that they stay in one register.
                *moved = sum.from(own);
            }
            for (&(node, lane), &[x, y, z, _]) in nodes.iter().zip(&moved) {
                solution[node as usize].set_lane(lane as usize, [x, y, z]);
            }
        }
    }
}
