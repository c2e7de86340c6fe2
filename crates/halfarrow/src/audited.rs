//! A system whose every step is recorded for the audit.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use halfarrow_audit::{self as audit, Audit, Auditor, Finding, wanted};
use halfarrow_compiler::bond_graph::{BondGraph, Element, Kind};
use halfarrow_exec as exec;
use halfarrow_sim::{
    Crawl, Failure, ImplicitSystem, Options, Sink, Sparsity, Stopped, Summary, System, simulate, simulate_implicit,
};
use serde::Serialize;

use crate::run::Recording;
use crate::verdict::Verdict;

/// Samples audited at once: bounds the memory of long runs.
const CHUNK: usize = 4096;

/// Greatest misses that the audit found.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct AuditReport {
    /// What they mean for the result.
    pub verdict: Verdict,
    /// What is missed by more than may be, with what to do about it.
    pub warnings: Vec<String>,
    /// Power made or eaten by the junction structure.
    pub power: Option<Miss>,
    /// Stored less initial, supplied plus dissipated energy.
    pub energy: Option<Miss>,
    /// Laws of junctions and elements.
    pub residual: Option<Miss>,
    /// Stored quantities and integrated signals against the integrals of their rates.
    pub rates: Option<Miss>,
    /// Storages that make or eat energy, and why.
    pub notes: Vec<String>,
    /// What could not be checked, and why.
    pub unchecked: Vec<String>,
}

/// The greatest miss of a kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Miss {
    /// Relative to the greatest magnitude of its kind around its place.
    pub value: f64,
    /// When, in s.
    pub time: f64,
    /// Where, and what was missed there.
    pub place: String,
    /// Below this a miss says nothing; 0 where nothing is integrated.
    pub resolution: f64,
}

/// A model that records for the audit what it hands out no one else.
pub struct Audited<'a, M> {
    model: &'a mut M,
    book: Book,
}

/// What is recorded.
struct Book {
    auditor: Auditor,
    /// What the method was allowed to neglect of each state, as far as it said so.
    neglected: Vec<f64>,
    parameters: BTreeMap<String, f64>,
    names: Vec<String>,
    times: Vec<f64>,
    columns: Vec<Vec<f64>>,
    /// Where the recorded values of the user stand among all.
    shown: Vec<usize>,
    /// The order in which a value that is not finite is looked for: what sources give comes first.
    suspects: Vec<usize>,
    /// How many of these, the first ones, are values of sources.
    sources: usize,
    /// What the user records that was infinite, and when first.
    infinite: BTreeMap<usize, f64>,
    /// Where rates had no finite value last.
    failed: Option<(f64, Vec<f64>)>,
    values: Vec<f64>,
}

