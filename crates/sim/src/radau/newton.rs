//! Simplified Newton for the increments of a step. Source: [HW], IV.8.

use super::tableau::{BACK, NODES, STAGES, TRANSFORM};
use super::{Radau, STEEP, StepError, norm};
use crate::{Affected, Failure, ImplicitSystem};

/// Iterations at most.
pub(super) const MOST_ITERATIONS: usize = 7;

/// Factor from one correction to the next beyond which rounding keeps Newton from getting where it should.
const STALLED: f64 = 0.3;

/// What a correction may be of the unknowns by rounding alone.
const ROUNDING: f64 = f64::EPSILON;

/// Roundings of all that an equation adds up that a correction may be made of.
const NOISE: f64 = 8.0;
/// How far beyond that a correction counts as rounding that Newton cannot get rid of.
const STUCK: f64 = 8.0;

/// Rate of convergence beyond which there is none.
const DIVERGENT: f64 = 0.99;

/// How Newton converges: what was seen in one step is believed in the next.
#[derive(Clone, Copy)]
pub(super) struct Convergence {
    /// Factor from one correction to the next.
    rate: f64,
    /// What is left after a correction, relative to it.
    left: f64,
}

impl Default for Convergence {
    fn default() -> Convergence {
        Convergence { rate: super::FAST, left: 1.0 }
    }
}

impl Convergence {
    /// Factor from one correction to the next.
    pub(super) fn rate(&self) -> f64 {
        self.rate
    }
}

impl Radau {
    /// Iterates from the increments in `z`; the number of iterations.
    pub(super) fn iterate(&mut self, system: &mut dyn ImplicitSystem, h: f64) -> Result<usize, StepError> {
        self.newton = Convergence { rate: super::FAST, left: libm::pow(self.newton.left.max(f64::EPSILON), 0.8) };
        let (mut before, mut growth_before, mut wanted_before) = (0.0_f64, 0.0, f64::INFINITY);
        let (rounding, steep) = (ROUNDING / self.relative.max(f64::EPSILON), self.is_steep(system, h));
        for iteration in 1..=MOST_ITERATIONS {
            self.correct(system, h)?;
            self.work.iterations += 1;
            let [a, b, c] = &self.correction;
            let size = norm(&[a, b, c], &self.allowed);
            let wanted = self.wanted.as_ref().map_or(size, |wanted| norm(&[a, b, c], wanted));
            // About a place where a law is infinitely steep corrections go to and fro: two short ones in a row are enough.
            let short = size.max(before).max(wanted) <= self.newton_tolerance;
            if iteration > 1 && short && system.is_steep() {
                self.apply();
                return Ok(iteration);
            }
            if iteration > 1 && iteration < MOST_ITERATIONS && !(steep && size <= rounding) {
                let growth = size / before;
                self.newton.rate = if iteration == 2 { growth } else { (growth * growth_before).sqrt() };
                growth_before = growth;
                if let Err(slow) = self.predict_convergence(size, MOST_ITERATIONS - 1 - iteration) {
                    if !self.is_rounding(system) {
                        return Err(slow);
                    }
                    self.apply();
                    return Ok(iteration);
                }
            }
            if !size.is_finite() {
                return Err(StepError::Slow { shorten: 0.5 });
            }
            before = size.max(f64::EPSILON);
            let stalled = wanted > STALLED * wanted_before || iteration == MOST_ITERATIONS;
            let enough = self.newton_tolerance / self.newton.left;
            self.apply();
            // One correction by a steep Jacobian says little of what it leaves: where a diode has begun to conduct meanwhile, all of
            // them are short.
            let told = iteration > 1 || !steep || size <= rounding;
            if told && size <= enough && (wanted <= enough || stalled) {
                return Ok(iteration);
            }
            wanted_before = wanted;
        }
        // The last correction has been applied.
        if self.is_rounding(system) { Ok(MOST_ITERATIONS) } else { Err(StepError::Slow { shorten: 0.5 }) }
    }

    /// Whether the correction of unknowns that do not act back on the motion is no more than what roundings of the equations make
    /// of them, and that of the others what is allowed. The flow of a capacitor that a source holds is the difference of two
    /// charges over the step: what rounding leaves of it may be large beside nothing at all.
    fn is_rounding(&mut self, system: &dyn ImplicitSystem) -> bool {
        if self.wanted.is_none() {
            return false;
        }
        self.take_noise(system);
        let fits = |(i, correction): (usize, &f64)| {
            let noise = if self.index[i] > 1 { STUCK * self.noise[i] } else { 0.0 };
            correction.abs() <= noise.max(self.newton_tolerance * self.allowed[i])
        };
        self.correction.iter().all(|part| part.iter().enumerate().all(fits))
    }

