//! Depth and wavelength of lines over a surface.

use serde::Serialize;

use super::spectrum::dominant_wavelength;

/// Waves shorter than this share of the longest line are wrinkles; what is longer is form.
const ROUGHEST: f64 = 0.6;

/// What lines over a surface measure.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct WrinkleFigures {
    /// Root mean square of the height, less each line's parabola. (mm)
    pub depth_rms: f64,
    /// From the lowest trough to the highest ridge of a line: median over the lines. (mm)
    pub trough_to_ridge: f64,
    /// The wavelength whose slopes have the most power; 0 where there is no wave. (mm)
    pub wavelength: f64,
}

/// Measures lines of (arc length, height), both in mm.
pub fn figures_of_lines(lines: &[Vec<(f64, f64)>]) -> WrinkleFigures {
    let lines: Vec<Vec<(f64, f64)>> = lines.iter().map(|line| less_parabola(line)).collect();
    let heights = || lines.iter().flatten().map(|s| s.1);
    let count = heights().count();
    let mut spans: Vec<f64> = lines
        .iter()
        .map(|line| {
            let low = line.iter().map(|s| s.1).fold(f64::INFINITY, f64::min);
            let high = line.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
            (high - low).max(0.0)
        })
        .collect();
    spans.sort_by(f64::total_cmp);
    let longest = lines
        .iter()
        .filter_map(|line| Some(line.last()?.0 - line.first()?.0))
        .fold(0.0, f64::max);
    let wavelength = dominant_wavelength(&lines).filter(|l| *l < ROUGHEST * longest);
    WrinkleFigures {
        depth_rms: (heights().map(|h| h * h).sum::<f64>() / count.max(1) as f64).sqrt(),
        trough_to_ridge: spans.get(spans.len() / 2).copied().unwrap_or(0.0),
        wavelength: wavelength.unwrap_or(0.0),
    }
}

/// A line less its least squares parabola.
fn less_parabola(line: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (line.first(), line.last()) else {
        return Vec::new();
    };
    let (middle, half) = (0.5 * (first.0 + last.0), 0.5 * (last.0 - first.0));
    let terms = |s: f64| {
        let t = if half > 0.0 { (s - middle) / half } else { 0.0 };
        nalgebra::Vector3::new(1.0, t, t * t)
    };
    let mut normal = nalgebra::Matrix3::zeros();
    let mut rhs = nalgebra::Vector3::zeros();
    for &(s, h) in line {
        let t = terms(s);
        normal += t * t.transpose();
        rhs += t * h;
    }
    let fit = normal.lu().solve(&rhs).unwrap_or_default();
    line.iter()
        .map(|&(s, h)| (s, h - fit.dot(&terms(s))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_on_a_bowl_is_measured_without_the_bowl() {
        let line: Vec<(f64, f64)> = (0..201)
            .map(|k| {
                let s = 0.5 * f64::from(k);
                let wave = 0.4 * (std::f64::consts::TAU * s / 10.0).sin();
                (s, wave + 0.01 * (s - 20.0).powi(2))
            })
            .collect();
        let figures = figures_of_lines(&[line.clone(), line]);
        assert!(
            (figures.depth_rms - 0.4 / 2f64.sqrt()).abs() < 0.02,
            "{figures:?}"
        );
        assert!((figures.trough_to_ridge - 0.8).abs() < 0.1, "{figures:?}");
        assert!((figures.wavelength - 10.0).abs() < 0.4, "{figures:?}");
        let flat = figures_of_lines(&[vec![(0.0, 1.0), (1.0, 2.0), (2.0, 5.0)]]);
        assert!(flat.depth_rms < 1e-9 && flat.wavelength == 0.0, "{flat:?}");
    }
}
