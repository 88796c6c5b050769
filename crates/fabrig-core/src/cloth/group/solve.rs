//! The sweep of a substep: every constraint is projected once.

use super::interface::Substep;
use super::state::Group;
use crate::cloth::constraints::bend::{BendCompliance, project_bend};
use crate::cloth::constraints::pressure::project_pressure;
use crate::cloth::constraints::shear::project_shear;
use crate::cloth::constraints::stretch::{StretchCompliance, project_stretch};
use crate::cloth::lanes::Real;

impl<R: Real> Group<R> {
    #[inline(always)]
    pub(super) fn solve_lanes(&mut self, substep: &Substep) {
        let h_e2 = self.h_e * self.h_e;
        let one = R::splat(1.0);
        let progress = R::splat(substep.progress[1]);
        if self.has_pressure {
            project_pressure(
                &self.lists.cells,
                &self.targets,
                &mut self.solution,
                &self.inv_masses,
                one / (self.pressure * h_e2),
                &mut self.gradient,
            );
        }
        let bend = BendCompliance {
            compliance: one / (self.bend * h_e2),
            dropoff: self.bend_dropoff,
            inv_edge_squared: self.inv_edge_squared,
        };
        project_bend(
            &self.lists.triples,
            &mut self.solution,
            &self.inv_masses,
            &bend,
        );
        for (x, target) in self.solution.iter_mut().zip(&self.targets) {
            *x = *target + *x;
        }
        project_shear(
            &self.lists.diagonals,
            &mut self.solution,
            &self.inv_masses,
            &self.diagonal_lengths,
            progress,
            one / (self.shear * h_e2),
        );
        let compliance = StretchCompliance {
            stretch: one / (self.stretch[0] * h_e2),
            compression: one / (self.stretch[1] * h_e2),
            gamma: self.stretch_damping_time / self.h_e,
        };
        project_stretch(
            &self.lists.edges,
            &mut self.solution,
            &self.inv_masses,
            &self.edge_lengths,
            &self.resting,
            progress,
            &compliance,
        );
    }
}
