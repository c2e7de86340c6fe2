//! What stays as it is where a source or the law of a storage jumps: each stored quantity together with those that follow it,
//! `X + S^T X_d`. Speeds of storages that a source moves do not. Source: `method.md`, 5.4, momentum form.

use super::definitions::Definitions;
use super::minimal::{Assembled, StoragePort, groups, imposed, rows_of};
use super::rows::Among;
use crate::algebra::{Expr, Symbol};
use crate::bond_graph::Meaning;
use crate::causal_graph::{CausalGraph, Combination, PortState, Role};

/// A sum of stored quantities that no jump of a source changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Momentum {
    /// The independent variable it belongs to: the co-energy variable of a storage, or a speed without one.
    pub speed: Symbol,
    /// The sum, in stored quantities of the graph: the same in all forms.
    pub sum: Expr,
    /// Whether a source that is no constant moves one of its storages, or a law of one may jump.
    pub moved: bool,
}

impl Assembled<'_> {
    /// The sums of storages that depend on each other, where a source may move them or a sum is a state. `truth` is the graph with its exact ports, of whose pool that
    /// of these definitions is a continuation.
    pub(super) fn momenta(&mut self, truth: &CausalGraph) -> Vec<Momentum> {
        let mut rows = rows_of(&mut self.d, truth);
        let storage_ports: Vec<StoragePort> =
            truth.ports.ports.iter().filter_map(|state| self.storage_port(truth, state)).collect();
        let moving = rows.sources().filter(|port| is_moving(&mut self.d, truth, port)).map(|port| port.input);
        let mut moving = Among::new(moving.collect());
        let mut all = Vec::new();
        for (members, speeds) in groups(&mut self.d.x, &storage_ports, &truth.ports.virtual_speeds, &mut rows) {
            let dependent: Vec<&StoragePort> =
                members.iter().map(|&m| &storage_ports[m]).filter(|c| c.state.role == Role::Dependent).collect();
            let jumps = members.iter().any(|&m| storage_ports[m].may_jump(&self.d));
            // A storage alone keeps what is its state.
            if dependent.is_empty() && !(jumps && members.iter().any(|&m| self.is_state(storage_ports[m].z))) {
                continue;
            }
            let moved = jumps || dependent.iter().any(|c| rows.is_made_of(&mut self.d.x, c.z, &mut moving));
            // Else the states tell the storages, whatever form they are in.
            if !moved && members.iter().all(|&m| self.stored_of(&storage_ports[m]).is_some()) {
                continue;
            }
            let of_dependent: Vec<Combination> =
                dependent.iter().map(|c| rows.of(&mut self.d.x, c.z).cloned().unwrap_or_default()).collect();
            let independent = members.iter().map(|&m| &storage_ports[m]).filter(|c| c.state.role == Role::Independent);
            let own = independent.map(|c| (c.z, Some(c.stored)));
            for (speed, stored) in own.chain(speeds.iter().map(|v| (v.speed, None))) {
                let mut sum: Vec<Expr> = stored.map(|s| self.d.x.sym(s)).into_iter().collect();
                for (storage_port, row) in dependent.iter().zip(&of_dependent) {
                    if let Some(factor) = row.coefficient(speed) {
                        let stored = self.d.x.sym(storage_port.stored);
                        sum.push(self.d.x.mul(&[factor, stored]));
                    }
                }
                let sum = self.d.x.add(&sum);
                all.push(Momentum { speed, sum, moved });
            }
        }
        all
    }

    fn is_state(&self, symbol: Symbol) -> bool {
        self.states.iter().any(|state| state.symbol == symbol)
    }
}

/// Whether the value of a source may change.
fn is_moving(d: &mut Definitions, truth: &CausalGraph, source: &PortState) -> bool {
    let value = imposed(&mut d.x, truth, source);
    !d.is_constant(value)
}

/// Those that can be computed from what is defined.
pub(super) fn known(d: &Definitions, momenta: Vec<Momentum>) -> Vec<Momentum> {
    let outside =
        |s| matches!(d.meaning(s), Some(Meaning::Time | Meaning::Parameter(_) | Meaning::Input(_) | Meaning::Held(_)));
    let given = |s: Symbol| {
        d.of.contains_key(&s)
            || d.states.contains_key(&s)
            || d.free.contains(&s)
            || d.constants.contains(&s)
            || outside(s)
    };
    let defined = |m: &Momentum| d.x.symbols_of(m.sum).iter().all(|&s| !d.missing.contains_key(&s) && given(s));
    momenta.into_iter().filter(defined).collect()
}
