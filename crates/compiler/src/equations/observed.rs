//! What can be recorded, and what the start has to satisfy.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::hash::BuildHasher;

use hashbrown::HashTable;
use rustc_hash::FxBuildHasher;

use super::definitions::Definitions;
use super::{Guess, InitialCondition, Observed, ObservedKind, Position, State, StateKind, Unavailable};
use crate::algebra::{Expr, Symbol, SymbolKind};
use crate::bond_graph::{BondGraph, HeldKind, Kind, Meaning, Shape};
use crate::unit::Unit;

/// The name of a state: its variable, or the output or `let` that says the same. A sum of stored quantities that has the name of
/// another one, of the independent variables with which a run began, has one of its own.
pub fn state_name(d: &Definitions, symbol: Symbol, meaning: Option<Expr>) -> String {
    let own = d.x.name(symbol);
    let Some(meaning) = meaning else { return own.to_string() };
    let mut named = d.graph.outputs.iter().chain(&d.graph.lets);
    match named.clone().find(|n| n.value == meaning) {
        Some(same) => same.name.clone(),
        None if named.any(|n| n.name == own) => format!("{own}.anew"),
        None => own.to_string(),
    }
}

/// Every variable that can be recorded, states, computed positions and outputs first.
///
/// Efforts with a share in what a constraint at the rates carries, by `shares`, are told with it; what efforts are without it
/// comes last, of all of them: which have a share may depend on what is independent.
pub fn observed(
    d: &mut Definitions,
    states: &[State],
    positions: &[Position],
    shares: &BTreeMap<Symbol, Symbol>,
) -> Vec<Observed> {
    let graph = d.graph;
    let mut whole: BTreeMap<Symbol, Expr> = BTreeMap::new();
    // A multiplier is told as it is: in the bonds of the loop it stands for what acts at the rates.
    let multipliers: BTreeSet<Symbol> = graph.constraints.iter().flat_map(|c| d.x.symbols_of(c.multiplier)).collect();
    for (&symbol, &share) in shares {
        if matches!(d.meaning(symbol), Some(Meaning::Effort(_))) && !multipliers.contains(&symbol) {
            let terms = [symbol, share].map(|s| d.x.sym(s));
            whole.insert(symbol, d.x.add(&terms));
        }
    }
    let mut count = states.len() + positions.len();
    variables(graph, &mut |_, _, _| count += 1);
    let mut all: Vec<Observed> = Vec::with_capacity(count);
    let mut taken: HashTable<u32> = HashTable::new();
    let hash = |name: &str| FxBuildHasher.hash_one(name);
    let mut add = |name: &str, value, (unit, kind, default), is_unique: bool| {
        let at = hash(name);
        if taken.find(at, |&i| *all[i as usize].name == *name).is_none() {
            // A large model has many variables of bonds; their names are no one else's but a state's.
            if !is_unique {
                taken.insert_unique(at, all.len() as u32, |&i| hash(&all[i as usize].name));
            }
            all.push(Observed { name: name.into(), value, unit, kind, default });
        }
    };
    for state in states {
        let value = d.x.sym(state.symbol);
        add(&state.name, Ok(value), (state.unit.clone(), kind_of(d, state), true), false);
    }
    for position in positions {
        let value = d.x.sym(position.symbol);
        let kind = match d.meaning(position.symbol) {
            Some(Meaning::Stored(_)) => ObservedKind::Displacement,
            _ => ObservedKind::Signal,
        };
        add(&position.name, Ok(value), (position.unit.clone(), kind, true), false);
    }
    for (list, default) in [(&graph.outputs, true), (&graph.lets, false)] {
        for named in list {
            let named_value = if whole.is_empty() { named.value } else { d.x.substitute(named.value, &whole) };
            let value = value_of(d, named_value);
            add(&named.name, value, (named.unit.clone(), ObservedKind::Named, default), false);
        }
    }
    for constraint in &graph.constraints {
        if !constraint.drawn {
            let value = value_of(d, constraint.multiplier);
            add(&format!("{}.e", constraint.name), value, (None, ObservedKind::Effort, false), false);
        }
        if constraint.holonomic {
            let drift = value_of(d, constraint.expr);
            add(&format!("{}.drift", constraint.name), drift, (None, ObservedKind::Drift, false), false);
        }
    }
    variables(graph, &mut |name, kind, symbol| {
        let e = whole.get(&symbol).copied().unwrap_or_else(|| d.x.sym(symbol));
        let value = value_of(d, e);
        let unit: Option<Unit> = graph.variables.get(&symbol).and_then(|v| v.unit.clone());
        add(name, value, (unit, kind, false), true);
    });
    for signal in graph.signals.values() {
        let e = d.x.sym(signal.symbol);
        let value = value_of(d, e);
        add(&signal.name, value, (signal.unit.clone(), ObservedKind::Signal, false), false);
    }
    for held in graph.held.values().filter(|h| h.kind.is_discrete()) {
        let e = d.x.sym(held.symbol);
        let unit = graph.variables.get(&held.symbol).and_then(|v| v.unit.clone());
        add(&held.name, Ok(e), (unit, ObservedKind::Signal, held.kind == HeldKind::Discrete), false);
    }
    for input in graph.inputs.values() {
        let e = d.x.sym(input.symbol);
        add(&input.name, Ok(e), (input.unit.clone(), ObservedKind::Input, false), false);
    }
    for named in graph.shapes.iter().flat_map(Shape::values) {
        let value = value_of(d, named.value);
        add(&named.name, value, (named.unit.clone(), ObservedKind::Named, false), false);
    }
    if graph.elements.values().any(|e| e.carries.is_some()) {
        variables(graph, &mut |name, kind, symbol| {
            if kind == ObservedKind::Effort {
                let e = d.x.sym(symbol);
                let unit = graph.variables.get(&symbol).and_then(|v| v.unit.clone());
                add(&bare_name(name), value_of(d, e), (unit, ObservedKind::Bare, false), true);
            }
        });
    }
    debug_assert_eq!(
        all.iter().map(|o| &o.name).collect::<BTreeSet<_>>().len(),
        all.len(),
        "each has a name of its own"
    );
    all
}

