//! What is stored changes by what flows in.

use crate::at_once::{AtOnce, STRETCHES};
use crate::laws::sensitivities;
use crate::quadrature::gauss;
use crate::scales::{Quantity, Scales, Settled, Term};
use crate::values::Values;
use crate::worst::{Raw, Worst, above};
use halfarrow_compiler::algebra::{EvaluationOrder, Expr, Symbol};
use halfarrow_compiler::bond_graph::{BondGraph, Element, ElementId, Kind, Meaning, PortRef, Storage, StorageLaw};
use std::collections::BTreeSet;

/// Storages whose law reads more than their own variables and parameters: they make or eat energy.
pub(crate) fn notes(graph: &BondGraph) -> Vec<String> {
    let mut notes = Vec::new();
    for (id, element) in graph.elements.iter() {
        if let Kind::Inertance(storage) | Kind::Compliance(storage) = &element.kind {
            let names: Vec<&str> =
                outside(graph, id, element, storage).into_iter().map(|s| graph.exprs.name(s)).collect();
            if !names.is_empty() {
                let names = names.join(", ");
                notes.push(format!("{} makes or eats energy: its law changes with {names}", element.name));
            }
        }
    }
    notes
}

/// What the laws of a storage read besides its own variables and parameters.
fn outside(graph: &BondGraph, id: ElementId, element: &Element, storage: &Storage) -> BTreeSet<Symbol> {
    let port = |port: u32| graph.storage_symbols(PortRef { element: id, port }).map(|(z, _)| z);
    let own = |s: &Symbol| storage.stored.contains(s) || (0..element.ports.len() as u32).any(|p| port(p) == Some(*s));
    let laws = storage.laws.iter().flat_map(|law| match *law {
        StorageLaw::Integral(e) | StorageLaw::Derivative(e) | StorageLaw::Implicit(e) => [Some(e), None],
        // Its displacement is imposed; what it stores follows from its law alone.
        StorageLaw::Known { law, .. } => [Some(law), None],
    });
    let read = laws.flatten().flat_map(|e: Expr| graph.exprs.symbols_of(e));
    let parameter = |s: &Symbol| matches!(graph.variables.get(s).map(|v| v.meaning), Some(Meaning::Parameter(_)));
    read.filter(|s| !own(s) && !parameter(s)).collect()
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
    for (id, element) in graph.elements.iter() {
        let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &element.kind else { continue };
        for (port, &stored) in storage.stored.iter().enumerate() {
            let port = PortRef { element: id, port: port as u32 };
            let rate = graph.storage_symbols(port).map(|(_, rate)| rate);
            match (values.column(stored), rate.and_then(|rate| values.column(rate))) {
                (Some(x), Some(rate)) => {
                    // What acts on it for as long as the run lasts makes that much by its rounding, and by what the method misses of it.
                    let acts = graph.storage_symbols(port).map(|(_, rate)| scales.of(graph, rate));
                    let mut terms = vec![Term::of(Quantity::Of(stored), 1.0)];
                    terms.extend(acts.map(|acts| Term::acting(acts, scales.span())));
                    if let Some(k) = jumps(values.times, x, JUMPED * greatest(x)).iter().position(|j| *j != 0.0) {
                        let (name, time) = (&element.name, values.times[k]);
                        unchecked
                            .push(format!("the impulse that {name} takes at t = {time} s: no effort or flow tells it"));
                    }
                    let held = IntegratedQuantity { name: &element.name, x, rate, terms };
                    held.compare(values, settled, worst, Vec::new);
                }
                _ => unchecked.push(format!("the rate of what {} stores: it is not known", element.name)),
            }
        }
    }
    for signal in graph.signals.values() {
        let Some(x) = values.column(signal.symbol) else {
            unchecked.push(format!("the rate of {}: its value is not known", signal.name));
            continue;
        };
        if greatest(x) < NOTHING {
            continue;
        }
        let reader = match values.reader(&[signal.rate]) {
            Ok(reader) => reader,
            Err(missing) => {
                unchecked.push(format!("the rate of {}: {missing} is not known", signal.name));
                continue;
            }
        };
        let mut room = Vec::new();
        let mut at = |k: usize| reader.values_in(&mut room, k, &[]).map_or(f64::NAN, |v| v[0]);
        let rate: Vec<f64> = (0..x.len()).map(&mut at).collect();
        if rate.iter().any(|r| r.is_nan()) && !x.iter().any(|x| x.is_nan()) {
            unchecked.push(format!("the rate of {}: it jumps with the state", signal.name));
            continue;
        }
        let held = IntegratedQuantity {
            name: &signal.name,
            x,
            rate: &rate,
            terms: vec![Term::of(Quantity::Of(signal.symbol), 1.0)],
        };
        held.compare(values, settled, worst, || {
            // What its rate reads moves it: the terms that its rate has in the middle of the run.
            let reads = sensitivities(graph, scales, settled, &reader, x.len() / 2, |v| v[0]);
            reads.into_iter().map(|(quantity, weight)| Term::acting(quantity, weight * scales.span())).collect()
        });
    }
}

