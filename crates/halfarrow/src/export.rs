//! The model as code for elsewhere.
#![cfg_attr(not(feature = "fmu"), allow(dead_code, reason = "only FMUs look ahead"))]

use std::ops::ControlFlow;

use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::program::Program;
use halfarrow_compiler::textbook::show;
#[cfg(feature = "fmu")]
use halfarrow_emit::fmu;
use halfarrow_emit::fmu::Version;
use halfarrow_emit::{self as emit, EmitError, File, Real, latex};
use halfarrow_exec as exec;
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::{Events as _, Method, Options, Sink, System as _, simulate};
use serde::Serialize;

use crate::error::{Error, Problem};
#[cfg(feature = "fmu")]
use crate::library::library;
use crate::model::Model;
use crate::run::{Start, projected};

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// C99: header, source, a program that steps it, a CMake file.
    C,
    /// A Functional Mock-up Unit 2.0, for model exchange and co-simulation.
    Fmu2,
    /// A Functional Mock-up Unit 3.0, for both too.
    Fmu3,
    /// Rates and outputs as functions of CasADi: a file of Python.
    Casadi,
    /// The equations as a LaTeX document.
    Latex,
}

impl Target {
    /// Its name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Target::C => "c",
            Target::Fmu2 => "fmu2",
            Target::Fmu3 => "fmu3",
            Target::Casadi => "casadi",
            Target::Latex => "latex",
        }
    }
}

/// What to write, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// What is written.
    pub target: Target,
    /// The form of the equations; code takes `minimal` and `kane` only.
    pub form: Form,
    /// The method of a step.
    pub method: FixedMethod,
    /// The length of a step, in s.
    pub step: f64,
    /// The real numbers of C; FMUs have `double`.
    pub real: Real,
    /// Whether positions that only speeds keep together are put back onto the relations between them after each step; of C and
    /// FMUs, which steps by themselves, in `double`.
    pub project: bool,
    /// FMUs: whether a binary for this machine stands in it, made by its C compiler; sources always do.
    pub binary: bool,
}

impl Default for Export {
    /// C with the minimal form, the classical Runge-Kutta method and steps of 1 ms.
    fn default() -> Export {
        Export {
            target: Target::C,
            form: Form::Minimal,
            method: FixedMethod::Rk4,
            step: 1e-3,
            real: Real::Double,
            project: false,
            binary: true,
        }
    }
}

/// What was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// The files, in memory.
    pub files: Vec<File>,
    /// What there is to know of them.
    pub report: ExportReport,
}

/// What there is to know of what was written.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExportReport {
    /// Name of the model.
    pub model: String,
    /// `c`, `fmu2`, `fmu3`, `casadi` or `latex`.
    pub target: &'static str,
    /// The name before all functions in C; empty without code.
    pub name: String,
    /// The method of a step, if there is code.
    pub method: Option<&'static str>,
    /// The length of a step, in s, if there is code.
    pub step: Option<f64>,
    /// `double` or `float`, if there is code.
    pub real: Option<&'static str>,
    /// Names of the states.
    pub states: Vec<String>,
    /// Names of the inputs.
    pub inputs: Vec<String>,
    /// Names of the parameters that can be set.
    pub parameters: Vec<String>,
    /// Names of what is computed after each step.
    pub outputs: Vec<String>,
    /// What a step costs at most, if there is code.
    pub cost: Option<CostReport>,
    /// The same in words.
    pub cost_text: Vec<String>,
    /// Paths of the files.
    pub files: Vec<String>,
}

impl ExportReport {
    /// Nothing but the names of the model and of what is written.
    fn without_code(model: &str, target: Target) -> ExportReport {
        ExportReport {
            model: model.to_string(),
            target: target.name(),
            name: String::new(),
            method: None,
            step: None,
            real: None,
            states: Vec::new(),
            inputs: Vec::new(),
            parameters: Vec::new(),
            outputs: Vec::new(),
            cost: None,
            cost_text: Vec::new(),
            files: Vec::new(),
        }
    }
}

