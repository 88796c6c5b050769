//! Position-based dynamics, as a baseline: Algorithm 1 of the paper, after Müller et al. 2007.
//!
//! Every constraint is projected by a share k in [0, 1] of the way, with
//! `k' = 1 - (1 - k)^(1/sweeps)`. PBD's shares have no units; here k is what one implicit step
//! of 1/60 s would do with the material's spring, so that one substep of one sweep means the
//! material. As PBD's does, the cloth stiffens with the count of substeps: that is what this
//! baseline shows.

use super::interface::Substep;
use super::solve::SweepCompliance;
use super::state::Group;
use crate::cloth::constraints::stretch::StretchCompliance;
use crate::machine::Real;

/// The step that shares are calibrated for. (s)
const STEP: f64 = 1.0 / 60.0;

/// Share of one sweep of a spring of stiffness `k` between inverse masses of sum `w`.
fn share(k: f64, w: f64, sweeps: u32) -> f64 {
    let pull = k * w * STEP * STEP;
    1.0 - (1.0 - pull / (1.0 + pull)).powf(1.0 / f64::from(sweeps))
}

impl<R: Real> Group<R> {
    /// The compliance under which a projection goes a share of the way.
    fn share_compliance(&self, stiffness: R, masses: f64, sweeps: u32) -> R {
        let mut out = R::splat(0.0);
        for lane in 0..R::LANES {
            let w = masses / self.mass.lane(lane);
            let s = share(stiffness.lane(lane), w, sweeps);
            // Projections see the mass with its damping.
            let seen = self.inv_masses.first().map_or(w, |i| masses * i.lane(lane));
            out.set_lane(lane, seen * (1.0 / s - 1.0));
        }
        out
    }

    /// The projections of a substep.
    #[inline(always)]
    pub(super) fn project_lanes(&mut self, substep: &Substep, sweeps: u32) {
        let compliance = SweepCompliance {
            pressure: R::splat(f64::from(sweeps)) / (self.pressure * R::splat(STEP * STEP)),
            bend: self.share_compliance(self.bend, 6.0, sweeps),
            shear: self.share_compliance(self.shear, 2.0, sweeps),
            stretch: StretchCompliance {
                stretch: self.share_compliance(self.stretch[0], 2.0, sweeps),
                compression: self.share_compliance(self.stretch[1], 2.0, sweeps),
                gamma: R::splat(0.0),
            },
        };
        let mut kept = R::splat(1.0);
        for lane in 0..R::LANES {
            let w = 1.0 / self.mass.lane(lane);
            kept.set_lane(
                lane,
                1.0 - share(self.magnet.stiffness.lane(lane), w, sweeps),
            );
        }
        for sweep in 0..sweeps {
            if sweep > 0 {
                for (x, target) in self.solution.iter_mut().zip(&self.targets) {
                    *x -= *target;
                }
            }
            for x in &mut self.solution {
                *x = *x * kept;
            }
            self.share_anchors(|k, mass| share(k, 1.0 / mass, sweeps));
            self.sweep_once(R::splat(substep.progress[1]), &compliance);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::share;

    #[test]
    fn sweeps_together_do_what_one_does() {
        let once = share(300.0, 2.0, 1);
        let each = share(300.0, 2.0, 5);
        assert!((1.0 - (1.0 - each).powi(5) - once).abs() < 1e-12);
        assert!(share(0.0, 2.0, 1) == 0.0 && share(1e12, 2.0, 1) > 0.999);
    }
}
