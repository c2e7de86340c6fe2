//! Large sparse matrices for which the fixed order does not do: rows are exchanged, which takes memory when it comes to
//! that first.

use halfarrow_compiler::sparse::SymbolicFactors;
use halfarrow_sim::{SparseLu, Sparsity};

/// By how much a solution that is known may be missed: beyond it the matrix is singular but for rounding.
const MISSED: f64 = 1e-3;

/// A matrix, and its transpose where that is asked for, factored with exchanges of rows.
pub(super) struct Exchanged {
    /// For each entry of the matrix by its place in the fixed order: row and column, and its number in the pattern.
    entries: Vec<(usize, usize, usize)>,
    lu: SparseLu<f64>,
    /// That of the transpose, with the same numbers.
    turned: Option<SparseLu<f64>>,
    right: Vec<f64>,
    /// What a solution leaves of the equations.
    rest: Vec<f64>,
}

impl std::fmt::Debug for Exchanged {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Exchanged").field("entries", &self.entries.len()).finish_non_exhaustive()
    }
}

impl Clone for Exchanged {
    fn clone(&self) -> Exchanged {
        let values: Vec<f64> = self.values();
        let mut other = Exchanged::of(self.entries.clone(), self.right.len());
        other.factor(&values);
        other
    }
}

impl Exchanged {
    /// For matrices of this order.
    pub fn new(symbolic: &SymbolicFactors) -> Exchanged {
        let place = |(row, column): (usize, usize)| (symbolic.rows[row] as usize, symbolic.columns[column] as usize, 0);
        Exchanged::of(symbolic.matrix.places().map(place).collect(), symbolic.rows.len())
    }

    fn of(mut entries: Vec<(usize, usize, usize)>, size: usize) -> Exchanged {
        let mut columns = vec![Vec::new(); size];
        entries.iter().for_each(|&(row, column, _)| columns[column].push(row));
        columns.iter_mut().for_each(|rows| rows.sort_unstable());
        let pattern = Sparsity::from_columns(columns);
        entries.iter_mut().for_each(|entry| entry.2 = pattern.place(entry.0, entry.1));
        Exchanged { entries, lu: SparseLu::new(&pattern), turned: None, right: vec![0.0; size], rest: vec![0.0; size] }
    }

    /// The entries by place.
    fn values(&self) -> Vec<f64> {
        let mut values = vec![0.0; self.entries.len()];
        let stored = self.lu.stored();
        values.iter_mut().zip(&self.entries).for_each(|(value, entry)| *value = stored[entry.2]);
        values
    }

    /// Factors the matrix of these entries, by place; false if it is singular.
    pub fn factor(&mut self, matrix: &[f64]) -> bool {
        self.turned = None;
        let values = self.lu.values();
        matrix.iter().zip(&self.entries).for_each(|(&value, entry)| values[entry.2] = value);
        if !matrix.iter().all(|value| value.is_finite()) || !self.lu.factor() {
            return false;
        }
        // A solution of ones, which a singular matrix does not give back.
        self.right.fill(0.0);
        matrix.iter().zip(&self.entries).for_each(|(value, entry)| self.right[entry.0] += value);
        self.lu.solve(&mut self.right);
        self.right.iter().all(|x| (x - 1.0).abs() <= MISSED)
    }

    /// Replaces `b` by the solution, refined once.
    pub fn solve(&mut self, b: &mut [f64]) {
        self.rest.copy_from_slice(b);
        self.lu.solve(b);
        let stored = self.lu.stored();
        self.entries.iter().for_each(|&(row, column, number)| self.rest[row] -= stored[number] * b[column]);
        self.lu.solve(&mut self.rest);
        b.iter_mut().zip(&self.rest).filter(|(_, r)| r.is_finite()).for_each(|(x, r)| *x += r);
    }

    /// Replaces `b` by the solution of the equations with the matrix transposed.
    pub fn solve_transposed(&mut self, b: &mut [f64]) {
        if self.turned.is_none() {
            let pattern = self.lu.pattern().transposed();
            let mut turned = SparseLu::new(&pattern);
            let stored = self.lu.stored();
            for &(row, column, number) in &self.entries {
                turned.values()[pattern.place(column, row)] = stored[number];
            }
            turned.factor();
            self.turned = Some(turned);
        }
        if let Some(turned) = &mut self.turned {
            turned.solve(b);
        }
    }
}
