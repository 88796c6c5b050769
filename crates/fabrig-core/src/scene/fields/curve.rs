//! Values at times, joined straight or smoothly and held at both ends.

use super::Join;

/// A curve through values of `N` numbers at rising times.
///
/// Joined smoothly it is the cubic spline with continuous second derivative that comes to rest at
/// both ends: what moves along it starts and stops without a jolt. Between keys that turn sharply
/// it may go past them.
///
/// # Source
///
/// de Boor, *A Practical Guide to Splines*, 1978, chapter IV (complete spline).
#[derive(Debug, Clone, PartialEq)]
pub(in crate::scene) struct Curve<const N: usize> {
    times: Vec<f64>,
    values: Vec<[f64; N]>,
    /// Slopes at the keys (1/s); none where keys are joined straight.
    slopes: Option<Vec<[f64; N]>>,
    /// Integral from the first key to each. (s)
    areas: Vec<[f64; N]>,
}

impl<const N: usize> Curve<N> {
    /// The same at all times.
    pub(in crate::scene) fn constant(value: [f64; N]) -> Self {
        Self::new(Join::Straight, vec![0.0], vec![value])
    }

    /// - `times`: rising (s), at least one; `values`: as many
    pub(in crate::scene) fn new(join: Join, times: Vec<f64>, values: Vec<[f64; N]>) -> Self {
        let slopes = (join == Join::Smooth).then(|| complete_slopes(&times, &values));
        let mut curve = Self {
            times,
            values,
            slopes,
            areas: Vec::new(),
        };
        let mut area = [0.0; N];
        curve.areas.push(area);
        for span in 0..curve.times.len().saturating_sub(1) {
            let more = curve.area_in(span, 1.0);
            area = std::array::from_fn(|c| area[c] + more[c]);
            curve.areas.push(area);
        }
        curve
    }

    /// The value at a time. (s)
    pub(in crate::scene) fn at(&self, time: f64) -> [f64; N] {
        let Some((span, s)) = self.place(time) else {
            let is_before = self.times.first().is_some_and(|first| time < *first);
            let held = if is_before {
                self.values.first()
            } else {
                self.values.last()
            };
            return held.copied().unwrap_or([0.0; N]);
        };
        let (a, b) = (&self.values[span], &self.values[span + 1]);
        let Some(slopes) = &self.slopes else {
            return std::array::from_fn(|c| a[c] + (b[c] - a[c]) * s);
        };
        let h = self.times[span + 1] - self.times[span];
        let (m, n) = (&slopes[span], &slopes[span + 1]);
        let (s2, s3) = (s * s, s * s * s);
        std::array::from_fn(|c| {
            (2.0 * s3 - 3.0 * s2 + 1.0) * a[c]
                + (s3 - 2.0 * s2 + s) * h * m[c]
                + (3.0 * s2 - 2.0 * s3) * b[c]
                + (s3 - s2) * h * n[c]
        })
    }

    /// The integral from the first key to a time. (s)
    pub(in crate::scene) fn integral(&self, time: f64) -> [f64; N] {
        let (Some(first), Some(last)) = (self.times.first(), self.times.last()) else {
            return [0.0; N];
        };
        match self.place(time) {
            Some((span, s)) => {
                let more = self.area_in(span, s);
                std::array::from_fn(|c| self.areas[span][c] + more[c])
            }
            None if time < *first => self.values[0].map(|v| v * (time - first)),
            None => {
                let end = self.values.len() - 1;
                std::array::from_fn(|c| self.areas[end][c] + self.values[end][c] * (time - last))
            }
        }
    }

    /// The interval that a time is in, and the share of it that is over; none outside all.
    fn place(&self, time: f64) -> Option<(usize, f64)> {
        let after = self.times.partition_point(|t| *t <= time);
        let span = after.checked_sub(1)?;
        let end = self.times.get(after)?;
        Some((span, (time - self.times[span]) / (end - self.times[span])))
    }

