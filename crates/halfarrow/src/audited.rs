//! A sink that records every step for the audit.

mod beside;

use std::cell::{Cell, OnceCell};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::sync::Arc;

use beside::{Part, PlacedAuditor, Recorded, look};
use halfarrow_audit::{self as audit, Audit, Finding};
use halfarrow_compiler::bond_graph::{BondGraph, Kind};
use halfarrow_compiler::ids::Id;
use halfarrow_compiler::program::{Observed, ObservedKind, bare_name};
use halfarrow_exec as exec;
use halfarrow_sim::{
    Affected, Crawl, Events as _, Failure, Options, Sink, Stopped, Summary, simulate, simulate_implicit,
};
use rustc_hash::FxHashMap;
use serde::Serialize;

use crate::drift::DriftReport;
use crate::run::Recording;
use crate::verdict::Verdict;

/// Samples audited at once at most, and at least: what bounds the memory of long runs.
const CHUNK: usize = 4096;
const LEAST: usize = 32;
/// Values kept for the next audit, of models that have many.
const KEPT: usize = 1 << 22;

/// Greatest misses that the audit found.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct AuditReport {
    /// What they mean for the result.
    pub verdict: Verdict,
    /// What is missed by more than may be, with what to do about it.
    pub warnings: Vec<String>,
    /// Power made or eaten by the junction structure.
    pub power: Option<Deviation>,
    /// Stored less initial, supplied plus dissipated energy.
    pub energy: Option<Deviation>,
    /// Energy that appears or vanishes within so many steps; below the resolution it may have flowed.
    #[serde(skip)]
    pub at_once: Vec<(usize, Deviation)>,
    /// Laws of junctions and elements.
    pub residual: Option<Deviation>,
    /// Stored quantities and integrated signals against the integrals of their rates.
    pub rates: Option<Deviation>,
    /// The most that the samples leave open of energy and rates, wherever that is: what is missed there does not show.
    #[serde(skip)]
    pub open: f64,
    /// How far a run by half the step has gone elsewhere: of implicit steps of fixed length, where the samples leave much open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub halved: Option<Deviation>,
    /// What storages have gained by the events of the model, in J, by their names; below 0 what they have lost.
    pub events: BTreeMap<String, f64>,
    /// How far positions have drifted from relations that their speeds keep, and nothing else.
    pub drift: Vec<DriftReport>,
    /// Storages that make or eat energy, and why.
    pub notes: Vec<String>,
    /// What could not be checked, and why.
    pub unchecked: Vec<String>,
}

/// The greatest miss of a kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Deviation {
    /// Relative to the greatest magnitude of its kind around its place.
    pub value: f64,
    /// When, in s.
    pub time: f64,
    /// Where, and what was missed there.
    pub place: String,
    /// Below this a miss says nothing; 0 where nothing is integrated.
    pub resolution: f64,
}

/// A model that records for the audit what no one else asks for.
pub struct Audited<'a, M> {
    model: &'a mut M,
    book: Book,
}

/// By how many times the error that steps are allowed what acts may be missed: that of a force by what is allowed of the place that a
/// controller reads.
const MISSED: f64 = 30.0;

/// What is recorded.
struct Book {
    /// Taken out where it is handed on.
    auditor: Option<PlacedAuditor>,
    /// What the method was allowed to neglect of each state, as far as it said so.
    neglected: Vec<f64>,
    /// The part of what acts that it may miss.
    tolerance: f64,
    recorded: Arc<Recorded>,
    times: Vec<f64>,
    /// The values of all names at each time, one time after the other.
    samples: Vec<f64>,
    /// Where the recorded values of the user stand among all.
    shown: Vec<usize>,
    /// What each value is.
    origins: Vec<Origin>,
    /// What the user records that was infinite, and when first.
    infinite: BTreeMap<usize, f64>,
    /// What is handed out.
    out: Vec<f64>,
}

