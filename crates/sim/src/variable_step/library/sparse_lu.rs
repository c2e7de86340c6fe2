//! Sparse linear equations that say when they have no solution, where the library's own solver panics.

use std::cell::RefCell;
use std::rc::Rc;

use diffsol_la::error::{LaError, LinearSolverError};
use diffsol_la::linear_solver::LinearSolver;
use diffsol_la::{FaerContext, FaerSparseMat, FaerVec, LinearOp, Matrix, MatrixCommon, Vector};

use crate::{Sparsity, linear};

/// Factors that solvers hand on to those that come after a restart: the order of elimination is found once a run.
pub(crate) type KeptFactors = Rc<RefCell<Option<linear::SparseLu<f64>>>>;

/// A sparse matrix and its triangular factors. A singular matrix leaves none; Newton is told so when it asks for a
/// solution, and the integrator tries a shorter step.
#[derive(Default)]
pub(super) struct SparseLu {
    matrix: Option<FaerSparseMat<f64>>,
    kept: KeptFactors,
    factored: bool,
}

impl SparseLu {
    /// With factors that others have had, none of whom asks for them again.
    pub(super) fn after(kept: &KeptFactors) -> SparseLu {
        SparseLu { kept: Rc::clone(kept), ..SparseLu::default() }
    }
}

impl LinearSolver<FaerSparseMat<f64>> for SparseLu {
    fn set_sparsity<C>(&mut self, op: &C)
    where
        C: LinearOp<T = f64, V = FaerVec<f64>, M = FaerSparseMat<f64>, C = FaerContext>,
    {
        let matrix = FaerSparseMat::new_from_sparsity(op.nrows(), op.ncols(), op.sparsity(), *op.context());
        let structure = matrix.inner()[0].symbolic();
        let columns = (0..op.ncols()).map(|column| structure.row_idx_of_col(column).collect());
        let pattern = Sparsity::from_columns(columns);
        let kept = &mut *self.kept.borrow_mut();
        if kept.as_ref().is_none_or(|kept| *kept.pattern() != pattern) {
            *kept = Some(linear::SparseLu::new(&pattern));
        }
        self.matrix = Some(matrix);
        self.factored = false;
    }

    fn set_linearisation<C>(&mut self, op: &C)
    where
        C: LinearOp<T = f64, V = FaerVec<f64>, M = FaerSparseMat<f64>, C = FaerContext>,
    {
        self.factored = false;
        if let (Some(matrix), Some(factors)) = (&mut self.matrix, &mut *self.kept.borrow_mut()) {
            op.matrix_inplace(matrix);
            factors.values().copy_from_slice(matrix.inner()[0].val());
            self.factored = factors.factor();
        }
    }

    fn solve_in_place(&self, b: &mut FaerVec<f64>) -> Result<(), LaError> {
        let kept = &mut *self.kept.borrow_mut();
        let factors = kept.as_mut().filter(|_| self.factored).ok_or(LinearSolverError::LuSolveFailed)?;
        let mut finite = true;
        b.for_each_batch_host([], |b, [], _| {
            factors.solve(b);
            finite &= b.iter().all(|value| value.is_finite());
        });
        if finite { Ok(()) } else { Err(LinearSolverError::LuSolveFailed.into()) }
    }

    /// Integration forward in time does not ask for it.
    fn solve_transpose_in_place(&self, _: &mut FaerVec<f64>) -> Result<(), LaError> {
        Err(LinearSolverError::LuSolveFailed.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use diffsol_la::matrix::sparsity::MatrixSparsity;
    use diffsol_la::{IndexType, VectorIndex};

    /// A matrix of three diagonals.
    struct Tridiagonal {
        context: FaerContext,
        below: f64,
        on: f64,
        above: f64,
    }

    const ROWS: usize = 3;

    impl LinearOp for Tridiagonal {
        type T = f64;
        type V = FaerVec<f64>;
        type M = FaerSparseMat<f64>;
        type C = FaerContext;

        fn nrows(&self) -> IndexType {
            ROWS
        }
        fn ncols(&self) -> IndexType {
            ROWS
        }
        fn context(&self) -> &FaerContext {
            &self.context
        }
        fn sparsity(&self) -> Option<<FaerSparseMat<f64> as Matrix>::Sparsity> {
            let near = |i: usize| (i.saturating_sub(1)..=(i + 1).min(ROWS - 1)).map(move |row| (row, i));
            MatrixSparsity::<FaerSparseMat<f64>>::try_from_indices(ROWS, ROWS, (0..ROWS).flat_map(near).collect()).ok()
        }
        fn matrix_inplace(&self, matrix: &mut FaerSparseMat<f64>) {
            let values = [self.on, self.below, self.above, self.on, self.below, self.above, self.on];
            let (indices, values) = ((0..7).collect::<Vec<_>>(), FaerVec::from_vec(values.to_vec(), *self.context()));
            let index = VectorIndex::from_vec(indices, *self.context());
            matrix.set_data_with_indices(&index, &index, &values);
        }
    }

    fn solve(below: f64, on: f64, above: f64) -> Result<Vec<f64>, LaError> {
        let (op, mut lu) = (Tridiagonal { context: FaerContext::default(), below, on, above }, SparseLu::default());
        lu.set_sparsity(&op);
        lu.set_linearisation(&op);
        let mut b = FaerVec::from_vec(vec![0.0, 0.0, 4.0], *op.context());
        lu.solve_in_place(&mut b)?;
        Ok((0..ROWS).map(|i| b.get_index(i)).collect())
    }

    #[test]
    fn solves_what_has_a_solution() {
        let x = solve(-1.0, 2.0, -1.0).unwrap();
        assert!(x.iter().zip([1.0, 2.0, 3.0]).all(|(x, exact)| (x - exact).abs() < 1e-15), "{x:?}");
    }

    #[test]
    fn says_what_has_none() {
        assert!(solve(0.0, 0.0, 0.0).is_err());
        assert!(solve(1.0, 0.0, 1.0).is_err());
        assert!(solve(0.0, 0.0, 1.0).is_err());
    }
}
