//! The search for the least sum of squares.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra_of_lm::storage::Owned;
use nalgebra_of_lm::{DMatrix, DVector, Dyn};

use super::Loss;
use super::measured::Measured;
use super::range::Range;
use crate::compiled::Compiled;
use crate::error::{Error, Problem};
use crate::run::Run;

/// A residual where the model does not run: no step goes there.
const NOWHERE: f64 = 1e100;

/// What stays the same in all searches of a fit.
pub(super) struct Task<'a> {
    pub compiled: &'a Compiled,
    /// What is measured; the run of each, and what was measured in it.
    pub runs: Vec<(Run, Measured)>,
    pub names: Vec<String>,
    pub ranges: Vec<Range>,
    pub loss: (Loss, f64),
    pub tolerance: f64,
    pub evaluations: std::cell::Cell<usize>,
    pub jacobians: std::cell::Cell<usize>,
    pub progress: std::cell::RefCell<&'a mut dyn FnMut(usize) -> bool>,
}

/// Of each run the columns: outputs, then their derivatives by each of the quantities asked for.
pub(super) type Columns = Vec<Vec<Vec<f64>>>;

impl Task<'_> {
    /// The runs with these values, differentiated by some of the parameters.
    ///
    /// # Errors
    /// The model does not run with them, or the fit was stopped.
    pub fn columns(&self, values: &[f64], by: &[usize]) -> Result<Columns, Error> {
        self.evaluations.set(self.evaluations.get() + 1);
        self.jacobians.set(self.jacobians.get() + usize::from(!by.is_empty()));
        if !(self.progress.borrow_mut())(self.evaluations.get()) {
            return Err(Problem::BadOption { reason: "the fit was stopped".to_string() }.into());
        }
        let mut compiled = self.compiled.clone();
        compiled.set_all(self.names.iter().map(String::as_str).zip(values.iter().copied()))?;
        let one = |(run, _): &(Run, Measured)| {
            let sensitivities = by.iter().map(|&j| self.names[j].clone()).collect();
            let done = compiled.simulate(&Run { sensitivities, ..run.clone() }, &mut |_| true)?;
            Ok(done.trace.columns.into_iter().map(|column| column.values).collect())
        };
        self.runs.iter().map(one).collect()
    }

    /// For each measurement that there is, what `of` makes of run, output and sample.
    fn each<'s>(&'s self, of: impl Fn(usize, usize, usize) -> f64 + 's) -> impl Iterator<Item = f64> + 's {
        let runs = self.runs.iter().enumerate();
        let places = runs.flat_map(|(r, (_, m))| {
            m.values.iter().enumerate().flat_map(move |(k, values)| (0..values.len()).map(move |i| (r, k, i)))
        });
        let there = |&(r, k, i): &(usize, usize, usize)| self.runs[r].1.values[k][i].is_finite();
        places.filter(there).map(move |(r, k, i)| of(r, k, i) / self.runs[r].1.sigma[k][i])
    }

    /// How many measurements there are.
    pub fn measurements(&self) -> usize {
        self.each(|_, _, _| 0.0).count()
    }

    /// Model less measurement in standard deviations.
    pub fn residuals(&self, columns: &Columns) -> Vec<f64> {
        self.each(|r, k, i| columns[r][k][i] - self.runs[r].1.values[k][i]).collect()
    }

    /// Their derivatives by as many parameters as the columns hold, column by column.
    pub fn slopes(&self, columns: &Columns, count: usize) -> Vec<Vec<f64>> {
        let by = |j: usize| {
            self.each(move |r, k, i| columns[r][(j + 1) * self.runs[r].1.values.len() + k][i]).collect::<Vec<f64>>()
        };
        (0..count).map(by).collect()
    }

    /// The sum that is made least.
    pub fn cost(&self, residuals: &[f64]) -> f64 {
        let (loss, scale) = self.loss;
        residuals.iter().map(|&r| loss.bent(r, scale).0).map(|r| r * r).sum()
    }

    /// Searches from these values on, where some parameters stay what they are. What was found, whether the search has come
    /// to its end by itself, and how it ended.
    pub fn search(&self, begin: &[f64], free: &[usize]) -> (Vec<f64>, bool, String) {
        let u = free.iter().map(|&j| self.ranges[j].place(begin[j])).collect();
        let search = Search { task: self, begin: begin.to_vec(), free: free.to_vec(), u: DVector::from_vec(u) };
        let method =
            LevenbergMarquardt::new().with_ftol(self.tolerance).with_xtol(self.tolerance).with_gtol(self.tolerance);
        let (found, ended) = method.minimize(search);
        (found.values(), ended.termination.was_successful(), format!("{:?}", ended.termination))
    }
}

/// The problem as the method asks for it.
struct Search<'a, 't> {
    task: &'a Task<'t>,
    begin: Vec<f64>,
    free: Vec<usize>,
    u: DVector<f64>,
}

impl Search<'_, '_> {
    fn values(&self) -> Vec<f64> {
        let mut values = self.begin.clone();
        self.free.iter().zip(&self.u).for_each(|(&j, u)| values[j] = self.task.ranges[j].value(*u));
        values
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Search<'_, '_> {
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
        let (loss, scale) = self.task.loss;
        Some(match self.task.columns(&self.values(), &[]) {
            Ok(columns) => {
                let residuals = self.task.residuals(&columns).into_iter();
                DVector::from_vec(residuals.map(|r| loss.bent(r, scale).0).collect())
            }
            Err(_) => DVector::from_element(self.task.measurements(), NOWHERE),
        })
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let columns = self.task.columns(&self.values(), &self.free).ok()?;
        let (loss, scale) = self.task.loss;
        let residuals = self.task.residuals(&columns);
        let slopes = self.task.slopes(&columns, self.free.len());
        let steps: Vec<f64> = self.free.iter().zip(&self.u).map(|(&j, u)| self.task.ranges[j].slope(*u)).collect();
        let entry = |i: usize, j: usize| slopes[j][i] * steps[j] * loss.bent(residuals[i], scale).1;
        Some(DMatrix::from_fn(residuals.len(), self.free.len(), entry))
    }
}