impl<'a, M: Recording + Parameters> Audited<'a, M> {
    /// Audits what `model` computes; what it records stays what it is.
    pub fn new(model: &'a mut M, graph: &Arc<BondGraph>) -> Audited<'a, M> {
        let observed = &model.program().observed;
        let asked = model.recorded().to_vec();
        let mut wanted = Wanted::new(observed, graph);
        let auditor = audit::Auditor::new(graph, &mut |name| wanted.column_of(name));
        let Wanted { chosen, origins, .. } = wanted;
        let names: Vec<Arc<str>> = chosen.iter().map(|&i| observed[i].name.clone()).collect();
        let all = [chosen, asked].concat();
        let count = all.len();
        model.record_these(all);
        let known = graph.parameters.values().map(|p| p.name.clone());
        let parameters = known.filter_map(|name| model.parameter(&name).map(|value| (name, value))).collect();
        let book = Book {
            recorded: Arc::new(Recorded { parameters, names: names.clone() }),
            shown: (names.len()..count).collect(),
            samples: Vec::new(),
            times: Vec::new(),
            auditor: Some(PlacedAuditor::Here(Box::new(auditor))),
            neglected: Vec::new(),
            tolerance: 0.0,
            origins,
            infinite: BTreeMap::new(),
            out: Vec::new(),
        };
        Audited { model, book }
    }

    /// The model, which records for the audit.
    pub fn model(&mut self) -> &mut M {
        self.model
    }

    /// What was found.
    pub fn finish(mut self) -> AuditReport {
        let mut auditor = self.book.auditor.take().expect("it is handed back").into_auditor();
        let tracked = self.model.program().tracked.iter();
        tracked.zip(&self.book.neglected).for_each(|(&symbol, error)| auditor.neglect(symbol, *error));
        auditor.tolerate(self.book.tolerance);
        if let Some(last) = self.book.part() {
            look(&mut auditor, &self.book.recorded, &last, &mut Vec::new());
        }
        AuditReport::from(auditor.finish())
    }

    /// What is to be known of the values recorded, given why the run stopped, if it did.
    pub fn notes(&self, failure: Option<&Failure>) -> Vec<String> {
        let program = self.model.program();
        let name = |i: &usize| &program.observed[self.model.recorded()[self.book.shown[*i]]].name;
        let infinite = self.book.infinite.iter();
        let mut notes: Vec<String> =
            infinite.map(|(i, time)| format!("`{}` is infinite at t = {time} s", name(i))).collect();
        let grown = match failure {
            Some(Failure::StepTooSmall { .. }) => self.book.grown(&self.book.suspects(|_| true), GROWN),
            // Steps may get past a pole; what grew so far is none of the run's own.
            None => self.book.grown(&self.book.suspects(|origin| origin == Origin::Source), POLE),
            Some(_) => None,
        };
        if let Some((name, value, time)) = grown {
            notes.push(format!("{name} grows without bound: it is {value:e} at t = {time} s"));
        }
        notes
    }
}

/// What a value of the graph is, in the order in which one that is not finite is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    /// What a source gives.
    Source,
    /// An input or a signal.
    Signal,
    /// Anything else.
    Other,
}

/// What the audit asks for of what can be recorded.
struct Wanted<'p> {
    observed: &'p [Observed],
    /// Whether some of them are efforts without what a constraint carries; these come last.
    has_bare: bool,
    /// Where each name that has a value stands among these, made when one is not found in its turn.
    index_of: OnceCell<FxHashMap<&'p str, u32>>,
    /// Behind what was found last: among states, among other variables, and among those that are asked for after them.
    next: [usize; 3],
    /// What is a source or a signal.
    special: FxHashMap<String, Origin>,
    /// Whether what has one value has it in all modes of the model: it is recorded once then, whatever its names.
    in_all_modes: bool,
    /// The column of each value of the program, or of each name, if it has one.
    columns: Vec<u32>,
    /// What is recorded for the audit, in the order of the columns.
    chosen: Vec<usize>,
    origins: Vec<Origin>,
}

/// How far a name is looked for behind the last one.
const NEAR: usize = 6;

/// The column of what was not asked for yet.
const NONE: u32 = u32::MAX;

