//! Rank of sparse matrices of numbers, for components and systems too large for expressions.

use std::collections::{BTreeMap, BTreeSet};

use crate::algebra::{Expr, Exprs, Symbol};

/// Entries below this, in rows scaled to 1, count as zero.
const TINY: f64 = 1e-10;

/// A row: column and entry.
pub(crate) type Row = BTreeMap<usize, f64>;

/// Rank by elimination with threshold pivoting that keeps the rows short.
pub(crate) fn rank(rows: Vec<Row>) -> usize {
    let mut matrix = Matrix::new(rows);
    let mut rank = 0;
    while let Some((row, column)) = matrix.pivot() {
        matrix.eliminate(row, column);
        rank += 1;
    }
    rank
}

struct Matrix {
    rows: Vec<Row>,
    /// Rows not yet used, by length.
    queue: BTreeSet<(usize, usize)>,
    /// Unused rows with an entry in each column.
    columns: BTreeMap<usize, BTreeSet<usize>>,
}

impl Matrix {
    fn new(mut rows: Vec<Row>) -> Matrix {
        let mut columns: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
        for (number, row) in rows.iter_mut().enumerate() {
            let largest = row.values().fold(0.0f64, |largest, entry| largest.max(entry.abs()));
            row.values_mut().for_each(|entry| *entry /= largest);
            row.retain(|_, entry| entry.abs() > TINY);
            for &column in row.keys() {
                columns.entry(column).or_default().insert(number);
            }
        }
        let queue = rows.iter().enumerate().map(|(number, row)| (row.len(), number)).collect();
        Matrix { rows, queue, columns }
    }

    /// The shortest row left, and in it the entry of the shortest column among those that are large enough.
    fn pivot(&mut self) -> Option<(usize, usize)> {
        while let Some((length, row)) = self.queue.pop_first() {
            let entries = &self.rows[row];
            for column in entries.keys() {
                self.columns.get_mut(column).expect("known column").remove(&row);
            }
            if length == 0 {
                continue;
            }
            let largest = entries.values().fold(0.0f64, |largest, entry| largest.max(entry.abs()));
            let fit = entries.iter().filter(|(_, entry)| entry.abs() >= 0.1 * largest);
            return fit
                .map(|(&column, _)| (self.columns[&column].len(), column))
                .min()
                .map(|(_, column)| (row, column));
        }
        None
    }

    fn eliminate(&mut self, pivot_row: usize, column: usize) {
        let pivot = std::mem::take(&mut self.rows[pivot_row]);
        for row in std::mem::take(self.columns.get_mut(&column).expect("known column")) {
            self.queue.remove(&(self.rows[row].len(), row));
            let factor = self.rows[row][&column] / pivot[&column];
            for (&other, entry) in &pivot {
                self.subtract(row, other, factor * entry, other == column);
            }
            self.queue.insert((self.rows[row].len(), row));
        }
    }

    fn subtract(&mut self, row: usize, column: usize, amount: f64, vanishes: bool) {
        let entry = self.rows[row].entry(column).or_insert(0.0);
        let scale = entry.abs().max(amount.abs());
        *entry -= amount;
        if vanishes || entry.abs() <= TINY * scale {
            self.rows[row].remove(&column);
            self.columns.entry(column).or_default().remove(&row);
        } else {
            self.columns.entry(column).or_default().insert(row);
        }
    }
}

/// The value of an expression at the given parameters; what varies gets an arbitrary value near 1, always the same.
pub(crate) fn sample(exprs: &Exprs, e: Expr) -> f64 {
    let mut value = |symbol: Symbol| {
        let given = exprs.facts(symbol).given.and_then(|given| exprs.given_value(given));
        given.unwrap_or_else(|| arbitrary(symbol))
    };
    exprs.eval(e, &mut value)
}

/// A number between 0.5 and 1.5 for each symbol.
pub(crate) fn arbitrary(symbol: Symbol) -> f64 {
    let mixed = (u64::from(symbol.0) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    0.5 + (mixed >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(entries: &[f64]) -> Row {
        entries.iter().enumerate().filter(|(_, entry)| **entry != 0.0).map(|(i, entry)| (i, *entry)).collect()
    }

    #[test]
    fn ranks_of_small_matrices() {
        assert_eq!(rank(vec![row(&[1.0, 2.0]), row(&[2.0, 4.0])]), 1);
        assert_eq!(rank(vec![row(&[0.0, 2.0]), row(&[3.0, 0.0])]), 2);
        assert_eq!(rank(vec![row(&[0.0, 0.0]), row(&[1e-9, 1e9])]), 1);
        let thirds = [row(&[1.0, 1.0, 1.0]), row(&[1.0 / 3.0, -2.0, 0.1]), row(&[4.0 / 3.0, -1.0, 1.1])];
        assert_eq!(rank(thirds.to_vec()), 2);
    }

    #[test]
    fn a_long_chain_stays_sparse() {
        let n = 20_000;
        let chain = |i: usize| {
            let near = [(i.wrapping_sub(1), -1.0), (i, 2.0), (i + 1, -1.0)];
            near.into_iter().filter(|(j, _)| *j < n).collect()
        };
        assert_eq!(rank((0..n).map(chain).collect()), n);
    }
}
