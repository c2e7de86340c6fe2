//! CSV files of earlier runs and measurements, with the units that they say.

use std::collections::BTreeMap;
use std::path::Path;

use halfarrow_compiler::unit::{Dimension, Unit};
use halfarrow_trace::{Column, InputColumn, InputError, InputTable, Trace, parse_inputs, read_inputs};

use crate::error::Problem;

/// A file that was read, its times in s.
pub(crate) struct ReadTable {
    /// Times, in s.
    pub times: Vec<f64>,
    /// The columns beside the time, by name.
    pub columns: BTreeMap<String, ReadColumn>,
}

/// A column as it stands in the file.
pub(crate) struct ReadColumn {
    /// Its numbers.
    pub values: Vec<f64>,
    /// Their unit, if the file says one.
    pub unit: Option<Unit>,
}

impl ReadTable {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, its lines have faults, or a unit is none.
    pub fn open(path: &Path) -> Result<ReadTable, Problem> {
        ReadTable::of(path, read_inputs(path))
    }

    /// Reads the text of a file. `path` is for messages.
    ///
    /// # Errors
    /// Its lines have faults, or a unit is none.
    pub fn parse(path: &Path, text: &str) -> Result<ReadTable, Problem> {
        ReadTable::of(path, parse_inputs(text))
    }

    fn of(path: &Path, table: Result<InputTable, Vec<InputError>>) -> Result<ReadTable, Problem> {
        let bad = |faults| Problem::BadInput { path: path.to_path_buf(), faults };
        let table = table.map_err(|e| bad(e.iter().map(ToString::to_string).collect()))?;
        let time = unit_of("t", table.time_unit.as_deref()).map_err(|fault| bad(vec![fault]))?;
        if let Some(unit) = time.as_ref().filter(|unit| unit.dimension != Dimension::SECOND) {
            return Err(bad(vec![format!(
                "line 2: the time is in {unit}: give it in a unit of time, such as s or ms"
            )]));
        }
        let (mut columns, mut faults, mut times) = (BTreeMap::new(), Vec::new(), Vec::new());
        for (name, InputColumn { signal, unit }) in table.columns {
            times = signal.times().iter().map(|&t| to_si(t, time.as_ref())).collect();
            match unit_of(&name, unit.as_deref()) {
                Ok(unit) => _ = columns.insert(name, ReadColumn { values: signal.values().to_vec(), unit }),
                Err(fault) => faults.push(fault),
            }
        }
        if faults.is_empty() { Ok(ReadTable { times, columns }) } else { Err(bad(faults)) }
    }
}

impl ReadColumn {
    /// The numbers in SI units. `declared`: the unit of what they are for; they are in it if the file says none.
    ///
    /// # Errors
    /// The file says a unit of something else.
    pub fn in_si(&self, name: &str, declared: Option<&Unit>) -> Result<Vec<f64>, String> {
        let unit = self.unit.as_ref().or(declared);
        if let (Some(own), Some(declared)) = (unit, declared)
            && own.dimension != declared.dimension
        {
            return Err(format!(
                "line 2: `{name}` is in {own} here and in {declared} in the model, which measures something else: give the \
                 column in {declared}, or in a multiple of it"
            ));
        }
        Ok(self.values.iter().map(|&value| to_si(value, unit)).collect())
    }
}

/// What an earlier run has written to a CSV file, to lie over `own`: columns of the same name are given in its units. The
/// columns are in the order of their names.
///
/// # Errors
/// The file cannot be read, or a column measures something else than that of the same name.
pub fn read_trace(path: &Path, own: &Trace) -> Result<Trace, Problem> {
    let bad = |faults| Problem::BadInput { path: path.to_path_buf(), faults };
    let table = ReadTable::open(path)?;
    let (mut columns, mut faults) = (Vec::new(), Vec::new());
    for (name, column) in table.columns {
        match like(&name, &column, own) {
            Ok((values, unit)) => columns.push(Column { name, unit, values }),
            Err(fault) => faults.push(fault),
        }
    }
    if faults.is_empty() { Ok(Trace { times: table.times, columns }) } else { Err(bad(faults)) }
}

/// The values of a column in the unit of that of the same name, and this unit.
fn like(name: &str, column: &ReadColumn, own: &Trace) -> Result<(Vec<f64>, String), String> {
    let own = own.columns.iter().find(|c| c.name == name).and_then(|c| Unit::parse(&c.unit).ok());
    let text = |unit: Option<&Unit>| unit.map(ToString::to_string).unwrap_or_default();
    match (&column.unit, own) {
        (Some(_), Some(own)) => {
            let si = column.in_si(name, Some(&own))?;
            Ok((si.into_iter().map(|value| own.from_si_f64(value)).collect(), text(Some(&own))))
        }
        (unit, _) => Ok((column.values.clone(), text(unit.as_ref()))),
    }
}

fn to_si(value: f64, unit: Option<&Unit>) -> f64 {
    unit.filter(|unit| !unit.is_si()).map_or(value, |unit| unit.to_si_f64(value))
}

fn unit_of(column: &str, text: Option<&str>) -> Result<Option<Unit>, String> {
    let unit = |text: &str| {
        Unit::parse(text).map_err(|_| format!("line 2: `{text}` of `{column}` is neither a number nor a unit"))
    };
    text.map(unit).transpose()
}
