//! Checks a run against the bond graph it came from: power, energy and every law, by code that shares nothing with the
//! formulations but the [`BondGraph`]. Source: `method.md`, section 7.
//!
//! - **Power**: at every sample the powers at the ports of a connected junction structure sum to zero.
//! - **Residual**: at every sample every junction, two-port, source, resistor and storage law holds.
//! - **Energy and rates**: between samples, stored quantities and energies change by the integrals of their rates. The
//!   integrals are taken over the samples themselves, by quintics through neighbouring ones between jumps, and come
//!   with an estimate of their own error ([`Finding::resolution`], the difference to quartics): what is found below it
//!   says nothing about the run. Samples at every step of the integrator resolve about as much as its steps do.
//!
//! Every miss counts relative to what there is of its kind around its place during the run; what is zero but for rounding counts
//! only beside what its kind has elsewhere, what moves it, and the terms of its law.
//!
//! What is undetermined or was not recorded is not checked, and listed in [`Audit::unchecked`]; pseudo-bonds are exempt
//! from power and energy.
#![forbid(unsafe_code)]

mod at_once;
mod constraints;
mod drift;
mod energy;
mod lanes;
mod laws;
mod on_all_cores;
mod power;
mod quadrature;
mod regions;
mod scales;
mod set_valued;
mod terms;
mod values;
mod worst;

use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::bond_graph::{BondGraph, Kind};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

use at_once::STRETCHES;
pub use drift::{Drift, DriftKind};
pub use values::wanted;

/// What is audited: samples of a run, with the variables of [`wanted`] that have a value.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// Times in s, never decreasing; a time given twice is a jump, its two sides.
    pub times: &'a [f64],
    /// The names of the columns.
    pub names: &'a [Arc<str>],
    /// The columns, each as long as `times`, in SI units.
    pub columns: &'a [&'a [f64]],
    /// Parameters and constants by name, in SI units.
    pub parameters: &'a BTreeMap<String, f64>,
}

/// The greatest miss of a kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The miss, relative to the greatest magnitude of its kind around its place during the run.
    pub value: f64,
    /// When, in s.
    pub time: f64,
    /// Where: an element, a junction or a part of the graph, and what was missed there.
    pub place: String,
    /// Below this a miss says nothing; 0 where nothing is integrated.
    pub resolution: f64,
}

/// What an audit finds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Audit {
    /// Power made or eaten by the junction structure, relative to the greatest power at a port of the connected part.
    pub power: Option<Finding>,
    /// Stored less initial, supplied plus dissipated energy, relative to the greatest energy held or moved at a port.
    pub energy: Option<Finding>,
    /// Laws of junctions and elements, relative to the greatest effort or flow in the joined region.
    pub residual: Option<Finding>,
    /// Energy that appears or vanishes within so many samples one after the other, beyond what can flow meanwhile, which is the
    /// resolution.
    pub at_once: Vec<(usize, Finding)>,
    /// Stored quantities and integrated signals against the integrals of their rates, relative to their range.
    pub rates: Option<Finding>,
    /// The most that the samples leave open of energy and rates, wherever that is: what is missed there does not show.
    pub open: f64,
    /// How far positions have drifted from relations that their speeds keep.
    pub drift: Vec<Drift>,
    /// Storages that make or eat energy, and why.
    pub notes: Vec<String>,
    /// What storages have gained by the events of the model, in J, by their names; below 0 what they have lost.
    pub events: BTreeMap<String, f64>,
    /// What could not be checked, and why.
    pub unchecked: Vec<String>,
}

/// Audits a run that is given whole.
///
/// # Panics
/// If a column is not as long as the times.
pub fn audit(graph: &BondGraph, run: &Run) -> Audit {
    let mut auditor = Auditor::of(graph, run);
    auditor.take(run);
    auditor.finish()
}

/// The part of what stands beside it that a variable counts as at least where runs are compared.
const COMPARED: f64 = 1e-6;

