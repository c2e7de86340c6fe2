//! Measurements: what stands in the files of a fit.

use crate::compiled::Compiled;
use crate::error::{Error, Problem};
use crate::input::Input;
use crate::table_file::{ReadColumn, ReadTable};

use super::{Fit, Sigma};
use halfarrow_compiler::unit::Unit;

/// A run that was measured.
#[derive(Debug, Clone)]
pub(super) struct Measured {
    /// The file.
    pub name: String,
    /// Times, in s, up to the end of the run.
    pub times: Vec<f64>,
    /// Measurements, output by output, in the units of results; NaN where there is none.
    pub values: Vec<Vec<f64>>,
    /// Their standard deviations.
    pub sigma: Vec<Vec<f64>>,
    /// Inputs that are columns of the file.
    pub inputs: Vec<(String, Input)>,
}

/// All of them, with whether their standard deviations are given. Where they are not, those of an output are its spread in all
/// runs, so that outputs of different units count alike.
pub(super) fn all(fit: &Fit, compiled: &Compiled) -> Result<(Vec<Measured>, bool), Error> {
    let bad = |reason: String| Error::from(Problem::BadOption { reason });
    let unknown = fit.sigma.iter().find(|(name, _)| !fit.outputs.iter().any(|(output, _)| output == name));
    if let Some((name, _)) = unknown {
        let compared: Vec<&str> = fit.outputs.iter().map(|(output, _)| output.as_str()).collect();
        let compared = compared.join(", ");
        return Err(bad(format!(
            "a standard deviation is given for `{name}`, which is not compared: there is {compared}"
        )));
    }
    let given = |name: &str| fit.sigma.iter().any(|s| s.0 == name);
    let known = fit.outputs.iter().all(|(name, _)| given(name));
    if !known && !fit.sigma.is_empty() {
        let reason = "standard deviations are given for some outputs only: give them for all, or for none";
        return Err(bad(reason.into()));
    }
    let mut runs = fit.data.iter().map(|path| one(fit, compiled, path)).collect::<Result<Vec<_>, _>>()?;
    if !known {
        for k in 0..fit.outputs.len() {
            let all: Vec<f64> = runs.iter().flat_map(|run| &run.values[k]).copied().filter(|v| v.is_finite()).collect();
            let spread = spread(&all);
            runs.iter_mut().for_each(|run| run.sigma[k].fill(spread));
        }
    }
    let measured = |run: &Measured| {
        let pairs = run.values.iter().flatten().zip(run.sigma.iter().flatten());
        pairs.filter(|(value, _)| value.is_finite()).all(|(_, s)| s.is_finite() && *s > 0.0)
    };
    match runs.iter().all(measured) {
        true => Ok((runs, known)),
        false => Err(bad("standard deviations have to be finite and above 0".into())),
    }
}

fn spread(known: &[f64]) -> f64 {
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    let square = known.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / known.len() as f64;
    if square > 0.0 { square.sqrt() } else { 1.0 }
}

fn one(fit: &Fit, compiled: &Compiled, path: &std::path::Path) -> Result<Measured, Error> {
    let table = ReadTable::open(path)?;
    let fault = |fault: String| Error::from(Problem::BadInput { path: path.to_path_buf(), faults: vec![fault] });
    let mut last = f64::NEG_INFINITY;
    if table.times.iter().any(|&t| std::mem::replace(&mut last, t) >= t || t < 0.0) {
        return Err(fault("times have to ascend from 0 on, each of them once".into()));
    }
    let count = table.times.iter().take_while(|t| **t <= fit.run.to).count();
    if count == 0 {
        return Err(fault("nothing was measured before the end of the run".into()));
    }
    let column = |name: &str| {
        table.columns.get(name).ok_or_else(|| {
            let known: Vec<&str> = table.columns.keys().map(String::as_str).collect();
            fault(format!("there is no column `{name}`; there are {}", known.join(", ")))
        })
    };
    let program = compiled.minimal().program();
    let (mut values, mut sigma, mut inputs) = (Vec::new(), Vec::new(), Vec::new());
    for (name, of) in &fit.outputs {
        let unit = program.observed.iter().find(|o| *o.name == **name).and_then(|o| o.unit.as_ref());
        values.push(in_unit(column(of)?, of, unit).map_err(fault)?[..count].to_vec());
        let step = |unit: &Unit| unit.from_si_f64(1.0) - unit.from_si_f64(0.0);
        sigma.push(match fit.sigma.iter().find(|s| s.0 == *name).map(|s| &s.1) {
            None => vec![1.0; count],
            Some(Sigma::Number(number)) => vec![*number; count],
            Some(Sigma::Column(of)) => {
                let found = column(of)?;
                // A deviation is a difference: where units begin does not count.
                let factor = match (&found.unit, unit) {
                    (Some(own), Some(unit)) if own.dimension == unit.dimension => step(unit) / step(own),
                    (Some(own), Some(unit)) => {
                        return Err(fault(format!("`{of}` is in {own}, but what it is the deviation of is in {unit}")));
                    }
                    _ => 1.0,
                };
                found.values[..count].iter().map(|value| factor * value).collect()
            }
        });
    }
    for (name, of) in &fit.columns {
        let unit = program.inputs.iter().find(|input| input.name == *name).and_then(|input| input.unit.as_ref());
        let values = in_unit(column(of)?, of, unit).map_err(fault)?;
        inputs.push((name.clone(), Input::Series { times: table.times.clone(), values }));
    }
    let times = table.times[..count].to_vec();
    let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    Ok(Measured { name, times, values, sigma, inputs })
}

/// The numbers of a column in a unit.
fn in_unit(found: &ReadColumn, name: &str, unit: Option<&Unit>) -> Result<Vec<f64>, String> {
    Ok(match (&found.unit, unit) {
        (Some(_), Some(unit)) => {
            let si = found.in_si(name, Some(unit))?;
            si.into_iter().map(|value| if unit.is_si() { value } else { unit.from_si_f64(value) }).collect()
        }
        _ => found.values.clone(),
    })
}
