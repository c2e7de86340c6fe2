//! Many runs of one model, each with parameters of its own.

mod audit;
mod journal;
mod plan;
mod reduce;
mod structures;

pub use audit::{SetMiss, SweepAudit};
pub use plan::{Samples, Vary};
pub use reduce::{Reduce, Reduction};

use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use halfarrow_compiler::diagnostic::nearest;
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::unit::Unit;
use halfarrow_exec::{self as exec, Execution};
use halfarrow_sim::wide::{LANES, is_wide, simulate_wide};
use halfarrow_sim::{Method, Options, Stopped, Summary, simulate};
use halfarrow_trace::{Column, CsvTable, ParquetTable, write_whole};
use rayon::prelude::*;
use serde::Serialize;

use crate::compiled::Compiled;
use crate::drift::{SetDrift, SweepDrift, of_sweep};
use crate::error::{Error, Problem};
use crate::input::connect;
use crate::model::Model;
use crate::run::{Record, Run, choose, options, projected, units};
use journal::{Journal, JournalChunk};
use plan::Plan;
use reduce::{Reducers, Reducing};
use structures::{Structures, set_all};

/// Sets of a chunk: what is computed in one go, written at once, and lost when the program is killed.
const CHUNK: usize = 4 * LANES;

/// How often a sweep asks whether to go on, at least.
const ASKED: Duration = Duration::from_millis(50);

/// Many runs, and what is kept of each.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// What each run does. With an explicit method of fixed step several sets run at once on vectors.
    pub run: Run,
    /// Parameters that vary, every value with every value of the others, the last one fastest.
    pub vary: Vec<Vary>,
    /// Sets of parameters from a table, each with all that `vary` gives.
    pub samples: Option<Samples>,
    /// What is kept of each run; empty: the last value of everything that is recorded.
    pub reduce: Vec<Reduce>,
    /// Begins anew, whatever an interrupted sweep has left.
    pub restart: bool,
    /// Whether CSV has a second line with the units of the columns.
    pub units: bool,
    /// What these sets are of a larger sweep, if it is computed in parts; `None`: they are all.
    pub part: Option<Part>,
}

/// Where the sets of a sweep stand in a larger one. They have the numbers that they have there, and those are audited that
/// are audited there: the parts together give what the whole sweep gives, to the last bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// How many sets stand before them.
    pub first: usize,
    /// How many sets there are in all.
    pub of: usize,
}

/// A sweep whose rows are kept in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepTable {
    /// The number of each set, its parameters, what is kept of its run, and whether it failed.
    pub columns: Vec<Column>,
    /// What there is to know.
    pub report: SweepReport,
    /// Whether all sets are there; else those that were done when it was stopped, and nothing was audited.
    pub complete: bool,
}

/// What came of a sweep.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweepReport {
    /// Name of the model.
    pub model: String,
    /// Number of sets.
    pub sets: usize,
    /// Sets that were there from an interrupted sweep.
    pub resumed: usize,
    /// Names of the columns, after the number of the set: parameters, what is kept, and whether the run failed.
    pub columns: Vec<String>,
    /// Sets that could not be run to the end, with why: at most the first 100.
    pub failures: Vec<SetFailure>,
    /// Number of such sets.
    pub failed: usize,
    /// How far positions have drifted from relations that only their speeds keep.
    pub drift: Vec<SweepDrift>,
    /// What is to be known of all runs.
    pub notes: Vec<String>,
    /// What the audit found of a sample of the sets.
    pub audit: SweepAudit,
}

/// A set that could not be run to the end.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetFailure {
    /// Its number, from 1.
    pub set: usize,
    /// Why.
    pub reason: String,
}

/// Told that are told; all are counted.
const MOST_TOLD: usize = 100;

