//! How great things are in a run: what a miss is measured against.
//!
//! A miss counts relative to the greatest quantity of its place during the run: efforts to efforts and flows to flows of the
//! bonds joined by junctions, stored quantities and signals to themselves. What is zero but for rounding has no magnitude of
//! its own: what stands *beside* it, its kind elsewhere, what moves it during the run, the terms of its law, tells how much
//! of a miss is rounding, and how great it counts as at least.

use crate::laws::Link;
use crate::regions::Classes;
use crate::values::Values;
use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::bond_graph::{BondGraph, BondId, Kind, Meaning, PortRef};
use halfarrow_compiler::unit::Dimension;
use std::collections::BTreeMap;

/// The part of what stands beside a quantity that rounding may make of it: errors in the last place, amplified some thousand
/// times on their way.
const NOISE: f64 = 1e-12;

/// The part of what stands beside it that a quantity counts as at least. Far below it what is wrong still stands out, and what
/// rounding makes, amplified even more, is no part of it.
const FLOOR: f64 = 1e-9;

/// What a modulus that moves makes of a quantity is lost below this part of the other.
const LOST: f64 = 1e-6;

/// What has a magnitude of its own, above rounding of what laws tell, counts as no more times it.
const AMPLIFIED: f64 = 1e3;

/// From law to law, what stands beside a quantity is passed on so often.
const NEIGHBOURS: usize = 3;

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

/// What a miss counts relative to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Term {
    pub quantity: Quantity,
    pub weight: f64,
    /// Whether it only stands beside what is missed.
    pub beside: bool,
}

impl Term {
    /// What is missed is of this.
    pub fn of(quantity: Quantity, weight: f64) -> Term {
        Term { quantity, weight, beside: false }
    }

