//! Constraints relaxed: every relation that a multiplier keeps up becomes a stiff spring with a damper beside it.
//! Source: [KM]; `method.md`, section 4.
//!
//! A relation between flows is kept up by a compliance and a resistor, one between efforts by their duals. With `r` what
//! should vanish, `s' = k r` and `multiplier = s + d r`, in the direction in which the pair takes up power. The state `s`
//! is the force of the spring, so that it starts as what the constraint carries.

use std::collections::{BTreeMap, BTreeSet};

use super::along::AlgebraicConstraint;
use super::breaks::place_of;
use super::definitions::{Definition, Definitions};
use super::minimal::{Assembled, Chosen};
use super::{AlgebraicRole, StateKind};
use crate::algebra::{Expr, Facts, Symbol, SymbolKind};
use crate::bond_graph::ParameterKind::{self, Declared, FastestRate, SpringDamping, SpringStiffness};
use crate::bond_graph::{BondGraph, ElementId, Kind, Meaning, Parameter, ParameterId, PortRef, StorageLaw, Variable};
use crate::causal_graph::CausalGraph;
use crate::causal_paths::numeric::sample;
use crate::ids::{Id, Map};
use crate::span::Span;

/// By default springs are so stiff that their frequency is 1000 times the model's own fastest rate.
const STIFFNESS: i64 = 1_000_000;

/// The parameters of the relaxed constraints, added to the graph: they can be set like any other.
pub struct Springs {
    stiffness: Symbol,
    damping: Symbol,
    rate: Symbol,
}

/// Adds `form.stiffness`, the square of the ratio of the springs' frequency to `form.rate`; `form.damping`, in parts of
/// critical damping; and `form.rate`, the fastest rate of the model without its constraints, in 1/s.
pub fn parameters(open: &mut CausalGraph) -> Springs {
    let fastest = fastest_rate(open);
    let graph = &mut open.graph;
    let stiffness = graph.exprs.int(STIFFNESS);
    let damping = graph.exprs.int(1);
    let rate = graph.exprs.float(fastest);
    Springs {
        stiffness: parameter(graph, SpringStiffness, stiffness),
        damping: parameter(graph, SpringDamping, damping),
        rate: parameter(graph, FastestRate, rate),
    }
}

fn parameter(graph: &mut BondGraph, kind: ParameterKind, value: Expr) -> Symbol {
    let (name, doc) = match kind {
        SpringStiffness => ("form.stiffness", "stiffness of relaxed constraints"),
        SpringDamping => ("form.damping", "damping of relaxed constraints"),
        FastestRate => ("form.rate", "fastest rate of the model without its constraints"),
        Declared => unreachable!("the model declares it"),
    };
    let facts = Facts { nonzero: true, positive: true, given: Some(value) };
    let symbol = graph.exprs.symbol(name, facts);
    let meaning = Meaning::Parameter(ParameterId::new(graph.parameters.len()));
    graph.variables.insert(symbol, Variable { meaning, unit: None });
    graph.parameters.push(Parameter {
        name: name.to_string(),
        symbol,
        value,
        constant: false,
        shapes: false,
        kind,
        unit: None,
        doc: doc.to_string(),
        span: Span::default(),
    });
    symbol
}

/// The fastest of the rates at which two storages, or a storage and a resistor, exchange energy; 1 if none do.
fn fastest_rate(open: &CausalGraph) -> f64 {
    let graph = &open.graph;
    let mut x = graph.exprs.clone();
    let mobility = mobilities(graph);
    let mut known = Map::new();
    let mut fastest = 0.0f64;
    for state in &open.ports.ports {
        let Some(&own) = mobility.get(&state.input) else { continue };
        let row = open.ports.resolve(&mut x, state.output, &mut known);
        for &(symbol, coefficient) in &row.0 {
            let entry = sample(&x, coefficient);
            if let Some(other) = mobility.get(&symbol) {
                fastest = fastest.max((entry * entry * own * other).abs().sqrt());
            } else if let Some(slope) = resistance(open, &mut x, symbol) {
                fastest = fastest.max((entry * entry * own * slope).abs());
            }
        }
    }
    if fastest.is_finite() && fastest > 0.0 { fastest } else { 1.0 }
}

/// Slope of the law of the resistor that gives this variable.
fn resistance(open: &CausalGraph, x: &mut crate::algebra::Exprs, given: Symbol) -> Option<f64> {
    use crate::bond_graph::ResistorLaw::{Conductive, Implicit, Resistive};
    let state = open.ports.ports.iter().find(|p| p.input == given)?;
    let (Kind::Resistor(laws) | Kind::SkewGyrator(laws)) = &open.graph.elements[state.port.element].kind else {
        return None;
    };
    let bond = &open.graph.bonds[open.graph.bond_of(state.port)];
    let (law, by, inverse) = match laws[state.port.port as usize] {
        Resistive(e) => (e, bond.flow, given != bond.effort),
        Conductive(f) => (f, bond.effort, given != bond.flow),
        Implicit(_) => return None,
    };
    let slope = x.derivative(law, by);
    let slope = sample(x, slope);
    Some(if inverse { 1.0 / slope } else { slope })
}