impl<'a, M: Recording + Parameters> Audited<'a, M> {
    /// Audits what `model` computes; what it records stays what it is.
    pub fn new(model: &'a mut M, graph: &BondGraph) -> Audited<'a, M> {
        let observed = &model.program().observed;
        let asked: Vec<String> = model.recorded().iter().map(|&i| observed[i].name.clone()).collect();
        let available = |name: &String| observed.iter().any(|o| o.name == *name && o.value.is_ok());
        let names: Vec<String> = wanted(graph).into_iter().filter(available).collect();
        let all: Vec<&str> = names.iter().chain(&asked).map(String::as_str).collect();
        let count = all.len();
        // Every name is known to have a value, so this cannot fail.
        let _ = model.record(&all);
        let known = graph.parameters.values().map(|p| p.name.clone());
        let (suspects, sources) = suspects(graph, &names);
        let book = Book {
            parameters: known.filter_map(|name| model.parameter(&name).map(|value| (name, value))).collect(),
            shown: (names.len()..count).collect(),
            columns: vec![Vec::new(); names.len()],
            values: vec![0.0; count],
            times: Vec::new(),
            auditor: Auditor::new(graph),
            neglected: Vec::new(),
            suspects,
            sources,
            infinite: BTreeMap::new(),
            failed: None,
            names,
        };
        Audited { model, book }
    }

    /// What was found.
    pub fn finish(mut self) -> AuditReport {
        let tracked = self.model.program().tracked.iter();
        tracked.zip(&self.book.neglected).for_each(|(&symbol, error)| self.book.auditor.neglect(symbol, *error));
        self.book.audit();
        AuditReport::from(self.book.auditor.finish())
    }

    /// What is to be known of the values recorded, given why the run stopped, if it did.
    pub fn notes(&self, failure: Option<&Failure>) -> Vec<String> {
        let program = self.model.program();
        let name = |i: &usize| &program.observed[self.model.recorded()[self.book.shown[*i]]].name;
        let infinite = self.book.infinite.iter();
        let mut notes: Vec<String> =
            infinite.map(|(i, time)| format!("`{}` is infinite at t = {time} s", name(i))).collect();
        let grown = match failure {
            Some(Failure::StepTooSmall { .. }) => self.book.grown(&self.book.suspects, GROWN),
            // Steps may get past a pole; what grew so far is none of the run's own.
            None => self.book.grown(&self.book.suspects[..self.book.sources], POLE),
            Some(_) => None,
        };
        if let Some((name, value, time)) = grown {
            notes.push(format!("{name} grows without bound: it is {value:e} at t = {time} s"));
        }
        notes
    }
}

/// The values of the graph, those that sources give first, then inputs and held signals, then all others; and how many sources
/// give.
fn suspects(graph: &BondGraph, names: &[String]) -> (Vec<usize>, usize) {
    let given = |e: &Element| match e.kind {
        Kind::EffortSource { .. } => Some(format!("{}.e", e.name)),
        Kind::FlowSource { .. } => Some(format!("{}.f", e.name)),
        _ => None,
    };
    let given: BTreeSet<String> = graph.elements.values().filter_map(given).collect();
    let rank = |name: &String| if given.contains(name) { 0 } else { 1 + usize::from(name.contains('.')) };
    let mut all: Vec<usize> = (0..names.len()).collect();
    all.sort_by_cached_key(|&i| rank(&names[i]));
    (all, names.iter().filter(|name| given.contains(*name)).count())
}

/// What knows the values of parameters.
pub trait Parameters {
    /// The present value of a parameter.
    fn parameter(&self, name: &str) -> Option<f64>;
}

impl Parameters for exec::Model {
    fn parameter(&self, name: &str) -> Option<f64> {
        self.parameter(name)
    }
}

impl Parameters for exec::ImplicitModel {
    fn parameter(&self, name: &str) -> Option<f64> {
        self.reference().parameter(name)
    }
}

/// What has grown this many times over the run before grows without bound.
const GROWN: f64 = 1e3;

/// A source that is greater than it is for half of the time by this factor has a pole.
const POLE: f64 = 1e9;

impl Book {
    /// Keeps the values just observed at `t`.
    fn keep(&mut self, t: f64) -> Result<(), Failure> {
        if let Some(what) = self.not_finite() {
            return Err(Failure::NotFinite { time: t, what: what.to_string() });
        }
        // A part of the run never ends between the two samples of a jump.
        if self.times.len() >= CHUNK && self.times.last() != Some(&t) {
            self.audit();
        }
        self.times.push(t);
        self.columns.iter_mut().zip(&self.values).for_each(|(column, value)| column.push(*value));
        Ok(())
    }

    /// A value of the graph that is not finite, of a source if there is one.
    fn not_finite(&self) -> Option<&str> {
        let found = self.suspects.iter().find(|&&i| !self.values[i].is_finite());
        found.map(|&i| self.names[i].as_str())
    }

    /// A value that is beyond all it is for half of the time by this factor at its greatest: its name, what it is then, when.
    fn grown(&self, among: &[usize], factor: f64) -> Option<(&str, f64, f64)> {
        among.iter().find_map(|&i| {
            let column = &self.columns[i];
            let peak = (0..column.len()).max_by(|&a, &b| column[a].abs().total_cmp(&column[b].abs()))?;
            let usual = self.usual(column);
            let grew = usual > 0.0 && column[peak].abs() > factor * usual;
            grew.then(|| (self.names[i].as_str(), column[peak], self.times[peak]))
        })
    }

    /// The magnitude that a value stays below for half of the time.
    fn usual(&self, column: &[f64]) -> f64 {
        let mut held: Vec<(f64, f64)> =
            self.times.windows(2).zip(column).map(|(t, value)| (value.abs(), t[1] - t[0])).collect();
        held.sort_by(|a, b| a.0.total_cmp(&b.0));
        let half = held.iter().map(|h| h.1).sum::<f64>() / 2.0;
        let mut passed = 0.0;
        let middle = held.iter().find(|h| {
            passed += h.1;
            passed >= half
        });
        middle.map_or(0.0, |h| h.0)
    }

