//! The minimal form: one explicit ODE per degree of freedom. Source: `method.md`, section 5.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use petgraph::unionfind::UnionFind;
use rustc_hash::FxHashMap;

use super::definitions::{Definition, Definitions};
use super::loops::by_gains;
use super::rows::{Among, Rows};
use super::{StateKind, Unavailable};
use crate::algebra::{Expr, Exprs, Node, Symbol, SymbolKind};
use crate::bond_graph::{
    ElementId, IntegratedSignal, Kind, Meaning, PortCausality, PortRef, ResistorLaw, Storage, StorageLaw,
};
use crate::causal_graph::start_point::start_point;
use crate::causal_graph::{CausalGraph, Combination, PortState, Role, Virtual, imposes_effort};

/// A state of the minimal form before it is ordered.
#[derive(Debug, Clone)]
pub struct Chosen {
    /// Its symbol.
    pub symbol: Symbol,
    /// Whose it is.
    pub kind: StateKind,
    /// For a momentum form: what the state is, in stored quantities.
    pub meaning: Option<Expr>,
    /// The variable of the bond graph that tells the state.
    pub tracked: Symbol,
}

/// The definitions of the minimal form.
pub struct Assembled<'a> {
    /// All definitions.
    pub d: Definitions<'a>,
    /// The states, storages in the order of the model, then signals.
    pub states: Vec<Chosen>,
    /// Rows of the junction structure.
    pub rows: Rows<'a>,
    /// What changes the stored quantities behind the states.
    pub balances: Vec<Balance>,
    pub(super) deferred: Vec<DeferredRate>,
    /// Sources that are no constants, as soon as they are looked for.
    moving: Option<Among>,
}

/// What changes a stored quantity, or a combination of stored quantities: `quantity' = row`. Written out by
/// [`Assembled::written_out`], where that is asked for.
#[derive(Debug, Clone)]
pub struct Balance {
    /// The state that stands for it.
    pub state: Symbol,
    /// The quantity, those of dependent storages that follow left out unless it is a momentum.
    own: Expr,
    /// What changes it: the rate of the storage, or the reaction of a speed without one.
    pub rate: Symbol,
    /// The co-energy variable that dependent storages follow, and those that may.
    z: Symbol,
    dependent: Rc<[DependentStorage]>,
    /// Whether `own` is a momentum.
    is_momentum: bool,
}

/// A dependent storage of a group.
#[derive(Debug, Clone, Copy)]
pub(super) struct DependentStorage {
    z: Symbol,
    stored: Symbol,
    rate: Symbol,
}

/// The dependent storages of a group.
fn dependent_of(group: &[&StoragePort]) -> Rc<[DependentStorage]> {
    let dependent = group.iter().filter(|c| c.state.role == Role::Dependent);
    dependent.map(|c| DependentStorage { z: c.z, stored: c.stored, rate: c.rate }).collect()
}

/// A rate whose definition waits until all states are known.
pub(super) enum DeferredRate {
    /// The rate of the state `z` makes the rate of `X(z)` equal to what the bond carries.
    Speed { z: Symbol, rate: Symbol, stored: Expr, bond: Symbol },
    /// The rate of a dependent storage follows by differentiating what defines its stored quantity.
    Dependent { rate: Symbol, stored: Symbol },
    /// The rate of the state is free: the bond carries the rate of `X`.
    Free { stored: Expr, bond: Symbol },
    /// `pi' = structure + S'^T X_d`.
    Momentum { rate: Symbol, structure: Expr, followers: Vec<Follower>, z: Symbol },
}

impl DeferredRate {
    /// Whether it is the rate of the speed `z`.
    pub(super) fn is_speed_of(&self, z: Symbol) -> bool {
        matches!(self, DeferredRate::Speed { z: own, .. } if *own == z)
    }
}

/// A storage port with all that its equations need.
pub(super) struct StoragePort<'a> {
    pub(super) state: &'a PortState,
    pub(super) storage: &'a Storage,
    pub(super) law: StorageLaw,
    /// Stored quantity, co-energy variable and rate, as the port has them.
    pub(super) stored: Symbol,
    pub(super) z: Symbol,
    pub(super) rate: Symbol,
    inertance: bool,
}

