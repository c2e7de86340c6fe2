//! A run: what is asked of it, and what comes of it.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;

use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::bond_graph::{Element, Kind, ParameterKind, PortRef, Storage};
use halfarrow_compiler::diagnostic::{Diagnostic, codes, nearest};
use halfarrow_compiler::equations::{Equations, Form};
use halfarrow_compiler::program::{Program, Unkept, UnkeptRelation};
use halfarrow_compiler::unit::Unit;
use halfarrow_exec::{self as exec, EquilibriumError, Execution, StartError};
use halfarrow_sim::{
    AbsoluteTolerance, Affected, Crawl, Events as _, Failure, ImplicitSystem as _, Method, Options, Sink, Summary,
};
use halfarrow_trace::Trace;
use serde::Serialize;

use crate::advice::{advice, off_step};
use crate::alternatives::Alternatives;
use crate::audited::{AuditReport, Audited};
use crate::clock::Moment;
use crate::compiled::Ready;
use crate::cost;
use crate::error::{Error, Problem};
use crate::execution::{RoutineReport, execute, executed};
use crate::gradient::{Taped, is_stiff};
use crate::halving;
use crate::input::{Input, connect};
use crate::model::Model;
use crate::sensitivity::{By, column, quantities, vary, with_derivatives};
use crate::verdict::{Made, OPEN};

/// Steps with samples inside, at most: so many make curves smooth by themselves, and a long run does not take four times the
/// memory.
const SMOOTH: usize = 2000;
/// Runs that record more variables than this record the ends of their steps only.
const MOST_INSIDE: usize = 500;
/// So do runs of models with more variables than this: the audit looks at all of them at each sample.
const LARGE: usize = 20_000;

/// What to run and how exactly. Times in s, values in SI units; series of inputs and recorded outputs in the units that
/// their declarations give.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// End of the run; it begins at 0. Above 0.
    pub to: f64,
    /// Time between recorded points; `None`: every step. Start and end are always recorded.
    pub every: Option<f64>,
    /// Times that are recorded in the place of these, in s, ascending; the end is always recorded. Empty: as `every` says.
    pub at: Vec<f64>,
    /// Whether methods of variable step record three points inside each step as well, where every step is recorded: what is
    /// greatest and what means are is then known as exactly as the run, and curves are smooth. Gradients have them in all steps,
    /// other runs in the first 2000, if they record at most 500 variables of a model with at most 20,000.
    pub inside: bool,
    /// The formulation.
    pub form: Form,
    /// Form `stiff`: square of the ratio of the springs' frequency to the fastest rate of the model; `None`: 1e6.
    pub stiffness: Option<f64>,
    /// Form `stiff`: damping of the springs in parts of critical damping; `None`: 1.
    pub damping: Option<f64>,
    /// The method.
    pub method: Method,
    /// Step of a method with fixed step, longest step of the others.
    pub step: Option<f64>,
    /// Relative error allowed in a step.
    pub rtol: f64,
    /// Absolute error allowed in a step, in the unit of each state; `None`: scaled to each state.
    pub atol: Option<f64>,
    /// Whether positions that only speeds keep together are put back onto the relations between them after each step, by
    /// the least change that does it.
    pub project: bool,
    /// Whether reactions that are not unique, of constraints that repeat others, are recorded as those of least norm. In the
    /// form `minimal`, by [`Model::simulate`].
    pub minimum_norm: bool,
    /// Inputs that are given: their names and what they are over time. The others keep their defaults.
    pub inputs: Vec<(String, Input)>,
    /// Where to start.
    pub start: Start,
    /// What to record.
    pub record: Record,
    /// What the run is differentiated by: parameters, start values (`body.q(0)`: of a variable for which the model gives one,
    /// or that starts empty) and constant inputs. The derivatives of what is recorded, exact ones, follow its columns in this
    /// order, each by the SI unit of what it is by. In the form `minimal`.
    pub sensitivities: Vec<String>,
    /// Bytecode or machine code. Results are the same to the last bit.
    pub execution: Execution,
}

/// Where a run starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// As the model says.
    Given,
    /// At rest, as near as possible to what the model says.
    Equilibrium,
}

/// What is recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Record {
    /// States and outputs.
    Default,
    /// States and outputs, and these variables.
    Also(Vec<String>),
    /// Everything that has a value.
    All,
    /// These variables, in this order.
    Names(Vec<String>),
}

impl Default for Run {
    /// To 1 s with the default method at `rtol` 1e-6, every step, states and outputs.
    fn default() -> Run {
        Run {
            to: 1.0,
            every: None,
            at: Vec::new(),
            inside: false,
            form: Form::Minimal,
            stiffness: None,
            damping: None,
            method: Method::Auto,
            step: None,
            rtol: 1e-6,
            atol: None,
            project: false,
            minimum_norm: false,
            inputs: Vec::new(),
            start: Start::Given,
            record: Record::Default,
            sensitivities: Vec::new(),
            execution: Execution::Auto,
        }
    }
}

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulated {
    /// What was recorded.
    pub trace: Trace,
    /// What it took, and how well it did.
    pub report: RunReport,
}

