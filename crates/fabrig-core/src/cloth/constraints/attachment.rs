//! Attachments: nodes held to rigid bodies, and patches held to each other (Eq. 5).
//!
//! **Anchors.** `E = k/2 |x - A(t)|^2` with an anchor A whose motion is known: folded into the
//! inertial target like the magnet, adding `k h_e^2` to the effective mass and
//! `k h_e^2 (A - X)` to the pull, for anchored nodes only.
//!
//! **Pairs.** For nodes a and b of two patches, `C = (x_a - x_b) - (X_a - X_b) = u_a - u_b`:
//! the offset is kept that their targets have now, so a held pose is not disturbed and the
//! offset turns with the jaw. All pairs are projected at once from the predicted positions
//! (Jacobi). A node of n pairs gives each of them an n-th of its mass, which keeps soft pairs
//! exact and rigid ones stable. Corrections are rounded to a fixed grid, on which addition is
//! associative, so they depend neither on the order of the pairs nor on threads, and mirrored
//! input gives mirrored output.
//!
//! Source: Zhu & Joslin 2024, Eq. 5; XPBD eq. 18 for a vector-valued constraint; Tonge,
//! Benevolenski & Voroshilov 2012, *Mass splitting for jitter-free parallel rigid body
//! simulation*.

use crate::machine::{Real, Vec3};

/// Differences of displacements are kept within this. (mm)
const LARGEST: f64 = 65_536.0;

/// Added and subtracted again, it rounds a number to a multiple of 2^-34 mm. Such numbers, and
/// their sums up to 2^18 mm, are exact.
const ROUNDING: f64 = 1.5 * (1_u64 << 18) as f64;

/// What a node brings into its pairs.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PairEnd {
    /// Effective inverse mass. [1/mass]
    pub(crate) inv_mass: f64,
    /// How many pairs share the node.
    pub(crate) pair_count: f64,
}

/// Share of the way to b's displacement that a goes in the projection of their pair.
///
/// - `compliance`: 1/(k h_e^2) [1/mass]
#[inline(always)]
pub(crate) fn pair_share(a: &PairEnd, b: &PairEnd, compliance: f64) -> f64 {
    a.inv_mass / (a.inv_mass * a.pair_count + b.inv_mass * b.pair_count + compliance)
}

/// A vector of an end of a pair; the fourth component fills a register and is 0. (mm)
pub(crate) type PairVector = [f64; 4];

/// A sum of corrections that does not depend on their order.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct OrderFreeSum {
    sum: PairVector,
}

impl OrderFreeSum {
    /// Takes in the correction of `own` by its pair with `other`, which goes `share` of the
    /// way. (mm)
    #[inline(always)]
    pub(crate) fn add(&mut self, own: &PairVector, other: &PairVector, share: f64) {
        for axis in 0..4 {
            let gap = other[axis] - own[axis];
            // What is no number counts as far away.
            let gap = if -LARGEST < gap { gap } else { -LARGEST };
            let gap = if gap < LARGEST { gap } else { LARGEST };
            // The nearest multiple: both signs are treated alike.
            self.sum[axis] += (gap * share + ROUNDING) - ROUNDING;
        }
    }

    /// The sum, added to `own`. (mm)
    #[inline(always)]
    pub(crate) fn from(&self, own: &PairVector) -> PairVector {
        std::array::from_fn(|axis| own[axis] + self.sum[axis])
    }
}

/// Pull of an anchor, `k h_e^2 (A - X)`; it adds `k h_e^2` to the mass. [mm mass]
///
/// - `offset`: A - X (mm)
#[inline(always)]
pub(crate) fn anchor_pull<R: Real>(offset: Vec3<R>, stiffness: R, h_e: R) -> Vec3<R> {
    offset * (stiffness * h_e * h_e)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn end(inv_mass: f64) -> PairEnd {
        PairEnd {
            inv_mass,
            pair_count: 1.0,
        }
    }

    #[test]
    fn a_rigid_pair_meets_and_keeps_momentum() {
        let (a, b) = (end(0.5), end(2.0));
        let (of_a, of_b) = (pair_share(&a, &b, 0.0), pair_share(&b, &a, 0.0));
        assert!((of_a + of_b - 1.0).abs() < 1e-14, "they meet");
        assert!((of_a / 0.5 - of_b / 2.0).abs() < 1e-14, "equal impulses");
    }

    #[test]
    fn compliance_limits_the_force() {
        let (a, b) = (end(1.0), end(1.0));
        // Implicit step of a spring k = 4, h_e = 1, between unit masses at a distance of -1.
        let moved = -pair_share(&a, &b, 0.25);
        let force = -4.0 * (1.0 + 2.0 * moved);
        assert!((moved - force).abs() < 1e-14);
        assert_eq!(pair_share(&a, &b, f64::INFINITY), 0.0);
    }

    #[test]
    fn the_sum_does_not_depend_on_order_and_mirrors() {
        let terms = [[0.1, 1e-9, 3.0], [0.7, -5e5, 1e-3], [-0.3, 0.2, -2.9]];
        let sum = |order: [usize; 3], sign: f64| {
            let mut m = OrderFreeSum::default();
            for i in order {
                let own = [0.01 * sign, 0.02, 0.03, 0.0];
                let other = [terms[i][0] * sign, terms[i][1], terms[i][2], 0.0];
                m.add(&own, &other, 0.3);
            }
            m.from(&[0.0; 4])
        };
        let one = sum([0, 1, 2], 1.0);
        assert_eq!(one, sum([2, 0, 1], 1.0));
        let mirrored = sum([1, 2, 0], -1.0);
        assert_eq!(one[0], -mirrored[0]);
        assert!((one[0] - 0.3 * (0.5 - 0.03)).abs() < 1e-9);
        assert!((one[1] + 0.3 * LARGEST).abs() < 1.0, "bounded");
    }

    #[test]
    fn an_anchor_is_the_implicit_step_of_its_spring() {
        // m x'' = -k (x - A): (x - y) m = -h^2 k (x - A), relative to X = 0.
        let pull = anchor_pull(Vec3::<f64>::splat([2.0, 0.0, 0.0]), 50.0, 0.1);
        let (m, y) = (1.5, -1.0);
        let x = (m * y + pull.x) / (m + 50.0 * 0.01);
        assert!((m * (x - y) + 0.01 * 50.0 * (x - 2.0)).abs() < 1e-14);
    }
}
