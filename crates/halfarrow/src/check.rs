//! Everything that is wrong or odd in a model.

use halfarrow_compiler::compile::Found;
use halfarrow_compiler::diagnostic::to_json;
use serde_json::{Value, json};

use crate::Override;
use crate::error::Error;
use crate::model::Model;
use crate::source::Source;
use crate::watch::StageTime;

/// What `halfarrow check` tells.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckReport {
    /// All diagnostics, and the texts they are about.
    pub found: Found,
    /// Number of errors.
    pub errors: usize,
    /// Number of warnings.
    pub warnings: usize,
    /// What the stages took; nothing if the bond graph has errors.
    pub timings: Vec<StageTime>,
}

impl CheckReport {
    /// Checks a model through all stages, as far as its errors allow; `set` replaces values of parameters.
    ///
    /// # Errors
    /// The equations have no value at the start.
    pub fn of(source: Source, set: &[Override]) -> Result<CheckReport, Error> {
        let model = Model::new(source, set);
        let timings = model.as_ref().ok().map(|model| model.watch.clone());
        let found = match model.and_then(|model| model.check()) {
            Ok(found) | Err(Error::Model(found)) => found,
            Err(other) => return Err(other),
        };
        let errors = found.diagnostics.0.iter().filter(|d| d.is_error()).count();
        let warnings = found.diagnostics.0.len() - errors;
        let timings = timings.map(|watch| watch.noted()).unwrap_or_default();
        Ok(CheckReport { found, errors, warnings, timings })
    }

    /// For programs: `errors`, `warnings`, `diagnostics`.
    pub fn to_json(&self) -> Value {
        json!({
            "errors": self.errors,
            "warnings": self.warnings,
            "diagnostics": to_json(&self.found.diagnostics, &self.found.sources),
        })
    }
}
