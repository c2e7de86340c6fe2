//! Jumps of sources and laws where speeds are states: sums of stored quantities are conserved, and the speeds follow.

use super::Model;
use crate::bytecode::{Layout, Routine};
use halfarrow_compiler::program::{Program, Value};
use halfarrow_sim::Failure;

/// Passes of Newton on the speeds after a jump.
const ITERATIONS: usize = 50;
/// A relative step of theirs that has to shrink, or is what rounding leaves.
const NOISE: f64 = 1e-9;
/// A relative step of theirs that is rounding.
const SETTLED: f64 = 4.0 * f64::EPSILON;

/// The states that jump, and the routine of the sums that do not.
#[derive(Debug, Clone)]
pub(super) struct ConservedSums {
    states: Vec<usize>,
    sums: Routine,
}

impl ConservedSums {
    /// `None` where no source that jumps moves a storage that follows a state, and no law of one jumps.
    pub fn of(program: &Program, layout: &Layout) -> Option<ConservedSums> {
        let (states, sums): (Vec<usize>, Vec<Value>) = program.kept.iter().map(|k| (k.0 as usize, k.1)).unzip();
        (!states.is_empty()).then(|| ConservedSums { sums: layout.routine(program, &sums), states })
    }

    pub fn routine(&self) -> &Routine {
        &self.sums
    }

    /// The states that jump.
    pub fn states(&self) -> &[usize] {
        &self.states
    }
}

impl Model {
    /// The sums at `(t, x)` in the present mode.
    pub(super) fn sums(&mut self, t: f64, x: &[f64]) -> Result<Vec<f64>, Failure> {
        let code = self.code.clone();
        let Some(kept) = &code.kept else { return Ok(Vec::new()) };
        self.place(t, x);
        self.frame.run(&kept.sums).map_err(|error| self.failure(t, error))?;
        let sums = kept.sums.outputs.iter().map(|&r| self.frame.r[r as usize]).collect();
        self.vary_sums(t, x, kept)?;
        Ok(sums)
    }

    /// Gives the states that jump the values at which the sums in the present mode are what they were; whether any moved.
    pub(super) fn conserve_sums(&mut self, t: f64, x: &mut [f64], before: &[f64]) -> Result<bool, Failure> {
        let code = self.code.clone();
        let Some(kept) = &code.kept else { return Ok(false) };
        let moved = self.solve_sums(kept, t, x, before)?;
        self.vary_conserved(t, x, kept)?;
        Ok(moved)
    }

    fn solve_sums(&mut self, kept: &ConservedSums, t: f64, x: &mut [f64], before: &[f64]) -> Result<bool, Failure> {
        let n = kept.states.len();
        let (mut last, mut residual) = (f64::INFINITY, vec![0.0; n]);
        for iteration in 0..ITERATIONS {
            let mut matrix = vec![0.0; n * n];
            for column in 0..n {
                self.place(t, x);
                self.still();
                self.frame.d[self.code.layout.states as usize + kept.states[column]] = 1.0;
                self.frame.run_along(&kept.sums).map_err(|error| self.failure(t, error))?;
                for (row, &register) in kept.sums.outputs.iter().enumerate() {
                    matrix[row * n + column] = self.frame.d[register as usize];
                    residual[row] = self.frame.r[register as usize] - before[row];
                }
            }
            if residual.iter().all(|m| *m == 0.0) {
                return Ok(iteration > 0);
            }
            let Some(step) = super::minimum_norm::step(&matrix, &residual, n).filter(|step| step.rank == n) else {
                break;
            };
            let relative = |(&i, s): (&usize, &f64)| s.abs() / x[i].abs().max(s.abs()).max(f64::MIN_POSITIVE);
            let length = kept.states.iter().zip(&step.step).map(relative).fold(0.0, f64::max);
            if length < NOISE && length >= 0.5 * last {
                return Ok(true);
            }
            kept.states.iter().zip(&step.step).for_each(|(&i, s)| x[i] += s);
            if length <= SETTLED {
                return Ok(true);
            }
            last = length;
        }
        let what = "the speeds after a jump of a source or a law".to_string();
        let residual = residual.iter().fold(0.0f64, |most, m| most.max(m.abs()));
        Err(Failure::NoConvergence { time: t, what, iterations: ITERATIONS, residual })
    }
}