    /// The values that the user asked for.
    fn hand_out(&mut self, t: f64, out: &mut [f64]) {
        for (k, (value, &i)) in out.iter_mut().zip(&self.shown).enumerate() {
            *value = self.values[i];
            if value.is_infinite() {
                self.infinite.entry(k).or_insert(t);
            }
        }
    }

    /// Remembers where rates had no finite value.
    fn note_failure(&mut self, result: &Result<(), Failure>, t: f64, x: &[f64]) {
        if matches!(result, Err(Failure::NotFinite { .. })) {
            self.failed = Some((t, x.to_vec()));
        }
    }

    /// Audits what has been recorded, and keeps the last sample to go on from.
    fn audit(&mut self) {
        if self.times.len() < 2 {
            return;
        }
        let columns = self.names.iter().cloned().zip(self.columns.iter().map(Vec::as_slice)).collect();
        self.auditor.take(&audit::Run { times: &self.times, columns: &columns, parameters: &self.parameters });
        let last = self.times.len() - 1;
        self.times.drain(..last);
        self.columns.iter_mut().for_each(|column| drop(column.drain(..last)));
    }
}

impl Audited<'_, exec::Model> {
    /// Runs it, as [`simulate`].
    ///
    /// # Errors
    /// As [`simulate`].
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub fn simulate(&mut self, options: &Options, x: &mut [f64], sink: &mut dyn Sink) -> Result<Summary, Stopped> {
        let mut sink = Told { sink, rtol: options.rtol, neglected: Vec::new() };
        let done = simulate(self, options, x, &mut sink);
        self.book.neglected = sink.neglected;
        done
    }

    /// Names the source behind rates that are not finite, if there is one.
    pub fn explain(&mut self, failure: Failure) -> Failure {
        let Failure::NotFinite { time, what } = &failure else { return failure };
        let Some((t, x)) = self.book.failed.take().filter(|(t, _)| t == time) else { return failure };
        // It has no value, which is why it is looked at; what has one is written.
        let _ = self.model.observe(t, &x, &mut self.book.values);
        match self.book.not_finite() {
            Some(name) if name != what => {
                Failure::NotFinite { time: *time, what: format!("{name}, and with it {what},") }
            }
            _ => failure,
        }
    }
}

impl Audited<'_, exec::ImplicitModel> {
    /// Runs it, as [`simulate_implicit`].
    ///
    /// # Errors
    /// As [`simulate_implicit`].
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub fn simulate(
        &mut self,
        options: &Options,
        (y, yp): (&mut [f64], &mut [f64]),
        sink: &mut dyn Sink,
    ) -> Result<Summary, Stopped> {
        let mut sink = Told { sink, rtol: options.rtol, neglected: Vec::new() };
        let done = simulate_implicit(self, options, y, yp, &mut sink);
        self.book.neglected = sink.neglected;
        done
    }
}

/// A sink that remembers the magnitude below which the method neglects what happens to each state.
struct Told<'a> {
    sink: &'a mut dyn Sink,
    rtol: f64,
    neglected: Vec<f64>,
}

impl Sink for Told<'_> {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.sink.sample(t, values);
    }
    fn progress(&mut self, t: f64) -> ControlFlow<()> {
        self.sink.progress(t)
    }
    fn tolerances(&mut self, magnitudes: &[f64], absolute: &[f64]) {
        self.neglected.clear();
        self.neglected.extend(absolute.iter().map(|error| error / self.rtol));
        self.sink.tolerances(magnitudes, absolute);
    }
    fn crawls(&mut self, crawl: &Crawl) {
        self.sink.crawls(crawl);
    }
}

impl From<Audit> for AuditReport {
    fn from(a: Audit) -> AuditReport {
        let miss = |found: Option<Finding>| found.map(Miss::from);
        AuditReport {
            power: miss(a.power),
            energy: miss(a.energy),
            residual: miss(a.residual),
            rates: miss(a.rates),
            notes: a.notes,
            unchecked: a.unchecked,
            ..AuditReport::default()
        }
    }
}

