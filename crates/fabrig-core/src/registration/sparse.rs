//! Sparse symmetric positive definite systems: one symbolic factorization, many numeric ones.
//!
//! Runs on one thread on purpose: at these sizes (a few thousand unknowns) faer's own
//! threading costs more than it saves, and one thread gives the same bits everywhere.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};

use super::RegistrationError;

/// A symmetric positive definite matrix of fixed pattern (lower triangle, by columns).
pub(crate) struct SpdSystem {
    size: usize,
    column_starts: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

impl SpdSystem {
    /// The pattern: pairs (i, j) in any order, any triangle, repeated or not. The diagonal is
    /// always in it.
    pub(crate) fn new(size: usize, pairs: &[(u32, u32)]) -> Result<Self, RegistrationError> {
        let mut entries: Vec<(u32, u32)> = pairs
            .iter()
            .map(|&(i, j)| (i.min(j), i.max(j)))
            .chain((0..size as u32).map(|i| (i, i)))
            .collect();
        entries.sort_unstable();
        entries.dedup();
        let mut column_starts = vec![0usize; size + 1];
        for e in &entries {
            column_starts[e.0 as usize + 1] += 1;
        }
        for c in 0..size {
            column_starts[c + 1] += column_starts[c];
        }
        let rows: Vec<usize> = entries.iter().map(|e| e.1 as usize).collect();
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, &column_starts, None, &rows);
        let symbolic = factorize_symbolic_cholesky(
            pattern,
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|_| RegistrationError::SystemTooLarge { unknowns: size })?;
        let factor = vec![0.0; symbolic.len_val()];
        let scratch = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default())
            .or(symbolic.solve_in_place_scratch::<f64>(3, Par::Seq));
        Ok(Self {
            size,
            values: vec![0.0; rows.len()],
            column_starts,
            rows,
            symbolic,
            factor,
            memory: MemBuffer::new(scratch),
        })
    }

    /// Sets every value to zero.
    pub(super) fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Values of the lower triangle, column after column.
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Sets all values, in the order of [`Self::values`].
    pub(super) fn set_values(&mut self, values: &[f64]) {
        self.values.copy_from_slice(values);
    }

    /// Adds to the entry (i, j), which must be in the pattern; the entry (j, i) follows.
    pub(crate) fn add(&mut self, i: u32, j: u32, value: f64) {
        let (column, row) = (i.min(j) as usize, i.max(j) as usize);
        let range = self.column_starts[column]..self.column_starts[column + 1];
        if let Ok(k) = self.rows[range.clone()].binary_search(&row) {
            self.values[range.start + k] += value;
        } else {
            debug_assert!(false, "entry ({i}, {j}) is not in the pattern");
        }
    }

    /// Factorizes and solves for three right-hand sides at once, in place; `rhs` is
    /// column-major, shape [3, size].
    pub(crate) fn solve(&mut self, rhs: &mut [f64]) -> Result<(), RegistrationError> {
        self.factorize()?;
        self.solve_factorized(rhs);
        Ok(())
    }

    /// Factorizes the matrix as it stands, for [`Self::solve_factorized`].
    pub(crate) fn factorize(&mut self) -> Result<(), RegistrationError> {
        let pattern = SymbolicSparseColMatRef::new_checked(
            self.size,
            self.size,
            &self.column_starts,
            None,
            &self.rows,
        );
        let matrix = SparseColMatRef::new(pattern, &self.values);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.memory),
                Spec::default(),
            )
            .map(|_| ())
            .map_err(|_| RegistrationError::SystemNotSolvable {
                unknowns: self.size,
            })
    }

    /// Solves with the last factorization; `rhs` as for [`Self::solve`].
    pub(crate) fn solve_factorized(&mut self, rhs: &mut [f64]) {
        let columns = MatMut::from_column_major_slice_mut(rhs, self.size, 3);
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            columns,
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_of_springs_is_solved_twice_with_one_pattern() {
        let n = 50u32;
        let pairs: Vec<_> = (1..n).map(|i| (i, i - 1)).collect();
        let mut system = SpdSystem::new(n as usize, &pairs).expect("symbolic");
        for stiffness in [1.0, 7.5] {
            system.clear();
            for i in 0..n {
                system.add(i, i, 0.1);
            }
            for &(i, j) in &pairs {
                system.add(i, i, stiffness);
                system.add(j, j, stiffness);
                system.add(j, i, -stiffness);
            }
            let x: Vec<f64> = (0..3 * n).map(|i| (f64::from(i) * 0.37).sin()).collect();
            let mut rhs = vec![0.0; 3 * n as usize];
            for c in 0..3 {
                let at = |i: u32| x[(c * n + i) as usize];
                for i in 0..n {
                    let mut y = 0.1 * at(i);
                    if i > 0 {
                        y += stiffness * (at(i) - at(i - 1));
                    }
                    if i + 1 < n {
                        y += stiffness * (at(i) - at(i + 1));
                    }
                    rhs[(c * n + i) as usize] = y;
                }
            }
            system.solve(&mut rhs).expect("solve");
            for (a, b) in rhs.iter().zip(&x) {
                assert!((a - b).abs() < 1e-10);
            }
        }
    }
}