/// Writes down what defines every variable. Errors name the variable that has no value and why.
///
/// With `momenta`, sums of stored quantities are states where a source moves a dependent storage.
pub fn assemble<'a>(causal: &'a CausalGraph, momenta: bool) -> Result<Assembled<'a>, (Symbol, Unavailable)> {
    let graph = &causal.graph;
    let mut d = Definitions::new(graph.exprs.clone(), graph);
    for &symbol in &causal.ports.undetermined {
        d.missing.insert(symbol, Unavailable::Undetermined);
    }
    d.of_laws = variables_of_laws(causal);
    let mut rows = rows_of(&mut d, causal);
    for (symbol, row) in rows.definitions(&mut d.x) {
        let value = row.expr(&mut d.x);
        d.set(symbol, value);
    }
    if !causal.ports.loops.is_empty() {
        let mut point = start_point(&d.x, graph);
        causal.ports.loops.iter().for_each(|own| by_gains(&mut d, own, &mut rows, &mut point));
    }
    let mut assembled = Assembled::with_rows(d, rows);
    assembled.imposed_and_algebraic(causal);
    assembled.storages(causal, momenta);
    assembled.signals();
    assembled.rates()?;
    assembled.d.define_user_rates();
    Ok(assembled)
}

/// The rows of a graph, without sources whose value is zero.
pub(super) fn rows_of<'a>(d: &mut Definitions, causal: &'a CausalGraph) -> Rows<'a> {
    let mut zero = BTreeSet::new();
    for state in causal.ports.ports.iter().filter(|p| matches!(p.role, Role::Source | Role::Redundant)) {
        let value = imposed(&mut d.x, causal, state);
        if d.x.is_zero(value) {
            zero.insert(state.input);
        }
    }
    Rows::new(causal, zero)
}

/// What algebraic laws give and take.
pub(super) fn variables_of_laws(causal: &CausalGraph) -> BTreeSet<Symbol> {
    let laws = causal.ports.ports.iter().filter(|p| matches!(p.role, Role::Algebraic(_)));
    laws.flat_map(|p| [p.input, p.output]).collect()
}

/// The value that a port imposes.
pub(super) fn imposed(x: &mut Exprs, causal: &CausalGraph, state: &PortState) -> Expr {
    match &causal.graph.elements[state.port.element].kind {
        Kind::EffortSource { value } | Kind::FlowSource { value } => *value,
        Kind::ZeroCompliance { flow } => *flow,
        Kind::Compliance(storage) => match storage.laws[state.port.port as usize] {
            StorageLaw::Known { displacement, law } => {
                let stored = storage.stored[state.port.port as usize];
                x.substitute(law, &BTreeMap::from([(stored, displacement)]))
            }
            _ => x.int(0),
        },
        _ => x.int(0),
    }
}

impl<'a> Assembled<'a> {
    fn with_rows(d: Definitions<'a>, rows: Rows<'a>) -> Self {
        Assembled { d, states: Vec::new(), rows, balances: Vec::new(), deferred: Vec::new(), moving: None }
    }

    /// Definitions without states yet.
    pub(super) fn empty(d: Definitions<'a>) -> Self {
        Assembled::with_rows(d, Rows::none())
    }

    /// Sources, constraints and algebraic laws give their variable.
    pub(super) fn imposed_and_algebraic(&mut self, causal: &'a CausalGraph) {
        let graph = &causal.graph;
        for state in &causal.ports.ports {
            match state.role {
                Role::Source | Role::Redundant => {
                    let value = match self.gives_what_it_imposes(causal, state) {
                        true => imposed(&mut self.d.x, causal, state),
                        // A constraint that repeats others and is dropped carries nothing.
                        false => self.d.x.int(0),
                    };
                    self.d.set(state.input, value);
                    if let Kind::Compliance(storage) = &graph.elements[state.port.element].kind
                        && let StorageLaw::Known { displacement, .. } = storage.laws[state.port.port as usize]
                    {
                        self.d.set(storage.stored[state.port.port as usize], displacement);
                    }
                }
                Role::Algebraic(causality) => self.algebraic(causal, state, causality),
                Role::Independent | Role::Dependent => {}
            }
        }
    }

