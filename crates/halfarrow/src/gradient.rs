//! Gradients: the derivatives of one number that a run comes to by many parameters, from the run followed backwards.

use halfarrow_compiler::unit::Unit;
use halfarrow_exec as exec;
use halfarrow_sim::{Method, Options, Summary};
use halfarrow_trace::Trace;
use serde::Serialize;

use crate::compiled::{Compiled, Ready};
use crate::error::{Error, Problem};
use crate::model::Model;
use crate::run::{Progress, Run, Simulated, units};
use crate::sensitivity::By;

/// The number that is differentiated, told the run.
pub type Objective<'a> = dyn FnMut(&Trace) -> Result<Weighed, Error> + 'a;

/// A number that a run comes to, with its derivatives by what was recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighed {
    /// The number.
    pub value: f64,
    /// Its derivatives by each column at each sample, in the units of the columns.
    pub samples: Vec<Vec<f64>>,
    /// Its derivatives by the time of each sample, in 1/s: samples that events are taken at move with these. `None` if the number
    /// is one of samples at times that stand still.
    pub times: Option<Vec<f64>>,
}

/// What a gradient comes to.
#[derive(Debug, Clone, PartialEq)]
pub struct Gradient {
    /// The number.
    pub value: f64,
    /// Its derivatives, in the order of [`Run::sensitivities`] where there are any, else by all parameters that have one.
    pub slopes: Vec<Slope>,
    /// Parameters by which there is no derivative, and why; of those that were not named.
    pub without: Vec<(String, String)>,
    /// The run itself.
    pub run: Simulated,
}

/// A derivative.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Slope {
    /// The parameter, start value or input.
    pub name: String,
    /// Its SI unit; empty where it has none, or none is known.
    pub unit: String,
    /// Its present value, in SI units; `None` of a start value.
    pub at: Option<f64>,
    /// The derivative by it.
    pub slope: f64,
}

/// What a run leaves for the way back.
pub(crate) struct Taped {
    pub tape: exec::Tape,
    /// The first of the recorded values that were asked for.
    pub first: usize,
    pub stiff: bool,
}

impl Model {
    /// The derivatives of a number that a run comes to, by parameters, start values and constant inputs: exact ones, at the
    /// cost of a few runs however many they are. Every step of the run is kept meanwhile. A run by a method of fixed step is
    /// followed back step by step; otherwise the way back is as exact as the run.
    ///
    /// # Errors
    /// As [`simulate`](Model::simulate); something has no derivative; the objective says so.
    pub fn gradient(
        &self,
        run: &Run,
        objective: &mut Objective<'_>,
        progress: &mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Result<Gradient, Error> {
        self.compile(run.form)?.gradient(run, objective, progress)
    }

    fn gradient_with(
        &self,
        mut system: exec::Model,
        run: &Run,
        objective: &mut Objective<'_>,
        progress: &mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Result<Gradient, Error> {
        // Samples at given times stand still.
        let moves = run.every.is_none() && run.at.is_empty();
        let (by, options, run, taped) = self.run_taped(&mut system, run, progress)?;
        let Weighed { value, samples: weights, times } = objective(&run.trace)?;
        let samples = taped.tape.samples();
        let shape = || (weights.len(), weights.iter().map(Vec::len).find(|&length| length != samples));
        let columns = run.trace.columns.len();
        if shape() != (columns, None) {
            let reason = format!(
                "the derivatives by what was recorded have to be {columns} columns of {samples} samples, not {} of {}",
                weights.len(),
                weights.first().map_or(0, Vec::len)
            );
            return Err(Problem::BadOption { reason }.into());
        }
        if let Some((at, _)) = weights.iter().enumerate().find(|(_, w)| w.iter().any(|w| !w.is_finite())) {
            let reason = format!("the derivative by {} is not a finite number everywhere", run.trace.columns[at].name);
            return Err(Problem::BadOption { reason }.into());
        }
        // From declared units to SI units.
        let factors: Vec<f64> =
            units(&system)[taped.first..].iter().map(|unit| unit.as_ref().map_or(1.0, step)).collect();
        let rows: Vec<f64> = (0..samples)
            .flat_map(|k| weights.iter().zip(&factors).map(move |(column, factor)| column[k] * factor))
            .collect();
        let method = (options.method, taped.stiff);
        let times = times.filter(|times| moves && times.len() == samples).unwrap_or_default();
        let weights = exec::SampleWeights { first: taped.first, values: &rows, times: &times };
        let slopes = taped.tape.gradient(&mut system, &weights, method, options.rtol);
        let slopes = slopes.map_err(|failure| self.stopped(failure))?;
        let slope = |(by, slope): (&By, f64)| Slope {
            name: by.name.clone(),
            unit: by.unit.clone(),
            at: match by.quantity {
                exec::Quantity::Parameter(_) | exec::Quantity::Input(_) => system.value_of(by.quantity),
                _ => None,
            },
            slope,
        };
        let slopes = by.iter().zip(slopes).map(slope).collect();
        Ok(Gradient { value, slopes, without: Vec::new(), run })
    }
}

/// Why no parameter can be differentiated by.
fn nothing_to_vary(without: &[(String, String)]) -> String {
    let why = match without {
        [] => "the model has no parameter that may change".to_string(),
        [(_, why), ..] if without.iter().all(|other| other.1 == *why) => why.clone(),
        several => {
            let each: Vec<String> = several.iter().map(|(name, why)| format!("`{name}`: {why}")).collect();
            each.join("; ")
        }
    };
    format!(
        "there is nothing to take a derivative by: {why}; --sensitivity names start values and constant inputs, too"
    )
}

/// How a value in a unit moves with that in SI units.
fn step(unit: &Unit) -> f64 {
    unit.from_si_f64(1.0) - unit.from_si_f64(0.0)
}

/// Whether the way back has no rates to build on: those of stiff systems are less exact than the states.
pub(crate) fn is_stiff(options: &Options, summary: &Summary) -> bool {
    summary.stiff || matches!(options.method, Method::Bdf | Method::Radau)
}

impl Compiled {
    /// As [`Model::gradient`].
    ///
    /// # Errors
    /// As there.
    pub fn gradient(
        &self,
        run: &Run,
        objective: &mut Objective<'_>,
        progress: &mut dyn FnMut(Progress<'_>) -> bool,
    ) -> Result<Gradient, Error> {
        let Ready::Explicit(system) = &self.ready else {
            let reason = format!("gradients are those of the form minimal, not {}", self.form().name());
            return Err(Problem::BadOption { reason }.into());
        };
        let (mut run, mut without) = (run.clone(), Vec::new());
        if run.sensitivities.is_empty() {
            let mut trial = (**system).clone();
            for (index, parameter) in system.program().parameters.iter().enumerate() {
                if parameter.constant || parameter.shapes {
                    continue;
                }
                match trial.vary(&[exec::Quantity::Parameter(index)], std::slice::from_ref(&parameter.name)) {
                    Ok(()) => run.sensitivities.push(parameter.name.clone()),
                    Err(why) => without.push((parameter.name.clone(), why)),
                }
            }
        }
        if run.sensitivities.is_empty() {
            return Err(Problem::BadOption { reason: nothing_to_vary(&without) }.into());
        }
        let system = (**system).clone();
        Ok(Gradient { without, ..self.model().gradient_with(system, &run, objective, progress)? })
    }
}
