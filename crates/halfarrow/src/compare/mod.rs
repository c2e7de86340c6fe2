//! All forms of a model beside each other: size, cost of an evaluation, time at equal error, agreement.

mod forms;
mod ladder;
mod picture;
mod reference;
mod subject;

use std::time::Duration;

use halfarrow_compiler::algebra::Expr;
use halfarrow_compiler::bond_graph::ParameterKind;
use halfarrow_compiler::equations::{EquationStep, Equations, Form, ObservedKind};
use halfarrow_sim::{Failure, Method};
use serde::Serialize;

use crate::audited::AuditReport;
use crate::clock::Moment;
use crate::equations::by_name;
use crate::error::{Error, Problem};
use crate::input::Input;
use crate::model::Model;
use crate::run::Run;
use crate::verdict::Verdict;
use forms::LEFT_OUT;
pub use forms::{ComparedForms, SolvedBlocks};
use ladder::{Effort, LONGEST, Rung, cost_at, error_of, ladder, order, rung, ten_to};
use reference::{Apart, POINTS, Reference};
use subject::{Common, Settings, Subject, Variable, is_over};

/// Tolerance of the runs whose agreement is told.
const TIGHT: f64 = 1e-11;
/// Powers of ten of the stiffness, the square of the ratio of frequencies.
const STIFFNESSES: std::ops::RangeInclusive<i32> = 2..=12;
/// Operations of the rates and their derivatives in a run that is as long as its fastest time, times how often that passes.
const MOST_OPERATIONS: f64 = 1e8;
/// Why a form has no times.
const STOPS: &str = "its runs stop before their end";
/// Parts of a budget at whose end the reference, all ladders and all times have to be there.
const REFERENCE: f64 = 0.4;
const LADDERS: f64 = 0.75;
const TIMES: f64 = 0.85;
/// Errors of the form `stiff` from which its order is read: above rounding, below where springs are soft.
const ORDERLY: std::ops::Range<f64> = 1e-9..3e-2;

/// What to compare and how exactly. Times in s.
#[derive(Debug, Clone, PartialEq)]
pub struct Compare {
    /// End of the runs; `None`: ten times the slowest time that the motion near the start knows, within bounds.
    pub to: Option<f64>,
    /// Error of the motion at which times are compared, relative to the greatest magnitude of each variable.
    pub error: f64,
    /// Inputs that are given: their names and what they are over time.
    pub inputs: Vec<(String, Input)>,
    /// Runs whose median counts as the time.
    pub repeats: usize,
    /// Processor time of a run, in s, beyond which no tighter tolerance is tried.
    pub patience: f64,
    /// Time for all of it, in s; what it does not suffice for is left out, and said. `None`: as long as it takes.
    pub budget: Option<f64>,
}

impl Default for Compare {
    /// At an error of 1e-6, medians of 7 runs, of at most 20 s each, as long as it takes.
    fn default() -> Compare {
        Compare { to: None, error: 1e-6, inputs: Vec::new(), repeats: 7, patience: 20.0, budget: None }
    }
}

/// What `halfarrow compare` tells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompareReport {
    /// Name of the model.
    pub model: String,
    /// End of the runs, in s.
    pub to: f64,
    /// Error at which times are compared.
    pub error: f64,
    /// What errors are measured against; `None` if the time did not suffice for it: then no form has times.
    pub reference: Option<ReferenceReport>,
    /// One for each form, those that do not apply with the reason.
    pub rows: Vec<Row>,
    /// What is to be known.
    pub notes: Vec<String>,
}

/// What errors are measured against: the minimal form at a relative tolerance of 1e-12.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReferenceReport {
    /// The form that confirms it.
    pub confirmed_by: &'static str,
    /// Greatest difference of the motion between the two; NaN if no other run came to its end.
    pub confirmed_to: f64,
}

