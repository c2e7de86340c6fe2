//! What is stored changes by what flows in.

use crate::at_once::{AtOnce, STRETCHES};
use crate::lanes::{add, are_finite, greatest, greatest_product, higher};
use crate::laws::sensitivities;
use crate::on_all_cores::on_all_cores;
use crate::quadrature::{Integral, gauss};
use crate::scales::{Quantity, Scales, Settled, Term};
use crate::values::Values;
use crate::worst::{Raw, Worst, above};
use halfarrow_compiler::algebra::{EvaluationOrder, Expr, Symbol};
use halfarrow_compiler::bond_graph::{
    BondGraph, Element, ElementId, IntegratedSignal, Kind, Meaning, PortRef, Storage, StorageLaw,
};
use smallvec::SmallVec;
use std::collections::BTreeSet;

/// Storages whose law reads more than their own variables and parameters: they make or eat energy.
pub(crate) fn notes(graph: &BondGraph) -> Vec<String> {
    let mut notes = Vec::new();
    for (id, element) in graph.elements.iter() {
        if let Kind::Inertance(storage) | Kind::Compliance(storage) = &element.kind {
            let found: BTreeSet<Symbol> = outside(graph, id, element, storage).collect();
            let names: Vec<&str> = found.into_iter().map(|s| graph.exprs.name(s)).collect();
            if !names.is_empty() {
                let names = names.join(", ");
                notes.push(format!("{} makes or eats energy: its law changes with {names}", element.name));
            }
        }
    }
    notes
}

/// What the laws of a storage read besides its own variables and parameters.
fn outside<'g>(
    graph: &'g BondGraph,
    id: ElementId,
    element: &'g Element,
    storage: &'g Storage,
) -> impl Iterator<Item = Symbol> + 'g {
    let port = move |port: u32| graph.storage_symbols(PortRef { element: id, port }).map(|(z, _)| z);
    let own =
        move |s: &Symbol| storage.stored.contains(s) || (0..element.ports.len() as u32).any(|p| port(p) == Some(*s));
    let law = |law: &StorageLaw| match *law {
        StorageLaw::Integral(e) | StorageLaw::Derivative(e) | StorageLaw::Implicit(e) => e,
        // Its displacement is imposed; what it stores follows from its law alone.
        StorageLaw::Known { law, .. } => law,
    };
    let read = storage.laws.iter().map(law).flat_map(|e: Expr| graph.exprs.symbols_of(e));
    let parameter = |s: &Symbol| matches!(graph.variables.get(s).map(|v| v.meaning), Some(Meaning::Parameter(_)));
    read.filter(move |s| !own(s) && !parameter(s))
}

/// What never exceeds this has not moved: methods take a state that nothing moves to be as great.
const NOTHING: f64 = 1e-100;

/// Stored quantities and integrated signals against the integrals of their rates.
pub(crate) fn rates(
    graph: &BondGraph,
    values: &Values,
    (scales, settled): (&Scales, &Settled),
    worst: &mut Worst,
    unchecked: &mut Vec<String>,
) {
    let is_storage = |e: &Element| matches!(e.kind, Kind::Inertance(_) | Kind::Compliance(_));
    let storages: Vec<ElementId> = graph.elements.iter().filter(|(_, e)| is_storage(e)).map(|(id, _)| id).collect();
    let of_storages = on_all_cores(&storages, values, |storages, values| {
        let mut check = Check::new(values, settled);
        storages.iter().for_each(|&id| check.storage(graph, id, scales));
        (check.worst, check.unchecked)
    });
    let mut check = Check::new(values, settled);
    graph.signals.values().for_each(|signal| check.signal(graph, signal, scales));
    for (found, missing) in of_storages.into_iter().chain([(check.worst, check.unchecked)]) {
        worst.absorb(0, found, settled);
        unchecked.extend(missing);
    }
}

