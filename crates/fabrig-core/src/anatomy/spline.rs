//! Curves through points: Catmull-Rom splines and polylines by arc length.

use crate::Point;

/// A uniform Catmull-Rom spline through `points` at `t` in [0, 1]; two points make a line.
///
/// End tangents come from one point mirrored beyond each end.
///
/// # Source
///
/// Catmull & Rom 1974, A Class of Local Interpolating Splines.
pub(super) fn catmull_rom(points: &[Point], t: f64) -> Point {
    let last = points.len() - 1;
    if last == 0 {
        return points[0];
    }
    let x = t.clamp(0.0, 1.0) * last as f64;
    let k = (x.floor() as usize).min(last - 1);
    let s = x - k as f64;
    let (p1, p2) = (points[k].coords, points[k + 1].coords);
    let p0 = if k > 0 {
        points[k - 1].coords
    } else {
        p1 * 2.0 - p2
    };
    let p3 = if k + 2 <= last {
        points[k + 2].coords
    } else {
        p2 * 2.0 - p1
    };
    let (m1, m2) = ((p2 - p0) * 0.5, (p3 - p1) * 0.5);
    let (s2, s3) = (s * s, s * s * s);
    Point::from(
        p1 * (2.0 * s3 - 3.0 * s2 + 1.0)
            + m1 * (s3 - 2.0 * s2 + s)
            + p2 * (3.0 * s2 - 2.0 * s3)
            + m2 * (s3 - s2),
    )
}

/// A Catmull-Rom spline at parameters that are not evenly spaced.
///
/// - `knots`: rising, same length as `points`; `at`: between the first and the last knot
pub(super) fn catmull_rom_at(points: &[Point], knots: &[f64], at: f64) -> Point {
    let last = points.len() - 1;
    let k = knots[1..last].iter().filter(|knot| **knot <= at).count();
    let span = knots[k + 1] - knots[k];
    let s = if span > 0.0 {
        ((at - knots[k]) / span).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let slope = |i: usize| (points[i + 1] - points[i]) / (knots[i + 1] - knots[i]).max(1e-12);
    // Weighted as a parabola through three points would be.
    let tangent = |i: usize| {
        if i == 0 {
            slope(0)
        } else if i == last {
            slope(last - 1)
        } else {
            let (a, b) = (knots[i] - knots[i - 1], knots[i + 1] - knots[i]);
            (slope(i - 1) * b + slope(i) * a) / (a + b).max(1e-12)
        }
    };
    let (s2, s3) = (s * s, s * s * s);
    Point::from(
        points[k].coords * (2.0 * s3 - 3.0 * s2 + 1.0)
            + tangent(k) * span * (s3 - 2.0 * s2 + s)
            + points[k + 1].coords * (3.0 * s2 - 2.0 * s3)
            + tangent(k + 1) * span * (s3 - s2),
    )
}

/// `count` samples of the spline through `points`, evenly spaced by arc length, ends included.
pub(super) fn sample_by_length(points: &[Point], count: usize) -> Vec<Point> {
    let dense: Vec<Point> = (0..=256)
        .map(|i| catmull_rom(points, f64::from(i) / 256.0))
        .collect();
    (0..count)
        .map(|i| polyline_at(&dense, i as f64 / (count - 1).max(1) as f64))
        .collect()
}

/// The place at a share of the length of a polyline.
pub(super) fn polyline_at(points: &[Point], share: f64) -> Point {
    let length: f64 = polyline_length(points);
    let mut rest = share.clamp(0.0, 1.0) * length;
    for pair in points.windows(2) {
        let step = (pair[1] - pair[0]).norm();
        if rest <= step && step > 0.0 {
            return pair[0] + (pair[1] - pair[0]) * (rest / step);
        }
        rest -= step;
    }
    points[points.len() - 1]
}

/// Length of a polyline.
pub(super) fn polyline_length(points: &[Point]) -> f64 {
    points.windows(2).map(|p| (p[1] - p[0]).norm()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<Point> {
        [[0., 0., 0.], [1., 2., 0.], [3., 2., 1.], [4., 0., 0.]]
            .iter()
            .map(|c| Point::new(c[0], c[1], c[2]))
            .collect()
    }

    #[test]
    fn splines_pass_through_their_points() {
        let p = points();
        let knots = [0.0, 0.2, 0.7, 1.0];
        for k in 0..4 {
            assert!((catmull_rom(&p, k as f64 / 3.0) - p[k]).norm() < 1e-12);
            assert!((catmull_rom_at(&p, &knots, knots[k]) - p[k]).norm() < 1e-12);
        }
    }

    #[test]
    fn two_points_make_a_line_with_even_samples() {
        let p = [Point::origin(), Point::new(3.0, 0.0, 0.0)];
        let s = sample_by_length(&p, 4);
        for (k, q) in s.iter().enumerate() {
            assert!((q - Point::new(k as f64, 0.0, 0.0)).norm() < 1e-12);
        }
        assert!((catmull_rom_at(&p, &[0.0, 1.0], 0.5).x - 1.5).abs() < 1e-12);
    }

    #[test]
    fn samples_by_length_are_evenly_spaced() {
        let s = sample_by_length(&points(), 30);
        let steps: Vec<f64> = s.windows(2).map(|p| (p[1] - p[0]).norm()).collect();
        let mean = steps.iter().sum::<f64>() / steps.len() as f64;
        assert!(steps.iter().all(|s| (s / mean - 1.0).abs() < 0.02));
    }
}
