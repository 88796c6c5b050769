//! Small least squares whose unknowns have a sign: non-negative, or of either sign at a price.

use nalgebra::{Cholesky, DMatrix, DVector};

/// What unknowns may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sign {
    /// Zero or more, free of charge.
    NonNegative,
    /// Anything, each at this price times its size, so that few are not zero.
    Either {
        /// In the unit of the right-hand side.
        price: f64,
    },
}

impl Sign {
    fn price(self) -> f64 {
        match self {
            Self::NonNegative => 0.0,
            Self::Either { price } => price,
        }
    }
}

/// The unknowns in work: those that are not zero, each with its sign.
struct Active {
    weights: DVector<f64>,
    free: Vec<usize>,
    signs: Vec<f64>,
}

/// Minimises `1/2 w'Nw - b'w + price |w|_1` for a positive definite `N`, over `w >= 0` or over
/// all `w`.
///
/// Active sets after Lawson & Hanson 1974, on the normal equations, with signs after the
/// feature-sign search of Lee et al. 2007; every round solves the free unknowns exactly, so
/// the answer is exact up to rounding when it ends by itself, and of the right signs always. A
/// `start` near the answer saves rounds.
pub(super) fn solve_signed(
    normal: &DMatrix<f64>,
    rhs: &DVector<f64>,
    sign: Sign,
    start: DVector<f64>,
) -> DVector<f64> {
    let count = rhs.len();
    let scale = (0..count).map(|i| normal[(i, i)]).fold(0.0, f64::max);
    let tolerance = 1e-10 * scale.max(f64::MIN_POSITIVE);
    let mut active = Active {
        free: (0..count).filter(|&i| start[i] != 0.0).collect(),
        signs: start.iter().map(|w| w.signum()).collect(),
        weights: start,
    };
    let mut is_started = !active.free.is_empty();
    for _ in 0..3 * count {
        if is_started {
            is_started = false;
        } else {
            let mut gradient = rhs.clone();
            for &i in &active.free {
                gradient.axpy(-active.weights[i], &normal.column(i), 1.0);
            }
            let gain = |i: usize| match sign {
                Sign::NonNegative => gradient[i],
                Sign::Either { price } => gradient[i].abs() - price,
            };
            let entering = (0..count)
                .filter(|&i| active.weights[i] == 0.0)
                .max_by(|&a, &b| gain(a).total_cmp(&gain(b)));
            match entering {
                Some(i) if gain(i) > tolerance => {
                    active.signs[i] = match sign {
                        Sign::NonNegative => 1.0,
                        Sign::Either { .. } => gradient[i].signum(),
                    };
                    active.free.push(i);
                }
                _ => break,
            }
        }
        if active.settle(normal, rhs, sign.price()).is_none() {
            break;
        }
    }
    active.weights
}

impl Active {
    /// Solves the free unknowns; those that would change their sign go to zero and leave.
    /// `None` where the free part cannot be solved.
    fn settle(&mut self, normal: &DMatrix<f64>, rhs: &DVector<f64>, price: f64) -> Option<()> {
        while !self.free.is_empty() {
            let solution = self.solve_free(normal, rhs, price)?;
            let keeps_sign = |(&i, &s): (&usize, &f64)| s * self.signs[i] > 0.0;
            if self.free.iter().zip(solution.iter()).all(keeps_sign) {
                for (&i, &s) in self.free.iter().zip(solution.iter()) {
                    self.weights[i] = s;
                }
                return Some(());
            }
            let mut step = 1.0f64;
            let mut leaving = None;
            for (slot, (&i, &s)) in self.free.iter().zip(solution.iter()).enumerate() {
                if s * self.signs[i] <= 0.0 {
                    let way = self.weights[i] - s;
                    let share = if way == 0.0 {
                        0.0
                    } else {
                        self.weights[i] / way
                    };
                    if leaving.is_none() || share < step {
                        (step, leaving) = (share, Some(slot));
                    }
                }
            }
            for (&i, &s) in self.free.iter().zip(solution.iter()) {
                self.weights[i] += step * (s - self.weights[i]);
            }
            let leaving = leaving.map(|slot| self.free[slot]);
            let (weights, signs) = (&mut self.weights, &self.signs);
            self.free.retain(|&i| {
                let stays = Some(i) != leaving && weights[i] * signs[i] > 1e-12;
                if !stays {
                    weights[i] = 0.0;
                }
                stays
            });
        }
        Some(())
    }