    /// Computes what roundings of the equations at the trial values make of each unknown of a step.
    pub(super) fn take_noise(&mut self, system: &dyn ImplicitSystem) {
        let Radau { noise, sums, moved, matrices, .. } = self;
        sums.fill(0.0);
        for (place, (row, column)) in system.sparsity().entries().enumerate() {
            sums[row] +=
                (self.dy[place] * self.trial[column]).abs() + (self.dyp[place] * self.trial_rates[column]).abs();
        }
        noise.fill(0.0);
        for turn in [false, true] {
            let signed = |(row, sum): (usize, &f64)| if turn && row % 2 == 1 { -sum } else { *sum };
            moved.iter_mut().zip(sums.iter().enumerate().map(signed)).for_each(|(moved, sum)| *moved = sum);
            matrices.solve_real(moved);
            let part = |moved: &f64| NOISE * f64::EPSILON * moved.abs();
            noise.iter_mut().zip(&*moved).for_each(|(noise, moved)| *noise = noise.max(part(moved)));
        }
    }

    /// Whether the rate of an unknown would change by far more in the step than by its own tolerance, if only what the Jacobian
    /// says happened to it: then corrections are short whatever is left.
    fn is_steep(&mut self, system: &dyn ImplicitSystem, h: f64) -> bool {
        let sums = &mut self.rates_of_change;
        sums.fill([0.0; 2]);
        for (place, (row, column)) in system.sparsity().entries().enumerate() {
            sums[row][0] += (self.dy[place] * h).abs() * self.allowed[column];
            sums[row][1] += self.dyp[place].abs() * self.allowed[column];
        }
        sums.iter().any(|[by_values, by_rates]| *by_rates > 0.0 && *by_values > STEEP * by_rates)
    }

    /// Whether `remaining` more iterations will do after a correction of this size.
    fn predict_convergence(&mut self, size: f64, remaining: usize) -> Result<(), StepError> {
        let rate = self.newton.rate;
        if rate.is_nan() || rate >= DIVERGENT {
            return Err(StepError::Slow { shorten: 0.5 });
        }
        self.newton.left = rate / (1.0 - rate);
        let expected = self.newton.left * size * libm::pow(rate, remaining as f64) / self.newton_tolerance;
        if expected >= 1.0 {
            let shorten = 0.8 * libm::pow(expected.clamp(1e-4, 20.0), -1.0 / (4.0 + remaining as f64));
            return Err(StepError::Slow { shorten });
        }
        Ok(())
    }

    /// Computes the transformed correction of the increments.
    fn correct(&mut self, system: &mut dyn ImplicitSystem, h: f64) -> Result<(), StepError> {
        for stage in 0..STAGES {
            self.stage_residual(system, h, stage)?;
        }
        let [first, second, third] = &mut self.correction;
        for ((a, b), c) in first.iter_mut().zip(second.iter_mut()).zip(third.iter_mut()) {
            let residual = [*a, *b, *c];
            [*a, *b, *c] = BACK.map(|row| -(row[0] * residual[0] + row[1] * residual[1] + row[2] * residual[2]));
        }
        self.matrices.solve_real(first);
        self.matrices.solve_complex(second, third);
        Ok(())
    }

    /// Writes the residual of a stage.
    fn stage_residual(&mut self, system: &mut dyn ImplicitSystem, h: f64, stage: usize) -> Result<(), StepError> {
        let weights = self.inverse[stage];
        let [a, b, c] = &self.z;
        for i in 0..self.y.len() {
            self.trial[i] = self.y[i] + self.z[stage][i];
            self.trial_rates[i] = (weights[0] * a[i] + weights[1] * b[i] + weights[2] * c[i]) / h;
        }
        let (t, out) = (self.t + NODES[stage] * h, &mut self.correction[stage]);
        if let Some(unknown) = self.trial.iter().position(|value| !value.is_finite()) {
            return Err(StepError::Failed(Failure::NotFinite {
                time: t,
                what: Affected::variable(system.unknown_name(unknown)),
            }));
        }
        self.work.residuals += 1;
        system.residual(t, &self.trial, &self.trial_rates, out).map_err(StepError::Failed)?;
        match out.iter().position(|value| !value.is_finite()) {
            Some(row) => {
                Err(StepError::Failed(Failure::NotFinite { time: t, what: Affected::Other(system.equation_name(row)) }))
            }
            None => Ok(()),
        }
    }

    /// Applies the correction.
    fn apply(&mut self) {
        for i in 0..self.y.len() {
            let correction = [self.correction[0][i], self.correction[1][i], self.correction[2][i]];
            for (z, row) in self.z.iter_mut().zip(TRANSFORM) {
                z[i] += row[0] * correction[0] + row[1] * correction[1] + row[2] * correction[2];
            }
        }
    }
}
