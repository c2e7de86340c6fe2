//! Elimination: linear equations of solve blocks, solved without taking memory.

mod batch;
mod definite;
mod exchanged;
mod full;
mod rank;
mod sparse;

pub(crate) use batch::{BatchFactors, UpperPattern};
pub(crate) use full::Lu;
pub(crate) use rank::RankRevealing;

use std::sync::Arc;

use halfarrow_compiler::program::{Block, Matrix};
use sparse::SparseLu;

/// The matrix of a solve block and its factors.
#[derive(Debug, Clone)]
pub(crate) enum Factors {
    /// As a full matrix; with the places of the entries that may differ from 0.
    Full(Lu, Vec<u32>),
    /// In an order that is fixed.
    Sparse(SparseLu),
    /// Those that another block has made serve, as long as a routine makes them; whether the matrix is symmetric.
    Borrowed(Arc<Matrix>, bool),
}

impl Factors {
    /// Room for the matrix of a block; where it borrows factors of another one, as soon as it has to make them itself.
    pub fn new(block: &Block) -> Factors {
        match block {
            Block::Linear { shared: Some(_), matrix, .. } => Factors::Borrowed(matrix.clone(), block.is_symmetric()),
            _ => Factors::of(block.matrix(), block.is_symmetric()),
        }
    }

    fn of(matrix: &Matrix, symmetric: bool) -> Factors {
        let n = matrix.values.size();
        match &matrix.factors {
            Some(symbolic) => Factors::Sparse(SparseLu::new(symbolic.clone(), symmetric)),
            None => {
                let places = matrix.values.pattern().places().map(|(row, column)| (row * n + column) as u32);
                Factors::Full(Lu::new(n, symmetric), places.collect())
            }
        }
    }

    /// Takes up the entries of the matrix, row by row, and factors it; `Err(unknown)` if no pivot is left for that, or if
    /// an entry is not finite.
    pub fn factor(&mut self, entries: impl Iterator<Item = f64>) -> Result<(), usize> {
        match self {
            Factors::Full(lu, places) => {
                let matrix = lu.matrix();
                places.iter().zip(entries).for_each(|(&place, entry)| matrix[place as usize] = entry);
                lu.factor()
            }
            Factors::Sparse(lu) => lu.factor(entries),
            Factors::Borrowed(matrix, symmetric) => {
                *self = Factors::of(matrix, *symmetric);
                self.factor(entries)
            }
        }
    }

    /// Replaces `b` by the solution. The matrix must have been factored.
    pub fn solve(&mut self, b: &mut [f64]) {
        match self {
            Factors::Full(lu, _) => lu.solve(b),
            Factors::Sparse(lu) => lu.solve(b),
            Factors::Borrowed(..) => unreachable!("it was factored"),
        }
    }

    /// The same, of sparse ones without refinement: for Newton's method, whose next correction refines this one.
    pub fn solve_once(&mut self, b: &mut [f64]) {
        match self {
            Factors::Full(lu, _) => lu.solve(b),
            Factors::Sparse(lu) => lu.solve_once(b),
            Factors::Borrowed(..) => unreachable!("it was factored"),
        }
    }

    /// Replaces `b` by the solution of the equations with the matrix transposed. It must have been factored.
    pub fn solve_transposed(&mut self, b: &mut [f64]) {
        match self {
            Factors::Full(lu, _) => lu.solve_transposed(b),
            Factors::Sparse(lu) => lu.solve_transposed(b),
            Factors::Borrowed(..) => unreachable!("it was factored"),
        }
    }

    /// The logarithm of the magnitude of the determinant of the factored matrix; NaN where it is not known.
    pub fn log_determinant(&self) -> f64 {
        match self {
            Factors::Full(lu, _) => lu.log_determinant(),
            Factors::Sparse(lu) => lu.log_determinant(),
            Factors::Borrowed(..) => f64::NAN,
        }
    }

    /// Whether the determinant of the factored matrix is above zero.
    pub fn is_positive(&self) -> bool {
        match self {
            Factors::Full(lu, _) => lu.is_positive(),
            Factors::Sparse(lu) => lu.is_positive(),
            Factors::Borrowed(..) => false,
        }
    }
}
