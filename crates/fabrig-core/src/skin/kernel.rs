//! The kernel that binds by distance alone: `(1 - (d/R)^2)^3`.

/// The kernel at distance `d` for radius `radius`: 1 at 0, 0 from the radius on, twice
/// smooth there.
pub fn falloff(d: f64, radius: f64) -> f64 {
    let t = 1.0 - (d / radius).powi(2);
    if t > 0.0 { t.powi(3) } else { 0.0 }
}

/// Weights of nodes at the given distances: kernel with a radius just beyond the furthest,
/// normalized to a sum that falls from one to zero as the nearest goes from 0 to `reach`.
/// What is missing to one is the skull's. (mm)
pub fn weights(distances: &[f64], reach: f64) -> Vec<f64> {
    let furthest = distances.iter().copied().fold(0.0, f64::max);
    let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let radius = (1.1 * furthest).max(f64::MIN_POSITIVE).min(reach);
    let mut weights: Vec<f64> = distances.iter().map(|&d| falloff(d, radius)).collect();
    let total: f64 = weights.iter().sum();
    let hold = if nearest.is_finite() {
        falloff(nearest, reach)
    } else {
        0.0
    };
    for weight in &mut weights {
        *weight = if total > 0.0 {
            *weight * hold / total
        } else {
            0.0
        };
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_at_a_node_and_fade_to_the_skull() {
        let near: f64 = weights(&[0.0, 1.0, 2.0], 20.0).iter().sum();
        let far: f64 = weights(&[19.9, 19.95], 20.0).iter().sum();
        let out: f64 = weights(&[20.0, 25.0], 20.0).iter().sum();
        assert!((near - 1.0).abs() < 1e-12);
        assert!(far > 0.0 && far < 1e-4);
        assert_eq!(out, 0.0);
        assert!(weights(&[], 20.0).is_empty());
    }
}
