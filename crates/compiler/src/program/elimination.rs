//! Small symmetric blocks of linear equations, written out: what elimination does, operation by operation, once for all who
//! write it down.

use super::calculus::Calculus;

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
}

/// The factors of a matrix `Uᵀ D U` that is definite: `U` with ones on its diagonal, row by row, and the inverse of `D`.
pub struct Definite<N> {
    upper: Vec<N>,
    inverses: Vec<N>,
}

impl<N: Copy> Definite<N> {
    /// Factors the matrix of so many rows, which is given row by row; pivots below this fraction of the entry that they
    /// come from are rounding.
    pub fn factor<K: Elimination<Number = N>>(k: &mut K, matrix: &[N], n: usize, rounding: f64) -> Definite<N> {
        let mut upper = matrix.to_vec();
        let mut inverses = Vec::with_capacity(n);
        let sign = k.sign_of(matrix[0]);
        let sign = k.keep(sign);
        for row in 0..n {
            let pivot = upper[row * n + row];
            let (size, entry) = (k.mul(sign, pivot), k.mul(sign, matrix[row * n + row]));
            let (size, rounding) = (k.keep(size), k.number(rounding));
            let least = k.mul(rounding, entry);
            k.require(size, least);
            let one = k.number(1.0);
            let inverse = k.div(one, pivot);
            inverses.push(k.keep(inverse));
            for j in row + 1..n {
                let factor = k.mul(upper[row * n + j], inverses[row]);
                let factor = k.keep(factor);
                for i in j..n {
                    // The entries of the row itself are scaled behind this one.
                    let product = k.mul(factor, upper[row * n + i]);
                    let left = k.sub(upper[j * n + i], product);
                    upper[j * n + i] = k.keep(left);
                }
                upper[row * n + j] = factor;
            }
        }
        Definite { upper, inverses }
    }

    /// Replaces the right side by the solution.
    pub fn solve<K: Elimination<Number = N>>(&self, k: &mut K, right: &mut [N]) {
        let n = right.len();
        let zero = k.number(0.0);
        for b in right.iter_mut() {
            let start = k.add(*b, zero);
            *b = k.keep(start);
        }
        for row in 0..n {
            (row + 1..n).for_each(|j| self.take_off(k, right, (row, j), (j, row)));
        }
        for (b, &inverse) in right.iter_mut().zip(&self.inverses) {
            let scaled = k.mul(*b, inverse);
            let scaled = k.add(scaled, zero);
            *b = k.keep(scaled);
        }
        for row in (0..n).rev() {
            (0..row).for_each(|i| self.take_off(k, right, (i, row), (i, row)));
        }
    }

    /// Takes off one entry of the right side what a factor makes of another.
    fn take_off<K: Elimination<Number = N>>(
        &self,
        k: &mut K,
        right: &mut [N],
        (row, column): (usize, usize),
        (from, done): (usize, usize),
    ) {
        let product = k.mul(self.upper[row * right.len() + column], right[done]);
        let left = k.sub(right[from], product);
        right[from] = k.keep(left);
    }
}