/// What a run took, and how well it did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunReport {
    /// Name of the model.
    pub model: String,
    /// The time reached, in s.
    pub reached: f64,
    /// Accepted steps.
    pub steps: usize,
    /// Steps tried in vain.
    pub rejected: usize,
    /// Evaluations of the rates.
    pub evaluations: usize,
    /// Directional derivatives of the rates.
    pub tangents: usize,
    /// Jumps of sources and inputs that were met.
    pub jumps: usize,
    /// Corners of inputs that steps ended at: only slopes jump there.
    pub corners: usize,
    /// Switching conditions that changed their side.
    pub switches: usize,
    /// How often other variables became independent, near positions where the first ones do not tell the motion.
    pub exchanges: usize,
    /// How often positions were put back onto relations that their speeds keep.
    pub projections: usize,
    /// Whether the stiff method took over.
    pub stiff: bool,
    /// What ran as machine code, and why.
    pub execution: Vec<RoutineReport>,
    /// The audit.
    pub audit: AuditReport,
    /// What was left out or is to be known.
    pub notes: Vec<String>,
    /// How exact each state or unknown was kept in the end; of methods of variable step.
    #[serde(skip)]
    pub tolerances: Vec<StateTolerance>,
    /// What took how long.
    #[serde(skip)]
    pub timings: Timings,
}

impl RunReport {
    /// What the audit says, beside what else is to be known.
    fn take_notes(&mut self) {
        let RunReport { audit, notes, .. } = self;
        notes.extend(audit.notes.iter().chain(&audit.warnings).cloned());
    }
}

/// How exact a state is kept, in SI units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateTolerance {
    /// The state.
    pub name: String,
    /// The magnitude that it is taken to have.
    pub scale: f64,
    /// Absolute error allowed in a step.
    pub absolute: f64,
}

/// What took how long, in s.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Timings {
    /// Causality, equations and their program.
    pub equations: f64,
    /// Consistent start values.
    pub start: f64,
    /// The run, recording and audit included.
    pub run: f64,
}

/// How far a run has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress<'a> {
    /// The time reached, in s.
    pub time: f64,
    /// What is to be known at once; all of them are in the report too.
    pub note: Option<&'a str>,
}

/// A run that is about to begin.
struct Begun {
    start: Vec<f64>,
    options: Options,
    by: Vec<By>,
    notes: Vec<String>,
}

/// A run that stopped before its end.
#[derive(Debug, Clone, PartialEq)]
pub struct Stopped {
    /// Why.
    pub failure: Failure,
    /// What was recorded before.
    pub trace: Trace,
    /// What it took so far.
    pub report: RunReport,
}

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.failure.fmt(f)
    }
}

/// What to know of unknowns that nothing determined.
fn floats(names: Vec<String>) -> Option<String> {
    let verb = if names.len() == 1 { "floats" } else { "float" };
    (!names.is_empty()).then(|| {
        format!(
            "{} {verb} for a while: what the laws say lies below rounding, so the least change is taken; an R of large resistance beside them would tell",
            names.join(", ")
        )
    })
}

/// What to know of contacts that are hit at one instant: by which rule.
fn shares((count, first, names): (usize, f64, Vec<String>)) -> String {
    let more = match count {
        1 => String::new(),
        2 => ", and once more later".to_string(),
        _ => format!(", and {} times more later", count - 1),
    };
    format!(
        "impulses of {} at t = {first} s are shared out all at once{more}; sides that are a little apart hand them on one by one, which may be another motion",
        names.join(", ")
    )
}

/// That a place of rest has others beside it.
pub(crate) fn one_of_many(free: usize) -> Option<String> {
    let combinations =
        if free == 1 { "a combination of states is".into() } else { format!("{free} combinations of states are") };
    (free > 0).then(|| format!("the equilibrium is one of many, near the start values: {combinations} free"))
}

/// A result that satisfies the model, as the audit found: what is doubtful is said, what is wrong is refused.
fn judged(outcome: Result<Simulated, Error>, made: &Made) -> Result<Simulated, Error> {
    match outcome {
        Ok(mut done) => {
            done.report.audit.judge(made);
            if let Some(failure) = done.report.audit.refusal(made) {
                return Err(Error::Run(Box::new(Stopped { failure, trace: done.trace, report: done.report })));
            }
            done.report.take_notes();
            Ok(done)
        }
        Err(Error::Run(mut stopped)) => {
            if matches!(stopped.failure, Failure::OutOfDomain { .. }) {
                stopped.report.audit.forget_what_is_no_number();
            }
            stopped.report.audit.judge(made);
            stopped.report.take_notes();
            Err(Error::Run(stopped))
        }
        error => error,
    }
}

