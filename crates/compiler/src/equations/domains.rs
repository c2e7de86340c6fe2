//! Where laws have a value: what a logarithm, a root or a table may be asked for.

use std::collections::BTreeSet;

use super::blocks::elements_of;
use super::definitions::{Definition, Definitions};
use super::{DomainKind, EquationStep, LawDomain, NewtonBlock, State};
use crate::algebra::{Expr, Exprs, Function, Node, Outside, Symbol};
use crate::bond_graph::Meaning;

/// The domains of all that is defined, in the order of the symbols. A law that was inverted has one wherever its values
/// do not reach everywhere: `f = is*(exp(e/vt) - 1)` gives `e` only for `f` above `-is`. What is iterated for has none but those
/// of the equations that are iterated: a current that is `-is` to rounding asks nothing of a law that is never inverted.
pub fn domains(d: &mut Definitions, states: &[State], steps: &[EquationStep]) -> Vec<LawDomain> {
    let mut all = Vec::new();
    let iterated: BTreeSet<Symbol> = iterations(steps).flat_map(|block| block.unknowns.iter().copied()).collect();
    let inside =
        iterations(steps).flat_map(|block| block.body.iter().map(|b| b.1).chain(block.residuals.iter().copied()));
    let partial = inside.filter(|&e| !d.x.total(e)).flat_map(|e| partial_parts(&d.x, e));
    let in_iterations: BTreeSet<Expr> = partial.map(|(argument, _)| argument).collect();
    let states: BTreeSet<Symbol> = states.iter().map(|s| s.symbol).collect();
    let explicit: Vec<(Symbol, Expr)> =
        d.of.iter().filter_map(|(&s, d)| if let Definition::Explicit(e) = d { Some((s, *e)) } else { None }).collect();
    for (symbol, value) in explicit {
        if d.x.total(value) || states.contains(&symbol) {
            continue;
        }
        let of_an_element =
            matches!(d.meaning(symbol), Some(Meaning::Effort(_) | Meaning::Flow(_) | Meaning::Stored(_)));
        let elements = if of_an_element { elements_of(d, &[symbol]) } else { Vec::new() };
        let is_iterated = iterated.contains(&symbol);
        for (argument, kind) in partial_parts(&d.x, value) {
            if is_iterated && !in_iterations.contains(&argument) {
                continue;
            }
            let asked = asked(d, argument);
            let limit = asked.and_then(|asked| limit(d, argument, kind, asked));
            all.push(LawDomain { symbol, elements: elements.clone(), argument, kind, asked, limit });
        }
    }
    all
}

/// The iterations among the steps.
fn iterations(steps: &[EquationStep]) -> impl Iterator<Item = &NewtonBlock> {
    steps.iter().filter_map(|step| if let EquationStep::Newton(block) = step { Some(&**block) } else { None })
}

/// What an expression calls that has no value everywhere, with what must hold of its argument.
fn partial_parts(x: &Exprs, e: Expr) -> Vec<(Expr, DomainKind)> {
    let mut seen = BTreeSet::from([e]);
    let mut open = vec![e];
    let mut found = Vec::new();
    while let Some(e) = open.pop() {
        found.extend(demand(x, e));
        x.node(e).for_each_child(|c| {
            if seen.insert(c) {
                open.push(c);
            }
        });
    }
    found
}

fn demand(x: &Exprs, e: Expr) -> Option<(Expr, DomainKind)> {
    match x.node(e) {
        Node::Call(Function::Log | Function::Log10, a) if !x.positive(a[0]) => Some((a[0], DomainKind::Positive)),
        Node::Call(Function::Sqrt, a) if !x.nonnegative(a[0]) => Some((a[0], DomainKind::NotNegative)),
        Node::Call(Function::Asin | Function::Acos, a) => Some((a[0], DomainKind::Within(-1.0, 1.0))),
        Node::Pow(base, n) if x.is_number(*n).is_none_or(|n| !n.is_integer()) && !x.nonnegative(*base) => {
            Some((*base, DomainKind::NotNegative))
        }
        Node::Table(t, a) if x.table1d(*t).outside() == Outside::Error => {
            let points = x.table1d(*t).x();
            Some((*a, DomainKind::Within(points[0], points[points.len() - 1])))
        }
        _ => None,
    }
}

/// The one variable that an argument reads.
fn asked(d: &Definitions, argument: Expr) -> Option<Symbol> {
    let symbols = d.x.symbols_of(argument);
    let mut varying = symbols.iter().filter(|s| !matches!(d.meaning(**s), Some(Meaning::Parameter(_))));
    varying.next().copied().filter(|_| varying.next().is_none())
}

/// Where the domain ends for the variable asked.
fn limit(d: &mut Definitions, argument: Expr, kind: DomainKind, asked: Symbol) -> Option<Expr> {
    match kind {
        DomainKind::Within(..) => None,
        DomainKind::Positive | DomainKind::NotNegative => {
            let limit = d.solve_for(argument, asked)?;
            d.is_constant(limit).then_some(limit)
        }
    }
}