/// Something that changes by its rate.
struct IntegratedQuantity<'a> {
    name: &'a str,
    x: &'a [f64],
    rate: &'a [f64],
    terms: Vec<Term>,
}

impl IntegratedQuantity<'_> {
    /// Takes note of where it differs most from the integral of its rate; `more` gives further terms of its scale.
    fn compare(&self, values: &Values, settled: &Settled, worst: &mut Worst, more: impl FnOnce() -> Vec<Term>) {
        let (times, integral) = (values.times, values.quadrature.integrate(self.rate));
        let moved = integral.values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        let mut terms = self.terms.clone();
        terms.push(Term::of(Quantity::Number, moved));
        terms.extend(more());
        let scale = settled.scale(&terms);
        let jumps = jumps(times, self.x, JUMPED * greatest(self.x));
        let miss = |k: usize| self.x[k] - self.x[0] - jumps[k] - integral.values[k];
        let stands_out = |k: usize| (scale.relative(miss(k)), scale.relative(integral.uncertainty[k]));
        worst.leaves_open(scale.relative(integral.uncertainty.last().copied().unwrap_or(0.0)));
        let beyond = |a: usize, b: usize| above(stands_out(b), stands_out(a));
        let Some(k) = (0..times.len()).reduce(|most, k| if beyond(most, k) { k } else { most }) else { return };
        let place = format!("{}: what it holds against its rate", self.name);
        worst.keep(Raw { miss: miss(k), resolution: integral.uncertainty[k], time: times[k], place, terms }, settled);
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
    let n = values.times.len();
    let (mut balance, mut uncertainty, mut moved) = (vec![0.0; n], vec![0.0; n], vec![0.0f64; n]);
    let (mut any, mut held, mut by_impulses) = (false, 0.0f64, Vec::new());
    let mut gains: Vec<Vec<(String, f64)>> = vec![Vec::new(); n];
    let mut told = true;
    let mut at_once = AtOnce::new(n);
    for port in graph.outer_ports() {
        let element = &graph.elements[port.element];
        if pseudo.contains(&scales.part(graph, port)) {
            continue;
        }
        let Some(power) = values.power(port) else {
            unchecked.push(format!("the energy balance: the power at {} is not known", element.name));
            return None;
        };
        any = true;
        held = held.max(energy_held(graph, values, port));
        let own = match stored_by_law(graph, values, port) {
            Some((energy, gained)) => {
                if !gained.is_empty() {
                    let name = graph.port_name(port);
                    by_impulses.push((name.clone(), gained.iter().map(|(_, gain)| gain).sum()));
                    gained.into_iter().for_each(|(k, gain)| gains[k].push((name.clone(), gain)));
                }
                at_once.stores(&energy);
                energy
            }
            None => {
                told &= !matches!(element.kind, Kind::Inertance(_) | Kind::Compliance(_));
                at_once.passes(&power);
                let through = values.quadrature.integrate(&power);
                uncertainty.iter_mut().zip(&through.uncertainty).for_each(|(sum, own)| *sum += own);
                through.values
            }
        };
        for ((balance, moved), own) in balance.iter_mut().zip(&mut moved).zip(&own) {
            *balance += own;
            *moved = moved.max(own.abs());
        }
    }
    let moved = moved.into_iter().fold(held, f64::max);
    let given = if told && takes_only(graph) { given(values.times, &gains) } else { None };
    any.then_some(Balance { missing: balance, uncertainty, moved, by_impulses, given, at_once })
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
        (Some(z), Some(x)) => z.iter().zip(x).fold(0.0, |most, (z, x)| most.max((z * x).abs())),
        _ => 0.0,
    }
}

