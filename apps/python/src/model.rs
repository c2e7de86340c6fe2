//! A model, with its equations once they are derived.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use halfarrow::{
    Compare, Compiled, DrawOptions, DrawnPaths, Error, Export, Form, Gradient, Library, Override, Picture, PlotOptions,
    Problem, Real, Reduce, Report, Source, Stage, Target, Trace, Weighed,
};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyAny, PyBytes};
use pythonize::pythonize;

use crate::errors::{diagnostics, raised, refused};
use crate::linear::{LinearizeOptions, Linearized};
use crate::options::{Inputs, RunOptions, fixed, form, inputs, none};
use crate::run::{Ended, Runs, traces};
use crate::stepper::Stepper;
use crate::sweep::{SweepOptions, Swept};
use crate::threads::{alone, apart};
use crate::watcher::Watcher;

/// Values of parameters as text.
type Overrides = Vec<(String, String)>;
/// Values of parameters, in SI units.
type Values = Vec<(String, f64)>;
/// Name, text, files that it read, values of parameters as text.
type Parts = (String, String, BTreeMap<String, String>, Overrides);

/// Files with their contents, and what there is to know of them.
type Files<'py> = (Vec<(String, Bound<'py, PyBytes>)>, Bound<'py, PyAny>);
/// Text of a page, warnings, why its run failed, forms that are not to be used.
type PageParts = (String, Vec<String>, Option<String>, Vec<&'static str>);

/// A model of the library. Its equations are derived when they are first needed, and kept.
#[pyclass(frozen, module = "halfarrow._halfarrow")]
pub struct Model {
    model: halfarrow::Model,
    compiled: Mutex<BTreeMap<&'static str, Arc<Compiled>>>,
}

impl Model {
    fn of(model: halfarrow::Model) -> Model {
        Model { model, compiled: Mutex::default() }
    }

    /// The equations of a form; called without the interpreter, for which others may wait.
    fn compiled(&self, form: Form) -> Result<Arc<Compiled>, Error> {
        let mut known = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(compiled) = known.get(form.name()) {
            return Ok(Arc::clone(compiled));
        }
        let compiled = Arc::new(self.model.compile(form)?);
        known.insert(form.name(), Arc::clone(&compiled));
        Ok(compiled)
    }

    /// The same with other values of parameters.
    fn compiled_with(&self, form: Form, values: &Values) -> Result<Arc<Compiled>, Error> {
        let compiled = self.compiled(form)?;
        if values.is_empty() {
            return Ok(compiled);
        }
        let mut changed = (*compiled).clone();
        changed.set_all(values.iter().map(|(name, value)| (name.as_str(), *value)))?;
        Ok(Arc::new(changed))
    }

    /// The model with other values of parameters.
    fn model_with(&self, values: &Values) -> Result<halfarrow::Model, Error> {
        match values.is_empty() {
            true => Ok(self.model.clone()),
            false => self.compiled_with(Form::Minimal, values)?.model_as_set().map(Arc::unwrap_or_clone),
        }
    }
}

fn overrides(set: Overrides) -> Vec<Override> {
    set.into_iter().map(|(name, value)| Override { name, value }).collect()
}

/// Does something without the interpreter, which may fail.
fn tried<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Error> + Send) -> PyResult<T> {
    apart(py, work).map_err(|error| raised(py, error))
}