/// What a step costs at most: see [`halfarrow_emit::c::Cost`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[allow(missing_docs)]
pub struct CostReport {
    pub operations: u64,
    pub divisions: u64,
    pub calls: u64,
    pub linear_solves: u64,
    pub newton_solves: u64,
    pub newton_evaluations: u64,
    pub method_iterations: u64,
    pub total: u64,
    pub jump_total: u64,
    pub most_jumps: u64,
    pub delay_points: u64,
    pub memory: u64,
    pub modes: u64,
}

/// Combinations of branches of set-valued laws at most in exported code.
const MOST_MODES: usize = 256;
/// Choices of independent variables at most in it: where there are more it keeps its own.
const MOST_SETS: usize = 16;

impl Model {
    /// Writes the model, in memory.
    ///
    /// # Errors
    /// The model has errors or no start, or something is asked that cannot be.
    pub fn export(&self, export: &Export) -> Result<Exported, Error> {
        if export.real == Real::Float && export.target != Target::C {
            return Err(not_single(export.target));
        }
        if let (Some(law), Target::Casadi) = (self.graph.set_valued.first(), export.target) {
            let name = &self.graph.elements[law.element].name;
            let reason = format!(
                "`{name}` has a set-valued law, whose branch changes while the model runs: functions of CasADi have no memory \
                 of it; give it a law with a finite slope, such as a steep resistance, or export c, fmu2 or fmu3"
            );
            return Err(Problem::BadOption { reason }.into());
        }
        match export.target {
            Target::C => self.export_c(export),
            Target::Fmu2 => self.export_fmu(export, Version::V2),
            Target::Fmu3 => self.export_fmu(export, Version::V3),
            Target::Casadi => self.export_casadi(export),
            Target::Latex => self.export_latex(export),
        }
    }

    fn export_latex(&self, export: &Export) -> Result<Exported, Error> {
        let equations = self.equations_in(export.form)?;
        let start = self.unknowns_at_start(&equations);
        let states: Vec<String> = equations.states.iter().map(|s| s.name.clone()).collect();
        let shown = show(equations);
        let start: Vec<f64> = start.into_iter().take(states.len()).collect();
        let name = format!("{}.tex", self.name());
        let files = vec![File::text(&name, latex::document(&shown, &start))];
        let report =
            ExportReport { states, files: vec![name], ..ExportReport::without_code(self.name(), export.target) };
        Ok(Exported { files, report })
    }

    fn export_casadi(&self, export: &Export) -> Result<Exported, Error> {
        let code = ExportedProgram::new(self, export)?;
        let solutions = code.system.solutions();
        let text = emit::casadi::write(&code.program, &code.start, (&code.recorded, &solutions)).map_err(refused)?;
        let name = format!("{}.py", self.name());
        let report = ExportReport { files: vec![name.clone()], ..code.names(&code.recorded) };
        Ok(Exported { files: vec![File::text(&name, text)], report })
    }

    fn export_c(&self, export: &Export) -> Result<Exported, Error> {
        let code = ExportedProgram::new(self, export)?;
        let written = emit::c::write(&code.asked(false)?).map_err(refused)?;
        let w = &written;
        let files = vec![
            File::text(format!("{}.h", w.name), &*w.header),
            File::text(format!("{}.c", w.name), &*w.source),
            File::text("main.c", &*w.main),
            File::text("CMakeLists.txt", &*w.cmake),
        ];
        let names: Vec<String> = files.iter().map(|f| f.path.clone()).collect();
        Ok(Exported { report: code.report(&w.name, &w.cost, &code.recorded, names), files })
    }

    #[cfg(feature = "fmu")]
    fn export_fmu(&self, export: &Export, version: Version) -> Result<Exported, Error> {
        let mut code = ExportedProgram::new(self, export)?;
        code.start.grown = grown(&mut code.system, &code.start, export);
        let written = fmu::write(&code.asked(true)?, version).map_err(refused)?;
        let binary = if export.binary { Some(library(&written, version)?) } else { None };
        let mut names: Vec<String> = written.files.iter().map(|f| f.path.clone()).collect();
        names.extend(binary.iter().map(|f| f.path.clone()));
        let file = File { path: format!("{}.fmu", written.name), bytes: fmu::package(&written, binary) };
        let report = code.report(&written.name, &written.cost, &written.recorded, names);
        Ok(Exported { files: vec![file], report })
    }