    /// What is missed stands beside this.
    pub fn beside(quantity: Quantity, weight: f64) -> Term {
        Term { quantity, weight, beside: true }
    }
}

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
    /// What laws make of one quantity, given another: the greatest weights.
    links: BTreeMap<(Quantity, Quantity), f64>,
    /// Integrals of the magnitudes of efforts and flows.
    turnovers: BTreeMap<Quantity, f64>,
    /// Start values that the model gives.
    given: BTreeMap<Quantity, f64>,
    /// Magnitudes below which the method of the run neglected what happens.
    neglected: BTreeMap<Quantity, f64>,
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
            links: BTreeMap::new(),
            turnovers: BTreeMap::new(),
            given: BTreeMap::new(),
            neglected: BTreeMap::new(),
            begun: None,
            span: 0.0,
        }
    }

    /// Takes note of the magnitudes of a part of the run.
    pub fn absorb(&mut self, graph: &BondGraph, values: &Values) {
        if let (Some(&first), Some(&last)) = (values.times.first(), values.times.last()) {
            self.span = last - *self.begun.get_or_insert(first);
        }
        let mut turned: BTreeMap<Quantity, f64> = BTreeMap::new();
        for bond in graph.bonds.ids() {
            for flow in [false, true] {
                let column = if flow { values.flow(bond) } else { values.effort(bond) }.unwrap_or_default();
                let quantity = self.of_bond(bond, flow);
                self.note(quantity, greatest(column));
                let most = turned.entry(quantity).or_default();
                *most = most.max(turnover(values.times, column));
            }
        }
        turned.into_iter().for_each(|(quantity, more)| *self.turnovers.entry(quantity).or_default() += more);
        for (&symbol, column) in values.columns() {
            if let quantity @ Quantity::Of(_) = self.of(graph, symbol) {
                self.note(quantity, greatest(column));
            }
        }
        self.absorb_given(graph, values);
        for port in graph.outer_ports() {
            let power = values.power(port).unwrap_or_default();
            self.note(self.power(graph, port), greatest(&power));
        }
    }

    /// Takes note of the start values that the model gives: they tell what is great where a run begins at rest.
    fn absorb_given(&mut self, graph: &BondGraph, values: &Values) {
        let starts = graph.elements.values().filter_map(|element| match &element.kind {
            Kind::Inertance(storage) | Kind::Compliance(storage) => Some(&storage.initial),
            _ => None,
        });
        for initial in starts.flatten() {
            let value = graph.exprs.eval(initial.value, &mut |s| values.parameter(s).unwrap_or(f64::NAN)).abs();
            if value.is_finite() {
                let quantity = self.of(graph, initial.symbol);
                let given = self.given.entry(quantity).or_default();
                *given = given.max(value);
            }
        }
    }

    /// Takes note of an energy.
    pub fn absorb_energy(&mut self, energy: f64) {
        self.note(Quantity::Energy, energy);
    }

    /// Takes note of what laws make of their variables, both ways.
    pub fn absorb_links(&mut self, links: &[Link]) {
        for link in links.iter().filter(|link| link.weight > 0.0 && link.weight.is_finite()) {
            let back = link.straight.then_some(((link.from, link.of), 1.0 / link.weight));
            for (pair, weight) in [Some(((link.of, link.from), link.weight)), back].into_iter().flatten() {
                let known = self.links.entry(pair).or_default();
                *known = known.max(weight);
            }
        }
    }

    /// Takes note of the magnitude below which the method neglected what happens to a variable.
    pub fn neglect(&mut self, graph: &BondGraph, symbol: Symbol, magnitude: f64) {
        let quantity = self.of(graph, symbol);
        let least = self.neglected.entry(quantity).or_default();
        *least = least.max(magnitude);
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
        let sorts = self.sorts(graph);
        let mut beside = self.seen.clone();
        let mut raise = |quantity: Quantity, least: f64| {
            let most = beside.entry(quantity).or_default();
            *most = most.max(least);
        };
        self.given.iter().for_each(|(&quantity, &given)| raise(quantity, given));
        for bond in graph.bonds.ids() {
            for flow in [false, true] {
                raise(self.of_bond(bond, flow), sorts[&sort_of_bond(graph, bond, flow)]);
            }
        }
        for (port, stored) in storages(graph) {
            raise(Quantity::Of(stored), sorts[&sort_of_stored(graph, port, stored)].max(self.turnover(graph, port)));
        }
        // What stands beside a variable stands beside what a law makes of it.
        let (of_terms, of_variables): (Vec<_>, Vec<_>) =
            self.links.iter().partition(|((_, from), _)| *from == Quantity::Number);
        for (&(quantity, _), weight) in of_terms {
            let most = beside.entry(quantity).or_default();
            *most = most.max(*weight);
        }
        let alone = beside.clone();
        for _ in 0..NEIGHBOURS {
            let near = beside.clone();
            for ((quantity, from), weight) in of_variables.iter().copied() {
                let told = *weight * near.get(from).copied().unwrap_or(0.0);
                let own = alone.get(quantity).copied().unwrap_or(0.0);
                // What is told itself by far greater things than there are makes nothing rounding.
                let likely = (*weight * alone.get(from).copied().unwrap_or(0.0)).max(told / (AMPLIFIED * AMPLIFIED));
                let told = if own > FLOOR * likely { told.min(AMPLIFIED * own) } else { told };
                let most = beside.entry(*quantity).or_default();
                *most = most.max(told);
            }
        }
        self.raise_energies(graph, &alone, &mut beside);
        let size = |(&quantity, &beside): (&Quantity, &f64)| {
            let own = self.seen(quantity).max(FLOOR * beside);
            (quantity, Size { own, beside, alone: alone.get(&quantity).copied().unwrap_or(0.0) })
        };
        let mut of: BTreeMap<Quantity, Size> = beside.iter().map(size).collect();
        for (stored, least) in self.least_stored(graph) {
            let size = of.entry(stored).or_default();
            size.own = size.own.max(least);
        }
        Settled { of }
    }

    /// What the stored quantities count as at least, since the method neglected what is less. It is believed up to what
    /// would be there if the storage held the energy of the greatest: it may have been wrong about a magnitude. Storages
    /// that depend on others go with them: what holds less energy than was neglected of any state is neglected.
    fn least_stored(&self, graph: &BondGraph) -> Vec<(Quantity, f64)> {
        if self.neglected.is_empty() {
            return Vec::new();
        }
        let energy = |port: PortRef, stored: Symbol| {
            let acts = graph.storage_symbols(port).map_or(0.0, |(z, _)| self.seen(self.of(graph, z)));
            acts * self.seen(Quantity::Of(stored))
        };
        let held: Vec<(Quantity, f64)> =
            storages(graph).map(|(port, stored)| (Quantity::Of(stored), energy(port, stored))).collect();
        let most = held.iter().fold(0.0, |most: f64, (_, energy)| most.max(*energy));
        let told = self.neglected_through_laws();
        let neglected = |(quantity, held): &(Quantity, f64)| {
            let share = told.get(quantity)? / self.seen(*quantity);
            (*held > 0.0).then(|| (held * share * share).min(most))
        };
        let shared = held.iter().filter_map(neglected).fold(0.0, f64::max);
        let least = |of: &(Quantity, f64)| {
            let energy = neglected(of).unwrap_or(shared);
            (of.0, self.seen(of.0) * if of.1 > 0.0 { (energy / of.1).sqrt() } else { 0.0 })
        };
        held.iter().map(least).collect()
    }

    /// The magnitudes below which the method neglected quantities, told of themselves or of what a law joins them with.
    fn neglected_through_laws(&self) -> BTreeMap<Quantity, f64> {
        let mut all = self.neglected.clone();
        for ((of, from), weight) in &self.links {
            if let Some(magnitude) = self.neglected.get(from) {
                let least = all.entry(*of).or_default();
                *least = least.max(weight * magnitude);
            }
        }
        all
    }

    /// The greatest quantity of each sort.
    fn sorts(&self, graph: &BondGraph) -> BTreeMap<Sort, f64> {
        let mut sorts: BTreeMap<Sort, f64> = BTreeMap::new();
        let mut note = |sort: Sort, magnitude: f64| {
            let most = sorts.entry(sort).or_default();
            *most = most.max(magnitude);
        };
        for bond in graph.bonds.ids() {
            for flow in [false, true] {
                note(sort_of_bond(graph, bond, flow), self.seen(self.of_bond(bond, flow)));
            }
        }
        for (port, stored) in storages(graph) {
            let rate_is_flow = matches!(self.rate(graph, port), Quantity::Flow(_));
            let held = self.seen(Quantity::Of(stored));
            note(sort_of_stored(graph, port, stored), held);
            // A rate below a part of this changes what is stored by no more than that part.
            note(sort_of_bond(graph, graph.bond_of(port), rate_is_flow), held * self.per_second());
        }
        sorts
    }

    /// Energies stand beside what storages hold at the sizes of their variables, powers beside these energies in the time of the
    /// run.
    fn raise_energies(&self, graph: &BondGraph, alone: &BTreeMap<Quantity, f64>, beside: &mut BTreeMap<Quantity, f64>) {
        let held = |sizes: &BTreeMap<Quantity, f64>| {
            let size = |quantity: Quantity| sizes.get(&quantity).copied().unwrap_or(0.0);
            let held = storages(graph).filter_map(|(port, stored)| {
                let z = graph.storage_symbols(port)?.0;
                Some(size(self.of(graph, z)) * size(Quantity::Of(stored)))
            });
            held.fold(0.0, f64::max)
        };
        let (own, told) = (held(alone), held(beside));
        let held = if own > FLOOR * told { own } else { told };
        let ports = graph.outer_ports();
        let energy = beside.entry(Quantity::Energy).or_default();
        *energy = energy.max(held);
        let power = *energy * self.per_second();
        for port in ports {
            let most = beside.entry(self.power(graph, port)).or_default();
            *most = most.max(power);
        }
    }

    fn seen(&self, quantity: Quantity) -> f64 {
        self.seen.get(&quantity).copied().unwrap_or(0.0)
    }

    fn per_second(&self) -> f64 {
        if self.span > 0.0 { 1.0 / self.span } else { 0.0 }
    }

    /// The integral of the magnitude of what moves a stored quantity, or stands where that does.
    pub fn turnover(&self, graph: &BondGraph, port: PortRef) -> f64 {
        self.turnovers.get(&self.rate(graph, port)).copied().unwrap_or(0.0)
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

/// The integral of the magnitude, from below: of what grows without bound the samples tell no more.
fn turnover(times: &[f64], column: &[f64]) -> f64 {
    let pieces = times.windows(2).zip(column.windows(2));
    pieces.map(|(t, v)| (t[1] - t[0]) * v[0].abs().min(v[1].abs())).sum()
}

fn greatest(column: &[f64]) -> f64 {
    column.iter().fold(0.0, |most, v| most.max(v.abs()))
}

/// How great a quantity is, and what stands beside it.
#[derive(Debug, Clone, Copy, Default)]
struct Size {
    own: f64,
    beside: f64,
    /// What stands beside it but for what laws tell.
    alone: f64,
}

/// The sizes of all quantities as the run stands.
pub(crate) struct Settled {
    of: BTreeMap<Quantity, Size>,
}

/// What a miss is measured with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    own: f64,
    beside: f64,
}