/// The name of an effort without what a constraint at the rates puts on it.
pub fn bare_name(name: &str) -> String {
    format!("{name}.bare")
}

/// What a state is.
fn kind_of(d: &Definitions, state: &State) -> ObservedKind {
    let junction = match state.kind {
        StateKind::Storage(Some(element)) => Some(&d.graph.elements[element].kind),
        _ => None,
    };
    match (d.x.kind(state.symbol), d.meaning(d.x.untwinned(state.symbol))) {
        (SymbolKind::Momentum(_), _) => ObservedKind::Sum,
        (SymbolKind::Spring(_), _) => ObservedKind::Spring,
        (_, Some(Meaning::Effort(_))) => ObservedKind::Effort,
        (_, Some(Meaning::Flow(_))) => ObservedKind::Flow,
        (_, Some(Meaning::Stored(port))) => stored_kind(&d.graph.elements[port.element].kind),
        _ => match junction {
            Some(Kind::Zero) => ObservedKind::Effort,
            Some(Kind::One) => ObservedKind::Flow,
            _ => ObservedKind::Signal,
        },
    }
}

fn stored_kind(storage: &Kind) -> ObservedKind {
    if matches!(storage, Kind::Inertance(_)) { ObservedKind::Momentum } else { ObservedKind::Displacement }
}

/// An expression as something to evaluate, or the reason why it has no value.
pub fn value_of(d: &Definitions, e: Expr) -> Result<Expr, Unavailable> {
    for symbol in d.x.symbols_of(e) {
        if let Some(reason) = d.missing.get(&symbol) {
            return Err(reason.clone());
        }
        let given = d.of.contains_key(&symbol)
            || d.states.contains_key(&symbol)
            || d.free.contains(&symbol)
            || is_outside(d, symbol);
        if !given {
            return Err(Unavailable::Undetermined);
        }
    }
    Ok(e)
}