impl Model {
    /// Computes a trajectory. `progress` is told the time reached after every step, and what is to be known as soon as it is,
    /// and says whether to go on. For many runs of one model see [`compile`](Model::compile).
    ///
    /// # Errors
    /// The model has errors, something is asked that cannot be, or the run stops; what was computed so far is kept.
    pub fn simulate(&self, run: &Run, progress: &mut dyn FnMut(Progress<'_>) -> bool) -> Result<Simulated, Error> {
        let begun = Moment::now();
        let compiled = if run.minimum_norm { self.compile_sharing(run.form)? } else { self.compile(run.form)? };
        let equations = begun.elapsed().as_secs_f64();
        let mut done = compiled.simulate(run, progress);
        match &mut done {
            Ok(done) => done.report.timings.equations = equations,
            Err(Error::Run(stopped)) => stopped.report.timings.equations = equations,
            Err(_) => {}
        }
        done
    }

    /// A trajectory of a system that is ready; it is used up.
    pub(crate) fn simulate_with(
        &self,
        system: Ready,
        run: &Run,
        progress: &mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Result<Simulated, Error> {
        let begun = Moment::now();
        let mut timings = Timings::default();
        let mut done = match system {
            Ready::Explicit(system) => self.run_explicit(*system, run, &mut timings, progress),
            Ready::Form { system, explicit } => self.run_form((*system, explicit), run, &mut timings, progress),
        };
        timings.run = begun.elapsed().as_secs_f64() - timings.start;
        self.watch.note("start", timings.start);
        self.watch.note("run", timings.run);
        match &mut done {
            Ok(done) => done.report.timings = timings,
            Err(Error::Run(stopped)) => stopped.report.timings = timings,
            Err(_) => {}
        }
        judged(done, &Made::by(run))
    }

    fn run_explicit(
        &self,
        mut system: exec::Model,
        run: &Run,
        timings: &mut Timings,
        progress: &mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Result<Simulated, Error> {
        let begun = Moment::now();
        let Begun { start, options, by, notes } = self.begin_explicit(&mut system, run)?;
        timings.start = begun.elapsed().as_secs_f64();
        let mut done =
            self.integrate(&mut system, start, (&options, run.execution, &by), (notes, None), &mut *progress)?;
        let fixed = matches!(options.method, Method::Fixed(_));
        if fixed && done.report.audit.open > OPEN && !done.report.audit.is_beyond(&Made::by(run)) {
            let start = self.start(&mut system, run.start)?;
            let options = Options { step: options.step.map(|step| 0.5 * step), ..options };
            let halved =
                self.integrate(&mut system, start, (&options, run.execution, &by), (Vec::new(), None), progress);
            done.report.audit.halved = halved.ok().and_then(|halved| halving::apart(&done.trace, &halved.trace));
        }
        Ok(done)
    }

    /// A run that can be followed backwards.
    pub(crate) fn run_taped(
        &self,
        system: &mut exec::Model,
        run: &Run,
        progress: &mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Result<(Vec<By>, Options, Simulated, Taped), Error> {
        let Begun { start, mut options, by, notes } = self.begin_explicit(system, run)?;
        options.inside = if run.inside { usize::MAX } else { 0 };
        let mut taped = None;
        let done = self.integrate(system, start, (&options, run.execution, &[]), (notes, Some(&mut taped)), progress);
        let done = judged(done, &Made::by(run))?;
        Ok((by, options, done, taped.expect("a run that came to its end")))
    }

    /// Finds the start of a run, and what is known before it.
    fn begin_explicit(&self, system: &mut exec::Model, run: &Run) -> Result<Begun, Error> {
        if run.method.asks_for_derivatives() {
            system.prepare_derivatives().map_err(|failure| self.stopped(failure))?;
        }
        connect(&system.program().inputs.clone(), &run.inputs, |name, t, v| system.connect(name, t, v))?;
        if run.form != Form::Minimal {
            without_sensitivities(run)?;
            without_springs(run)?;
        }
        let mut notes = choose(system, &run.record)?;
        notes.extend(projected(system.program(), run.project, run.method)?);
        let by = quantities(system, run)?;
        vary(system, &by)?;
        let (start, free) = self.start_with_freedom(system, run.start)?;
        notes.extend(one_of_many(free));
        let mut options = options(run)?;
        options.inside = inside(run, system.observed(), system.program());
        if options.check(start.len()).is_ok() {
            cost::check(system, &start, &options, system.observed())?;
        }
        if let (Method::Fixed(method), Some(step)) = (options.method, options.step) {
            notes.extend(advice(system, &start, method, step));
            notes.extend(off_step(system, step));
        }
        Ok(Begun { start, options, by, notes })
    }

    fn run_form(
        &self,
        (mut system, explicit): (exec::ImplicitModel, bool),
        run: &Run,
        timings: &mut Timings,
        progress: &mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Result<Simulated, Error> {
        let begun = Moment::now();
        without_sensitivities(run)?;
        set_up(&mut system, run)?;
        let mut notes = choose(&mut system, &run.record)?;
        match explicit {
            true => notes.extend(projected(system.program(), run.project, run.method)?),
            false if run.project => {
                let reason = format!(
                    "project is for explicit equations: the form {} holds its constraints itself (try minimal)",
                    run.form.name()
                );
                return Err(Problem::BadOption { reason }.into());
            }
            false => {}
        }
        let (x, free) = self.start_with_freedom(system.reference_mut(), run.start)?;
        notes.extend(one_of_many(free));
        set_spring_rate(&mut system, &x)?;
        let (y, yp) = system.start_at(0.0, &x).map_err(|failure| self.stopped(failure))?;
        timings.start = begun.elapsed().as_secs_f64();
        let mut options = if explicit { options(run)? } else { implicit_options(run)? };
        options.inside = inside(run, system.recorded().len(), system.reference().program());
        if options.check(y.len()).is_ok() {
            let recorded = Recording::recorded(&system).len();
            cost::check(system.reference_mut(), &x, &options, recorded)?;
        }
        match explicit {
            true => self.integrate(&mut system.into_form(), y, (&options, run.execution, &[]), (notes, None), progress),
            false => self.integrate_implicit(&mut system, (y, yp), (&options, run.execution), notes, progress),
        }
    }

    fn integrate(
        &self,
        system: &mut exec::Model,
        mut x: Vec<f64>,
        (options, execution, by): (&Options, Execution, &[By]),
        (notes, taped): (Vec<String>, Option<&mut Option<Taped>>),
        progress: &mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Result<Simulated, Error> {
        let mut sink = Recorder::new(system, by, notes, progress);
        let options = &with_derivatives(system, options, by, x.len());
        let mut audited = Audited::new(system, &self.graph);
        execute(audited.model(), execution, options)?;
        let mut outcome = match taped {
            None => {
                audited.model().begin_at_positions(0.0, &mut x);
                audited.simulate(options, &mut x, &mut sink)
            }
            Some(taped) => audited.simulate_taped(options, &mut x, &mut sink).map(|(summary, tape, first)| {
                *taped = Some(Taped { tape, first, stiff: is_stiff(options, &summary) });
                summary
            }),
        };
        if let Err(stopped) = &mut outcome {
            let ended = audited.model().end_of_derivatives(&stopped.failure, stopped.time);
            stopped.failure = ended.unwrap_or_else(|| audited.explain(stopped));
        }
        // Those of the mode in which it ends.
        let names = audited.model().program().own_states().iter().map(|state| state.name.clone()).collect();
        let tolerances = sink.tolerances(names);
        let mut notes = sink.notes;
        notes.extend(audited.notes(outcome.as_ref().err().map(|s| &s.failure)));
        let audit = audited.finish();
        notes.extend(floats(system.floating()));
        notes.extend(system.shared_impulses().map(shares));
        kept(self.ended(outcome, options, sink.trace, audit, notes), tolerances, executed(system))
    }

    fn integrate_implicit(
        &self,
        system: &mut exec::ImplicitModel,
        (mut y, mut yp): (Vec<f64>, Vec<f64>),
        (options, execution): (&Options, Execution),
        notes: Vec<String>,
        progress: &mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Result<Simulated, Error> {
        let mut sink = Recorder::new(system, &[], notes, progress);
        let mut audited = Audited::new(system, &self.graph);
        execute(audited.model(), execution, options)?;
        let outcome = audited.simulate(options, (&mut y, &mut yp), &mut sink);
        // Those of the mode in which it ends.
        let unknowns = audited.model();
        let names = (0..unknowns.unknowns()).map(|i| unknowns.unknown_name(i)).collect();
        let tolerances = sink.tolerances(names);
        let mut notes = sink.notes;
        notes.extend(audited.notes(outcome.as_ref().err().map(|s| &s.failure)));
        let audit = audited.finish();
        notes.extend(floats(system.floating()));
        kept(self.ended(outcome, options, sink.trace, audit, notes), tolerances, executed(system))
    }

    fn ended(
        &self,
        outcome: Result<Summary, halfarrow_sim::Stopped>,
        options: &Options,
        trace: Trace,
        audit: AuditReport,
        notes: Vec<String>,
    ) -> Result<Simulated, Error> {
        match outcome {
            Ok(summary) => Ok(Simulated { trace, report: self.run_report(&summary, options.to, audit, notes) }),
            Err(stopped) if matches!(stopped.failure, Failure::BadOption { .. }) => {
                Err(Problem::BadOption { reason: stopped.failure.to_string() }.into())
            }
            Err(stopped) => {
                let report = self.run_report(&stopped.summary, stopped.time, audit, notes);
                Err(Error::Run(Box::new(Stopped { failure: self.blame_start(stopped.failure), trace, report })))
            }
        }
    }

    /// A form beside the minimal one, with inputs connected and springs as asked.
    pub(crate) fn implicit_system(&self, equations: &Equations, run: &Run) -> Result<exec::ImplicitModel, Error> {
        let mut system = self.form_system(equations)?;
        set_up(&mut system, run)?;
        Ok(system)
    }

    /// A form beside the minimal one.
    pub(crate) fn form_system(&self, equations: &Equations) -> Result<exec::ImplicitModel, Error> {
        self.form_beside(equations, self.system_in(Form::Minimal)?)
    }

    /// The same beside a minimal form that is there already.
    pub(crate) fn form_beside(
        &self,
        equations: &Equations,
        minimal: exec::Model,
    ) -> Result<exec::ImplicitModel, Error> {
        let program = self.program_of(equations);
        let code = || match self.graph.set_valued.is_empty() {
            true => exec::ImplicitModel::new(program, minimal),
            false => {
                let modes = Arc::new(Alternatives::new(&self.graph, equations));
                exec::ImplicitModel::with_modes(program, modes, minimal)
            }
        };
        self.watch.time("code", code).map_err(|failure| self.stopped(failure))
    }

    fn run_report(&self, summary: &Summary, reached: f64, audit: AuditReport, notes: Vec<String>) -> RunReport {
        RunReport {
            model: self.graph.name.clone(),
            reached,
            steps: summary.steps,
            rejected: summary.rejected,
            evaluations: summary.rates,
            tangents: summary.tangents,
            jumps: summary.jumps,
            corners: summary.corners,
            switches: summary.crossings,
            exchanges: summary.exchanges,
            projections: summary.projections,
            stiff: summary.stiff,
            execution: Vec::new(),
            audit,
            notes,
            tolerances: Vec::new(),
            timings: Timings::default(),
        }
    }

    /// The system of an explicit form.
    pub(crate) fn system_in(&self, form: Form) -> Result<exec::Model, Error> {
        let equations = self.equations_in(form)?;
        let planned = self.planned(&equations);
        drop(equations);
        self.coded(planned)
    }

    /// The same as the continuation of smaller ones, where the model continues such.
    pub(crate) fn continued_system(&self, form: Form) -> Option<exec::Model> {
        self.family.as_ref()?;
        let program = self.watch.time("program", || self.continued_program(form))?;
        let system = self.coded((program, Arc::new(Alternatives::of_form(&self.graph, form)))).ok()?;
        // What was decided by the values of parameters may be otherwise in a larger model.
        system.broken().is_none().then_some(system)
    }

    pub(crate) fn system(&self, equations: &Equations) -> Result<exec::Model, Error> {
        self.coded(self.planned(equations))
    }

    /// The program of equations, and what makes those of other modes: nothing else is needed of them for a run.
    pub(crate) fn planned(&self, equations: &Equations) -> (Program, Arc<Alternatives>) {
        (self.program_of(equations), Arc::new(Alternatives::new(&self.graph, equations)))
    }

    pub(crate) fn coded(&self, (program, alternatives): (Program, Arc<Alternatives>)) -> Result<exec::Model, Error> {
        let code = || exec::Model::of(Arc::new(exec::Compiled::new(program).with_alternatives(alternatives)));
        self.watch.time("code", code).map_err(|failure| self.stopped(failure))
    }

    /// Says of a value that is not finite at the start which stored quantity it comes from, if that starts at 0 since nothing
    /// else is given.
    fn blame_start(&self, failure: Failure) -> Failure {
        let Failure::NotFinite { time: 0.0, what } = &failure else { return failure };
        let (variable, behind) = match what {
            Affected::Variables(names) => (names.first(), String::new()),
            Affected::Through(variable, other) => (Some(variable), format!(" and with it {other},")),
            Affected::Rate(_) | Affected::Other(_) => return failure,
        };
        let Some((element, storage, start)) = variable.and_then(|name| self.starts_empty(name)) else { return failure };
        let stored = self.graph.exprs.name(storage.stored[0]);
        let names =
            if let Affected::Variables(_) = what { what.to_string() } else { variable.cloned().unwrap_or_default() };
        let why = format!("{names}, where {stored} starts at 0 since `{}` gives no `{start}`,", element.name);
        Failure::NotFinite { time: 0.0, what: Affected::Other(why + &behind) }
    }

    /// The storage of which a variable has this name, if the model gives it no start value; and what would give it one.
    fn starts_empty(&self, name: &str) -> Option<(&Element, &Storage, &'static str)> {
        let graph = &self.graph;
        let is_of =
            |port: PortRef| ["e", "f", "p", "q"].iter().any(|v| format!("{}.{v}", graph.port_name(port)) == name);
        let ports = |element, e: &Element| (0..e.ports.len() as u32).map(move |port| PortRef { element, port });
        let (_, element) = graph.elements.iter().find(|(id, e)| ports(*id, e).any(is_of))?;
        match &element.kind {
            Kind::Inertance(storage) if storage.initial.is_empty() => Some((element, storage, "p0")),
            Kind::Compliance(storage) if storage.initial.is_empty() => Some((element, storage, "q0")),
            _ => None,
        }
    }

    /// A run that stopped with nothing recorded.
    pub(crate) fn stopped_at(&self, stopped: halfarrow_sim::Stopped) -> Error {
        let report = self.run_report(&stopped.summary, stopped.time, AuditReport::default(), Vec::new());
        Error::Run(Box::new(Stopped { failure: stopped.failure, trace: Trace::default(), report }))
    }

    /// A run that never began.
    pub(crate) fn stopped(&self, failure: Failure) -> Error {
        let report = self.run_report(&Summary::default(), 0.0, AuditReport::default(), Vec::new());
        Error::Run(Box::new(Stopped { failure: self.blame_start(failure), trace: Trace::default(), report }))
    }

    pub(crate) fn start(&self, system: &mut exec::Model, start: Start) -> Result<Vec<f64>, Error> {
        self.start_with_freedom(system, start).map(|(x, _)| x)
    }

    /// The start, and how many combinations of states are free there: 0 unless it is one of many places of rest.
    pub(crate) fn start_with_freedom(
        &self,
        system: &mut exec::Model,
        start: Start,
    ) -> Result<(Vec<f64>, usize), Error> {
        let x = system.initialise(0.0).map_err(|error| self.no_start(error))?;
        match start {
            Start::Given => Ok((x, 0)),
            Start::Equilibrium => match system.equilibrium(0.0, &x) {
                Ok(equilibrium) => Ok((equilibrium.x, equilibrium.free)),
                Err(EquilibriumError::Failure(failure)) => Err(self.stopped(failure)),
                Err(error) => Err(Problem::NoEquilibrium { reason: error.to_string() }.into()),
            },
        }
    }

    fn no_start(&self, error: StartError) -> Error {
        match error {
            StartError::Failure(failure) => self.stopped(failure),
            StartError::Conflict(conflict) => self.fault(self.conflict_diagnostic(&conflict).into()),
            StartError::NoNumber { value, span, .. } => {
                let d = Diagnostic::error(codes::I005, error.to_string(), span, format!("this comes to {value}"));
                self.fault(
                    d.hint("look for a root or a logarithm of what is below zero, or for a division by zero").into(),
                )
            }
            StartError::NotFound { ref searched, .. } => {
                let span = halfarrow_compiler::span::Span::default();
                let d = Diagnostic::error(codes::I004, error.to_string(), span, "in this model");
                let hint = "give start values nearer to ones that fit";
                let hint = match self.guess_for(searched) {
                    Some(guess) => format!("{hint}, or a guess from where they are searched, such as `{guess}`"),
                    None => hint.to_string(),
                };
                self.fault(d.hint(hint).into())
            }
        }
    }

    /// A statement that guesses the first of what is searched for which there can be one.
    fn guess_for(&self, searched: &[String]) -> Option<String> {
        let graph = &self.graph;
        let signals = graph.signals.values().map(|s| s.symbol);
        let stored = graph.elements.values().flat_map(|e| match &e.kind {
            Kind::Inertance(storage) | Kind::Compliance(storage) => storage.stored.as_slice(),
            _ => &[],
        });
        let all: Vec<Symbol> = signals.chain(stored.copied()).collect();
        let of = |name: &String| all.iter().copied().find(|s| graph.exprs.name(*s) == name);
        let symbol = searched.iter().find_map(of)?;
        let unit = graph.variables.get(&symbol).and_then(|v| v.unit.as_ref()).map(Unit::to_string);
        let unit = unit.filter(|u| u != "1").map_or(String::new(), |u| format!(" {u}"));
        Some(format!("guess {} = 0.4{unit}", graph.exprs.name(symbol)))
    }

    /// Start values that contradict each other, at their places, with what would fit.
    fn conflict_diagnostic(&self, conflict: &exec::StartConflict) -> Diagnostic {
        let say = |v: &exec::StartValue| format!("{} = {} asked, {} would fit", v.name, v.asked, v.fitting);
        let mut values = conflict.values.iter();
        let first = values.next().map_or((Default::default(), String::new()), |v| (v.span, say(v)));
        let title = "start values contradict each other or a constraint";
        let d = Diagnostic::error(codes::I003, title, first.0, first.1);
        let d = values.fold(d, |d, v| d.also(v.span, say(v)));
        let hint = "take the values that would fit, or leave out all but one of them";
        d.hint(match self.guess_for(&conflict.searched) {
            Some(guess) => format!("{hint}; where they do fit somewhere, guess a place near it, such as `{guess}`"),
            None => hint.to_string(),
        })
    }

    /// That there is a start.
    pub(crate) fn check_start(&self, equations: &Equations) -> Result<(), Error> {
        let mut system = self.system(equations)?;
        self.start(&mut system, Start::Given).map(|_| ())
    }

    /// The values of the unknowns of a form at the start; none where there is no start.
    pub(crate) fn unknowns_at_start(&self, equations: &Equations) -> Vec<f64> {
        let found = match self.runs_alone(equations.form) {
            true => self.system(equations).and_then(|mut system| self.start(&mut system, Start::Given)).ok(),
            false => {
                let system = self.implicit_system(equations, &Run::default());
                system.ok().and_then(|mut system| system.initialise(0.0).ok()).map(|(y, _)| y)
            }
        };
        found.unwrap_or_default()
    }

    /// The values of all variables at the start; none where there is no start.
    pub(crate) fn values_at_start(&self, equations: &Equations) -> BTreeMap<String, f64> {
        let found = self.system(equations).and_then(|mut system| {
            system.record_all();
            let mut x = self.start(&mut system, Start::Given)?;
            let mut trace = empty_trace(&system);
            let mut values = vec![0.0; trace.columns.len()];
            let observed = system.handle_event(0.0, &mut x).and_then(|()| system.observe(0.0, &x, &mut values));
            observed.map_err(|failure| self.stopped(failure))?;
            trace.sample(0.0, &values);
            Ok(trace)
        });
        let columns = found.map(|trace| trace.columns).unwrap_or_default();
        columns.into_iter().map(|c| (c.name, c.values[0])).collect()
    }
}

/// What records variables by name.
pub(crate) trait Recording {
    /// What is run.
    fn program(&self) -> &Program;
    /// Indices of what is recorded.
    fn recorded(&self) -> &[usize];
    /// Chooses what is recorded.
    fn record(&mut self, names: &[&str]) -> Result<(), exec::RecordError>;
    /// Chooses what is recorded, by indices of what has a value.
    fn record_these(&mut self, observed: Vec<usize>);
    /// Records everything that has a value.
    fn record_all(&mut self);
    /// How it runs from now on.
    fn execute(&mut self, execution: Execution, expected: Option<exec::Expected>) -> Result<(), exec::MachineError>;
    /// How it has been run.
    fn executed(&self) -> Vec<exec::Executed>;
}

macro_rules! recording {
    ($($model:ty),*) => {$(
        impl Recording for $model {
            fn program(&self) -> &Program {
                self.program()
            }
            fn recorded(&self) -> &[usize] {
                self.recorded()
            }
            fn record(&mut self, names: &[&str]) -> Result<(), exec::RecordError> {
                self.record(names)
            }
            fn record_these(&mut self, observed: Vec<usize>) {
                self.record_these(observed);
            }
            fn record_all(&mut self) {
                self.record_all();
            }
            fn execute(&mut self, execution: Execution, expected: Option<exec::Expected>) -> Result<(), exec::MachineError> {
                self.execute(execution, expected)
            }
            fn executed(&self) -> Vec<exec::Executed> {
                self.executed()
            }
        }
    )*};
}
recording!(exec::Model, exec::ImplicitModel);

/// Gives the samples to a trace, and tells how far the run has come.
struct Recorder<'p> {
    trace: Trace,
    /// The unit of each column that is not given in SI units.
    units: Vec<Option<Unit>>,
    row: Vec<f64>,
    notes: Vec<String>,
    /// Magnitude and absolute tolerance of each state.
    kept: (Vec<f64>, Vec<f64>),
    progress: &'p mut dyn FnMut(Progress<'_>) -> bool,
}

impl<'p> Recorder<'p> {
    /// Tells what is to be known before the run.
    fn new(
        system: &impl Recording,
        by: &[By],
        notes: Vec<String>,
        progress: &'p mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Recorder<'p> {
        for note in &notes {
            // Whether to go on is asked after the first step.
            let _ = progress(Progress { time: 0.0, note: Some(note) });
        }
        let (trace, units) = (differentiated_trace(system, by), units(system));
        Recorder { trace, units, row: Vec::new(), notes, kept: (Vec::new(), Vec::new()), progress }
    }

    /// How exact the states of these names were kept.
    fn tolerances(&self, names: Vec<String>) -> Vec<StateTolerance> {
        let (scales, absolute) = &self.kept;
        let values = scales.iter().zip(absolute);
        names
            .into_iter()
            .zip(values)
            .map(|(name, (&scale, &absolute))| StateTolerance { name, scale, absolute })
            .collect()
    }
}

/// What ended, with how exact its states were kept and how it was evaluated.
fn kept(
    mut ended: Result<Simulated, Error>,
    tolerances: Vec<StateTolerance>,
    execution: Vec<RoutineReport>,
) -> Result<Simulated, Error> {
    let report = match &mut ended {
        Ok(done) => &mut done.report,
        Err(Error::Run(stopped)) => &mut stopped.report,
        Err(_) => return ended,
    };
    (report.tolerances, report.execution) = (tolerances, execution);
    ended
}

impl Sink for Recorder<'_> {
    fn sample(&mut self, t: f64, values: &[f64]) {
        let given = |(unit, &si): (&Option<Unit>, &f64)| unit.as_ref().map_or(si, |unit| unit.from_si_f64(si));
        self.row.clear();
        let (own, slopes) = values.split_at(self.units.len());
        self.row.extend(self.units.iter().zip(own).map(given));
        // Of units that do not begin at zero the steps count.
        let step = |(unit, &si): (&Option<Unit>, &f64)| {
            unit.as_ref().map_or(si, |unit| unit.from_si_f64(si) - unit.from_si_f64(0.0))
        };
        self.row.extend(self.units.iter().cycle().zip(slopes).map(step));
        self.trace.sample(t, &self.row);
    }
    fn progress(&mut self, t: f64) -> ControlFlow<()> {
        let go_on = (self.progress)(Progress { time: t, note: None });
        if go_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
    fn tolerances(&mut self, magnitudes: &[f64], absolute: &[f64]) {
        for (kept, values) in [(&mut self.kept.0, magnitudes), (&mut self.kept.1, absolute)] {
            kept.clear();
            kept.extend_from_slice(values);
        }
    }
    fn crawls(&mut self, crawl: &Crawl) {
        let Crawl { time, steps, step, state } = crawl;
        let note = format!(
            "the run crawls: {steps} steps up to t = {time:e} s, the last of {step:e} s; it is {state} that asks for steps this \
             short (its scale stands under --timings; --atol sets what is allowed)"
        );
        let _ = (self.progress)(Progress { time: *time, note: Some(&note) });
        self.notes.push(note);
    }
}

/// A trace for what is recorded, and for its derivatives.
fn differentiated_trace(system: &impl Recording, by: &[By]) -> Trace {
    let own = empty_trace(system).columns;
    let slopes = by.iter().flat_map(|by| own.iter().map(move |c| column(&c.name, &c.unit, by)));
    Trace::new(own.iter().map(|c| (c.name.clone(), c.unit.clone())).chain(slopes))
}

fn empty_trace(system: &impl Recording) -> Trace {
    let observed = &system.program().observed;
    let column = |&i: &usize| {
        let unit = observed[i].unit.as_ref().map(ToString::to_string).unwrap_or_default();
        (observed[i].name.to_string(), unit)
    };
    Trace::new(system.recorded().iter().map(column))
}

/// The declared units of the recorded variables, where they are not SI units.
pub(crate) fn units(system: &impl Recording) -> Vec<Option<Unit>> {
    let observed = &system.program().observed;
    system.recorded().iter().map(|&i| observed[i].unit.clone().filter(|unit| !unit.is_si())).collect()
}

/// In how many steps a run that records so many variables of a program has samples inside.
fn inside(run: &Run, recorded: usize, program: &Program) -> usize {
    if run.inside && recorded <= MOST_INSIDE && program.observed.len() <= LARGE { SMOOTH } else { 0 }
}

pub(crate) fn options(run: &Run) -> Result<Options, Problem> {
    if matches!(run.method, Method::Fixed(_)) && run.step.is_none() {
        return Err(Problem::NoStep);
    }
    Ok(Options {
        method: run.method,
        from: 0.0,
        to: run.to,
        every: run.every,
        at: run.at.clone(),
        inside: 0,
        step: run.step,
        rtol: run.rtol,
        atol: run.atol.map_or(AbsoluteTolerance::Scaled, AbsoluteTolerance::Same),
        project: run.project,
    })
}

/// What is to be known of the relations onto which positions are put back, if that is asked for.
pub(crate) fn projected(program: &Program, project: bool, method: Method) -> Result<Vec<String>, Problem> {
    if !project {
        return Ok(Vec::new());
    }
    if method == Method::Bdf {
        let reason = "project does not go with bdf, whose steps go on with their history: take radau or another solver";
        return Err(Problem::BadOption { reason: reason.into() });
    }
    let left = |r: &&UnkeptRelation| r.reason != Unkept::Nonholonomic;
    if let Some(relation) = program.unkept_relations.iter().find(left) {
        let reason = format!(
            "positions cannot be put back onto `{}`: {}; leave project out, or write the relation of the positions as a \
             constraint",
            relation.text, relation.reason
        );
        return Err(Problem::BadOption { reason });
    }
    let said = |r: &UnkeptRelation| format!("nothing is put back onto `{} = 0`: {}", r.text, r.reason);
    let mut notes: Vec<String> = program.unkept_relations.iter().map(said).collect();
    if program.position_relations.is_empty() {
        notes.push("project has nothing to do: no positions of this model are known by their speeds only".into());
    }
    Ok(notes)
}

/// Springs of the form `stiff` have to be faster than what the model does at its start, which its structure alone does
/// not tell: a pendulum swings without a spring.
pub(crate) fn set_spring_rate(system: &mut exec::ImplicitModel, x: &[f64]) -> Result<(), Problem> {
    let Some(rate) = system.program().parameter_of(ParameterKind::FastestRate) else { return Ok(()) };
    let (Some(fastest), Some(own)) = (system.fastest_rate(0.0, x), system.parameter(rate)) else { return Ok(()) };
    if fastest <= own {
        return Ok(());
    }
    system.set_form_parameter(rate, fastest).map_err(|e| Problem::BadOption { reason: e.to_string() })
}

/// Connects the inputs of a run, and sets the springs that it asks for.
pub(crate) fn set_up(system: &mut exec::ImplicitModel, run: &Run) -> Result<(), Problem> {
    connect(&system.program().inputs.clone(), &run.inputs, |name, t, v| system.connect(name, t, v))?;
    set_spring(system, ParameterKind::SpringStiffness, "stiffness", run.stiffness)?;
    set_spring(system, ParameterKind::SpringDamping, "damping", run.damping)
}

/// Derivatives are those of the minimal form.
fn without_sensitivities(run: &Run) -> Result<(), Problem> {
    if run.sensitivities.is_empty() {
        return Ok(());
    }
    let reason = format!("sensitivities are those of the form minimal, not {}", run.form.name());
    Err(Problem::BadOption { reason })
}

/// Options of springs need some.
fn without_springs(run: &Run) -> Result<(), Problem> {
    let given = [("stiffness", run.stiffness), ("damping", run.damping)];
    let Some((option, _)) = given.iter().find(|(_, value)| value.is_some()) else { return Ok(()) };
    Err(Problem::BadOption { reason: format!("{option} is an option of the form stiff") })
}

/// Sets what an option says of the springs.
fn set_spring(
    system: &mut exec::ImplicitModel,
    kind: ParameterKind,
    option: &str,
    value: Option<f64>,
) -> Result<(), Problem> {
    let Some(value) = value else { return Ok(()) };
    let bad = |reason| Problem::BadOption { reason };
    let Some(index) = system.program().parameter_of(kind) else {
        return Err(bad(format!("{option} is an option of the form stiff")));
    };
    let below = if kind == ParameterKind::SpringStiffness { value <= 0.0 } else { value < 0.0 };
    if below || !value.is_finite() {
        return Err(bad(format!("{option} is {value}: it has to be a finite number above zero")));
    }
    system.set_form_parameter(index, value).map_err(|e| bad(e.to_string()))
}

/// A form with algebraic unknowns or free rates is integrated by one method only.
fn implicit_options(run: &Run) -> Result<Options, Problem> {
    let options = options(run)?;
    match run.method {
        Method::Auto | Method::Radau => Ok(Options { method: Method::Radau, ..options }),
        _ => {
            let reason =
                format!("the form {} is no explicit equation: only the solver radau takes it", run.form.name());
            Err(Problem::BadOption { reason })
        }
    }
}

/// Chooses what is recorded; tells what was left out.
pub(crate) fn choose(system: &mut impl Recording, record: &Record) -> Result<Vec<String>, Problem> {
    match record {
        Record::Default => Ok(left_out(system, true)),
        Record::Also(more) => {
            let observed = system.program().observed.iter().filter(|o| o.default && o.value.is_ok());
            let mut names: Vec<String> = observed.map(|o| o.name.to_string()).collect();
            more.iter().for_each(|name| {
                if !names.contains(name) {
                    names.push(name.clone())
                }
            });
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let notes = left_out(system, true);
            system.record(&names).map_err(|error| refused(system, error)).map(|()| notes)
        }
        Record::All => {
            system.record_all();
            Ok(left_out(system, false))
        }
        Record::Names(names) => {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            system.record(&names).map_err(|error| refused(system, error)).map(|()| Vec::new())
        }
    }
}

/// What has no value among what would be recorded.
fn left_out(system: &impl Recording, only_default: bool) -> Vec<String> {
    let observed = system.program().observed.iter().filter(|o| o.default || !only_default);
    let without = observed.filter_map(|o| o.value.as_ref().err().map(|why| format!("`{}` is left out: {why}", o.name)));
    without.collect()
}

pub(crate) fn refused(system: &impl Recording, error: exec::RecordError) -> Problem {
    match error {
        exec::RecordError::Unknown(name) => {
            let known = system.program().observed.iter().map(|o| &*o.name);
            Problem::UnknownVariable { nearest: nearest(&name, known).map(str::to_string), name }
        }
        exec::RecordError::Unavailable(name, why) => Problem::Unavailable { name, reason: why.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_that_misses_a_law_is_refused_and_kept() {
        let text = "model Mass\n1:j -> I:mass(1)\nSe:push(1) -> j\n";
        let model = Model::from_text("mass.bond", text, &[]).expect("a model without errors");
        let run = Run { to: 1.0, ..Run::default() };
        let mut done = model.simulate(&run, &mut |_| true).expect("its laws are met");
        done.report.audit.residual.as_mut().expect("laws are checked").value = 1e-4;
        let mut said = judged(Ok(done), &Made::by(&run)).expect("a doubt is said");
        assert!(said.report.notes.iter().any(|note| note.contains("1e-4")), "{:?}", said.report.notes);
        said.report.audit.residual.as_mut().expect("laws are checked").value = 0.5;
        let Err(Error::Run(stopped)) = judged(Ok(said), &Made::by(&run)) else {
            panic!("half of the effort is missing")
        };
        assert!(matches!(&stopped.failure, Failure::Untrue { miss, .. } if *miss == 0.5), "{}", stopped.failure);
        assert!(!stopped.trace.times.is_empty(), "what was computed is kept");
    }
}