impl Settled {
    /// The scale of what has these terms.
    pub fn scale(&self, terms: &[Term]) -> Scale {
        terms.iter().fold(Scale { own: LEAST, beside: LEAST }, |most, term| {
            let Size { own, beside, .. } = self.size(term.quantity);
            let part = if term.beside { FLOOR } else { 1.0 };
            Scale { own: most.own.max(part * term.weight * own), beside: most.beside.max(term.weight * beside) }
        })
    }

    /// The magnitude of a quantity.
    pub fn of(&self, quantity: Quantity) -> f64 {
        self.size(quantity).own
    }

    /// How great a quantity counts as at least, whatever it is.
    pub fn beside(&self, quantity: Quantity) -> f64 {
        self.size(quantity).beside
    }

    /// Whether what a modulus makes of one quantity is lost in the other: a modulus that is 0 but for rounding tells nothing of
    /// what it passes on.
    pub fn is_lost(&self, weight: f64, from: Quantity, of: Quantity) -> bool {
        weight * self.size(from).alone < LOST * self.size(of).alone
    }

    fn size(&self, quantity: Quantity) -> Size {
        match quantity {
            Quantity::Number => Size { own: 1.0, beside: 1.0, alone: 1.0 },
            quantity => self.of.get(&quantity).copied().unwrap_or_default(),
        }
    }
}

