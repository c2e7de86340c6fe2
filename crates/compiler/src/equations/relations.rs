//! How the states of a form move together, whatever the laws of elements say. Source: `method.md`, 5.1.
//!
//! Storages take, and integrated signals integrate, what the junction structure makes of the efforts and flows that
//! elements give: `Σ factor · X' = Σ coefficient · drive`. Where fewer drives than states stand in such rows, the states
//! keep relations that no law and no motion changes: positions that are integrals of one speed, a spring behind a
//! transformer whose modulus reads an angle, the flux of a coil without resistance. Few of them have a closed form; all
//! of them hold along any path that the drives allow.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::{FxHashMap, FxHashSet};

use super::definitions::Definitions;
use super::minimal::{Assembled, Chosen};
use super::rows::without_own;
use crate::algebra::{Expr, Exprs, ONE, Symbol};
use crate::bond_graph::{Kind, Meaning};
use crate::causal_graph::{CausalGraph, Combination, PortState, Role};

/// The rows that share all their drives with others.
#[derive(Debug, Clone, Default)]
pub struct Relations {
    /// The rows, in the order of the states.
    pub rows: Vec<Moved>,
    /// Number of drives.
    pub drives: usize,
    /// Whether there may be rows that are not written out, because all of them together are too long.
    pub unwritten: bool,
}

/// Terms of rows that are written out at most.
const TERMS: usize = 100_000;
/// And of rows on the way to them.
const TERMS_ON_THE_WAY: usize = 10 * TERMS;

/// One row: `Σ factor · quantity' = Σ coefficient · drive`.
#[derive(Debug, Clone)]
pub struct Moved {
    /// Factors and quantities: states, or stored quantities that follow from states.
    pub quantity: Vec<(Expr, Symbol)>,
    /// Drives, by their number, and their coefficients.
    pub by: Vec<(usize, Expr)>,
}

/// Who may set a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Drive {
    /// The element that gives this variable.
    Element(Symbol),
    /// Whatever this state integrates that is no combination of efforts and flows.
    Own(Symbol),
}

/// A row before its drives are numbered.
struct Row {
    quantity: Vec<(Expr, Symbol)>,
    by: BTreeMap<Drive, Expr>,
}

/// Finds the rows of all states, and keeps those that are not free by themselves.
pub(super) fn relations(assembled: &mut Assembled, causal: &CausalGraph) -> Relations {
    let ports = Ports::of(&assembled.d, causal);
    let states = assembled.states.clone();
    let entangled = entangled(assembled, &ports, &states);
    let entangled: Vec<&Chosen> =
        states.iter().zip(entangled).filter(|state| state.1).map(|(state, _)| state).collect();
    if are_long(assembled, &ports, &entangled) {
        return Relations { unwritten: true, ..Relations::default() };
    }
    let mut rows: Vec<Row> = entangled.into_iter().filter_map(|state| row(assembled, &ports, state)).collect();
    // Rows with a drive of their own go wherever the others go.
    let drives: Vec<Vec<Drive>> = rows.iter().map(|row| row.by.keys().copied().collect()).collect();
    let mut left = without_own(&drives).into_iter();
    rows.retain(|_| left.next() == Some(true));
    let drives: BTreeSet<Drive> = rows.iter().flat_map(|r| r.by.keys().copied()).collect();
    let number: BTreeMap<Drive, usize> = drives.into_iter().zip(0..).collect();
    let numbered =
        |r: Row| Moved { quantity: r.quantity, by: r.by.into_iter().map(|(drive, c)| (number[&drive], c)).collect() };
    Relations { drives: number.len(), rows: rows.into_iter().map(numbered).collect(), unwritten: false }
}

/// Whether the rows of these states are too long to be written out.
fn are_long(assembled: &mut Assembled, ports: &Ports, states: &[&Chosen]) -> bool {
    let (mut terms, mut on_the_way) = (0, TERMS_ON_THE_WAY);
    states.iter().filter_map(|state| ports.rate_of(state)).any(|rate| {
        let row = assembled.rows.inputs_within(&mut assembled.d.x, rate, &mut on_the_way);
        terms += row.map_or(TERMS + 1, |row| row.len());
        terms > TERMS
    })
}

/// What the ports are to the rows.
struct Ports<'a> {
    causal: &'a CausalGraph,
    /// Rates of dependent storages, with what they are rates of.
    dependent: FxHashMap<Symbol, Symbol>,
    /// What elements are free to give: co-energies of independent storages, algebraic laws, sources that read what moves.
    free: FxHashSet<Symbol>,
    /// Flows given by sources that read what moves, with their values.
    sources: FxHashMap<Symbol, Expr>,
    /// Independent storages, by co-energy variable and by stored quantity.
    independent: FxHashMap<Symbol, &'a PortState>,
}