impl<'p> Wanted<'p> {
    fn new(observed: &'p [Observed], graph: &BondGraph) -> Wanted<'p> {
        let mut special = FxHashMap::default();
        let mut is_a = |name: String, origin: Origin| _ = special.insert(name, origin);
        graph.inputs.values().for_each(|i| is_a(i.name.clone(), Origin::Signal));
        graph.signals.values().for_each(|s| is_a(s.name.clone(), Origin::Signal));
        graph.held.values().for_each(|h| is_a(h.name.clone(), Origin::Signal));
        graph.elements.values().for_each(|e| match e.kind {
            Kind::EffortSource { .. } => is_a(format!("{}.e", e.name), Origin::Source),
            Kind::FlowSource { .. } => is_a(format!("{}.f", e.name), Origin::Source),
            _ => {}
        });
        let variables = observed.iter().position(|o| !o.default).unwrap_or(observed.len());
        Wanted {
            observed,
            has_bare: observed.last().is_some_and(|o| o.kind == ObservedKind::Bare),
            index_of: OnceCell::new(),
            next: [0, variables, variables],
            special,
            in_all_modes: graph.set_valued.is_empty(),
            columns: Vec::new(),
            chosen: Vec::new(),
            origins: Vec::new(),
        }
    }

    /// Where a name stands that has a value. Names are asked for in about the order in which they stand.
    fn index_of(&mut self, name: &str) -> Option<usize> {
        let all = self.observed;
        let is_it = |i: &usize| *all[*i].name == *name && all[*i].value.is_ok();
        for far in 0..NEAR {
            for next in &mut self.next {
                if let Some(found) = Some(*next + far).filter(|at| *at < all.len()).filter(is_it) {
                    *next = found + 1;
                    return Some(found);
                }
            }
        }
        let known = self.index_of.get_or_init(|| {
            let available = all.iter().enumerate().filter(|(_, o)| o.value.is_ok());
            available.map(|(i, o)| (&*o.name, i as u32)).collect()
        });
        Some(*known.get(name)? as usize)
    }

    /// The column of a variable, from now on if it had none; `None` if it has no value. Of an effort that bears what a
    /// constraint at the rates carries it is what the junctions balance by.
    fn column_of(&mut self, name: &str) -> Option<usize> {
        let bare = if self.has_bare { self.index_of(&bare_name(name)) } else { None };
        let index = bare.or_else(|| self.index_of(name))?;
        let value = self.observed[index].value.as_ref().ok()?.index();
        let place = if self.in_all_modes { value } else { index };
        if self.columns.len() <= place {
            self.columns.resize(place + 1, NONE);
        }
        let origin = self.special.get(name).copied().unwrap_or(Origin::Other);
        let column = &mut self.columns[place];
        if *column == NONE {
            *column = self.chosen.len() as u32;
            self.chosen.push(index);
            self.origins.push(origin);
            return Some(*column as usize);
        }
        // It goes by the name that would be looked at first.
        let at = *column as usize;
        if (origin, &self.observed[index].name) < (self.origins[at], &self.observed[self.chosen[at]].name) {
            (self.origins[at], self.chosen[at]) = (origin, index);
        }
        Some(at)
    }
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

/// It stands above this part of its peak
const FLANK: f64 = 1e-3;

/// for less than this part of the time.
const SHARP: f64 = 1e-5;

impl Book {
    /// Keeps the values at `t`.
    fn keep(&mut self, t: f64, values: &[f64]) -> Result<(), Failure> {
        if let Some(what) = self.not_finite(values) {
            return Err(Failure::NotFinite { time: t, what: Affected::variable(what.to_string()) });
        }
        // A part of the run never ends between the two samples of a jump.
        let chunk = (KEPT / self.recorded.names.len().max(1)).clamp(LEAST, CHUNK);
        if self.times.len() >= chunk && self.times.last() != Some(&t) {
            self.audit();
        }
        self.times.push(t);
        self.samples.extend_from_slice(&values[..self.recorded.names.len()]);
        Ok(())
    }

    /// A value of the graph that is not finite, of a source if there is one.
    fn not_finite(&self, values: &[f64]) -> Option<&str> {
        if values[..self.recorded.names.len()].iter().all(|value| value.is_finite()) {
            return None;
        }
        let found = self.suspects(|_| true).into_iter().find(|&i| !values[i].is_finite());
        found.map(|i| &*self.recorded.names[i])
    }

    /// The columns of some origins in the order in which a value that is not finite is looked for.
    fn suspects(&self, among: impl Fn(Origin) -> bool) -> Vec<usize> {
        let names = &self.recorded.names;
        let mut all: Vec<usize> = (0..names.len()).filter(|&i| among(self.origins[i])).collect();
        all.sort_by_key(|&i| (self.origins[i], &names[i]));
        all
    }

    /// A value that is beyond all it is for half of the time by this factor at its greatest: its name, what it is then, when.
    fn grown(&self, among: &[usize], factor: f64) -> Option<(&str, f64, f64)> {
        among.iter().find_map(|&i| {
            let column: Vec<f64> = self.samples.iter().skip(i).step_by(self.recorded.names.len()).copied().collect();
            let peak = (0..column.len()).max_by(|&a, &b| column[a].abs().total_cmp(&column[b].abs()))?;
            let usual = self.usual(&column);
            let grew = usual > 0.0 && column[peak].abs() > factor * usual;
            (grew && (factor < POLE || self.is_sharp(&column, peak)))
                .then(|| (&*self.recorded.names[i], column[peak], self.times[peak]))
        })
    }

    /// Whether a peak is too sharp for a pulse, or for what comes or goes.
    fn is_sharp(&self, column: &[f64], peak: usize) -> bool {
        let high = |k: usize| column[k].abs() > FLANK * column[peak].abs();
        let high: f64 =
            (1..column.len()).filter(|&k| high(k - 1) && high(k)).map(|k| self.times[k] - self.times[k - 1]).sum();
        let span = self.times.last().zip(self.times.first()).map_or(0.0, |(last, first)| last - first);
        high < SHARP * span
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
    fn shown(&mut self, t: f64, values: &[f64]) -> &[f64] {
        self.out.clear();
        self.out.extend(self.shown.iter().map(|&i| values[i]));
        for k in (0..self.out.len()).filter(|&k| self.out[k].is_infinite()) {
            self.infinite.entry(k).or_insert(t);
        }
        &self.out
    }

    /// Audits what has been recorded, and keeps the last sample to go on from.
    fn audit(&mut self) {
        let (Some(part), Some(auditor)) = (self.part(), self.auditor.take()) else { return };
        let size = part.samples.len();
        let (auditor, mut room) = auditor.take(&self.recorded, part);
        room.clear();
        room.reserve(size);
        room.append(&mut self.samples);
        (self.auditor, self.samples) = (Some(auditor), room);
    }

    /// What has been recorded since the last part, from its last sample on, which is kept.
    fn part(&mut self) -> Option<Part> {
        let last = self.times.len().checked_sub(1).filter(|&last| last > 0)?;
        let kept = self.samples[last * self.recorded.names.len()..].to_vec();
        let now = self.times[last];
        let times = std::mem::replace(&mut self.times, vec![now]);
        Some(Part { times, samples: std::mem::replace(&mut self.samples, kept) })
    }
}

impl Audited<'_, exec::Model> {
    /// Runs it, as [`simulate`].
    ///
    /// # Errors
    /// As [`simulate`].
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub fn simulate(&mut self, options: &Options, x: &mut [f64], sink: &mut dyn Sink) -> Result<Summary, Stopped> {
        let (first, recorded, count) =
            (self.book.recorded.names.len(), self.model.observed(), self.model.varied_by().len());
        self.book.shown.extend(recorded..recorded + count * (recorded - first));
        let mut sink = Auditing { book: &mut self.book, sink, rtol: options.rtol };
        if count == 0 {
            return simulate(self.model, options, x, &mut sink);
        }
        let mut varied = exec::Varied::new(self.model, first);
        let mut y = varied.point(x);
        let mut done = simulate(&mut varied, options, &mut y, &mut sink);
        x.copy_from_slice(&y[..x.len()]);
        if let Err(Stopped { without_rates: Some((_, y)), .. }) = &mut done {
            y.truncate(x.len());
        }
        done
    }

    /// Runs it, as [`simulate`], so that it can be followed backwards: with what it leaves behind, and the number of the first
    /// recorded value that was asked for.
    ///
    /// # Errors
    /// As [`simulate`].
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub fn simulate_taped(
        &mut self,
        options: &Options,
        x: &mut [f64],
        sink: &mut dyn Sink,
    ) -> Result<(Summary, exec::Tape, usize), Stopped> {
        let first = self.book.recorded.names.len();
        let mut sink = Auditing { book: &mut self.book, sink, rtol: options.rtol };
        let mut taped = exec::Taped::new(self.model);
        let mut sink = Numbering { sink: &mut sink, observations: taped.observations(), sampled: Vec::new() };
        let summary = simulate(&mut taped, options, x, &mut sink)?;
        let sampled = sink.sampled;
        Ok((summary, taped.into_tape(&sampled), first))
    }

    /// Names the source behind rates that are not finite, if there is one.
    pub fn explain(&mut self, stopped: &Stopped) -> Failure {
        let failure = stopped.failure.clone();
        let Failure::NotFinite { time, what } = &failure else { return failure };
        let Some((t, x)) = stopped.without_rates.as_ref().filter(|(t, _)| t == time) else { return failure };
        let mut values = vec![0.0; self.model.observed()];
        // It has no value, which is why it is looked at; what has one is written.
        let _ = self.model.observe(*t, x, &mut values);
        match self.book.not_finite(&values) {
            Some(name) if *what != Affected::variable(name.to_string()) => {
                let what = Affected::Through(name.to_string(), Box::new(what.clone()));
                Failure::NotFinite { time: *time, what }
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
        let mut sink = Auditing { book: &mut self.book, sink, rtol: options.rtol };
        simulate_implicit(self.model, options, y, yp, &mut sink)
    }
}

/// The sink that sees every step, and hands on what another one asked for.
struct Auditing<'a> {
    book: &'a mut Book,
    sink: &'a mut dyn Sink,
    rtol: f64,
}

impl Sink for Auditing<'_> {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.sink.sample(t, self.book.shown(t, values));
    }
    fn watches(&self) -> bool {
        true
    }
    fn watch(&mut self, t: f64, values: &[f64]) -> Result<(), Failure> {
        self.book.keep(t, values)
    }
    fn progress(&mut self, t: f64) -> ControlFlow<()> {
        self.sink.progress(t)
    }
    fn tolerances(&mut self, magnitudes: &[f64], absolute: &[f64]) {
        self.book.neglected.clear();
        self.book.neglected.extend(absolute.iter().map(|error| error / self.rtol));
        self.book.tolerance = MISSED * self.rtol;
        self.sink.tolerances(magnitudes, absolute);
    }
    fn crawls(&mut self, crawl: &Crawl) {
        self.sink.crawls(crawl);
    }
}

/// The sink that notes which observations were samples.
struct Numbering<'a> {
    sink: &'a mut dyn Sink,
    observations: Rc<Cell<usize>>,
    sampled: Vec<usize>,
}