/// What changes by its rate at every sample.
struct Check<'a, 'b> {
    values: &'b Values<'a>,
    settled: &'b Settled,
    worst: Worst,
    unchecked: Vec<String>,
    /// Memory that is used again.
    integral: Integral,
    misses: Vec<f64>,
}

impl<'a, 'b> Check<'a, 'b> {
    fn new(values: &'b Values<'a>, settled: &'b Settled) -> Check<'a, 'b> {
        let (worst, integral) = Default::default();
        Check { values, settled, worst, unchecked: Vec::new(), integral, misses: Vec::new() }
    }

    fn storage(&mut self, graph: &BondGraph, id: ElementId, scales: &Scales) {
        let (values, element) = (self.values, &graph.elements[id]);
        let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &element.kind else { return };
        for (port, &stored) in storage.stored.iter().enumerate() {
            let port = PortRef { element: id, port: port as u32 };
            let rate = graph.storage_symbols(port).map(|(_, rate)| rate);
            let (Some(x), Some(rates)) = (values.column(stored), rate.and_then(|rate| values.column(rate))) else {
                self.unchecked.push(format!("the rate of what {} stores: it is not known", element.name));
                continue;
            };
            // What acts on it for as long as the run lasts makes that much by its rounding, and by what the method misses of it.
            let acts = rate.map(|rate| Term::acting(scales.of(graph, rate), scales.span()));
            if let Some(k) = jumps(values, x).iter().position(|j| *j != 0.0) {
                let (name, time) = (&element.name, values.times[k]);
                self.unchecked
                    .push(format!("the impulse that {name} takes at t = {time} s: no effort or flow tells it"));
            }
            self.compare(&element.name, (x, rates), [Term::of(Quantity::Of(stored), 1.0)].into_iter().chain(acts));
        }
    }

    fn signal(&mut self, graph: &BondGraph, signal: &IntegratedSignal, scales: &Scales) {
        let (values, settled) = (self.values, self.settled);
        let Some(x) = values.column(signal.symbol) else {
            self.unchecked.push(format!("the rate of {}: its value is not known", signal.name));
            return;
        };
        if greatest(x) < NOTHING {
            return;
        }
        let reader = match values.reader(&[signal.rate]) {
            Ok(reader) => reader,
            Err(missing) => {
                self.unchecked.push(format!("the rate of {}: {missing} is not known", signal.name));
                return;
            }
        };
        let mut room = Vec::new();
        let mut at = |k: usize| reader.values_in(&mut room, k, &[]).map_or(f64::NAN, |v| v[0]);
        let rates: Vec<f64> = (0..x.len()).map(&mut at).collect();
        if rates.iter().any(|r| r.is_nan()) && !x.iter().any(|x| x.is_nan()) {
            self.unchecked.push(format!("the rate of {}: it jumps with the state", signal.name));
            return;
        }
        // What its rate reads moves it: the terms that its rate has in the middle of the run.
        let reads = sensitivities(graph, scales, settled, &reader, x.len() / 2, |v| v[0]);
        let reads = reads.into_iter().map(|(quantity, weight)| Term::acting(quantity, weight * scales.span()));
        self.compare(&signal.name, (x, &rates), [Term::of(Quantity::Of(signal.symbol), 1.0)].into_iter().chain(reads));
    }

    /// Takes note of where what is held differs most from the integral of its rates.
    fn compare(&mut self, name: &str, (x, rates): (&[f64], &[f64]), terms: impl Iterator<Item = Term>) {
        let Check { values, settled, .. } = *self;
        let Check { worst, integral, misses, .. } = self;
        let Some(&begin) = x.first() else { return };
        values.quadrature.integrate_into(rates, integral);
        let moved = Term::of(Quantity::Number, greatest(&integral.values));
        let terms: SmallVec<[Term; 4]> = terms.chain([moved]).collect();
        let scale = settled.scale(&terms);
        misses.clear();
        misses.extend(x.iter().zip(&integral.values).map(|(x, integral)| x - begin - integral));
        misses.iter_mut().zip(jumps(values, x)).for_each(|(miss, jump)| *miss -= jump);
        // What is uncertain adds up.
        worst.leaves_open(scale.relative(integral.uncertainty.last().copied().unwrap_or(0.0)));
        if are_finite(misses) && worst.is_above(scale.relative(greatest(misses))) {
            return;
        }
        let stands_out = |k: usize| (scale.relative(misses[k]), scale.relative(integral.uncertainty[k]));
        let beyond = |a: usize, b: usize| above(stands_out(b), stands_out(a));
        let Some(k) = (0..misses.len()).reduce(|most, k| if beyond(most, k) { k } else { most }) else { return };
        let (place, time) = (format!("{name}: what it holds against its rate"), values.times[k]);
        let raw = Raw { miss: misses[k], resolution: integral.uncertainty[k], time, place, terms: terms.into_vec() };
        worst.keep(raw, settled);
    }
}

