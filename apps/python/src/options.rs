//! What the Python part asks for, as the library takes it.

use halfarrow::{Execution, FixedMethod, Form, Input, Method, Record, Run, Start};
use numpy::{PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::errors::UsageError;

/// An input: the same value all the time, values over times in s, or CSV.
#[derive(FromPyObject)]
pub enum Given<'py> {
    Constant(f64),
    Series(PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
    /// `file` and its path, or `csv` and a text.
    Csv(String, String),
}

/// Inputs by name.
pub type Inputs<'py> = Vec<(String, Given<'py>)>;

/// As the library takes them.
pub fn inputs(given: Inputs<'_>) -> PyResult<Vec<(String, Input)>> {
    let input = |given: Given<'_>| {
        Ok::<_, PyErr>(match given {
            Given::Constant(value) => Input::Constant(value),
            Given::Series(times, values) => Input::Series { times: times.to_vec()?, values: values.to_vec()? },
            Given::Csv(kind, path) if kind == "file" => Input::File(path.into()),
            Given::Csv(_, text) => Input::Csv(text),
        })
    };
    given.into_iter().map(|(name, given)| Ok((name, input(given)?))).collect()
}

/// What is recorded: `default`, `all`, `names` or `also`, and the names for the last two.
pub type Recorded = (String, Vec<String>);

/// A run; see `Run` of the library.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct RunOptions {
    to: f64,
    every: Option<f64>,
    at: Vec<f64>,
    form: String,
    stiffness: Option<f64>,
    damping: Option<f64>,
    method: String,
    step: Option<f64>,
    rtol: f64,
    atol: Option<f64>,
    project: bool,
    minimum_norm: bool,
    start: String,
    record: Recorded,
    sensitivities: Vec<String>,
    execution: String,
}

impl RunOptions {
    pub fn run(self, given: Inputs<'_>) -> PyResult<Run> {
        let (kind, names) = self.record;
        Ok(Run {
            to: self.to,
            every: self.every,
            at: self.at,
            form: form(&self.form)?,
            stiffness: self.stiffness,
            damping: self.damping,
            method: method(&self.method)?,
            step: self.step,
            rtol: self.rtol,
            atol: self.atol,
            project: self.project,
            minimum_norm: self.minimum_norm,
            inside: true,
            inputs: inputs(given)?,
            start: start(&self.start)?,
            record: match kind.as_str() {
                "default" => Record::Default,
                "all" => Record::All,
                "names" => Record::Names(names),
                "also" => Record::Also(names),
                other => return Err(none("record", other)),
            },
            sensitivities: self.sensitivities,
            execution: match self.execution.as_str() {
                "auto" => Execution::Auto,
                "bytecode" => Execution::Bytecode,
                "machine" => Execution::Machine,
                other => return Err(none("execution", other)),
            },
        })
    }
}

pub fn form(name: &str) -> PyResult<Form> {
    Form::ALL.into_iter().find(|form| form.name() == name).ok_or_else(|| none("form", name))
}

pub fn start(name: &str) -> PyResult<Start> {
    match name {
        "given" => Ok(Start::Given),
        "equilibrium" => Ok(Start::Equilibrium),
        other => Err(none("start", other)),
    }
}

pub fn fixed(name: &str) -> PyResult<FixedMethod> {
    match name {
        "euler" => Ok(FixedMethod::Euler),
        "heun" => Ok(FixedMethod::Heun),
        "rk4" => Ok(FixedMethod::Rk4),
        "implicit-midpoint" => Ok(FixedMethod::ImplicitMidpoint),
        "linearly-implicit-euler" => Ok(FixedMethod::LinearlyImplicitEuler),
        "linearly-implicit-bdf2" => Ok(FixedMethod::LinearlyImplicitBdf2),
        "rosenbrock" => Ok(FixedMethod::Rosenbrock),
        other => Err(none("method", other)),
    }
}

fn method(name: &str) -> PyResult<Method> {
    match name {
        "auto" => Ok(Method::Auto),
        "explicit" => Ok(Method::Explicit),
        "bdf" => Ok(Method::Bdf),
        "radau" => Ok(Method::Radau),
        other => fixed(other).map(Method::Fixed),
    }
}

/// There is no such choice.
pub fn none(option: &str, value: &str) -> PyErr {
    UsageError::new_err(format!("{option} is {value:?}, which there is not"))
}
