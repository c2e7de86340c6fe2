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
use crate::sweep::{Reduce, Reduction};

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
        let system = (**system).clone();
        Ok(Gradient { without, ..self.model().gradient_with(system, &run, objective, progress)? })
    }
}

impl Reduce {
    /// The number itself as an objective of [`Model::gradient`]: what is recorded has to hold its variable.
    ///
    /// # Errors
    /// The variable is not recorded, or the number has no derivative by values at given times.
    pub fn objective(&self, trace: &Trace) -> Result<Weighed, Error> {
        let bad = |reason: String| Error::from(Problem::BadOption { reason });
        let Some(at) = trace.columns.iter().position(|c| c.name == self.variable) else {
            return Err(bad(format!("`{}` is not recorded", self.variable)));
        };
        let (times, values) = (&trace.times, &trace.columns[at].values);
        let mut weights = vec![vec![0.0; times.len()]; trace.columns.len()];
        let mut by_time = vec![0.0; times.len()];
        let own = &mut weights[at];
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            return Err(bad("nothing was recorded".into()));
        };
        let place = |better: &dyn Fn(f64, f64) -> bool| {
            (0..values.len()).fold(0, |best, i| if better(values[i], values[best]) { i } else { best })
        };
        let at_one = |own: &mut Vec<f64>, i: usize, slope: f64| {
            own[i] = slope;
            slope * values[i]
        };
        let length = last - first;
        let value = match self.reduction {
            Reduction::Initial => at_one(own, 0, 1.0),
            Reduction::Final => at_one(own, values.len() - 1, 1.0),
            Reduction::Min => at_one(own, place(&|a, b| a < b), 1.0),
            Reduction::Max => at_one(own, place(&|a, b| a > b), 1.0),
            Reduction::MaxAbs => {
                let i = place(&|a, b| a.abs() > b.abs());
                at_one(own, i, if values[i] < 0.0 { -1.0 } else { 1.0 })
            }
            Reduction::Mean => {
                let mut mean = 0.0;
                for (i, t) in times.windows(2).enumerate() {
                    let part = 0.5 * (t[1] - t[0]) / length;
                    mean += part * (values[i] + values[i + 1]);
                    let slope = 0.5 * (values[i] + values[i + 1]) / length;
                    by_time[i] -= slope;
                    by_time[i + 1] += slope;
                    own[i] += part;
                    own[i + 1] += part;
                }
                mean
            }
            Reduction::Rms => {
                let mut square = 0.0;
                for (i, t) in times.windows(2).enumerate() {
                    let (part, [a, b]) = ((t[1] - t[0]) / (3.0 * length), [values[i], values[i + 1]]);
                    square += part * (a * a + a * b + b * b);
                    let slope = (a * a + a * b + b * b) / (3.0 * length);
                    by_time[i] -= slope;
                    by_time[i + 1] += slope;
                    own[i] += part * (2.0 * a + b);
                    own[i + 1] += part * (2.0 * b + a);
                }
                let rms = square.sqrt();
                let half = if rms > 0.0 { 0.5 / rms } else { 0.0 };
                own.iter_mut().chain(&mut by_time).for_each(|w| *w *= half);
                rms
            }
            Reduction::TimeOfMax => {
                let reason = "time_of_max has no derivative: it is one of the times at which the run is recorded";
                return Err(bad(reason.into()));
            }
        };
        Ok(Weighed { value, samples: weights, times: Some(by_time) })
    }
}
