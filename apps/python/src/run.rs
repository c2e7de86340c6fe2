//! What came of a run: columns as arrays, the report when it is asked for.

use std::path::PathBuf;

use halfarrow::{Column, Error, RunReport, Simulated, Trace};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyAny;
use pythonize::pythonize;

use crate::errors::{FileError, UsageError, raised};
use crate::threads::apart;
use crate::watcher::Watcher;

/// A run that came to its end, or stopped with what it had computed. Times and columns are the memory of the run itself.
#[pyclass(frozen, module = "halfarrow._halfarrow")]
pub struct Ended {
    report: RunReport,
    /// Times, in s.
    #[pyo3(get)]
    times: Py<PyArray1<f64>>,
    /// Name, unit and values of each column.
    #[pyo3(get)]
    columns: Vec<(String, String, Py<PyArray1<f64>>)>,
    /// Where the numbers of the times and of each column lay when the run wrote them.
    #[pyo3(get)]
    addresses: Vec<usize>,
    /// Why the run stopped, if it did.
    #[pyo3(get)]
    failure: Option<String>,
    /// What a signal or `progress` has raised to stop it.
    #[pyo3(get)]
    raised: Option<Py<PyAny>>,
    /// What the run took by itself, in s, its start included.
    #[pyo3(get)]
    seconds: f64,
}

impl Ended {
    pub fn of(py: Python<'_>, outcome: Result<Simulated, Error>, seconds: f64, watcher: Watcher) -> PyResult<Ended> {
        let stopped_by = watcher.raised();
        let (trace, report, failure) = match outcome {
            Ok(done) => (done.trace, done.report, None),
            Err(Error::Run(stopped)) => {
                let failure = stopped.to_string();
                (stopped.trace, stopped.report, Some(failure))
            }
            Err(error) => return Err(stopped_by.unwrap_or_else(|| raised(py, error))),
        };
        let address = |values: &Vec<f64>| values.as_ptr() as usize;
        let addresses =
            std::iter::once(address(&trace.times)).chain(trace.columns.iter().map(|c| address(&c.values))).collect();
        let raised = stopped_by.map(|error| error.into_value(py).into_any());
        Ok(Ended {
            report,
            times: PyArray1::from_vec(py, trace.times).unbind(),
            columns: columns(py, trace.columns),
            addresses,
            failure,
            raised,
            seconds,
        })
    }
}

/// Columns handed over as they are.
pub fn columns(py: Python<'_>, columns: Vec<Column>) -> Vec<(String, String, Py<PyArray1<f64>>)> {
    columns.into_iter().map(|c| (c.name, c.unit, PyArray1::from_vec(py, c.values).unbind())).collect()
}

#[pymethods]
impl Ended {
    /// What the run took, and how well it did, as a dict.
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize(py, &self.report)?)
    }

    /// Of each state its name, the magnitude that it was taken to have and the error allowed in a step, in SI units.
    fn tolerances(&self) -> Vec<(String, f64, f64)> {
        self.report.tolerances.iter().map(|kept| (kept.name.clone(), kept.scale, kept.absolute)).collect()
    }

    /// What was left out or is to be known.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.report.notes.clone()
    }

    /// What the audit found missed.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.report.audit.warnings.clone()
    }

    /// The time reached, in s.
    #[getter]
    fn reached(&self) -> f64 {
        self.report.reached
    }
}

/// Runs by name: times, and name, unit and values of each column.
pub type Runs<'py> = Vec<(String, PyReadonlyArray1<'py, f64>, Vec<(String, String, PyReadonlyArray1<'py, f64>)>)>;

/// The same as the library takes them.
pub fn traces(runs: Runs<'_>) -> PyResult<Vec<(String, Trace)>> {
    let column = |(name, unit, values): (String, String, PyReadonlyArray1<'_, f64>)| {
        Ok(Column { name, unit, values: values.to_vec()? })
    };
    let trace = |(name, times, columns): (String, PyReadonlyArray1<'_, f64>, Vec<_>)| {
        let columns = columns.into_iter().map(column).collect::<PyResult<_>>()?;
        Ok((name, Trace { times: times.to_vec()?, columns }))
    };
    runs.into_iter().map(trace).collect()
}

/// Writes a run as CSV or Parquet, as the ending of the path says; CSV with a second line of units if asked for.
#[pyfunction]
pub fn write_trace(py: Python<'_>, path: PathBuf, runs: Runs<'_>, units: bool) -> PyResult<()> {
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).unwrap_or_default();
    let write: fn(&Trace, &PathBuf, bool) -> Result<(), halfarrow::WriteError> = match ending.as_str() {
        "csv" => |trace, path, units| halfarrow::write_csv(trace, path, units),
        "parquet" => |trace, path, _| halfarrow::write_parquet(trace, path),
        _ => {
            let text =
                format!("the name {} does not say what to write: let it end in .csv or .parquet", path.display());
            return Err(UsageError::new_err(text));
        }
    };
    let traces = traces(runs)?;
    apart(py, || traces.iter().try_for_each(|(_, trace)| write(trace, &path, units)))
        .map_err(|why| FileError::new_err(format!("{} cannot be written: {}", path.display(), why.source)))
}
