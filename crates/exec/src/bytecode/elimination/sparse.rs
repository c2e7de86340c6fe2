//! Sparse linear equations in an order that is fixed: row by row, with the pivots on the diagonal of that order and one
//! refinement. Where a pivot is too small beside what stands below it, the matrix is factored as a full one, a large one with
//! exchanges of rows. One that is symmetric whatever its values is first taken as definite, see
//! [`definite`](super::definite).
//!
//! Exported C does the same operations in the same order.

use super::definite::SparseDefinite;
use super::exchanged::Exchanged;
use super::full::Lu;
use halfarrow_compiler::algebra::math;
use halfarrow_compiler::sparse::SymbolicFactors;
use std::sync::Arc;

/// A pivot does if it is at least this fraction of the best one in its column, rows scaled: less than for a full matrix,
/// as the solution is refined (the bound of KLU: Davis and Palamadai Natarajan, ACM Transactions on Mathematical
/// Software 37, 2010).
const THRESHOLD: f64 = 1e-3;
/// Matrices of more rows are not factored as full ones.
const FULL_AT_MOST: usize = 200;

/// A sparse square matrix and, beside it, its triangular factors.
#[derive(Debug, Clone)]
pub(crate) struct SparseLu {
    symbolic: Arc<SymbolicFactors>,
    /// The entries of the matrix, by place.
    matrix: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Inverse pivots, and their magnitudes beside their rows.
    inverse: Vec<f64>,
    weight: Vec<f64>,
    /// The row that is being eliminated.
    row: Vec<f64>,
    work: Vec<f64>,
    rest: Vec<f64>,
    /// The matrix as a full one; memory is taken when it is needed for the first time.
    full: Option<Box<Lu>>,
    /// The same with exchanges of rows, for a large one.
    exchanged: Option<Box<Exchanged>>,
    /// Whether the determinant of a large one was above zero when it was known last: exchanges do not tell.
    positive: bool,
    /// The factors as those of a symmetric matrix.
    definite: Option<Box<SparseDefinite>>,
    /// Which factors there are.
    factored: Factored,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Factored {
    Definite,
    Sparse,
    Full,
    Exchanged,
}

impl SparseLu {
    /// Room for a matrix with these factors; `symmetric`: whatever its values.
    pub fn new(symbolic: Arc<SymbolicFactors>, symmetric: bool) -> SparseLu {
        let line = vec![0.0; symbolic.rows.len()];
        SparseLu {
            matrix: vec![0.0; symbolic.matrix.len()],
            lower: vec![0.0; symbolic.lower.len()],
            upper: vec![0.0; symbolic.upper.len()],
            inverse: line.clone(),
            weight: line.clone(),
            row: line.clone(),
            work: line.clone(),
            rest: line,
            full: None,
            exchanged: None,
            positive: true,
            definite: symmetric.then(|| SparseDefinite::new(&symbolic)).flatten().map(Box::new),
            factored: Factored::Sparse,
            symbolic,
        }
    }

    /// Takes up the entries of the matrix, row by row, and factors it; `Err(unknown)` if no pivot is left for that, or if
    /// an entry is not finite.
    pub fn factor(&mut self, entries: impl Iterator<Item = f64>) -> Result<(), usize> {
        // The entries come in the order of the matrix; `position` says where each one stands.
        let symbolic = Arc::clone(&self.symbolic);
        entries.zip(&symbolic.positions).for_each(|(entry, &at)| self.matrix[at as usize] = entry);
        let large = symbolic.rows.len() > FULL_AT_MOST;
        if large && self.factored != Factored::Exchanged {
            self.positive = self.is_positive();
        }
        if self.definite.as_mut().is_some_and(|definite| definite.factor(&symbolic, &self.matrix)) {
            self.factored = Factored::Definite;
            return Ok(());
        }
        let found = (0..symbolic.rows.len()).try_for_each(|place| self.eliminate(&symbolic, place).ok_or(place));
        let Err(place) = found else {
            self.factored = Factored::Sparse;
            return Ok(());
        };
        if !large {
            self.factored = Factored::Full;
            return self.factor_full(&symbolic);
        }
        self.factored = Factored::Exchanged;
        let exchanged = self.exchanged.get_or_insert_with(|| Box::new(Exchanged::new(&symbolic)));
        exchanged.factor(&self.matrix).then_some(()).ok_or(symbolic.columns[place] as usize)
    }