impl Model {
    /// Runs a sweep on all cores and writes a row for each set to `out`, `.parquet` or `.csv`: the number of the set from 1,
    /// its parameters, what is kept of the run, and `failed`, 1 if the run did not come to its end (what is kept is then
    /// not a number). Rows stand in the order of the sets. A sample of the sets is run once more and audited. `progress` is told how many sets are done and says whether to
    /// go on.
    ///
    /// What is done stands in a file beside `out`, of its name with `.partial` behind; a sweep that was interrupted goes
    /// on from there. It is taken away in the end.
    ///
    /// # Errors
    /// The model has errors, something is asked that cannot be, a file cannot be written, another sweep is writing it, or
    /// `progress` stops it. Sets that fail are no error.
    pub fn sweep(
        &self,
        sweep: &Sweep,
        out: &Path,
        progress: &mut dyn FnMut(usize, usize) -> bool,
    ) -> Result<SweepReport, Error> {
        let kind = Kind::of(out)?;
        let prepared = self.prepare(sweep)?;
        let Prepared { plan, columns, .. } = &prepared;
        let identity = self.identity(sweep, plan, columns);
        let unwritable = |why: io::Error| Error::from(Problem::Unwritable { path: out.into(), why: why.to_string() });
        let mut journal = Journal::open(out, &identity, columns.len(), sweep.restart)?;
        let resumed = journal.sets();
        let open = plan.chunks().filter(|chunk| !journal.has(*chunk)).collect();
        let work = prepared.work();
        let add = &mut |entry: JournalChunk| journal.add(&entry);
        if !compute(&work, sweep.run.start, (open, resumed), add, progress).map_err(unwritable)? {
            return Err(Error::Interrupted { done: journal.sets(), sets: plan.sets() });
        }
        let audit = audit::sample_of(&work, &sweep.run);
        let told = kind.write(out, columns, sweep.units, &mut journal).map_err(unwritable)?;
        journal.remove();
        Ok(self.sweep_report(&prepared, resumed, told, audit))
    }

    /// Runs a sweep on all cores and keeps its rows in memory: the columns that [`sweep`](Model::sweep) writes.
    ///
    /// # Errors
    /// The model has errors, something is asked that cannot be, or `progress` stops it. Sets that fail are no error.
    pub fn sweep_columns(
        &self,
        sweep: &Sweep,
        progress: &mut dyn FnMut(usize, usize) -> bool,
    ) -> Result<(Vec<Column>, SweepReport), Error> {
        let table = self.sweep_prepared(sweep, &self.prepare(sweep)?, progress);
        match table.complete {
            true => Ok((table.columns, table.report)),
            false => Err(Error::Interrupted { done: table.columns[0].values.len(), sets: table.report.sets }),
        }
    }

    fn sweep_prepared(
        &self,
        sweep: &Sweep,
        prepared: &Prepared,
        progress: &mut dyn FnMut(usize, usize) -> bool,
    ) -> SweepTable {
        let Prepared { plan, columns, .. } = prepared;
        let mut entries: BTreeMap<usize, JournalChunk> = BTreeMap::new();
        let work = prepared.work();
        let add = &mut |entry: JournalChunk| {
            entries.insert(entry.chunk, entry);
            Ok(())
        };
        let kept = compute(&work, sweep.run.start, (plan.chunks().collect(), 0), add, progress);
        // Memory takes whatever comes.
        let complete = kept.unwrap_or(false);
        let audit = if complete { audit::sample_of(&work, &sweep.run) } else { SweepAudit::default() };
        let mut told = Told::default();
        entries.values().for_each(|entry| told.note(entry));
        let width = columns.len();
        let values = |c: usize| entries.values().flat_map(move |e| e.values.iter().skip(c).step_by(width)).copied();
        let column = |(c, (name, unit)): (usize, &(String, String))| Column {
            name: name.clone(),
            unit: unit.clone(),
            values: values(c).collect(),
        };
        let columns = columns.iter().enumerate().map(column).collect();
        SweepTable { columns, report: self.sweep_report(prepared, 0, told, audit), complete }
    }

    /// All that a sweep needs before its first run.
    fn prepare(&self, sweep: &Sweep) -> Result<Prepared, Error> {
        self.prepare_with(self.system_in(sweep.run.form)?, sweep)
    }

