//! Small dense linear equations with complex numbers, without allocation.

use super::pivot_row;
use faer::c64;

/// A dense square matrix, whose rows should be of like size, and its triangular factors in the same place; all memory is
/// taken in [`new`](ComplexLu::new).
pub(crate) struct ComplexLu {
    size: usize,
    /// Row by row; the factors hold the reciprocals of the pivots.
    entries: Vec<c64>,
    /// The row that stands in each place.
    order: Vec<usize>,
    work: Vec<c64>,
}

impl ComplexLu {
    pub(crate) fn new(size: usize) -> ComplexLu {
        let zero = c64::new(0.0, 0.0);
        ComplexLu { size, entries: vec![zero; size * size], order: vec![0; size], work: vec![zero; size] }
    }

    /// Makes all entries 0.
    pub(crate) fn clear(&mut self) {
        self.entries.fill(c64::new(0.0, 0.0));
    }

    pub(crate) fn set(&mut self, row: usize, column: usize, value: c64) {
        self.entries[row * self.size + column] = value;
    }

    /// Factors in place; `Err(column)` if no pivot is left for it.
    pub(crate) fn factor(&mut self) -> Result<(), usize> {
        let n = self.size;
        (0..n).for_each(|row| self.order[row] = row);
        for k in 0..n {
            self.swap(k, self.pivot(k).ok_or(k)?);
            let (above, below) = self.entries.split_at_mut((k + 1) * n);
            let pivots = &mut above[k * n..];
            pivots[k] = pivots[k].inv();
            for row in below.chunks_exact_mut(n) {
                let factor = row[k] * pivots[k];
                row[k] = factor;
                if factor != c64::new(0.0, 0.0) {
                    row[k + 1..].iter_mut().zip(&pivots[k + 1..]).for_each(|(a, pivot)| *a -= factor * pivot);
                }
            }
        }
        Ok(())
    }

    /// Replaces `re + i im` by the solution. The matrix must have been factored.
    pub(crate) fn solve(&mut self, re: &mut [f64], im: &mut [f64]) {
        let n = self.size;
        for row in 0..n {
            let from = self.order[row];
            let (done, rest) = self.work.split_at_mut(row);
            rest[0] = c64::new(re[from], im[from]) - dot(&self.entries[row * n..][..row], done);
        }
        for row in (0..n).rev() {
            let (work, done) = self.work.split_at_mut(row + 1);
            let entries = &self.entries[row * n..][..n];
            work[row] = (work[row] - dot(&entries[row + 1..], done)) * entries[row];
            (re[row], im[row]) = (work[row].re, work[row].im);
        }
    }

    /// The row to bring to place `k`: the diagonal one if it is good enough. `None` if all are 0 to rounding.
    fn pivot(&self, k: usize) -> Option<usize> {
        let weight = |row: usize| self.entries[row * self.size + k].l1_norm();
        pivot_row(k..self.size, weight)
    }

    fn swap(&mut self, a: usize, b: usize) {
        if a != b {
            (0..self.size).for_each(|j| self.entries.swap(a * self.size + j, b * self.size + j));
            self.order.swap(a, b);
        }
    }
}

fn dot(a: &[c64], b: &[c64]) -> c64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_with_pivots_past_zeros() {
        let rows = [[c64::new(0.0, 0.0), c64::new(0.0, 2.0)], [c64::new(1.0, 1.0), c64::new(1.0, 0.0)]];
        let mut lu = ComplexLu::new(2);
        rows.iter().enumerate().for_each(|(i, row)| row.iter().enumerate().for_each(|(j, &a)| lu.set(i, j, a)));
        lu.factor().unwrap();
        // The solution (2, i): -2 and 2 + 3i.
        let (mut re, mut im) = ([-2.0, 2.0], [0.0, 3.0]);
        lu.solve(&mut re, &mut im);
        assert!((re[0] - 2.0).abs() + im[0].abs() + re[1].abs() + (im[1] - 1.0).abs() < 1e-15, "{re:?} {im:?}");
    }

    #[test]
    fn says_where_no_pivot_is_left() {
        let mut lu = ComplexLu::new(2);
        lu.set(0, 0, c64::new(1.0, 1.0));
        assert_eq!(lu.factor(), Err(1));
    }
}
