//! Frequency and damping of something that rings.

use std::f64::consts::TAU;

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

/// The oscillation that a ring about zero is most like.
///
/// Of one oscillation three samples at equal steps are linearly related,
/// `y_(k+1) = 2 e^(-z w s) cos(w_d s) y_k - e^(-2 z w s) y_(k-1)`; the two numbers are taken that
/// fit all samples best, in least squares. Where several oscillations sound together, it is the
/// one oscillator that comes nearest to what is heard, whatever small one dies last. The step s
/// is half of the time to the first crossing of zero, an eighth of a period.
///
/// - `samples`: at steps of `dt` (s), from when it was let go
///
/// Returns `None` where it does not swing.
///
/// Source: de Prony 1795, for one pair of exponentials.
pub fn oscillation(samples: &[f64], dt: f64) -> Option<Oscillation> {
    let crossing = samples
        .windows(2)
        .position(|pair| pair[0] != 0.0 && pair[0].signum() != pair[1].signum())?;
    let stride = crossing.div_ceil(2).max(1);
    let (mut squares, mut products, mut past) = (0.0, 0.0, 0.0);
    let (mut onward, mut across) = (0.0, 0.0);
    for k in stride..samples.len().saturating_sub(stride) {
        let [before, now, after] = [samples[k - stride], samples[k], samples[k + stride]];
        squares += now * now;
        products += now * before;
        past += before * before;
        onward += after * now;
        across += after * before;
    }
    let determinant = squares * past - products * products;
    if determinant.is_nan() || determinant <= 1e-12 * squares * past {
        return None;
    }
    let linear = (onward * past - across * products) / determinant;
    let constant = (across * squares - onward * products) / determinant;
    let decay = -constant;
    if decay <= 0.0 || 0.25 * linear * linear >= decay {
        return None;
    }
    let step = stride as f64 * dt;
    let damped = (0.5 * linear / decay.sqrt()).acos() / step;
    let loss = -0.5 * decay.ln() / step;
    Some(Oscillation {
        frequency: damped / TAU,
        damping_ratio: loss / damped.hypot(loss),
    })
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
                (found.frequency / expected.frequency - 1.0).abs() < 1e-6,
                "{found:?}"
            );
            assert!(
                (found.damping_ratio / ratio - 1.0).abs() < 1e-6,
                "{found:?}"
            );
            // A small one that dies last is not what is heard.
            let mixed: Vec<f64> = samples
                .iter()
                .enumerate()
                .map(|(k, y)| y + 0.01 * (70.0 * k as f64 * dt).cos())
                .collect();
            let found = oscillation(&mixed, dt).unwrap();
            assert!((found.frequency / expected.frequency - 1.0).abs() < 0.03);
        }
        assert_eq!(oscillation(&[1.0, 0.5, 0.2, 0.1, 0.0], 0.1), None);
        assert_eq!(oscillation(&[], 0.1), None);
    }
}
