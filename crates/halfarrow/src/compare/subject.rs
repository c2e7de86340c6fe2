//! A form of a model, ready to run as often as it takes.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use halfarrow_compiler::bond_graph::BondGraph;
use halfarrow_compiler::causal_graph::CausalGraph;
use halfarrow_compiler::equations::{Equations, Form, ObservedKind};
use halfarrow_compiler::program::Observed;
use halfarrow_exec::{self as exec, Operations};
use halfarrow_sim::{
    Events as _, Failure, ImplicitSystem, Method, Options, Sink, Stopped, Summary, simulate, simulate_implicit,
};
use halfarrow_trace::Trace;

use crate::audited::{AuditReport, Audited};
use crate::clock::{Moment, ProcessorTime};
use crate::error::Error;
use crate::input::connect;
use crate::model::Model;
use crate::run::{Run, Start, set_spring_rate, set_up};
use crate::verdict::Made;

/// A form at its start.
#[derive(Clone)]
pub(super) struct Subject<'m> {
    graph: &'m Arc<BondGraph>,
    form: Form,
    system: Ready,
}

/// A variable that all forms have.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Variable {
    pub name: String,
    /// SI unit; empty where it is not known.
    pub unit: String,
    pub kind: ObservedKind,
}

/// How a form is integrated.
#[derive(Clone)]
#[allow(clippy::large_enum_variant, reason = "there are few of them")]
enum Ready {
    /// Rates, and the state at the start.
    Explicit(exec::Model, Vec<f64>),
    /// Residuals, unknowns and their rates at the start.
    Implicit(exec::ImplicitModel, Vec<f64>, Vec<f64>),
}

/// What to run it with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Settings {
    pub method: Method,
    pub rtol: f64,
    pub to: f64,
    /// When the run is given up, if at all.
    pub until: Option<Moment>,
}

impl Settings {
    fn options(self, every: Option<f64>) -> Options {
        Options { method: self.method, to: self.to, every, rtol: self.rtol, ..Options::default() }
    }
}

/// Whether the time for something is over.
pub(super) fn is_over(until: Option<Moment>) -> bool {
    until.is_some_and(|until| Moment::now() >= until)
}

/// Steps between two looks at the clock.
const LOOK: usize = 32;

/// Takes samples if somebody wants them, and gives up when the time is over.
struct Patient<'t> {
    trace: Option<&'t mut Trace>,
    until: Option<Moment>,
    steps: usize,
}

impl<'t> Patient<'t> {
    fn new(trace: Option<&'t mut Trace>, settings: Settings) -> Patient<'t> {
        Patient { trace, until: settings.until, steps: 0 }
    }
}

impl Sink for Patient<'_> {
    fn sample(&mut self, t: f64, values: &[f64]) {
        if let Some(trace) = &mut self.trace {
            trace.sample(t, values);
        }
    }

    fn progress(&mut self, _: f64) -> ControlFlow<()> {
        self.steps += 1;
        if self.steps.is_multiple_of(LOOK) && is_over(self.until) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// An audit, unless its run was given up.
#[allow(clippy::result_large_err, reason = "a run fails once")]
fn given(ended: Result<Summary, Stopped>, audit: AuditReport) -> Option<AuditReport> {
    let given_up = matches!(ended, Err(stopped) if matches!(stopped.failure, Failure::Interrupted { .. }));
    (!given_up).then_some(audit)
}

/// What all forms of a model have in common, made once.
pub(super) struct Common<'m> {
    pub model: &'m Model,
    causal: CausalGraph,
    /// The minimal form, ready to run: it starts the others.
    minimal: exec::Model,
}

impl<'m> Common<'m> {
    /// That of a model, and its minimal equations.
    pub fn of(model: &'m Model) -> Result<(Common<'m>, Equations), Error> {
        let causal = model.causal_graph()?;
        let equations = model.equations_of(&causal, Form::Minimal)?;
        let minimal = model.system(&equations)?;
        Ok((Common { model, causal, minimal }, equations))
    }

    /// The equations of a form.
    pub fn equations(&self, form: Form) -> Result<Equations, Error> {
        self.model.equations_of(&self.causal, form)
    }