/// How great each recorded variable of the graph counts as at least: what is zero but for rounding has a magnitude from what
/// stands beside it. In SI units, by name.
///
/// # Panics
/// If a column is not as long as the times.
pub fn magnitudes(graph: &BondGraph, run: &Run) -> BTreeMap<String, f64> {
    let mut auditor = Auditor::of(graph, run);
    auditor.take(run);
    let settled = auditor.scales.settled();
    let recorded: BTreeSet<&str> = run.names.iter().map(|name| &**name).collect();
    let mut all = BTreeMap::new();
    values::variables(graph, &mut |name, symbols| {
        // Of several that have the name the last one counts.
        if let Some(&symbol) = symbols.last().filter(|_| recorded.contains(name)) {
            all.insert(name.to_string(), COMPARED * settled.beside(auditor.scales.of(graph, symbol)));
        }
    });
    all
}

/// Audits a run that comes in parts: what a miss counts relative to is known when all of it was seen.
pub struct Auditor {
    graph: Arc<BondGraph>,
    columns: values::Columns,
    shares: Vec<constraints::Share>,
    quotients: laws::Quotients,
    relations: Vec<drift::Relation>,
    scales: scales::Scales,
    power: worst::Worst,
    energy: worst::Worst,
    at_once: [worst::Worst; STRETCHES.len()],
    residual: worst::Worst,
    rates: worst::Worst,
    /// What storages have gained by impulses, in J.
    by_impulses: BTreeMap<String, f64>,
    unchecked: BTreeSet<String>,
}

impl Auditor {
    /// Audits a run with these columns.
    fn of(graph: &BondGraph, run: &Run) -> Auditor {
        let known: BTreeMap<&str, usize> = run.names.iter().enumerate().map(|(i, name)| (&**name, i)).collect();
        Auditor::new(&Arc::new(graph.clone()), &mut |name| known.get(name).copied())
    }

    /// Nothing has been seen yet. `column_of` tells the column that is recorded under a name.
    pub fn new(graph: &Arc<BondGraph>, column_of: &mut dyn FnMut(&str) -> Option<usize>) -> Auditor {
        let none = worst::Worst::default;
        let mut graph = Arc::clone(graph);
        let (mut shares, mut quotients, mut relations) = Default::default();
        if makes_expressions(&graph) {
            let mut x = graph.exprs.clone();
            shares = constraints::shares(&graph, &mut x);
            quotients = laws::quotients(&graph, &mut x);
            relations = drift::relations(&graph, &mut x);
            graph = Arc::new(graph.with_exprs(x));
        }
        let (columns, scales) =
            on_all_cores::beside(&graph, || values::Columns::new(&graph, column_of), || scales::Scales::new(&graph));
        Auditor {
            columns,
            scales,
            graph,
            shares,
            quotients,
            relations,
            power: none(),
            energy: none(),
            at_once: std::array::from_fn(|_| none()),
            residual: none(),
            rates: none(),
            by_impulses: BTreeMap::new(),
            unchecked: BTreeSet::new(),
        }
    }

