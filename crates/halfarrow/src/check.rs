//! Everything that is wrong or odd in a model.

use halfarrow_compiler::compile::Found;
use halfarrow_compiler::diagnostic::to_json;
use serde_json::{Value, json};

use crate::error::Error;
use crate::model::Model;
use crate::source::Source;

/// What `halfarrow check` tells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CheckReport {
    /// All diagnostics, and the texts they are about.
    pub found: Found,
    /// Number of errors.
    pub errors: usize,
    /// Number of warnings.
    pub warnings: usize,
}

impl CheckReport {
    /// Checks a model through all stages, as far as its errors allow.
    ///
    /// # Errors
    /// The equations have no value at the start.
    pub fn of(source: Source) -> Result<CheckReport, Error> {
        let found = match Model::new(source, &[]).and_then(|model| model.check()) {
            Ok(found) | Err(Error::Model(found)) => found,
            Err(other) => return Err(other),
        };
        let errors = found.diagnostics.0.iter().filter(|d| d.is_error()).count();
        let warnings = found.diagnostics.0.len() - errors;
        Ok(CheckReport { found, errors, warnings })
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
