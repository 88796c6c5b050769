//! Frequency and damping of something that rings.

use std::f64::consts::{PI, TAU};

use serde::Serialize;

/// A damped oscillation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Oscillation {
    /// Damped frequency. (Hz)
    pub frequency: f64,
    /// Share of critical damping.
    pub damping_ratio: f64,
}

impl Oscillation {
    /// Of a mass on a spring: `x'' + c x' + w^2 x = 0`.
    ///
    /// - `rate`: w (1/s); `damping`: c (1/s)
    pub fn of_spring(rate: f64, damping: f64) -> Self {
        let damping_ratio = 0.5 * damping / rate;
        let below = (1.0 - damping_ratio * damping_ratio).max(0.0);
        Self {
            frequency: rate / TAU * below.sqrt(),
            damping_ratio,
        }
    }
}

/// Measures a ring about zero: half a period is the time between crossings of zero, and the
/// logarithmic decrement comes from the extremes between them.
///
/// - `samples`: at steps of `dt` (s), from when it was let go
///
/// Returns `None` where it does not swing at least once and a half.
pub fn oscillation(samples: &[f64], dt: f64) -> Option<Oscillation> {
    let mut crossings = Vec::new();
    let mut extremes = vec![];
    let mut most = 0.0f64;
    for (k, pair) in samples.windows(2).enumerate() {
        let (a, b) = (pair[0], pair[1]);
        most = most.max(peak_near(samples, k));
        if a != 0.0 && a.signum() != b.signum() {
            crossings.push((k as f64 + a / (a - b)) * dt);
            extremes.push(most);
            most = 0.0;
        }
    }
    // What comes before the first crossing is where it was held.
    let count = crossings.len();
    if count < 3 {
        return None;
    }
    let largest = extremes.get(1).copied()?;
    // Beyond this it is noise.
    let used = (1..count)
        .take_while(|&k| extremes[k] > 0.02 * largest)
        .last()?;
    if used < 2 {
        return None;
    }
    let half_period = (crossings[used] - crossings[0]) / used as f64;
    let decrement = (extremes[1] / extremes[used]).ln() / (used - 1) as f64;
    let damping_ratio = decrement / (PI * PI + decrement * decrement).sqrt();
    Some(Oscillation {
        frequency: 0.5 / half_period,
        damping_ratio,
    })
}

/// Size of the extreme of the parabola through a sample and its neighbours, or of the sample.
fn peak_near(samples: &[f64], k: usize) -> f64 {
    let own = samples[k].abs();
    let (Some(before), Some(after)) = (k.checked_sub(1).map(|k| samples[k]), samples.get(k + 1))
    else {
        return own;
    };
    let (a, b, c) = (before.abs(), own, after.abs());
    let bend = a - 2.0 * b + c;
    if b >= a && b >= c && bend < 0.0 && before.signum() == after.signum() {
        b - 0.125 * (a - c).powi(2) / bend
    } else {
        own
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_ring_is_measured() {
        for (frequency, ratio) in [(7.0, 0.05), (7.0, 0.137), (4.0, 0.3)] {
            let dt = 1.0 / 480.0;
            let rate = TAU * frequency;
            let damped = rate * (1.0f64 - ratio * ratio).sqrt();
            let samples: Vec<f64> = (0..960)
                .map(|k| {
                    let t = f64::from(k) * dt;
                    let swing = (damped * t).cos() + ratio * rate / damped * (damped * t).sin();
                    -(-ratio * rate * t).exp() * swing
                })
                .collect();
            let found = oscillation(&samples, dt).unwrap();
            let expected = Oscillation::of_spring(rate, 2.0 * ratio * rate);
            assert!(
                (found.frequency / expected.frequency - 1.0).abs() < 0.01,
                "{found:?}"
            );
            assert!(
                (found.damping_ratio / ratio - 1.0).abs() < 0.03,
                "{found:?}"
            );
        }
        assert_eq!(oscillation(&[1.0, 0.5, 0.2, 0.1, 0.0], 0.1), None);
        assert_eq!(oscillation(&[], 0.1), None);
    }
}
