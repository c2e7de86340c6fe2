//! Definitions put into each other: every variable in terms of states, time and inputs.

use std::collections::{BTreeMap, BTreeSet};

use super::definitions::{Definition, Definitions};
use super::{EquationStep, LinearBlock};
use crate::algebra::{Expr, Exprs, Node, Symbol};
use crate::bond_graph::{Kind, Meaning};

/// Linear blocks up to this size are written out.
pub const CLOSED: usize = 3;

/// Sources whose value varies by a law of time or inputs: equations are easier to read with their names.
pub fn named_sources(d: &Definitions) -> BTreeMap<Symbol, Expr> {
    let mut named = BTreeMap::new();
    for element in d.graph.elements.values() {
        let (symbol, value) = match element.kind {
            Kind::EffortSource { value } => (d.graph.bonds[element.ports[0].bond].effort, value),
            Kind::FlowSource { value } => (d.graph.bonds[element.ports[0].bond].flow, value),
            _ => continue,
        };
        let outside = |s: &Symbol| {
            matches!(d.meaning(*s), Some(Meaning::Time | Meaning::Parameter(_) | Meaning::Input(_) | Meaning::Held(_)))
        };
        let symbols = d.x.symbols_of(value);
        let given = d.of.get(&symbol) == Some(&Definition::Explicit(value));
        let plain = matches!(d.x.node(value), Node::Symbol(_));
        if given && !plain && !d.is_constant(value) && symbols.iter().all(outside) {
            named.insert(symbol, value);
        }
    }
    named
}

/// Every variable in terms of states, time, inputs, named sources and what stays implicit.
///
/// `None` if the search for short forms is over before all are found: [`Exprs::bound_search`].
pub fn expansions(
    d: &mut Definitions,
    steps: &[EquationStep],
    rates: &BTreeSet<Symbol>,
    named: &BTreeMap<Symbol, Expr>,
) -> Option<BTreeMap<Symbol, Expr>> {
    let mut known: BTreeMap<Symbol, Expr> = BTreeMap::new();
    for step in steps {
        if d.x.search_is_over() {
            return None;
        }
        match step {
            EquationStep::Assign { symbol, value } if !named.contains_key(symbol) => {
                let value = put_in(&mut d.x, *value, &known);
                known.insert(*symbol, value);
            }
            EquationStep::Linear(block)
                if block.unknowns.len() <= CLOSED && !block.unknowns.iter().any(|u| rates.contains(u)) =>
            {
                let LinearBlock { unknowns, matrix, right, .. } = &**block;
                let matrix = matrix.map(|&e| put_in(&mut d.x, e, &known)).dense(crate::algebra::ZERO);
                let matrix: Vec<Vec<Expr>> = matrix.chunks(unknowns.len()).map(<[Expr]>::to_vec).collect();
                let right: Vec<Expr> = right.iter().map(|&e| put_in(&mut d.x, e, &known)).collect();
                let values = cramer(&mut d.x, &matrix, &right);
                known.extend(unknowns.iter().copied().zip(values));
            }
            _ => {}
        }
    }
    Some(known)
}

/// An expression with what is known put in, in its shortest form.
pub fn put_in(x: &mut Exprs, e: Expr, known: &BTreeMap<Symbol, Expr>) -> Expr {
    let e = x.substitute(e, known);
    let e = x.without_settled_terms(e);
    let e = x.simplify(e);
    x.without_settled_terms(e)
}

/// The solution of a small linear system by determinants.
fn cramer(x: &mut Exprs, matrix: &[Vec<Expr>], right: &[Expr]) -> Vec<Expr> {
    let all = determinant(x, matrix);
    let all = x.simplify(all);
    (0..right.len())
        .map(|k| {
            let replaced: Vec<Vec<Expr>> = matrix
                .iter()
                .zip(right)
                .map(|(row, &r)| row.iter().enumerate().map(|(c, &e)| if c == k { r } else { e }).collect())
                .collect();
            let one = determinant(x, &replaced);
            let one = x.simplify(one);
            let quotient = x.div(one, all);
            x.simplify(quotient)
        })
        .collect()
}

/// A determinant by expansion along the first row.
fn determinant(x: &mut Exprs, matrix: &[Vec<Expr>]) -> Expr {
    if let [row] = matrix {
        return row[0];
    }
    let mut terms = Vec::new();
    for (c, &e) in matrix[0].iter().enumerate() {
        let minor: Vec<Vec<Expr>> = matrix[1..]
            .iter()
            .map(|r| r.iter().enumerate().filter(|(k, _)| *k != c).map(|(_, &e)| e).collect())
            .collect();
        let minor = determinant(x, &minor);
        let term = x.mul(&[e, minor]);
        terms.push(if c % 2 == 0 { term } else { x.neg(term) });
    }
    x.add(&terms)
}
