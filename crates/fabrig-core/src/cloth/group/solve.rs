//! The sweep of a substep: every constraint is projected once.

use super::interface::Substep;
use super::state::Group;
use crate::cloth::constraints::bend::{BendCompliance, project_bend};
use crate::cloth::constraints::pressure::{PadFaces, project_pressure};
use crate::cloth::constraints::shear::project_shear;
use crate::cloth::constraints::stretch::{StretchCompliance, project_stretch};
use crate::machine::Real;

/// Compliances of one sweep.
#[derive(Debug, Clone, Copy)]
pub(super) struct SweepCompliance<R> {
    /// Of the volume. [mm^4/mass]
    pub(super) pressure: R,
    /// Of second differences. [1/mass]
    pub(super) bend: R,
    /// Of diagonals. [1/mass]
    pub(super) shear: R,
    /// Of edges.
    pub(super) stretch: StretchCompliance<R>,
}

impl<R: Real> Group<R> {
    /// The sweep that means the material: compliance 1/(k h_e^2).
    #[inline(always)]
    pub(super) fn solve_lanes(&mut self, substep: &Substep) {
        let h_e2 = self.h_e * self.h_e;
        let one = R::splat(1.0);
        let compliance = SweepCompliance {
            pressure: one / (self.pressure * h_e2),
            bend: one / (self.bend * h_e2),
            shear: one / (self.shear * h_e2),
            stretch: StretchCompliance {
                stretch: one / (self.stretch[0] * h_e2),
                compression: one / (self.stretch[1] * h_e2),
                gamma: self.stretch_damping_time / self.h_e,
            },
        };
        self.sweep_once(R::splat(substep.progress[1]), &compliance);
    }

    /// Projects every constraint once, from displacements to positions. What has no stiffness in
    /// any lane would move nothing and is left out.
    ///
    /// - `progress`: how far through the frame, 0 to 1
    #[inline(always)]
    pub(super) fn sweep_once(&mut self, progress: R, compliance: &SweepCompliance<R>) {
        let is_varied = self.edge_lengths.is_varied();
        if self.has_pressure {
            let faces = PadFaces {
                cells: &self.lists.cells,
                targets: &self.targets,
                heights: &self.floor.heights,
            };
            project_pressure(
                &faces,
                self.floor.rest,
                &mut self.solution,
                &self.inv_masses,
                compliance.pressure,
                &mut self.gradient,
            );
        }
        if self.has_bend {
            let bend = BendCompliance {
                compliance: compliance.bend,
                dropoff: self.bend_dropoff,
                inv_edge_squared: self.inv_edge_squared,
            };
            let (triples, x) = (&self.lists.triples, &mut self.solution);
            let (w, softness) = (&self.inv_masses, &self.bend_softness);
            if is_varied {
                project_bend::<R, true>(triples, x, w, &bend, softness);
            } else {
                project_bend::<R, false>(triples, x, w, &bend, softness);
            }
        }
        for (x, target) in self.solution.iter_mut().zip(&self.targets) {
            *x = *target + *x;
        }
        if self.has_shear {
            let (diagonals, x) = (&self.lists.diagonals, &mut self.solution);
            let (w, lengths) = (&self.inv_masses, &self.diagonal_lengths);
            let shear = compliance.shear;
            if is_varied {
                project_shear::<R, true>(diagonals, x, w, lengths, progress, shear);
            } else {
                project_shear::<R, false>(diagonals, x, w, lengths, progress, shear);
            }
        }
        if is_varied {
            self.stretch_all::<true, true>(progress, &compliance.stretch);
        } else if self.has_stretch_damping {
            self.stretch_all::<true, false>(progress, &compliance.stretch);
        } else {
            self.stretch_all::<false, false>(progress, &compliance.stretch);
        }
    }

    #[inline(always)]
    fn stretch_all<const IS_DAMPED: bool, const IS_VARIED: bool>(
        &mut self,
        progress: R,
        compliance: &StretchCompliance<R>,
    ) {
        project_stretch::<R, IS_DAMPED, IS_VARIED>(
            &self.lists.edges,
            &mut self.solution,
            &self.inv_masses,
            &self.edge_lengths,
            &self.resting,
            progress,
            compliance,
        );
    }
}
