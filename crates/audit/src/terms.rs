//! How great the terms are that a value is made of: what cancels in a sum leaves their rounding.

use halfarrow_compiler::algebra::{Expr, Exprs, Node};

/// A value as sums and products of what is evaluated.
pub(crate) enum Terms {
    /// The place of an evaluated part.
    Part(usize),
    /// A sum.
    Sum(Vec<Terms>),
    /// A product.
    Product(Vec<Terms>),
}

impl Terms {
    /// The terms of an expression; what has to be evaluated is added to `parts`.
    pub fn of(exprs: &Exprs, expr: Expr, parts: &mut Vec<Expr>) -> Terms {
        match exprs.node(expr) {
            Node::Add(terms) => Terms::Sum(terms.iter().map(|&t| Terms::of(exprs, t, parts)).collect()),
            Node::Mul(factors) => Terms::Product(factors.iter().map(|&f| Terms::of(exprs, f, parts)).collect()),
            _ => {
                parts.push(expr);
                Terms::Part(parts.len() - 1)
            }
        }
    }

    /// The sum of the magnitudes of all terms.
    pub fn magnitude(&self, values: &[f64]) -> f64 {
        match self {
            Terms::Part(at) => values[*at].abs(),
            Terms::Sum(terms) => terms.iter().map(|t| t.magnitude(values)).sum(),
            Terms::Product(factors) => factors.iter().map(|f| f.magnitude(values)).product(),
        }
    }
}
