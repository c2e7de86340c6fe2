//! Small dense linear equations without allocation.

use super::pivot_row;

/// A dense square matrix and its triangular factors in the same place; all memory is taken in [`new`](Lu::new).
/// Rows are scaled by their greatest entry for the choice of the pivot.
pub(crate) struct Lu {
    size: usize,
    /// Row by row.
    entries: Vec<f64>,
    /// The row that stands in each place.
    order: Vec<usize>,
    scale: Vec<f64>,
    work: Vec<f64>,
}

impl Lu {
    pub(crate) fn new(size: usize) -> Lu {
        Lu {
            size,
            entries: vec![0.0; size * size],
            order: vec![0; size],
            scale: vec![0.0; size],
            work: vec![0.0; size],
        }
    }

    /// Makes it the unit matrix.
    pub(crate) fn set_unit(&mut self) {
        self.entries.fill(0.0);
        (0..self.size).for_each(|i| self.entries[i * self.size + i] = 1.0);
    }

    /// Makes all entries 0.
    pub(crate) fn clear(&mut self) {
        self.entries.fill(0.0);
    }

    /// Adds to one entry.
    pub(crate) fn add(&mut self, row: usize, column: usize, value: f64) {
        self.entries[row * self.size + column] += value;
    }

    /// Factors in place; `Err(column)` if no pivot is left for it.
    pub(crate) fn factor(&mut self) -> Result<(), usize> {
        let n = self.size;
        for row in 0..n {
            self.order[row] = row;
            self.scale[row] = self.entries[row * n..][..n].iter().fold(f64::MIN_POSITIVE, |most, a| most.max(a.abs()));
        }
        for k in 0..n {
            self.swap(k, self.pivot(k).ok_or(k)?);
            for row in k + 1..n {
                let factor = self.entries[row * n + k] / self.entries[k * n + k];
                self.entries[row * n + k] = factor;
                if factor != 0.0 {
                    (k + 1..n).for_each(|j| self.entries[row * n + j] -= factor * self.entries[k * n + j]);
                }
            }
        }
        Ok(())
    }

    /// Replaces `b` by the solution. The matrix must have been factored.
    pub(crate) fn solve(&mut self, b: &mut [f64]) {
        let n = self.size;
        for row in 0..n {
            let sum: f64 = (0..row).map(|j| self.entries[row * n + j] * self.work[j]).sum();
            self.work[row] = b[self.order[row]] - sum;
        }
        for row in (0..n).rev() {
            let sum: f64 = (row + 1..n).map(|j| self.entries[row * n + j] * b[j]).sum();
            b[row] = (self.work[row] - sum) / self.entries[row * n + row];
        }
    }

    /// The row to bring to place `k`: the diagonal one if it is good enough. `None` if all are 0 to rounding.
    fn pivot(&self, k: usize) -> Option<usize> {
        let weight = |row: usize| self.entries[row * self.size + k].abs() / self.scale[row];
        pivot_row(k..self.size, weight)
    }

    fn swap(&mut self, a: usize, b: usize) {
        if a != b {
            (0..self.size).for_each(|j| self.entries.swap(a * self.size + j, b * self.size + j));
            self.order.swap(a, b);
            self.scale.swap(a, b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solve(rows: &[&[f64]], b: &[f64]) -> Result<Vec<f64>, usize> {
        let mut lu = Lu::new(b.len());
        for (i, row) in rows.iter().enumerate() {
            row.iter().enumerate().for_each(|(j, &a)| lu.add(i, j, a));
        }
        lu.factor()?;
        let mut x = b.to_vec();
        lu.solve(&mut x);
        Ok(x)
    }

    #[test]
    fn pivots_past_zeros_and_scales() {
        assert_eq!(solve(&[&[0.0, 2.0], &[4.0, 1.0]], &[2.0, 5.0]), Ok(vec![1.0, 1.0]));
        let x = solve(&[&[1e-20, 1e5], &[1.0, 1.0]], &[1e5, 2.0]).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] - 1.0).abs() < 1e-15, "{x:?}");
    }

    #[test]
    fn says_where_no_pivot_is_left() {
        assert_eq!(solve(&[&[1.0, 2.0], &[2.0, 4.0]], &[1.0, 1.0]), Err(1));
        assert_eq!(solve(&[&[1.0, 0.0], &[0.0, 0.0]], &[1.0, 1.0]), Err(1));
        assert_eq!(solve(&[&[f64::NAN]], &[1.0]), Err(0));
    }
}
