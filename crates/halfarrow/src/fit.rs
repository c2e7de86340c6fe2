//! Parameters from measurements: least squares by the method of Levenberg and Marquardt, with exact derivatives.

use std::path::PathBuf;

use faer::Mat;
use halfarrow_compiler::equations::Form;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra_of_lm::storage::Owned;
use nalgebra_of_lm::{DMatrix, DVector, Dyn};
use serde::Serialize;

use crate::compiled::Compiled;
use crate::error::{Error, Problem};
use crate::model::Model;
use crate::run::{Record, Run};
use crate::table_file::ReadTable;

/// Directions in which residuals change by less than this part of the greatest change are told by the errors of runs alone.
const RANK: f64 = 1e-6;
/// A share of a parameter in such a direction below which it takes no part.
const SHARE: f64 = 1e-3;
/// A parameter below this part of its first guess, or of the distance of its bounds, counts as that.
const NEAR_ZERO: f64 = 1e-2;
/// A residual where the model does not run: no step goes there.
const NOWHERE: f64 = 1e100;

/// What to fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The run; its end is the last time of the data unless it is sooner. In the form `minimal`.
    pub run: Run,
    /// A CSV file with a column `t` and those that are compared.
    pub data: PathBuf,
    /// Variables with the columns that are measurements of them.
    pub outputs: Vec<(String, String)>,
    /// Standard deviations of the measurements of variables, in their units; those of the others are estimated.
    pub sigma: Vec<(String, f64)>,
    /// What is fitted.
    pub parameters: Vec<FitParameter>,
    /// Relative change of parameters and sum of squares at which the search ends.
    pub tolerance: f64,
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
    /// SI unit, where known.
    pub unit: Option<String>,
    /// Whether it lies at a bound.
    pub at_bound: bool,
}

/// A parameter as the search has it: without bounds by `value = scale · u`, between bounds by the sine of `u`. Source: [MINUIT].
#[derive(Debug, Clone, Copy)]
enum Range {
    Free { scale: f64 },
    Between { low: f64, high: f64 },
}

impl Range {
    fn value(self, u: f64) -> f64 {
        match self {
            Range::Free { scale } => scale * u,
            Range::Between { low, high } => low + 0.5 * (high - low) * (1.0 + libm::sin(u)),
        }
    }

    fn slope(self, u: f64) -> f64 {
        match self {
            Range::Free { scale } => scale,
            Range::Between { low, high } => 0.5 * (high - low) * libm::cos(u),
        }
    }

    fn place(self, value: f64) -> f64 {
        match self {
            Range::Free { scale } => value / scale,
            Range::Between { low, high } => libm::asin((2.0 * (value - low) / (high - low) - 1.0).clamp(-1.0, 1.0)),
        }
    }
}

/// The problem as the method asks for it.
struct Search<'a> {
    compiled: &'a Compiled,
    run: Run,
    names: Vec<String>,
    ranges: Vec<Range>,
    /// Measurements, output by output, and their standard deviations; NaN where there is none.
    measured: Vec<Vec<f64>>,
    sigma: Vec<f64>,
    u: DVector<f64>,
    evaluations: std::cell::Cell<usize>,
    jacobians: std::cell::Cell<usize>,
    progress: std::cell::RefCell<&'a mut dyn FnMut(usize) -> bool>,
}

impl Search<'_> {
    fn values(&self) -> Vec<f64> {
        self.ranges.iter().zip(&self.u).map(|(range, u)| range.value(*u)).collect()
    }

    /// The columns of a run with the present values: outputs, then their derivatives by each parameter.
    fn columns(&self, differentiated: bool) -> Result<Vec<Vec<f64>>, Error> {
        self.evaluations.set(self.evaluations.get() + 1);
        let mut compiled = self.compiled.clone();
        let values = self.values();
        compiled.set_all(self.names.iter().map(String::as_str).zip(values))?;
        let mut run = self.run.clone();
        if differentiated {
            self.jacobians.set(self.jacobians.get() + 1);
            run.sensitivities.clone_from(&self.names);
        }
        if !(self.progress.borrow_mut())(self.evaluations.get()) {
            let reason = "the fit was stopped".to_string();
            return Err(Problem::BadOption { reason }.into());
        }
        let done = compiled.simulate(&run, &mut |_| true)?;
        Ok(done.trace.columns.into_iter().map(|column| column.values).collect())
    }

    /// For each measurement that there is, what `of` makes of the column of its output.
    fn each<'s>(&'s self, of: impl Fn(usize, usize) -> f64 + 's) -> impl Iterator<Item = f64> + 's {
        let places = self.measured.iter().enumerate();
        let places = places.flat_map(|(k, values)| (0..values.len()).map(move |i| (k, i)));
        places.filter(|&(k, i)| self.measured[k][i].is_finite()).map(move |(k, i)| of(k, i) / self.sigma[k])
    }

    fn residuals_of(&self, columns: &[Vec<f64>]) -> Vec<f64> {
        self.each(|k, i| columns[k][i] - self.measured[k][i]).collect()
    }

    /// The derivatives of the residuals by the parameters themselves.
    fn slopes_of(&self, columns: &[Vec<f64>]) -> DMatrix<f64> {
        let outputs = self.measured.len();
        let by = |j: usize| self.each(move |k, i| columns[(j + 1) * outputs + k][i]).collect::<Vec<f64>>();
        let all: Vec<Vec<f64>> = (0..self.names.len()).map(by).collect();
        DMatrix::from_fn(all.first().map_or(0, Vec::len), all.len(), |i, j| all[j][i])
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Search<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, u: &DVector<f64>) {
        self.u.copy_from(u);
    }

    fn params(&self) -> DVector<f64> {
        self.u.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        Some(match self.columns(false) {
            Ok(columns) => DVector::from_vec(self.residuals_of(&columns)),
            Err(_) => DVector::from_iterator(self.each(|_, _| 1.0).count(), self.each(|_, _| 1.0).map(|_| NOWHERE)),
        })
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let mut slopes = self.slopes_of(&self.columns(true).ok()?);
        for (j, range) in self.ranges.iter().enumerate() {
            let slope = range.slope(self.u[j]);
            slopes.column_mut(j).iter_mut().for_each(|entry| *entry *= slope);
        }
        Some(slopes)
    }
}