impl From<Finding> for Miss {
    fn from(f: Finding) -> Miss {
        Miss { value: f.value, time: f.time, place: f.place, resolution: f.resolution }
    }
}

impl System for Audited<'_, exec::Model> {
    fn states(&self) -> usize {
        self.model.states()
    }
    fn state_name(&self, state: usize) -> String {
        self.model.state_name(state)
    }
    fn switch_name(&self, switch: usize) -> String {
        self.model.switch_name(switch)
    }
    fn observed_name(&self, value: usize) -> String {
        self.model.observed_name(self.book.shown[value])
    }
    fn scales(&self) -> &[f64] {
        self.model.scales()
    }
    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        let done = self.model.rates(t, x, dx);
        self.book.note_failure(&done, t, x);
        done
    }
    fn tangent(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.model.tangent(t, x, v, jv)
    }
    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        self.model.jacobian(t, x, values)
    }
    fn drift(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.model.drift(t, x, out)
    }
    fn sparsity(&self) -> &Sparsity {
        self.model.sparsity()
    }
    fn observe(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.model.observe(t, x, &mut self.book.values)?;
        self.book.hand_out(t, out);
        Ok(())
    }
    fn observed(&self) -> usize {
        self.book.shown.len()
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        self.model.next_jump(t)
    }
    fn is_corner(&mut self, t: f64) -> bool {
        self.model.is_corner(t)
    }
    fn cross_jump(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.model.cross_jump(t, x)?;
        self.model.observe(t, x, &mut self.book.values)?;
        self.book.keep(t)
    }
    fn accept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.model.accept(t, x)?;
        if self.book.times.last() != Some(&t) {
            self.model.observe(t, x, &mut self.book.values)?;
            self.book.keep(t)?;
        }
        Ok(())
    }
    fn switches(&self) -> usize {
        self.model.switches()
    }
    fn switch_values(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.model.switch_values(t, x, g)
    }
}

impl ImplicitSystem for Audited<'_, exec::ImplicitModel> {
    fn unknowns(&self) -> usize {
        self.model.unknowns()
    }
    fn unknown_name(&self, unknown: usize) -> String {
        self.model.unknown_name(unknown)
    }
    fn equation_name(&self, equation: usize) -> String {
        self.model.equation_name(equation)
    }
    fn switch_name(&self, switch: usize) -> String {
        self.model.switch_name(switch)
    }
    fn observed_name(&self, value: usize) -> String {
        self.model.observed_name(self.book.shown[value])
    }
    fn scales(&mut self, t: f64, span: f64) -> Result<Vec<f64>, Failure> {
        self.model.scales(t, span)
    }
    fn index(&self, unknown: usize) -> u8 {
        self.model.index(unknown)
    }
    fn residual(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.model.residual(t, y, yp, out)
    }
    fn sparsity(&self) -> &Sparsity {
        self.model.sparsity()
    }
    fn jacobian(&mut self, t: f64, y: &[f64], yp: &[f64], dy: &mut [f64], dyp: &mut [f64]) -> Result<(), Failure> {
        self.model.jacobian(t, y, yp, dy, dyp)
    }
    fn semi_explicit(&self) -> Option<&[bool]> {
        self.model.semi_explicit()
    }
    fn observe(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.model.observe(t, y, yp, &mut self.book.values)?;
        self.book.hand_out(t, out);
        Ok(())
    }
    fn observed(&self) -> usize {
        self.book.shown.len()
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        self.model.next_jump(t)
    }
    fn is_corner(&mut self, t: f64) -> bool {
        self.model.is_corner(t)
    }
    fn cross_jump(&mut self, t: f64, y: &mut [f64], yp: &mut [f64]) -> Result<(), Failure> {
        self.model.cross_jump(t, y, yp)?;
        self.model.observe(t, y, yp, &mut self.book.values)?;
        self.book.keep(t)
    }
    fn accept(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(), Failure> {
        self.model.accept(t, y, yp)?;
        if self.book.times.last() != Some(&t) {
            self.model.observe(t, y, yp, &mut self.book.values)?;
            self.book.keep(t)?;
        }
        Ok(())
    }
    fn switches(&self) -> usize {
        self.model.switches()
    }
    fn switch_values(&mut self, t: f64, y: &[f64], yp: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.model.switch_values(t, y, yp, g)
    }
}
