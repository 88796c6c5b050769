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
//! exact and rigid ones stable. Corrections are added in fixed point, where addition is
//! associative, so they depend neither on the order of the pairs nor on threads, and mirrored
//! input gives mirrored output.
//!
//! Source: Zhu & Joslin 2024, Eq. 5; XPBD eq. 18 for a vector-valued constraint; Tonge,
//! Benevolenski & Voroshilov 2012, *Mass splitting for jitter-free parallel rigid body
//! simulation*.

/// Fixed-point units per mm; a correction is exact to 2^-36 mm.
const UNITS_PER_MM: f64 = (1_u64 << 36) as f64;

/// Corrections are kept within this, so that a sum of 2^15 of them cannot overflow. (mm)
const LARGEST: f64 = 4096.0;

/// Where a node of a pair stands before pairs are projected.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Port {
    /// Predicted displacement from the target. (mm)
    pub(crate) displacement: [f64; 3],
    /// Effective inverse mass. [1/mass]
    pub(crate) inv_mass: f64,
    /// How many pairs share the node.
    pub(crate) pair_count: f64,
}

/// Correction of node a by its pair with b. (mm)
///
/// - `compliance`: 1/(k h_e^2) [1/mass]
#[inline(always)]
pub(crate) fn project_pair(a: &Port, b: &Port, compliance: f64) -> [f64; 3] {
    let share = a.inv_mass / (a.inv_mass * a.pair_count + b.inv_mass * b.pair_count + compliance);
    [0, 1, 2].map(|axis| (b.displacement[axis] - a.displacement[axis]) * share)
}

/// A sum of corrections that does not depend on their order.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct OrderFreeSum {
    sum: [i64; 3],
}

impl OrderFreeSum {
    /// Takes in one correction. (mm)
    #[inline(always)]
    pub(crate) fn add(&mut self, correction: [f64; 3]) {
        for axis in 0..3 {
            let bounded = correction[axis].clamp(-LARGEST, LARGEST);
            // Truncation towards zero treats both signs alike.
            self.sum[axis] += (bounded * UNITS_PER_MM) as i64;
        }
    }

    /// The sum. (mm)
    #[inline(always)]
    pub(crate) fn total(&self) -> [f64; 3] {
        self.sum.map(|s| s as f64 / UNITS_PER_MM)
    }
}

/// Pull and added mass of an anchor: `(k h_e^2 (A - X), k h_e^2)`. [mm mass, mass]
#[inline(always)]
pub(crate) fn anchor_pull(offset: [f64; 3], stiffness: f64, h_e: f64) -> ([f64; 3], f64) {
    let added = stiffness * h_e * h_e;
    (offset.map(|o| o * added), added)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(displacement: [f64; 3], inv_mass: f64) -> Port {
        Port {
            displacement,
            inv_mass,
            pair_count: 1.0,
        }
    }

    #[test]
    fn a_rigid_pair_meets_and_keeps_momentum() {
        let a = port([1.0, 2.0, 3.0], 0.5);
        let b = port([0.0, -1.0, 3.5], 2.0);
        let da = project_pair(&a, &b, 0.0);
        let db = project_pair(&b, &a, 0.0);
        for axis in 0..3 {
            let gap = a.displacement[axis] + da[axis] - b.displacement[axis] - db[axis];
            assert!(gap.abs() < 1e-14);
            assert!((da[axis] / 0.5 + db[axis] / 2.0).abs() < 1e-14);
        }
    }

    #[test]
    fn compliance_limits_the_force() {
        let a = port([1.0, 0.0, 0.0], 1.0);
        let b = port([0.0; 3], 1.0);
        // Implicit step of a spring k = 4, h_e = 1, between unit masses.
        let moved = project_pair(&a, &b, 0.25)[0];
        let force = -4.0 * (1.0 + 2.0 * moved);
        assert!((moved - force).abs() < 1e-14);
        assert_eq!(project_pair(&a, &b, f64::INFINITY)[0], 0.0);
    }

    #[test]
    fn the_sum_does_not_depend_on_order_and_mirrors() {
        let terms = [[0.1, 1e-9, 3.0], [0.7, -5e5, 1e-3], [-0.3, 0.2, -2.9]];
        let sum = |order: [usize; 3], sign: f64| {
            let mut m = OrderFreeSum::default();
            for i in order {
                m.add([terms[i][0] * sign, terms[i][1], terms[i][2]]);
            }
            m.total()
        };
        let one = sum([0, 1, 2], 1.0);
        assert_eq!(one, sum([2, 0, 1], 1.0));
        let mirrored = sum([1, 2, 0], -1.0);
        assert_eq!(one[0], -mirrored[0]);
        assert!((one[0] - 0.5).abs() < 1e-9);
        assert!((one[1] + LARGEST).abs() < 1.0, "bounded");
    }

    #[test]
    fn an_anchor_is_the_implicit_step_of_its_spring() {
        // m x'' = -k (x - A): (x - y) m = -h^2 k (x - A), relative to X = 0.
        let (pull, added) = anchor_pull([2.0, 0.0, 0.0], 50.0, 0.1);
        let (m, y) = (1.5, -1.0);
        let x = (m * y + pull[0]) / (m + added);
        assert!((m * (x - y) + 0.01 * 50.0 * (x - 2.0)).abs() < 1e-14);
    }
}
