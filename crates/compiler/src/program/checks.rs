//! What must hold for the values to mean something: domains of laws, assumptions, divisors.

use super::lower::Lowering;
use super::op::Op;
use super::{Assumption, Holds, LawDomain, PivotGuard, Value, first_of};
use crate::algebra::{self, Expr, Exprs, Function, MINUS_ONE, Node, PlainNames, Symbol, ascii};
use crate::bond_graph::{BondGraph, ElementId};
use crate::equations;

/// An expression whose text is longer is described in messages by what it reads.
const SHORT: usize = 60;

/// An expression as text if it is short, else which symbols of this kind it reads.
pub(super) fn described(exprs: &Exprs, e: Expr, named: &dyn Fn(&Symbol) -> bool) -> String {
    if least_text(exprs, e, SHORT) <= SHORT {
        let text = ascii(exprs, e, &PlainNames(exprs));
        if text.len() <= SHORT {
            return text;
        }
    }
    let read: Vec<&str> = exprs.symbols_of(e).into_iter().filter(named).map(|s| exprs.name(s)).collect();
    format!("an expression in {}", first_of(&read.join(", ")))
}

/// What the text of an expression has at least, as far as that tells whether it has more characters than this: its symbols and
/// numbers. Long numbers take long to write.
fn least_text(exprs: &Exprs, e: Expr, most: usize) -> usize {
    let (mut length, mut open) = (0, vec![e]);
    while let Some(e) = open.pop().filter(|_| length <= most) {
        match exprs.node(e) {
            Node::Symbol(s) => length += exprs.name(*s).len(),
            Node::Add(parts) | Node::Mul(parts) => open.extend(parts.iter().filter(|&&part| part != MINUS_ONE)),
            Node::Pow(part, _) | Node::Whole(part) => open.push(*part),
            _ => length += 1,
        }
    }
    length
}

/// Elements by their names, for messages.
pub(super) fn names(graph: &BondGraph, elements: &[ElementId]) -> String {
    let names: Vec<&str> = elements.iter().map(|&e| graph.elements[e].name.as_str()).collect();
    names.join(", ")
}

/// A domain, if all that it reads is evaluated.
pub(super) fn domain(lower: &mut Lowering, graph: &BondGraph, domain: &equations::LawDomain) -> Option<LawDomain> {
    let name = |s: Symbol| graph.exprs.name(s).to_string();
    let defined = graph.exprs.symbols_of(domain.argument).iter().all(|&s| lower.defined(s).is_some());
    defined.then(|| LawDomain {
        given: name(domain.symbol),
        elements: names(graph, &domain.elements),
        argument: lower.value(domain.argument),
        kind: domain.kind,
        asked: domain.asked.and_then(|s| Some((name(s), lower.defined(s)?))),
        limit: domain.limit.map(|limit| lower.value(limit)),
    })
}

/// An assumption with the value that tells whether it holds; none if it is a divisor that is guarded as it is.
pub(super) fn assumption(
    lower: &mut Lowering,
    graph: &BondGraph,
    pivot_guards: &[PivotGuard],
    of: &algebra::Assumption,
) -> Option<Assumption> {
    let exprs = &graph.exprs;
    let says = match of.holds {
        Holds::Zero => "is zero",
        Holds::NotZero => "is not zero",
        Holds::Positive => "is above zero",
        Holds::NotNegative => "is not below zero",
    };
    let what = described(exprs, of.expr, &|_| true);
    let value = lower.value(of.expr);
    if of.holds == Holds::NotZero && pivot_guards.iter().any(|w| w.pivot == value) {
        return None;
    }
    let sum = matches!(of.holds, Holds::Zero | Holds::NotZero) && !matches!(exprs.node(of.expr), Node::Symbol(_));
    let scale = if sum { magnitude(lower, exprs, of.expr) } else { value };
    Some(Assumption { value, scale, holds: of.holds, text: format!("{what} {says}") })
}

/// What a sum of products comes to if nothing in it cancels.
fn magnitude(lower: &mut Lowering, exprs: &Exprs, e: Expr) -> Value {
    match exprs.node(e) {
        Node::Add(terms) => {
            let mut sum = lower.constant(0.0);
            for &term in terms {
                let size = magnitude(lower, exprs, term);
                sum = lower.add(sum, size);
            }
            sum
        }
        Node::Mul(factors) => {
            let sized = factors.iter().filter(|&&factor| factor != MINUS_ONE);
            let sizes = sized.map(|&factor| magnitude(lower, exprs, factor)).collect::<Vec<_>>();
            let product = sizes.into_iter().reduce(|product, size| lower.op(Op::Mul(product, size)));
            product.expect("a product has factors")
        }
        Node::Number(n) => lower.constant(n.to_f64().abs()),
        _ => {
            let value = lower.value(e);
            lower.op(Op::Call(Function::Abs, value))
        }
    }
}

/// The factors of a divisor that vary or could vanish.
pub(super) fn divisors(exprs: &Exprs, pivot: Expr) -> Vec<Expr> {
    match exprs.node(pivot) {
        Node::Mul(factors) => factors.iter().flat_map(|&f| divisors(exprs, f)).collect(),
        Node::Pow(base, exponent) if exprs.is_number(*exponent).is_some_and(|n| n.signum() > 0) => {
            divisors(exprs, *base)
        }
        Node::Pow(_, exponent) if exprs.is_number(*exponent).is_some() => Vec::new(),
        Node::Number(n) if !n.is_zero() => Vec::new(),
        _ => vec![pivot],
    }
}