/// A form.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Row {
    /// The form, by its name on the command line.
    #[serde(serialize_with = "by_name")]
    pub form: Form,
    /// What it is.
    pub meaning: &'static str,
    /// Why it does not apply, or did not come to the end.
    pub reason: Option<String>,
    /// Number of differential equations; integrated signals are not counted.
    pub differential: Option<usize>,
    /// Number of algebraic equations.
    pub algebraic: Option<usize>,
    /// Index.
    pub index: Option<u8>,
    /// Operations of one evaluation of rates or residuals.
    pub flops: Option<usize>,
    /// The same by kind.
    pub operations: Option<OperationsReport>,
    /// Blocks of equations that an evaluation solves.
    pub loops: Option<SolvedBlocks>,
    /// Processor time from the bond graph to what runs, in s.
    pub seconds_to_compile: Option<f64>,
    /// The method that serves it best at the error asked for.
    pub solver: Option<&'static str>,
    /// Steps of the run at that error.
    pub steps: Option<usize>,
    /// Evaluations of rates or residuals in it.
    pub evaluations: Option<usize>,
    /// Processor time for each simulated second at that error, in s; `None` if no run is as exact.
    pub seconds_per_second: Option<f64>,
    /// The same with the method Radau IIA, which takes every form.
    pub seconds_by_radau: Option<f64>,
    /// How much longer it takes than the form `minimal`.
    pub times_minimal: Option<f64>,
    /// Greatest difference of any variable from the reference at a relative tolerance of 1e-11, relative to the greatest
    /// magnitude of the variable.
    pub max_error: Option<f64>,
    /// The variable concerned.
    pub max_error_in: Option<String>,
    /// The same for the motion alone.
    pub motion_error: Option<f64>,
    /// Stored less initial, supplied plus dissipated energy in the run at the error asked for, relative.
    pub energy_error: Option<f64>,
    /// Below this it says nothing: energies are integrated from the ends of steps, which may be far apart.
    pub energy_resolution: Option<f64>,
    /// What the audit found in that run.
    pub audit: Option<AuditReport>,
    /// Form `stiff`: measured order of convergence in the stiffness.
    pub order: Option<f64>,
    /// Form `stiff`: stiffness and the error of the motion that it causes.
    pub convergence: Vec<Convergence>,
    /// All runs that were timed.
    pub runs: Vec<TimedRun>,
}

/// Operations of one evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct OperationsReport {
    /// Additions, subtractions, comparisons.
    pub additions: usize,
    /// Multiplications.
    pub multiplications: usize,
    /// Divisions.
    pub divisions: usize,
    /// Functions and tables.
    pub calls: usize,
    /// Blocks solved by Newton, of which one iteration is counted.
    pub iterated: usize,
}

/// Stiffness of the springs of the form `stiff`, and what it causes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Convergence {
    /// Square of the ratio between the frequency of the springs and the fastest rate of the model.
    pub stiffness: f64,
    /// Error of the motion at a tight tolerance.
    pub error: f64,
}

/// A run that was timed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TimedRun {
    /// The method.
    pub solver: &'static str,
    /// Relative tolerance.
    pub rtol: f64,
    /// Form `stiff`: its stiffness.
    pub stiffness: Option<f64>,
    /// Greatest error of the motion.
    pub error: f64,
    /// Processor time for each simulated second, in s.
    pub seconds_per_second: f64,
    /// Accepted steps.
    pub steps: usize,
    /// Evaluations of rates or residuals.
    pub evaluations: usize,
}

/// Is told what part is done and what is being measured; says whether to go on.
pub type Progress<'p> = &'p mut dyn FnMut(f64, &str) -> bool;

impl Model {
    /// Puts all forms beside each other: [`compared_forms`](Model::compared_forms), [`measured`](ComparedForms::measured).
    ///
    /// Errors are those of the *motion*: states, stored quantities; each relative to its greatest magnitude in the run.
    /// Every form runs with the same evaluator and exact Jacobians, by each method that can take it; the one that costs
    /// least at the error asked for counts.
    ///
    /// # Errors
    /// The model has errors, options make no sense, or the reference run stops.
    pub fn compare(&self, compare: &Compare, progress: Progress) -> Result<CompareReport, Error> {
        self.compared_forms(compare, progress)?.measured(progress)
    }