/// Jumps of what is held, added up, sample by sample: at a time given twice it may change by an impulse, which no rate tells.
/// What changes by less than `least` there has not jumped.
fn jumps(times: &[f64], x: &[f64], least: f64) -> Vec<f64> {
    let mut sum = vec![0.0; x.len()];
    for k in 1..x.len() {
        let change = if times[k] <= times[k - 1] { x[k] - x[k - 1] } else { 0.0 };
        sum[k] = sum[k - 1] + if change.abs() > least { change } else { 0.0 };
    }
    sum
}

/// The greatest magnitude.
fn greatest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// Part of what it holds at most by which a stored quantity has to change at once to have jumped.
const JUMPED: f64 = 1e-9;

/// What is gained at samples, in J.
type Gains = Vec<(usize, f64)>;

/// Energy that a one-port storage has taken up since the start, `∫ z dX` along its law, sample by sample, without what it
/// has gained by impulses, and that, each with its sample; `None` if its law is no function of its own stored quantity and parameters, or reads what is not known.
fn stored_by_law(graph: &BondGraph, values: &Values, port: PortRef) -> Option<(Vec<f64>, Gains)> {
    let element = &graph.elements[port.element];
    let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &element.kind else { return None };
    let (StorageLaw::Integral(law) | StorageLaw::Known { law, .. }) = *storage.laws.first()? else { return None };
    if storage.laws.len() != 1 || !outside(graph, port.element, element, storage).is_empty() {
        return None;
    }
    let (own, x) = (storage.stored[0], values.column(storage.stored[0])?);
    if graph.exprs.symbols_of(law).into_iter().any(|s| s != own && values.parameter(s).is_none()) {
        return None;
    }
    if let Some(line) = values.line(law) {
        return Some(stored_along(values.times, x, |x| line.where_all_are(x)));
    }
    let law = EvaluationOrder::new(&graph.exprs, &[law]);
    let numbers: Vec<Option<f64>> = law.symbols().iter().map(|&s| values.parameter(s).filter(|_| s != own)).collect();
    let mut room = Vec::new();
    Some(stored_along(values.times, x, |x| law.values_in(&mut room, |k| [numbers[k].unwrap_or(x)])[0][0]))
}

/// The same for a law `z` of what is stored, which is `x` at the samples.
fn stored_along(times: &[f64], x: &[f64], mut z: impl FnMut(f64) -> f64) -> (Vec<f64>, Gains) {
    // What an impulse gives or takes is no power of any sample.
    let jumps = jumps(times, x, JUMPED * greatest(x));
    let (mut energy, mut gained) = (vec![0.0; x.len()], Vec::new());
    for k in 1..x.len() {
        let change = gauss(x[k - 1], x[k], &mut z);
        let by_impulse = jumps[k] != jumps[k - 1];
        gained.extend(by_impulse.then_some((k, change)));
        energy[k] = energy[k - 1] + if by_impulse { 0.0 } else { change };
    }
    (energy, gained)
}
