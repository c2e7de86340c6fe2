//! Small dense linear equations without allocation. A symmetric matrix that is definite is factored as
//! `Uᵀ D U`; all others with rows scaled, threshold pivoting and one refinement.
//!
//! Machine code and exported C do the same operations in the same order.

use halfarrow_compiler::algebra::math;

/// The diagonal stays the pivot while it is at least this fraction of the best one in its column.
const THRESHOLD: f64 = 0.1;

/// A dense square matrix and, beside it, its triangular factors. All memory is taken in [`new`](Lu::new).
#[derive(Debug, Clone)]
pub(crate) struct Lu {
    size: usize,
    /// Whether the matrix is known to be symmetric whatever its values; if not, it is looked at.
    symmetric: bool,
    /// Whether the factors are those of a symmetric matrix: `U` above the diagonal, its mirror image below, the inverse of
    /// `D` in `scale`.
    definite: bool,
    /// Of such factors: where the zeros at the end of each row of `U`, and at the start of each row of its mirror image,
    /// leave off.
    ends: Vec<usize>,
    starts: Vec<usize>,
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
    pub fn new(size: usize, symmetric: bool) -> Lu {
        let square = vec![0.0; size * size];
        let line = vec![0.0; size];
        Lu {
            size,
            symmetric,
            definite: false,
            ends: vec![0; size],
            starts: vec![0; size],
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
        let symmetric = self.size > 1 && (self.symmetric || self.looks_symmetric());
        self.definite = symmetric && self.factor_definite();
        if self.definite { Ok(()) } else { self.factor_general() }
    }

    /// `Uᵀ D U`, `U` with ones on its diagonal; false if a pivot has another sign than the first one, or is not above
    /// rounding of the entry that it comes from.
    fn factor_definite(&mut self) -> bool {
        let n = self.size;
        let sign = 1f64.copysign(self.matrix[0]);
        for (k, (row, of_matrix)) in self.factors.chunks_exact_mut(n).zip(self.matrix.chunks_exact(n)).enumerate() {
            row[..k].fill(0.0);
            row[k..].copy_from_slice(&of_matrix[k..]);
            self.starts[k] = k;
        }
        for k in 0..n {
            let (upper, lower) = self.factors.split_at_mut((k + 1) * n);
            let row = &mut upper[k * n + k..];
            let pivot = row[0];
            if !is_definite(sign * pivot, sign * self.matrix[k * n + k], n) {
                return false;
            }
            let inverse = 1.0 / pivot;
            let end = row.iter().rposition(|&u| u != 0.0).unwrap_or(0);
            for (j, below) in lower.chunks_exact_mut(n).enumerate().take(end) {
                let u = row[j + 1];
                if u != 0.0 {
                    let factor = u * inverse;
                    below[k] = factor;
                    below[k + 1 + j..].iter_mut().zip(&row[j + 1..=end]).for_each(|(a, u)| *a -= factor * u);
                    self.starts[k + 1 + j] = self.starts[k + 1 + j].min(k);
                }
            }
            row[1..=end].iter_mut().for_each(|u| *u *= inverse);
            (self.scale[k], self.ends[k]) = (inverse, k + 1 + end);
        }
        true
    }

    fn looks_symmetric(&self) -> bool {
        let (n, a) = (self.size, &self.matrix);
        (0..n).all(|i| (0..i).all(|j| a[i * n + j] == a[j * n + i]))
    }

    fn factor_general(&mut self) -> Result<(), usize> {
        match self.size {
            2 => self.factor_of_size(2),
            3 => self.factor_of_size(3),
            4 => self.factor_of_size(4),
            5 => self.factor_of_size(5),
            6 => self.factor_of_size(6),
            n => self.factor_of_size(n),
        }
    }

    /// For a size that is known where this is called: loops of a few turns are then unrolled.
    #[inline(always)]
    fn factor_of_size(&mut self, n: usize) -> Result<(), usize> {
        let Lu { matrix, factors, order, scale, .. } = self;
        let (matrix, factors) = (&matrix[..n * n], &mut factors[..n * n]);
        let (order, scale) = (&mut order[..n], &mut scale[..n]);
        factors.copy_from_slice(matrix);
        for row in 0..n {
            order[row] = row;
            scale[row] = factors[row * n..][..n].iter().fold(f64::MIN_POSITIVE, |most, a| most.max(a.abs()));
        }
        for k in 0..n {
            let pivot = pivot(n, factors, scale, k).ok_or(k)?;
            if pivot != k {
                let (upper, lower) = factors.split_at_mut(pivot * n);
                upper[k * n..][..n].swap_with_slice(&mut lower[..n]);
                order.swap(k, pivot);
                scale.swap(k, pivot);
            }
            let (upper, lower) = factors.split_at_mut((k + 1) * n);
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

    /// Replaces `b` by the solution. The matrix must have been factored.
    pub fn solve(&mut self, b: &mut [f64]) {
        let n = self.size;
        if self.definite {
            return self.solve_definite(b);
        }
        if n == 1 {
            b[0] /= self.factors[0];
            return;
        }
        match n {
            2 => self.solve_of_size(2, b),
            3 => self.solve_of_size(3, b),
            4 => self.solve_of_size(4, b),
            5 => self.solve_of_size(5, b),
            6 => self.solve_of_size(6, b),
            n => self.solve_of_size(n, b),
        }
    }

    /// By general factors, for a size that is known where this is called.
    #[inline(always)]
    fn solve_of_size(&mut self, n: usize, b: &mut [f64]) {
        let Lu { matrix, factors, order, work, rest, .. } = self;
        let (matrix, factors, order) = (&matrix[..n * n], &factors[..n * n], &order[..n]);
        let (work, rest, b) = (&mut work[..n], &mut rest[..n], &mut b[..n]);
        rest.copy_from_slice(b);
        substitute(n, factors, order, work, b);
        for (row, rest) in matrix.chunks_exact(n).zip(rest.iter_mut()) {
            *rest = row.iter().zip(b.iter()).fold(*rest, |sum, (a, x)| sum - a * x);
        }
        substitute(n, factors, order, work, rest);
        // A refinement that is no small correction is none: the equations are not finite.
        b.iter_mut().zip(rest.iter()).filter(|(_, r)| r.is_finite()).for_each(|(x, r)| *x += r);
    }

    /// Replaces `b` by the solution of the equations with the matrix transposed. It must have been factored.
    pub fn solve_transposed(&mut self, b: &mut [f64]) {
        if self.definite {
            return self.solve_definite(b);
        }
        let n = self.size;
        let Lu { matrix, factors, order, work, rest, .. } = self;
        rest.copy_from_slice(b);
        substitute_transposed(n, factors, order, work, b);
        for (row, x) in matrix.chunks_exact(n).zip(&*b) {
            rest.iter_mut().zip(row).for_each(|(rest, a)| *rest -= a * x);
        }
        substitute_transposed(n, factors, order, work, rest);
        // As in `solve`.
        b.iter_mut().zip(rest.iter()).filter(|(_, r)| r.is_finite()).for_each(|(x, r)| *x += r);
    }

    fn solve_definite(&self, b: &mut [f64]) {
        let n = self.size;
        // A zero without a minus stays as it is when nothing is taken off it, so that zeros may be left out.
        b.iter_mut().for_each(|b| *b += 0.0);
        for k in 0..n {
            let (done, left) = b.split_at_mut(k + 1);
            let row = &self.factors[k * n + k + 1..k * n + self.ends[k]];
            left.iter_mut().zip(row).for_each(|(b, u)| *b -= u * done[k]);
        }
        b.iter_mut().zip(&self.scale).for_each(|(b, inverse)| *b = *b * inverse + 0.0);
        for k in (0..n).rev() {
            let (left, done) = b.split_at_mut(k);
            let row = &self.factors[k * n + self.starts[k]..k * n + k];
            left[self.starts[k]..].iter_mut().zip(row).for_each(|(b, u)| *b -= u * done[0]);
        }
    }

    /// The logarithm of the magnitude of the determinant of the factored matrix.
    pub fn log_determinant(&self) -> f64 {
        match self.definite {
            true => -self.scale.iter().map(|inverse| math::log(inverse.abs())).sum::<f64>(),
            false => (0..self.size).map(|k| math::log(self.factors[k * self.size + k].abs())).sum(),
        }
    }

    /// Whether the determinant of the factored matrix is above zero.
    pub fn is_positive(&self) -> bool {
        let n = self.size;
        if self.definite {
            return n.is_multiple_of(2) || self.scale[0] > 0.0;
        }
        let minuses = (0..n).filter(|&k| self.factors[k * n + k] < 0.0).count();
        let exchanges: usize =
            (0..n).map(|k| self.order[k + 1..].iter().filter(|&&later| later < self.order[k]).count()).sum();
        (minuses + exchanges).is_multiple_of(2)
    }
}

#[inline(always)]
fn substitute(n: usize, factors: &[f64], order: &[usize], work: &mut [f64], b: &mut [f64]) {
    for row in 0..n {
        let own = &factors[row * n..row * n + row];
        work[row] = less_products(b[order[row]], own, &work[..row]);
    }
    for row in (0..n).rev() {
        let own = &factors[row * n..(row + 1) * n];
        b[row] = less_products(work[row], &own[row + 1..], &b[row + 1..]) / own[row];
    }
}

fn substitute_transposed(n: usize, factors: &[f64], order: &[usize], work: &mut [f64], b: &mut [f64]) {
    work.copy_from_slice(b);
    for k in 0..n {
        let (upper, left) = (&factors[k * n + k..(k + 1) * n], &mut work[k..]);
        left[0] /= upper[0];
        let (solved, left) = left.split_at_mut(1);
        left.iter_mut().zip(&upper[1..]).for_each(|(left, u)| *left -= u * solved[0]);
    }
    for k in (0..n).rev() {
        let (left, solved) = work.split_at_mut(k);
        left.iter_mut().zip(&factors[k * n..]).for_each(|(left, l)| *left -= l * solved[0]);
        b[order[k]] = work[k];
    }
}

/// The row to bring to place `k`: the diagonal one if it is good enough. `None` if all are 0 to rounding.
#[inline(always)]
fn pivot(n: usize, factors: &[f64], scale: &[f64], k: usize) -> Option<usize> {
    let weight = |row: usize| factors[row * n + k].abs() / scale[row];
    let own = weight(k);
    let (mut best, mut greatest) = (k, own);
    for row in k + 1..n {
        let weight = weight(row);
        if weight > greatest || weight.is_nan() {
            (best, greatest) = (row, weight);
        }
    }
    if own >= THRESHOLD * greatest {
        (best, greatest) = (k, own);
    }
    (greatest > f64::EPSILON * n as f64 && greatest.is_finite()).then_some(best)
}

/// Whether a pivot of a positive symmetric matrix is above rounding of the diagonal entry that it comes from.
pub(super) fn is_definite(pivot: f64, entry: f64, size: usize) -> bool {
    pivot > 0.0 && pivot > f64::EPSILON * size as f64 * entry && pivot < f64::INFINITY
}

/// `start - a·b`: the sum of groups of four products, each of the four places apart, then the products that are left.
#[inline(always)]
fn less_products(start: f64, a: &[f64], b: &[f64]) -> f64 {
    let (groups_a, rest_a) = a.as_chunks::<4>();
    let (groups_b, rest_b) = b.as_chunks::<4>();
    let mut result = start;
    if !groups_a.is_empty() {
        let mut sums = [0.0; 4];
        for (a, b) in groups_a.iter().zip(groups_b) {
            (0..4).for_each(|i| sums[i] += a[i] * b[i]);
        }
        result -= (sums[0] + sums[1]) + (sums[2] + sums[3]);
    }
    rest_a.iter().zip(rest_b).for_each(|(a, b)| result -= a * b);
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solve(rows: &[&[f64]], b: &[f64]) -> Result<Vec<f64>, usize> {
        solve_as(rows, b, false)
    }

    fn solve_as(rows: &[&[f64]], b: &[f64], symmetric: bool) -> Result<Vec<f64>, usize> {
        let mut lu = Lu::new(b.len(), symmetric);
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
    fn symmetric_matrices_have_the_same_solutions() {
        let mut seed = 1.0f64;
        let mut next = || {
            seed = (seed * 16807.0) % 2147483647.0;
            seed / 2147483647.0 - 0.5
        };
        for n in 2..12 {
            for definite in [true, false] {
                let half: Vec<Vec<f64>> = (0..n).map(|_| (0..n).map(|_| next()).collect()).collect();
                let entry = |i: usize, j: usize| match definite {
                    true => (0..n).map(|k| half[i][k] * half[j][k]).sum::<f64>() + f64::from(u8::from(i == j)),
                    false => half[i.min(j)][i.max(j)],
                };
                let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
                let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
                let b: Vec<f64> = (0..n).map(|_| next()).collect();
                // Rows exchanged are the same equations, and no longer symmetric.
                let (mut turned, mut b_turned) = (rows.clone(), b.clone());
                turned.rotate_left(1);
                b_turned.rotate_left(1);
                let (here, there) = (solve_as(&rows, &b, true).unwrap(), solve(&turned, &b_turned).unwrap());
                assert_eq!(here, solve(&rows, &b).unwrap(), "symmetric matrices are seen to be so");
                let most = there.iter().fold(0.0f64, |most, x| most.max(x.abs()));
                let off = here.iter().zip(&there).fold(0.0f64, |off, (a, b)| off.max((a - b).abs()));
                assert!(off <= 1e-13 * most * if definite { 1.0 } else { 1e3 }, "{n} {definite}: {off}");
            }
        }
        assert_eq!(solve_as(&[&[-2.0, 1.0], &[1.0, -2.0]], &[-3.0, 3.0], true), Ok(vec![1.0, -1.0]));
        assert_eq!(solve_as(&[&[1.0, 2.0], &[2.0, 4.0]], &[1.0, 1.0], true), Err(1));
        assert_eq!(solve_as(&[&[0.0, 1.0], &[1.0, 0.0]], &[2.0, 3.0], true), Ok(vec![3.0, 2.0]));
        assert_eq!(solve_as(&[&[f64::NAN, 0.0], &[0.0, 1.0]], &[1.0, 1.0], true), Err(0));
    }

    #[test]
    fn transposed_equations_have_their_own_solutions() {
        let mut seed = 7.0f64;
        let mut next = || {
            seed = (seed * 16807.0) % 2147483647.0;
            seed / 2147483647.0 - 0.5
        };
        for n in 1..9 {
            for symmetric in [false, true] {
                let half: Vec<Vec<f64>> = (0..n).map(|_| (0..n).map(|_| next()).collect()).collect();
                let entry = |i: usize, j: usize| match symmetric {
                    true => (0..n).map(|k| half[i][k] * half[j][k]).sum::<f64>() + f64::from(u8::from(i == j)),
                    false => half[i][j],
                };
                let b: Vec<f64> = (0..n).map(|_| next()).collect();
                let of = |turned: bool| {
                    let mut lu = Lu::new(n, symmetric);
                    (0..n * n).for_each(|k| {
                        lu.matrix()[k] = if turned { entry(k % n, k / n) } else { entry(k / n, k % n) };
                    });
                    lu.factor().unwrap();
                    lu
                };
                let (mut here, mut there) = (b.clone(), b.clone());
                of(false).solve_transposed(&mut here);
                of(true).solve(&mut there);
                let most = there.iter().fold(0.0f64, |most, x| most.max(x.abs()));
                for (x, y) in here.iter().zip(&there) {
                    assert!((x - y).abs() <= 1e-12 * most, "{n} {symmetric}: {x} {y}");
                }
            }
        }
    }

    #[test]
    fn knows_the_sign_of_the_determinant() {
        let sign = |rows: &[&[f64]]| {
            let mut lu = Lu::new(rows.len(), false);
            lu.matrix().copy_from_slice(&rows.concat());
            lu.factor().unwrap();
            lu.is_positive()
        };
        assert!(sign(&[&[2.0]]) && !sign(&[&[-2.0]]));
        assert!(sign(&[&[-2.0, 1.0], &[1.0, -2.0]]));
        assert!(!sign(&[&[-2.0, 1.0, 0.0], &[1.0, -2.0, 1.0], &[0.0, 1.0, -2.0]]));
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
