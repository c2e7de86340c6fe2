//! A run in the hands of the caller.

use halfarrow::Error;
use pyo3::prelude::*;
use pyo3::types::PyAny;
use pythonize::pythonize;

use crate::errors::{raised, refused};
use crate::threads::apart;
use crate::watcher::Watcher;

/// Steps between two looks at the clock.
const STRIDE: u64 = 64;

/// A run by steps of fixed length.
#[pyclass(module = "halfarrow._halfarrow")]
pub struct Stepper {
    run: halfarrow::Stepper,
}

impl Stepper {
    pub fn of(run: halfarrow::Stepper) -> Stepper {
        Stepper { run }
    }
}

/// Where a run by steps stands, with its parameters and inputs.
#[pyclass(frozen, module = "halfarrow._halfarrow")]
pub struct Snapshot {
    saved: halfarrow::Snapshot,
}

#[pymethods]
impl Stepper {
    /// How far it has come, in s.
    #[getter]
    fn time(&self) -> f64 {
        self.run.time()
    }

    /// The length of a step, in s.
    #[getter]
    fn step_length(&self) -> f64 {
        self.run.step()
    }

    /// Goes on by so many steps.
    fn advance(&mut self, py: Python<'_>, steps: u64) -> PyResult<()> {
        let mut watcher = Watcher::new(None);
        let run = &mut self.run;
        let done = apart(py, || {
            let mut left = steps;
            while left > 0 {
                let now = left.min(STRIDE);
                run.advance(now)?;
                left -= now;
                if left > 0 && !watcher.go_on(|| ()) {
                    break;
                }
            }
            Ok::<(), Error>(())
        });
        done.map_err(|error| raised(py, error))?;
        watcher.raised().map_or(Ok(()), Err)
    }

    /// Sets an input.
    fn set_input(&mut self, name: &str, value: f64) -> PyResult<()> {
        self.run.set_input(name, value).map_err(refused)
    }

    /// Sets a parameter, in SI units.
    fn set_parameter(&mut self, py: Python<'_>, name: &str, value: f64) -> PyResult<()> {
        self.run.set_parameter(name, value).map_err(|error| raised(py, error))
    }

    /// The value of a parameter or constant, in SI units.
    fn parameter(&self, name: &str) -> Option<f64> {
        self.run.parameter(name)
    }

    /// The present value of a variable.
    fn read(&mut self, py: Python<'_>, name: &str) -> PyResult<f64> {
        self.run.read(name).map_err(|error| raised(py, error))
    }

    /// How far positions have drifted by now from what only their speeds keep, a dict for each relation.
    fn drift<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize(py, &self.run.drift())?)
    }

    fn save(&self) -> Snapshot {
        Snapshot { saved: self.run.save() }
    }

    fn restore(&mut self, py: Python<'_>, snapshot: &Snapshot) -> PyResult<()> {
        self.run.restore(&snapshot.saved).map_err(|error| raised(py, error))
    }
}
