//! The sweep of a substep: every constraint is projected once.

use super::interface::Substep;
use super::state::Group;
use crate::cloth::constraints::bend::{BendCompliance, project_bend};
use crate::cloth::constraints::grid_lists::Strip;
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

    /// Projects every constraint once, from displacements to positions, strip by strip. What has no
    /// stiffness in any lane would move nothing and is left out.
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
        for index in 0..self.lists.strips.len() {
            let strip = self.lists.strips[index].clone();
            if self.has_bend {
                self.bend_strip(&strip, compliance.bend);
            }
            let targets = &self.targets[strip.nodes.clone()];
            for (x, target) in self.solution[strip.nodes.clone()].iter_mut().zip(targets) {
                *x = *target + *x;
            }
            if self.has_shear {
                self.shear_strip(&strip, progress, compliance.shear);
            }
            if is_varied {
                self.stretch_strip::<true, true>(&strip, progress, &compliance.stretch);
            } else if self.has_stretch_damping {
                self.stretch_strip::<true, false>(&strip, progress, &compliance.stretch);
            } else {
                self.stretch_strip::<false, false>(&strip, progress, &compliance.stretch);
            }
        }
    }

    #[inline(always)]
    fn bend_strip(&mut self, strip: &Strip, compliance: R) {
        let bend = BendCompliance {
            compliance,
            dropoff: self.bend_dropoff,
            inv_edge_squared: self.inv_edge_squared,
        };
        let triples = &self.lists.triples[strip.triples.clone()];
        let (x, w) = (&mut self.solution, &self.inv_masses);
        if self.edge_lengths.is_varied() {
            let softness = &self.bend_softness[strip.triples.clone()];
            project_bend::<R, true>(triples, x, w, &bend, softness);
        } else {
            project_bend::<R, false>(triples, x, w, &bend, &[]);
        }
    }

    #[inline(always)]
    fn shear_strip(&mut self, strip: &Strip, progress: R, compliance: R) {
        let diagonals = &self.lists.diagonals[strip.diagonals.clone()];
        let (x, w) = (&mut self.solution, &self.inv_masses);
        let lengths = self.diagonal_lengths.part(strip.diagonals.clone());
        if self.edge_lengths.is_varied() {
            project_shear::<R, true>(diagonals, x, w, lengths, progress, compliance);
        } else {
            project_shear::<R, false>(diagonals, x, w, lengths, progress, compliance);
        }
    }

    #[inline(always)]
    fn stretch_strip<const IS_DAMPED: bool, const IS_VARIED: bool>(
        &mut self,
        strip: &Strip,
        progress: R,
        compliance: &StretchCompliance<R>,
    ) {
        project_stretch::<R, IS_DAMPED, IS_VARIED>(
            &self.lists.edges[strip.edges.clone()],
            &mut self.solution,
            &self.inv_masses,
            self.edge_lengths.part(strip.edges.clone()),
            &self.resting,
            progress,
            compliance,
        );
    }
}
