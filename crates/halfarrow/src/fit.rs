//! Parameters from measurements: least squares by the method of Levenberg and Marquardt, with exact derivatives.

mod loss;
mod measured;
mod profile;
mod range;
mod search;

pub use loss::Loss;
pub use profile::Profile;

use std::path::PathBuf;

use faer::Mat;
use halfarrow_compiler::bond_graph::BondGraph;
use halfarrow_compiler::equations::Form;
use halfarrow_trace::{Column, Trace};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF as _, Normal, StudentsT};

use crate::error::{Error, Problem};
use crate::model::Model;
use crate::run::{Record, Run};
use measured::Measured;
use range::Range;
use search::Task;

/// Directions in which residuals change by less than this part of the greatest change are told by the errors of runs alone.
const RANK: f64 = 1e-6;
/// A share of a parameter in such a direction below which it takes no part.
const SHARE: f64 = 1e-3;
/// A parameter below this part of its first guess, or of the distance of its bounds, counts as that.
const NEAR_ZERO: f64 = 1e-2;
/// Intervals hold the true value this often.
const LEVEL: f64 = 0.95;

/// What to fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The run; its end is the last time of the data unless it is sooner. In the form `minimal`.
    pub run: Run,
    /// CSV files with a column `t` and those that are compared: a run for each, all with the same parameters.
    pub data: Vec<PathBuf>,
    /// Inputs that are columns of these files.
    pub columns: Vec<(String, String)>,
    /// Variables with the columns that are measurements of them.
    pub outputs: Vec<(String, String)>,
    /// Standard deviations of the measurements of variables, in their units: of all or of none, then they are estimated.
    pub sigma: Vec<(String, Sigma)>,
    /// What is fitted.
    pub parameters: Vec<FitParameter>,
    /// Relative change of parameters and sum of squares at which the search ends.
    pub tolerance: f64,
    /// How many searches are made, from different values.
    pub starts: usize,
    /// What large residuals count, and from how many standard deviations on.
    pub loss: (Loss, f64),
    /// Parameters whose profile is wanted.
    pub profiles: Vec<String>,
}

impl Default for Fit {
    /// Of nothing, to 1e-10, by one search for the least sum of squares.
    fn default() -> Fit {
        Fit {
            run: Run { to: f64::INFINITY, rtol: 1e-8, ..Run::default() },
            data: Vec::new(),
            columns: Vec::new(),
            outputs: Vec::new(),
            sigma: Vec::new(),
            parameters: Vec::new(),
            tolerance: 1e-10,
            starts: 1,
            loss: (Loss::Linear, 1.0),
            profiles: Vec::new(),
        }
    }
}

/// A standard deviation.
#[derive(Debug, Clone, PartialEq)]
pub enum Sigma {
    /// The same for all measurements.
    Number(f64),
    /// A column of the data.
    Column(String),
}

/// A parameter to fit; the search begins at its value in the model, or between its bounds. The start value of a variable is
/// one too: `spring.q(0)`.
#[derive(Debug, Clone, PartialEq)]
pub struct FitParameter {
    /// Its name.
    pub name: String,
    /// Its bounds, as text with or without units.
    pub bounds: Option<(String, String)>,
}