    /// Factors the row in a place; `None` if a pivot does not do.
    fn eliminate(&mut self, symbolic: &SymbolicFactors, place: usize) -> Option<()> {
        let (before, after) = (symbolic.lower.row(place), symbolic.upper.row(place));
        let SparseLu { matrix, lower, upper, inverse, weight, row, .. } = self;
        symbolic.lower.columns_of(place).iter().for_each(|&k| row[k as usize] = 0.0);
        symbolic.upper.columns_of(place).iter().for_each(|&j| row[j as usize] = 0.0);
        row[place] = 0.0;
        let mut scale = f64::MIN_POSITIVE;
        for entry in symbolic.matrix.row(place) {
            row[symbolic.matrix.columns()[entry] as usize] = matrix[entry];
            scale = scale.max(matrix[entry].abs());
        }
        for (l, &k) in lower[before.clone()].iter_mut().zip(symbolic.lower.columns_of(place)) {
            let k = k as usize;
            let (least, own) = (THRESHOLD * row[k].abs(), weight[k] * scale);
            if least > own || least.is_nan() || own.is_nan() {
                return None;
            }
            let factor = row[k] * inverse[k];
            *l = factor;
            for (u, &j) in upper[symbolic.upper.row(k)].iter().zip(symbolic.upper.columns_of(k)) {
                row[j as usize] -= factor * u;
            }
        }
        weight[place] = row[place].abs() / scale;
        if !(weight[place] > f64::EPSILON * row.len() as f64 && weight[place].is_finite()) {
            return None;
        }
        inverse[place] = 1.0 / row[place];
        for (u, &j) in upper[after].iter_mut().zip(symbolic.upper.columns_of(place)) {
            *u = row[j as usize];
        }
        Some(())
    }

    fn factor_full(&mut self, symbolic: &SymbolicFactors) -> Result<(), usize> {
        let n = symbolic.rows.len();
        let lu = self.full.get_or_insert_with(|| Box::new(Lu::new(n, false)));
        lu.matrix().fill(0.0);
        for ((place, column), &entry) in symbolic.matrix.places().zip(&self.matrix) {
            lu.matrix()[symbolic.rows[place] as usize * n + symbolic.columns[column] as usize] = entry;
        }
        lu.factor()
    }

    /// The logarithm of the magnitude of the determinant of the factored matrix; NaN where rows have been exchanged
    /// or the matrix is definite, whose pivots are not looked at.
    pub fn log_determinant(&self) -> f64 {
        match self.factored {
            Factored::Full => self.full.as_ref().map_or(f64::NAN, |lu| lu.log_determinant()),
            Factored::Sparse => -self.inverse.iter().map(|inverse| math::log(inverse.abs())).sum::<f64>(),
            Factored::Definite | Factored::Exchanged => f64::NAN,
        }
    }

    /// Replaces `b` by the solution. The matrix must have been factored.
    pub fn solve(&mut self, b: &mut [f64]) {
        match self.factored {
            Factored::Full => return self.full.iter_mut().for_each(|lu| lu.solve(b)),
            Factored::Exchanged => return self.exchanged.iter_mut().for_each(|lu| lu.solve(b)),
            Factored::Definite => return self.definite.iter_mut().for_each(|lu| lu.solve(&self.symbolic, b)),
            Factored::Sparse => {}
        }
        let symbolic = Arc::clone(&self.symbolic);
        let mut rest = std::mem::take(&mut self.rest);
        rest.copy_from_slice(b);
        self.substitute(&symbolic, b);
        for (place, &row) in symbolic.rows.iter().enumerate() {
            let mut left = rest[row as usize];
            for entry in symbolic.matrix.row(place) {
                left -= self.matrix[entry] * b[symbolic.columns[symbolic.matrix.columns()[entry] as usize] as usize];
            }
            rest[row as usize] = left;
        }
        self.substitute(&symbolic, &mut rest);
        // A refinement that is no small correction is none: the equations are not finite.
        b.iter_mut().zip(&rest).filter(|(_, r)| r.is_finite()).for_each(|(x, r)| *x += r);
        self.rest = rest;
    }

    /// The same, without refinement of sparse factors.
    pub fn solve_once(&mut self, b: &mut [f64]) {
        if self.factored != Factored::Sparse {
            return self.solve(b);
        }
        let symbolic = Arc::clone(&self.symbolic);
        self.substitute(&symbolic, b);
    }