/// The energy of the whole model at every sample: what is missing, what the samples leave open, and how much is held or moved
/// at most.
pub(crate) struct Balance {
    missing: Vec<f64>,
    uncertainty: Vec<f64>,
    pub moved: f64,
    /// What storages have gained by impulses, in J, by their names.
    pub by_impulses: Vec<(String, f64)>,
    /// Where impulses can only take energy and have given some: when most of it at once, to which storage above all, and all
    /// of it.
    given: Option<(f64, String, f64)>,
    at_once: AtOnce,
}

/// Stored energy against what was supplied and dissipated, over all parts without pseudo-bonds.
pub(crate) fn balance(
    graph: &BondGraph,
    values: &Values,
    scales: &Scales,
    unchecked: &mut Vec<String>,
) -> Option<Balance> {
    let pseudo = pseudo_parts(graph, scales);
    let mut ports = graph.outer_ports();
    ports.retain(|&port| pseudo.is_empty() || !pseudo.contains(&scales.part(graph, port)));
    if ports.is_empty() {
        return None;
    }
    let parts = on_all_cores(&ports, values, |ports, values| Held::by(ports, graph, values));
    let held = match parts.into_iter().reduce(|all, more| Ok(all?.with(more?))).expect("there are ports") {
        Ok(held) => held,
        Err(port) => {
            let name = &graph.elements[port.element].name;
            unchecked.push(format!("the energy balance: the power at {name} is not known"));
            return None;
        }
    };
    let Held { missing, uncertainty, moved, gains, told, at_once } = held;
    let mut by_impulses: Vec<(String, f64)> = Vec::new();
    let mut at_samples: Vec<Vec<(String, f64)>> = vec![Vec::new(); values.times.len()];
    for (port, gained) in gains {
        let name = graph.port_name(port);
        by_impulses.push((name.clone(), gained.iter().map(|(_, gain)| gain).sum()));
        gained.into_iter().for_each(|(k, gain)| at_samples[k].push((name.clone(), gain)));
    }
    let given = if told && takes_only(graph) { given(values.times, &at_samples) } else { None };
    Some(Balance { missing, uncertainty, moved, by_impulses, given, at_once })
}

/// What some ports hold and pass.
struct Held {
    missing: Vec<f64>,
    uncertainty: Vec<f64>,
    moved: f64,
    /// What storages have gained by impulses.
    gains: Vec<(PortRef, Gains)>,
    /// Whether the laws of all storages tell what they hold.
    told: bool,
    at_once: AtOnce,
}

