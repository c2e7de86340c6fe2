//! The stage: from a causal graph to equations in evaluation order.

use std::collections::{BTreeMap, BTreeSet};

use super::along::{AlgebraicConstraint, Treatment, assemble_all};
use super::assumptions::assumptions;
use super::blocks::{Insoluble, Ordered, order};
use super::breaks::{name_of, open_loops};
use super::definitions::Definitions;
use super::exchanges::{Exchanges, exchanges, may_exchange};
use super::freedom::{self, Sum};
use super::jumps::readable;
use super::minimal::{Assembled, assemble};
use super::momenta::{Momentum, known};
use super::position_relations::position_relations;
use super::positions::{self, Computed, found_by_iteration};
use super::stiff::parameters;
use super::verify::verify;
use super::{
    Algebraic, BreakBound, Conserved, EquationStep, Equations, Form, Position, Relations, State, StateKind,
    Unavailable, conserved, domains, expansion, index, observed, relations,
};
use crate::algebra::{Expr, Exprs, Symbol};
use crate::bond_graph::{BondGraph, BondId, ElementId, Kind, Meaning, PortRef};
use crate::causal_graph::{CausalGraph, Role, Stroke, as_drawn, resistors_first, shares, without_constraints};
use crate::causal_paths::{certificate, eliminated_ports, invert};
use crate::diagnostic::{Diagnostic, Diagnostics, codes};
use crate::ids::{Map, Table};
use crate::span::Span;
use crate::unit::Unit;

/// Derives the equations of a graph in one form.
///
/// Errors: a rate of an input is needed that nobody gives (E001), a loop of variables has no unique solution (E002).
/// Source: `method.md`, sections 4 and 5.
pub fn derive_equations(causal: &CausalGraph, form: Form) -> Result<Equations, Diagnostics> {
    let equations = match form {
        Form::Minimal | Form::Kane => minimal(causal, form, usize::MAX),
        Form::Inverted => inverted(causal),
        Form::Break | Form::Relaxed => classical(causal, form),
        Form::Lagrange => lagrange(causal),
        Form::Stiff => stiff(causal),
    }?;
    debug_assert_eq!(verify(&equations), Ok(()), "{} in form {form:?}", causal.graph.name);
    Ok(equations)
}

/// The minimal form, in which constants stand for at most so many states; others that are conserved stay states.
///
/// Errors: as [`derive_equations`].
pub fn derive_minimal(causal: &CausalGraph, conserved: usize) -> Result<Equations, Diagnostics> {
    let equations = minimal(causal, Form::Minimal, conserved)?;
    debug_assert_eq!(verify(&equations), Ok(()), "{}", causal.graph.name);
    Ok(equations)
}

/// Independent variables alone: one explicit equation each.
fn minimal(causal: &CausalGraph, form: Form, constants: usize) -> Result<Equations, Diagnostics> {
    let graph = &causal.graph;
    let momenta = form == Form::Minimal;
    let mut assembled =
        assemble(causal, momenta).map_err(|(symbol, reason)| needs_rate(graph, &graph.exprs, symbol, &reason))?;
    let positions = positions::eliminate(&mut assembled, causal);
    let exchanged = may_exchange(&assembled, causal);
    let conserved = if momenta { conserved::eliminate(&mut assembled, constants, exchanged) } else { Vec::new() };
    let before = assembled.d.x.assumed();
    let relations = relations::relations(&mut assembled, causal);
    assembled.d.x.forget_unwatched(&before);
    let unordered =
        UnorderedEquations { conserved, positions, relations, ..UnorderedEquations::of(assembled, Vec::new()) };
    order_equations(causal, causal, form, unordered)
}

/// All storages along the strokes, dependent ones with multipliers.
fn classical(causal: &CausalGraph, form: Form) -> Result<Equations, Diagnostics> {
    let strokes = if form == Form::Relaxed { resistors_first(causal) } else { causal.strokes.clone() };
    along(causal, &strokes, form, &|_| Treatment::Multiplier, Treatment::Multiplier)
}

/// All storages, those on zero-order paths in derivative causality.
fn inverted(causal: &CausalGraph) -> Result<Equations, Diagnostics> {
    let inverted = invert(causal);
    let gone = eliminated_ports(causal, &inverted);
    let treat = |port| if gone.contains(&port) { Treatment::Eliminated } else { Treatment::Free };
    let form = |treat, speeds| along(causal, &inverted.strokes, Form::Inverted, treat, speeds);
    let mut equations = form(&treat, Treatment::Free).or_else(|_| form(&|_| Treatment::Free, Treatment::Multiplier))?;
    equations.certificate = Some(certificate(causal, &inverted));
    Ok(equations)
}

