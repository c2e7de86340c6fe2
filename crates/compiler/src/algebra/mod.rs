//! Exact expressions: shared nodes, rationals, zero test, derivative, elimination.
//!
//! Every stage keeps its formulas in one pool, [`Exprs`], in which equal expressions are one entry. Numbers are exact;
//! floats occur in values of tables and in [`Evaluator`] only.

mod antiderivative;
mod assumptions;
mod calculus;
mod construct;
mod cost;
mod elimination;
mod estimate;
mod evaluate;
mod exprs;
mod field;
mod fingerprint;
mod functions;
mod grown;
mod linear;
mod listed;
mod lowest_terms;
pub mod math;
mod needed;
mod node;
mod order;
mod polynomial;
mod precise;
mod properties;
mod rational;
mod residue;
mod rewrite;
mod share;
mod symbol_sets;
mod symbols;
mod table;
mod text;
mod unit_vector;
mod zero;

pub use assumptions::{Assumption, Assumptions, Holds};
pub use cost::Cost;
pub use elimination::{
    BackSubstitution, Coefficients, Elimination, Eliminator, NumericPoint, Pivot, Quality, SparseRow, Zero,
    back_substitute, eliminate,
};
pub use estimate::{Estimate, Estimates};
pub use evaluate::{EvaluationOrder, Evaluator, somewhere};
pub use exprs::{Exprs, MINUS_ONE, ONE, ZERO};
pub(crate) use fingerprint::{mix, near, scattered};
pub use listed::{ListedAssumptions, ListedPool, ListedSymbol};
pub use lowest_terms::LowestTerms;
pub use node::{Comparison, Expr, Facts, Function, Node, Parts, Symbol};
pub use rational::Rational;
pub use residue::{PrimeField, Residue, Residues};
pub use share::Shared;
pub use symbol_sets::Symbols;
pub(crate) use symbols::natural_order;
pub use symbols::{SymbolKind, dotted};
pub use table::{Interpolation, Outside, Table1d, TableError, TableId};
pub use text::{
    Names, Place, PlainNames, Sort, ascii, ascii_within, latex, latex_name, latex_owner, mathml, mathml_name,
    mathml_owner, mathml_within, unicode, unicode_name, unicode_within,
};
pub use unit_vector::unit_vector;

#[cfg(test)]
mod tests;