    /// The integral over the first `s` of an interval. (s)
    fn area_in(&self, span: usize, s: f64) -> [f64; N] {
        let h = self.times[span + 1] - self.times[span];
        let (a, b) = (&self.values[span], &self.values[span + 1]);
        let (s2, s3, s4) = (s * s, s * s * s, s * s * s * s);
        let Some(slopes) = &self.slopes else {
            return std::array::from_fn(|c| h * (a[c] * s + (b[c] - a[c]) * s2 * 0.5));
        };
        let (m, n) = (&slopes[span], &slopes[span + 1]);
        std::array::from_fn(|c| {
            h * ((s4 * 0.5 - s3 + s) * a[c]
                + (s4 * 0.25 - s3 * (2.0 / 3.0) + s2 * 0.5) * h * m[c]
                + (s3 - s4 * 0.5) * b[c]
                + (s4 * 0.25 - s3 / 3.0) * h * n[c])
        })
    }
}

/// Slopes of the spline with continuous second derivative and none at its ends: a tridiagonal
/// system, dominated by its diagonal.
fn complete_slopes<const N: usize>(times: &[f64], values: &[[f64; N]]) -> Vec<[f64; N]> {
    let count = times.len();
    let mut slopes = vec![[0.0; N]; count];
    if count < 3 {
        return slopes;
    }
    let inverse = |span: usize| 1.0 / (times[span + 1] - times[span]);
    // Forward: each row less its share of the one before.
    let mut above = vec![0.0; count];
    for i in 1..count - 1 {
        let (left, right) = (inverse(i - 1), inverse(i));
        let diagonal = 2.0 * (left + right) - left * above[i - 1];
        above[i] = right / diagonal;
        slopes[i] = std::array::from_fn(|c| {
            let before = (values[i][c] - values[i - 1][c]) * left * left;
            let after = (values[i + 1][c] - values[i][c]) * right * right;
            (3.0 * (before + after) - left * slopes[i - 1][c]) / diagonal
        });
    }
    for i in (1..count - 1).rev() {
        let next = slopes[i + 1];
        slopes[i] = std::array::from_fn(|c| slopes[i][c] - above[i] * next[c]);
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(join: Join) -> Curve<1> {
        let times = vec![0.5, 1.0, 2.5, 3.0, 4.0];
        let values = [1.0, -2.0, 0.5, 3.0, 3.5].map(|v| [v]).to_vec();
        Curve::new(join, times, values)
    }

    #[test]
    fn keys_are_met_and_held_outside() {
        for join in [Join::Straight, Join::Smooth] {
            let c = curve(join);
            for (time, value) in [(-9.0, 1.0), (0.5, 1.0), (1.0, -2.0), (2.5, 0.5), (9.0, 3.5)] {
                assert!((c.at(time)[0] - value).abs() < 1e-12, "{join:?} at {time}");
            }
        }
        assert!((curve(Join::Straight).at(1.75)[0] + 0.75).abs() < 1e-12);
        assert_eq!(Curve::constant([7.0]).at(123.0), [7.0]);
    }

    #[test]
    fn smooth_curves_have_two_continuous_derivatives_and_rest_at_their_ends() {
        let c = curve(Join::Smooth);
        let h = 1e-4;
        let first = |t: f64| (c.at(t + h)[0] - c.at(t - h)[0]) / (2.0 * h);
        let second = |t: f64| (c.at(t + h)[0] - 2.0 * c.at(t)[0] + c.at(t - h)[0]) / (h * h);
        for key in [1.0, 2.5, 3.0] {
            assert!(
                (first(key - 2.0 * h) - first(key + 2.0 * h)).abs() < 0.02,
                "{key}"
            );
            assert!(
                (second(key - 2.0 * h) - second(key + 2.0 * h)).abs() < 0.2,
                "{key}"
            );
        }
        for end in [0.5, 4.0] {
            assert!(first(end).abs() < 0.01, "{end}");
        }
    }

    #[test]
    fn integrals_are_those_of_a_fine_sum() {
        for join in [Join::Straight, Join::Smooth] {
            let c = curve(join);
            for end in [-1.0, 0.5, 0.7, 2.0, 3.9, 6.0_f64] {
                let steps = 20_000;
                let dt = (end - 0.5) / f64::from(steps);
                let middle = |k: i32| c.at(0.5 + (f64::from(k) + 0.5) * dt)[0] * dt;
                let sum: f64 = (0..steps).map(middle).sum();
                assert!((c.integral(end)[0] - sum).abs() < 1e-6, "{join:?} to {end}");
            }
        }
    }
}