    /// Looks at the next part of the run, which begins with the last sample of the one before.
    ///
    /// # Panics
    /// If a column is not as long as the times.
    pub fn take(&mut self, run: &Run) {
        assert!(run.columns.iter().all(|c| c.len() == run.times.len()), "every column has one value a sample");
        let graph = &self.graph;
        let values = values::Values::new(graph, &self.columns, run);
        self.relations.iter_mut().for_each(|relation| relation.take(graph, &values));
        let mut unchecked = Vec::new();
        let balance = energy::balance(graph, &values, &self.scales, &mut unchecked);
        self.scales.absorb(graph, &values);
        balance.iter().for_each(|balance| self.scales.absorb_energy(balance.moved));
        let links = laws::links((graph, &self.quotients), &values, &self.scales, &self.scales.settled());
        self.scales.absorb_links(&links);
        let settled = self.scales.settled();
        let scales = (&self.scales, &settled);
        let Auditor { power, residual, rates, shares, quotients, .. } = self;
        let beside = values.beside_these();
        let of_laws = move || {
            let mut unchecked = Vec::new();
            laws::residual((graph, shares, quotients), &values, scales, residual, &mut unchecked);
            set_valued::residual(graph, &values, scales, residual, &mut unchecked);
            unchecked
        };
        let of_flows = move || {
            let mut unchecked = Vec::new();
            power::power(graph, &beside, scales, power, &mut unchecked);
            energy::rates(graph, &beside, scales, rates, &mut unchecked);
            unchecked
        };
        let (missing, also) = on_all_cores::both_at_once(graph, of_laws, of_flows);
        unchecked.extend(missing.into_iter().chain(also));
        balance.iter().for_each(|balance| balance.compare(run.times, &settled, &mut self.energy));
        balance.iter().for_each(|balance| balance.compare_at_once(run.times, &settled, &mut self.at_once));
        for (name, gained) in balance.into_iter().flat_map(|b| b.by_impulses) {
            *self.by_impulses.entry(name).or_default() += gained;
        }
        let kinds = [&mut self.power, &mut self.energy, &mut self.residual, &mut self.rates];
        kinds.into_iter().chain(&mut self.at_once).for_each(worst::Worst::end_part);
        self.unchecked.extend(unchecked);
    }

    /// The method of the run neglected what happens to a state or unknown below this magnitude, in its own unit.
    pub fn neglect(&mut self, symbol: Symbol, magnitude: f64) {
        self.scales.neglect(&self.graph, symbol, magnitude);
    }

    /// The method of the run may have missed this part of what acts.
    pub fn tolerate(&mut self, part: f64) {
        self.scales.tolerate(part);
    }

    /// What was found.
    pub fn finish(self) -> Audit {
        let settled = self.scales.settled();
        let notes = energy::notes(&self.graph);
        let impulses = !self.graph.clauses.is_empty() || self.graph.has_leaping_ratios();
        let events = if impulses { self.by_impulses } else { BTreeMap::new() };
        Audit {
            power: self.power.finding(&settled),
            energy: self.energy.finding(&settled),
            at_once: STRETCHES
                .into_iter()
                .zip(&self.at_once)
                .filter_map(|(steps, worst)| Some((steps, worst.finding(&settled)?)))
                .collect(),
            residual: self.residual.finding(&settled),
            rates: self.rates.finding(&settled),
            open: self.energy.open().max(self.rates.open()),
            drift: self.relations.into_iter().map(drift::Relation::finish).collect(),
            notes,
            events,
            unchecked: self.unchecked.into_iter().collect(),
        }
    }
}

/// Whether there are constraints, two-ports or relations between speeds, of which an audit makes expressions of its own.
fn makes_expressions(graph: &BondGraph) -> bool {
    let is_junction = |kind: &Kind| matches!(kind, Kind::Zero | Kind::One);
    let two_port = |kind: &Kind| kind.is_inner() && !is_junction(kind);
    !graph.constraints.is_empty()
        || !graph.signals.is_empty()
        || graph.elements.values().any(|element| two_port(&element.kind))
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1e} at t = {} s, {}", self.value, self.time, self.place)?;
        if self.resolution > 0.0 {
            write!(f, " (samples resolve {:.1e})", self.resolution)?;
        }
        Ok(())
    }
}

impl fmt::Display for Audit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines =
            [("power", &self.power), ("energy", &self.energy), ("residual", &self.residual), ("rates", &self.rates)];
        for (name, finding) in lines {
            match finding {
                Some(finding) => writeln!(f, "{name}: {finding}")?,
                None => writeln!(f, "{name}: nothing to check")?,
            }
        }
        self.events.iter().try_for_each(|(name, gained)| writeln!(f, "events: {name} {gained:+.6e} J"))?;
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))?;
        self.unchecked.iter().try_for_each(|what| writeln!(f, "not checked: {what}"))
    }
}
