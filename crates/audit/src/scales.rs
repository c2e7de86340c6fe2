//! How great things are in a run: what a miss is measured against.
//!
//! A miss counts relative to the greatest quantity of its place during the run: efforts to efforts and flows to flows of the
//! bonds joined by junctions, stored quantities and signals to themselves. What is zero but for rounding has no magnitude of
//! its own; it counts as at least [`FLOOR`] of what its kind has elsewhere, of what moves it during the run, and of the terms
//! of its law.

use crate::regions::Classes;
use crate::values::Values;
use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::bond_graph::{BondGraph, BondId, Kind, Meaning, PortRef};
use halfarrow_compiler::unit::Dimension;
use std::collections::BTreeMap;

/// The part of the greatest quantity of its kind that a quantity counts as at least. Rounding errors are far below it even
/// where they are amplified ten thousand times; what is smaller than it, and wrong, still stands out.
pub(crate) const FLOOR: f64 = 1e-6;

/// No scale is below this: numbers near the end of the range of `f64` have fewer digits.
const LEAST: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// What has a magnitude.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Quantity {
    /// Efforts of a region.
    Effort(usize),
    /// Flows of a region.
    Flow(usize),
    /// A stored quantity or signal.
    Of(Symbol),
    /// Powers at the ports of a connected junction structure.
    Power(usize),
    /// Energies held or moved in the whole model.
    Energy,
    /// A number: its weight is the magnitude.
    Number,
}

/// Quantities with the weights they have in what is measured.
pub(crate) type Terms = Vec<(Quantity, f64)>;

/// What is of like size without a floor of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Sort {
    Effort(Option<Dimension>),
    Flow(Option<Dimension>),
    Momentum(Option<Dimension>),
    Displacement(Option<Dimension>),
}

/// The greatest magnitudes seen so far; a run may come in parts.
pub(crate) struct Scales {
    regions: Classes,
    parts: Classes,
    seen: BTreeMap<Quantity, f64>,
    begun: Option<f64>,
    /// Length of the run so far, in s.
    span: f64,
}

impl Scales {
    pub fn new(graph: &BondGraph) -> Scales {
        Scales {
            regions: Classes::new(graph, |kind| matches!(kind, Kind::Zero | Kind::One)),
            parts: Classes::new(graph, |kind| kind.is_inner()),
            seen: BTreeMap::new(),
            begun: None,
            span: 0.0,
        }
    }

    /// Takes note of the magnitudes of a part of the run.
    pub fn absorb(&mut self, graph: &BondGraph, values: &Values) {
        if let (Some(&first), Some(&last)) = (values.times.first(), values.times.last()) {
            self.span = last - *self.begun.get_or_insert(first);
        }
        for bond in graph.bonds.ids() {
            for flow in [false, true] {
                let column = if flow { values.flow(bond) } else { values.effort(bond) };
                self.note(self.of_bond(bond, flow), greatest(column.unwrap_or_default()));
            }
        }
        for (&symbol, column) in values.columns() {
            if let quantity @ Quantity::Of(_) = self.of(graph, symbol) {
                self.note(quantity, greatest(column));
            }
        }
        for port in graph.outer_ports() {
            let power = values.power(port).unwrap_or_default();
            self.note(self.power(graph, port), greatest(&power));
        }
    }

    /// Takes note of an energy.
    pub fn absorb_energy(&mut self, energy: f64) {
        self.note(Quantity::Energy, energy);
    }

    fn note(&mut self, quantity: Quantity, magnitude: f64) {
        let seen = self.seen.entry(quantity).or_default();
        *seen = seen.max(magnitude);
    }

    /// Length of the run so far, in s.
    pub fn span(&self) -> f64 {
        self.span
    }

    /// The quantity of an effort or flow.
    pub fn of_bond(&self, bond: BondId, flow: bool) -> Quantity {
        let region = self.regions.of(bond);
        if flow { Quantity::Flow(region) } else { Quantity::Effort(region) }
    }

    /// The powers that those at a port stand beside.
    pub fn power(&self, graph: &BondGraph, port: PortRef) -> Quantity {
        Quantity::Power(self.parts.of(graph.bond_of(port)))
    }

    /// The quantity that a symbol is of.
    pub fn of(&self, graph: &BondGraph, symbol: Symbol) -> Quantity {
        match graph.variables.get(&symbol).map(|v| v.meaning) {
            Some(Meaning::Effort(bond)) => self.of_bond(bond, false),
            Some(Meaning::Flow(bond)) => self.of_bond(bond, true),
            Some(Meaning::Rate(of)) => match graph.variables.get(&of).map(|v| v.meaning) {
                Some(Meaning::Stored(port)) => self.rate(graph, port),
                _ => Quantity::Of(symbol),
            },
            _ => Quantity::Of(symbol),
        }
    }

    /// The effort or flow that the rate of a stored quantity is.
    pub fn rate(&self, graph: &BondGraph, port: PortRef) -> Quantity {
        let flow = !matches!(graph.elements[port.element].kind, Kind::Inertance(_));
        self.of_bond(graph.bond_of(port), flow)
    }

