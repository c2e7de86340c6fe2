//! Symmetric blocks of linear equations, written out: what elimination does, operation by operation, once for all who write
//! it down. What is nowhere but zero is left out.

use super::calculus::Calculus;
use crate::sparse::Pattern;

/// Blocks are written out if their elimination takes up to this many products: that of 20 unknowns that all depend on each
/// other takes 1,710.
const WRITTEN_OUT: usize = 2_000;

/// Those who write a block out.
pub trait Elimination: Calculus {
    /// 1 with the sign of a number.
    fn sign_of(&mut self, a: Self::Number) -> Self::Number;
    /// Asks that a pivot, made positive, lie above zero and above `least`, and be finite. Where it does not, what follows
    /// counts for nothing.
    fn require(&mut self, pivot: Self::Number, least: Self::Number);
    /// A number that is read more than once.
    fn keep(&mut self, a: Self::Number) -> Self::Number {
        a
    }
    /// A number from which others will be taken off.
    fn open(&mut self, a: Self::Number) -> Self::Number {
        self.keep(a)
    }
    /// `a` less a product. Nobody reads `a` itself any more.
    fn take_off(&mut self, a: Self::Number, product: Self::Number) -> Self::Number {
        let left = self.sub(a, product);
        self.keep(left)
    }
}

/// Whether a symmetric block with this pattern is written out.
pub fn is_written_out(pattern: &Pattern) -> bool {
    pattern.size() * pattern.size() <= 2 * WRITTEN_OUT && products(pattern) <= WRITTEN_OUT
}

/// Products that elimination takes, and the solution for one right side.
pub fn products(pattern: &Pattern) -> usize {
    let upper = filled(pattern);
    upper.iter().map(|row| row.len() * (row.len() + 1) / 2 + 2 * row.len() + 2).sum()
}

/// The columns right of the diagonal where `U` has entries, row by row.
fn filled(pattern: &Pattern) -> Vec<Vec<usize>> {
    let n = pattern.size();
    let mut stands = vec![false; n * n];
    pattern.places().for_each(|(i, j)| stands[i * n + j] = true);
    let mut rows = Vec::with_capacity(n);
    for k in 0..n {
        let row: Vec<usize> = (k + 1..n).filter(|&j| stands[k * n + j]).collect();
        for (a, &i) in row.iter().enumerate() {
            row[a..].iter().for_each(|&j| stands[i * n + j] = true);
        }
        rows.push(row);
    }
    rows
}

/// The factors of a matrix `Uᵀ D U` that is definite: `U` with ones on its diagonal, row by row, and the inverse of `D`.
pub struct Definite<N> {
    /// Columns and entries right of the diagonal.
    upper: Vec<Vec<(usize, N)>>,
    inverses: Vec<N>,
}

impl<N: Copy> Definite<N> {
    /// Factors the symmetric matrix with these entries; pivots below this fraction of the entry that they come from are
    /// rounding.
    pub fn factor<K>(k: &mut K, (pattern, entries): (&Pattern, &[N]), rounding: f64) -> Definite<N>
    where
        K: Elimination<Number = N>,
    {
        let n = pattern.size();
        let zero = k.number(0.0);
        let mut full = vec![zero; n * n];
        pattern.places().zip(entries).for_each(|((i, j), &entry)| full[i * n + j] = entry);
        let sign = k.sign_of(full[0]);
        let sign = k.keep(sign);
        let (mut upper, mut inverses) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let diagonal: Vec<N> = (0..n).map(|i| full[i * n + i]).collect();
        for (row, columns) in filled(pattern).into_iter().enumerate() {
            let pivot = full[row * n + row];
            let (size, entry) = (k.mul(sign, pivot), k.mul(sign, diagonal[row]));
            let (size, rounding) = (k.keep(size), k.number(rounding));
            let least = k.mul(rounding, entry);
            k.require(size, least);
            let one = k.number(1.0);
            let inverse = k.div(one, pivot);
            let inverse = k.keep(inverse);
            let mut own = Vec::with_capacity(columns.len());
            for (a, &j) in columns.iter().enumerate() {
                let factor = k.mul(full[row * n + j], inverse);
                let factor = k.keep(factor);
                for &i in &columns[a..] {
                    let product = k.mul(factor, full[row * n + i]);
                    full[j * n + i] = k.take_off(full[j * n + i], product);
                }
                own.push((j, factor));
            }
            upper.push(own);
            inverses.push(inverse);
        }
        Definite { upper, inverses }
    }

    /// Replaces the right side by the solution.
    pub fn solve<K: Elimination<Number = N>>(&self, k: &mut K, right: &mut [N]) {
        let zero = k.number(0.0);
        for b in right.iter_mut() {
            let start = k.add(*b, zero);
            *b = k.open(start);
        }
        for (row, upper) in self.upper.iter().enumerate() {
            for &(column, u) in upper {
                let product = k.mul(u, right[row]);
                right[column] = k.take_off(right[column], product);
            }
        }
        for (b, &inverse) in right.iter_mut().zip(&self.inverses) {
            let scaled = k.mul(*b, inverse);
            let scaled = k.add(scaled, zero);
            *b = k.open(scaled);
        }
        // From the last unknown on: each one by those behind it.
        for (row, upper) in self.upper.iter().enumerate().rev() {
            for &(column, u) in upper.iter().rev() {
                let product = k.mul(u, right[column]);
                right[row] = k.take_off(right[row], product);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_zero_takes_no_products() {
        let full = |n: usize| Pattern::new((0..n).map(|_| 0..n));
        let chain = |n: usize| Pattern::new((0..n).map(|i: usize| i.saturating_sub(1)..n.min(i + 2)));
        assert_eq!((products(&full(20)), products(&chain(20))), (1_750, 97));
        assert!(is_written_out(&full(20)) && is_written_out(&chain(60)) && !is_written_out(&full(24)));
        // The last one of a star fills nothing in, the first one all.
        let star = |center: usize| {
            Pattern::new((0..9).map(|i| {
                if i == center {
                    (0..9).collect()
                } else {
                    let mut row = vec![i, center];
                    row.sort_unstable();
                    row
                }
            }))
        };
        assert!(products(&star(8)) < products(&star(0)));
    }
}