    fn gives_what_it_imposes(&self, causal: &CausalGraph, state: &PortState) -> bool {
        let effort = causal.graph.bonds[causal.graph.bond_of(state.port)].effort;
        let gives_effort = self.d.x.untwinned(state.input) == effort;
        imposes_effort(&causal.graph, state.port).is_none_or(|imposes| imposes == gives_effort)
    }

    fn algebraic(&mut self, causal: &'a CausalGraph, state: &PortState, causality: PortCausality) {
        let graph = &causal.graph;
        let bond = &graph.bonds[graph.bond_of(state.port)];
        let residual = match &graph.elements[state.port.element].kind {
            Kind::Resistor(laws) | Kind::SkewGyrator(laws) => match laws[state.port.port as usize] {
                ResistorLaw::Resistive(e) => (bond.effort, e, PortCausality::Resistive),
                ResistorLaw::Conductive(f) => (bond.flow, f, PortCausality::Conductive),
                ResistorLaw::Implicit(residual) => {
                    let residual = self.own(causal, state, residual);
                    return self.d.set_root(state.input, residual);
                }
            },
            // A source whose value depends on what it sets.
            Kind::EffortSource { value } => (bond.effort, *value, PortCausality::Resistive),
            Kind::FlowSource { value } => (bond.flow, *value, PortCausality::Conductive),
            Kind::ResidualEffort { residual: Some(r) } | Kind::ResidualFlow { residual: Some(r) } => {
                let residual = self.own(causal, state, *r);
                return self.d.set_root(state.input, residual);
            }
            _ => return self.met_by_the_other(causal, state, causality),
        };
        let (given, law, written) = residual;
        let law = self.own(causal, state, law);
        if written == causality {
            return self.d.set_law(state.input, law, state.output);
        }
        // Written the other way round: the law gives what the junction structure gives too.
        let given = self.d.x.sym(given);
        let given = self.own(causal, state, given);
        self.d.set_equal(state.input, given, law);
    }

    /// A constraint that is met as a law: it gives what it imposes, or an unknown that makes the imposed variable right.
    fn met_by_the_other(&mut self, causal: &CausalGraph, state: &PortState, causality: PortCausality) {
        let value = imposed(&mut self.d.x, causal, state);
        let gives_effort = causality == PortCausality::Resistive;
        if imposes_effort(&causal.graph, state.port) == Some(gives_effort) {
            return self.d.set(state.input, value);
        }
        let held = self.d.x.sym(state.output);
        let residual = self.d.x.sub(held, value);
        self.d.of.insert(state.input, Definition::Implicit(residual));
    }

    /// An expression of a law with the variables that this port itself has where two elements share a bond.
    fn own(&mut self, causal: &CausalGraph, state: &PortState, e: Expr) -> Expr {
        let bond = &causal.graph.bonds[causal.graph.bond_of(state.port)];
        if [bond.effort, bond.flow].contains(&state.input) {
            return e;
        }
        let effort_in = self.d.x.untwinned(state.output) == bond.effort;
        let (effort, flow) = if effort_in { (state.output, state.input) } else { (state.input, state.output) };
        let (effort, flow) = (self.d.x.sym(effort), self.d.x.sym(flow));
        self.d.x.substitute(e, &BTreeMap::from([(bond.effort, effort), (bond.flow, flow)]))
    }

    /// Storages, one group of mutually dependent ones after the other.
    fn storages(&mut self, causal: &'a CausalGraph, momenta: bool) {
        let storage_ports: Vec<StoragePort<'a>> =
            causal.ports.ports.iter().filter_map(|state| self.storage_port(causal, state)).collect();
        for storage_port in &storage_ports {
            self.d.stored.insert(storage_port.stored, storage_port.rate);
        }
        let speeds = &causal.ports.virtual_speeds;
        for (members, group_speeds) in groups(&mut self.d.x, &storage_ports, speeds, &mut self.rows) {
            let group: Vec<&StoragePort> = members.iter().map(|&m| &storage_ports[m]).collect();
            if group.iter().all(|c| c.state.role == Role::Independent) && group_speeds.is_empty() {
                group.iter().for_each(|storage_port| self.independent(storage_port));
            } else if !momenta || self.in_velocity_form(&group) {
                self.velocity_form(&group, &group_speeds);
            } else {
                self.momentum_form(&group, &group_speeds);
            }
        }
        self.sort_states();
    }

