//! Forms that keep all storages: what defines every variable along the drawn strokes, or in the solved structure, and
//! which unknowns are left. Source: `method.md`, sections 3 and 4.

use super::definitions::{Definition, Definitions};
use super::minimal::{Assembled, Chosen, DeferredRate, StoragePort, variables_of_laws};
use super::{AlgebraicRole, StateKind, Unavailable};
use crate::algebra::{Expr, Symbol};
use crate::bond_graph::{Kind, PortRef};
use crate::causal_graph::{CausalGraph, Role};

/// What becomes of a storage in derivative causality.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Treatment {
    /// It integrates like the others; what its bond carries is a multiplier that keeps up its relation to them.
    Multiplier,
    /// Its rate is left free: it is a break variable, and the relation of the storage to the others the equation.
    Free,
    /// It is no unknown: it follows from the others, its rate by differentiation.
    Eliminated,
}

/// An unknown without a rate, and what vanishes for its sake.
#[derive(Debug, Clone, Copy)]
pub struct AlgebraicConstraint {
    /// The unknown; `None` where a free rate of a state takes its place.
    pub unknown: Option<(Symbol, AlgebraicRole)>,
    /// What vanishes.
    pub residual: Expr,
}

/// Writes down what defines every variable, with every storage that `treat` does not eliminate as a state. Independent
/// variables without a storage are unknowns, or if `speeds` is `Free` states with a free rate.
pub fn assemble_all<'a>(
    causal: &'a CausalGraph,
    treat: &dyn Fn(PortRef) -> Treatment,
    speeds: Treatment,
) -> Result<(Assembled<'a>, Vec<AlgebraicConstraint>), (Symbol, Unavailable)> {
    let graph = &causal.graph;
    let mut d = Definitions::new(graph.exprs.clone(), graph);
    for &symbol in &causal.ports.undetermined {
        d.missing.insert(symbol, Unavailable::Undetermined);
    }
    d.of_laws = variables_of_laws(causal);
    for (&symbol, row) in &causal.ports.definitions {
        let value = row.expr(&mut d.x);
        d.set(symbol, value);
    }
    let mut assembled = Assembled::empty(d);
    assembled.imposed_and_algebraic(causal);
    let mut constraints = assembled.all_storages(causal, treat);
    constraints.extend(assembled.virtual_speeds(causal, speeds));
    assembled.signals();
    assembled.rates()?;
    assembled.d.define_user_rates();
    Ok((assembled, constraints))
}

impl<'a> Assembled<'a> {
    fn all_storages(
        &mut self,
        causal: &'a CausalGraph,
        treat: &dyn Fn(PortRef) -> Treatment,
    ) -> Vec<AlgebraicConstraint> {
        let storage_ports: Vec<StoragePort<'a>> =
            causal.ports.ports.iter().filter_map(|state| self.storage_port(causal, state)).collect();
        for storage_port in &storage_ports {
            self.d.stored.insert(storage_port.stored, storage_port.rate);
        }
        let mut constraints = Vec::new();
        for storage_port in &storage_ports {
            match (storage_port.state.role, treat(storage_port.state.port)) {
                (Role::Independent, _) => self.independent(storage_port),
                (_, Treatment::Eliminated) if self.eliminate_storage(storage_port) => {}
                (_, Treatment::Multiplier) => constraints.extend(self.with_multiplier(storage_port)),
                _ => constraints.extend(self.with_free_rate(storage_port)),
            }
        }
        self.sort_states();
        constraints
    }

    /// A storage that follows from others; `false` if its stored quantity cannot be written down.
    fn eliminate_storage(&mut self, storage_port: &StoragePort) -> bool {
        let Some(stored) = self.stored_of(storage_port) else { return false };
        self.d.set(storage_port.stored, stored);
        self.deferred.push(DeferredRate::Dependent { rate: storage_port.rate, stored: storage_port.stored });
        true
    }