impl Scale {
    /// The scale of what also stands beside so much of a quantity whose scale alone is `other`.
    pub fn beside(self, weight: f64, other: Scale) -> Scale {
        Scale { own: self.own.max(FLOOR * weight * other.own), beside: self.beside.max(weight * other.beside) }
    }

    /// The miss as a part of what is there: what rounding may make of it as a part of what stands beside it.
    pub fn relative(self, miss: f64) -> f64 {
        let miss = miss.abs();
        let noise = NOISE * self.beside;
        match miss > noise {
            // NaN stays what it is.
            false => miss / self.beside,
            true => NOISE + (miss - noise) / self.own,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_miss_of_nothing_is_nothing_and_no_scale_vanishes() {
        let settled = Settled { of: BTreeMap::new() };
        let scale = settled.scale(&[Term::of(Quantity::Energy, 1.0)]);
        assert!(scale.relative(f64::MIN_POSITIVE) < 1e-15);
        assert_eq!(scale.relative(0.0), 0.0);
        assert!(scale.relative(f64::NAN).is_nan());
        assert_eq!(scale.relative(f64::INFINITY), f64::INFINITY);
    }

    #[test]
    fn what_rounding_makes_counts_relative_to_what_stands_beside() {
        let settled = Settled { of: BTreeMap::new() };
        let scale = settled.scale(&[Term::of(Quantity::Number, 1e-3), Term::beside(Quantity::Number, 1e3)]);
        assert!((scale.relative(1e-12) - 1e-15).abs() < 1e-25);
        assert!((scale.relative(1e-5) - 1e-2).abs() < 1e-5);
        let grows = [0.0, 1e-12, 1e-9, 2e-9, 1e-3, 1.0].map(|miss| scale.relative(miss));
        assert!(grows.is_sorted(), "{grows:?}");
    }
}
