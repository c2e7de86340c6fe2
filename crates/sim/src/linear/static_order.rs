//! Triangular factors in an order that is fixed before any value is known: each factorisation takes the same operations,
//! and no memory.

use super::Number;
use crate::Sparsity;
use halfarrow_sparse::{Pattern, SymbolicFactors};

/// The factors of a sparse matrix, row by row, with the pivots on the diagonal of the order.
pub(super) struct StaticLu<T> {
    symbolic: SymbolicFactors,
    /// For each entry of the matrix, in the order of elimination, its place in the pattern.
    from: Vec<u32>,
    lower: Vec<T>,
    upper: Vec<T>,
    /// Reciprocals of the pivots.
    inverse: Vec<T>,
    /// The row that is being eliminated.
    row: Vec<T>,
}

impl<T: Number> StaticLu<T> {
    /// `None` if matrices of this pattern are singular whatever their entries are.
    pub(super) fn new(pattern: &Sparsity) -> Option<StaticLu<T>> {
        let (rows, places) = by_rows(pattern);
        let symbolic = SymbolicFactors::new(&rows)?;
        let mut from = vec![0; places.len()];
        places.iter().zip(&symbolic.positions).for_each(|(&place, &position)| from[position as usize] = place);
        Some(StaticLu {
            from,
            lower: vec![T::default(); symbolic.lower.len()],
            upper: vec![T::default(); symbolic.upper.len()],
            inverse: vec![T::default(); pattern.states()],
            row: vec![T::default(); pattern.states()],
            symbolic,
        })
    }

    /// Entries of the factors beside the diagonal.
    pub(super) fn entries(&self) -> usize {
        self.lower.len() + self.upper.len()
    }

    /// Additions and products to factor a matrix and to solve with the factors once.
    pub(super) fn operations(&self) -> u64 {
        self.symbolic.operations()
    }

    /// Factors the matrix with these entries, in the order of the pattern. `false` if a pivot is none.
    pub(super) fn factor(&mut self, values: &[T]) -> bool {
        (0..self.row.len()).all(|place| self.eliminate(place, values))
    }

    fn eliminate(&mut self, place: usize, values: &[T]) -> bool {
        let StaticLu { symbolic, from, lower, upper, inverse, row } = self;
        let (before, after) = (symbolic.lower.columns_of(place), symbolic.upper.columns_of(place));
        before.iter().chain(after).for_each(|&column| row[column as usize] = T::default());
        row[place] = T::default();
        for entry in symbolic.matrix.row(place) {
            row[symbolic.matrix.columns()[entry] as usize] = values[from[entry] as usize];
        }
        for (own, &k) in lower[symbolic.lower.row(place)].iter_mut().zip(before) {
            let factor = row[k as usize] * inverse[k as usize];
            *own = factor;
            let line = symbolic.upper.row(k as usize);
            for (u, &j) in upper[line.clone()].iter().zip(&symbolic.upper.columns()[line]) {
                row[j as usize] -= factor * *u;
            }
        }
        let pivot = row[place];
        inverse[place] = pivot.reciprocal();
        upper[symbolic.upper.row(place)].iter_mut().zip(after).for_each(|(own, &j)| *own = row[j as usize]);
        let size = pivot.magnitude();
        size > 0.0 && size.is_finite()
    }

    /// Replaces `b` by the solution.
    pub(super) fn solve(&mut self, b: &mut [T]) {
        let StaticLu { symbolic, lower, upper, inverse, row, .. } = self;
        for (place, &from) in symbolic.rows.iter().enumerate() {
            let line = symbolic.lower.row(place);
            let factors = lower[line.clone()].iter().zip(&symbolic.lower.columns()[line]);
            row[place] = factors.fold(b[from as usize], |left, (l, &k)| left - *l * row[k as usize]);
        }
        for (place, &to) in symbolic.columns.iter().enumerate().rev() {
            let line = symbolic.upper.row(place);
            let factors = upper[line.clone()].iter().zip(&symbolic.upper.columns()[line]);
            let left = factors.fold(row[place], |left, (u, &j)| left - *u * row[j as usize]);
            row[place] = left * inverse[place];
            b[to as usize] = row[place];
        }
    }
}

/// The pattern by rows, and for each of its entries the place in the pattern by columns.
fn by_rows(pattern: &Sparsity) -> (Pattern, Vec<u32>) {
    let mut rows: Vec<Vec<(usize, u32)>> = vec![Vec::new(); pattern.states()];
    for (place, (row, column)) in pattern.entries().enumerate() {
        rows[row].push((column, place as u32));
    }
    let places = rows.iter().flatten().map(|entry| entry.1).collect();
    (Pattern::new(rows.iter().map(|row| row.iter().map(|entry| entry.0))), places)
}