    /// Takes away what the structure says of the storage's co-energy variable; it becomes what vanishes.
    fn relation(&mut self, storage_port: &StoragePort) -> Option<Expr> {
        let structure = self.d.of.remove(&storage_port.z)?.expr();
        let own = self.d.x.sym(storage_port.z);
        Some(self.d.x.sub(own, structure))
    }

    fn with_multiplier(&mut self, storage_port: &StoragePort) -> Option<AlgebraicConstraint> {
        let residual = self.relation(storage_port)?;
        self.independent(storage_port);
        if self.d.states.contains_key(&storage_port.stored) {
            // The rate of the stored quantity is the multiplier itself; the state gets a rate of its own name.
            let rate = self.d.rate_symbol(storage_port.stored);
            self.d.states.insert(storage_port.stored, rate);
            let multiplier = self.d.x.sym(storage_port.rate);
            self.d.set(rate, multiplier);
        }
        let element = storage_port.state.port.element;
        self.d.free.insert(storage_port.rate);
        Some(AlgebraicConstraint { unknown: Some((storage_port.rate, AlgebraicRole::Multiplier(element))), residual })
    }

    fn with_free_rate(&mut self, storage_port: &StoragePort) -> Option<AlgebraicConstraint> {
        let residual = self.relation(storage_port)?;
        self.independent(storage_port);
        // By its speed: the bond carries the rate of the stored quantity, whatever the rate of the speed is.
        if let Some(DeferredRate::Speed { stored, bond, .. }) = self.deferred.pop_if(|l| l.is_speed_of(storage_port.z))
        {
            self.deferred.push(DeferredRate::Free { stored, bond });
        }
        self.d.free.insert(self.d.states.get(&storage_port.z).copied().unwrap_or(storage_port.rate));
        Some(AlgebraicConstraint { unknown: None, residual })
    }

    /// Independent variables without a storage: they, or their rates, are unknown, and their reactions vanish.
    fn virtual_speeds(&mut self, causal: &CausalGraph, treatment: Treatment) -> Vec<AlgebraicConstraint> {
        let mut constraints = Vec::new();
        for v in &causal.ports.virtual_speeds {
            let residual = self.d.x.sym(v.reaction);
            let unknown = if treatment == Treatment::Free {
                let rate = self.d.state(v.speed);
                self.d.free.insert(rate);
                let kind = StateKind::Storage(Some(v.junction));
                self.states.push(Chosen { symbol: v.speed, kind, meaning: None, tracked: v.speed });
                None
            } else {
                self.d.free.insert(v.speed);
                Some((v.speed, AlgebraicRole::Multiplier(v.junction)))
            };
            constraints.push(AlgebraicConstraint { unknown, residual });
        }
        self.sort_states();
        constraints
    }

    /// Laws that give no value to what their element sets: that is an unknown.
    pub fn open_laws(&mut self, causal: &CausalGraph) -> Vec<AlgebraicConstraint> {
        self.open(causal, |_| true)
    }

    /// Constraints: what they carry is an unknown.
    pub fn open_constraints(&mut self, causal: &CausalGraph) -> Vec<AlgebraicConstraint> {
        self.open(causal, |kind| !matches!(kind, Kind::Resistor(_) | Kind::SkewGyrator(_)))
    }

    fn open(&mut self, causal: &CausalGraph, test: impl Fn(&Kind) -> bool) -> Vec<AlgebraicConstraint> {
        let mut constraints = Vec::new();
        for state in causal.ports.ports.iter().filter(|p| matches!(p.role, Role::Algebraic(_))) {
            let element = state.port.element;
            let kind = &causal.graph.elements[element].kind;
            if let Some(Definition::Implicit(residual)) = self.d.of.get(&state.input).copied()
                && test(kind)
            {
                self.d.of.remove(&state.input);
                self.d.free.insert(state.input);
                let law = matches!(kind, Kind::Resistor(_) | Kind::SkewGyrator(_));
                let cause = if law { AlgebraicRole::Law(element) } else { AlgebraicRole::Multiplier(element) };
                constraints.push(AlgebraicConstraint { unknown: Some((state.input, cause)), residual });
            }
        }
        constraints
    }
}