    fn solve_free(
        &self,
        normal: &DMatrix<f64>,
        rhs: &DVector<f64>,
        price: f64,
    ) -> Option<DVector<f64>> {
        let free = &self.free;
        let n = free.len();
        let sub = DMatrix::from_fn(n, n, |i, j| normal[(free[i], free[j])]);
        let b = DVector::from_fn(n, |i, _| rhs[free[i]] - price * self.signs[free[i]]);
        Cholesky::new(sub).map(|c| c.solve(&b))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inner_solution_is_the_linear_one() {
        let normal = DMatrix::from_row_slice(2, 2, &[2.0, 0.5, 0.5, 1.0]);
        let want = DVector::from_row_slice(&[0.3, 0.4]);
        let rhs = &normal * &want;
        for sign in [Sign::NonNegative, Sign::Either { price: 0.0 }] {
            let got = solve_signed(&normal, &rhs, sign, DVector::zeros(2));
            assert!((got - &want).norm() < 1e-10);
        }
    }

    /// A fixed ill-conditioned problem whose free solution has negative parts.
    fn hard_problem() -> (DMatrix<f64>, DVector<f64>) {
        let count = 12;
        let rows = DMatrix::from_fn(20, count, |i, j| {
            ((i * 7 + j * 3) as f64 * 0.37).sin() + 0.2 * (i as f64 * 0.1).cos()
        });
        let mut normal = rows.transpose() * &rows;
        for i in 0..count {
            normal[(i, i)] += 1e-3;
        }
        (
            normal,
            DVector::from_fn(count, |i, _| (i as f64 * 1.3).cos()),
        )
    }

    #[test]
    fn a_non_negative_answer_meets_the_optimality_conditions() {
        let (normal, rhs) = hard_problem();
        let count = rhs.len();
        let cold = solve_signed(&normal, &rhs, Sign::NonNegative, DVector::zeros(count));
        let start = DVector::from_element(count, 0.1);
        let warm = solve_signed(&normal, &rhs, Sign::NonNegative, start);
        assert!((&cold - warm).norm() < 1e-6);
        let gradient = rhs - &normal * &cold;
        for i in 0..count {
            assert!(cold[i] >= 0.0);
            if cold[i] > 0.0 {
                assert!(gradient[i].abs() < 1e-6, "free {i}: {}", gradient[i]);
            } else {
                assert!(gradient[i] < 1e-6, "bound {i}: {}", gradient[i]);
            }
        }
    }

    #[test]
    fn a_priced_answer_meets_the_optimality_conditions_and_is_sparse() {
        let (normal, rhs) = hard_problem();
        let (count, price) = (rhs.len(), 0.4);
        let sign = Sign::Either { price };
        let cold = solve_signed(&normal, &rhs, sign, DVector::zeros(count));
        let start = DVector::from_fn(count, |i, _| if i % 2 == 0 { 0.1 } else { -0.1 });
        let warm = solve_signed(&normal, &rhs, sign, start);
        assert!((&cold - warm).norm() < 1e-6);
        let gradient = rhs - &normal * &cold;
        let mut zero_count = 0;
        for i in 0..count {
            if cold[i] == 0.0 {
                zero_count += 1;
                assert!(gradient[i].abs() < price + 1e-6, "{i}: {}", gradient[i]);
            } else {
                let left = gradient[i] - price * cold[i].signum();
                assert!(left.abs() < 1e-6, "{i}: {left}");
            }
        }
        assert!((1..count).contains(&zero_count));
        assert!(cold.iter().any(|w| *w < 0.0));
    }
}
