//! Positions that constraints on displacements determine: computed from the others, not integrated, so that closed loops
//! do not drift. Source: `method.md`, 5.4.

use std::collections::{BTreeMap, BTreeSet};

use super::definitions::Definition;
use super::minimal::{Assembled, Chosen};
use super::{EquationStep, StateKind};
use crate::algebra::{Expr, Node, NumericPoint, Symbol};
use crate::bond_graph::{BondGraph, Constraint, Kind, Meaning};
use crate::causal_graph::start_point::start_point;
use crate::causal_graph::{CausalGraph, Role};
use crate::sparse::Matching;

/// Entries below this part of the greatest of their row count as zero where positions are chosen.
const SMALL: f64 = 1e-6;
/// Entries of a row below this part of what they came from are rounding.
const ROUNDING: f64 = 1e-11;

/// A position that is computed.
#[derive(Debug, Clone)]
pub(super) struct Computed {
    /// What would be a state.
    pub position: Chosen,
    /// The constraint that defines it, by its place among those of the graph.
    pub constraint: usize,
}

/// A constraint with its slopes by states that are positions.
struct Row {
    /// Its place among the constraints of the graph.
    constraint: usize,
    slopes: Vec<(usize, Expr)>,
}

/// Takes from the states as many positions as the constraints determine, and defines them by these; in the order of the
/// states.
pub(super) fn eliminate(assembled: &mut Assembled, causal: &CausalGraph) -> Vec<Computed> {
    let graph = &causal.graph;
    let kept: Vec<usize> = (0..graph.constraints.len()).filter(|&c| holds(causal, &graph.constraints[c])).collect();
    if kept.is_empty() {
        return Vec::new();
    }
    let candidates = candidates(assembled);
    let rows: Vec<Row> = kept.into_iter().filter_map(|c| row(assembled, graph, c, &candidates)).collect();
    let sources: BTreeSet<Symbol> =
        causal.ports.ports.iter().filter(|p| is_source(graph, p)).map(|p| p.input).collect();
    let chosen = chosen(assembled, graph, &rows, (&candidates, &sources));
    let Some(pairs) = matched(&rows, &chosen) else { return Vec::new() };
    let mut constraint_of: BTreeMap<Symbol, usize> =
        pairs.iter().map(|&(at, candidate)| (candidates[candidate].symbol, rows[at].constraint)).collect();
    for (&symbol, &constraint) in &constraint_of {
        assembled.d.states.remove(&symbol);
        assembled.d.computed.insert(symbol);
        define(assembled, symbol, graph.constraints[constraint].expr);
    }
    assembled.balances.retain(|b| !constraint_of.contains_key(&b.state));
    let mut computed = Vec::new();
    for position in std::mem::take(&mut assembled.states) {
        match constraint_of.remove(&position.symbol) {
            Some(constraint) => computed.push(Computed { position, constraint }),
            None => assembled.states.push(position),
        }
    }
    computed
}

/// Defines a position by a constraint: written down where that divides by what is constant, else by iteration.
fn define(assembled: &mut Assembled, position: Symbol, constraint: Expr) {
    let d = &mut assembled.d;
    let root = match d.x.linear_in(constraint, &[position]) {
        Some((slope, _)) if d.is_constant(slope[0]) => d.solve_for(constraint, position),
        _ => None,
    };
    d.of.insert(position, root.map_or(Definition::Implicit(constraint), Definition::Explicit));
}

/// Those of them that iterations find; the others are written down.
pub(super) fn found_by_iteration(computed: &[Computed], steps: &[EquationStep]) -> BTreeSet<Symbol> {
    let unknowns = steps.iter().flat_map(|step| match step {
        EquationStep::Newton(block) => &block.unknowns[..],
        _ => &[],
    });
    let computed: BTreeSet<Symbol> = computed.iter().map(|c| c.position.symbol).collect();
    unknowns.copied().filter(|s| computed.contains(s)).collect()
}

fn is_source(graph: &BondGraph, port: &crate::causal_graph::PortState) -> bool {
    matches!(graph.elements[port.port.element].kind, Kind::EffortSource { .. } | Kind::FlowSource { .. })
}

/// Whether a constraint on displacements acts: one that repeats others says nothing new.
fn holds(causal: &CausalGraph, constraint: &Constraint) -> bool {
    let acts = |p: &&crate::causal_graph::PortState| p.port.element == constraint.element;
    let held = matches!(causal.graph.elements[constraint.element].kind, Kind::ZeroCompliance { .. });
    constraint.holonomic && held && causal.ports.ports.iter().find(acts).is_some_and(|p| p.role == Role::Source)
}

/// States that are positions and that no event sets.
fn candidates(assembled: &Assembled) -> Vec<Chosen> {
    let graph = assembled.d.graph;
    let reset: BTreeSet<Symbol> = graph.clauses.iter().flat_map(|c| &c.actions).map(|a| a.target).collect();
    // An effort that is set may be that of a spring.
    let sets_effort = reset.iter().any(|&s| matches!(assembled.d.meaning(s), Some(Meaning::Effort(_))));
    let is_position = |s: &&Chosen| match assembled.d.meaning(s.symbol) {
        Some(Meaning::Signal(_)) => s.kind == StateKind::Signal,
        Some(Meaning::Stored(port)) => !sets_effort && matches!(graph.elements[port.element].kind, Kind::Compliance(_)),
        _ => false,
    };
    assembled.states.iter().filter(is_position).filter(|s| !reset.contains(&s.symbol)).cloned().collect()
}

