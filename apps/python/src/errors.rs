//! Errors of the library as exceptions of the package.

use halfarrow::{Error, Found, Problem};
use pyo3::import_exception;
use pyo3::prelude::*;
use pyo3::types::PyAny;

import_exception!(halfarrow._errors, ModelError);
import_exception!(halfarrow._errors, UsageError);
import_exception!(halfarrow._errors, UnknownNameError);
import_exception!(halfarrow._errors, FileError);
import_exception!(halfarrow._errors, RunError);

/// The exception of an error.
pub fn raised(py: Python<'_>, error: Error) -> PyErr {
    let text = error.render(false);
    let text = text.trim_end().strip_prefix("error: ").unwrap_or(text.trim_end()).to_string();
    match error {
        // What was asked for is at fault, not the text.
        Error::Model(_) if error.exit_status() == 2 => UsageError::new_err(text),
        Error::Model(found) => match diagnostics(py, &found) {
            Ok(diagnostics) => ModelError::new_err((text, diagnostics.unbind())),
            Err(error) => error,
        },
        Error::Usage(problem) => refused(problem),
        Error::Run(_) | Error::Interrupted { .. } => RunError::new_err(text),
    }
}

/// The exception of something asked that cannot be.
pub fn refused(problem: Problem) -> PyErr {
    let text = problem.to_string();
    match problem {
        Problem::UnknownVariable { .. } | Problem::UnknownInput { .. } => UnknownNameError::new_err(text),
        Problem::Unreadable { .. } | Problem::Unwritable { .. } => FileError::new_err(text),
        _ => UsageError::new_err(text),
    }
}

/// Diagnostics as a list of dicts, each with its lines of the model as `rendered`.
pub fn diagnostics<'py>(py: Python<'py>, found: &Found) -> PyResult<Bound<'py, PyAny>> {
    let mut all = Error::Model(found.clone()).to_json()["diagnostics"].take();
    for (told, diagnostic) in all.as_array_mut().into_iter().flatten().zip(&found.diagnostics.0) {
        let mut alone = found.clone();
        alone.diagnostics.0 = vec![diagnostic.clone()];
        told["rendered"] = alone.render(false).trim_end().into();
    }
    Ok(pythonize::pythonize(py, &all)?)
}
