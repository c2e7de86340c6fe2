//! Gradients: the derivatives of one number that a run comes to by many parameters, from the run followed backwards.

use halfarrow_compiler::unit::Unit;
use halfarrow_exec as exec;
use halfarrow_sim::{Method, Options, Summary};
use halfarrow_trace::Trace;
use serde::Serialize;

use crate::compiled::{Compiled, Ready};
use crate::error::{Error, Problem};
use crate::model::Model;
use crate::pieces::{Quartic, STEP, WEIGHTS, pieces};
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

/// How fast a variable moves at both ends of a step of this length, by its samples.
fn slopes_at_ends(values: &[f64], h: f64) -> [f64; 2] {
    let quartic = Quartic::through(std::array::from_fn(|k| values[k]));
    [-1.0, 1.0].map(|u| quartic.slope(u) * 2.0 / h)
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
        // The turn inside of a step that goes beyond all samples, told by those of its step: its place is at rest, whatever
        // moves the ends.
        let turn = |own: &mut Vec<f64>, by_time: &mut Vec<f64>, sign: f64| {
            let most = values.iter().map(|v| sign * v).fold(f64::NEG_INFINITY, f64::max);
            let steps = pieces(times).filter(|piece| piece.len() == STEP);
            let turns = steps.filter_map(|piece| {
                let samples: [f64; STEP] = std::array::from_fn(|k| values[piece.start + k]);
                let (u, value) = Quartic::through(samples).beyond(samples, sign)?;
                (sign * value > most).then_some((piece, u, value))
            });
            let (piece, u, value) = turns.max_by(|a, b| (sign * a.2).total_cmp(&(sign * b.2)))?;
            let (first, last) = (piece.start, piece.end - 1);
            let slopes = slopes_at_ends(&values[piece], times[last] - times[first]);
            let counts = Quartic::counts(u);
            counts.iter().enumerate().for_each(|(k, count)| own[first + k] = *count);
            by_time[first] = -counts[0] * slopes[0];
            by_time[last] = -counts[STEP - 1] * slopes[1];
            Some(value)
        };
        let value = match self.reduction {
            Reduction::Initial => at_one(own, 0, 1.0),
            Reduction::Final => at_one(own, values.len() - 1, 1.0),
            Reduction::Min => {
                let i = place(&|a, b| a < b);
                turn(own, &mut by_time, -1.0).unwrap_or_else(|| at_one(own, i, 1.0))
            }
            Reduction::Max => {
                let i = place(&|a, b| a > b);
                turn(own, &mut by_time, 1.0).unwrap_or_else(|| at_one(own, i, 1.0))
            }
            Reduction::MaxAbs => {
                let i = place(&|a, b| a.abs() > b.abs());
                let turned = if values[i] < 0.0 { -1.0 } else { 1.0 };
                match turn(own, &mut by_time, turned) {
                    Some(value) => {
                        own.iter_mut().chain(&mut by_time).for_each(|w| *w *= turned);
                        turned * value
                    }
                    None => at_one(own, i, turned),
                }
            }
            Reduction::Mean => {
                let mut mean = 0.0;
                for piece in pieces(times) {
                    let (first, last) = (piece.start, piece.end - 1);
                    let h = times[last] - times[first];
                    if piece.len() == STEP {
                        // What is beyond the end of a step does not count, nor how its end moves along the curve.
                        let slopes = slopes_at_ends(&values[piece.clone()], h);
                        for (i, weight) in piece.zip(WEIGHTS) {
                            mean += h * weight * values[i] / length;
                            own[i] += h * weight / length;
                        }
                        by_time[first] -= (values[first] + h * WEIGHTS[0] * slopes[0]) / length;
                        by_time[last] += (values[last] - h * WEIGHTS[0] * slopes[1]) / length;
                        continue;
                    }
                    let part = 0.5 * h / length;
                    mean += part * (values[first] + values[last]);
                    let slope = 0.5 * (values[first] + values[last]) / length;
                    by_time[first] -= slope;
                    by_time[last] += slope;
                    own[first] += part;
                    own[last] += part;
                }
                mean
            }
            Reduction::Rms => {
                let mut square = 0.0;
                for piece in pieces(times) {
                    let (first, last) = (piece.start, piece.end - 1);
                    let (h, [a, b]) = (times[last] - times[first], [values[first], values[last]]);
                    if piece.len() == STEP {
                        let slopes = slopes_at_ends(&values[piece.clone()], h);
                        for (i, weight) in piece.zip(WEIGHTS) {
                            square += h * weight * values[i] * values[i] / length;
                            own[i] += 2.0 * h * weight * values[i] / length;
                        }
                        by_time[first] -= (a * a + 2.0 * h * WEIGHTS[0] * a * slopes[0]) / length;
                        by_time[last] += (b * b - 2.0 * h * WEIGHTS[0] * b * slopes[1]) / length;
                        continue;
                    }
                    let part = h / (3.0 * length);
                    square += part * (a * a + a * b + b * b);
                    let slope = (a * a + a * b + b * b) / (3.0 * length);
                    by_time[first] -= slope;
                    by_time[last] += slope;
                    own[first] += part * (2.0 * a + b);
                    own[last] += part * (2.0 * b + a);
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
