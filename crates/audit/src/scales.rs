//! How great things are in a run: what a miss is measured against.
//!
//! A miss counts relative to the greatest quantity of its place during the run: efforts to efforts and flows to flows of the
//! bonds joined by junctions, stored quantities and signals to themselves. What is zero but for rounding has no magnitude of
//! its own: what stands *beside* it, its kind elsewhere, what moves it during the run, the terms of its law, tells how much
//! of a miss is rounding, and how great it counts as at least.

use crate::lanes::{greatest, higher};
use crate::laws::Link;
use crate::on_all_cores::on_all_cores;
use crate::regions::Classes;
use crate::values::Values;
use halfarrow_compiler::algebra::{Symbol, ZERO};
use halfarrow_compiler::bond_graph::{BondGraph, BondId, Kind, Meaning, PortRef};
use halfarrow_compiler::unit::Dimension;
use std::collections::BTreeMap;
use std::sync::Arc;

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

/// From law to law, what stands beside a quantity is passed on so often;
const NEIGHBOURS: usize = 3;
/// and so often, once, to what is nothing but rounding of it: in a machine that falls freely all joints carry no more.
const FAR_NEIGHBOURS: usize = 12;

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
    pub standing: Standing,
}

/// What something is to what is missed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Standing {
    /// The same.
    Own,
    /// It only stands beside it.
    Beside,
    /// It acts on it, and is no better known than the method tells it.
    Acting,
}

impl Term {
    /// What is missed is of this.
    pub fn of(quantity: Quantity, weight: f64) -> Term {
        Term { quantity, weight, standing: Standing::Own }
    }

    /// What is missed stands beside this.
    pub fn beside(quantity: Quantity, weight: f64) -> Term {
        Term { quantity, weight, standing: Standing::Beside }
    }

    /// This acts on what is missed.
    pub fn acting(quantity: Quantity, weight: f64) -> Term {
        Term { quantity, weight, standing: Standing::Acting }
    }
}

/// What is of like size without a floor of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sort {
    Effort(Option<Dimension>),
    Flow(Option<Dimension>),
    Momentum(Option<Dimension>),
    Displacement(Option<Dimension>),
}

/// Where the sizes of quantities stand.
#[derive(Default)]
struct Places {
    regions: Classes,
    parts: Classes,
    /// Of stored quantities and signals, by symbol.
    of: Vec<u32>,
    /// How many these are.
    symbols: usize,
}

/// What has no place among stored quantities and signals.
const NOWHERE: u32 = u32::MAX;

impl Places {
    fn new(graph: &BondGraph) -> Places {
        let mut places = Places {
            regions: Classes::new(graph, |kind| matches!(kind, Kind::Zero | Kind::One)),
            parts: Classes::new(graph, |kind| kind.is_inner()),
            of: vec![NOWHERE; graph.exprs.symbol_count()],
            symbols: 0,
        };
        for symbol in (0..graph.exprs.symbol_count() as u32).map(Symbol) {
            if let Quantity::Of(_) = places.quantity(graph, symbol) {
                places.of[symbol.0 as usize] = places.symbols as u32;
                places.symbols += 1;
            }
        }
        places
    }

    /// The place of a quantity; `None` of a symbol that the graph does not have.
    fn find(&self, quantity: Quantity) -> Option<usize> {
        let (regions, parts) = (self.regions.count(), self.parts.count());
        Some(match quantity {
            Quantity::Effort(region) => region,
            Quantity::Flow(region) => regions + region,
            Quantity::Of(symbol) => {
                let place = self.of.get(symbol.0 as usize).filter(|&&place| place != NOWHERE)?;
                2 * regions + *place as usize
            }
            Quantity::Power(part) => 2 * regions + self.symbols + part,
            Quantity::Energy => 2 * regions + self.symbols + parts,
            Quantity::Number => 2 * regions + self.symbols + parts + 1,
        })
    }

    fn at(&self, quantity: Quantity) -> usize {
        self.find(quantity).expect("a quantity of the graph")
    }

    fn count(&self) -> usize {
        2 * self.regions.count() + self.symbols + self.parts.count() + 2
    }

    fn quantity_of_bond(&self, bond: BondId, flow: bool) -> Quantity {
        let region = self.regions.of(bond);
        if flow { Quantity::Flow(region) } else { Quantity::Effort(region) }
    }

