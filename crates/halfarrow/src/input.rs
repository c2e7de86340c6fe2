//! What drives a model: its inputs over time.

use std::path::{Path, PathBuf};

use halfarrow_compiler::program;
use halfarrow_compiler::unit::Unit;
use halfarrow_exec as exec;

use crate::error::Problem;
use crate::table_file::ReadTable;

/// An input over time, from the start of a run. Before its first value it has that, after its last one the last.
///
/// Values without a unit are in that of the input's declaration.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// A CSV file: a column `t`, and one called as the input or nothing else. Straight between its rows; a time that stands
    /// twice is a jump.
    File(PathBuf),
    /// The text of such a file.
    Csv(String),
    /// Values at these times in s, straight between them; a time that stands twice is a jump.
    Series {
        /// Times, never decreasing.
        times: Vec<f64>,
        /// A value for each.
        values: Vec<f64>,
    },
    /// The same value all the time.
    Constant(f64),
}

impl Input {
    /// A function of time in s, sampled from 0 to `to` at equal distances of about `every` and straight between.
    ///
    /// ```
    /// use halfarrow::Input;
    /// let ramp = Input::sampled(1.0, 0.5, |t| 2.0 * t);
    /// assert_eq!(ramp, Input::Series { times: vec![0.0, 0.5, 1.0], values: vec![0.0, 1.0, 2.0] });
    /// ```
    pub fn sampled(to: f64, every: f64, function: impl FnMut(f64) -> f64) -> Input {
        let parts = (to / every).round().max(1.0);
        let times: Vec<f64> = (0..=parts as usize).map(|i| i as f64 * to / parts).collect();
        Input::Series { values: times.iter().copied().map(function).collect(), times }
    }

    /// Times in s and values in SI units. `declared`: the unit of the input.
    fn points(&self, name: &str, declared: Option<&Unit>) -> Result<(Vec<f64>, Vec<f64>), Problem> {
        let own = declared.filter(|unit| !unit.is_si());
        let si = |value: &f64| own.map_or(*value, |unit| unit.to_si_f64(*value));
        match self {
            Input::File(path) => column(ReadTable::open(path)?, path, name, declared),
            Input::Csv(text) => {
                let place = given(name);
                column(ReadTable::parse(&place, text)?, &place, name, declared)
            }
            Input::Series { times, values } => Ok((times.clone(), values.iter().map(si).collect())),
            Input::Constant(value) => Ok((vec![0.0], vec![si(value)])),
        }
    }

    /// The file that is meant where something is wrong with it.
    fn place(&self, name: &str) -> PathBuf {
        match self {
            Input::File(path) => path.clone(),
            _ => given(name),
        }
    }
}

impl<P: Into<PathBuf>> From<P> for Input {
    fn from(path: P) -> Input {
        Input::File(path.into())
    }
}

/// What stands for a file where there is none.
fn given(name: &str) -> PathBuf {
    format!("what is given for `{name}`").into()
}

/// The column of an input in a table.
fn column(
    mut table: ReadTable,
    path: &Path,
    name: &str,
    declared: Option<&Unit>,
) -> Result<(Vec<f64>, Vec<f64>), Problem> {
    let bad = |faults| Problem::BadInput { path: path.to_path_buf(), faults };
    let columns: Vec<String> = table.columns.keys().cloned().collect();
    let found = if columns.len() == 1 { &columns[0] } else { name };
    let missing = || bad(vec![format!("no column is called `{name}`: there are {}", columns.join(", "))]);
    let column = table.columns.remove(found).ok_or_else(missing)?;
    let values = column.in_si(found, declared).map_err(|fault| bad(vec![fault]))?;
    Ok((table.times, values))
}

/// Connects what is given to the inputs of a model.
pub(crate) fn connect(
    inputs: &[program::Input],
    given: &[(String, Input)],
    mut put: impl FnMut(&str, &[f64], &[f64]) -> Result<(), exec::InputError>,
) -> Result<(), Problem> {
    for (name, input) in given {
        let Some(declared) = inputs.iter().find(|i| i.name == *name) else {
            let known = inputs.iter().map(|i| i.name.clone()).collect();
            return Err(Problem::UnknownInput { name: name.clone(), known });
        };
        let (times, values) = input.points(name, declared.unit.as_ref().or(declared.deduced.as_ref()))?;
        let bad = |e: exec::InputError| Problem::BadInput { path: input.place(name), faults: vec![e.to_string()] };
        put(name, &times, &values).map_err(bad)?;
    }
    Ok(())
}
