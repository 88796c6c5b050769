//! Overall damping: `f = -m c v`, v in the head frame.
//!
//! Linear in the node's own velocity, so it is folded into the inertial target like the
//! magnet: with the velocity `(x - x_b)/h_e` of the time stencil it draws to `x_b` with the
//! weight `m c h_e`. Stretch damping is in [`super::stretch`], damping towards the target's
//! motion in [`super::magnet`].
//!
//! Source: nCloth's *damp*; folding as in Bouaziz et al. 2014, *Projective dynamics*, eq. 2.

use crate::machine::Real;

/// What damping adds to a node's effective mass, all of it drawing to `x_b`. [mass]
///
/// - `rate`: c (1/s)
#[inline(always)]
pub(crate) fn damping_mass<R: Real>(mass: R, rate: R, h_e: R) -> R {
    mass * rate * h_e
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coasting_node_slows_down_exponentially() {
        // Backward Euler of v' = -c v: y = x + h v, x_b = x.
        let (c, h, steps) = (3.0, 1e-4, 10_000);
        let (mut x, mut v) = (0.0_f64, 1.0_f64);
        for _ in 0..steps {
            let weight = 1.0 + damping_mass(1.0, c, h);
            let next = ((x + h * v) + damping_mass(1.0, c, h) * x) / weight;
            v = (next - x) / h;
            x = next;
        }
        let decayed = (-c * h * f64::from(steps)).exp();
        assert!((v / decayed - 1.0).abs() < 1e-3);
        assert!((x - (1.0 - decayed) / c).abs() < 1e-3);
    }
}
