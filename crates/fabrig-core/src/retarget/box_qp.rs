//! Quadratic problems over a box: `min 1/2 w'Hw - g'w`, `0 <= w <= 1`.
//!
//! A few sweeps of projected coordinate descent find most of the active bounds; a primal
//! active set method goes on from there to the solution, which for a positive definite `H` is
//! the only one and reached in finitely many steps.
//!
//! # Source
//!
//! Nocedal & Wright, *Numerical Optimization*, 2nd ed., 2006, section 16.5.

use nalgebra::{DMatrix, DVector};

use super::RetargetError;

/// Sweeps of coordinate descent before the active set takes over.
const SWEEPS: usize = 8;

/// Largest KKT residual that is taken for a solution.
const TOLERANCE: f64 = 1e-9;

/// A problem, `min 1/2 w'Hw - g'w` over `0 <= w <= 1`.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxQp {
    /// `H`, symmetric positive definite, shape [control_count, control_count].
    pub hessian: DMatrix<f64>,
    /// `g`, shape `[control_count]`.
    pub linear: DVector<f64>,
}

/// Its solution.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxSolution {
    /// `w`, shape `[control_count]`.
    pub weights: DVector<f64>,
    /// Largest |w - clamp(w - D^-1 (Hw - g))|, D the diagonal of `H`: 0 exactly where the
    /// conditions of Karush, Kuhn and Tucker hold, in units of weight.
    pub kkt_residual: f64,
    /// Steps of the active set method.
    pub steps: usize,
}

impl BoxQp {
    /// The value that is minimized.
    pub fn value(&self, weights: &DVector<f64>) -> f64 {
        0.5 * weights.dot(&(&self.hessian * weights)) - self.linear.dot(weights)
    }

    /// See [`BoxSolution::kkt_residual`].
    pub fn kkt_residual(&self, weights: &DVector<f64>) -> f64 {
        let gradient = &self.hessian * weights - &self.linear;
        (0..weights.len())
            .map(|i| {
                let stepped = weights[i] - gradient[i] / self.hessian[(i, i)];
                (weights[i] - stepped.clamp(0.0, 1.0)).abs()
            })
            .fold(0.0, f64::max)
    }
}

/// Solves a problem, starting from `start` (clamped to the box).
///
/// # Errors
///
/// [`RetargetError::Count`] where sizes do not fit, [`RetargetError::NotPositiveDefinite`].
pub fn solve_box_qp(problem: &BoxQp, start: &DVector<f64>) -> Result<BoxSolution, RetargetError> {
    let count = problem.linear.len();
    for (what, found) in [
        ("rows of the matrix", problem.hessian.nrows()),
        ("columns of the matrix", problem.hessian.ncols()),
        ("starting weights", start.len()),
    ] {
        if found != count {
            return Err(RetargetError::Count {
                what,
                expected: count,
                found,
            });
        }
    }
    let bad = |i: &usize| {
        let d = problem.hessian[(*i, *i)];
        !(d > 0.0 && d.is_finite())
    };
    if let Some(control) = (0..count).find(bad) {
        return Err(RetargetError::NotPositiveDefinite { control });
    }
    let mut weights = start.map(|w| {
        if w.is_finite() {
            w.clamp(0.0, 1.0)
        } else {
            0.0
        }
    });
    descend(problem, &mut weights);
    let steps = active_set(problem, &mut weights)?;
    Ok(BoxSolution {
        kkt_residual: problem.kkt_residual(&weights),
        weights,
        steps,
    })
}

fn descend(problem: &BoxQp, weights: &mut DVector<f64>) {
    for _ in 0..SWEEPS {
        for i in 0..weights.len() {
            let slope = problem.hessian.column(i).dot(weights) - problem.linear[i];
            weights[i] = (weights[i] - slope / problem.hessian[(i, i)]).clamp(0.0, 1.0);
        }
    }
}