impl FitParameter {
    /// Of a text such as `ks`, or `ks=5 kN/m:50 kN/m`.
    ///
    /// # Errors
    /// It is neither.
    pub fn parse(text: &str) -> Result<FitParameter, Problem> {
        let Some((name, range)) = text.split_once('=') else {
            return Ok(FitParameter { name: text.trim().to_string(), bounds: None });
        };
        let Some((low, high)) = range.split_once(':') else {
            let reason =
                format!("`{text}` gives no bounds: write `{name}` alone, or `{name}=5e3:50e3`", name = name.trim());
            return Err(Problem::BadOption { reason });
        };
        let bounds = Some((low.trim().to_string(), high.trim().to_string()));
        Ok(FitParameter { name: name.trim().to_string(), bounds })
    }
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FitReport {
    /// Name of the model.
    pub model: String,
    /// The parameters.
    pub parameters: Vec<Estimate>,
    /// Their correlations, row by row; `null` where the data do not tell.
    pub correlations: Vec<Vec<Option<f64>>>,
    /// Sum of squares of what is left over, in standard deviations.
    pub cost: f64,
    /// Measurements, and how many they are more than what was found.
    pub measurements: usize,
    /// Degrees of freedom.
    pub freedom: usize,
    /// Variance of a residual: 1 where standard deviations are given for all outputs, else estimated.
    pub variance: f64,
    /// How many combinations of parameters the data tell.
    pub rank: usize,
    /// Combinations that they do not tell: relative changes of parameters that change no output together.
    pub unidentified: Vec<Vec<(String, f64)>>,
    /// Runs of the model, and those of them with derivatives.
    pub evaluations: usize,
    /// Runs with derivatives.
    pub jacobians: usize,
    /// Whether the search came to an end by itself.
    pub success: bool,
    /// Why it ended.
    pub ended: String,
    /// Of each search where it began, where it ended and what it came to there; `null` where the model does not run.
    pub starts: Vec<Beginning>,
    /// The profiles that were asked for.
    pub profiles: Vec<Profile>,
    /// Measurements, the fitted model and what is left over, of each run.
    #[serde(skip)]
    pub runs: Vec<FittedRun>,
}

/// A search.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Beginning {
    /// Values of the parameters where it began, in SI units.
    pub begin: Vec<f64>,
    /// Where it ended.
    pub end: Option<Vec<f64>>,
    /// The sum there.
    pub cost: Option<f64>,
}

/// A run that was measured, beside the fitted model.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedRun {
    /// The file.
    pub name: String,
    /// The measurements, and as `travel: residual` what is left over in standard deviations.
    pub measured: Trace,
    /// The fitted model.
    pub fitted: Trace,
}

/// A parameter that was fitted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// Its name.
    pub name: String,
    /// Its value, in SI units.
    pub value: f64,
    /// Its standard error; `null` where the data do not tell it.
    pub error: Option<f64>,
    /// A confidence interval of 95 % by it; `null` with it.
    pub interval: Option<(f64, f64)>,
    /// SI unit, where known.
    pub unit: Option<String>,
    /// Whether it lies at a bound.
    pub at_bound: bool,
}

impl Model {
    /// The same model with start values of these variables as parameters, called `spring.q(0)`.
    ///
    /// # Errors
    /// A variable begins with no value.
    pub fn with_starts(&self, variables: &[&str]) -> Result<Model, Problem> {
        let mut graph = BondGraph::clone(&self.graph);
        for variable in variables {
            graph.make_start_parameter(variable).map_err(|reason| Problem::BadOption { reason })?;
        }
        Ok(self.with_graph(graph))
    }