/// The slopes of a constraint by positions; `None` if it reads what is no position.
fn row(assembled: &mut Assembled, graph: &BondGraph, constraint: usize, candidates: &[Chosen]) -> Option<Row> {
    let mut e = graph.constraints[constraint].expr;
    // Displacements that follow from states are written by these.
    loop {
        let d = &assembled.d;
        let mut known = BTreeMap::new();
        for symbol in d.x.symbols_of(e) {
            match (d.meaning(symbol)?, d.of.get(&symbol)) {
                (Meaning::Signal(_) | Meaning::Stored(_), Some(Definition::Explicit(value))) => {
                    known.insert(symbol, *value);
                }
                (Meaning::Signal(_) | Meaning::Stored(_), None) if d.states.contains_key(&symbol) => {}
                (Meaning::Parameter(_) | Meaning::Time | Meaning::Input(_) | Meaning::Held(_), _) => {}
                _ => return None,
            }
        }
        if known.is_empty() {
            break;
        }
        e = assembled.d.x.substitute(e, &known);
    }
    let x = &mut assembled.d.x;
    let read = x.symbols_of(e);
    let at = candidates.iter().enumerate().filter(|(_, c)| read.contains(&c.symbol));
    let slopes: Vec<(usize, Expr)> = at.map(|(i, c)| (i, x.derivative(e, c.symbol))).collect();
    let slopes: Vec<_> = slopes.into_iter().filter(|(_, slope)| !x.is_zero(*slope)).collect();
    (!slopes.is_empty()).then_some(Row { constraint, slopes })
}

/// Which positions are computed: those first whose rate is no kept speed, last those whose rate is imposed, by the size of their
/// slopes at the start.
fn chosen(
    assembled: &Assembled,
    graph: &BondGraph,
    rows: &[Row],
    (candidates, sources): (&[Chosen], &BTreeSet<Symbol>),
) -> BTreeSet<usize> {
    let x = &assembled.d.x;
    let mut point = start_point(x, graph);
    let mut open: Vec<BTreeMap<usize, f64>> = rows.iter().map(|row| numbers(assembled, row, &mut point)).collect();
    let kinds: Vec<Speed> = candidates.iter().map(|c| speed(assembled, c.symbol, sources)).collect();
    // Where a run goes on no source lets go of what it moves: at its limit the machine stops.
    let classes = [Speed::Dependent, Speed::Kept, Speed::Imposed];
    let classes = if graph.point.is_some() { &classes[..2] } else { &classes };
    let mut chosen = BTreeSet::new();
    for &class in classes {
        loop {
            let mut best: Option<(f64, usize, usize)> = None;
            for (r, row) in open.iter().enumerate() {
                let most = row.values().fold(0.0f64, |most, v| most.max(v.abs()));
                for (&column, v) in row.iter().filter(|(c, _)| kinds[**c] == class) {
                    let share = v.abs() / most;
                    if share >= SMALL && best.is_none_or(|b| share > b.0) {
                        best = Some((share, r, column));
                    }
                }
            }
            let Some((_, r, column)) = best else { break };
            let pivot = open.swap_remove(r);
            chosen.insert(column);
            open.iter_mut().for_each(|row| subtract(row, &pivot, column));
        }
    }
    chosen
}

fn numbers(assembled: &Assembled, row: &Row, point: &mut NumericPoint) -> BTreeMap<usize, f64> {
    // A slope without a value there is some number.
    let number = |v: f64| if v.is_finite() { v } else { 1.0 };
    row.slopes.iter().map(|&(c, e)| (c, number(point.value(&assembled.d.x, e)))).filter(|(_, v)| *v != 0.0).collect()
}

fn subtract(row: &mut BTreeMap<usize, f64>, pivot: &BTreeMap<usize, f64>, column: usize) {
    let Some(entry) = row.remove(&column) else { return };
    let factor = entry / pivot[&column];
    for (&c, v) in pivot.iter().filter(|(c, _)| **c != column) {
        let own = row.entry(c).or_default();
        let size = own.abs().max((factor * v).abs());
        *own -= factor * v;
        if own.abs() <= ROUNDING * size {
            row.remove(&c);
        }
    }
}

/// What a position integrates.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Speed {
    /// What follows from states.
    Dependent,
    /// A state.
    Kept,
    /// What a source imposes.
    Imposed,
}

fn speed(assembled: &Assembled, position: Symbol, sources: &BTreeSet<Symbol>) -> Speed {
    let d = &assembled.d;
    let mut rate = d.states[&position];
    loop {
        if sources.contains(&rate) {
            return Speed::Imposed;
        }
        if d.states.contains_key(&rate) {
            return Speed::Kept;
        }
        match d.of.get(&rate).map(|of| (of, d.x.node(of.expr()))) {
            Some((Definition::Explicit(_), &Node::Symbol(symbol))) => rate = symbol,
            _ => return Speed::Dependent,
        }
    }
}

/// Each chosen position with the row that defines it: a row that reads it. `None` if there are not as many.
fn matched(rows: &[Row], chosen: &BTreeSet<usize>) -> Option<Vec<(usize, usize)>> {
    let columns: Vec<usize> = chosen.iter().copied().collect();
    let place: BTreeMap<usize, usize> = columns.iter().enumerate().map(|(k, &c)| (c, k)).collect();
    let edges: Vec<Vec<usize>> =
        rows.iter().map(|row| row.slopes.iter().filter_map(|(c, _)| place.get(c).copied()).collect()).collect();
    let mut matching = Matching::new(rows.len().max(columns.len()));
    matching.complete(&edges);
    let pairs: Vec<(usize, usize)> =
        (0..columns.len()).filter_map(|k| Some((matching.row_of[k]?, columns[k]))).collect();
    (pairs.len() == columns.len()).then_some(pairs)
}
