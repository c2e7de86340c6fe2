//! Models near a point.

use halfarrow::{Linearize, LinearizeReport, Point};
use numpy::{Complex64, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyAny;
use pythonize::pythonize;

use crate::errors::UsageError;
use crate::options::{Inputs, inputs};

/// Where to linearise: `start`, `equilibrium`, or a time in s.
#[derive(FromPyObject)]
enum At {
    Time(f64),
    Named(String),
}

/// Where to linearise, and between what; see `Linearize` of the library.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct LinearizeOptions {
    at: At,
    inputs: Option<Vec<String>>,
    outputs: Option<Vec<String>>,
    symbolic: bool,
}

impl LinearizeOptions {
    pub fn wanted(self, given: Inputs<'_>) -> PyResult<Linearize> {
        let at = match self.at {
            At::Time(time) => Point::Time(time),
            At::Named(name) if name == "start" => Point::Start,
            At::Named(name) if name == "equilibrium" => Point::Equilibrium,
            At::Named(other) => {
                let text = format!("at is {other:?}: it has to be \"start\", \"equilibrium\" or a time in s");
                return Err(UsageError::new_err(text));
            }
        };
        let LinearizeOptions { inputs: between, outputs, symbolic, .. } = self;
        Ok(Linearize { at, inputs: between, outputs, symbolic, series: inputs(given)? })
    }
}

/// A model near a point.
#[pyclass(frozen, module = "halfarrow._halfarrow")]
pub struct Linearized {
    report: LinearizeReport,
}

impl Linearized {
    pub fn of(report: LinearizeReport) -> Linearized {
        Linearized { report }
    }
}

/// Input, output, angular frequencies in rad/s, values.
type Response<'py> = (String, String, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<Complex64>>);

#[pymethods]
impl Linearized {
    /// All of it as a dict.
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize(py, &self.report)?)
    }

    /// The responses of all outputs to all inputs over the frequencies that the model knows.
    fn responses<'py>(&self, py: Python<'py>) -> Vec<Response<'py>> {
        let response = |r: halfarrow::Response| {
            let values = r.values.iter().map(|&[re, im]| Complex64::new(re, im)).collect();
            (r.input, r.output, PyArray1::from_vec(py, r.frequencies), PyArray1::from_vec(py, values))
        };
        self.report.responses().into_iter().map(response).collect()
    }

    /// The Bode plot as SVG.
    fn bode(&self) -> String {
        self.report.bode().svg
    }

    /// The Nyquist plot as SVG.
    fn nyquist(&self) -> String {
        self.report.nyquist().svg
    }
}