    fn prepare_with(&self, mut system: exec::Model, sweep: &Sweep) -> Result<Prepared, Error> {
        if !sweep.run.sensitivities.is_empty() {
            let reason = "sets of a sweep are not differentiated: simulate each with its sensitivities".into();
            return Err(Problem::BadOption { reason }.into());
        }
        connect(&system.program().inputs.clone(), &sweep.run.inputs, |name, t, v| system.connect(name, t, v))?;
        let plan = Plan::new(sweep, &system)?;
        let reducers = reducers(sweep, &mut system)?;
        let mut options = options(&sweep.run)?;
        let over_time = sweep.reduce.iter().any(|reduce| reduce.reduction.is_over_time());
        let by_steps = options.every.is_none() && options.at.is_empty() && !matches!(options.method, Method::Fixed(_));
        options.inside = if over_time && by_steps { usize::MAX } else { 0 };
        options.check(system.program().states.len()).map_err(|e| Problem::BadOption { reason: e.to_string() })?;
        let notes = projected(system.program(), sweep.run.project, sweep.run.method)?;
        crate::cost::check_stops(&system, &options)?;
        let columns = columns(&plan, &reducers, &system);
        let structures = Structures::of(self, &system, sweep, &plan);
        let execution = sweep.run.execution;
        system.execute(execution, None).map_err(|why| Problem::BadOption { reason: why.to_string() })?;
        Ok(Prepared { plan, reducers, options, columns, structures, execution, notes })
    }

    fn sweep_report(&self, prepared: &Prepared, resumed: usize, told: Told, audit: SweepAudit) -> SweepReport {
        SweepReport {
            model: self.name().to_string(),
            sets: prepared.plan.sets(),
            resumed,
            columns: prepared.columns.iter().map(|c| c.0.clone()).collect(),
            failed: told.count,
            failures: told.first,
            drift: of_sweep(told.drifts, &audit.greatest.drift, audit.sets),
            notes: prepared.notes.clone(),
            audit,
        }
    }

    /// What tells one sweep from another.
    fn identity(&self, sweep: &Sweep, plan: &Plan, columns: &[(String, String)]) -> String {
        // Everything that the rows depend on, as text; they are the same by bytecode and machine code.
        let graph = format!("{:?}", self.graph);
        let run = Run { execution: Execution::Auto, ..sweep.run.clone() };
        format!("{} {:016x} {run:?} {plan:?} {columns:?}", self.name(), fingerprint(graph.as_bytes()))
    }
}

impl Compiled {
    /// Runs a sweep on all cores with the equations that are there, and keeps its rows in memory; called on a thread of a pool
    /// of rayon, on that thread. What was set holds where the sweep does not vary it. `progress` is told how many sets are done, and says whether to go on; it is asked some
    /// times a second. What is done when it stops the sweep is kept.
    ///
    /// # Errors
    /// As [`Model::sweep_columns`]; the form is not the minimal one.
    pub fn sweep(&self, sweep: &Sweep, progress: &mut dyn FnMut(usize, usize) -> bool) -> Result<SweepTable, Error> {
        if self.form() != Form::Minimal || sweep.run.form != Form::Minimal {
            let reason = "a compiled model sweeps in the form minimal".into();
            return Err(Problem::BadOption { reason }.into());
        }
        // Other equations, where sets need them, follow from the model with what was set.
        let model = self.model_as_set()?;
        let prepared = model.prepare_with(self.minimal().clone(), sweep)?;
        Ok(model.sweep_prepared(sweep, &prepared, progress))
    }
}

/// What a sweep needs before its first run.
struct Prepared {
    plan: Plan,
    reducers: Vec<Reducers>,
    options: Options,
    /// Names and units.
    columns: Vec<(String, String)>,
    structures: Structures,
    execution: Execution,
    notes: Vec<String>,
}

impl Prepared {
    fn work(&self) -> SweepContext<'_> {
        let Prepared { plan, reducers, options, structures, execution, .. } = self;
        SweepContext { plan, reducers, options, structures, execution: *execution }
    }
}

/// What is told of sets beside their rows: that they came to no end, and how far positions have drifted.
#[derive(Default)]
struct Told {
    count: usize,
    /// The first of them.
    first: Vec<SetFailure>,
    /// How far positions have drifted in the others.
    drifts: Vec<SetDrift>,
}

impl Told {
    fn note(&mut self, entry: &JournalChunk) {
        self.count += entry.failures.len();
        let room = MOST_TOLD.saturating_sub(self.first.len());
        self.first.extend(entry.failures.iter().take(room).cloned());
        entry.drifts.iter().for_each(|drift| SetDrift::gather(&mut self.drifts, drift.clone()));
    }
}

