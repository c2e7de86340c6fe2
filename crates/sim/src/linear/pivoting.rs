//! Triangular factors with pivots chosen among the rows, for matrices with which an order fixed beforehand does not do.

use super::Number;
use crate::Sparsity;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::prelude::Reborrow as _;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par};

/// A sparse matrix and its factors; the order of the columns is chosen once.
pub(super) struct PivotingLu<T: Number> {
    symbolic: SymbolicLu<usize>,
    matrix: SparseColMat<usize, T>,
    factors: NumericLu<usize, T>,
    memory: MemBuffer,
}

impl<T: Number> PivotingLu<T> {
    /// `None` if there is no memory for it.
    pub(super) fn new(pattern: &Sparsity) -> Option<PivotingLu<T>> {
        let size = pattern.states();
        let starts = (0..size).map(|column| pattern.places(column).start).chain([pattern.nonzeros()]).collect();
        let rows = pattern.entries().map(|(row, _)| row).collect();
        let structure = SymbolicSparseColMat::new_checked(size, size, starts, None, rows);
        let symbolic = factorize_symbolic_lu(structure.rb(), Default::default()).ok()?;
        let need = StackReq::any_of(&[
            symbolic.factorize_numeric_lu_scratch::<T>(Par::Seq, Default::default()),
            symbolic.solve_in_place_scratch::<T>(1, Par::Seq),
        ]);
        Some(PivotingLu {
            symbolic,
            matrix: SparseColMat::new(structure, vec![T::default(); pattern.nonzeros()]),
            factors: NumericLu::new(),
            memory: MemBuffer::try_new(need).ok()?,
        })
    }

    /// Factors the matrix with these entries. `false` if it is singular.
    pub(super) fn factor(&mut self, values: &[T]) -> bool {
        self.matrix.val_mut().copy_from_slice(values);
        let stack = MemStack::new(&mut self.memory);
        let matrix = self.matrix.rb();
        self.symbolic.factorize_numeric_lu(&mut self.factors, matrix, Par::Seq, stack, Default::default()).is_ok()
    }

    /// Replaces `b` by the solution.
    pub(super) fn solve(&mut self, b: &mut [T]) {
        let factors = LuRef::new_unchecked(&self.symbolic, &self.factors);
        let rows = b.len();
        let b = MatMut::from_column_major_slice_mut(b, rows, 1);
        factors.solve_in_place_with_conj(Conj::No, b, Par::Seq, MemStack::new(&mut self.memory));
    }
}