/// What an objective of Python gives for a run.
fn asked(py: Python<'_>, objective: &Py<PyAny>, trace: &Trace) -> PyResult<Weighed> {
    let times = PyArray1::from_slice(py, &trace.times);
    let columns: Vec<_> = trace.columns.iter().map(|c| PyArray1::from_slice(py, &c.values)).collect();
    let names: Vec<&str> = trace.columns.iter().map(|c| c.name.as_str()).collect();
    let told = objective.bind(py).call1((times, names, columns))?;
    let (value, weights): (f64, Vec<PyReadonlyArray1<'_, f64>>) = told.extract()?;
    let samples = weights.iter().map(|w| Ok(w.to_vec()?)).collect::<PyResult<_>>()?;
    Ok(Weighed { value, samples, times: None })
}

#[pymethods]
impl Model {
    /// A model from its text, the files that it may import, and values of parameters.
    #[staticmethod]
    fn from_text(
        py: Python<'_>,
        name: &str,
        text: &str,
        files: BTreeMap<String, String>,
        set: Overrides,
    ) -> PyResult<Model> {
        let source = Source::text(name, text).with_files(files);
        tried(py, || halfarrow::Model::new(source, &overrides(set)).map(Model::of))
    }

    /// A model from a file; what it imports lies in its folder, in those of `allow`, or below.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, allow: Vec<PathBuf>, set: Overrides) -> PyResult<Model> {
        tried(py, || {
            let source = Source::open_allowing(&path, &allow)?;
            halfarrow::Model::new(source, &overrides(set)).map(Model::of)
        })
    }

    /// The same model with other values of parameters.
    fn with_parameters(&self, py: Python<'_>, set: Overrides) -> PyResult<Model> {
        tried(py, || self.model.with(&overrides(set)).map(Model::of))
    }

    /// The same model with start values of these variables as parameters.
    fn with_starts(&self, py: Python<'_>, variables: Vec<String>) -> PyResult<Model> {
        let variables: Vec<&str> = variables.iter().map(String::as_str).collect();
        tried(py, || Ok(Model::of(self.model.with_starts(&variables)?)))
    }

    /// What the same model can be made of elsewhere.
    fn parts(&self) -> Parts {
        let source = self.model.source();
        let set = self.model.overrides().iter().map(|o| (o.name.clone(), o.value.clone())).collect();
        (source.name().to_string(), source.content().to_string(), self.model.files(), set)
    }

    #[getter]
    fn name(&self) -> &str {
        self.model.name()
    }

    /// What was noticed in the text, names, units and bonds.
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        diagnostics(py, self.model.warnings())
    }

    /// What was noticed through all stages.
    fn check<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let found = tried(py, || self.model.check())?;
        diagnostics(py, &found)
    }

    /// What each stage took so far: its name, seconds, memory.
    fn timings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize(py, &self.model.timings())?)
    }

    /// Parameters, inputs, states, variables.
    fn interface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let compiled = tried(py, || self.compiled(Form::Minimal))?;
        Ok(pythonize(py, &compiled.interface())?)
    }

    /// The value of a text such as `20 kN/m` for a parameter, in SI units.
    fn quantity(&self, py: Python<'_>, name: &str, text: &str) -> PyResult<f64> {
        tried(py, || self.compiled(Form::Minimal))?.quantity(name, text).map_err(refused)
    }

    /// A stage as text.
    fn show(&self, py: Python<'_>, stage: &str) -> PyResult<String> {
        let found = Stage::ALL.into_iter().find(|known| known.name() == stage);
        let stage = found.ok_or_else(|| none("stage", stage))?;
        tried(py, || stage.show_model(&self.model))
    }

    /// Zero-order causal paths and what becomes of them.
    fn loops<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let report = tried(py, || self.model.loops())?;
        Ok(pythonize(py, &report)?)
    }

    /// The equations of a form, of some variables or all.
    fn equations<'py>(&self, py: Python<'py>, form_name: &str, only: Vec<String>) -> PyResult<Bound<'py, PyAny>> {
        let form = form(form_name)?;
        let report = tried(py, || self.model.equations_for(form, &only))?;
        Ok(pythonize(py, &report)?)
    }

    /// The drawing as SVG.
    fn draw(&self, py: Python<'_>, paths: Option<Vec<usize>>, laws: bool, first_cells: bool) -> PyResult<String> {
        let options = DrawOptions {
            paths: paths.map_or(DrawOptions::default().paths, DrawnPaths::Numbers),
            laws,
            first_cells,
            ..DrawOptions::default()
        };
        tried(py, || self.model.draw(&options)).map(|picture| picture.svg)
    }

    /// A plot of runs as SVG.
    fn plot(&self, runs: Runs<'_>, vars: Vec<String>, x: Option<String>, log: [bool; 2]) -> PyResult<String> {
        let traces = traces(runs)?;
        let named: Vec<_> = traces.iter().map(|(name, trace)| (name.as_str(), trace)).collect();
        let options = PlotOptions { vars, x, log };
        match (&named[..], options.is_plain()) {
            ([(_, trace)], true) => Ok(self.model.plot(trace).svg),
            _ => self.model.plot_runs(&named, &options).map(|picture| picture.svg).map_err(refused),
        }
    }

    /// A run.
    fn simulate(
        &self,
        py: Python<'_>,
        options: RunOptions,
        given: Inputs<'_>,
        values: Values,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Ended> {
        let run = options.run(given)?;
        let mut watcher = Watcher::new(progress);
        let mut begun = Instant::now();
        let outcome = apart(py, || {
            let mut go_on = |told: halfarrow::Progress<'_>| watcher.go_on(|| (told.time,));
            if run.minimum_norm {
                return self.model_with(&values)?.simulate(&run, &mut go_on);
            }
            let compiled = self.compiled_with(run.form, &values)?;
            begun = Instant::now();
            compiled.simulate(&run, &mut go_on)
        });
        let seconds = begun.elapsed().as_secs_f64();
        Ended::of(py, outcome, seconds, watcher)
    }

    /// A run, and the derivatives of a number that it comes to: of a text such as `rms(travel)`, or of what `objective` gives
    /// for times, names and columns, with its derivatives by the columns. Of each the name, the unit, the present value and the
    /// derivative; then by what there is none, and why.
    #[allow(clippy::type_complexity, reason = "a row of plain values")]
    fn gradient(
        &self,
        py: Python<'_>,
        options: RunOptions,
        given: Inputs<'_>,
        values: Values,
        objective: Py<PyAny>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(f64, Vec<(String, String, Option<f64>, f64)>, Vec<(String, String)>, Ended)> {
        let run = options.run(given)?;
        let reduce = match objective.extract::<String>(py) {
            Ok(text) => Some(Reduce::parse(&text).map_err(refused)?),
            Err(_) => None,
        };
        let (mut watcher, mut begun, mut thrown) = (Watcher::new(progress), Instant::now(), None);
        let outcome = apart(py, || {
            let mut go_on = |told: halfarrow::Progress<'_>| watcher.go_on(|| (told.time,));
            let compiled = self.compiled_with(run.form, &values)?;
            begun = Instant::now();
            let mut number = |trace: &Trace| match &reduce {
                Some(reduce) => reduce.objective(trace),
                None => Python::attach(|py| asked(py, &objective, trace)).map_err(|error| {
                    thrown = Some(error);
                    Problem::BadOption { reason: "the objective has raised".into() }.into()
                }),
            };
            compiled.gradient(&run, &mut number, &mut go_on)
        });
        let seconds = begun.elapsed().as_secs_f64();
        if let Some(error) = thrown {
            return Err(error);
        }
        let (found, run) = match outcome {
            Ok(Gradient { value, slopes, without, run }) => ((value, slopes, without), Ok(run)),
            Err(error) => ((f64::NAN, Vec::new(), Vec::new()), Err(error)),
        };
        let ended = Ended::of(py, run, seconds, watcher)?;
        let slopes = found.1.into_iter().map(|s| (s.name, s.unit, s.at, s.slope)).collect();
        Ok((found.0, slopes, found.2, ended))
    }

    /// A sweep in memory, on all cores or on one thread.
    fn sweep(
        &self,
        py: Python<'_>,
        options: SweepOptions<'_>,
        given: Inputs<'_>,
        progress: Option<Py<PyAny>>,
        on_one_thread: bool,
    ) -> PyResult<Swept> {
        let sweep = options.sweep(given)?;
        let mut watcher = Watcher::new(progress);
        let work = || {
            let mut told = 0;
            let mut go_on = |done: usize, sets: usize| match std::mem::replace(&mut told, done) == done {
                true => watcher.go_on(|| (done, sets)),
                false => watcher.ask(|| (done, sets)),
            };
            self.compiled(Form::Minimal)?.sweep(&sweep, &mut go_on)
        };
        let outcome = if on_one_thread { alone(py, work) } else { apart(py, work) };
        Swept::of(py, outcome, watcher)
    }

    /// A run by steps.
    fn stepper(
        &self,
        py: Python<'_>,
        method: &str,
        step: f64,
        start: &str,
        project: bool,
        values: Values,
    ) -> PyResult<Stepper> {
        let (method, start) = (fixed(method)?, crate::options::start(start)?);
        let begun = || self.compiled_with(Form::Minimal, &values)?.stepper_projecting(method, step, start, project);
        tried(py, begun).map(Stepper::of)
    }

    /// Matrices near a point.
    fn linearize(
        &self,
        py: Python<'_>,
        options: LinearizeOptions,
        given: Inputs<'_>,
        values: Values,
    ) -> PyResult<Linearized> {
        let wanted = options.wanted(given)?;
        tried(py, || self.model_with(&values)?.linearize(&wanted)).map(Linearized::of)
    }

    /// Code for elsewhere: files with their contents, and what there is to know of them.
    #[allow(clippy::too_many_arguments, reason = "each is an argument of `export` in Python")]
    fn export<'py>(
        &self,
        py: Python<'py>,
        target: &str,
        form_name: &str,
        method: &str,
        step: f64,
        real: &str,
        project: bool,
        binary: bool,
    ) -> PyResult<Files<'py>> {
        let targets = [Target::C, Target::Fmu2, Target::Fmu3, Target::Casadi, Target::Latex];
        let target = targets.into_iter().find(|known| known.name() == target).ok_or_else(|| none("target", target))?;
        let real = [Real::Double, Real::Float]
            .into_iter()
            .find(|known| known.name() == real)
            .ok_or_else(|| none("real", real))?;
        let export = Export { target, form: form(form_name)?, method: fixed(method)?, step, real, project, binary };
        let exported = tried(py, || self.model.export(&export))?;
        let files = exported.files.iter().map(|file| (file.path.clone(), PyBytes::new(py, &file.bytes))).collect();
        Ok((files, pythonize(py, &exported.report)?))
    }

    /// All forms beside each other.
    #[allow(clippy::too_many_arguments, reason = "each is an argument of `compare` in Python")]
    fn compare<'py>(
        &self,
        py: Python<'py>,
        to: Option<f64>,
        error: f64,
        repeats: usize,
        patience: f64,
        budget: Option<f64>,
        given: Inputs<'_>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, String)> {
        let wanted = Compare { to, error, inputs: inputs(given)?, repeats, patience, budget };
        let mut watcher = Watcher::new(progress);
        let compared =
            apart(py, || self.model.compare(&wanted, &mut |part, what| watcher.go_on(|| (part, what.to_string()))));
        if let Some(error) = watcher.raised() {
            return Err(error);
        }
        let report = compared.map_err(|error| raised(py, error))?;
        Ok((pythonize(py, &report)?, report.plot().svg))
    }

    /// Everything in one page: its text, warnings, why its run failed, forms that are not to be used.
    fn report(
        &self,
        py: Python<'_>,
        to: Option<f64>,
        compare: bool,
        budget: f64,
        given: Inputs<'_>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PageParts> {
        let wanted = Report { to, compare, compare_budget: budget, inputs: inputs(given)?, ..Report::default() };
        let mut watcher = Watcher::new(progress);
        let made =
            apart(py, || self.model.report(&wanted, &mut |part, what| watcher.go_on(|| (part, what.to_string()))));
        if let Some(error) = watcher.raised() {
            return Err(error);
        }
        let page = made.map_err(|error| raised(py, error))?;
        Ok((page.html, page.warnings, page.failure, page.refused))
    }
}

/// A picture as PNG.
#[pyfunction]
pub fn png<'py>(py: Python<'py>, svg: String) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = apart(py, || Picture { svg }.to_png()).map_err(refused)?;
    Ok(PyBytes::new(py, &bytes))
}

/// The canonical layout of a text.
#[pyfunction]
pub fn format_text(py: Python<'_>, name: &str, text: &str) -> PyResult<String> {
    tried(py, || halfarrow::format_text(name, text))
}

/// The components that come with the program.
#[pyfunction]
pub fn library(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    Ok(pythonize(py, &Library::all())?)
}
