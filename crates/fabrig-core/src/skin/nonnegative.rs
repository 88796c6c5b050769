//! Small least squares with non-negative unknowns.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Minimises `1/2 w'Nw - b'w` over `w >= 0` for a positive definite `N`.
///
/// Active sets after Lawson & Hanson 1974, on the normal equations; every round solves the
/// free unknowns exactly, so the answer is exact up to rounding when it ends by itself, and
/// feasible always. A feasible `start` near the answer saves rounds.
pub(super) fn solve_nonnegative(
    normal: &DMatrix<f64>,
    rhs: &DVector<f64>,
    start: DVector<f64>,
) -> DVector<f64> {
    let count = rhs.len();
    let scale = (0..count).map(|i| normal[(i, i)]).fold(0.0, f64::max);
    let tolerance = 1e-10 * scale.max(f64::MIN_POSITIVE);
    let mut weights = start;
    let mut free: Vec<usize> = (0..count).filter(|&i| weights[i] > 0.0).collect();
    let mut is_started = !free.is_empty();
    for _ in 0..3 * count {
        let gradient = rhs - normal * &weights;
        let entering = (0..count)
            .filter(|i| !free.contains(i))
            .max_by(|&a, &b| gradient[a].total_cmp(&gradient[b]));
        match entering {
            _ if is_started => is_started = false,
            Some(i) if gradient[i] > tolerance => free.push(i),
            _ => break,
        }
        // Shrink the free set until its exact solution is inside.
        loop {
            let Some(solution) = solve_free(normal, rhs, &free) else {
                free.pop();
                return weights;
            };
            if solution.iter().all(|&s| s > 0.0) {
                weights.fill(0.0);
                for (&i, &s) in free.iter().zip(solution.iter()) {
                    weights[i] = s;
                }
                break;
            }
            let mut step = 1.0f64;
            for (&i, &s) in free.iter().zip(solution.iter()) {
                if s <= 0.0 {
                    step = step.min(weights[i] / (weights[i] - s).max(f64::MIN_POSITIVE));
                }
            }
            for (&i, &s) in free.iter().zip(solution.iter()) {
                weights[i] += step * (s - weights[i]);
            }
            let before = free.len();
            let weights_now = &mut weights;
            free.retain(|&i| {
                let stays = weights_now[i] > 1e-12;
                if !stays {
                    weights_now[i] = 0.0;
                }
                stays
            });
            if free.is_empty() || free.len() == before {
                break;
            }
        }
    }
    weights
}

fn solve_free(normal: &DMatrix<f64>, rhs: &DVector<f64>, free: &[usize]) -> Option<DVector<f64>> {
    let n = free.len();
    let sub = DMatrix::from_fn(n, n, |i, j| normal[(free[i], free[j])]);
    let b = DVector::from_fn(n, |i, _| rhs[free[i]]);
    Cholesky::new(sub).map(|c| c.solve(&b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inner_solution_is_the_linear_one() {
        let normal = DMatrix::from_row_slice(2, 2, &[2.0, 0.5, 0.5, 1.0]);
        let want = DVector::from_row_slice(&[0.3, 0.4]);
        let got = solve_nonnegative(&normal, &(&normal * &want), DVector::zeros(2));
        assert!((got - want).norm() < 1e-10);
    }

    #[test]
    fn the_answer_meets_the_optimality_conditions() {
        // A fixed ill-conditioned problem whose free solution has negative parts.
        let count = 12;
        let rows = DMatrix::from_fn(20, count, |i, j| {
            ((i * 7 + j * 3) as f64 * 0.37).sin() + 0.2 * (i as f64 * 0.1).cos()
        });
        let mut normal = rows.transpose() * &rows;
        for i in 0..count {
            normal[(i, i)] += 1e-3;
        }
        let rhs = DVector::from_fn(count, |i, _| (i as f64 * 1.3).cos());
        let cold = solve_nonnegative(&normal, &rhs, DVector::zeros(count));
        let warm = solve_nonnegative(&normal, &rhs, DVector::from_element(count, 0.1));
        assert!((&cold - warm).norm() < 1e-6);
        let w = cold;
        let gradient = rhs - &normal * &w;
        for i in 0..count {
            assert!(w[i] >= 0.0);
            if w[i] > 0.0 {
                assert!(gradient[i].abs() < 1e-6, "free {i}: {}", gradient[i]);
            } else {
                assert!(gradient[i] < 1e-6, "bound {i}: {}", gradient[i]);
            }
        }
    }
}