/// `dz/dX` of each storage port by its co-energy variable, at the given parameters.
fn mobilities(graph: &BondGraph) -> BTreeMap<Symbol, f64> {
    let mut x = graph.exprs.clone();
    let mut all = BTreeMap::new();
    for (id, element) in graph.elements.iter() {
        let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &element.kind else { continue };
        for (index, law) in storage.laws.iter().enumerate() {
            let Some((z, _)) = graph.storage_symbols(PortRef { element: id, port: index as u32 }) else { continue };
            let stored = storage.stored[index];
            let mut slope = |e: Expr, by: Symbol| {
                let slope = x.derivative(e, by);
                sample(&x, slope)
            };
            let mobility = match *law {
                StorageLaw::Integral(e) => slope(e, stored),
                StorageLaw::Derivative(e) => 1.0 / slope(e, z),
                StorageLaw::Implicit(e) => -slope(e, stored) / slope(e, z),
                StorageLaw::Known { .. } => continue,
            };
            if mobility.is_finite() {
                all.insert(z, mobility.abs());
            }
        }
    }
    all
}

impl Assembled<'_> {
    /// Gives every multiplier a spring and a damper in the place of its relation. Closures that are none are left.
    pub fn relax(
        &mut self,
        causal: &CausalGraph,
        springs: &Springs,
        constraints: Vec<AlgebraicConstraint>,
    ) -> Vec<AlgebraicConstraint> {
        let mobility = mobilities(&causal.graph);
        let mut left = Vec::new();
        for constraint in constraints {
            match constraint.unknown {
                Some((multiplier, AlgebraicRole::Multiplier(element))) => {
                    let along = takes_up_along(causal, multiplier);
                    self.spring(springs, &mobility, element, multiplier, constraint.residual, along);
                }
                _ => left.push(constraint),
            }
        }
        self.sort_states();
        left
    }

    fn spring(
        &mut self,
        springs: &Springs,
        mobility: &BTreeMap<Symbol, f64>,
        element: ElementId,
        multiplier: Symbol,
        relation: Expr,
        along: bool,
    ) {
        let moved = mobility_of(&mut self.d, relation, mobility);
        let d = &mut self.d;
        let inertia = if moved.is_finite() && moved > 0.0 { 1.0 / moved } else { 1.0 };
        // A default: three digits of it are enough, and can be read.
        let inertia = d.x.decimal(&format!("{inertia:.2e}")).expect("a decimal");
        let (stiffness, damping, rate) = (d.x.sym(springs.stiffness), d.x.sym(springs.damping), d.x.sym(springs.rate));
        let (two, root) = (d.x.int(2), d.x.sqrt(stiffness));
        let k = d.x.mul(&[stiffness, rate, rate, inertia]);
        let c = d.x.mul(&[two, damping, root, rate, inertia]);
        let relation = if along { relation } else { d.x.neg(relation) };
        let place = place_of(d, multiplier).map_or_else(|| d.graph.elements[element].name.clone(), |(place, _)| place);
        let spring = d.x.made_of(SymbolKind::Spring(multiplier), &format!("{place}.spring"));
        let force = d.x.sym(spring);
        let damped = d.x.mul(&[c, relation]);
        let carried = d.x.add(&[force, damped]);
        d.free.remove(&multiplier);
        d.set(multiplier, carried);
        let spring_rate = d.state(spring);
        let change = d.x.mul(&[k, relation]);
        d.set(spring_rate, change);
        let kind = StateKind::Storage(Some(element));
        self.states.push(Chosen { symbol: spring, kind, meaning: None, tracked: multiplier });
    }
}

/// Whether the pair takes up power where the multiplier has the sign of the relation. A storage takes `z` and is offered
/// more by the structure where `z - structure` is negative.
fn takes_up_along(causal: &CausalGraph, multiplier: Symbol) -> bool {
    let state = causal.ports.ports.iter().find(|p| p.input == multiplier);
    state.is_some_and(|state| {
        let element = &causal.graph.elements[state.port.element];
        let storage = matches!(element.kind, Kind::Inertance(_) | Kind::Compliance(_));
        !storage && element.ports[state.port.port as usize].inward
    })
}

/// How much a unit of the multiplier moves its own relation: the sum of squared gradients times mobilities.
fn mobility_of(d: &mut Definitions, relation: Expr, mobility: &BTreeMap<Symbol, f64>) -> f64 {
    let mut gradient: BTreeMap<Symbol, f64> = BTreeMap::new();
    follow(d, relation, 1.0, mobility, &mut BTreeSet::new(), &mut gradient);
    gradient.iter().map(|(z, slope)| slope * slope * mobility[z]).sum()
}

fn follow(
    d: &mut Definitions,
    e: Expr,
    factor: f64,
    mobility: &BTreeMap<Symbol, f64>,
    open: &mut BTreeSet<Symbol>,
    gradient: &mut BTreeMap<Symbol, f64>,
) {
    for symbol in d.x.symbols_of(e) {
        let slope = d.x.derivative(e, symbol);
        let slope = factor * sample(&d.x, slope);
        if !slope.is_finite() {
            continue;
        }
        if mobility.contains_key(&symbol) {
            *gradient.entry(symbol).or_insert(0.0) += slope;
        } else if let Some(Definition::Explicit(inner)) = d.of.get(&symbol).copied()
            && open.insert(symbol)
        {
            follow(d, inner, slope, mobility, open, gradient);
            open.remove(&symbol);
        }
    }
}
