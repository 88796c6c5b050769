//! Pairs: what a group tells the others of its paired nodes, and what it hears from them.

use super::state::Group;
use crate::cloth::constraints::attachment::{OrderFreeSum, Port, project_pair};
use crate::cloth::lanes::Real;

impl<R: Real> Group<R> {
    pub(super) fn write_ports(&self, ports: &mut Vec<Port>) {
        ports.clear();
        for (&(node, lane), partners) in self.pairs.nodes.iter().zip(&self.pairs.partners) {
            let (node, lane) = (node as usize, lane as usize);
            ports.push(Port {
                displacement: self.solution[node].lane(lane),
                inv_mass: self.inv_masses[node].lane(lane),
                pair_count: partners.len() as f64,
            });
        }
    }

    pub(super) fn solve_pairs(&mut self, ports: &[Vec<Port>]) {
        let pairs = &self.pairs;
        for (&(node, lane), partners) in pairs.nodes.iter().zip(&pairs.partners) {
            let (node, lane) = (node as usize, lane as usize);
            let h_e = self.h_e.lane(lane);
            let own = Port {
                displacement: self.solution[node].lane(lane),
                inv_mass: self.inv_masses[node].lane(lane),
                pair_count: partners.len() as f64,
            };
            let mut sum = OrderFreeSum::default();
            for partner in partners {
                let other = &ports[partner.group][partner.port];
                let compliance = 1.0 / (partner.stiffness * h_e * h_e);
                sum.add(project_pair(&own, other, compliance));
            }
            let total = sum.total();
            let moved = [0, 1, 2].map(|axis| own.displacement[axis] + total[axis]);
            self.solution[node].set_lane(lane, moved);
        }
    }
}
