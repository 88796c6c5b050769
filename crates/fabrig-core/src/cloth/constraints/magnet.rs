//! The magnet: every node is drawn to its target (Eq. 4).
//!
//! `C = |X_i - M_i|` with energy `k/2 |x - X|^2`, and damping `-m c_m (v - V)` relative to the
//! velocity V of the target, so that it lets the cloth follow a moving target without lag and
//! yet sets how long the cloth rings about it.
//!
//! The force is linear in the node's own position, so it is folded into the inertial target,
//! which is algebraically exact: minimizing
//! `m/2 |x - y|^2 + h_e^2 k/2 |x - X|^2 + m c_m h_e/2 |(x - X) - u_b|^2`
//! over x gives the mass-weighted mean of y, X and X + u_b, where `u_b` is the displacement
//! from the target that the time stencil holds for the past.
//!
//! Source: Zhu & Joslin 2024, Eq. 4; folding of diagonal quadratic terms into the inertial
//! term as in Bouaziz et al. 2014, *Projective dynamics*, eq. 2.

use crate::machine::Real;

/// The magnet of every node of a patch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Magnet<R> {
    /// k. [mass/s^2]
    pub(crate) stiffness: R,
    /// c_m. (1/s)
    pub(crate) damping: R,
}

impl<R: Real> Magnet<R> {
    /// What the magnet adds to a node's effective mass. [mass]
    #[inline(always)]
    pub(crate) fn added_mass(&self, mass: R, h_e: R) -> R {
        self.stiffness * h_e * h_e + self.past_mass(mass, h_e)
    }

    /// The part of the added mass that draws to `X + u_b` rather than to X. [mass]
    #[inline(always)]
    pub(crate) fn past_mass(&self, mass: R, h_e: R) -> R {
        mass * self.damping * h_e
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folding_minimizes_the_energy() {
        let magnet = Magnet {
            stiffness: 900.0_f64,
            damping: 5.0,
        };
        let (mass, h, y, ub) = (2.0, 0.01, 0.7, 0.3);
        let weight = mass + magnet.added_mass(mass, h);
        let folded = (mass * y + magnet.past_mass(mass, h) * ub) / weight;
        // The energy of a displacement u, whose target is at 0.
        let energy = |u: f64| {
            0.5 * mass * (u - y).powi(2)
                + 0.5 * h * h * 900.0 * u * u
                + 0.5 * mass * 5.0 * h * (u - ub).powi(2)
        };
        let slope = (energy(folded + 1e-5) - energy(folded - 1e-5)) / 2e-5;
        assert!(slope.abs() < 1e-9, "{slope}");
    }
}