    /// Replaces `b` by the solution of the equations with the matrix transposed. It must have been factored.
    pub fn solve_transposed(&mut self, b: &mut [f64]) {
        match self.factored {
            Factored::Full => return self.full.iter_mut().for_each(|lu| lu.solve_transposed(b)),
            Factored::Exchanged => return self.exchanged.iter_mut().for_each(|lu| lu.solve_transposed(b)),
            Factored::Definite => return self.definite.iter_mut().for_each(|lu| lu.solve(&self.symbolic, b)),
            Factored::Sparse => {}
        }
        let symbolic = Arc::clone(&self.symbolic);
        let mut rest = std::mem::take(&mut self.rest);
        rest.copy_from_slice(b);
        self.substitute_transposed(&symbolic, b);
        for (place, &row) in symbolic.rows.iter().enumerate() {
            for entry in symbolic.matrix.row(place) {
                let column = symbolic.columns[symbolic.matrix.columns()[entry] as usize];
                rest[column as usize] -= self.matrix[entry] * b[row as usize];
            }
        }
        self.substitute_transposed(&symbolic, &mut rest);
        // As in `solve`.
        b.iter_mut().zip(&rest).filter(|(_, r)| r.is_finite()).for_each(|(x, r)| *x += r);
        self.rest = rest;
    }

    fn substitute_transposed(&mut self, symbolic: &SymbolicFactors, b: &mut [f64]) {
        let SparseLu { lower, upper, inverse, work, .. } = self;
        work.iter_mut().zip(&symbolic.columns).for_each(|(work, &column)| *work = b[column as usize]);
        for place in 0..symbolic.columns.len() {
            work[place] *= inverse[place];
            for (u, &j) in upper[symbolic.upper.row(place)].iter().zip(symbolic.upper.columns_of(place)) {
                work[j as usize] -= u * work[place];
            }
        }
        for (place, &row) in symbolic.rows.iter().enumerate().rev() {
            for (l, &k) in lower[symbolic.lower.row(place)].iter().zip(symbolic.lower.columns_of(place)) {
                work[k as usize] -= l * work[place];
            }
            b[row as usize] = work[place];
        }
    }

    fn substitute(&mut self, symbolic: &SymbolicFactors, b: &mut [f64]) {
        let SparseLu { lower, upper, inverse, work, .. } = self;
        for (place, &row) in symbolic.rows.iter().enumerate() {
            let factors = lower[symbolic.lower.row(place)].iter().zip(symbolic.lower.columns_of(place));
            work[place] = factors.fold(b[row as usize], |left, (l, &k)| left - l * work[k as usize]);
        }
        substitute_back(symbolic, (upper, inverse), work, b);
    }

