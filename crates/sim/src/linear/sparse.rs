//! Sparse linear equations: in a fixed order as long as that does, with pivots where it does not.

use super::Number;
use super::pivoting::PivotingLu;
use super::static_order::StaticLu;
use crate::Sparsity;

/// Operations for each entry of the factors beyond which blocks of columns are faster than single rows.
const MOST_OPERATIONS: u64 = 120;

/// What a solution may leave of equations, relative to what each of them adds up.
const ALLOWED: f64 = 1e-10;

/// Matrices for which the order did not do after which it is tried no more.
const MOST_POOR: usize = 3;

/// A sparse matrix and its triangular factors.
///
/// Pivots stand where the pattern puts them, so that a factorisation takes the same operations each time and no memory.
/// Each time it is tried on equations of known solution whether they do; if not, rows are exchanged, which takes memory
/// when it comes to that first.
pub struct SparseLu<T: Number> {
    pattern: Sparsity,
    values: Vec<T>,
    fixed: Option<StaticLu<T>>,
    pivoting: Option<Box<PivotingLu<T>>>,
    /// Whether the factors are those with pivots.
    is_pivoted: bool,
    poor: usize,
    trial: Vec<T>,
    rest: Vec<T>,
    sizes: Vec<f64>,
}

impl<T: Number> SparseLu<T> {
    /// For matrices of this pattern.
    pub fn new(pattern: &Sparsity) -> SparseLu<T> {
        let cheap = |fixed: &StaticLu<T>| fixed.operations() <= MOST_OPERATIONS * fixed.entries().max(1) as u64;
        let size = pattern.states();
        SparseLu {
            values: vec![T::default(); pattern.nonzeros()],
            fixed: StaticLu::new(pattern).filter(cheap),
            pivoting: None,
            is_pivoted: false,
            poor: 0,
            trial: vec![T::default(); size],
            rest: vec![T::default(); size],
            sizes: vec![0.0; size],
            pattern: pattern.clone(),
        }
    }

    /// Where the matrix may have entries.
    pub fn pattern(&self) -> &Sparsity {
        &self.pattern
    }