    /// The scales as the run stands.
    pub fn settled(&self, graph: &BondGraph) -> Settled {
        let seen = |q: Quantity| self.seen.get(&q).copied().unwrap_or(0.0);
        let mut sorts: BTreeMap<Sort, f64> = BTreeMap::new();
        let mut note = |sort: Sort, magnitude: f64| {
            let most = sorts.entry(sort).or_default();
            *most = most.max(magnitude);
        };
        for bond in graph.bonds.ids() {
            for flow in [false, true] {
                note(sort_of_bond(graph, bond, flow), seen(self.of_bond(bond, flow)));
            }
        }
        let per_second = if self.span > 0.0 { 1.0 / self.span } else { 0.0 };
        for (port, stored) in storages(graph) {
            let rate_is_flow = matches!(self.rate(graph, port), Quantity::Flow(_));
            note(sort_of_stored(graph, port, stored), seen(Quantity::Of(stored)));
            // A rate below this changes what is stored by next to nothing.
            note(sort_of_bond(graph, graph.bond_of(port), rate_is_flow), seen(Quantity::Of(stored)) * per_second);
        }
        let mut of = self.seen.clone();
        let mut raise = |quantity: Quantity, floor: f64| {
            let scale = of.entry(quantity).or_default();
            *scale = scale.max(FLOOR * floor);
        };
        for bond in graph.bonds.ids() {
            for flow in [false, true] {
                raise(self.of_bond(bond, flow), sorts[&sort_of_bond(graph, bond, flow)]);
            }
        }
        for (port, stored) in storages(graph) {
            let moved = self.span * seen(self.rate(graph, port));
            raise(Quantity::Of(stored), sorts[&sort_of_stored(graph, port, stored)].max(moved));
        }
        let mut settled = Settled { of };
        settled.raise_energy(self, graph);
        settled
    }
}

/// Stored quantities and their ports.
fn storages(graph: &BondGraph) -> impl Iterator<Item = (PortRef, Symbol)> {
    graph.elements.iter().flat_map(|(element, e)| {
        let stored: &[Symbol] = match &e.kind {
            Kind::Inertance(storage) | Kind::Compliance(storage) => &storage.stored,
            _ => &[],
        };
        stored.iter().enumerate().map(move |(port, &symbol)| (PortRef { element, port: port as u32 }, symbol))
    })
}

fn dimension(graph: &BondGraph, symbol: Symbol) -> Option<Dimension> {
    graph.variables.get(&symbol).and_then(|v| v.unit.as_ref()).map(|unit| unit.dimension)
}

fn sort_of_bond(graph: &BondGraph, bond: BondId, flow: bool) -> Sort {
    let b = &graph.bonds[bond];
    if flow { Sort::Flow(dimension(graph, b.flow)) } else { Sort::Effort(dimension(graph, b.effort)) }
}

fn sort_of_stored(graph: &BondGraph, port: PortRef, stored: Symbol) -> Sort {
    let unit = dimension(graph, stored);
    match graph.elements[port.element].kind {
        Kind::Inertance(_) => Sort::Momentum(unit),
        _ => Sort::Displacement(unit),
    }
}

fn greatest(column: &[f64]) -> f64 {
    column.iter().fold(0.0, |most, v| most.max(v.abs()))
}

/// Scales with their floors.
pub(crate) struct Settled {
    of: BTreeMap<Quantity, f64>,
}

impl Settled {
    /// The greatest of these terms.
    pub fn scale(&self, terms: &[(Quantity, f64)]) -> f64 {
        terms.iter().fold(LEAST, |most, &(quantity, weight)| most.max(weight * self.of(quantity)))
    }

    /// The magnitude of a quantity.
    pub fn of(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Number => 1.0,
            quantity => self.of.get(&quantity).copied().unwrap_or(0.0),
        }
    }

    /// An energy counts as at least the floor of what storages hold and ports move at the scales of their variables.
    fn raise_energy(&mut self, scales: &Scales, graph: &BondGraph) {
        let held = storages(graph).filter_map(|(port, stored)| {
            let z = graph.storage_symbols(port)?.0;
            Some(self.of(scales.of(graph, z)) * self.of(Quantity::Of(stored)))
        });
        let held = held.fold(0.0, f64::max);
        let powers = graph.outer_ports().into_iter().map(|port| self.of(scales.power(graph, port)));
        let moved = scales.span * powers.fold(0.0, f64::max);
        let energy = self.of.entry(Quantity::Energy).or_default();
        *energy = energy.max(FLOOR * held.max(moved));
        let per_second = if scales.span > 0.0 { 1.0 / scales.span } else { 0.0 };
        let least = FLOOR * *energy * per_second;
        let ids: Vec<Quantity> = graph.outer_ports().into_iter().map(|port| scales.power(graph, port)).collect();
        for quantity in ids {
            let power = self.of.entry(quantity).or_default();
            *power = power.max(least);
        }
    }
}

/// The miss against a scale; what misses nothing is 0 whatever the scale.
pub(crate) fn relative(miss: f64, scale: f64) -> f64 {
    if miss == 0.0 { 0.0 } else { miss.abs() / scale }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_miss_of_nothing_is_nothing_and_no_scale_vanishes() {
        let settled = Settled { of: BTreeMap::new() };
        let scale = settled.scale(&[(Quantity::Energy, 1.0)]);
        assert!(scale > 0.0 && relative(f64::MIN_POSITIVE, scale) < 1e-15);
        assert_eq!(relative(0.0, scale), 0.0);
        assert!(relative(f64::NAN, scale).is_nan());
        assert_eq!(settled.scale(&[(Quantity::Number, 3.0), (Quantity::Energy, 1.0)]), 3.0);
    }
}