impl<'a> Ports<'a> {
    fn of(d: &Definitions, causal: &'a CausalGraph) -> Ports<'a> {
        let mut ports = Ports {
            causal,
            dependent: FxHashMap::default(),
            free: FxHashSet::default(),
            sources: FxHashMap::default(),
            independent: FxHashMap::default(),
        };
        for port in &causal.ports.ports {
            if port.role == Role::Independent {
                ports.independent.extend([(port.input, port)]);
                ports.independent.extend(stored(causal, port).map(|stored| (stored, port)));
            }
            match port.role {
                Role::Dependent => {
                    ports.dependent.extend(stored(causal, port).map(|stored| (port.input, stored)));
                }
                Role::Independent | Role::Algebraic(_) => _ = ports.free.insert(port.input),
                Role::Source | Role::Redundant => {
                    let Some(value) = d.of.get(&port.input).map(|given| given.expr()) else { continue };
                    if !varies(d, value) {
                        continue;
                    }
                    ports.free.insert(port.input);
                    if matches!(causal.graph.elements[port.port.element].kind, Kind::FlowSource { .. }) {
                        ports.sources.insert(port.input, value);
                    }
                }
            }
        }
        ports.free.extend(causal.ports.virtual_speeds.iter().map(|v| v.speed));
        ports
    }

    /// The port of the independent storage behind a state.
    fn port_of(&self, state: &Chosen) -> Option<&'a PortState> {
        self.independent.get(&state.symbol).or_else(|| self.independent.get(&state.tracked)).copied()
    }

    /// What the junction structure makes of it: the rate of the storage, or the reaction of a speed without one.
    fn rate_of(&self, state: &Chosen) -> Option<Symbol> {
        let speeds = &self.causal.ports.virtual_speeds;
        let alone = || speeds.iter().find(|v| v.speed == state.tracked).map(|v| v.reaction);
        self.port_of(state).map(|p| p.output).or_else(alone)
    }
}

fn stored(causal: &CausalGraph, port: &PortState) -> Option<Symbol> {
    match &causal.graph.elements[port.port.element].kind {
        Kind::Inertance(storage) | Kind::Compliance(storage) => storage.stored.get(port.port.port as usize).copied(),
        _ => None,
    }
}

/// Whether an expression may change while time stands still.
fn varies(d: &Definitions, e: Expr) -> bool {
    let still = |s: Symbol| {
        d.constants.contains(&s)
            || matches!(
                d.meaning(s),
                Some(Meaning::Parameter(_) | Meaning::Time | Meaning::Input(_) | Meaning::Held(_))
            )
    };
    d.x.depends_on_any(e, &|s| !still(s))
}

/// Which states may share all their drives with others.
fn entangled(assembled: &Assembled, ports: &Ports, states: &[Chosen]) -> Vec<bool> {
    let moved_by = |state: &Chosen| match assembled.d.meaning(state.symbol) {
        Some(Meaning::Signal(signal)) => {
            let rate = ports.causal.graph.signals[signal].rate;
            assembled.d.x.symbols_of(rate).into_iter().collect()
        }
        _ => ports.rate_of(state).into_iter().collect(),
    };
    let moved_by: Vec<Vec<Symbol>> = states.iter().map(moved_by).collect();
    let is_drive = |p: &PortState| ports.free.contains(&p.input) && !ports.sources.contains_key(&p.input);
    assembled.rows.entangled(&moved_by, is_drive)
}

/// The row of a state; `None` if nothing is known of it, so that it moves as it likes.
fn row(assembled: &mut Assembled, ports: &Ports, state: &Chosen) -> Option<Row> {
    let causal = ports.causal;
    if let Some(Meaning::Signal(signal)) = assembled.d.meaning(state.symbol) {
        let rate = causal.graph.signals[signal].rate;
        let mut sum = Sum { assembled, ports, row: Row { quantity: Vec::new(), by: BTreeMap::new() } };
        sum.row.quantity.push((ONE, state.symbol));
        sum.add_rate(state.symbol, rate)?;
        return sum.finish();
    }
    let port = ports.port_of(state);
    let rate = ports.rate_of(state)?;
    let combination = assembled.rows.alone(&mut assembled.d.x, rate)?;
    let mut sum = Sum { assembled, ports, row: Row { quantity: Vec::new(), by: BTreeMap::new() } };
    sum.row.quantity.extend(port.and_then(|p| stored(causal, p)).map(|stored| (ONE, stored)));
    sum.add(&combination, ONE);
    sum.finish()
}

/// A row that is being added up.
struct Sum<'s, 'a> {
    assembled: &'s mut Assembled<'a>,
    ports: &'s Ports<'s>,
    row: Row,
}