fn is_outside(d: &Definitions, symbol: Symbol) -> bool {
    use crate::bond_graph::Meaning::{Held, Input, Parameter, Time};
    matches!(d.meaning(symbol), Some(Time | Parameter(_) | Input(_) | Held(_)))
}

/// Calls `visit` with the names of all efforts, flows and stored quantities, and their symbols.
fn variables(graph: &BondGraph, visit: &mut dyn FnMut(&str, ObservedKind, Symbol)) {
    use ObservedKind::{Effort, Flow};
    let mut name = String::new();
    let mut visit = |place: &str, variable: &str, kind, symbol| {
        name.clear();
        name.extend([place, variable]);
        visit(&name, kind, symbol);
    };
    for element in graph.elements.values() {
        let name = &element.name;
        let bond = |port: usize| &graph.bonds[element.ports[port].bond];
        match &element.kind {
            Kind::Zero => visit(name, ".e", Effort, bond(0).effort),
            Kind::One => visit(name, ".f", Flow, bond(0).flow),
            kind => {
                for index in 0..element.ports.len() {
                    let place = match element.ports[index].name.as_str() {
                        "" => Cow::Borrowed(name.as_str()),
                        _ => Cow::Owned(element.part_name(index)),
                    };
                    visit(&place, ".e", Effort, bond(index).effort);
                    visit(&place, ".f", Flow, bond(index).flow);
                    match kind {
                        Kind::Inertance(s) => visit(&place, ".p", stored_kind(kind), s.stored[index]),
                        Kind::Compliance(s) => visit(&place, ".q", stored_kind(kind), s.stored[index]),
                        _ => {}
                    }
                }
            }
        }
    }
    for bond in graph.bonds.values().filter(|b| !b.name.is_empty()) {
        visit(&bond.name, ".e", Effort, bond.effort);
        visit(&bond.name, ".f", Flow, bond.flow);
    }
}

/// Where the search of the start begins; not for what has no value.
pub fn guesses(d: &mut Definitions) -> Vec<Guess> {
    let graph = d.graph;
    let mut all = Vec::new();
    for guess in &graph.guesses {
        let symbols = d.x.symbols_of(guess.what);
        // Common flows take part where freedom is left, see `freedom`.
        let flow = |s: &Symbol| matches!(graph.variables.get(s).map(|v| v.meaning), Some(Meaning::Flow(_)));
        if symbols.iter().any(|s| d.missing.contains_key(s) || flow(s)) {
            continue;
        }
        let name = symbols.iter().next().map_or(String::new(), |s| d.x.name(*s).to_string());
        let residual = d.x.sub(guess.what, guess.value);
        all.push(Guess { residual, name, value: guess.value, span: guess.span });
    }
    all
}

/// Start values of storages and signals, and constraints on displacements but for those that hold by definition.
pub fn conditions(d: &mut Definitions, positions: &[Position]) -> Vec<InitialCondition> {
    let graph = d.graph;
    let mut all = Vec::new();
    let mut add = |d: &mut Definitions, symbol: Symbol, value: Expr, span| {
        let own = d.x.sym(symbol);
        let residual = d.x.sub(own, value);
        let name = d.x.name(symbol).to_string();
        all.push(InitialCondition { residual, name, value, firm: false, weak: false, span });
    };
    for element in graph.elements.values() {
        if let Kind::Inertance(storage) | Kind::Compliance(storage) = &element.kind {
            for initial in &storage.initial {
                add(d, initial.symbol, initial.value, initial.span);
            }
        }
    }
    for signal in graph.signals.values() {
        if let Some(value) = signal.initial {
            add(d, signal.symbol, value, signal.span);
        }
    }
    let written: BTreeSet<usize> = positions.iter().filter(|p| !p.by_iteration).map(|p| p.constraint).collect();
    let constraints = graph.constraints.iter().enumerate().filter(|(c, _)| !written.contains(c)).map(|(_, c)| c);
    for constraint in constraints.filter(|c| c.holonomic) {
        let zero = d.x.int(0);
        all.push(InitialCondition {
            residual: constraint.expr,
            name: constraint.name.clone(),
            value: zero,
            firm: true,
            weak: false,
            span: constraint.span,
        });
    }
    all
}