    /// Storages in the order of the model.
    pub(super) fn sort_states(&mut self) {
        let place = |c: &Chosen| match c.kind {
            StateKind::Storage(Some(element)) => element.0,
            _ => u32::MAX,
        };
        self.states.sort_by_key(place);
    }

    pub(super) fn storage_port<'c>(
        &mut self,
        causal: &'c CausalGraph,
        state: &'c PortState,
    ) -> Option<StoragePort<'c>> {
        if !matches!(state.role, Role::Independent | Role::Dependent) {
            return None;
        }
        let element = &causal.graph.elements[state.port.element];
        let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &element.kind else { return None };
        let port = state.port.port as usize;
        let (z, rate) = match state.role {
            Role::Independent => (state.input, state.output),
            _ => (state.output, state.input),
        };
        let law = match storage.laws[port] {
            StorageLaw::Integral(e) => StorageLaw::Integral(self.own(causal, state, e)),
            StorageLaw::Derivative(e) => StorageLaw::Derivative(self.own(causal, state, e)),
            StorageLaw::Implicit(e) => StorageLaw::Implicit(self.own(causal, state, e)),
            known => known,
        };
        let inertance = matches!(element.kind, Kind::Inertance(_));
        Some(StoragePort { state, storage, law, stored: storage.stored[port], z, rate, inertance })
    }

    /// `X` as an expression of co-energy variables, if it can be written down.
    pub(super) fn stored_of(&mut self, storage_port: &StoragePort) -> Option<Expr> {
        match storage_port.law {
            StorageLaw::Derivative(e) => Some(e),
            StorageLaw::Integral(e) => {
                let z = self.d.x.sym(storage_port.z);
                let residual = self.d.x.sub(z, e);
                let others =
                    storage_port.storage.stored.iter().any(|s| *s != storage_port.stored && self.d.x.depends_on(e, *s));
                let inverse = if others { None } else { self.d.solve_for(residual, storage_port.stored) };
                inverse.filter(|&e| !self.d.x.is_steep(e))
            }
            StorageLaw::Implicit(e) => self.d.solve_for(e, storage_port.stored),
            StorageLaw::Known { .. } => None,
        }
    }

    /// `m` of a linear inertance `X = m z` with constant `m`.
    fn constant_inertance(&mut self, storage_port: &StoragePort) -> Option<Expr> {
        if !storage_port.inertance {
            return None;
        }
        let stored = self.stored_of(storage_port)?;
        let symbols: Vec<Symbol> = storage_port.storage_speeds(&self.d).into_iter().collect();
        let (coefficients, rest) = self.d.x.linear_in(stored, &symbols)?;
        let constant = coefficients.iter().all(|&c| self.d.is_constant(c)) && self.d.x.is_zero(rest);
        constant.then_some(stored)
    }

    fn choose(&mut self, storage_port: &StoragePort, symbol: Symbol) {
        let kind = StateKind::Storage(Some(storage_port.state.port.element));
        self.states.push(Chosen { symbol, kind, meaning: None, tracked: symbol });
    }

    /// A storage on which no other depends: flow of a linear inertance, stored quantity of anything else.
    pub(super) fn independent(&mut self, storage_port: &StoragePort) {
        let alone = dependent_of(&[]);
        if let Some(stored) = self.constant_inertance(storage_port) {
            return self.by_speed(storage_port, stored, &alone);
        }
        match storage_port.law {
            StorageLaw::Integral(e) => {
                self.by_stored(storage_port, &alone);
                self.d.set(storage_port.z, e);
            }
            StorageLaw::Derivative(e) => {
                let stored = self.d.x.sym(storage_port.stored);
                let residual = self.d.x.sub(stored, e);
                let inverse = self.d.solve_for(residual, storage_port.z);
                let single = storage_port.storage.laws.len() == 1;
                match inverse.filter(|_| single) {
                    Some(z) => {
                        self.by_stored(storage_port, &alone);
                        self.d.set(storage_port.z, z);
                    }
                    None => self.by_speed(storage_port, e, &alone),
                }
            }
            StorageLaw::Implicit(e) => {
                self.by_stored(storage_port, &alone);
                self.d.set_root(storage_port.z, e);
            }
            StorageLaw::Known { .. } => {}
        }
    }

    /// State `X`, whose rate the bond carries.
    fn by_stored(&mut self, storage_port: &StoragePort, dependent: &Rc<[DependentStorage]>) {
        self.d.stored_state(storage_port.stored);
        self.choose(storage_port, storage_port.stored);
        let own = self.d.x.sym(storage_port.stored);
        self.balances.push(storage_port.balance(storage_port.stored, own, dependent));
    }

    /// State `z`: its rate makes the rate of `X(z)` equal to what the bond carries.
    fn by_speed(&mut self, storage_port: &StoragePort, stored: Expr, dependent: &Rc<[DependentStorage]>) {
        self.d.set(storage_port.stored, stored);
        let rate = self.d.state(storage_port.z);
        self.choose(storage_port, storage_port.z);
        self.deferred.push(DeferredRate::Speed { z: storage_port.z, rate, stored, bond: storage_port.rate });
        self.balances.push(storage_port.balance(storage_port.z, stored, dependent));
    }

    /// A balance over its quantity and what changes it, inputs of the junction structure other than rates of dependent
    /// storages; `None` if dependent storages do not follow constantly.
    pub fn written_out(&mut self, balance: &Balance) -> Option<(Expr, Combination)> {
        let followers = self.followers(balance.z, &balance.dependent);
        if followers.iter().any(|f| !self.d.is_constant(f.factor)) {
            return None;
        }
        let mut row = self.rows.own(&mut self.d.x, balance.rate)?;
        row.0.retain(|t| followers.iter().all(|f| f.rate != t.0));
        let mut terms = vec![balance.own];
        for f in followers.iter().filter(|_| !balance.is_momentum) {
            let stored = self.d.x.sym(f.stored);
            terms.push(self.d.x.mul(&[f.factor, stored]));
        }
        Some((self.d.x.add(&terms), row))
    }

    /// Whether all dependent storages of its group follow by constant ratios.
    pub fn follows_constantly(&mut self, balance: &Balance) -> bool {
        balance.dependent.iter().all(|storage| {
            let row = self.rows.of(&mut self.d.x, storage.z);
            row.is_none_or(|row| row.0.iter().all(|t| self.d.is_constant(t.1)))
        })
    }

    /// The dependent storages of a group that read `z`.
    fn followers(&mut self, z: Symbol, dependent: &[DependentStorage]) -> Vec<Follower> {
        let follower = |c: &DependentStorage| {
            let factor = self.rows.of(&mut self.d.x, c.z)?.coefficient(z)?;
            Some(Follower { factor, stored: c.stored, rate: c.rate })
        };
        dependent.iter().filter_map(follower).collect()
    }

    /// Whether a group can be written with speeds (or stored quantities) of the independent storages as states: no
    /// varying source enters, no law jumps, and every law gives `X` from `z`.
    fn in_velocity_form(&mut self, group: &[&StoragePort]) -> bool {
        let dependent = group.iter().filter(|c| c.state.role == Role::Dependent);
        let constant_sources = dependent.clone().all(|storage_port| !self.is_moved(storage_port.z));
        let steady = !group.iter().any(|storage_port| storage_port.may_jump(&self.d));
        steady && constant_sources && group.iter().all(|storage_port| self.stored_of(storage_port).is_some())
    }

    /// Whether a source that is no constant stands in the row of a variable.
    fn is_moved(&mut self, z: Symbol) -> bool {
        if self.moving.is_none() {
            let varies = |p: &&PortState| self.d.of.get(&p.input).is_some_and(|of| !self.d.is_constant(of.expr()));
            self.moving = Some(Among::new(self.rows.sources().filter(varies).map(|p| p.input).collect()));
        }
        self.moving.as_mut().is_some_and(|moving| self.rows.is_made_of(&mut self.d.x, z, moving))
    }

    /// States are speeds of linear inertances and stored quantities of other storages; rates of dependent ones follow by
    /// differentiating what they depend on.
    fn velocity_form(&mut self, group: &[&StoragePort], speeds: &[Virtual]) {
        let dependent = dependent_of(group);
        for storage_port in group {
            match (storage_port.state.role, self.stored_of(storage_port), storage_port.law) {
                (Role::Dependent, stored, _) => {
                    match stored {
                        Some(stored) => self.d.set(storage_port.stored, stored),
                        None => self.dependent_by_law(storage_port),
                    }
                    self.deferred
                        .push(DeferredRate::Dependent { rate: storage_port.rate, stored: storage_port.stored });
                }
                (_, stored, StorageLaw::Integral(law)) => match self.constant_inertance(storage_port).and(stored) {
                    Some(stored) => self.by_speed(storage_port, stored, &dependent),
                    None => {
                        self.by_stored(storage_port, &dependent);
                        self.d.set(storage_port.z, law);
                    }
                },
                (_, Some(stored), _) => self.by_speed(storage_port, stored, &dependent),
                (_, None, _) => {
                    self.by_stored(storage_port, &dependent);
                    let residual = self.law_residual(storage_port);
                    self.d.set_root(storage_port.z, residual);
                }
            }
        }
        for v in speeds {
            let rate = self.d.state(v.speed);
            let element = Some(v.junction);
            self.states.push(Chosen {
                symbol: v.speed,
                kind: StateKind::Storage(element),
                meaning: None,
                tracked: v.speed,
            });
            // Nothing stands there to take the reaction: what acts on the dependent storages balances itself.
            let reaction = self.d.of[&v.reaction].expr();
            let balance = self.d.x.neg(reaction);
            self.d.of.insert(rate, Definition::Implicit(balance));
        }
    }

    /// States are `pi = X_i + S^T X_d`: no rate of a source is asked for, no law has to be inverted.
    fn momentum_form(&mut self, group: &[&StoragePort], speeds: &[Virtual]) {
        let dependent = dependent_of(group);
        for storage_port in group.iter().filter(|c| c.state.role == Role::Dependent) {
            match self.stored_of(storage_port) {
                Some(stored) => self.d.set(storage_port.stored, stored),
                None => self.dependent_by_law(storage_port),
            }
            // While running nothing needs the rates of dependent storages; who looks at them gets them by differentiation.
            self.deferred.push(DeferredRate::Dependent { rate: storage_port.rate, stored: storage_port.stored });
        }
        for storage_port in group.iter().filter(|c| c.state.role == Role::Independent) {
            let (port, graph) = (storage_port.state.port, self.d.graph);
            let place = (port.element, graph.port_name(port));
            let stored = Some(storage_port.stored);
            let (sum, state) = self.momentum_state(stored, storage_port.z, storage_port.rate, place, &dependent);
            let own = self.d.x.sub(state, sum);
            self.d.set(storage_port.stored, own);
            match storage_port.law {
                StorageLaw::Integral(law) => self.d.set(storage_port.z, law),
                _ => {
                    let residual = self.law_residual(storage_port);
                    self.d.set_root(storage_port.z, residual);
                }
            }
        }
        for v in speeds {
            let place = (v.junction, self.d.graph.elements[v.junction].name.clone());
            let (sum, state) = self.momentum_state(None, v.speed, v.reaction, place, &dependent);
            let residual = self.d.x.sub(state, sum);
            self.d.set_root(v.speed, residual);
        }
    }

    /// `X` of a dependent storage from its law as written. Where the inverse has an infinite slope the law is solved for `X`
    /// by iteration, and its rate from the law's own slope.
    fn dependent_by_law(&mut self, storage_port: &StoragePort) {
        let residual = self.law_residual(storage_port);
        match self.d.solve_for(residual, storage_port.stored) {
            Some(inverse) if self.d.x.is_steep(inverse) => {
                self.d.of.insert(storage_port.stored, Definition::Implicit(residual));
            }
            _ => self.d.set_root(storage_port.stored, residual),
        }
    }

    /// `0 = …` in `X` and `z`.
    fn law_residual(&mut self, storage_port: &StoragePort) -> Expr {
        match storage_port.law {
            StorageLaw::Integral(e) => {
                let z = self.d.x.sym(storage_port.z);
                self.d.x.sub(z, e)
            }
            StorageLaw::Derivative(e) => {
                let stored = self.d.x.sym(storage_port.stored);
                self.d.x.sub(stored, e)
            }
            StorageLaw::Implicit(e) => e,
            StorageLaw::Known { displacement, .. } => displacement,
        }
    }

    /// Declares the state `pi` of a port or junction, with its rate; gives `Σ S X_d` and `pi` as expressions.
    fn momentum_state(
        &mut self,
        stored: Option<Symbol>,
        z: Symbol,
        rate: Symbol,
        (element, place): (ElementId, String),
        dependent: &Rc<[DependentStorage]>,
    ) -> (Expr, Expr) {
        let followers = self.followers(z, dependent);
        let pi = self.d.x.made_of(SymbolKind::Momentum(z), &format!("{place}.pi"));
        let state = self.d.x.sym(pi);
        let dependent = Rc::clone(dependent);
        self.balances.push(Balance { state: pi, own: state, rate, z, dependent, is_momentum: true });
        let d = &mut self.d;
        let pi_rate = d.state(pi);
        let mut sum = Vec::new();
        for f in &followers {
            let stored = d.x.sym(f.stored);
            sum.push(d.x.mul(&[f.factor, stored]));
        }
        let sum = d.x.add(&sum);
        let own = stored.map_or(d.x.int(0), |s| d.x.sym(s));
        let meaning = d.x.add(&[own, sum]);
        // pi' = what the bond of the independent storage carries without the rates of dependent ones, and S'^T X_d.
        let mut structure = self.rows.of(&mut d.x, rate).cloned().unwrap_or_default();
        structure.0.retain(|t| followers.iter().all(|f| f.rate != t.0));
        let structure = structure.expr(&mut d.x);
        self.deferred.push(DeferredRate::Momentum { rate: pi_rate, structure, followers, z });
        let kind = StateKind::Storage(Some(element));
        self.states.push(Chosen { symbol: pi, kind, meaning: Some(meaning), tracked: z });
        (sum, state)
    }

    /// Integrated signals; one that repeats a stored quantity is read from it.
    pub(super) fn signals(&mut self) {
        let graph = self.d.graph;
        for signal in graph.signals.values() {
            if let Some(value) = self.repeated(signal) {
                self.d.set(signal.symbol, value);
                continue;
            }
            let rate = self.d.state(signal.symbol);
            self.d.set(rate, signal.rate);
            let symbol = signal.symbol;
            self.states.push(Chosen { symbol, kind: StateKind::Signal, meaning: None, tracked: symbol });
        }
    }
}

