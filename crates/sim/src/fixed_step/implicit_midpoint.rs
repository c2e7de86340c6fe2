//! The implicit midpoint rule.

use super::matrix::StepMatrix;
use crate::{Failure, Sparsity, System};

/// Newton iterations at most in a step.
const MOST_ITERATIONS: usize = 20;

/// A correction this small, relative to the states, leaves an error of rounding: Newton squares it.
const SMALL: f64 = 1e-9;

/// Solves `X = x + h/2 · f(t + h/2, X)` for the midpoint `X`; the step ends at `2X - x`.
pub(super) struct ImplicitMidpoint {
    matrix: StepMatrix,
    middle: Vec<f64>,
    rates: Vec<f64>,
    /// Magnitude of what each equation adds up.
    sizes: Vec<f64>,
    /// The residual, then the correction.
    correction: Vec<f64>,
}

impl ImplicitMidpoint {
    pub(super) fn new(sparsity: &Sparsity, blocks: usize) -> ImplicitMidpoint {
        let states = sparsity.states();
        ImplicitMidpoint {
            matrix: StepMatrix::new(sparsity, blocks),
            middle: vec![0.0; states],
            rates: vec![0.0; states],
            sizes: vec![0.0; states],
            correction: vec![0.0; states],
        }
    }

    /// Writes the end of the step to `end`.
    pub(super) fn step(
        &mut self,
        system: &mut dyn System,
        t: f64,
        h: f64,
        x: &[f64],
        end: &mut [f64],
    ) -> Result<(), Failure> {
        let middle_time = t + 0.5 * h;
        self.middle.copy_from_slice(x);
        for _ in 0..MOST_ITERATIONS {
            self.correct(system, middle_time, 0.5 * h, x)?;
            if self.relative_correction(system.scales()) <= SMALL {
                (0..x.len()).for_each(|i| end[i] = 2.0 * self.middle[i] - x[i]);
                return Ok(());
            }
        }
        let residual = self.correction.iter().fold(0.0, |most: f64, correction| most.max(correction.abs()));
        let what = "the implicit midpoint step".into();
        Err(Failure::NoConvergence { time: middle_time, what, iterations: MOST_ITERATIONS, residual })
    }

    /// One Newton iteration on the midpoint.
    fn correct(&mut self, system: &mut dyn System, t: f64, half: f64, x: &[f64]) -> Result<(), Failure> {
        system.rates(t, &self.middle, &mut self.rates)?;
        self.sizes.iter_mut().zip(x).for_each(|(size, x)| *size = x.abs());
        let (sizes, middle) = (&mut self.sizes, &self.middle);
        self.matrix.factor(system, t, middle, half, |row, column, value| {
            sizes[row] += (half * value * middle[column]).abs();
        })?;
        for (i, correction) in self.correction.iter_mut().enumerate() {
            *correction = x[i] + half * self.rates[i] - self.middle[i];
        }
        self.matrix.solve(&mut self.correction);
        self.middle.iter_mut().zip(&self.correction).for_each(|(middle, correction)| *middle += correction);
        Ok(())
    }

    /// The greatest correction, each relative to its state or to what its equation adds up.
    fn relative_correction(&self, scales: &[f64]) -> f64 {
        let mut most: f64 = 0.0;
        for (i, correction) in self.correction.iter().enumerate() {
            let size = self.middle[i].abs().max(self.sizes[i]).max(scales[i]);
            let relative = if *correction == 0.0 { 0.0 } else { correction.abs() / size };
            if relative > most || relative.is_nan() {
                most = relative;
            }
        }
        most
    }
}
