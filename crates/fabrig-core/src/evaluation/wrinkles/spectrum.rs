//! Spectra of lines that are not sampled evenly.

use std::f64::consts::TAU;

/// Wavelengths tried, from two mean steps to the length of the longest line.
const TRIED: usize = 400;

/// The wavelength whose slopes have the most power over all lines, each a list of (arc length,
/// height): the mean wave number of the peak, weighted by power down to half of it, so that it does
/// not hang on single samples. (mm)
///
/// Slopes, since light shows them and not heights: a part of the face that comes out as a whole by
/// more than its folds are deep is no wrinkle.
///
/// Returns `None` for lines that are flat or too short.
pub(super) fn dominant_wavelength(lines: &[Vec<(f64, f64)>]) -> Option<f64> {
    let length = |line: &[(f64, f64)]| Some(line.last()?.0 - line.first()?.0);
    let longest = lines.iter().filter_map(|l| length(l)).fold(0.0, f64::max);
    let steps = lines.iter().map(|l| l.len().saturating_sub(1)).max()?;
    if longest <= 0.0 || steps < 4 {
        return None;
    }
    let highest = 0.5 * steps as f64 / longest;
    let lowest = 1.0 / longest;
    let powers: Vec<(f64, f64)> = (0..TRIED)
        .map(|k| {
            let number = lowest + (highest - lowest) * k as f64 / (TRIED - 1) as f64;
            let heights: f64 = lines.iter().map(|line| power(line, number)).sum();
            (number, heights * number * number)
        })
        .collect();
    let (peak, most) = powers
        .iter()
        .enumerate()
        .map(|(k, p)| (k, p.1))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    if most <= 0.0 {
        return None;
    }
    let is_high = |k: &usize| powers[*k].1 >= 0.5 * most;
    let low = (0..=peak).rev().take_while(is_high).last()?;
    let high = (peak..TRIED).take_while(is_high).last()?;
    let (sum, weight) = powers[low..=high]
        .iter()
        .fold((0.0, 0.0), |(s, w), p| (s + p.0 * p.1, w + p.1));
    Some(weight / sum)
}

/// `|sum h(s) exp(-2 pi i n s) ds|^2` with steps between the middles of neighbours.
fn power(line: &[(f64, f64)], number: f64) -> f64 {
    let (mut real, mut imaginary) = (0.0, 0.0);
    for (k, &(s, h)) in line.iter().enumerate() {
        let before = line[k.saturating_sub(1)].0;
        let after = line[(k + 1).min(line.len() - 1)].0;
        let (sin, cos) = (TAU * number * s).sin_cos();
        let weight = 0.5 * (after - before) * h;
        real += weight * cos;
        imaginary += weight * sin;
    }
    real * real + imaginary * imaginary
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uneven_samples_of_a_wave_give_its_length() {
        for wavelength in [7.0, 11.0, 16.0] {
            let lines: Vec<Vec<(f64, f64)>> = (0..5)
                .map(|line| {
                    (0..41)
                        .map(|k| {
                            let s = 1.5 * f64::from(k) + 0.3 * f64::from(k * k % 7) / 7.0;
                            (s, (TAU * s / wavelength + f64::from(line)).sin())
                        })
                        .collect()
                })
                .collect();
            let found = dominant_wavelength(&lines).unwrap();
            assert!(
                (found / wavelength - 1.0).abs() < 0.04,
                "{found} {wavelength}"
            );
        }
        // Twice as high, four times as long: half as steep.
        let line: Vec<(f64, f64)> = (0..81)
            .map(|k| {
                let s = 0.75 * f64::from(k);
                (s, (TAU * s / 6.0).sin() + 2.0 * (TAU * s / 24.0).sin())
            })
            .collect();
        let found = dominant_wavelength(&[line]).unwrap();
        assert!((found / 6.0 - 1.0).abs() < 0.04, "{found}");
        let flat = vec![(0..20).map(|k| (f64::from(k), 0.0)).collect::<Vec<_>>()];
        assert_eq!(dominant_wavelength(&flat), None);
    }
}