impl Assembled<'_> {
    /// A signal that repeats a stored quantity, read from it: with the same start value or a constant distance to it.
    fn repeated(&mut self, signal: &IntegratedSignal) -> Option<Expr> {
        let &Node::Symbol(rate) = self.d.x.node(signal.rate) else { return None };
        let (&stored, _) = self.d.stored.iter().find(|(_, r)| **r == rate)?;
        let reset = |s| self.d.graph.clauses.iter().flat_map(|c| &c.actions).any(|a| a.target == s);
        if reset(stored) || reset(signal.symbol) {
            return None;
        }
        let own = self.d.x.sym(stored);
        let Some(start) = signal.initial else { return Some(own) };
        let Some(Meaning::Stored(port)) = self.d.meaning(stored) else { return None };
        let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &self.d.graph.elements[port.element].kind else {
            return None;
        };
        let first = storage.initial.iter().find(|i| i.symbol == stored)?.value;
        let distance = self.d.x.sub(start, first);
        Some(self.d.x.add(&[own, distance]))
    }

    /// Defines the rates that were put off.
    pub(super) fn rates(&mut self) -> Result<(), (Symbol, Unavailable)> {
        for rate in std::mem::take(&mut self.deferred) {
            let d = &mut self.d;
            match rate {
                DeferredRate::Speed { z, rate, stored, bond } => {
                    let change = d.rate(stored).map_err(|reason| (z, reason))?;
                    let bond = d.x.sym(bond);
                    let residual = d.x.sub(change, bond);
                    d.of.insert(rate, Definition::Implicit(residual));
                }
                DeferredRate::Free { stored, bond } => {
                    let change = d.rate(stored).map_err(|reason| (bond, reason))?;
                    d.set(bond, change);
                }
                DeferredRate::Dependent { rate, stored } => {
                    let definition = d.of[&stored];
                    match (d.rate(definition.expr()), definition) {
                        (Ok(change), Definition::Explicit(_)) => d.set(rate, change),
                        (Ok(change), Definition::Implicit(_)) => d.set_root(rate, change),
                        (Err(reason), _) => {
                            d.missing.insert(rate, reason);
                        }
                    }
                }
                DeferredRate::Momentum { rate, structure, followers, z } => {
                    let mut sum = vec![structure];
                    for f in followers {
                        let slope = d.rate(f.factor).map_err(|reason| (z, reason))?;
                        let stored = d.x.sym(f.stored);
                        sum.push(d.x.mul(&[slope, stored]));
                    }
                    let value = d.x.add(&sum);
                    d.set(rate, value);
                }
            }
        }
        Ok(())
    }
}