fn along(
    causal: &CausalGraph,
    strokes: &Table<BondId, Stroke>,
    form: Form,
    treat: &dyn Fn(PortRef) -> Treatment,
    speeds: Treatment,
) -> Result<Equations, Diagnostics> {
    let drawn = as_drawn(causal, strokes);
    let graph = &drawn.graph;
    let (mut assembled, mut constraints) = assemble_all(&drawn, treat, speeds)
        .map_err(|(symbol, reason)| needs_rate(graph, &graph.exprs, symbol, &reason))?;
    constraints.extend(assembled.open_laws(&drawn));
    let d = &mut assembled.d;
    let rates: BTreeSet<Symbol> = assembled.states.iter().map(|s| d.states[&s.symbol]).collect();
    let mut wanted = rates.clone();
    constraints.iter().for_each(|c| wanted.extend(d.x.symbols_of(c.residual)));
    let closed = rates.into_iter().chain(d.derived_rates()).collect();
    let (breaks, bound) = open_loops(d, strokes, &wanted, &closed);
    constraints.extend(breaks);
    order_equations(
        &drawn,
        causal,
        form,
        UnorderedEquations { breaks: bound, ..UnorderedEquations::of(assembled, constraints) },
    )
}

/// All storages and constraints in the solved structure, each relation among them with a multiplier.
fn lagrange(causal: &CausalGraph) -> Result<Equations, Diagnostics> {
    let open = without_constraints(causal);
    let (assembled, constraints) = constrained(&open)?;
    order_equations(&open, causal, Form::Lagrange, UnorderedEquations::of(assembled, constraints))
}

/// The same with a stiff spring and a damper for each multiplier.
fn stiff(causal: &CausalGraph) -> Result<Equations, Diagnostics> {
    let mut open = without_constraints(causal);
    let springs = parameters(&mut open);
    let (mut assembled, constraints) = constrained(&open)?;
    let constraints = assembled.relax(&open, &springs, constraints);
    order_equations(&open, causal, Form::Stiff, UnorderedEquations::of(assembled, constraints))
}

fn constrained(open: &CausalGraph) -> Result<(Assembled<'_>, Vec<AlgebraicConstraint>), Diagnostics> {
    let graph = &open.graph;
    let (mut assembled, mut constraints) = assemble_all(open, &|_| Treatment::Multiplier, Treatment::Multiplier)
        .map_err(|(symbol, reason)| needs_rate(graph, &graph.exprs, symbol, &reason))?;
    constraints.extend(assembled.open_constraints(open));
    Ok((assembled, constraints))
}

/// A form before its steps are in order.
struct UnorderedEquations<'a> {
    assembled: Assembled<'a>,
    constraints: Vec<AlgebraicConstraint>,
    conserved: Vec<Conserved>,
    positions: Vec<Computed>,
    relations: Relations,
    breaks: BreakBound,
}