    /// Whether the form `stiff` has springs: without constraints there are none. Where there are set-valued laws, in the mode
    /// of the graph or with one of them on another branch.
    fn has_springs(&self, equations: &Equations) -> Result<bool, Error> {
        if has_springs(equations) {
            return Ok(true);
        }
        let mode = self.graph.mode();
        for (law, present) in mode.iter().enumerate() {
            for branch in (0..self.graph.set_valued[law].branches.len()).filter(|branch| branch != present) {
                let mut other = mode.clone();
                other[law] = branch;
                let other = self.with_graph(self.graph.in_mode(&other));
                if other.equations_in(Form::Stiff).is_ok_and(|equations| has_springs(&equations)) {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Ten times the slowest time of the motion near the start, in s, within bounds.
    ///
    /// # Errors
    /// The model has no start.
    pub(crate) fn typical_time(&self) -> Result<f64, Error> {
        let (common, equations) = Common::of(self)?;
        Ok(typical_time(&common.subject(&equations, &Run::default())?))
    }
}

impl<'m> ComparedForms<'m> {
    /// Runs the forms: times at equal error, agreement.
    ///
    /// # Errors
    /// The reference run stops.
    pub fn measured(mut self, progress: Progress) -> Result<CompareReport, Error> {
        progress(0.02, "machine code");
        self.subjects.iter_mut().flatten().for_each(Subject::compile);
        progress(0.03, "reference");
        let minimal = self.subjects[0].as_ref().expect("without it there are no forms");
        let to = self.compare.to.unwrap_or_else(|| typical_time(minimal));
        self.run.to = to;
        let mut report = CompareReport {
            model: self.common.model.name().to_string(),
            to,
            error: self.compare.error,
            reference: None,
            rows: Vec::new(),
            notes: Vec::new(),
        };
        let cut = match self.reference(to)? {
            None => {
                report.rows = std::mem::take(&mut self.rows);
                report.notes.extend(self.budget.too_short());
                true
            }
            Some(reference) => {
                let (rows, cut) = self.rows_with_times(&reference, progress)?;
                let (confirmed_by, confirmed_to) = (reference.by.0.name(), reference.confirmed);
                (report.rows, report.reference) = (rows, Some(ReferenceReport { confirmed_by, confirmed_to }));
                report.notes = notes(&report);
                cut
            }
        };
        let graph = &self.common.model.graph;
        if !graph.set_valued.is_empty() {
            let mode = graph.mode_name();
            report
                .notes
                .push(format!("unknowns, index and operations are those of one mode of set-valued laws: {mode}"));
        }
        report.notes.extend(self.budget.note(cut));
        Ok(report)
    }

    /// What errors are measured against; `None` if the time does not suffice.
    fn reference(&self, to: f64) -> Result<Option<Reference>, Error> {
        let of = |form: &Form| {
            let found = self.rows.iter().position(|row| row.form == *form)?;
            Some((*form, self.subjects[found].as_ref()?))
        };
        let confirming = [Form::Lagrange, Form::Break, Form::Inverted, Form::Kane, Form::Relaxed];
        let mut others: Vec<(Form, &Subject)> = confirming.iter().filter_map(of).collect();
        // What is integrated in another way confirms more.
        others.sort_by_key(|(_, subject)| subject.is_explicit());
        let minimal = self.subjects[0].as_ref().expect("without it there are no forms");
        let effort = Effort { until: self.budget.part(REFERENCE), ..self.effort() };
        match Reference::new(minimal, &others, &motion(minimal), to, effort) {
            Ok(reference) => Ok(Some(reference)),
            Err(stopped) => match stopped.failure {
                Failure::Interrupted { .. } => Ok(None),
                failure => Err(self.common.model.stopped(failure)),
            },
        }
    }

    /// How much is measured, without an end.
    fn effort(&self) -> Effort {
        let patience = Duration::from_secs_f64(self.compare.patience.clamp(1e-3, 1e6));
        Effort { error: self.compare.error, patience, until: None }
    }

    /// Rows with times, and whether something was cut short.
    fn rows_with_times(&mut self, reference: &Reference, progress: Progress) -> Result<(Vec<Row>, bool), Error> {
        let (effort, count) = (self.effort(), self.rows.len());
        let mut forms: Vec<Measured> = Vec::with_capacity(count);
        let all = std::mem::take(&mut self.subjects).into_iter().zip(std::mem::take(&mut self.rows));
        for (i, (subject, row)) in all.enumerate() {
            let mut go_on = || progress(0.05 + 0.45 * i as f64 / count as f64, row.form.name());
            let until = self.budget.share(LADDERS, count - i);
            let effort = Effort { until, ..effort };
            let mut measured = Measured { row: row.clone(), ..Measured::default() };
            if let Some(subject) = subject {
                match self.stiff.as_ref().filter(|_| row.form == Form::Stiff) {
                    Some(equations) if self.common.model.has_springs(equations)? => {
                        self.climb_stiff(&mut measured, equations, reference, effort, &mut go_on)?;
                    }
                    _ => climb(&mut measured, subject, reference, effort, &mut go_on),
                }
            }
            measured.cut = is_over(until);
            forms.push(measured);
        }
        let until = self.budget.part(TIMES);
        let (to, repeats) = (reference.to, self.compare.repeats.max(1));
        measure(&mut forms, to, repeats, until, &mut |part| progress(0.5 + 0.45 * part, "times"));
        progress(0.95, "agreement");
        let cut = forms.iter().any(|form| form.cut) || is_over(until);
        let finished = |(i, form): (usize, Measured)| {
            form.finish(reference, Effort { until: self.budget.share(1.0, count - i), ..effort })
        };
        let mut rows: Vec<Row> = forms.into_iter().enumerate().map(finished).collect();
        relate(&mut rows);
        Ok((rows, cut))
    }

    /// The form `stiff`: its springs get stiffer as the error gets less.
    fn climb_stiff(
        &self,
        measured: &mut Measured<'m>,
        equations: &Equations,
        reference: &Reference,
        effort: Effort,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<(), Error> {
        let mut methods = vec![(Method::Radau, 0.3), (Method::Radau, 0.03), (Method::Bdf, 0.03)];
        for power in STIFFNESSES {
            if !go_on() || is_over(effort.until) {
                break;
            }
            let stiffness = ten_to(power);
            let run = Run { form: Form::Stiff, stiffness: Some(stiffness), ..self.run.clone() };
            let mut subject = self.common.subject(equations, &run)?;
            subject.compile();
            let exact = Settings { method: Method::Radau, rtol: 1e-9, to: reference.to, until: effort.run_until() };
            let Some(error) = error_of(&subject, reference, exact) else { continue };
            let mut rungs: Vec<Rung> = Vec::new();
            for &(method, part) in &methods {
                let rtol = (part * error).clamp(1e-11, 1e-3);
                let settings = Settings { method, rtol, to: reference.to, until: effort.run_until() };
                if rungs.iter().all(|r| (r.method, r.rtol) != (method, settings.rtol))
                    && let Some(found) = rung(&subject, reference, settings)
                {
                    rungs.push(Rung { stiffness: Some(stiffness), ..found });
                }
            }
            let least = |method| rungs.iter().filter(|r| r.method == method).map(|r| r.single).min();
            // What has fallen behind does not catch up as springs get stiffer.
            if least(Method::Bdf).is_none_or(|bdf| least(Method::Radau).is_some_and(|radau| bdf > 2 * radau)) {
                methods.retain(|m| m.0 != Method::Bdf);
            }
            let slow = rungs.iter().any(|r| r.single > effort.patience);
            let convergence = &mut measured.row.convergence;
            let no_better = convergence.last().is_some_and(|last| power > 4 && last.error < error);
            convergence.push(Convergence { stiffness, error });
            measured.rungs.extend(rungs.into_iter().map(|r| (r, measured.subjects.len())));
            measured.subjects.push(subject);
            if error < 0.1 * effort.error || no_better || slow {
                break;
            }
        }
        let floor = 30.0 * reference.confirmed;
        let orderly = measured.row.convergence.iter().filter(|c| ORDERLY.contains(&c.error) && c.error > floor);
        measured.row.order = order(&orderly.map(|c| (c.stiffness, c.error)).collect::<Vec<_>>());
        Ok(())
    }
}

/// A form by each method that can take it, at tighter and tighter tolerances.
fn climb<'m>(
    measured: &mut Measured<'m>,
    subject: Subject<'m>,
    reference: &Reference,
    effort: Effort,
    go_on: &mut dyn FnMut() -> bool,
) {
    for method in subject.methods() {
        let (rungs, given_up) = ladder(&subject, reference, method, effort, go_on);
        measured.rungs.extend(rungs.into_iter().map(|r| (r, 0)));
        measured.given_up |= given_up;
    }
    measured.subjects.push(subject);
}

/// Whether equations of the form `stiff` read the stiffness of springs.
fn has_springs(equations: &Equations) -> bool {
    let x = &equations.graph.exprs;
    let mut parameters = equations.graph.parameters.values();
    let Some(spring) = parameters.find(|p| p.kind == ParameterKind::SpringStiffness) else { return false };
    let reads = |e: Expr| x.symbols_of(e).contains(&spring.symbol);
    equations.steps.iter().flat_map(EquationStep::expressions).any(reads)
}

/// A form with its runs; `stiff` has a subject for each stiffness.
#[derive(Default)]
struct Measured<'m> {
    row: Row,
    /// Whether the time was over before all was measured.
    cut: bool,
    /// Whether a run took far longer than patience allows.
    given_up: bool,
    rungs: Vec<(Rung, usize)>,
    subjects: Vec<Subject<'m>>,
}

/// The time that comparing may take.
#[derive(Clone, Copy)]
struct Budget {
    begun: Moment,
    whole: Option<Duration>,
}

impl Budget {
    fn new(seconds: Option<f64>) -> Budget {
        let whole = seconds.map(|s| Duration::from_secs_f64(s.clamp(0.0, 1e7)));
        Budget { begun: Moment::now(), whole }
    }
    /// When this part of it is over.
    fn part(&self, part: f64) -> Option<Moment> {
        self.whole.map(|whole| self.begun + whole.mul_f64(part))
    }
    /// When one of so many that share what is left until then has had its time.
    fn share(&self, part: f64, among: usize) -> Option<Moment> {
        let now = Moment::now();
        self.part(part).map(|end| now + end.since(now) / among.max(1) as u32)
    }
    /// That it does not even suffice for the reference.
    fn too_short(&self) -> Option<String> {
        let seconds = self.whole?.as_secs_f64();
        Some(format!(
            "the {seconds} s for comparing do not suffice for the run that all others are measured against, so that there are \
             sizes and no times: give more time, or a shorter run"
        ))
    }
    /// What is to be said if it was spent before everything was measured.
    fn note(&self, cut: bool) -> Option<String> {
        let seconds = self.whole.filter(|_| cut || is_over(self.part(1.0)))?.as_secs_f64();
        Some(format!(
            "comparing was given {seconds} s: runs that would have taken longer are left out, with their times and errors"
        ))
    }
}

/// Times the runs of all forms.
fn measure(forms: &mut [Measured], to: f64, repeats: usize, until: Option<Moment>, go_on: &mut dyn FnMut(f64) -> bool) {
    let of = |form: &Measured| form.rungs.len();
    let counts: Vec<usize> = forms.iter().map(of).collect();
    let all = forms.iter().flat_map(|form| form.rungs.iter().map(|(rung, at)| (rung.clone(), &form.subjects[*at])));
    let mut all: Vec<(Rung, &Subject)> = all.collect();
    ladder::time(&mut all, to, repeats, until, go_on);
    let mut timed = all.into_iter().map(|(rung, _)| rung).collect::<Vec<_>>().into_iter();
    for (form, count) in forms.iter_mut().zip(counts) {
        form.rungs.iter_mut().zip(timed.by_ref().take(count)).for_each(|((rung, _), timed)| *rung = timed);
    }
}

impl Measured<'_> {
    /// What follows from the runs.
    fn finish(self, reference: &Reference, effort: Effort) -> Row {
        let Measured { mut row, cut, given_up, rungs, subjects } = self;
        let Some(last) = subjects.last() else {
            row.reason = row.reason.or(Some(STOPS.into()));
            return row;
        };
        row.take_operations(last);
        if rungs.is_empty() {
            let long = (LONGEST * effort.patience).as_secs_f64();
            row.reason = Some(match (cut, given_up) {
                (true, _) => LEFT_OUT.into(),
                (_, true) => format!("left out: a run takes more than {long} s (a longer --patience waits)"),
                _ => STOPS.into(),
            });
            return row;
        }
        let of = |method: Method| -> Vec<Rung> {
            rungs.iter().map(|r| &r.0).filter(|r| r.method == method).cloned().collect()
        };
        let methods = [Method::Explicit, Method::Bdf, Method::Radau];
        let best = methods.into_iter().filter_map(|m| cost_at(&of(m), effort.error)).min_by(|a, b| a.0.total_cmp(&b.0));
        row.seconds_by_radau = cost_at(&of(Method::Radau), effort.error).map(|cost| cost.0);
        let exactest = rungs.iter().map(|r| &r.0).min_by(|a, b| a.error.total_cmp(&b.error));
        let chosen = best.as_ref().map_or(exactest.cloned(), |b| Some(b.1.clone()));
        if let Some(chosen) = &chosen {
            let subject = rungs.iter().find(|r| r.0 == *chosen).map_or(last, |r| &subjects[r.1]);
            let settings =
                Settings { method: chosen.method, rtol: chosen.rtol, to: reference.to, until: effort.run_until() };
            let audit = subject.audited(settings, chosen.stiffness);
            if let Some(miss) = audit.as_ref().and_then(|audit| audit.energy.as_ref()) {
                (row.energy_error, row.energy_resolution) = (Some(miss.value), Some(miss.resolution));
            }
            row.audit = audit;
            row.solver = Some(solver(chosen.method));
        }
        match best {
            Some((seconds, rung)) => {
                row.seconds_per_second = Some(seconds);
                (row.steps, row.evaluations) = (Some(rung.steps), Some(rung.evaluations));
            }
            None => row.reason = chosen.map(|r| format!("no run comes nearer than {:.0e}", r.error)),
        }
        agreement(&mut row, last, reference, effort);
        row.runs = rungs.iter().map(|r| timed(&r.0)).collect();
        row
    }
}

/// How far all variables are off at a tight tolerance.
fn agreement(row: &mut Row, subject: &Subject, reference: &Reference, effort: Effort) {
    let variables = subject.variables();
    let names = reference.common(&variables);
    let tried = [Method::Radau, Method::Auto].into_iter().take(if subject.methods().len() > 2 { 2 } else { 1 });
    let found: Vec<(Apart, f64)> = tried
        .filter_map(|method| {
            let settings = Settings { method, rtol: TIGHT, to: reference.to, until: effort.run_until() };
            let trace = subject.sampled(settings, reference.to / POINTS, &names).ok()?;
            Some((reference.apart(&trace, false), reference.apart(&trace, true).value))
        })
        .collect();
    if let Some((apart, motion)) = found.into_iter().min_by(|a, b| a.0.value.total_cmp(&b.0.value)) {
        row.max_error = Some(apart.value);
        row.max_error_in = Some(apart.variable);
        row.motion_error = Some(motion);
    }
}

fn timed(rung: &Rung) -> TimedRun {
    TimedRun {
        solver: solver(rung.method),
        rtol: rung.rtol,
        stiffness: rung.stiffness,
        error: rung.error,
        seconds_per_second: rung.seconds,
        steps: rung.steps,
        evaluations: rung.evaluations,
    }
}

/// Times as multiples of that of the minimal form.
fn relate(rows: &mut [Row]) {
    let minimal = rows.iter().find(|row| row.form == Form::Minimal).and_then(|row| row.seconds_per_second);
    for row in rows {
        row.times_minimal = row.seconds_per_second.zip(minimal).map(|(own, minimal)| own / minimal);
    }
}

fn notes(report: &CompareReport) -> Vec<String> {
    let mut notes = Vec::new();
    let reference = report.reference.as_ref();
    let doubted = |r: &&ReferenceReport| r.confirmed_to > 0.1 * report.error || r.confirmed_to.is_nan();
    if let Some(ReferenceReport { confirmed_by: by, confirmed_to: confirmed }) = reference.filter(doubted) {
        notes.push(match confirmed.is_nan() {
            true => {
                "no other run came to its end, so that nothing confirms the reference: errors are differences from it"
                    .into()
            }
            false => {
                format!("the reference is confirmed by the form {by} to {confirmed:.0e} only: errors below say little")
            }
        });
    }
    for row in &report.rows {
        let warnings = row.audit.iter().flat_map(|audit| &audit.warnings);
        notes.extend(warnings.map(|warning| format!("warning: {}: {warning}", row.form)));
    }
    for row in report.rows.iter().filter(|row| row.form == Form::Stiff && row.differential.is_some()) {
        if row.convergence.is_empty() {
            notes.push(
                "stiff: there is no constraint to put a spring in the place of; its equations are those of lagrange"
                    .into(),
            );
        }
    }
    let higher =
        |row: &&Row| row.index.is_some_and(|index| index > 1) && row.reason.is_none() && row.form != Form::Stiff;
    let higher: Vec<&str> = report.rows.iter().filter(higher).map(|row| row.form.name()).collect();
    if !higher.is_empty() {
        let forms = higher.join(", ");
        notes.push(format!(
            "{forms}: no step is made for the sake of multipliers of index 2 and 3, whose errors do not act back on the \
             motion; what is told of them is computed from the other unknowns"
        ));
    }
    notes
}

/// The variables that the motion is: states and stored quantities.
fn motion(minimal: &Subject) -> Vec<String> {
    let stored = |v: &Variable| matches!(v.kind, ObservedKind::Momentum | ObservedKind::Displacement);
    let mut motion = minimal.states();
    motion.extend(minimal.variables().into_iter().filter(stored).map(|v| v.name));
    motion.sort();
    motion.dedup();
    motion
}

/// Ten times the slowest time of the motion near the start, but at most a thousand times the fastest, and no longer than runs of
/// large models can be repeated; 1 s if nothing moves. Rounded to 1, 2 or 5 times a power of ten.
fn typical_time(minimal: &Subject) -> f64 {
    let Some((slowest, fastest)) = minimal.rates() else { return 1.0 };
    // Of the rates, and of their derivatives by each state.
    let evaluated = minimal.operations().total() as f64 * (1 + minimal.states().len()) as f64;
    let time = (10.0 / slowest).min(1000.0 / fastest).min(MOST_OPERATIONS / (evaluated * fastest));
    let power = libm::floor(libm::log10(time));
    let unit = ten_to(power as i32);
    let digit = [1.0, 2.0, 5.0, 10.0].into_iter().find(|d| d * unit >= 0.999 * time).unwrap_or(10.0);
    digit * unit
}

fn check(compare: &Compare) -> Result<(), Problem> {
    let bad = |reason: String| Err(Problem::BadOption { reason });
    if let Some(to) = compare.to.filter(|to| !(to.is_finite() && *to > 0.0)) {
        return bad(format!("to is {to}: it has to be a time above zero, in s"));
    }
    if let Some(budget) = compare.budget.filter(|budget| !(budget.is_finite() && *budget > 0.0)) {
        return bad(format!("the budget is {budget}: it has to be a time above zero, in s"));
    }
    if !(1e-10..=1e-1).contains(&compare.error) {
        return bad(format!("error is {}: it has to be from 1e-10 to 0.1", compare.error));
    }
    Ok(())
}

/// The title of the first fault.
pub(crate) fn short(error: &Error) -> String {
    match error {
        Error::Model(found) => found.diagnostics.0.first().map_or_else(String::new, |d| d.title.clone()),
        other => other.to_string(),
    }
}

fn solver(method: Method) -> &'static str {
    match method {
        Method::Explicit => "explicit",
        Method::Bdf => "bdf",
        Method::Radau => "radau",
        Method::Auto => "auto",
        Method::Fixed(_) => "fixed",
    }
}

impl CompareReport {
    /// The forms whose results are not to be used, as the audit found.
    pub fn refused(&self) -> Vec<&'static str> {
        let refused = |row: &&Row| row.audit.as_ref().is_some_and(|audit| audit.verdict == Verdict::Refused);
        self.rows.iter().filter(refused).map(|row| row.form.name()).collect()
    }
}

impl Row {
    /// The processor time for a simulated second, with two or three digits and its unit; `None` if there is none.
    pub fn time_text(&self) -> Option<String> {
        let seconds = self.seconds_per_second?;
        let (value, unit) = match seconds {
            s if s < 1e-3 => (1e6 * s, "µs"),
            s if s < 1.0 => (1e3 * s, "ms"),
            s => (s, "s"),
        };
        Some(if value < 10.0 { format!("{value:.1} {unit}") } else { format!("{value:.0} {unit}") })
    }

    fn take_operations(&mut self, subject: &Subject) {
        let operations = subject.operations();
        self.flops = Some(operations.total());
        self.operations = Some(OperationsReport {
            additions: operations.additions,
            multiplications: operations.multiplications,
            divisions: operations.divisions,
            calls: operations.calls,
            iterated: operations.iterated,
        });
    }
}