    #[cfg(not(feature = "fmu"))]
    fn export_fmu(&self, _: &Export, _: Version) -> Result<Exported, Error> {
        Err(Problem::NotBuilt { what: "write FMUs", feature: "fmu" }.into())
    }
}

/// A program with its start, ready to be written.
struct ExportedProgram<'a> {
    export: &'a Export,
    system: exec::Model,
    program: Program,
    start: emit::Start,
    recorded: Vec<usize>,
    /// The other modes, and what is independent in the first one.
    modes: Vec<emit::c::Mode>,
    independent: Vec<Symbol>,
}

impl<'a> ExportedProgram<'a> {
    fn new(model: &Model, export: &'a Export) -> Result<ExportedProgram<'a>, Error> {
        if !matches!(export.form, Form::Minimal | Form::Kane) {
            return Err(refused(EmitError::Implicit));
        }
        let mut system = model.system_in(export.form)?;
        projected(system.program(), export.project, Method::Fixed(export.method))?;
        if export.project && export.real == Real::Float && export.target == Target::C {
            let reason = "project is for double: what float makes of positions is no drift".into();
            return Err(Problem::BadOption { reason }.into());
        }
        system.record_impulses();
        let states = model.start(&mut system, Start::Given)?;
        let start = start(&system, states).map_err(|failure| model.stopped(failure))?;
        let recorded = system.recorded().to_vec();
        let (independent, modes) = modes(model, export, &system, &start)?;
        Ok(ExportedProgram { export, program: system.program().clone(), system, start, recorded, modes, independent })
    }

    fn asked(&self, derivatives: bool) -> Result<emit::c::Export<'_>, Problem> {
        Ok(emit::c::Export {
            program: &self.program,
            start: &self.start,
            method: method(self.export.method),
            step: self.export.step,
            recorded: &self.recorded,
            derivatives,
            real: self.export.real,
            modes: &self.modes,
            independent: &self.independent,
            project: self.export.project,
        })
    }

    /// What the variables are called that whatever is written has.
    fn names(&self, recorded: &[usize]) -> ExportReport {
        let p = &self.program;
        ExportReport {
            states: p.states.iter().map(|s| s.name.clone()).collect(),
            inputs: p.inputs.iter().map(|i| i.name.clone()).collect(),
            parameters: p.parameters.iter().filter(|p| !p.constant).map(|p| p.name.clone()).collect(),
            outputs: recorded.iter().map(|&i| p.observed[i].name.to_string()).collect(),
            ..ExportReport::without_code(&p.name, self.export.target)
        }
    }

    fn report(&self, name: &str, c: &emit::c::Cost, recorded: &[usize], files: Vec<String>) -> ExportReport {
        let cost = CostReport {
            operations: c.operations,
            divisions: c.divisions,
            calls: c.calls,
            linear_solves: c.linear_solves,
            newton_solves: c.newton_solves,
            newton_evaluations: c.newton_evaluations,
            method_iterations: c.method_iterations,
            total: c.total,
            jump_total: c.jump_total,
            most_jumps: c.most_jumps,
            delay_points: c.delay_points,
            memory: c.memory,
            modes: c.modes,
        };
        ExportReport {
            name: name.to_string(),
            method: Some(method(self.export.method).name()),
            step: Some(self.export.step),
            real: Some(self.export.real.name()),
            cost: Some(cost),
            cost_text: c.lines(),
            files,
            ..self.names(recorded)
        }
    }
}

/// The modes that runs may come to from the first one, and what is independent in that.
fn modes(
    model: &Model,
    export: &Export,
    system: &exec::Model,
    start: &emit::Start,
) -> Result<(Vec<Symbol>, Vec<emit::c::Mode>), Error> {
    // Single precision does not tell what is carried over, functions of CasADi have no memory of a mode, and what relations keep
    // is known in one of them.
    let one = export.real == Real::Float || export.target == Target::Casadi || export.project;
    let sets = if one { 0 } else { MOST_SETS };
    let all = system.programs_of_modes((0.0, &start.states), MOST_MODES, sets).ok_or_else(|| {
        let laws = model.graph.set_valued.len();
        let reason = format!(
            "{laws} set-valued laws have more than {MOST_MODES} combinations of branches: exported code knows each of them as \
             equations of its own; export a part of the model, or give some of the laws a finite slope"
        );
        Error::from(Problem::BadOption { reason })
    })?;
    if export.project && !model.graph.set_valued.is_empty() {
        let reason = "exported code does not put positions back while set-valued laws hold some of them: leave out `--project`, or \
                      write the loop as a `constraint`";
        return Err(Problem::BadOption { reason: reason.into() }.into());
    }
    let mut all = all.into_iter().map(|mode| emit::c::Mode {
        program: mode.program,
        recorded: mode.recorded,
        independent: mode.independent,
    });
    Ok((all.next().map(|first| first.independent).unwrap_or_default(), all.collect()))
}

