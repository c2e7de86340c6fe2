//! What looks after a computation that runs without the interpreter: signals, and how far it has come.

use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// How often the interpreter is asked.
const ASKED: Duration = Duration::from_millis(50);

/// Asks the interpreter now and then whether to go on.
pub struct Watcher {
    /// Is told how far it has come.
    progress: Option<Py<PyAny>>,
    asked: Instant,
    /// What a signal or `progress` has raised.
    raised: Option<PyErr>,
}

impl Watcher {
    pub fn new(progress: Option<Py<PyAny>>) -> Watcher {
        Watcher { progress, asked: Instant::now(), raised: None }
    }

    /// Whether to go on, from a thread that has left the interpreter. `told` are the arguments of `progress`.
    pub fn go_on<A>(&mut self, told: impl FnOnce() -> A) -> bool
    where
        A: for<'py> pyo3::call::PyCallArgs<'py>,
    {
        if self.asked.elapsed() < ASKED {
            return self.raised.is_none();
        }
        self.ask(told)
    }

    /// The same, at once.
    pub fn ask<A>(&mut self, told: impl FnOnce() -> A) -> bool
    where
        A: for<'py> pyo3::call::PyCallArgs<'py>,
    {
        let outcome = Python::attach(|py| {
            py.check_signals()?;
            match &self.progress {
                Some(progress) => progress.call1(py, told()).map(drop),
                None => Ok(()),
            }
        });
        self.raised = self.raised.take().or(outcome.err());
        self.asked = Instant::now();
        self.raised.is_none()
    }

    /// What a signal or `progress` has raised.
    pub fn raised(self) -> Option<PyErr> {
        self.raised
    }
}