impl Model {
    /// The same model with start values of these variables as parameters, called `spring.q(0)`.
    ///
    /// # Errors
    /// A variable begins with no value.
    pub fn with_starts(&self, variables: &[&str]) -> Result<Model, Problem> {
        let mut graph = self.graph.clone();
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
        let (times, measured) = measurements(fit, &compiled)?;
        let spread = |values: &[f64]| {
            let known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
            let mean = known.iter().sum::<f64>() / known.len() as f64;
            let square = known.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / known.len() as f64;
            if square > 0.0 { square.sqrt() } else { 1.0 }
        };
        let given = |name: &String| fit.sigma.iter().find(|s| s.0 == *name).map(|s| s.1);
        let known = fit.outputs.iter().all(|(name, _)| given(name).is_some());
        if !known && !fit.sigma.is_empty() {
            return Err(bad(
                "standard deviations are given for some outputs only: give them for all, or for none".into()
            ));
        }
        let outputs = fit.outputs.iter().zip(&measured);
        let sigma: Vec<f64> =
            outputs.map(|((name, _), values)| given(name).unwrap_or_else(|| spread(values))).collect();
        if sigma.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
            return Err(bad("standard deviations have to be finite and above 0".into()));
        }
        let run = Run {
            to: *times.last().expect("there are measurements"),
            at: times,
            record: Record::Names(fit.outputs.iter().map(|(name, _)| name.clone()).collect()),
            ..fit.run.clone()
        };
        let (ranges, u) = ranges(fit, &compiled)?;
        let names = fit.parameters.iter().map(|p| p.name.clone()).collect();
        let counter = || std::cell::Cell::new(0);
        let progress = std::cell::RefCell::new(progress);
        let search = Search {
            compiled: &compiled,
            run,
            names,
            ranges,
            measured,
            sigma,
            u: DVector::from_vec(u),
            evaluations: counter(),
            jacobians: counter(),
            progress,
        };
        // Where the search begins the model has to run, and why it does not is told.
        search.columns(true)?;
        let method =
            LevenbergMarquardt::new().with_ftol(fit.tolerance).with_xtol(fit.tolerance).with_gtol(fit.tolerance);
        let (found, ended) = method.minimize(search);
        let columns = found.columns(true)?;
        let success = ended.termination.was_successful();
        self.judge(&found, &columns, known, (success, format!("{:?}", ended.termination)))
    }

    /// What the data tell at the end of a search.
    fn judge(
        &self,
        found: &Search<'_>,
        columns: &[Vec<f64>],
        known: bool,
        (success, ended): (bool, String),
    ) -> Result<FitReport, Error> {
        let (residuals, slopes, values) = (found.residuals_of(columns), found.slopes_of(columns), found.values());
        let n = values.len();
        // What is near zero counts as a part of where it was sought.
        let size = |j: usize| {
            let sought = match found.ranges[j] {
                Range::Free { scale } => scale,
                Range::Between { low, high } => high - low,
            };
            values[j].abs().max(NEAR_ZERO * sought)
        };
        let weighed = Mat::from_fn(residuals.len(), n, |i, j| slopes[(i, j)] * size(j));
        let bad = || Problem::BadOption { reason: "the derivatives at the end of the search are not finite".into() };
        let svd = weighed.thin_svd().map_err(|_| bad())?;
        let (sizes, ways) = (svd.S().column_vector(), svd.V());
        let most = sizes.iter().fold(0.0f64, |most, s| most.max(*s));
        let (told, untold): (Vec<usize>, Vec<usize>) =
            (0..n.min(residuals.len())).partition(|&k| sizes[k] > RANK * most);
        let (rank, measurements) = (told.len(), residuals.len());
        let cost = residuals.iter().map(|r| r * r).sum::<f64>();
        let freedom = measurements - rank;
        let variance = if known { 1.0 } else { cost / freedom.max(1) as f64 };
        let lost = |i: usize| untold.iter().any(|&k| ways[(i, k)].abs() > SHARE);
        let covariance = |i: usize, j: usize| {
            variance * told.iter().map(|&k| ways[(i, k)] * ways[(j, k)] / (sizes[k] * sizes[k])).sum::<f64>()
        };
        let correlation = |i: usize, j: usize| {
            let value = covariance(i, j) / (covariance(i, i) * covariance(j, j)).sqrt();
            (!lost(i) && !lost(j)).then_some(value)
        };
        let at_bound = |i: usize| match found.ranges[i] {
            Range::Free { .. } => false,
            Range::Between { low, high } => (values[i] - low).min(high - values[i]) <= 1e-6 * (high - low),
        };
        let interface = found.compiled.interface();
        let unit = |name: &str| interface.parameters.iter().find(|p| p.name == name).and_then(|p| p.unit.clone());
        let combination = |k: usize| {
            let mut shares: Vec<(String, f64)> = (0..n).map(|i| (found.names[i].clone(), ways[(i, k)])).collect();
            shares.retain(|(_, share)| share.abs() > SHARE);
            shares.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            let sign = shares.first().map_or(1.0, |s| s.1.signum());
            shares.into_iter().map(|(name, share)| (name, sign * share)).collect()
        };
        Ok(FitReport {
            model: self.name().to_string(),
            parameters: (0..n)
                .map(|i| Estimate {
                    name: found.names[i].clone(),
                    value: values[i],
                    error: (!lost(i)).then(|| covariance(i, i).sqrt() * size(i)),
                    unit: unit(&found.names[i]),
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
            evaluations: found.evaluations.get(),
            jacobians: found.jacobians.get(),
            success,
            ended,
        })
    }
}

/// Times and, output by output, measurements in the units of results.
fn measurements(fit: &Fit, compiled: &Compiled) -> Result<(Vec<f64>, Vec<Vec<f64>>), Error> {
    let table = ReadTable::open(&fit.data)?;
    let fault = |fault: String| Error::from(Problem::BadInput { path: fit.data.clone(), faults: vec![fault] });
    let mut last = f64::NEG_INFINITY;
    if table.times.iter().any(|&t| std::mem::replace(&mut last, t) >= t || t < 0.0) {
        return Err(fault("times have to ascend from 0 on, each of them once".into()));
    }
    let count = table.times.iter().take_while(|t| **t <= fit.run.to).count();
    if count == 0 {
        return Err(fault("nothing was measured before the end of the run".into()));
    }
    let observed = &compiled.minimal().program().observed;
    let mut all = Vec::new();
    for (name, column) in &fit.outputs {
        let Some(found) = table.columns.get(column) else {
            let known: Vec<&str> = table.columns.keys().map(String::as_str).collect();
            return Err(fault(format!("there is no column `{column}`; there are {}", known.join(", "))));
        };
        let unit = observed.iter().find(|o| o.name == *name).and_then(|o| o.unit.as_ref());
        let values = match (&found.unit, unit) {
            (Some(_), Some(unit)) => {
                let si = found.in_si(column, Some(unit)).map_err(fault)?;
                si.into_iter().map(|value| if unit.is_si() { value } else { unit.from_si_f64(value) }).collect()
            }
            _ => found.values.clone(),
        };
        all.push(values[..count].to_vec());
    }
    Ok((table.times[..count].to_vec(), all))
}

/// Ranges of the parameters, and where the search begins.
fn ranges(fit: &Fit, compiled: &Compiled) -> Result<(Vec<Range>, Vec<f64>), Error> {
    let (mut ranges, mut begin) = (Vec::new(), Vec::new());
    for parameter in &fit.parameters {
        let own = compiled.parameter(&parameter.name);
        let range = match &parameter.bounds {
            None => Range::Free { scale: own.filter(|v| *v != 0.0).map_or(1.0, f64::abs) },
            Some((low, high)) => {
                let (low, high) = (compiled.quantity(&parameter.name, low)?, compiled.quantity(&parameter.name, high)?);
                if low >= high || !(low.is_finite() && high.is_finite()) {
                    let reason = format!("`{}` is given the bounds {low} and {high}", parameter.name);
                    return Err(Problem::BadOption { reason }.into());
                }
                Range::Between { low, high }
            }
        };
        let value = match range {
            Range::Between { low, high } => match own.filter(|own| low < *own && *own < high) {
                Some(own) => own,
                None if low > 0.0 => (low * high).sqrt(),
                None => 0.5 * (low + high),
            },
            Range::Free { .. } => own.unwrap_or(0.0),
        };
        begin.push(range.place(value));
        ranges.push(range);
    }
    Ok((ranges, begin))
}
