//! Symmetric definite matrices of one pattern, one in each lane: the operations of [`Lu`](super::Lu) in its order, those on
//! zeros left out.

use crate::bytecode::wide;
use halfarrow_compiler::sparse::Pattern;

/// The places above the diagonal that elimination fills, row by row.
#[derive(Debug)]
pub(crate) struct UpperPattern {
    rows: Vec<UpperRow>,
    /// Their number.
    places: usize,
}

/// A row of `U`, and what elimination by it does.
#[derive(Debug)]
struct UpperRow {
    /// The entry of the matrix on the diagonal.
    diagonal: Option<usize>,
    /// Where its places right of the diagonal begin.
    start: usize,
    /// These: column, and the entry of the matrix that stands there.
    right: Vec<(usize, Option<usize>)>,
    /// For each of them, in the row of that column, where the places of the columns after it stand.
    below: Vec<Vec<usize>>,
}

impl UpperPattern {
    /// The places of the factors of a matrix with this pattern.
    pub fn of(pattern: &Pattern) -> UpperPattern {
        let n = pattern.size();
        let mut full: Vec<Vec<bool>> =
            (0..n).map(|i| (0..n).map(|j| pattern.entry(i, j).is_some()).collect()).collect();
        for k in 0..n {
            let row: Vec<usize> = (k + 1..n).filter(|&j| full[k][j]).collect();
            for &i in &row {
                row.iter().filter(|&&j| j >= i).for_each(|&j| full[i][j] = true);
            }
        }
        let columns: Vec<Vec<usize>> = (0..n).map(|i| (i + 1..n).filter(|&j| full[i][j]).collect()).collect();
        let starts: Vec<usize> = (0..n).map(|i| columns[..i].iter().map(Vec::len).sum()).collect();
        let place = |i: usize, j: usize| starts[i] + columns[i].iter().position(|&c| c == j).expect("filled");
        let row = |i: usize| {
            let right = columns[i].iter().map(|&j| (j, pattern.entry(i, j))).collect();
            let after = |a: usize| columns[i][a + 1..].iter().map(|&j| place(columns[i][a], j)).collect();
            let below = (0..columns[i].len()).map(after).collect();
            UpperRow { diagonal: pattern.entry(i, i), start: starts[i], right, below }
        };
        UpperPattern { rows: (0..n).map(row).collect(), places: columns.iter().map(Vec::len).sum() }
    }
}

type Vector<const N: usize> = wide::Vector<N>;

#[inline(always)]
fn each<const N: usize>(value: impl Fn(usize) -> f64) -> Vector<N> {
    wide::Vector(std::array::from_fn(value))
}

/// The factors of a matrix in each lane.
#[derive(Debug, Clone, Default)]
pub(crate) struct BatchFactors<const N: usize> {
    /// `U` above the diagonal, row by row.
    upper: Vec<Vector<N>>,
    /// The inverse of `D`; of a single equation its coefficient.
    inverse: Vec<Vector<N>>,
}

impl<const N: usize> BatchFactors<N> {
    /// Makes room for matrices with this pattern.
    pub fn reserve(&mut self, pattern: &UpperPattern) {
        self.upper.resize(self.upper.len().max(pattern.places), Vector::default());
        self.inverse.resize(self.inverse.len().max(pattern.rows.len()), Vector::default());
    }

    /// Factors the matrix with these entries; `good` loses the lanes in which it is not definite.
    #[inline(always)]
    pub fn factor(&mut self, pattern: &UpperPattern, entry: impl Fn(usize) -> Vector<N>, good: &mut Vector<N>) {
        let entry = |e: Option<usize>| e.map_or(wide::Vector([0.0; N]), &entry);
        let n = pattern.rows.len();
        if n == 1 {
            let a = entry(pattern.rows[0].diagonal);
            let size = each::<N>(|l| a[l].abs());
            let weight = each::<N>(|l| size[l] / if size[l] > f64::MIN_POSITIVE { size[l] } else { f64::MIN_POSITIVE });
            *good = each(|l| {
                let stands = (weight[l] > f64::EPSILON) & (weight[l] < f64::INFINITY);
                if stands { good[l] } else { 0.0 }
            });
            self.inverse[0] = a;
            return;
        }
        for (i, row) in pattern.rows.iter().enumerate() {
            self.inverse[i] = entry(row.diagonal);
            for (upper, &(_, e)) in self.upper[row.start..].iter_mut().zip(&row.right) {
                *upper = entry(e);
            }
        }
        let first = self.inverse[0];
        let sign = each::<N>(|l| 1f64.copysign(first[l]));
        let least = f64::EPSILON * n as f64;
        for (k, row) in pattern.rows.iter().enumerate() {
            let (pivot, diagonal) = (self.inverse[k], entry(row.diagonal));
            *good = each(|l| {
                let (size, entry) = (sign[l] * pivot[l], sign[l] * diagonal[l]);
                let stands = (size > 0.0) & (size > least * entry) & (size < f64::INFINITY);
                if stands { good[l] } else { 0.0 }
            });
            let inverse = each::<N>(|l| 1.0 / pivot[l]);
            for (a, (&(i, _), below)) in row.right.iter().zip(&row.below).enumerate() {
                let u = self.upper[row.start + a];
                let factor = each::<N>(|l| u[l] * inverse[l]);
                self.inverse[i] = each(|l| self.inverse[i][l] - factor[l] * u[l]);
                for (&at, other) in below.iter().zip(row.start + a + 1..) {
                    let other = self.upper[other];
                    self.upper[at] = each(|l| self.upper[at][l] - factor[l] * other[l]);
                }
            }
            for u in &mut self.upper[row.start..][..row.right.len()] {
                *u = each(|l| u[l] * inverse[l]);
            }
            self.inverse[k] = inverse;
        }
    }

    /// Replaces `b` by the solution.
    #[inline(always)]
    pub fn solve(&self, pattern: &UpperPattern, b: &mut [Vector<N>]) {
        let n = pattern.rows.len();
        if n == 1 {
            b[0] = each(|l| b[0][l] / self.inverse[0][l]);
            return;
        }
        b[..n].iter_mut().for_each(|b| *b = each(|l| b[l] + 0.0));
        for (k, row) in pattern.rows.iter().enumerate() {
            let done = b[k];
            for (u, &(j, _)) in self.upper[row.start..].iter().zip(&row.right) {
                b[j] = each(|l| b[j][l] - u[l] * done[l]);
            }
        }
        for (b, inverse) in b[..n].iter_mut().zip(&self.inverse) {
            *b = each(|l| b[l] * inverse[l] + 0.0);
        }
        // Back substitution, from the last unknown on.
        for (k, row) in pattern.rows.iter().enumerate().rev() {
            let mut value = b[k];
            for (u, &(j, _)) in self.upper[row.start..][..row.right.len()].iter().zip(&row.right).rev() {
                let done = &b[j];
                value = each(|l| value[l] - u[l] * done[l]);
            }
            b[k] = value;
        }
    }
}
