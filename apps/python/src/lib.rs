//! The compiled part of the Python package `halfarrow`: models, runs, sweeps and steppers of the library, with arrays and plain
//! dicts in the place of its reports. What users call is the Python text beside it, in `python/halfarrow`.

mod errors;
mod linear;
mod model;
mod options;
mod run;
mod stepper;
mod sweep;
mod threads;
mod watcher;

use pyo3::prelude::*;

/// The compiled part of `halfarrow`.
#[pymodule]
mod _halfarrow {
    #[pymodule_export]
    use super::linear::Linearized;
    #[pymodule_export]
    use super::model::{Model, format_text, library, png};
    #[pymodule_export]
    use super::run::{Ended, write_trace};
    #[pymodule_export]
    use super::stepper::{Snapshot, Stepper};
    #[pymodule_export]
    use super::sweep::Swept;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::threads::loaded();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