/// Computes the chunks that are open, where so many sets are done already; false if it was stopped.
fn compute(
    work: &SweepContext<'_>,
    start: crate::run::Start,
    (open, mut done): (Vec<usize>, usize),
    keep: &mut dyn FnMut(JournalChunk) -> io::Result<()>,
    progress: &mut dyn FnMut(usize, usize) -> bool,
) -> io::Result<bool> {
    if open.is_empty() || !progress(done, work.plan.sets()) {
        return Ok(open.is_empty());
    }
    if cfg!(target_family = "wasm") || rayon::current_thread_index().is_some() {
        // There are no threads, or this is one of some that have work of their own.
        let mut worker = Worker::new(work);
        for chunk in open {
            let entry = worker.chunk(chunk, start);
            done += entry.rows;
            keep(entry)?;
            if !progress(done, work.plan.sets()) {
                return Ok(false);
            }
        }
        return Ok(true);
    }
    // Few results wait to be kept: memory stays bounded however many sets there are.
    let (sender, receiver): (SyncSender<JournalChunk>, Receiver<JournalChunk>) = sync_channel(16);
    std::thread::scope(|scope| {
        scope.spawn(move || {
            // An end of the other side stops the work.
            let _ = open.into_par_iter().try_for_each_init(
                || Worker::new(work),
                |worker, chunk| sender.send(worker.chunk(chunk, start)).map_err(drop),
            );
        });
        // It ends with this loop, on which those who send to it wait.
        let receiver = receiver;
        loop {
            let go_on = match receiver.recv_timeout(ASKED) {
                Ok(entry) => {
                    done += entry.rows;
                    keep(entry)?;
                    progress(done, work.plan.sets())
                }
                Err(RecvTimeoutError::Timeout) => progress(done, work.plan.sets()),
                Err(RecvTimeoutError::Disconnected) => return Ok(true),
            };
            if !go_on {
                return Ok(false);
            }
        }
    })
}

/// A number that tells contents apart (FNV-1a).
fn fingerprint(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// What all workers read.
struct SweepContext<'a> {
    plan: &'a Plan,
    reducers: &'a [Reducers],
    options: &'a Options,
    structures: &'a Structures,
    execution: Execution,
}

/// A core's own copies of the model, by the numbers of their equations.
struct Worker<'a> {
    work: &'a SweepContext<'a>,
    copies: Vec<Option<Copies<'a>>>,
}

/// A model as a core runs it.
struct Copies<'a> {
    model: &'a Model,
    wide: Option<exec::WideModel>,
    system: exec::Model,
}

/// What became of a set, or why its run came to no end.
type Outcome = Result<Ended, String>;

/// A set whose run came to its end: what is kept of it, and how far its positions have drifted.
struct Ended {
    kept: Vec<f64>,
    drifted: Vec<exec::Drifted>,
}

impl Ended {
    fn of(kept: Reducing<'_>, system: &mut exec::Model, to: f64, x: &[f64]) -> Ended {
        // What has no value there was not measured.
        Ended { kept: kept.finish(), drifted: system.drift(to, x).unwrap_or_default() }
    }
}

impl<'a> Worker<'a> {
    fn new(work: &'a SweepContext<'a>) -> Worker<'a> {
        Worker { work, copies: (0..work.structures.len()).map(|_| None).collect() }
    }

    fn chunk(&mut self, chunk: usize, start: crate::run::Start) -> JournalChunk {
        let sets: Vec<usize> = (chunk * CHUNK..self.work.plan.sets().min((chunk + 1) * CHUNK)).collect();
        let mut entry =
            JournalChunk { chunk, rows: sets.len(), values: Vec::new(), drifts: Vec::new(), failures: Vec::new() };
        let mut outcomes: BTreeMap<usize, Outcome> = BTreeMap::new();
        let mut alike: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for &set in &sets {
            match self.work.structures.number(set) {
                Ok(number) => alike.entry(number).or_default().push(set),
                Err(reason) => _ = outcomes.insert(set, Err(reason)),
            }
        }
        for (number, sets) in alike {
            let copies = self.copies[number].get_or_insert_with(|| Copies::of(self.work, number));
            for group in sets.chunks(LANES) {
                outcomes.extend(group.iter().copied().zip(copies.group(self.work, group, start)));
            }
        }
        for (set, outcome) in outcomes {
            self.row(set, outcome, &mut entry);
        }
        entry
    }

    fn row(&self, set: usize, outcome: Outcome, entry: &mut JournalChunk) {
        entry.values.push(self.work.plan.number(set) as f64);
        entry.values.extend(self.work.plan.values(set));
        let failed = outcome.is_err();
        match outcome {
            Ok(Ended { kept, drifted }) => {
                entry.values.extend(kept);
                let number = self.work.plan.number(set);
                drifted.into_iter().for_each(|d| SetDrift::gather(&mut entry.drifts, SetDrift::of(d, number)));
            }
            Err(reason) => {
                let kept = self.work.reducers.iter().map(|r| r.reductions()).sum();
                entry.values.extend(std::iter::repeat_n(f64::NAN, kept));
                entry.failures.push(SetFailure { set: self.work.plan.number(set), reason });
            }
        }
        entry.values.push(f64::from(failed));
    }
}