impl<'a> UnorderedEquations<'a> {
    /// Nothing conserved, no relations known, no break variables.
    fn of(assembled: Assembled<'a>, constraints: Vec<AlgebraicConstraint>) -> UnorderedEquations<'a> {
        UnorderedEquations {
            assembled,
            constraints,
            conserved: Vec::new(),
            positions: Vec::new(),
            relations: Relations::default(),
            breaks: BreakBound::default(),
        }
    }
}

/// Puts everything into order. `truth` is the graph with its exact ports.
fn order_equations(
    causal: &CausalGraph,
    truth: &CausalGraph,
    form: Form,
    unordered: UnorderedEquations,
) -> Result<Equations, Diagnostics> {
    let graph = &causal.graph;
    let UnorderedEquations { mut assembled, constraints, conserved, positions, relations, breaks } = unordered;
    let momenta = assembled.momenta(truth);
    let jumps = assembled.jumps(truth, form)?;
    let exchanges = match form {
        Form::Minimal => exchanges(&mut assembled, truth, &conserved),
        _ => Exchanges::default(),
    };
    let Assembled { mut d, states, rows, balances, .. } = assembled;
    drop((rows, balances));
    let mut share_of = BTreeMap::new();
    for share in shares(&mut d.x, truth, |s| d.missing.contains_key(&s)) {
        d.set(share.symbol, share.value);
        share_of.insert(share.of, share.symbol);
    }
    d.spread_missing();
    let rates: BTreeSet<Symbol> = states.iter().map(|s| d.states[&s.symbol]).collect();
    for state in &states {
        if let Some(reason) = d.missing.get(&d.states[&state.symbol]) {
            return Err(needs_rate(graph, &d.x, state.symbol, reason));
        }
    }
    if form == Form::Minimal
        && let Some(unknown) = source_without_value(causal, &d)
    {
        return Err(unknown);
    }
    let mut roots = rates.clone();
    for constraint in &constraints {
        let read = d.x.symbols_of(constraint.residual);
        if let Some((symbol, reason)) = read.iter().find_map(|s| d.missing.get_key_value(s)) {
            return Err(needs_rate(graph, &d.x, *symbol, reason));
        }
        roots.extend(read);
    }
    let given: BTreeSet<Symbol> = causal.ports.ports.iter().filter(|p| is_law(p.role)).map(|p| p.input).collect();
    let mut ordered = sort(&mut d, &roots, &rates, &given).map_err(|insoluble| no_solution(&d, &insoluble))?;
    ordered.named.iter().for_each(|&(symbol, value)| d.set(symbol, value));
    d.positions = found_by_iteration(&positions, &ordered.steps);
    if let Some(lost) = lost_in_itself(&d) {
        return Err(through_itself(graph, &d.x, lost));
    }
    // A divisor vanishes where any number of times it does.
    let mut watched = BTreeSet::new();
    let readers = if causal.ports.watched.is_empty() { BTreeMap::new() } else { readers(&d) };
    for &pivot in &causal.ports.watched {
        let (_, pivot) = d.x.primitive(pivot);
        if !watched.insert(pivot) {
            continue;
        }
        let read = d.x.symbols_of(pivot);
        let elements: BTreeSet<ElementId> = read.iter().filter_map(|s| readers.get(s)).flatten().copied().collect();
        ordered.steps.push(EquationStep::Guard { pivot, elements: elements.into_iter().collect() });
    }
    let momenta = known(&d, momenta).into_iter();
    let of_the_bond = |d: &Definitions, symbol| of_the_bond(d, truth, symbol);
    let momenta = momenta.map(|m| Momentum { speed: of_the_bond(&d, m.speed), ..m }).collect();
    let tracked: Vec<Symbol> = states.iter().map(|s| of_the_bond(&d, s.tracked)).collect();
    let conserved = conserved.into_iter();
    let conserved = conserved.map(|c| Conserved { replaced: of_the_bond(&d, c.replaced), ..c }).collect();
    let free_rates: BTreeSet<Symbol> = rates.intersection(&d.free).copied().collect();
    let sums: Vec<Sum> = states.iter().filter(|s| s.meaning.is_some()).map(|s| Sum { speed: s.tracked }).collect();
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
    let positions: Vec<Position> = positions.iter().map(|computed| position(&mut d, computed)).collect();
    let (algebraic, mut residuals) = unknowns(&d, truth, &constraints);
    without_cancelling_terms(&mut d, &states, &algebraic, &ordered.steps, &mut residuals);
    // Forms with constraints left in them go by the minimal one at events.
    let jumps = jumps.filter(|_| residuals.is_empty());
    readable(&mut d, form, jumps.as_ref())?;
    let observed = observed::observed(&mut d, &states, &positions, &share_of);
    // The other forms start as the minimal one does.
    let own_start = form.is_explicit();
    let mut conditions = if own_start { observed::conditions(&mut d, &positions) } else { Vec::new() };
    if own_start {
        let free = freedom::conditions(&mut d, causal, &sums, &conditions);
        conditions.extend(free);
    }
    let guesses = if own_start { observed::guesses(&mut d) } else { Vec::new() };
    let domains = domains::domains(&mut d, &states, &ordered.steps);
    let implicit = ordered.steps.iter().flat_map(|s| match s {
        EquationStep::Newton(block) => block.unknowns.clone(),
        _ => Vec::new(),
    });
    let implicit = implicit.collect();
    let ports = &truth.ports.ports;
    let dependent: Vec<Symbol> = match form {
        Form::Minimal | Form::Kane => ports.iter().filter(|p| p.role == Role::Dependent).map(|p| p.output).collect(),
        _ => Vec::new(),
    };
    let dof = ports.iter().filter(|p| p.role == Role::Independent).count() + truth.ports.virtual_speeds.len();
    let index::Indices { index, indices, counts } =
        index::indices(&mut d, &states, &algebraic, &ordered.steps, &residuals);
    let assumptions = assumptions(&mut d.x, graph);
    let (position_relations, unkept_relations) = match residuals.is_empty() {
        true => position_relations(&mut d, &states, &positions),
        false => Default::default(),
    };
    Ok(Equations {
        form,
        graph: graph.with_exprs(d.x),
        states,
        positions,
        algebraic,
        residuals,
        conserved,
        relations,
        position_relations,
        unkept_relations,
        steps: ordered.steps,
        observed,
        conditions,
        guesses,
        domains,
        definitions: d.of,
        rows: ordered.rows,
        of_loops: ordered.named.iter().map(|n| n.0).collect(),
        dependent,
        meanings,
        index,
        indices,
        counts,
        breaks,
        tracked,
        momenta,
        exchanges,
        jumps,
        free_rates,
        certificate: None,
        dof,
        implicit,
        assumptions,
    })
}

/// The variable of the graph: that of the bond that two elements share, for the one that the second of them has of its own;
/// that of the bonds of a junction, for the one that is kept there without a storage.
pub(super) fn of_the_bond(d: &Definitions, causal: &CausalGraph, symbol: Symbol) -> Symbol {
    let kept = causal.ports.virtual_speeds.iter().find(|v| v.speed == symbol);
    let common = |junction| {
        let element = &d.graph.elements[junction];
        let bond = d.graph.common.get(&junction).copied().or(element.ports.first().map(|p| p.bond));
        let bond = &d.graph.bonds[bond?];
        Some(if matches!(element.kind, Kind::One) { bond.flow } else { bond.effort })
    };
    kept.and_then(|v| common(v.junction)).unwrap_or_else(|| d.x.untwinned(symbol))
}

/// A position that constraints determine.
fn position(d: &mut Definitions, computed: &Computed) -> Position {
    let Computed { position, constraint } = computed;
    let symbol = position.symbol;
    Position {
        symbol,
        name: d.x.name(symbol).to_string(),
        constraint: *constraint,
        rate: match d.meaning(symbol) {
            Some(Meaning::Signal(signal)) => d.graph.signals[signal].rate,
            _ => d.x.sym(d.stored[&symbol]),
        },
        by_iteration: d.positions.contains(&symbol),
        unit: unit_of(d.graph, symbol),
        span: span_of(d.graph, symbol, position.kind),
    }
}

/// The algebraic unknowns, and what vanishes: for free rates first, then for these.
fn unknowns(d: &Definitions, truth: &CausalGraph, constraints: &[AlgebraicConstraint]) -> (Vec<Algebraic>, Vec<Expr>) {
    let mut algebraic = Vec::new();
    let mut residuals: Vec<Expr> = constraints.iter().filter(|c| c.unknown.is_none()).map(|c| c.residual).collect();
    for constraint in constraints {
        let Some((symbol, cause)) = constraint.unknown else { continue };
        let tracked = of_the_bond(d, truth, symbol);
        algebraic.push(Algebraic { symbol, tracked, name: name_of(d, symbol), cause, unit: unit_of(d.graph, symbol) });
        residuals.push(constraint.residual);
    }
    (algebraic, residuals)
}

/// Writes out the residuals in which terms of an unknown cancel, where that takes the unknown out of them: added up while
/// running they leave rounding, which would count as a slope.
fn without_cancelling_terms(
    d: &mut Definitions,
    states: &[State],
    algebraic: &[Algebraic],
    steps: &[EquationStep],
    residuals: &mut [Expr],
) {
    let cancelling = index::cancelling(d, states, algebraic, steps, residuals);
    if cancelling.is_empty() {
        return;
    }
    let named = expansion::named_sources(d);
    let rates = states.iter().map(|s| s.rate).collect();
    let Some(known) = expansion::expansions(d, steps, &rates, &named) else { return };
    let unknown: BTreeSet<Symbol> =
        states.iter().flat_map(|s| [s.symbol, s.rate]).chain(algebraic.iter().map(|a| a.symbol)).collect();
    let reads = |d: &Definitions, e: Expr| {
        let near: BTreeSet<Symbol> = d.x.symbols_of(e).into_iter().collect();
        let far = reachable(d, &near).into_iter().flat_map(|s| d.x.symbols_of(d.of[&s].expr()));
        near.iter().copied().chain(far).filter(|s| unknown.contains(s)).collect::<BTreeSet<_>>().len()
    };
    for i in cancelling {
        let written = expansion::put_in(&mut d.x, residuals[i], &known);
        if reads(d, written) < reads(d, residuals[i]) {
            residuals[i] = written;
        }
    }
}

/// A source that reads what the structure does not determine, or one that is a law through what it reads and needs a
/// rate that nobody gives.
fn source_without_value(causal: &CausalGraph, d: &Definitions) -> Option<Diagnostics> {
    let graph = &causal.graph;
    causal.ports.ports.iter().find_map(|port| {
        let element = &graph.elements[port.port.element];
        if !matches!(element.kind, Kind::EffortSource { .. } | Kind::FlowSource { .. }) {
            return None;
        }
        match (d.missing.get(&port.input)?, port.role) {
            (Unavailable::Undetermined, _) => {
                let title = format!("{} reads a variable that is not determined", element.name);
                Some(undetermined(title, element.span))
            }
            (reason @ Unavailable::NeedsRateOf(_), Role::Algebraic(_)) => {
                Some(needs_rate(graph, &d.x, port.input, reason))
            }
            _ => None,
        }
    })
}

fn is_law(role: Role) -> bool {
    matches!(role, Role::Source | Role::Algebraic(_))
}

/// All steps: first what the rates of the states need, then what can be observed besides. Loops of the latter may be
/// insoluble (reactions that nobody determines), unless a source or law (`given`) is among them.
fn sort(
    d: &mut Definitions,
    roots: &BTreeSet<Symbol>,
    rates: &BTreeSet<Symbol>,
    given: &BTreeSet<Symbol>,
) -> Result<Ordered, Insoluble> {
    let needed = reachable(d, roots);
    let mut ordered = order(d, &needed, rates)?;
    loop {
        let rest: Vec<Symbol> = d.of.keys().copied().filter(|s| needed.binary_search(s).is_err()).collect();
        match order(d, &rest, rates) {
            Ok(more) => {
                ordered.steps.extend(more.steps);
                ordered.named.extend(more.named);
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
    let name = x.name(symbol);
    let span = span_of_symbols(graph, &[symbol]);
    Diagnostic::error(codes::E002, format!("{name} is only defined through itself"), span, "it acts here")
        .note("a source reads an effort or flow that exists only as the answer to that source")
        .hint("put an R there instead of the source, or let the source read through a filter, `state y' = (x - y)/tau`")
        .into()
}

fn needs_rate(graph: &BondGraph, x: &Exprs, symbol: Symbol, reason: &Unavailable) -> Diagnostics {
    let name = x.name(x.undotted(symbol).0).to_string();
    let input = match reason {
        Unavailable::NeedsRateOf(input) => input.clone(),
        Unavailable::Unsolvable => return through_itself(graph, x, symbol),
        Unavailable::Undetermined => return not_determined(graph, symbol, &name),
        Unavailable::NeedsRateOfUnknown(unknown) => return needs_rate_of_unknown(graph, symbol, &name, unknown).into(),
    };
    let span = graph.inputs.values().find(|i| i.name == *input).map(|i| i.span).unwrap_or_default();
    Diagnostic::error(
        codes::E001,
        format!("the equation of {name} needs the time derivative of {input}"),
        span,
        "nobody says how fast this changes",
    )
    .note(
        "its rate acts there: a signal takes its derivative, or it sets the ratio between storages that depend on each \
         other, whose momenta change with it",
    )
    .hint(format!("pass it through a filter, `state n' = ({input} - n)/tau`, and use n"))
    .into()
}

fn not_determined(graph: &BondGraph, symbol: Symbol, name: &str) -> Diagnostics {
    let span = span_of_symbols(graph, &[symbol]);
    undetermined(format!("the rate of {name} reads a variable that is not determined"), span)
}

fn undetermined(title: String, span: Span) -> Diagnostics {
    Diagnostic::error(codes::E002, title, span, "this needs it")
        .note("nothing in the structure says how large it is: a flow or an effort that circulates, or one that nothing takes up")
        .hint("read another variable, or put an element where this one can do work")
        .into()
}

fn needs_rate_of_unknown(graph: &BondGraph, symbol: Symbol, name: &str, unknown: &str) -> Diagnostic {
    let span = span_of_symbols(graph, &[symbol]);
    let title = format!("the equation of {name} needs the time derivative of {unknown}");
    Diagnostic::error(codes::E001, title, span, "it is read here")
        .note(format!("{unknown} is an algebraic unknown of this form, whose rate is no part of it"))
        .hint("choose the form minimal, which solves for it first")
}

fn no_solution(d: &Definitions, insoluble: &Insoluble) -> Diagnostics {
    let graph = d.graph;
    let name = |&s: &Symbol| d.x.name(s).to_string();
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

/// The elements whose moduli read each symbol.
fn readers(d: &Definitions) -> BTreeMap<Symbol, Vec<ElementId>> {
    let mut readers: BTreeMap<Symbol, Vec<ElementId>> = BTreeMap::new();
    for (id, element) in d.graph.elements.iter() {
        let read = element.kind.moduli().into_iter().flat_map(|modulus| d.x.symbols_of(modulus));
        read.for_each(|symbol| readers.entry(symbol).or_default().push(id));
    }
    readers
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
