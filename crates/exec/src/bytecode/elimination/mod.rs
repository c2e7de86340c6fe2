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

use halfarrow_compiler::program::Block;
use sparse::SparseLu;

/// The matrix of a solve block and its factors.
#[derive(Debug, Clone)]
pub(crate) enum Factors {
    /// As a full matrix; with the places of the entries that may differ from 0.
    Full(Lu, Vec<u32>),
    /// In an order that is fixed.
    Sparse(SparseLu),
}

impl Factors {
    /// Room for the matrix of a block.
    pub fn new(block: &Block) -> Factors {
        let (n, matrix) = (block.size(), block.matrix());
        match &matrix.factors {
            Some(symbolic) => Factors::Sparse(SparseLu::new(symbolic.clone(), block.is_symmetric())),
            None => {
                let places = matrix.values.pattern().places().map(|(row, column)| (row * n + column) as u32);
                Factors::Full(Lu::new(n, block.is_symmetric()), places.collect())
            }
        }
    }

    /// No room: for blocks whose factors another one has.
    pub fn none() -> Factors {
        Factors::Full(Lu::new(0, false), Vec::new())
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
        }
    }

    /// Replaces `b` by the solution. The matrix must have been factored.
    pub fn solve(&mut self, b: &mut [f64]) {
        match self {
            Factors::Full(lu, _) => lu.solve(b),
            Factors::Sparse(lu) => lu.solve(b),
        }
    }

    /// The same, of sparse ones without refinement: for Newton's method, whose next correction refines this one.
    pub fn solve_once(&mut self, b: &mut [f64]) {
        match self {
            Factors::Full(lu, _) => lu.solve(b),
            Factors::Sparse(lu) => lu.solve_once(b),
        }
    }

    /// Replaces `b` by the solution of the equations with the matrix transposed. It must have been factored.
    pub fn solve_transposed(&mut self, b: &mut [f64]) {
        match self {
            Factors::Full(lu, _) => lu.solve_transposed(b),
            Factors::Sparse(lu) => lu.solve_transposed(b),
        }
    }

    /// The logarithm of the magnitude of the determinant of the factored matrix; NaN where it is not known.
    pub fn log_determinant(&self) -> f64 {
        match self {
            Factors::Full(lu, _) => lu.log_determinant(),
            Factors::Sparse(lu) => lu.log_determinant(),
        }
    }

    /// Whether the determinant of the factored matrix is above zero.
    pub fn is_positive(&self) -> bool {
        match self {
            Factors::Full(lu, _) => lu.is_positive(),
            Factors::Sparse(lu) => lu.is_positive(),
        }
    }
}