/// Goes from face to face of the box until no bound wants to be left.
fn active_set(problem: &BoxQp, weights: &mut DVector<f64>) -> Result<usize, RetargetError> {
    let count = weights.len();
    let mut is_free: Vec<bool> = weights.iter().map(|w| 0.0 < *w && *w < 1.0).collect();
    // Each face is left for a lower value and never met again; the bound is for rounding.
    let most = 20 * count + 50;
    for step in 0..most {
        let free: Vec<usize> = (0..count).filter(|&i| is_free[i]).collect();
        if !free.is_empty() {
            let target = solve_free(problem, weights, &free)?;
            // As far towards the face's own minimum as the box allows.
            let mut share = 1.0f64;
            let mut blocked = None;
            for (k, &i) in free.iter().enumerate() {
                let move_by = target[k] - weights[i];
                let room = if move_by > 0.0 {
                    1.0 - weights[i]
                } else {
                    -weights[i]
                };
                if target[k] < 0.0 || target[k] > 1.0 {
                    let reach = (room / move_by).clamp(0.0, 1.0);
                    if reach < share || blocked.is_none() {
                        share = share.min(reach);
                        blocked = Some((i, if move_by > 0.0 { 1.0 } else { 0.0 }));
                    }
                }
            }
            for (k, &i) in free.iter().enumerate() {
                weights[i] += share * (target[k] - weights[i]);
            }
            if let Some((i, bound)) = blocked {
                weights[i] = bound;
                is_free[i] = false;
                continue;
            }
        }
        let gradient = &problem.hessian * &*weights - &problem.linear;
        let release = (0..count)
            .filter(|&i| !is_free[i])
            .map(|i| {
                let inwards = if weights[i] <= 0.0 { -1.0 } else { 1.0 };
                (inwards * gradient[i] / problem.hessian[(i, i)], i)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match release {
            Some((gain, i)) if gain > TOLERANCE => is_free[i] = true,
            _ => return Ok(step),
        }
    }
    Ok(most)
}

/// The minimum over the free controls with the others where they are.
fn solve_free(
    problem: &BoxQp,
    weights: &DVector<f64>,
    free: &[usize],
) -> Result<DVector<f64>, RetargetError> {
    let matrix = DMatrix::from_fn(free.len(), free.len(), |a, b| {
        problem.hessian[(free[a], free[b])]
    });
    let mut held = weights.clone();
    for &i in free {
        held[i] = 0.0;
    }
    let offset = &problem.hessian * held;
    let right = DVector::from_fn(free.len(), |a, _| problem.linear[free[a]] - offset[free[a]]);
    match matrix.cholesky() {
        Some(factor) => Ok(factor.solve(&right)),
        None => Err(RetargetError::NotPositiveDefinite { control: free[0] }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The best of the minima over all faces of the box.
    fn brute_force(problem: &BoxQp) -> DVector<f64> {
        let count = problem.linear.len();
        let mut best: Option<(f64, DVector<f64>)> = None;
        for code in 0..3usize.pow(count as u32) {
            let digit = |i: usize| code / 3usize.pow(i as u32) % 3;
            let mut weights = DVector::from_fn(count, |i, _| if digit(i) == 1 { 1.0 } else { 0.0 });
            let free: Vec<usize> = (0..count).filter(|&i| digit(i) == 2).collect();
            if !free.is_empty() {
                let found = solve_free(problem, &weights, &free).unwrap();
                for (k, &i) in free.iter().enumerate() {
                    weights[i] = found[k];
                }
            }
            if weights.iter().any(|w| !(-1e-12..=1.0 + 1e-12).contains(w)) {
                continue;
            }
            let value = problem.value(&weights);
            if best.as_ref().is_none_or(|(least, _)| value < *least) {
                best = Some((value, weights));
            }
        }
        best.unwrap().1
    }

    #[test]
    fn problems_that_have_no_solution_are_refused() {
        let problem = BoxQp {
            hessian: DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0]),
            linear: DVector::zeros(2),
        };
        assert!(matches!(
            solve_box_qp(&problem, &DVector::zeros(2)),
            Err(RetargetError::NotPositiveDefinite { control: 1 })
        ));
        assert!(matches!(
            solve_box_qp(&problem, &DVector::zeros(3)),
            Err(RetargetError::Count { .. })
        ));
    }

    proptest::proptest! {
        #[test]
        fn small_problems_agree_with_trying_every_face(
            entries in proptest::collection::vec(-1.0f64..1.0, 20),
            linear in proptest::collection::vec(-2.0f64..2.0, 4),
            start in proptest::collection::vec(-0.5f64..1.5, 4),
        ) {
            let basis = DMatrix::from_row_slice(5, 4, &entries);
            let hessian = basis.transpose() * &basis + DMatrix::identity(4, 4) * 1e-3;
            let problem = BoxQp { hessian, linear: DVector::from_vec(linear) };
            let found = solve_box_qp(&problem, &DVector::from_vec(start)).unwrap();
            let expected = brute_force(&problem);
            proptest::prop_assert!(found.kkt_residual < 1e-8, "{}", found.kkt_residual);
            proptest::prop_assert!((&found.weights - &expected).amax() < 1e-6,
                "{} {}", found.weights, expected);
        }

        #[test]
        fn larger_problems_meet_the_kkt_conditions(
            entries in proptest::collection::vec(-1.0f64..1.0, 60 * 30),
            linear in proptest::collection::vec(-3.0f64..3.0, 30),
        ) {
            let basis = DMatrix::from_row_slice(60, 30, &entries);
            let hessian = basis.transpose() * &basis + DMatrix::identity(30, 30) * 1e-4;
            let problem = BoxQp { hessian, linear: DVector::from_vec(linear) };
            let found = solve_box_qp(&problem, &DVector::repeat(30, 0.5)).unwrap();
            proptest::prop_assert!(found.kkt_residual < 1e-8, "{}", found.kkt_residual);
            proptest::prop_assert!(found.weights.iter().all(|w| (0.0..=1.0).contains(w)));
        }
    }
}
