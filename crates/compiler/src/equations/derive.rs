//! The stage: from a causal graph to equations in evaluation order.

use std::collections::BTreeSet;

use super::blocks::{Insoluble, Ordered, order};
use super::definitions::Definitions;
use super::minimal::{Assembled, assemble};
use super::{Equations, Form, State, StateKind, Step, Unavailable, conserved, observed};
use crate::algebra::{Exprs, Symbol};
use crate::bond_graph::{BondGraph, ElementId, Meaning};
use crate::causal_graph::{CausalGraph, Role};
use crate::diagnostic::{Diagnostic, Diagnostics, codes};
use crate::ids::Map;
use crate::span::Span;
use crate::unit::Unit;

/// Derives the equations of a graph in one form.
///
/// Errors: a rate of an input is needed that nobody gives (E001), a loop of variables has no unique solution (E002).
/// Source: `method.md`, sections 4 and 5.
pub fn derive_equations(causal: &CausalGraph, form: Form) -> Result<Equations, Diagnostics> {
    let Form::Minimal = form;
    let graph = &causal.graph;
    let mut assembled =
        assemble(causal).map_err(|(symbol, reason)| needs_rate(graph, &graph.exprs, symbol, &reason))?;
    let conserved = conserved::eliminate(&mut assembled, causal);
    let Assembled { mut d, states, .. } = assembled;
    d.spread_missing();
    let rates: BTreeSet<Symbol> = states.iter().map(|s| d.states[&s.symbol]).collect();
    for state in &states {
        if let Some(reason) = d.missing.get(&d.states[&state.symbol]) {
            return Err(needs_rate(graph, &d.x, state.symbol, reason));
        }
    }
    let given: BTreeSet<Symbol> = causal.ports.ports.iter().filter(|p| is_law(p.role)).map(|p| p.input).collect();
    let mut ordered = sort(&mut d, &rates, &given).map_err(|insoluble| no_solution(&d, &insoluble))?;
    if let Some(lost) = lost_in_itself(&d) {
        return Err(through_itself(graph, &d.x, lost));
    }
    for &pivot in &causal.ports.watched {
        ordered.steps.push(Step::Watch { pivot, elements: readers(&d, pivot) });
    }
    let meanings: Vec<_> = states.iter().filter_map(|s| s.meaning.map(|m| (s.symbol, m))).collect();
    let states: Vec<State> = states
        .into_iter()
        .map(|s| State {
            symbol: s.symbol,
            rate: d.states[&s.symbol],
            name: observed::state_name(&d, s.symbol, s.meaning),
            kind: s.kind,
            unit: unit_of(graph, s.symbol),
            span: span_of(graph, s.symbol, s.kind),
        })
        .collect();
    let observed = observed::observed(&mut d, &states);
    let conditions = observed::conditions(&mut d);
    let implicit = ordered.steps.iter().flat_map(|s| match s {
        Step::Newton { unknowns, .. } => unknowns.clone(),
        _ => Vec::new(),
    });
    let implicit = implicit.collect();
    let dependent: Vec<Symbol> =
        causal.ports.ports.iter().filter(|p| p.role == Role::Dependent).map(|p| p.output).collect();
    let dof =
        causal.ports.ports.iter().filter(|p| p.role == Role::Independent).count() + causal.ports.virtual_speeds.len();
    Ok(Equations {
        form,
        graph: graph.with_exprs(d.x),
        states,
        conserved,
        steps: ordered.steps,
        observed,
        conditions,
        definitions: d.of,
        rows: ordered.rows,
        dependent,
        meanings,
        index: 0,
        dof,
        implicit,
    })
}

fn is_law(role: Role) -> bool {
    matches!(role, Role::Source | Role::Algebraic(_))
}

/// All steps: first what the rates of the states need, then what can be observed besides. Loops of the latter may be
/// insoluble (reactions that nobody determines), unless a source or law (`given`) is among them.
fn sort(d: &mut Definitions, rates: &BTreeSet<Symbol>, given: &BTreeSet<Symbol>) -> Result<Ordered, Insoluble> {
    let needed = reachable(d, rates);
    let mut ordered = order(d, &needed, rates)?;
    loop {
        let rest: Vec<Symbol> = d.of.keys().copied().filter(|s| needed.binary_search(s).is_err()).collect();
        match order(d, &rest, rates) {
            Ok(more) => {
                ordered.steps.extend(more.steps);
                return Ok(ordered);
            }
            Err(insoluble) if insoluble.members.iter().any(|s| given.contains(s)) => return Err(insoluble),
            Err(insoluble) => {
                for symbol in insoluble.unknowns {
                    d.missing.insert(symbol, Unavailable::Unsolvable);
                }
                d.spread_missing();
            }
        }
    }
}

/// What these symbols read, near or far, themselves included.
fn reachable(d: &Definitions, from: &BTreeSet<Symbol>) -> Vec<Symbol> {
    let mut seen: Map<Symbol, ()> = Map::new();
    let mut work: Vec<Symbol> = from.iter().copied().collect();
    while let Some(symbol) = work.pop() {
        let Some(definition) = d.of.get(&symbol) else { continue };
        if seen.insert(symbol, ()).is_none() {
            work.extend(d.x.symbols_of(definition.expr()));
        }
    }
    seen.keys().copied().collect()
}