    /// The quantity that a symbol is of.
    fn quantity(&self, graph: &BondGraph, symbol: Symbol) -> Quantity {
        match graph.variables.get(&symbol).map(|v| v.meaning) {
            Some(Meaning::Effort(bond)) => self.quantity_of_bond(bond, false),
            Some(Meaning::Flow(bond)) => self.quantity_of_bond(bond, true),
            Some(Meaning::Rate(of)) => match graph.variables.get(&of).map(|v| v.meaning) {
                Some(Meaning::Stored(port)) => self.quantity_of_bond(graph.bond_of(port), rate_is_flow(graph, port)),
                _ => Quantity::Of(symbol),
            },
            _ => Quantity::Of(symbol),
        }
    }
}

/// A size for each place.
#[derive(Clone, Default)]
struct Sizes(Vec<f64>);

impl Sizes {
    fn of(places: &Places) -> Sizes {
        Sizes(vec![0.0; places.count()])
    }

    fn raise(&mut self, place: usize, least: f64) {
        self.0[place] = self.0[place].max(least);
    }

    /// Each as great as in another at least.
    fn raise_all(&mut self, least: &Sizes) {
        self.0.iter_mut().zip(&least.0).for_each(|(size, least)| *size = size.max(*least));
    }
}

impl std::ops::Index<usize> for Sizes {
    type Output = f64;
    fn index(&self, place: usize) -> &f64 {
        &self.0[place]
    }
}

/// A port of a storage: the places of what it stores, of what that makes and of what changes it, and their sorts.
struct Stored {
    held: usize,
    acts: usize,
    rate: usize,
    sort: usize,
    sort_of_rate: usize,
}

/// The greatest magnitudes seen so far; a run may come in parts.
pub(crate) struct Scales {
    places: Arc<Places>,
    stored: Vec<Stored>,
    /// The sorts of the efforts and flows of each region: pairs of place and sort, each once.
    sorts: Vec<(usize, usize)>,
    /// How many sorts there are.
    sort_count: usize,
    /// The places of the powers of parts that end somewhere.
    powers: Vec<usize>,
    seen: Sizes,
    /// What laws make of one quantity, given another: their places with the greatest weight, in order.
    links: Vec<(u32, u32, f64)>,
    /// Integrals of the magnitudes of efforts and flows.
    turnovers: Sizes,
    /// Start values that the model gives.
    given: Sizes,
    /// Magnitudes below which the method of the run neglected what happens.
    neglected: BTreeMap<usize, f64>,
    /// The part of what acts that the method of the run may miss.
    tolerance: f64,
    begun: Option<f64>,
    /// Length of the run so far, in s.
    span: f64,
}

impl Scales {
    pub fn new(graph: &BondGraph) -> Scales {
        let places = Places::new(graph);
        let mut known = Vec::new();
        let mut sorts: Vec<(usize, usize)> = Vec::new();
        for bond in graph.bonds.ids() {
            for flow in [false, true] {
                let sort = number_of(&mut known, sort_of_bond(graph, bond, flow));
                sorts.push((places.at(places.quantity_of_bond(bond, flow)), sort));
            }
        }
        sorts.sort_unstable();
        sorts.dedup();
        sorts.shrink_to_fit();
        let storage = |(port, held): (PortRef, Symbol)| {
            let (acts, _) = graph.storage_symbols(port)?;
            let (bond, flow) = (graph.bond_of(port), rate_is_flow(graph, port));
            Some(Stored {
                held: places.at(Quantity::Of(held)),
                acts: places.at(places.quantity(graph, acts)),
                rate: places.at(places.quantity_of_bond(bond, flow)),
                sort: number_of(&mut known, sort_of_stored(graph, port, held)),
                sort_of_rate: number_of(&mut known, sort_of_bond(graph, bond, flow)),
            })
        };
        let stored = storages(graph).filter_map(storage).collect();
        let outer = graph.outer_ports().into_iter();
        let mut powers: Vec<usize> =
            outer.map(|port| places.at(Quantity::Power(places.parts.of(graph.bond_of(port))))).collect();
        powers.sort_unstable();
        powers.dedup();
        Scales {
            stored,
            sorts,
            sort_count: known.len(),
            powers,
            seen: Sizes::of(&places),
            links: Vec::new(),
            turnovers: Sizes::of(&places),
            given: Sizes::of(&places),
            neglected: BTreeMap::new(),
            tolerance: 0.0,
            begun: None,
            span: 0.0,
            places: Arc::new(places),
        }
    }