/// A dependent storage seen from an independent one: `z_d = factor · z + …`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Follower {
    factor: Expr,
    stored: Symbol,
    rate: Symbol,
}

impl StoragePort<'_> {
    /// What changes the quantity `own` behind `state`, and the dependent ones that follow it.
    fn balance(&self, state: Symbol, own: Expr, dependent: &Rc<[DependentStorage]>) -> Balance {
        let dependent = Rc::clone(dependent);
        Balance { state, own, rate: self.rate, z: self.z, dependent, is_momentum: false }
    }

    /// Whether its law may jump while what it stores moves steadily: at an instant, with another variable, with an input.
    pub(super) fn may_jump(&self, d: &Definitions) -> bool {
        let law = match self.law {
            StorageLaw::Integral(law) | StorageLaw::Derivative(law) | StorageLaw::Implicit(law) => law,
            StorageLaw::Known { .. } => return false,
        };
        let own = self.storage_speeds(d);
        let of_others = |s: Symbol| !own.contains(&s) && !self.storage.stored.contains(&s);
        d.x.may_leap_by(law, &of_others)
            || d.x.depends_on_any(law, &|s| matches!(d.meaning(s), Some(Meaning::Input(_) | Meaning::Held(_))))
    }

    /// The co-energy symbols of all ports of the storage.
    fn storage_speeds(&self, d: &Definitions) -> BTreeSet<Symbol> {
        let ports = 0..self.storage.laws.len() as u32;
        let port = |port| PortRef { element: self.state.port.element, port };
        let mut all: BTreeSet<Symbol> =
            ports.filter_map(|p| d.graph.storage_symbols(port(p))).map(|(z, _)| z).collect();
        all.insert(self.z);
        all
    }
}

