//! Whether all values of a model fit its real numbers.

use super::Export;
use crate::{EmitError, Real};

/// Sees that parameters, what follows from them, numbers of the equations and of tables are held with all digits, and that
/// the start is finite.
///
/// # Errors
/// The first value that does not fit.
pub(super) fn check(export: &Export) -> Result<(), EmitError> {
    let (program, start) = (export.program, export.start);
    let fits = |what: &dyn Fn() -> String, value: f64| match export.real.holds(value) {
        true => Ok(()),
        false => Err(EmitError::Range(what(), value)),
    };
    for (parameter, &value) in program.parameters.iter().zip(&start.parameters) {
        fits(&|| format!("the parameter {}", parameter.name), value)?;
    }
    for value in program.determined(&[]).into_iter().filter_map(|v| program.values.constant(v)) {
        fits(&|| "a number of the equations".into(), value)?;
    }
    for &value in &start.derived {
        fits(&|| "what follows from parameters in the equations".into(), value)?;
    }
    for table in &program.tables {
        for &value in table.x().iter().chain(table.y()).chain(table.pieces().iter().flatten()) {
            fits(&|| "a number of a table".into(), value)?;
        }
    }
    // What is next to nothing at the start may be rounding.
    let finite = |value: f64| export.real == Real::Double || value.abs() < 1.0 || export.real.holds(value);
    let inputs = program.inputs.iter().map(|i| i.name.clone()).zip(&start.inputs);
    let states = program.states.iter().map(|s| s.name.clone()).zip(&start.states);
    match inputs.chain(states).find(|(_, value)| !finite(**value)) {
        Some((name, &value)) => Err(EmitError::Range(format!("{name} at the start"), value)),
        None => Ok(()),
    }
}