    /// Takes note of the magnitudes of a part of the run.
    pub fn absorb(&mut self, graph: &BondGraph, values: &Values) {
        if let (Some(&first), Some(&last)) = (values.times.first(), values.times.last()) {
            self.span = last - *self.begun.get_or_insert(first);
        }
        let sizes = sizes_of(values);
        let mut turned = Sizes::of(&self.places);
        for (id, bond) in graph.bonds.iter() {
            for (flow, symbol) in [(false, bond.effort), (true, bond.flow)] {
                let Some(column) = values.place(symbol) else { continue };
                let place = self.places.at(self.of_bond(id, flow));
                let (greatest, turnover) = sizes[column];
                self.seen.raise(place, greatest);
                turned.raise(place, turnover);
            }
        }
        self.turnovers.0.iter_mut().zip(&turned.0).for_each(|(all, more)| *all += more);
        for symbol in (0..self.places.of.len() as u32).map(Symbol) {
            if let (Some(place), Some(column)) = (self.places.find(Quantity::Of(symbol)), values.place(symbol)) {
                self.seen.raise(place, sizes[column].0);
            }
        }
        self.absorb_given(graph, values);
        let ports = graph.outer_ports();
        let powers = on_all_cores(&ports, values, |ports, values| {
            ports.iter().map(|&port| values.greatest_power(port)).collect::<Vec<f64>>()
        });
        ports.iter().zip(powers.iter().flatten()).for_each(|(&port, &power)| self.note(self.power(graph, port), power));
    }

    /// Takes note of the start values that the model gives: they tell what is great where a run begins at rest.
    fn absorb_given(&mut self, graph: &BondGraph, values: &Values) {
        let starts = graph.elements.values().filter_map(|element| match &element.kind {
            Kind::Inertance(storage) | Kind::Compliance(storage) => Some(&storage.initial),
            _ => None,
        });
        for initial in starts.flatten().filter(|initial| initial.value != ZERO) {
            let value = graph.exprs.eval(initial.value, &mut |s| values.parameter(s).unwrap_or(f64::NAN)).abs();
            if value.is_finite() {
                let place = self.places.at(self.of(graph, initial.symbol));
                self.given.raise(place, value);
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
            let (of, from) = (self.places.at(link.of) as u32, self.places.at(link.from) as u32);
            self.links.push((of, from, link.weight));
            if link.straight {
                self.links.push((from, of, 1.0 / link.weight));
            }
        }
        self.links.sort_unstable_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(b.2.total_cmp(&a.2)));
        self.links.dedup_by_key(|link| (link.0, link.1));
    }

    /// Takes note of the magnitude below which the method neglected what happens to a variable.
    pub fn neglect(&mut self, graph: &BondGraph, symbol: Symbol, magnitude: f64) {
        if let Some(place) = self.places.find(self.of(graph, symbol)) {
            let least = self.neglected.entry(place).or_default();
            *least = least.max(magnitude);
        }
    }

    /// Takes note of the part of what acts that the method may miss.
    pub fn tolerate(&mut self, part: f64) {
        self.tolerance = self.tolerance.max(part);
    }

    fn note(&mut self, quantity: Quantity, magnitude: f64) {
        let place = self.places.at(quantity);
        self.seen.raise(place, magnitude);
    }

    /// Length of the run so far, in s.
    pub fn span(&self) -> f64 {
        self.span
    }

    /// The quantity of an effort or flow.
    pub fn of_bond(&self, bond: BondId, flow: bool) -> Quantity {
        self.places.quantity_of_bond(bond, flow)
    }

    /// The powers that those at a port stand beside.
    pub fn power(&self, graph: &BondGraph, port: PortRef) -> Quantity {
        Quantity::Power(self.part(graph, port))
    }

    /// The connected part that a port belongs to.
    pub fn part(&self, graph: &BondGraph, port: PortRef) -> usize {
        self.part_of(graph.bond_of(port))
    }

    /// The connected part that a bond belongs to.
    pub fn part_of(&self, bond: BondId) -> usize {
        self.places.parts.of(bond)
    }

    /// How many connected parts there are.
    pub fn part_count(&self) -> usize {
        self.places.parts.count()
    }

    /// The quantity that a symbol is of.
    pub fn of(&self, graph: &BondGraph, symbol: Symbol) -> Quantity {
        self.places.quantity(graph, symbol)
    }