impl Held {
    /// By these ports; the first whose power is not known.
    fn by(ports: &[PortRef], graph: &BondGraph, values: &Values) -> Result<Held, PortRef> {
        let n = values.times.len();
        let (mut missing, mut uncertainty) = (vec![0.0; n], vec![0.0; n]);
        let (mut moved, mut gains, mut told, mut at_once) = (0.0, Vec::new(), true, AtOnce::new(n));
        let (mut power, mut integral) = (Vec::new(), Integral::default());
        for &port in ports {
            let element = &graph.elements[port.element];
            values.power(port, &mut power).ok_or(port)?;
            moved = higher(moved, energy_held(graph, values, port));
            match stored_by_law(graph, values, port, &mut integral.values) {
                Some(gained) => {
                    if !gained.is_empty() {
                        gains.push((port, gained));
                    }
                    at_once.stores(&integral.values);
                }
                None => {
                    told &= !matches!(element.kind, Kind::Inertance(_) | Kind::Compliance(_));
                    at_once.passes(&power);
                    values.quadrature.integrate_into(&power, &mut integral);
                    add(&mut uncertainty, &integral.uncertainty);
                }
            };
            add(&mut missing, &integral.values);
            moved = higher(moved, greatest(&integral.values));
        }
        Ok(Held { missing, uncertainty, moved, gains, told, at_once })
    }

    /// By these ports and others.
    fn with(mut self, more: Held) -> Held {
        add(&mut self.missing, &more.missing);
        add(&mut self.uncertainty, &more.uncertainty);
        self.gains.extend(more.gains);
        let at_once = self.at_once.with(more.at_once);
        Held { moved: higher(self.moved, more.moved), told: self.told && more.told, at_once, ..self }
    }
}

/// The connected parts that have bonds without power.
pub(crate) fn pseudo_parts(graph: &BondGraph, scales: &Scales) -> BTreeSet<usize> {
    graph.bonds.iter().filter(|(_, b)| b.pseudo).map(|(id, _)| scales.part_of(id)).collect()
}

/// Whether all impulses come from set-valued laws at rest, which take energy or leave it as it is: no event resets anything,
/// nothing imposes a motion.
fn takes_only(graph: &BondGraph) -> bool {
    let resets = graph.clauses.iter().any(|c| c.bound.is_none() && c.actions.iter().any(|a| a.impulse.is_some()));
    let own = |id: ElementId| graph.set_valued.iter().any(|law| law.element == id);
    let imposed = graph.elements.iter().any(|(id, e)| matches!(e.kind, Kind::FlowSource { .. }) && !own(id));
    let still = |s: Symbol| {
        let meaning = graph.variables.get(&s).map(|v| v.meaning);
        matches!(meaning, Some(Meaning::Signal(_) | Meaning::Stored(_) | Meaning::Parameter(_)))
    };
    let gaps = graph.set_valued.iter().filter_map(|law| law.constraint.as_ref()).chain(graph.constraints.iter());
    let moving = gaps.flat_map(|c| graph.exprs.symbols_of(c.expr)).any(|s| !still(s));
    !graph.set_valued.is_empty() && !resets && !imposed && !moving
}

/// What impulses have given at samples where they gave more than they took.
fn given(times: &[f64], gains: &[Vec<(String, f64)>]) -> Option<(f64, String, f64)> {
    let at = |k: usize| gains[k].iter().map(|(_, gain)| gain).sum::<f64>();
    let most = (0..times.len()).filter(|&k| at(k) > 0.0).reduce(|most, k| if at(k) > at(most) { k } else { most })?;
    let (name, _) = gains[most].iter().reduce(|a, b| if b.1 > a.1 { b } else { a })?;
    let all = (0..times.len()).map(|k| at(k).max(0.0)).sum();
    Some((times[most], name.clone(), all))
}

impl Balance {
    /// Takes note of where it differs most from zero.
    pub(crate) fn compare(&self, times: &[f64], settled: &Settled, worst: &mut Worst) {
        for (k, &time) in times.iter().enumerate() {
            let place = "the whole model".to_string();
            let terms = vec![Term::of(Quantity::Energy, 1.0)];
            let raw = Raw { miss: self.missing[k], resolution: self.uncertainty[k], time, place, terms };
            worst.keep(raw, settled);
        }
        if let Some((time, name, all)) = &self.given {
            let place = format!("{name}: what impulses give that can only take");
            let terms = vec![Term::of(Quantity::Energy, 1.0)];
            worst.keep(Raw { miss: *all, resolution: 0.0, time: *time, place, terms }, settled);
        }
    }

