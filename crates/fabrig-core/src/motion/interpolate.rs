//! Cubic Hermite interpolation of one channel at uneven times.
//!
//! p(s) = h00 p0 + h10 h m0 + h01 p1 + h11 h m1, with tangents chosen in two ways: limited,
//! so that no interval leaves the range of its two ends (weights stay weights), or through
//! the three nearest frames (rotations keep their velocity at turning points).
//!
//! # Source
//!
//! Fritsch & Butland, *A Method for Constructing Local Monotone Piecewise Cubic
//! Interpolants*, SIAM J. Sci. Stat. Comput. 5, 1984.

/// An interval of a clip and the place in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    /// Index of the frame at its start; the next frame ends it.
    pub(super) frame: usize,
    /// Place in it, in [0, 1].
    pub(super) s: f64,
}

/// Value and rate of change per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interpolated {
    pub(super) value: f64,
    pub(super) rate: f64,
}

/// How a tangent follows from the frames around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tangents {
    /// Never leaves the range of an interval's two ends.
    Limited,
    /// Of the parabola through three frames.
    Parabolic,
}

/// Interpolates the channel `value(frame)` of a clip with these times (rising) at `span`.
pub(super) fn interpolate(
    times: &[f64],
    value: impl Fn(usize) -> f64,
    span: Span,
    tangents: Tangents,
) -> Interpolated {
    let i = span.frame;
    if i + 1 >= times.len() {
        return Interpolated {
            value: value(i),
            rate: 0.0,
        };
    }
    let h = times[i + 1] - times[i];
    let (p0, p1) = (value(i), value(i + 1));
    let slope = |k: usize| (value(k + 1) - value(k)) / (times[k + 1] - times[k]);
    let length = |k: usize| times[k + 1] - times[k];
    let here = slope(i);
    let tangent_at = |k: usize| match (k > 0, k + 1 < times.len()) {
        (true, true) => inner_tangent(length(k - 1), length(k), slope(k - 1), slope(k), tangents),
        // The first and the last frame take the slope of their only interval.
        _ => here,
    };
    let (m0, m1) = (tangent_at(i), tangent_at(i + 1));
    let s = span.s;
    let (s2, s3) = (s * s, s * s * s);
    let cubic = (2.0 * s3 - 3.0 * s2 + 1.0) * p0
        + (s3 - 2.0 * s2 + s) * h * m0
        + (3.0 * s2 - 2.0 * s3) * p1
        + (s3 - s2) * h * m1;
    let rate = (6.0 * s2 - 6.0 * s) * (p0 - p1) / h
        + (3.0 * s2 - 4.0 * s + 1.0) * m0
        + (3.0 * s2 - 2.0 * s) * m1;
    let value = match tangents {
        // Exact in real numbers already; this takes off what rounding adds.
        Tangents::Limited => cubic.clamp(p0.min(p1), p0.max(p1)),
        Tangents::Parabolic => cubic,
    };
    Interpolated { value, rate }
}

fn inner_tangent(h0: f64, h1: f64, slope0: f64, slope1: f64, tangents: Tangents) -> f64 {
    match tangents {
        Tangents::Parabolic => (h1 * slope0 + h0 * slope1) / (h0 + h1),
        Tangents::Limited if slope0 * slope1 <= 0.0 => 0.0,
        Tangents::Limited => {
            // Weighted harmonic mean: at most 3 times the smaller slope, which is the
            // sufficient condition for a monotone cubic.
            let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
            (w0 + w1) / (w0 / slope0 + w1 / slope1)
        }
    }
}

/// The interval of `times` (rising, not empty) that holds `time`; the ends hold beyond them.
pub(super) fn find_span(times: &[f64], time: f64) -> Span {
    let after = times.partition_point(|&t| t <= time);
    if after == 0 {
        return Span { frame: 0, s: 0.0 };
    }
    if after == times.len() {
        return Span {
            frame: times.len() - 1,
            s: 0.0,
        };
    }
    let frame = after - 1;
    Span {
        frame,
        s: (time - times[frame]) / (times[after] - times[frame]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(times: &[f64], values: &[f64], time: f64, tangents: Tangents) -> Interpolated {
        interpolate(times, |i| values[i], find_span(times, time), tangents)
    }

    #[test]
    fn frames_are_met_and_a_parabola_is_exact() {
        let times = [0.0, 0.5, 0.7, 1.5, 2.0];
        let values: Vec<f64> = times.iter().map(|t| 3.0 * t * t - t + 1.0).collect();
        for (&t, &v) in times.iter().zip(&values) {
            assert!((at(&times, &values, t, Tangents::Parabolic).value - v).abs() < 1e-12);
        }
        for t in [0.55, 0.69, 1.0, 1.49] {
            let got = at(&times, &values, t, Tangents::Parabolic);
            assert!((got.value - (3.0 * t * t - t + 1.0)).abs() < 1e-12);
            assert!((got.rate - (6.0 * t - 1.0)).abs() < 1e-12);
        }
    }

    #[test]
    fn rates_are_derivatives_of_values() {
        let times = [0.0, 0.3, 0.35, 1.0, 1.2];
        let values = [0.0, 0.4, 0.9, 0.2, 0.2];
        for tangents in [Tangents::Limited, Tangents::Parabolic] {
            for k in 1..119 {
                let t = k as f64 * 0.01 + 0.0013;
                let d = 1e-6;
                let difference = (at(&times, &values, t + d, tangents).value
                    - at(&times, &values, t - d, tangents).value)
                    / (2.0 * d);
                let rate = at(&times, &values, t, tangents).rate;
                assert!((difference - rate).abs() < 1e-4, "{t}: {difference} {rate}");
            }
        }
    }

    #[test]
    fn beyond_the_ends_the_ends_hold() {
        let (times, values) = ([1.0, 2.0], [0.25, 0.75]);
        for (t, v) in [(-5.0, 0.25), (1.0, 0.25), (2.0, 0.75), (9.0, 0.75)] {
            assert_eq!(at(&times, &values, t, Tangents::Limited).value, v);
        }
        assert_eq!(at(&[3.0], &[0.5], 0.0, Tangents::Limited).value, 0.5);
    }

    proptest::proptest! {
        #[test]
        fn limited_values_stay_between_their_frames(
            steps in proptest::collection::vec((0.001f64..2.0, 0.0f64..=1.0), 2..8),
            place in 0.0f64..1.0,
        ) {
            let mut t = 0.0;
            let times: Vec<f64> = steps.iter().map(|(dt, _)| { t += dt; t }).collect();
            let values: Vec<f64> = steps.iter().map(|(_, v)| *v).collect();
            let time = times[0] + place * (times[times.len() - 1] - times[0]);
            let frame = find_span(&times, time).frame.min(times.len() - 2);
            let v = at(&times, &values, time, Tangents::Limited).value;
            let (a, b) = (values[frame], values[frame + 1]);
            proptest::prop_assert!(v >= a.min(b) && v <= a.max(b));
        }
    }
}