    /// A form at the start of a run.
    pub fn subject(&self, equations: &Equations, run: &Run) -> Result<Subject<'m>, Error> {
        let (model, form) = (self.model, equations.form);
        let graph = &model.graph;
        if model.runs_alone(form) {
            let mut system = if form == Form::Minimal { self.minimal.clone() } else { model.system(equations)? };
            connect(&system.program().inputs.clone(), &run.inputs, |name, t, v| system.connect(name, t, v))?;
            let x = model.start(&mut system, run.start)?;
            return Ok(Subject { graph, form, system: Ready::Explicit(system, x) });
        }
        let explicit = equations.residuals.is_empty() && graph.set_valued.is_empty();
        let mut system = model.form_beside(equations, self.minimal.clone())?;
        set_up(&mut system, run)?;
        let x = model.start(system.reference_mut(), Start::Given)?;
        set_spring_rate(&mut system, &x)?;
        let (y, yp) = system.start_at(0.0, &x).map_err(|failure| model.stopped(failure))?;
        let system = match explicit {
            true => Ready::Explicit(system.into_form(), y),
            false => Ready::Implicit(system, y, yp),
        };
        Ok(Subject { graph, form, system })
    }
}

impl Subject<'_> {
    /// Makes machine code of what its runs evaluate, where there is any: the same bits, sooner.
    pub(super) fn compile(&mut self) {
        let made = match &mut self.system {
            Ready::Explicit(system, _) => system.compile_machine().and_then(|()| system.compile_directional()),
            Ready::Implicit(system, ..) => system.compile_machine(),
        };
        // Where there is none all forms run as bytecode.
        let _ = made;
    }

    /// The methods that can integrate it.
    pub(super) fn methods(&self) -> Vec<Method> {
        match &self.system {
            Ready::Explicit(..) => vec![Method::Explicit, Method::Bdf, Method::Radau],
            Ready::Implicit(system, ..) => {
                let index_1 = (0..system.unknowns()).all(|unknown| system.index(unknown) == 1);
                let bdf = index_1 && !system.changes_unknowns() && system.semi_explicit().is_some();
                if bdf { vec![Method::Radau, Method::Bdf] } else { vec![Method::Radau] }
            }
        }
    }

    /// Whether it is an explicit equation.
    pub(super) fn is_explicit(&self) -> bool {
        matches!(self.system, Ready::Explicit(..))
    }

    /// Operations of one evaluation.
    pub(super) fn operations(&self) -> Operations {
        match &self.system {
            Ready::Explicit(system, _) => system.operations(),
            Ready::Implicit(system, ..) => system.operations(),
        }
    }

    /// Everything that can be recorded and has a value of its own, which the drift of a constraint has not.
    pub(super) fn variables(&self) -> Vec<Variable> {
        let program = match &self.system {
            Ready::Explicit(system, _) => system.program(),
            Ready::Implicit(system, ..) => system.program(),
        };
        let known = program
            .observed
            .iter()
            .filter(|o| o.value.is_ok() && !matches!(o.kind, ObservedKind::Drift | ObservedKind::Bare));
        let unit = |o: &Observed| o.unit.as_ref().map(|u| u.to_string()).unwrap_or_default();
        known.map(|o| Variable { name: o.name.to_string(), unit: unit(o), kind: o.kind }).collect()
    }

    /// Names of the states.
    pub(super) fn states(&self) -> Vec<String> {
        let program = match &self.system {
            Ready::Explicit(system, _) => system.program(),
            Ready::Implicit(system, ..) => system.program(),
        };
        program.states.iter().map(|s| s.name.clone()).collect()
    }

    /// Runs it and records these variables, in SI units.
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub(super) fn sampled(&self, settings: Settings, every: f64, names: &[&str]) -> Result<Trace, Stopped> {
        let mut trace = Trace::new(names.iter().map(|name| (*name, "")));
        let options = settings.options(Some(every));
        // All names are known to have values, so that recording them cannot fail.
        match self.system.clone() {
            Ready::Explicit(mut system, mut x) => {
                let _ = system.record(names);
                simulate(&mut system, &options, &mut x, &mut Patient::new(Some(&mut trace), settings))?;
            }
            Ready::Implicit(mut system, mut y, mut yp) => {
                let _ = system.record(names);
                simulate_implicit(
                    &mut system,
                    &options,
                    &mut y,
                    &mut yp,
                    &mut Patient::new(Some(&mut trace), settings),
                )?;
            }
        }
        Ok(trace)
    }

    /// Runs it and records nothing: the processor time that took.
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub(super) fn timed(&self, settings: Settings) -> Result<(Duration, Summary), Stopped> {
        let options = settings.options(None);
        match self.system.clone() {
            Ready::Explicit(mut system, mut x) => {
                let _ = system.record(&[]);
                let begun = ProcessorTime::now();
                let summary = simulate(&mut system, &options, &mut x, &mut Patient::new(None, settings))?;
                Ok((begun.elapsed(), summary))
            }
            Ready::Implicit(mut system, mut y, mut yp) => {
                let _ = system.record(&[]);
                let begun = ProcessorTime::now();
                let summary =
                    simulate_implicit(&mut system, &options, &mut y, &mut yp, &mut Patient::new(None, settings))?;
                Ok((begun.elapsed(), summary))
            }
        }
    }

    /// Runs it and audits every step; `stiffness` of the form `stiff`. `None` if the time is over before.
    pub(super) fn audited(&self, settings: Settings, stiffness: Option<f64>) -> Option<AuditReport> {
        let options = settings.options(None);
        let mut report = match self.system.clone() {
            Ready::Explicit(mut system, mut x) => {
                let _ = system.record(&[]);
                let mut audited = Audited::new(&mut system, self.graph);
                let ended = audited.simulate(&options, &mut x, &mut Patient::new(None, settings));
                given(ended, audited.finish())
            }
            Ready::Implicit(mut system, mut y, mut yp) => {
                let _ = system.record(&[]);
                let mut audited = Audited::new(&mut system, self.graph);
                let ended = audited.simulate(&options, (&mut y, &mut yp), &mut Patient::new(None, settings));
                given(ended, audited.finish())
            }
        }?;
        let (Settings { method, rtol, .. }, form) = (settings, self.form);
        report.judge(&Made { form, method, rtol, step: None, stiffness: stiffness.unwrap_or(1e6) });
        Some(report)
    }

    /// How great each recorded variable counts as at least, by name.
    pub(super) fn magnitudes(&self, trace: &Trace) -> BTreeMap<String, f64> {
        let parameter = |name: &str| match &self.system {
            Ready::Explicit(system, _) => system.parameter(name),
            Ready::Implicit(system, ..) => system.reference().parameter(name),
        };
        let known = self.graph.parameters.values();
        let parameters = known.filter_map(|p| Some((p.name.clone(), parameter(&p.name)?))).collect();
        let names: Vec<Arc<str>> = trace.columns.iter().map(|c| c.name.as_str().into()).collect();
        let columns: Vec<&[f64]> = trace.columns.iter().map(|c| c.values.as_slice()).collect();
        let (times, parameters) = (&trace.times, &parameters);
        let run = halfarrow_audit::Run { times, names: &names, columns: &columns, parameters };
        halfarrow_audit::magnitudes(self.graph, &run)
    }

    /// Rates of the motion near the start, in 1/s: the slowest and the fastest that are not zero.
    pub(super) fn rates(&self) -> Option<(f64, f64)> {
        let Ready::Explicit(mut system, mut x) = self.system.clone() else { return None };
        let _ = system.record(&[]);
        system.handle_event(0.0, &mut x).ok()?;
        let linear = system.linearise(0.0, &x, &[]).ok()?;
        let sizes: Vec<f64> =
            crate::linear_algebra::eigenvalues(&linear.a)?.iter().map(|z| libm::hypot(z[0], z[1])).collect();
        let fastest = sizes.iter().copied().fold(0.0f64, f64::max);
        let slowest = sizes.into_iter().filter(|s| *s > 1e-6 * fastest).fold(f64::INFINITY, f64::min);
        (fastest > 0.0 && fastest.is_finite()).then_some((slowest, fastest))
    }
}
