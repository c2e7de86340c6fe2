//! Freedom that the start values leave is zero in the storages, or what is guessed of them.
//!
//! A constant of the minimal form, and a sum of momenta that is its state, is no storage: if such a sum were zero, a storage
//! beside one that starts with something would start with it too, and other forms would start elsewhere. So the storages
//! behind them start from zero by a condition of their own, unless something that is given reaches them.

use std::collections::{BTreeMap, BTreeSet};

use super::definitions::Definitions;
use super::{Condition, Conserved};
use crate::algebra::{Expr, Symbol, ZERO};
use crate::bond_graph::Kind;
use crate::causal_graph::{CausalGraph, PortState, Role};

/// A state that is a sum of stored quantities.
pub(super) struct Sum {
    /// The state.
    pub state: Symbol,
    /// The sum.
    pub value: Expr,
    /// The co-energy variable of the storage that it is kept for, or a common variable without one.
    pub speed: Symbol,
}

/// The conditions that are missing: `storage = 0`, or its guess. `given` is what the start has to satisfy anyway.
pub(super) fn conditions(
    d: &mut Definitions,
    causal: &CausalGraph,
    conserved: &[Conserved],
    sums: &[Sum],
    given: &[Condition],
) -> Vec<Condition> {
    let begun = !given.is_empty() || !d.graph.guesses.is_empty();
    if sums.is_empty() && (conserved.is_empty() || !begun) {
        return Vec::new();
    }
    let own = own_storages(d, causal, sums);
    let mut leaves: BTreeSet<Symbol> = d.states.keys().copied().collect();
    leaves.extend(conserved.iter().map(|c| c.replaced));
    leaves.retain(|s| !own.contains_key(s));
    leaves.extend(own.values().copied());
    let mut reached = BTreeSet::new();
    for condition in given {
        reached.extend(read(d, condition.residual, &leaves));
    }
    let mut free = BTreeSet::new();
    free.extend(own.values());
    for conserved in conserved {
        free.extend(read(d, conserved.value, &leaves));
        free.extend(own.get(&conserved.replaced).or(Some(&conserved.replaced)));
    }
    free.retain(|s| !reached.contains(s) && !d.missing.contains_key(s));
    let mut begins = |symbol: Symbol| {
        let own = d.x.sym(symbol);
        let value = d.graph.guesses.iter().find(|g| g.what == own).map_or(ZERO, |g| g.value);
        Condition {
            residual: d.x.sub(own, value),
            name: d.x.name(symbol).trim_end_matches('*').to_string(),
            value,
            firm: false,
            span: Default::default(),
        }
    };
    free.into_iter().map(&mut begins).collect()
}

/// For each state that is a sum: what the storage, or the junction, that it is kept for holds itself.
fn own_storages(d: &Definitions, causal: &CausalGraph, sums: &[Sum]) -> BTreeMap<Symbol, Symbol> {
    let ports = causal.ports.ports.iter().filter(|p| p.role == Role::Independent);
    let stored = |port: &PortState| match &causal.graph.elements[port.port.element].kind {
        Kind::Inertance(storage) | Kind::Compliance(storage) => storage.stored.get(port.port.port as usize).copied(),
        _ => None,
    };
    let by_speed: BTreeMap<Symbol, Symbol> = ports.filter_map(|p| Some((p.input, stored(p)?))).collect();
    let own = |sum: &Sum| match by_speed.get(&sum.speed) {
        Some(&stored) => d.x.depends_on(sum.value, stored).then_some((sum.state, stored)),
        None => d.of.contains_key(&sum.speed).then_some((sum.state, sum.speed)),
    };
    sums.iter().filter_map(own).collect()
}

/// The leaves that an expression reads through definitions.
fn read(d: &Definitions, e: Expr, leaves: &BTreeSet<Symbol>) -> BTreeSet<Symbol> {
    let mut found = BTreeSet::new();
    let mut seen = BTreeSet::new();
    let mut open: Vec<Symbol> = d.x.symbols_of(e).into_iter().collect();
    while let Some(symbol) = open.pop() {
        if leaves.contains(&symbol) {
            found.insert(symbol);
        } else if seen.insert(symbol)
            && let Some(definition) = d.of.get(&symbol)
        {
            open.extend(d.x.symbols_of(definition.expr()));
        }
    }
    found
}