impl<'a> Copies<'a> {
    fn of(work: &SweepContext<'a>, number: usize) -> Copies<'a> {
        let structure = work.structures.get(number);
        let mut system = structure.system.clone();
        system.tell_drift(true);
        let wide = is_wide(work.options.method) && work.execution != Execution::Machine;
        let wide = wide.then(|| exec::WideModel::new(&system));
        // That there is machine code where it is asked for was made sure of before. Evaluations of all sets count together.
        let _ = system.execute(work.execution, None);
        Copies { model: &structure.model, wide, system }
    }

    /// Sets with the same equations, together where the method allows that.
    fn group(&mut self, work: &SweepContext<'_>, sets: &[usize], start: crate::run::Start) -> Vec<Outcome> {
        match self.wide.take() {
            Some(mut wide) => {
                let outcomes = self.together(work, &mut wide, sets, start);
                self.wide = Some(wide);
                outcomes
            }
            None => sets.iter().map(|&set| self.alone(work, set, start)).collect(),
        }
    }

    /// One set by itself, with any method.
    fn alone(&mut self, work: &SweepContext<'_>, set: usize, start: crate::run::Start) -> Outcome {
        let mut x = prepare(&mut self.system, self.model, work.plan, set, start)?;
        let mut sink = Reducers::begin(work.reducers, work.options.inside > 0);
        simulate(&mut self.system, work.options, &mut x, &mut sink).map_err(|stopped| stopped.to_string())?;
        Ok(Ended::of(sink, &mut self.system, work.options.to, &x))
    }

    /// Several sets on vectors.
    fn together(
        &self,
        work: &SweepContext<'_>,
        wide: &mut exec::WideModel,
        sets: &[usize],
        start: crate::run::Start,
    ) -> Vec<Outcome> {
        let states = self.system.program().states.len();
        let mut x = vec![[0.0; LANES]; states];
        let mut prepared: Vec<Result<(), String>> = Vec::with_capacity(sets.len());
        let mut wanted = [false; LANES];
        for (lane, &set) in sets.iter().enumerate() {
            let found = prepare(wide.model(lane), self.model, work.plan, set, start);
            wanted[lane] = found.is_ok();
            prepared.push(found.map(|state| x.iter_mut().zip(state).for_each(|(x, state)| x[lane] = state)));
        }
        wide.begin();
        let mut sinks: [_; LANES] = std::array::from_fn(|_| Reducers::begin(work.reducers, work.options.inside > 0));
        let ends = simulate_wide(wide, work.options, &mut x, &mut sinks, wanted);
        let mut outcome = |lane: usize, prepared: Result<(), String>, end: Result<Summary, Stopped>, sink| {
            prepared?;
            end.map_err(|stopped| stopped.to_string())?;
            let x: Vec<f64> = x.iter().map(|x| x[lane]).collect();
            Ok(Ended::of(sink, wide.model(lane), work.options.to, &x))
        };
        let all = prepared.into_iter().zip(ends).zip(sinks).enumerate();
        all.map(|(lane, ((prepared, end), sink))| outcome(lane, prepared, end, sink)).collect()
    }
}

/// Sets the parameters of a set and finds its start.
fn prepare(
    system: &mut exec::Model,
    model: &Model,
    plan: &Plan,
    set: usize,
    start: crate::run::Start,
) -> Result<Vec<f64>, String> {
    set_all(system, plan, set)?;
    let mut x = model.start(system, start).map_err(|error| error.to_string())?;
    system.begin_at_positions(0.0, &mut x);
    Ok(x)
}

/// Names and units of the columns.
fn columns(plan: &Plan, reducers: &[Reducers], system: &exec::Model) -> Vec<(String, String)> {
    let unit = |unit: Option<&Unit>| unit.map(ToString::to_string).unwrap_or_default();
    let mut all = vec![("set".to_string(), String::new())];
    all.extend(plan.names().iter().zip(plan.units()).map(|(name, u)| (name.clone(), unit(u.as_ref()))));
    for (reducer, &i) in reducers.iter().zip(system.recorded()) {
        all.extend(reducer.columns(&unit(system.program().observed[i].unit.as_ref())));
    }
    all.push(("failed".to_string(), String::new()));
    all
}

/// What is kept of each recorded variable, in the order in which they are recorded.
fn reducers(sweep: &Sweep, system: &mut exec::Model) -> Result<Vec<Reducers>, Problem> {
    if sweep.reduce.is_empty() {
        choose(system, &sweep.run.record)?;
    } else {
        let mut names: Vec<String> = Vec::new();
        for wanted in &sweep.reduce {
            if !names.contains(&wanted.variable) {
                names.push(wanted.variable.clone());
            }
        }
        choose(system, &Record::Names(names))?;
    }
    let units = units(system);
    let of = |(&i, unit): (&usize, Option<Unit>)| {
        let name = &system.program().observed[i].name;
        let wanted = sweep.reduce.iter().filter(|r| *r.variable == **name).map(|r| r.reduction).collect();
        Reducers::new(name, unit, if sweep.reduce.is_empty() { vec![Reduction::Final] } else { wanted })
    };
    Ok(system.recorded().iter().zip(units).map(of).collect())
}

/// A file of results while it is written.
enum Table<'a> {
    Csv(CsvTable<&'a mut (dyn io::Write + Send)>),
    Parquet(ParquetTable<&'a mut (dyn io::Write + Send)>),
}

/// What a file of results is.
#[derive(Clone, Copy)]
enum Kind {
    Csv,
    Parquet,
}

impl Kind {
    fn of(path: &Path) -> Result<Kind, Problem> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        match extension.as_str() {
            "csv" => Ok(Kind::Csv),
            "parquet" if cfg!(feature = "parquet") => Ok(Kind::Parquet),
            "parquet" => Err(Problem::NotBuilt { what: "write Parquet", feature: "parquet" }),
            _ => Err(Problem::UnknownKind { path: path.into(), known: vec!["csv", "parquet"] }),
        }
    }

    /// Writes all rows in the order of the sets, a chunk at a time. Gives how many failed, and the first of them.
    fn write(self, path: &Path, columns: &[(String, String)], units: bool, journal: &mut Journal) -> io::Result<Told> {
        let mut told = Told::default();
        let names: Vec<(&str, &str)> = columns.iter().map(|(name, unit)| (name.as_str(), unit.as_str())).collect();
        let written = write_whole(path, |out| {
            let mut table = match self {
                Kind::Csv => Table::Csv(CsvTable::new(out, names.iter().map(|(name, _)| *name))?),
                Kind::Parquet => Table::Parquet(ParquetTable::new(out, &names)?),
            };
            if let (true, Table::Csv(table)) = (units, &mut table) {
                table.line(names.iter().map(|(_, unit)| *unit))?;
            }
            for chunk in 0..journal.chunks() {
                let entry = journal.entry(chunk)?;
                told.note(&entry);
                let column = |c: usize| entry.values.iter().skip(c).step_by(names.len()).copied().collect();
                let columns: Vec<Vec<f64>> = (0..names.len()).map(column).collect();
                let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
                match &mut table {
                    Table::Csv(table) => table.rows(&columns)?,
                    Table::Parquet(table) => table.rows(&columns)?,
                }
            }
            match table {
                Table::Csv(_) => Ok(()),
                Table::Parquet(table) => table.finish(),
            }
        });
        written.map_err(|error| error.source)?;
        Ok(told)
    }
}

/// That a model has this parameter, and that it can be set.
pub(crate) fn known_parameter(system: &exec::Model, name: &str) -> Result<(), Problem> {
    let parameters = &system.program().parameters;
    match parameters.iter().find(|p| p.name == name) {
        Some(parameter) if parameter.constant && !parameter.shapes => {
            Err(Problem::BadOption { reason: format!("`{name}` is a constant: declare it as a param to vary it") })
        }
        Some(_) => Ok(()),
        None => {
            let known = parameters.iter().filter(|p| !p.constant || p.shapes).map(|p| p.name.as_str());
            let hint = nearest(name, known).map(|n| format!("; did you mean `{n}`?")).unwrap_or_default();
            Err(Problem::BadOption { reason: format!("the model has no parameter `{name}`{hint}") })
        }
    }
}
