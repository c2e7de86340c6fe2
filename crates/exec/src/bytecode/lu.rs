//! Small dense linear equations without allocation: rows scaled, threshold pivoting, one refinement.

/// The diagonal stays the pivot while it is at least this fraction of the best one in its column.
const THRESHOLD: f64 = 0.1;

/// A dense square matrix and, beside it, its triangular factors. All memory is taken in [`new`](Lu::new).
#[derive(Debug, Clone)]
pub(crate) struct Lu {
    size: usize,
    /// The matrix, row by row.
    matrix: Vec<f64>,
    factors: Vec<f64>,
    /// The row that stands in each place.
    order: Vec<usize>,
    scale: Vec<f64>,
    work: Vec<f64>,
    rest: Vec<f64>,
}

impl Lu {
    pub fn new(size: usize) -> Lu {
        let square = vec![0.0; size * size];
        let line = vec![0.0; size];
        Lu {
            size,
            matrix: square.clone(),
            factors: square,
            order: vec![0; size],
            scale: line.clone(),
            work: line.clone(),
            rest: line,
        }
    }

    /// The matrix, row by row, to be filled before [`factor`](Lu::factor).
    pub fn matrix(&mut self) -> &mut [f64] {
        &mut self.matrix
    }

    /// Factors the matrix; `Err(column)` if no pivot is left for it, or if an entry is not finite.
    pub fn factor(&mut self) -> Result<(), usize> {
        let n = self.size;
        self.factors.copy_from_slice(&self.matrix);
        for row in 0..n {
            self.order[row] = row;
            self.scale[row] = self.factors[row * n..][..n].iter().fold(f64::MIN_POSITIVE, |most, a| most.max(a.abs()));
        }
        for k in 0..n {
            let pivot = self.pivot(k).ok_or(k)?;
            self.swap(k, pivot);
            let (upper, lower) = self.factors.split_at_mut((k + 1) * n);
            let pivot_row = &upper[k * n..];
            for row in lower.chunks_exact_mut(n) {
                if row[k] != 0.0 {
                    let factor = row[k] / pivot_row[k];
                    row[k] = factor;
                    row[k + 1..].iter_mut().zip(&pivot_row[k + 1..]).for_each(|(a, p)| *a -= factor * p);
                }
            }
        }
        Ok(())
    }

    /// Replaces `b` by the solution, refined once. The matrix must have been factored.
    pub fn solve(&mut self, b: &mut [f64]) {
        let n = self.size;
        if n == 1 {
            b[0] /= self.factors[0];
            return;
        }
        let mut rest = std::mem::take(&mut self.rest);
        rest.copy_from_slice(b);
        self.substitute(b);
        for (row, rest) in self.matrix.chunks_exact(n).zip(rest.iter_mut()) {
            *rest = row.iter().zip(b.iter()).fold(*rest, |sum, (a, x)| sum - a * x);
        }
        self.substitute(&mut rest);
        // A refinement that is no small correction is none: the equations are not finite.
        b.iter_mut().zip(&rest).filter(|(_, r)| r.is_finite()).for_each(|(x, r)| *x += r);
        self.rest = rest;
    }

    /// Whether the determinant of the factored matrix is above zero.
    pub fn is_positive(&self) -> bool {
        let n = self.size;
        let minuses = (0..n).filter(|&k| self.factors[k * n + k] < 0.0).count();
        let exchanges: usize =
            (0..n).map(|k| self.order[k + 1..].iter().filter(|&&later| later < self.order[k]).count()).sum();
        (minuses + exchanges).is_multiple_of(2)
    }

    fn substitute(&mut self, b: &mut [f64]) {
        let n = self.size;
        for row in 0..n {
            let factors = &self.factors[row * n..row * n + row];
            let sum: f64 = factors.iter().zip(&self.work).map(|(f, w)| f * w).sum();
            self.work[row] = b[self.order[row]] - sum;
        }
        for row in (0..n).rev() {
            let factors = &self.factors[row * n..(row + 1) * n];
            let sum: f64 = factors[row + 1..].iter().zip(&b[row + 1..]).map(|(f, x)| f * x).sum();
            b[row] = (self.work[row] - sum) / factors[row];
        }
    }

    /// The row to bring to place `k`: the diagonal one if it is good enough. `None` if all are 0 to rounding.
    fn pivot(&self, k: usize) -> Option<usize> {
        let weight = |row: usize| self.factors[row * self.size + k].abs() / self.scale[row];
        let mut best = k;
        for row in k + 1..self.size {
            if weight(row) > weight(best) || weight(row).is_nan() {
                best = row;
            }
        }
        let best = if weight(k) >= THRESHOLD * weight(best) { k } else { best };
        (weight(best) > f64::EPSILON * self.size as f64 && weight(best).is_finite()).then_some(best)
    }

    fn swap(&mut self, a: usize, b: usize) {
        if a != b {
            let n = self.size;
            let (upper, lower) = self.factors.split_at_mut(b * n);
            upper[a * n..][..n].swap_with_slice(&mut lower[..n]);
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
        lu.matrix().copy_from_slice(&rows.concat());
        lu.factor()?;
        let mut x = b.to_vec();
        lu.solve(&mut x);
        Ok(x)
    }

    #[test]
    fn conductances_nine_decades_apart_keep_their_digits() {
        // Three resistors between two nodes, one of them a diode's slope.
        let (small, large) = (1e-9, 1.0);
        let rows: &[&[f64]] = &[&[small + large, -large], &[-large, large + small]];
        let x = solve(rows, &[small, 0.0]).unwrap();
        let exact = [(small + large) / (small + 2.0 * large), large / (small + 2.0 * large)];
        for (x, exact) in x.iter().zip(exact) {
            assert!((x - exact).abs() < 1e-7 * exact, "{x} {exact}");
        }
    }

    #[test]
    fn pivots_past_zeros_and_badly_scaled_rows() {
        assert_eq!(solve(&[&[0.0, 2.0], &[4.0, 1.0]], &[2.0, 5.0]), Ok(vec![1.0, 1.0]));
        let x = solve(&[&[1e-20, 1e5], &[1.0, 1.0]], &[1e5, 2.0]).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] - 1.0).abs() < 1e-15, "{x:?}");
    }

    #[test]
    fn knows_the_sign_of_the_determinant() {
        let sign = |rows: &[&[f64]]| {
            let mut lu = Lu::new(rows.len());
            lu.matrix().copy_from_slice(&rows.concat());
            lu.factor().unwrap();
            lu.is_positive()
        };
        assert!(sign(&[&[2.0]]) && !sign(&[&[-2.0]]));
        assert!(!sign(&[&[0.0, 1.0], &[1.0, 0.0]]) && sign(&[&[0.0, 1.0], &[-1.0, 0.0]]));
        assert!(sign(&[&[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0], &[1.0, 0.0, 0.0]]));
    }

    #[test]
    fn says_where_no_pivot_is_left() {
        assert_eq!(solve(&[&[1.0, 2.0], &[2.0, 4.0]], &[1.0, 1.0]), Err(1));
        assert_eq!(solve(&[&[1.0, 0.0], &[0.0, 0.0]], &[1.0, 1.0]), Err(1));
        assert_eq!(solve(&[&[f64::NAN]], &[1.0]), Err(0));
        assert_eq!(solve(&[&[1.0, 1.0], &[f64::INFINITY, 1.0]], &[1.0, 1.0]), Err(0));
    }
}