impl Sink for Numbering<'_> {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.sampled.push(self.observations.get());
        self.sink.sample(t, values);
    }
    fn watches(&self) -> bool {
        self.sink.watches()
    }
    fn watch(&mut self, t: f64, values: &[f64]) -> Result<(), Failure> {
        self.sink.watch(t, values)
    }
    fn progress(&mut self, t: f64) -> ControlFlow<()> {
        self.sink.progress(t)
    }
    fn tolerances(&mut self, magnitudes: &[f64], absolute: &[f64]) {
        self.sink.tolerances(magnitudes, absolute);
    }
    fn crawls(&mut self, crawl: &Crawl) {
        self.sink.crawls(crawl);
    }
}

impl From<Audit> for AuditReport {
    fn from(a: Audit) -> AuditReport {
        let miss = |found: Option<Finding>| found.map(Deviation::from);
        AuditReport {
            power: miss(a.power),
            energy: miss(a.energy),
            at_once: a.at_once.into_iter().map(|(steps, found)| (steps, found.into())).collect(),
            residual: miss(a.residual),
            rates: miss(a.rates),
            open: a.open,
            drift: a.drift.into_iter().map(DriftReport::from).collect(),
            notes: a.notes,
            events: a.events,
            unchecked: a.unchecked,
            ..AuditReport::default()
        }
    }
}

impl From<Finding> for Deviation {
    fn from(f: Finding) -> Deviation {
        Deviation { value: f.value, time: f.time, place: f.place, resolution: f.resolution }
    }
}