    /// Whether the determinant of the factored matrix is above zero; with exchanges of rows, whether it was so before.
    pub fn is_positive(&self) -> bool {
        match (self.factored, &self.full, &self.definite) {
            (Factored::Full, Some(lu), _) => lu.is_positive(),
            (Factored::Definite, _, Some(definite)) => definite.is_positive(),
            (Factored::Exchanged, _, _) => self.positive,
            _ => self.inverse.iter().fold(!self.symbolic.odd, |positive, &inverse| positive == (inverse > 0.0)),
        }
    }
}

/// From the last place on: each unknown by the entries right of the diagonal and the inverse of its pivot. `work` holds what is
/// left of the right side.
pub(super) fn substitute_back(
    symbolic: &SymbolicFactors,
    (upper, inverse): (&[f64], &[f64]),
    work: &mut [f64],
    b: &mut [f64],
) {
    for (place, &column) in symbolic.columns.iter().enumerate().rev() {
        let factors = upper[symbolic.upper.row(place)].iter().zip(symbolic.upper.columns_of(place));
        let left = factors.fold(work[place], |left, (u, &j)| left - u * work[j as usize]);
        work[place] = left * inverse[place];
        b[column as usize] = work[place];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfarrow_compiler::sparse::Pattern;

    /// Numbers between -0.5 and 0.5.
    fn numbers(mut seed: f64) -> impl FnMut() -> f64 {
        move || {
            seed = (seed * 16807.0) % 2147483647.0;
            seed / 2147483647.0 - 0.5
        }
    }

    /// A matrix with some entries in each row beside the diagonal, which is `heavy` times as large.
    fn sparse(n: usize, heavy: f64, seed: f64) -> (Pattern, Vec<f64>) {
        let mut next = numbers(seed);
        let rows: Vec<Vec<usize>> = (0..n)
            .map(|i| {
                let mut columns: Vec<usize> = (0..3).map(|_| ((next() + 0.5) * n as f64) as usize).collect();
                columns.push(i);
                columns.sort_unstable();
                columns.dedup();
                columns
            })
            .collect();
        let pattern = Pattern::new(rows);
        let entries = pattern.places().map(|(i, j)| if i == j { heavy * next() } else { next() }).collect();
        (pattern, entries)
    }

    fn full(pattern: &Pattern, entries: &[f64]) -> Lu {
        let n = pattern.size();
        let mut lu = Lu::new(n, false);
        pattern.places().zip(entries).for_each(|((i, j), &e)| lu.matrix()[i * n + j] = e);
        lu
    }

    #[test]
    fn solutions_are_those_of_the_full_matrix() {
        for (seed, heavy) in (1..40).map(|seed| (f64::from(seed), [0.0, 1e-9, 1.0, 10.0][seed as usize % 4])) {
            let (pattern, entries) = sparse(40, heavy, seed);
            let Some(symbolic) = SymbolicFactors::new(&pattern) else { continue };
            let mut next = numbers(seed + 100.0);
            let b: Vec<f64> = (0..40).map(|_| next()).collect();
            let (mut lu, mut other) = (SparseLu::new(Arc::new(symbolic), false), full(&pattern, &entries));
            let (found, expected) = (lu.factor(entries.iter().copied()), other.factor());
            assert_eq!(found.is_ok(), expected.is_ok(), "{seed}");
            if found.is_err() {
                continue;
            }
            assert_eq!(lu.is_positive(), other.is_positive(), "{seed} {heavy}");
            let mut x = b.clone();
            lu.solve(&mut x);
            let mut left = b.clone();
            pattern.places().zip(&entries).for_each(|((i, j), e)| left[i] -= e * x[j]);
            let mut turned = b.clone();
            lu.solve_transposed(&mut turned);
            let mut of_turned = b.clone();
            pattern.places().zip(&entries).for_each(|((i, j), e)| of_turned[j] -= e * turned[i]);
            let most = turned.iter().chain(&b).fold(0.0f64, |most, x| most.max(x.abs()));
            let missed = of_turned.iter().fold(0.0f64, |most, r| most.max(r.abs()));
            assert!(missed <= 1e-14 * most.max(1.0), "{seed} {heavy}: {missed:e} of {most:e}, transposed");
            let size = x.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            let rest = left.iter().fold(0.0f64, |most, r| most.max(r.abs()));
            assert!(rest <= 1e-14 * size.max(1.0), "{seed} {heavy}: {rest:e} of {size:e}");
        }
    }

    #[test]
    fn a_poor_pivot_is_not_taken() {
        // The pivot of the order vanishes; rows have to be exchanged.
        let pattern = Pattern::new([vec![0, 1], vec![0, 1]]);
        let symbolic = Arc::new(SymbolicFactors::new(&pattern).expect("regular"));
        let mut lu = SparseLu::new(symbolic, false);
        for small in [0.0, 1e-20, f64::MIN_POSITIVE] {
            assert_eq!(lu.factor([small, 1.0, 1.0, small].into_iter()), Ok(()));
            assert!(lu.factored == Factored::Full && !lu.is_positive());
            let mut b = [2.0, 3.0];
            lu.solve(&mut b);
            assert_eq!(b, [3.0, 2.0]);
        }
        assert_eq!(lu.factor([2.0, 1.0, 1.0, 2.0].into_iter()), Ok(()));
        assert!(lu.factored == Factored::Sparse && lu.is_positive());
    }

    /// Rows of a large matrix are exchanged where a pivot of the order vanishes.
    #[test]
    fn rows_of_large_matrices_are_exchanged() {
        let n = 400;
        let pattern = Pattern::new((0..n).map(|i| vec![i / 2 * 2, i / 2 * 2 + 1]).collect::<Vec<_>>());
        let symbolic = Arc::new(SymbolicFactors::new(&pattern).expect("regular"));
        let mut lu = SparseLu::new(symbolic, false);
        let entries =
            |small: f64| pattern.places().map(move |(i, j)| if i == j { small } else { 1.0 + (i / 2) as f64 });
        assert_eq!(lu.factor(entries(0.0)), Ok(()));
        assert_eq!(lu.factored, Factored::Exchanged);
        let right: Vec<f64> = (0..n).map(|i| i as f64 - 7.0).collect();
        for mut other in [lu.clone(), lu] {
            let (mut x, mut turned) = (right.clone(), right.clone());
            other.solve(&mut x);
            other.solve_transposed(&mut turned);
            for i in 0..n {
                let expected = right[i ^ 1] / (1.0 + (i / 2) as f64);
                assert!((x[i] - expected).abs() <= 1e-14 * expected.abs(), "{i}: {} {expected}", x[i]);
                assert!((turned[i] - expected).abs() <= 1e-14 * expected.abs(), "{i}: {} {expected}", turned[i]);
            }
            assert_eq!(other.factor(entries(0.5)), Ok(()));
            assert_eq!(other.factored, Factored::Sparse);
            // Its first rows are equal.
            assert!(other.factor(entries(1.0)).is_err());
        }
    }

    #[test]
    fn what_is_singular_is_said_to_be_so() {
        let pattern = Pattern::new([vec![0, 1], vec![0, 1]]);
        let mut lu = SparseLu::new(Arc::new(SymbolicFactors::new(&pattern).expect("regular")), false);
        assert!(lu.factor([1.0, 2.0, 2.0, 4.0].into_iter()).is_err());
        assert!(lu.factor([f64::NAN, 2.0, 2.0, 4.0].into_iter()).is_err());
        assert!(lu.factor([1.0, f64::INFINITY, 2.0, 4.0].into_iter()).is_err());
    }
    /// Nodes of a ladder and of a net with sources between them: tridiagonal with a few entries far off, definite if `sign`
    /// is not 0, up to that; else entries of the diagonal of either sign.
    fn symmetric(n: usize, sign: f64, seed: f64) -> (Pattern, Vec<f64>) {
        let mut next = numbers(seed);
        let mut full = vec![vec![0.0; n]; n];
        for i in 0..n {
            for j in [(i + 1) % n, (7 * i + 3) % n].into_iter().filter(|&j| j != i) {
                let conductance = crate::math::pow(10.0, 8.0 * next());
                (full[i][i], full[j][j]) = (full[i][i] + conductance, full[j][j] + conductance);
                (full[i][j], full[j][i]) = (full[i][j] - conductance, full[j][i] - conductance);
            }
            full[i][i] += 1e-3;
        }
        let of_sign = |i: usize| {
            if sign < 0.0 || sign == 0.0 && i % 2 == 1 { -1.0 } else { 1.0 }
        };
        let entry = |i: usize, j: usize| if i == j { of_sign(i) * full[i][j] } else { of_sign(0) * full[i][j] };
        let pattern = Pattern::new((0..n).map(|i| (0..n).filter(|&j| full[i][j] != 0.0).collect::<Vec<_>>()));
        let entries = pattern.places().map(|(i, j)| entry(i, j)).collect();
        (pattern, entries)
    }

    #[test]
    fn symmetric_matrices_take_half_the_work_where_they_are_definite() {
        for (seed, sign) in (1..30).map(|seed| (f64::from(seed), [1.0, -1.0, 0.0][seed as usize % 3])) {
            let n = 30 + seed as usize;
            let (pattern, entries) = symmetric(n, sign, seed);
            let symbolic = Arc::new(SymbolicFactors::new(&pattern).expect("regular"));
            let mut next = numbers(seed + 100.0);
            let b: Vec<f64> = (0..n).map(|_| next()).collect();
            let (mut lu, mut other) = (SparseLu::new(symbolic, true), full(&pattern, &entries));
            assert_eq!((lu.factor(entries.iter().copied()), other.factor()), (Ok(()), Ok(())));
            assert_eq!(lu.factored == Factored::Definite, sign != 0.0, "{seed}");
            assert_eq!(lu.is_positive(), other.is_positive(), "{seed} {sign}");
            let (mut x, mut turned, mut y) = (b.clone(), b.clone(), b.clone());
            lu.solve(&mut x);
            lu.solve_transposed(&mut turned);
            other.solve(&mut y);
            // Backward errors beside what each row is the sum of, and the errors of unknowns beside the greatest.
            let mut rows: Vec<(f64, f64)> = b.iter().map(|b| (*b, b.abs())).collect();
            for ((i, j), e) in pattern.places().zip(&entries) {
                rows[i] = (rows[i].0 - e * x[j], rows[i].1 + (e * x[j]).abs());
            }
            assert!(rows.iter().all(|r| r.0.abs() <= 1e-13 * r.1), "{seed} {sign}: {rows:?}");
            let most = y.iter().fold(0.0f64, |most, y| most.max(y.abs()));
            let off =
                x.iter().chain(&turned).zip(y.iter().chain(&y)).fold(0.0f64, |off, (x, y)| off.max((x - y).abs()));
            assert!(off <= 1e-9 * most, "{seed} {sign}: {off:e} of {most:e}");
        }
    }
}