/// An effort or flow that is defined only through itself: what the model does is then not known.
fn lost_in_itself(d: &Definitions) -> Option<Symbol> {
    let of_a_bond = |s: &Symbol| matches!(d.meaning(*s), Some(Meaning::Effort(_) | Meaning::Flow(_)));
    d.missing.iter().find(|(s, why)| **why == Unavailable::Unsolvable && of_a_bond(s)).map(|(s, _)| *s)
}

fn through_itself(graph: &BondGraph, x: &Exprs, symbol: Symbol) -> Diagnostics {
    let name = x.name(symbol).trim_end_matches('*');
    let span = span_of_symbols(graph, &[symbol]);
    Diagnostic::error(codes::E002, format!("{name} is only defined through itself"), span, "it acts here")
        .note("a source reads an effort or flow that exists only as the answer to that source")
        .hint("put an R there instead of the source, or let the source read through a filter, `state y' = (x - y)/tau`")
        .into()
}

fn needs_rate(graph: &BondGraph, x: &Exprs, symbol: Symbol, reason: &Unavailable) -> Diagnostics {
    let name = x.name(symbol).trim_end_matches(['\'', '*']).to_string();
    let input = match reason {
        Unavailable::NeedsRateOf(input) => input.clone(),
        Unavailable::Unsolvable => return through_itself(graph, x, symbol),
        Unavailable::Undetermined => return not_determined(graph, symbol, &name),
    };
    let span = graph.inputs.values().find(|i| i.name == input).map(|i| i.span).unwrap_or_default();
    Diagnostic::error(
        codes::E001,
        format!("the equation of {name} needs the time derivative of {input}"),
        span,
        "nobody says how fast this changes",
    )
    .note("it sets the ratio between storages that depend on each other; when the ratio changes, so do their momenta")
    .hint(format!("pass it through a filter, `state n' = ({input} - n)/tau`, and use n"))
    .into()
}

fn not_determined(graph: &BondGraph, symbol: Symbol, name: &str) -> Diagnostics {
    let span = span_of_symbols(graph, &[symbol]);
    let title = format!("the rate of {name} reads a variable that is not determined");
    Diagnostic::error(codes::E002, title, span, "this needs it")
        .note("nothing in the structure says how large it is: a flow or an effort that circulates, or one that nothing takes up")
        .hint("read another variable, or put an element where this one can do work")
        .into()
}

fn no_solution(d: &Definitions, insoluble: &Insoluble) -> Diagnostics {
    let graph = d.graph;
    let name = |&s: &Symbol| d.x.name(s).trim_end_matches('*').to_string();
    let unknowns: Vec<String> = insoluble.unknowns.iter().map(name).collect();
    let first = insoluble.elements.first();
    let mut fault = Diagnostic::error(
        codes::E002,
        format!("the loop through {} has no unique solution", unknowns.join(", ")),
        first.map_or_else(|| span_of_symbols(graph, &insoluble.unknowns), |&e| graph.elements[e].span),
        "it closes here",
    )
    .note("the determinant of the loop vanishes: what comes back equals what went out")
    .hint("break the loop with a storage or a resistor, or change the gain that closes it");
    for &element in insoluble.elements.iter().skip(1) {
        fault = fault.also(graph.elements[element].span, format!("it passes {}", graph.elements[element].name));
    }
    fault.into()
}

fn span_of_symbols(graph: &BondGraph, symbols: &[Symbol]) -> Span {
    let span = |s: &Symbol| match graph.variables.get(s).map(|v| v.meaning) {
        Some(Meaning::Effort(b) | Meaning::Flow(b)) => Some(graph.bonds[b].span),
        Some(Meaning::Signal(s)) => Some(graph.signals[s].span),
        _ => None,
    };
    symbols.iter().find_map(span).unwrap_or_default()
}

/// The elements whose moduli read what a pivot reads.
fn readers(d: &Definitions, pivot: crate::algebra::Expr) -> Vec<ElementId> {
    use crate::bond_graph::Kind;
    let symbols = d.x.symbols_of(pivot);
    let modulus = |k: &Kind| match k {
        Kind::Transformer { modulus } | Kind::Gyrator { modulus } => Some(*modulus),
        _ => None,
    };
    let reads = |m| d.x.symbols_of(m).iter().any(|s| symbols.contains(s));
    d.graph.elements.iter().filter(|(_, e)| modulus(&e.kind).is_some_and(reads)).map(|(id, _)| id).collect()
}

fn unit_of(graph: &BondGraph, symbol: Symbol) -> Option<Unit> {
    graph.variables.get(&symbol).and_then(|v| v.unit.clone())
}

fn span_of(graph: &BondGraph, symbol: Symbol, kind: StateKind) -> Span {
    match (kind, graph.variables.get(&symbol).map(|v| v.meaning)) {
        (StateKind::Storage(Some(element)), _) => graph.elements[element].span,
        (_, Some(Meaning::Signal(signal))) => graph.signals[signal].span,
        _ => Span::default(),
    }
}