    /// The scales as the run stands.
    pub fn settled(&self) -> Settled {
        let sorts = self.greatest_of_sorts();
        let mut beside = self.seen.clone();
        beside.raise_all(&self.given);
        self.sorts.iter().for_each(|&(place, sort)| beside.raise(place, sorts[sort]));
        for stored in &self.stored {
            beside.raise(stored.held, sorts[stored.sort].max(self.turnovers[stored.rate]));
        }
        // What stands beside a variable stands beside what a law makes of it.
        let number = self.places.at(Quantity::Number) as u32;
        for &(place, _, weight) in self.links.iter().filter(|link| link.1 == number) {
            beside.raise(place as usize, weight);
        }
        let alone = beside.clone();
        let links = || self.links.iter().filter(|link| link.1 != number).map(|l| (l.0 as usize, l.1 as usize, l.2));
        for _ in 0..NEIGHBOURS {
            let near = beside.clone();
            for (place, from, weight) in links() {
                let told = weight * near[from];
                let own = alone[place];
                // What is told itself by far greater things than there are makes nothing rounding.
                let likely = (weight * alone[from]).max(told / (AMPLIFIED * AMPLIFIED));
                beside.raise(place, if own > FLOOR * likely { told.min(AMPLIFIED * own) } else { told });
            }
        }
        // Once, so that nothing grows around a loop.
        let mut told_once = vec![false; beside.0.len()];
        for _ in NEIGHBOURS..FAR_NEIGHBOURS {
            let near = beside.clone();
            let mut raised = Vec::new();
            for (place, from, weight) in links().filter(|link| !told_once[link.0]) {
                let told = weight * near[from];
                if near[place] < NOISE * told {
                    beside.raise(place, told);
                    raised.push(place);
                }
            }
            if raised.is_empty() {
                break;
            }
            raised.into_iter().for_each(|place| told_once[place] = true);
        }
        self.raise_energies(&alone, &mut beside);
        let size =
            |((&seen, &beside), &alone): ((&f64, &f64), &f64)| Size { own: seen.max(FLOOR * beside), beside, alone };
        let mut of: Vec<Size> = self.seen.0.iter().zip(&beside.0).zip(&alone.0).map(size).collect();
        for (place, least) in self.least_stored() {
            of[place].own = of[place].own.max(least);
        }
        Settled { places: self.places.clone(), of, tolerance: self.tolerance }
    }

    /// What the stored quantities count as at least, since the method neglected what is less. It is believed up to what
    /// would be there if the storage held the energy of the greatest: it may have been wrong about a magnitude. Storages
    /// that depend on others go with them: what holds less energy than was neglected of any state is neglected.
    fn least_stored(&self) -> Vec<(usize, f64)> {
        if self.neglected.is_empty() {
            return Vec::new();
        }
        let energy = |stored: &Stored| self.seen[stored.acts] * self.seen[stored.held];
        let held: Vec<(usize, f64)> = self.stored.iter().map(|stored| (stored.held, energy(stored))).collect();
        let most = held.iter().fold(0.0, |most: f64, (_, energy)| most.max(*energy));
        let told = self.neglected_through_laws();
        let neglected = |&(place, held): &(usize, f64)| {
            let share = told[place]? / self.seen[place];
            (held > 0.0).then(|| (held * share * share).min(most))
        };
        let shared = held.iter().filter_map(neglected).fold(0.0, f64::max);
        let least = |of: &(usize, f64)| {
            let energy = neglected(of).unwrap_or(shared);
            (of.0, self.seen[of.0] * if of.1 > 0.0 { (energy / of.1).sqrt() } else { 0.0 })
        };
        held.iter().map(least).collect()
    }

    /// The magnitudes below which the method neglected quantities, told of themselves or of what a law joins them with.
    fn neglected_through_laws(&self) -> Vec<Option<f64>> {
        let mut all = vec![None; self.places.count()];
        self.neglected.iter().for_each(|(&place, &magnitude)| all[place] = Some(magnitude));
        for &(of, from, weight) in &self.links {
            if let Some(magnitude) = self.neglected.get(&(from as usize)) {
                let least = all[of as usize].get_or_insert(0.0);
                *least = least.max(weight * magnitude);
            }
        }
        all
    }

    /// The greatest quantity of each sort.
    fn greatest_of_sorts(&self) -> Vec<f64> {
        let mut sorts = vec![0.0f64; self.sort_count];
        let mut note = |sort: usize, magnitude: f64| sorts[sort] = sorts[sort].max(magnitude);
        self.sorts.iter().for_each(|&(place, sort)| note(sort, self.seen[place]));
        for stored in &self.stored {
            let held = self.seen[stored.held];
            note(stored.sort, held);
            // A rate below a part of this changes what is stored by no more than that part.
            note(stored.sort_of_rate, held * self.per_second());
        }
        sorts
    }