/// Everything at the start of a run.
fn start(system: &exec::Model, states: Vec<f64>) -> Result<emit::Start, halfarrow_sim::Failure> {
    let mut begun = system.clone();
    let mut x = states.clone();
    let mut observed = vec![0.0; system.observed()];
    begun.handle_event(0.0, &mut x)?;
    begun.observe(0.0, &x, &mut observed)?;
    let p = system.program();
    Ok(emit::Start {
        states,
        conserved: system.conserved().to_vec(),
        positions: system.positions().to_vec(),
        scales: system.scales().to_vec(),
        grown: Vec::new(),
        times: p.held.iter().map(|h| system.constant(h.time).unwrap_or(f64::NAN)).collect(),
        parameters: p.parameters.iter().map(|p| system.parameter(&p.name).unwrap_or(f64::NAN)).collect(),
        derived: system.derived().to_vec(),
        inputs: p.inputs.iter().map(|i| system.constant(i.default).unwrap_or(0.0)).collect(),
        observed,
    })
}

/// Steps of the fixed method, and of the run that looks how states grow, after which that run ends.
const LOOK_AHEAD: (f64, usize) = (1000.0, 2000);

/// How great states become that are nothing at the start, as far as a short run with error control tells.
fn grown(system: &mut exec::Model, start: &emit::Start, export: &Export) -> Vec<f64> {
    let mut growth = Growth { magnitudes: Vec::new(), steps: 0 };
    if start.scales.iter().all(|&scale| scale > 0.0) {
        return growth.magnitudes;
    }
    let options = Options { to: LOOK_AHEAD.0 * export.step, ..Options::default() };
    // Where it stops, by itself or since it takes too long, what was seen is told all the same.
    let _ = simulate(system, &options, &mut start.states.clone(), &mut growth);
    growth.magnitudes
}

/// Listens for the magnitudes of states.
struct Growth {
    magnitudes: Vec<f64>,
    steps: usize,
}

impl Sink for Growth {
    fn sample(&mut self, _: f64, _: &[f64]) {}

    fn progress(&mut self, _: f64) -> ControlFlow<()> {
        self.steps += 1;
        if self.steps < LOOK_AHEAD.1 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }

    fn tolerances(&mut self, magnitudes: &[f64], _: &[f64]) {
        self.magnitudes = magnitudes.to_vec();
    }
}

fn method(method: FixedMethod) -> emit::Method {
    match method {
        FixedMethod::Euler => emit::Method::Euler,
        FixedMethod::Heun => emit::Method::Heun,
        FixedMethod::Rk4 => emit::Method::Rk4,
        FixedMethod::ImplicitMidpoint => emit::Method::ImplicitMidpoint,
        FixedMethod::LinearlyImplicitEuler => emit::Method::LinearlyImplicitEuler,
        FixedMethod::LinearlyImplicitBdf2 => emit::Method::LinearlyImplicitBdf2,
        FixedMethod::Rosenbrock => emit::Method::Rosenbrock,
    }
}

/// Why something else than C is not written with numbers of single precision.
fn not_single(target: Target) -> Error {
    let why = match target {
        Target::Casadi => "functions of CasADi have no numbers of single precision",
        Target::Latex => "equations as a document have no numbers of single precision",
        _ => "the variables of FMUs are double",
    };
    Problem::BadOption { reason: format!("{why}: `--real float` is for `export c`") }.into()
}

fn refused(error: EmitError) -> Error {
    Problem::BadOption { reason: error.to_string() }.into()
}
