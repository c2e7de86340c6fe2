//! Sweeps in memory.

use halfarrow::{Error, Part, Reduce, Samples, Sweep, SweepReport, SweepTable, Vary};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyAny;
use pythonize::pythonize;

use crate::errors::{raised, refused};
use crate::options::{Inputs, RunOptions};
use crate::run::columns;
use crate::watcher::Watcher;

/// A sweep; see `Sweep` of the library.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct SweepOptions<'py> {
    run: RunOptions,
    /// Values of each parameter, in SI units.
    vary: Vec<(String, PyReadonlyArray1<'py, f64>)>,
    /// Names of parameters, and a row of values for each set.
    samples: Option<(Vec<String>, PyReadonlyArray2<'py, f64>)>,
    /// What is kept, such as `max(body.f)`.
    reduce: Vec<String>,
    /// How many sets of the whole sweep stand before these, and how many it has.
    part: Option<(usize, usize)>,
}

impl SweepOptions<'_> {
    pub fn sweep(self, given: Inputs<'_>) -> PyResult<Sweep> {
        let vary = |(name, values): (String, PyReadonlyArray1<'_, f64>)| Ok(Vary { name, values: values.to_vec()? });
        let samples = |(names, rows): (Vec<String>, PyReadonlyArray2<'_, f64>)| {
            let rows = rows.as_slice()?.chunks(names.len().max(1)).map(<[f64]>::to_vec).collect();
            Ok::<_, PyErr>(Samples { names, rows })
        };
        Ok(Sweep {
            run: self.run.run(given)?,
            vary: self.vary.into_iter().map(vary).collect::<PyResult<_>>()?,
            samples: self.samples.map(samples).transpose()?,
            reduce: self.reduce.iter().map(|text| Reduce::parse(text)).collect::<Result<_, _>>().map_err(refused)?,
            restart: false,
            units: false,
            part: self.part.map(|(first, of)| Part { first, of }),
        })
    }
}

/// A sweep that came to its end, or was stopped with the sets that were done.
#[pyclass(frozen, module = "halfarrow._halfarrow")]
pub struct Swept {
    report: SweepReport,
    /// Name, unit and values of each column.
    #[pyo3(get)]
    columns: Vec<(String, String, Py<PyArray1<f64>>)>,
    /// Whether all sets are there.
    #[pyo3(get)]
    complete: bool,
    /// What a signal or `progress` has raised to stop it.
    #[pyo3(get)]
    raised: Option<Py<PyAny>>,
}

impl Swept {
    pub fn of(py: Python<'_>, outcome: Result<SweepTable, Error>, watcher: Watcher) -> PyResult<Swept> {
        let stopped_by = watcher.raised();
        let table = match outcome {
            Ok(table) => table,
            Err(error) => return Err(stopped_by.unwrap_or_else(|| raised(py, error))),
        };
        let raised = stopped_by.map(|error| error.into_value(py).into_any());
        Ok(Swept { report: table.report, columns: columns(py, table.columns), complete: table.complete, raised })
    }
}

#[pymethods]
impl Swept {
    /// What there is to know, as a dict.
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize(py, &self.report)?)
    }
}