    /// Energies stand beside what storages hold at the sizes of their variables, powers beside these energies in the time of the
    /// run.
    fn raise_energies(&self, alone: &Sizes, beside: &mut Sizes) {
        let held = |sizes: &Sizes| {
            let held = self.stored.iter().map(|stored| sizes[stored.acts] * sizes[stored.held]);
            held.fold(0.0, f64::max)
        };
        let (own, told) = (held(alone), held(beside));
        let energy = self.places.at(Quantity::Energy);
        beside.raise(energy, if own > FLOOR * told { own } else { told });
        let power = beside[energy] * self.per_second();
        self.powers.iter().for_each(|&place| beside.raise(place, power));
    }

    fn per_second(&self) -> f64 {
        if self.span > 0.0 { 1.0 / self.span } else { 0.0 }
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

/// Whether the rate of what a storage holds is a flow.
fn rate_is_flow(graph: &BondGraph, port: PortRef) -> bool {
    !matches!(graph.elements[port.element].kind, Kind::Inertance(_))
}

/// The number of a sort among those that are known.
fn number_of(known: &mut Vec<Sort>, sort: Sort) -> usize {
    known.iter().position(|k| *k == sort).unwrap_or_else(|| {
        known.push(sort);
        known.len() - 1
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
fn turnover(steps: &[f64], column: &[f64]) -> f64 {
    const LANES: usize = 4;
    let lower = |a: f64, b: f64| if b < a { b } else { a };
    let piece = |step: f64, from: f64, to: f64| step * lower(from.abs(), to.abs());
    let behind = column.get(1..).unwrap_or_default();
    let ((steps, last), (from, _), (to, _)) =
        (steps.as_chunks::<LANES>(), column.as_chunks::<LANES>(), behind.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (step, (from, to)) in steps.iter().zip(from.iter().zip(to)) {
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += piece(step[k], from[k], to[k]);
        }
    }
    let done = LANES * steps.len();
    let rest = last.iter().zip(column.iter().zip(behind).skip(done)).map(|(step, (from, to))| piece(*step, *from, *to));
    sums.into_iter().chain(rest).sum()
}

/// The greatest magnitude of each column, and its turnover.
fn sizes_of(values: &Values) -> Vec<(f64, f64)> {
    let steps: Vec<f64> = values.times.windows(2).map(|t| t[1] - t[0]).collect();
    let columns = values.recorded_columns();
    let sizes = |columns: &[&[f64]], _: &Values| {
        columns.iter().map(|column| (greatest(column), turnover(&steps, column))).collect::<Vec<_>>()
    };
    on_all_cores(columns, values, sizes).concat()
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
#[derive(Default)]
pub(crate) struct Settled {
    places: Arc<Places>,
    of: Vec<Size>,
    /// The part of what acts that the method of the run may miss.
    tolerance: f64,
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
            let part = match term.standing {
                Standing::Own => 1.0,
                Standing::Beside => FLOOR,
                Standing::Acting => FLOOR.max(self.tolerance),
            };
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
            quantity => self.places.find(quantity).and_then(|place| self.of.get(place).copied()).unwrap_or_default(),
        }
    }
}

impl Scale {
    /// The scale of what has the terms of both.
    pub fn or(self, other: Scale) -> Scale {
        Scale { own: higher(self.own, other.own), beside: higher(self.beside, other.beside) }
    }

    /// The scale of what also stands beside so much of a quantity whose scale alone is `other`.
    pub fn beside(self, weight: f64, other: Scale) -> Scale {
        Scale { own: higher(self.own, FLOOR * weight * other.own), beside: higher(self.beside, weight * other.beside) }
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
        let settled = Settled::default();
        let scale = settled.scale(&[Term::of(Quantity::Energy, 1.0)]);
        assert!(scale.relative(f64::MIN_POSITIVE) < 1e-15);
        assert_eq!(scale.relative(0.0), 0.0);
        assert!(scale.relative(f64::NAN).is_nan());
        assert_eq!(scale.relative(f64::INFINITY), f64::INFINITY);
    }

    #[test]
    fn what_rounding_makes_counts_relative_to_what_stands_beside() {
        let settled = Settled::default();
        let scale = settled.scale(&[Term::of(Quantity::Number, 1e-3), Term::beside(Quantity::Number, 1e3)]);
        assert!((scale.relative(1e-12) - 1e-15).abs() < 1e-25);
        assert!((scale.relative(1e-5) - 1e-2).abs() < 1e-5);
        let grows = [0.0, 1e-12, 1e-9, 2e-9, 1e-3, 1.0].map(|miss| scale.relative(miss));
        assert!(grows.is_sorted(), "{grows:?}");
    }
}