/// Storages that depend on each other, or are ports of one field, with the virtual speeds among them.
pub(super) fn groups(
    x: &mut Exprs,
    storage_ports: &[StoragePort],
    speeds: &[Virtual],
    rows: &mut Rows,
) -> Vec<(Vec<usize>, Vec<Virtual>)> {
    let mut index: FxHashMap<Symbol, usize> = storage_ports.iter().enumerate().map(|(i, c)| (c.z, i)).collect();
    index.extend(speeds.iter().enumerate().map(|(k, v)| (v.speed, storage_ports.len() + k)));
    let mut set = UnionFind::<usize>::new(storage_ports.len() + speeds.len());
    let mut last: BTreeMap<ElementId, usize> = BTreeMap::new();
    for (i, storage_port) in storage_ports.iter().enumerate() {
        if let Some(previous) = last.insert(storage_port.state.port.element, i) {
            set.union(previous, i);
        }
    }
    let dependent = storage_ports.iter().enumerate().filter(|(_, c)| c.state.role == Role::Dependent);
    let dependent: Vec<(usize, Symbol)> = dependent.map(|(i, c)| (i, c.z)).collect();
    if rows.unite(x, &dependent, &index, &mut set).is_none() {
        for (i, z) in dependent {
            for input in rows.inputs_of(x, z) {
                if let Some(&other) = index.get(&input) {
                    set.union(i, other);
                }
            }
        }
    }
    let mut groups: BTreeMap<usize, (Vec<usize>, Vec<Virtual>)> = BTreeMap::new();
    for i in 0..storage_ports.len() {
        groups.entry(set.find(i)).or_default().0.push(i);
    }
    for (k, v) in speeds.iter().enumerate() {
        groups.entry(set.find(storage_ports.len() + k)).or_default().1.push(*v);
    }
    groups.into_values().collect()
}