    /// The entries of the matrix, in the order of the pattern: what the next factorisation takes.
    pub fn values(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// The entries as they were given last, in the order of the pattern.
    pub fn stored(&self) -> &[T] {
        &self.values
    }

    /// Factors the matrix. `false` if it is singular, or there is no memory.
    pub fn factor(&mut self) -> bool {
        self.is_pivoted = false;
        if let Some(fixed) = self.fixed.as_mut().filter(|_| self.poor < MOST_POOR) {
            if fixed.factor(&self.values) && self.left_over() <= ALLOWED {
                return true;
            }
            self.poor += 1;
        }
        self.is_pivoted = true;
        if self.pivoting.is_none() {
            self.pivoting = PivotingLu::new(&self.pattern).map(Box::new);
        }
        // The library does not tell of a last pivot that is 0.
        self.pivoting.as_mut().is_some_and(|pivoting| pivoting.factor(&self.values)) && self.left_over().is_finite()
    }

    /// Replaces `b` by the solution.
    pub fn solve(&mut self, b: &mut [T]) {
        match (&mut self.pivoting, &mut self.fixed) {
            (Some(pivoting), _) if self.is_pivoted => pivoting.solve(b),
            (_, Some(fixed)) => fixed.solve(b),
            _ => {}
        }
    }

    /// Tries the factors on equations of which ones are the solution: what theirs leaves of an equation, relative to what it
    /// adds up, at most. Not a number if they have none.
    fn left_over(&mut self) -> f64 {
        self.rest.fill(T::default());
        self.sizes.fill(0.0);
        for ((row, _), &value) in self.pattern.entries().zip(&self.values) {
            self.rest[row] += value;
            self.sizes[row] += value.magnitude();
        }
        let mut trial = std::mem::take(&mut self.trial);
        trial.copy_from_slice(&self.rest);
        self.solve(&mut trial);
        for ((row, column), &value) in self.pattern.entries().zip(&self.values) {
            let term = value * trial[column];
            self.rest[row] -= term;
            self.sizes[row] += term.magnitude();
        }
        self.trial = trial;
        let parts = self.rest.iter().zip(&self.sizes).map(|(rest, size)| rest.magnitude() / size);
        parts.fold(0.0, |most, part| if part > most || part.is_nan() { part } else { most })
    }

    /// Whether the last factors are those with pivots.
    #[cfg(test)]
    fn is_pivoted(&self) -> bool {
        self.is_pivoted
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::Lu;
    use faer::c64;

    /// Numbers between -0.5 and 0.5.
    fn numbers(mut seed: f64) -> impl FnMut() -> f64 {
        move || {
            seed = (seed * 16807.0) % 2147483647.0;
            seed / 2147483647.0 - 0.5
        }
    }

    /// A pattern with the diagonal and some more in each column.
    fn pattern(size: usize, next: &mut impl FnMut() -> f64) -> Sparsity {
        let mut row = || ((next() + 0.5) * size as f64) as usize;
        Sparsity::from_columns((0..size).map(|column| vec![column, row(), row()]))
    }

    fn solved_densely(pattern: &Sparsity, values: &[f64], b: &[f64]) -> Option<Vec<f64>> {
        let (mut lu, mut x) = (Lu::new(b.len()), b.to_vec());
        pattern.entries().zip(values).for_each(|((row, column), &value)| lu.add(row, column, value));
        lu.factor().ok()?;
        lu.solve(&mut x);
        Some(x)
    }

    #[test]
    fn solutions_are_those_of_the_dense_matrix() {
        let mut pivoted = 0;
        for (seed, heavy) in (1..60).map(|seed| (f64::from(seed), [0.0, 1e-12, 1.0, 10.0][seed as usize % 4])) {
            let mut next = numbers(seed);
            let pattern = pattern(40, &mut next);
            let mut lu = SparseLu::<f64>::new(&pattern);
            let value = |(row, column)| if row == column { heavy * next() } else { next() };
            lu.values.iter_mut().zip(pattern.entries().map(value)).for_each(|(own, value)| *own = value);
            let mut b: Vec<f64> = (0..40).map(f64::from).collect();
            let Some(dense) = solved_densely(&pattern, &lu.values, &b) else { continue };
            assert!(lu.factor(), "{seed}");
            pivoted += usize::from(lu.is_pivoted());
            lu.solve(&mut b);
            let most = dense.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            // Random matrices are ill-conditioned now and then.
            b.iter().zip(&dense).for_each(|(x, other)| assert!((x - other).abs() < 1e-7 * most, "{seed}: {x} {other}"));
        }
        assert!((1..40).contains(&pivoted), "both ways are taken: {pivoted}");
    }

    #[test]
    fn complex_equations_are_two_real_ones() {
        let mut next = numbers(5.0);
        let pattern = pattern(30, &mut next);
        let mut lu = SparseLu::<c64>::new(&pattern);
        let value = |(row, column)| c64::new(next() + if row == column { 4.0 } else { 0.0 }, next());
        lu.values.iter_mut().zip(pattern.entries().map(value)).for_each(|(own, value)| *own = value);
        assert!(lu.factor());
        let x: Vec<c64> = (0..30).map(|i| c64::new(f64::from(i), 1.0)).collect();
        let mut b = vec![c64::default(); 30];
        pattern.entries().zip(&lu.values).for_each(|((row, column), value)| b[row] += value * x[column]);
        lu.solve(&mut b);
        b.iter().zip(&x).for_each(|(x, exact)| assert!((x - exact).l1_norm() < 1e-12, "{x} {exact}"));
    }

    #[test]
    fn rows_are_exchanged_where_the_order_does_not_do() {
        let pattern = Sparsity::dense(2);
        let mut lu = SparseLu::<f64>::new(&pattern);
        for small in [0.0, 1e-300, 1e-20, 1e-12] {
            lu.values().copy_from_slice(&[small, 1.0, 1.0, 1.0]);
            assert!(lu.factor() && lu.is_pivoted(), "{small}");
            let mut b = [1.0, 2.0];
            lu.solve(&mut b);
            assert!((b[0] - 1.0).abs() < 1e-11 && (b[1] - 1.0).abs() < 1e-11, "{small}: {b:?}");
        }
        // Units as far apart as you like do no harm.
        let mut lu = SparseLu::<f64>::new(&pattern);
        lu.values().copy_from_slice(&[1.0, -1e-12, 1e12, 1.0]);
        assert!(lu.factor() && !lu.is_pivoted());
    }

    #[test]
    fn what_is_singular_is_said_to_be_so() {
        let mut lu = SparseLu::<f64>::new(&Sparsity::dense(2));
        for values in [[1.0, 2.0, 2.0, 4.0], [0.0; 4]] {
            lu.values().copy_from_slice(&values);
            assert!(!lu.factor());
        }
    }
}
