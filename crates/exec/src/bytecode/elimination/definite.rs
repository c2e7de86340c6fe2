//! Sparse symmetric linear equations whose matrix is definite, in an order that is fixed: `Uᵀ D U` row by row, half the work
//! of [`SparseLu`](super::sparse::SparseLu). No pivot is sought and nothing refined: the errors of such factors are those
//! of rounding, however unlike the magnitudes on the diagonal are (Demmel, "Applied Numerical Linear Algebra", 1997,
//! section 2.7).
//!
//! Exported C does the same operations in the same order.

use super::sparse::substitute_back;
use halfarrow_compiler::sparse::SymbolicFactors;

/// The factors of a symmetric matrix. `U` has ones on its diagonal; what is kept is `D U`.
#[derive(Debug, Clone)]
pub(super) struct SparseDefinite {
    /// For each place left of the diagonal its mirror image right of it.
    mirror: Vec<u32>,
    /// The entries of `D U` right of the diagonal.
    upper: Vec<f64>,
    /// The inverse of `D`.
    inverse: Vec<f64>,
    /// The row that is being eliminated.
    row: Vec<f64>,
    work: Vec<f64>,
}

impl SparseDefinite {
    /// Room for a matrix that is symmetric whatever its values; `None` if it cannot be definite.
    pub fn new(symbolic: &SymbolicFactors) -> Option<SparseDefinite> {
        let line = vec![0.0; symbolic.rows.len()];
        Some(SparseDefinite {
            mirror: symbolic.mirror()?,
            upper: vec![0.0; symbolic.upper.len()],
            inverse: line.clone(),
            row: line.clone(),
            work: line,
        })
    }

    /// Factors the matrix with these entries, by place; false if a pivot has another sign than the first one, or is not
    /// above rounding of the entry that it comes from.
    pub fn factor(&mut self, symbolic: &SymbolicFactors, matrix: &[f64]) -> bool {
        let SparseDefinite { mirror, upper, inverse, row, .. } = self;
        let n = row.len();
        let mut sign = 1.0;
        for place in 0..n {
            let after = symbolic.upper.columns_of(place);
            after.iter().for_each(|&j| row[j as usize] = 0.0);
            let mut entry = 0.0;
            for e in symbolic.matrix.row(place) {
                match symbolic.matrix.columns()[e] as usize {
                    column if column == place => entry = matrix[e],
                    column if column > place => row[column] = matrix[e],
                    _ => {}
                }
            }
            if place == 0 {
                sign = 1f64.copysign(entry);
            }
            let mut pivot = entry;
            for (&k, &e) in symbolic.lower.columns_of(place).iter().zip(&mirror[symbolic.lower.row(place)]) {
                let (k, e) = (k as usize, e as usize);
                let factor = upper[e] * inverse[k];
                pivot -= factor * upper[e];
                let end = symbolic.upper.row(k).end;
                for (u, &j) in upper[e + 1..end].iter().zip(&symbolic.upper.columns()[e + 1..end]) {
                    row[j as usize] -= factor * u;
                }
            }
            if !super::full::is_definite(sign * pivot, sign * entry, n) {
                return false;
            }
            inverse[place] = 1.0 / pivot;
            upper[symbolic.upper.row(place)].iter_mut().zip(after).for_each(|(u, &j)| *u = row[j as usize]);
        }
        true
    }

    /// Replaces `b` by the solution. The matrix must have been factored.
    pub fn solve(&mut self, symbolic: &SymbolicFactors, b: &mut [f64]) {
        let SparseDefinite { upper, inverse, work, .. } = self;
        work.iter_mut().zip(&symbolic.rows).for_each(|(work, &row)| *work = b[row as usize]);
        for place in 0..work.len() {
            let done = work[place] * inverse[place];
            for (u, &j) in upper[symbolic.upper.row(place)].iter().zip(symbolic.upper.columns_of(place)) {
                work[j as usize] -= u * done;
            }
        }
        substitute_back(symbolic, (upper, inverse), work, b);
    }

    /// Whether the determinant of the factored matrix is above zero.
    pub fn is_positive(&self) -> bool {
        self.inverse.len().is_multiple_of(2) || self.inverse.first().is_some_and(|&inverse| inverse > 0.0)
    }
}