    /// Takes note of where most is gained or lost at once, in as many steps as each of [`STRETCHES`].
    pub(crate) fn compare_at_once(&self, times: &[f64], settled: &Settled, worst: &mut [Worst]) {
        for (worst, steps) in worst.iter_mut().zip(STRETCHES) {
            if let Some(raw) = self.at_once.worst(times, steps) {
                worst.keep(raw, settled);
            }
        }
    }
}

/// How much energy a storage holds at most, within a factor: `|z X|`.
fn energy_held(graph: &BondGraph, values: &Values, port: PortRef) -> f64 {
    let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &graph.elements[port.element].kind else { return 0.0 };
    let z = graph.storage_symbols(port).and_then(|(z, _)| values.column(z));
    match (z, values.column(storage.stored[port.port as usize])) {
        (Some(z), Some(x)) => greatest_product(z, x),
        _ => 0.0,
    }
}

/// Jumps of what is held, added up, sample by sample: at a time given twice it may change by an impulse, which no rate tells.
/// None where no time is given twice.
fn jumps(values: &Values, x: &[f64]) -> Vec<f64> {
    if !values.quadrature.has_jumps() {
        return Vec::new();
    }
    let (times, least) = (values.times, JUMPED * greatest(x));
    let mut sum = vec![0.0; x.len()];
    for k in 1..x.len() {
        let change = if times[k] <= times[k - 1] { x[k] - x[k - 1] } else { 0.0 };
        sum[k] = sum[k - 1] + if change.abs() > least { change } else { 0.0 };
    }
    sum
}

/// Part of what it holds at most by which a stored quantity has to change at once to have jumped.
const JUMPED: f64 = 1e-9;

/// What is gained at samples, in J.
type Gains = Vec<(usize, f64)>;

/// Energy that a one-port storage has taken up since the start, `∫ z dX` along its law, sample by sample in `energy`, without
/// what it has gained by impulses, and that, each with its sample; `None` if its law is no function of its own stored quantity and
/// parameters, or reads what is not known.
fn stored_by_law(graph: &BondGraph, values: &Values, port: PortRef, energy: &mut Vec<f64>) -> Option<Gains> {
    let element = &graph.elements[port.element];
    let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &element.kind else { return None };
    let (StorageLaw::Integral(law) | StorageLaw::Known { law, .. }) = *storage.laws.first()? else { return None };
    if storage.laws.len() != 1 || outside(graph, port.element, element, storage).next().is_some() {
        return None;
    }
    let (own, x) = (storage.stored[0], values.column(storage.stored[0])?);
    if graph.exprs.symbols_of(law).into_iter().any(|s| s != own && values.parameter(s).is_none()) {
        return None;
    }
    if let Some(line) = values.line(law) {
        return Some(stored_along(values, x, |x| line.where_all_are(x), energy));
    }
    let law = EvaluationOrder::new(&graph.exprs, &[law]);
    let numbers: Vec<Option<f64>> = law.symbols().iter().map(|&s| values.parameter(s).filter(|_| s != own)).collect();
    let mut room = Vec::new();
    let z = |x| law.values_in(&mut room, |k| [numbers[k].unwrap_or(x)])[0][0];
    Some(stored_along(values, x, z, energy))
}

/// The same for a law `z` of what is stored, which is `x` at the samples.
fn stored_along(values: &Values, x: &[f64], mut z: impl FnMut(f64) -> f64, energy: &mut Vec<f64>) -> Gains {
    // What an impulse gives or takes is no power of any sample.
    let jumps = jumps(values, x);
    let (mut held, mut gained) = (0.0, Vec::new());
    energy.clear();
    energy.extend((!x.is_empty()).then_some(held));
    for k in 1..x.len() {
        let change = gauss(x[k - 1], x[k], &mut z);
        let by_impulse = !jumps.is_empty() && jumps[k] != jumps[k - 1];
        gained.extend(by_impulse.then_some((k, change)));
        held += if by_impulse { 0.0 } else { change };
        energy.push(held);
    }
    gained
}
