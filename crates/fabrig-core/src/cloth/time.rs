//! The time stencil: BDF2 with variable steps, backward Euler, and cubic Hermite targets.

/// Largest ratio of successive substeps for which BDF2 is used; it is stable below 2.41.
const LARGEST_RATIO: f64 = 2.0;

/// Weights of one substep: `x_b = x_n + g (x_n - x_(n-1))`, `v_(n+1) = (x_(n+1) - x_b)/h_e`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stencil {
    /// g: how far the last change is carried on.
    pub(crate) history: f64,
    /// Effective step. (s)
    pub(crate) h_e: f64,
}

impl Stencil {
    /// Backward Euler with step `h`. (s)
    pub(crate) fn euler(h: f64) -> Self {
        Self {
            history: 0.0,
            h_e: h,
        }
    }

    /// BDF2 with step `h` after a step `previous` (s); backward Euler where that is unstable.
    pub(crate) fn bdf2(h: f64, previous: f64) -> Self {
        let r = h / previous;
        if !(r > 0.0 && r <= LARGEST_RATIO) {
            return Self::euler(h);
        }
        Self {
            history: r * r / (1.0 + 2.0 * r),
            h_e: h * (1.0 + r) / (1.0 + 2.0 * r),
        }
    }
}

/// Weights of a cubic Hermite segment for its chord, its start slope and its end slope, at
/// `s` from 0 to 1; the value is relative to the segment's start, and exactly 0 at s = 0.
pub(crate) fn hermite(s: f64) -> [f64; 3] {
    [
        s * s * (3.0 - 2.0 * s),
        s * (1.0 - s) * (1.0 - s),
        -s * s * (1.0 - s),
    ]
}

/// Derivatives of [`hermite`] by the progress.
pub(crate) fn hermite_slope(s: f64) -> [f64; 3] {
    [
        6.0 * s * (1.0 - s),
        (1.0 - s) * (1.0 - 3.0 * s),
        s * (3.0 * s - 2.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_steps_give_the_textbook_weights() {
        let s = Stencil::bdf2(0.3, 0.3);
        assert!((s.history - 1.0 / 3.0).abs() < 1e-15);
        assert!((s.h_e - 0.2).abs() < 1e-15);
    }

    #[test]
    fn variable_steps_are_exact_for_parabolas() {
        let x = |t: f64| 2.0 - 3.0 * t + 5.0 * t * t;
        let v = |t: f64| -3.0 + 10.0 * t;
        let (h, previous) = (0.03, 0.02);
        let s = Stencil::bdf2(h, previous);
        let xb = x(0.0) + s.history * (x(0.0) - x(-previous));
        assert!(((x(h) - xb) / s.h_e - v(h)).abs() < 1e-12);
    }

    #[test]
    fn a_sudden_long_step_falls_back_to_euler() {
        assert_eq!(Stencil::bdf2(0.1, 0.01), Stencil::euler(0.1));
        assert_eq!(Stencil::bdf2(0.1, 0.0), Stencil::euler(0.1));
    }

    #[test]
    fn the_segment_reproduces_a_cubic() {
        let x = |t: f64| 1.0 + t - 2.0 * t * t + 0.5 * t * t * t;
        let slope = |t: f64| 1.0 - 4.0 * t + 1.5 * t * t;
        for i in 0..=10 {
            let s = f64::from(i) / 10.0;
            let [c, a, b] = hermite(s);
            let value = x(0.0) + c * (x(1.0) - x(0.0)) + a * slope(0.0) + b * slope(1.0);
            assert!((value - x(s)).abs() < 1e-14);
            let [c, a, b] = hermite_slope(s);
            let rate = c * (x(1.0) - x(0.0)) + a * slope(0.0) + b * slope(1.0);
            assert!((rate - slope(s)).abs() < 1e-14);
        }
    }
}