impl Sum<'_, '_> {
    /// Adds `factor · combination`: rates of dependent storages to the quantities, what elements give to the drives.
    fn add(&mut self, combination: &Combination, factor: Expr) {
        for &(symbol, coefficient) in &combination.0 {
            let x = &mut self.assembled.d.x;
            let c = x.mul(&[factor, coefficient]);
            if let Some(&stored) = self.ports.dependent.get(&symbol) {
                let c = x.neg(c);
                self.row.quantity.push((c, stored));
            } else if self.ports.sources.contains_key(&symbol) {
                self.add_source(symbol, c);
            } else if self.ports.free.contains(&symbol) {
                self.drive(Drive::Element(symbol), c);
            }
        }
    }

    /// A flow that a source takes from other flows moves with these; one that follows a law moves freely.
    fn add_source(&mut self, symbol: Symbol, factor: Expr) {
        let value = self.ports.sources[&symbol];
        let flow = |s: Symbol| matches!(self.assembled.d.meaning(s), Some(Meaning::Flow(_)));
        let flows = self.assembled.d.x.symbols_of(value).into_iter().filter(|&s| flow(s)).collect();
        match self.split(value, flows) {
            Some((combination, rest)) if !varies(&self.assembled.d, rest) && !self.reads(&combination, symbol) => {
                self.add(&combination, factor);
            }
            _ => self.drive(Drive::Element(symbol), factor),
        }
    }

    fn reads(&self, combination: &Combination, source: Symbol) -> bool {
        combination.0.iter().any(|t| t.0 == source || self.ports.sources.contains_key(&t.0))
    }

    /// Adds the rate of a signal.
    fn add_rate(&mut self, signal: Symbol, rate: Expr) -> Option<()> {
        let d = &self.assembled.d;
        let of_a_bond = |s: Symbol| matches!(d.meaning(s), Some(Meaning::Effort(_) | Meaning::Flow(_)));
        let variables = d.x.symbols_of(rate).into_iter().filter(|&s| of_a_bond(s)).collect();
        let (combination, rest) = self.split(rate, variables)?;
        self.add(&combination, ONE);
        if varies(&self.assembled.d, rest) {
            self.drive(Drive::Own(signal), ONE);
        }
        Some(())
    }

    /// An expression as a combination of what elements give, and what is left; `None` if it is none, or if the factors read
    /// efforts or flows.
    fn split(&mut self, e: Expr, variables: Vec<Symbol>) -> Option<(Combination, Expr)> {
        let (coefficients, rest) = self.assembled.d.x.linear_in(e, &variables)?;
        let mut sum: BTreeMap<Symbol, Expr> = BTreeMap::new();
        for (variable, coefficient) in variables.into_iter().zip(coefficients) {
            let d = &mut self.assembled.d;
            let reads_bonds = d
                .x
                .depends_on_any(coefficient, &|s| matches!(d.meaning(s), Some(Meaning::Effort(_) | Meaning::Flow(_))));
            let known = self.ports.free.contains(&variable) || self.ports.dependent.contains_key(&variable);
            let assembled = &mut *self.assembled;
            let row = match assembled.rows.of(&mut assembled.d.x, variable) {
                Some(row) => row.clone(),
                None if known => Combination::of(variable, ONE),
                None if assembled.d.of.get(&variable).is_some_and(|of| !varies(&assembled.d, of.expr())) => continue,
                None => return None,
            };
            if reads_bonds {
                return None;
            }
            let x = &mut self.assembled.d.x;
            for (symbol, c) in row.0 {
                let term = x.mul(&[coefficient, c]);
                add_to(x, &mut sum, symbol, term);
            }
        }
        Some((Combination(sum.into_iter().collect()), rest))
    }

    fn drive(&mut self, drive: Drive, coefficient: Expr) {
        add_to(&mut self.assembled.d.x, &mut self.row.by, drive, coefficient);
    }

    /// The row, unless something in it has no value.
    fn finish(self) -> Option<Row> {
        let missing = &self.assembled.d.missing;
        let x = &self.assembled.d.x;
        let without_value = |e: Expr| !missing.is_empty() && x.depends_on_any(e, &|s| missing.contains_key(&s));
        let unknown = self.row.quantity.iter().any(|(f, s)| missing.contains_key(s) || without_value(*f))
            || self.row.by.values().any(|&c| without_value(c));
        (!unknown).then_some(self.row)
    }
}

/// Adds a term to the coefficient of a key; coefficients that cancel are gone.
fn add_to<K: Ord>(x: &mut Exprs, sum: &mut BTreeMap<K, Expr>, key: K, term: Expr) {
    let Some(&old) = sum.get(&key) else {
        sum.insert(key, term);
        return;
    };
    let value = x.add(&[old, term]);
    let value = x.simplify(value);
    if x.is_zero(value) {
        sum.remove(&key);
    } else {
        sum.insert(key, value);
    }
}
