//! The determinant of a component of algebraic signals: `det(1 - A)`, with `A` the gains of the edges inside.
//!
//! Without its break variables a component is acyclic. So the determinant is that of the small matrix of gains from
//! break variable to break variable: exact, and short when the breaks are few. Source: Mason; `method.md`, section 3.

use std::collections::BTreeMap;

use super::numeric::{Row, rank, sample};
use crate::algebra::{Expr, Exprs};
use crate::causal_graph::signals::{NodeId, SignalGraph};

/// Components up to this many signals get their determinant as an expression.
const SIGNALS: usize = 600;
/// Components with up to this many break variables get their determinant as an expression.
const BREAKS: usize = 4;

/// The determinant as an expression; `None` for components too large for it to be of use.
pub(super) fn determinant(
    signals: &SignalGraph,
    component: &[NodeId],
    breaks: &[NodeId],
    exprs: &mut Exprs,
) -> Option<Expr> {
    if component.len() > SIGNALS || breaks.len() > BREAKS {
        return None;
    }
    let matrix = break_matrix(signals, component, breaks, exprs);
    let determinant = expand(&matrix, 0, &mut (0..breaks.len()).collect(), exprs);
    let determinant = exprs.simplify(determinant);
    Some(exprs.textbook(determinant))
}

/// `1 - G`: entry `[i][j]` is what break variable `i` gets from break variable `j`, subtracted from the unit matrix.
pub(super) fn break_matrix(
    signals: &SignalGraph,
    component: &[NodeId],
    breaks: &[NodeId],
    exprs: &mut Exprs,
) -> Vec<Vec<Expr>> {
    let order = evaluation_order(signals, component, breaks);
    let zero = exprs.int(0);
    let one = exprs.int(1);
    let mut matrix = vec![vec![zero; breaks.len()]; breaks.len()];
    for (column, &source) in breaks.iter().enumerate() {
        let arriving = transfer(signals, component, source, &order, exprs);
        for (row, sink) in breaks.iter().enumerate() {
            let gain = arriving.get(sink).copied().unwrap_or(zero);
            let unit = if row == column { one } else { zero };
            matrix[row][column] = exprs.sub(unit, gain);
        }
    }
    matrix
}

/// What every signal gets from `source` without passing through a break variable.
fn transfer(
    signals: &SignalGraph,
    component: &[NodeId],
    source: NodeId,
    order: &[NodeId],
    exprs: &mut Exprs,
) -> BTreeMap<NodeId, Expr> {
    let mut terms: BTreeMap<NodeId, Vec<Expr>> = BTreeMap::new();
    let mut value = BTreeMap::new();
    for &node in std::iter::once(&source).chain(order) {
        let here = if node == source {
            exprs.int(1)
        } else {
            let Some(terms) = terms.get(&node) else { continue };
            exprs.add(terms)
        };
        if node != source {
            value.insert(node, here);
        }
        for edge in signals.edges_from(node) {
            if edge.kind.is_algebraic() && component.binary_search(&edge.to).is_ok() {
                let gain = signals.gain(edge, exprs);
                let term = exprs.mul(&[gain, here]);
                terms.entry(edge.to).or_default().push(term);
            }
        }
    }
    for (node, terms) in terms {
        let sum = exprs.add(&terms);
        value.entry(node).or_insert(sum);
    }
    value
}

/// The signals of a component but its break variables, each after those that it is set from.
fn evaluation_order(signals: &SignalGraph, component: &[NodeId], breaks: &[NodeId]) -> Vec<NodeId> {
    let inner = |node: &NodeId| component.binary_search(node).is_ok() && !breaks.contains(node);
    let inner_heads = |node: NodeId| {
        let edges = signals.edges_from(node).iter();
        edges.filter(|edge| edge.kind.is_algebraic()).map(|edge| edge.to).filter(inner).collect::<Vec<_>>()
    };
    let rest: Vec<NodeId> = component.iter().copied().filter(inner).collect();
    let mut waiting: BTreeMap<NodeId, usize> = rest.iter().map(|&node| (node, 0)).collect();
    for &node in &rest {
        inner_heads(node).iter().for_each(|head| *waiting.get_mut(head).expect("inside") += 1);
    }
    let mut order: Vec<NodeId> = rest.iter().copied().filter(|node| waiting[node] == 0).collect();
    let mut done = 0;
    while done < order.len() {
        for head in inner_heads(order[done]) {
            let left = waiting.get_mut(&head).expect("inside");
            *left -= 1;
            if *left == 0 {
                order.push(head);
            }
        }
        done += 1;
    }
    order
}

/// Laplace expansion along the rows, `columns` being those left.
fn expand(matrix: &[Vec<Expr>], row: usize, columns: &mut Vec<usize>, exprs: &mut Exprs) -> Expr {
    if row == matrix.len() {
        return exprs.int(1);
    }
    let mut terms = Vec::new();
    for at in 0..columns.len() {
        let column = columns.remove(at);
        let minor = expand(matrix, row + 1, columns, exprs);
        columns.insert(at, column);
        let term = exprs.mul(&[matrix[row][column], minor]);
        terms.push(if at % 2 == 0 { term } else { exprs.neg(term) });
    }
    exprs.add(&terms)
}

/// Whether the determinant vanishes, for all parameters or at the given ones.
///
/// What varies while running (local gains of nonlinear laws) has no given value: there an arbitrary one is used.
pub(super) fn is_singular(
    signals: &SignalGraph,
    component: &[NodeId],
    determinant: Option<Expr>,
    exprs: &mut Exprs,
) -> bool {
    match determinant {
        Some(determinant) => exprs.is_zero(determinant) || exprs.is_zero_given(determinant),
        None => rank(rows(signals, component, exprs)) < component.len(),
    }
}

/// The rows of `1 - A` as numbers.
fn rows(signals: &SignalGraph, component: &[NodeId], exprs: &mut Exprs) -> Vec<Row> {
    let mut rows: Vec<Row> = (0..component.len()).map(|i| Row::from([(i, 1.0)])).collect();
    for (column, &node) in component.iter().enumerate() {
        for edge in signals.edges_from(node).iter().filter(|edge| edge.kind.is_algebraic()) {
            if let Ok(row) = component.binary_search(&edge.to) {
                let gain = signals.gain(edge, exprs);
                *rows[row].entry(column).or_insert(0.0) -= sample(exprs, gain);
            }
        }
    }
    rows
}