    /// Fits parameters to measurements. `progress` is told how many runs were made, and says whether to go on.
    ///
    /// # Errors
    /// The data do not fit, something is asked that cannot be, or the model does not run where the search begins.
    pub fn fit(&self, fit: &Fit, progress: &mut dyn FnMut(usize) -> bool) -> Result<FitReport, Error> {
        let bad = |reason: String| Error::from(Problem::BadOption { reason });
        if fit.parameters.is_empty() || fit.outputs.is_empty() {
            return Err(bad("name what is fitted, and what is compared".into()));
        }
        if fit.run.form != Form::Minimal {
            return Err(bad("a fit is one of the form minimal".into()));
        }
        let starts: Vec<&str> = fit.parameters.iter().filter_map(|p| p.name.strip_suffix("(0)")).collect();
        let compiled = self.with_starts(&starts)?.compile(Form::Minimal)?;
        if !(fit.loss.1.is_finite() && fit.loss.1 > 0.0) {
            return Err(bad(format!("the scale of the loss is {}: it has to be a finite number above 0", fit.loss.1)));
        }
        if fit.data.is_empty() || fit.starts == 0 {
            return Err(bad("there is nothing to compare with, or no search".into()));
        }
        let (measured, known) = measured::all(fit, &compiled)?;
        let (ranges, guesses) = range::ranges(fit, &compiled)?;
        let record = Record::Names(fit.outputs.iter().map(|(name, _)| name.clone()).collect());
        let run = |measured: Measured| {
            let to = *measured.times.last().expect("there are measurements");
            let inputs = fit.run.inputs.iter().cloned().chain(measured.inputs.clone()).collect();
            (Run { to, at: measured.times.clone(), record: record.clone(), inputs, ..fit.run.clone() }, measured)
        };
        let task = Task {
            compiled: &compiled,
            runs: measured.into_iter().map(run).collect(),
            names: fit.parameters.iter().map(|p| p.name.clone()).collect(),
            ranges,
            loss: fit.loss,
            tolerance: fit.tolerance,
            evaluations: std::cell::Cell::new(0),
            jacobians: std::cell::Cell::new(0),
            progress: std::cell::RefCell::new(progress),
        };
        let profiled = |name: &String| task.names.iter().position(|own| own == name);
        if let Some(name) = fit.profiles.iter().find(|name| profiled(name).is_none()) {
            return Err(bad(format!("a profile of `{name}` is asked for, which is not fitted")));
        }
        let all: Vec<usize> = (0..task.names.len()).collect();
        let (mut best, mut starts, mut why) = (None::<(f64, Ended)>, Vec::new(), None);
        for begin in range::beginnings(&task.ranges, &guesses, fit.starts) {
            // Where a search begins the model has to run; of the first one that does not, why is told.
            if let Err(error) = task.columns(&begin, &all) {
                why = why.or(Some(error));
                starts.push(Beginning { begin, end: None, cost: None });
                continue;
            }
            let found = task.search(&begin, &all);
            let cost = task.cost(&task.residuals(&task.columns(&found.0, &[])?));
            starts.push(Beginning { begin, end: Some(found.0.clone()), cost: Some(cost) });
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, found));
            }
        }
        let (cost, found) = match (best, why) {
            (Some(best), _) => best,
            (None, Some(why)) => return Err(why),
            (None, None) => unreachable!("there is a first search"),
        };
        let mut report = self.judge(&task, (cost, &found), known)?;
        report.starts = starts;
        for name in &fit.profiles {
            let at = profiled(name).expect("looked for above");
            report.profiles.push(profile::profile(&task, &report, at, (known, LEVEL))?);
        }
        (report.evaluations, report.jacobians) = (task.evaluations.get(), task.jacobians.get());
        Ok(report)
    }

    /// What the data tell at the end of a search.
    fn judge(
        &self,
        task: &Task<'_>,
        (cost, (values, success, ended)): (f64, &Ended),
        known: bool,
    ) -> Result<FitReport, Error> {
        let all: Vec<usize> = (0..values.len()).collect();
        let columns = task.columns(values, &all)?;
        let (residuals, mut slopes) = (task.residuals(&columns), task.slopes(&columns, values.len()));
        let n = values.len();
        let weights: Vec<f64> = residuals.iter().map(|&r| task.loss.0.weight(r, task.loss.1)).collect();
        slopes.iter_mut().for_each(|column| column.iter_mut().zip(&weights).for_each(|(slope, w)| *slope *= w));
        // What is near zero counts as a part of where it was sought.
        let size = |j: usize| {
            let sought = match task.ranges[j] {
                Range::Free { scale } => scale,
                Range::Between { low, high } => high - low,
            };
            values[j].abs().max(NEAR_ZERO * sought)
        };
        let weighed = Mat::from_fn(residuals.len(), n, |i, j| slopes[j][i] * size(j));
        let bad = || Problem::BadOption { reason: "the derivatives at the end of the search are not finite".into() };
        let svd = weighed.thin_svd().map_err(|_| bad())?;
        let (sizes, ways) = (svd.S().column_vector(), svd.V());
        let most = sizes.iter().fold(0.0f64, |most, s| most.max(*s));
        let (told, untold): (Vec<usize>, Vec<usize>) =
            (0..n.min(residuals.len())).partition(|&k| sizes[k] > RANK * most);
        let (rank, measurements) = (told.len(), residuals.len());
        let freedom = measurements - rank;
        let variance = if known { 1.0 } else { residuals.iter().map(|r| r * r).sum::<f64>() / freedom.max(1) as f64 };
        let lost = |i: usize| untold.iter().any(|&k| ways[(i, k)].abs() > SHARE);
        let covariance = |i: usize, j: usize| {
            variance * told.iter().map(|&k| ways[(i, k)] * ways[(j, k)] / (sizes[k] * sizes[k])).sum::<f64>()
        };
        let correlation = |i: usize, j: usize| {
            let value = covariance(i, j) / (covariance(i, i) * covariance(j, j)).sqrt();
            (!lost(i) && !lost(j)).then_some(value)
        };
        let at_bound = |i: usize| match task.ranges[i] {
            Range::Free { .. } => false,
            Range::Between { low, high } => (values[i] - low).min(high - values[i]) <= 1e-6 * (high - low),
        };
        let interface = task.compiled.interface();
        let unit = |name: &str| interface.parameters.iter().find(|p| p.name == name).and_then(|p| p.unit.clone());
        let combination = |k: usize| {
            let mut shares: Vec<(String, f64)> = (0..n).map(|i| (task.names[i].clone(), ways[(i, k)])).collect();
            shares.retain(|(_, share)| share.abs() > SHARE);
            shares.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            let sign = shares.first().map_or(1.0, |s| s.1.signum());
            shares.into_iter().map(|(name, share)| (name, sign * share)).collect()
        };
        let reach = reach(known, freedom, LEVEL);
        let error = |i: usize| (!lost(i)).then(|| covariance(i, i).sqrt() * size(i));
        Ok(FitReport {
            model: self.name().to_string(),
            parameters: (0..n)
                .map(|i| Estimate {
                    name: task.names[i].clone(),
                    value: values[i],
                    error: error(i),
                    interval: error(i).map(|error| (values[i] - reach * error, values[i] + reach * error)),
                    unit: unit(&task.names[i]),
                    at_bound: at_bound(i),
                })
                .collect(),
            correlations: (0..n).map(|i| (0..n).map(|j| correlation(i, j)).collect()).collect(),
            cost,
            measurements,
            freedom,
            variance,
            rank,
            unidentified: untold.iter().map(|&k| combination(k)).collect(),
            evaluations: task.evaluations.get(),
            jacobians: task.jacobians.get(),
            success: *success,
            ended: ended.clone(),
            starts: Vec::new(),
            profiles: Vec::new(),
            runs: fitted_runs(task, &columns, &residuals),
        })
    }
}

/// Where a search has ended: the values, whether by itself, and why.
type Ended = (Vec<f64>, bool, String);

/// How many standard errors an interval reaches to each side: by the normal distribution where the variance is known, else by
/// Student's.
fn reach(known: bool, freedom: usize, level: f64) -> f64 {
    let part = 0.5 + 0.5 * level;
    match known {
        true => Normal::standard().inverse_cdf(part),
        false => {
            let law = StudentsT::new(0.0, 1.0, freedom.max(1) as f64).expect("degrees of freedom above 0");
            law.inverse_cdf(part)
        }
    }
}

fn fitted_runs(task: &Task<'_>, columns: &search::Columns, residuals: &[f64]) -> Vec<FittedRun> {
    let observed = &task.compiled.minimal().program().observed;
    let unit = |name: &str| {
        let unit = observed.iter().find(|o| *o.name == *name).and_then(|o| o.unit.as_ref());
        unit.map(ToString::to_string).unwrap_or_default()
    };
    let mut left = residuals.iter().copied();
    let one = |((run, measured), own): (&(Run, Measured), &Vec<Vec<f64>>)| {
        let Record::Names(names) = &run.record else { unreachable!("outputs are recorded by name") };
        let column = |name: String, unit: String, values: &[f64]| Column { name, unit, values: values.to_vec() };
        let (mut data, mut fitted, mut rest) = (Vec::new(), Vec::new(), Vec::new());
        for ((name, values), own) in names.iter().zip(&measured.values).zip(own) {
            data.push(column(name.clone(), unit(name), values));
            fitted.push(column(name.clone(), unit(name), own));
            let next = |v: &f64| if v.is_finite() { left.next().unwrap_or(f64::NAN) } else { f64::NAN };
            let values: Vec<f64> = values.iter().map(next).collect();
            rest.push(column(format!("{name}: residual"), "1".into(), &values));
        }
        data.extend(rest);
        let trace = |columns| Trace { times: measured.times.clone(), columns };
        FittedRun { name: measured.name.clone(), measured: trace(data), fitted: trace(fitted) }
    };
    task.runs.iter().zip(columns).map(one).collect()
}
