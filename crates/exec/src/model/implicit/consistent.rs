//! Unknowns and rates that fit the equations, those of the minimal form beside them.

use super::super::minimum_norm;
use super::ImplicitModel;
use crate::bytecode::{Hold, SolveError};
use halfarrow_sim::{Failure, System as _};

/// Passes of Newton on states of the minimal form.
const ITERATIONS: usize = 30;
/// What rounding leaves of a slope whose terms cancel, against the greatest slope by the same unknown.
const CANCELLED: f64 = 1e-14;
/// A relative step of theirs that has to shrink faster, or is what rounding leaves; before it, a law may be steep.
const NOISE: f64 = 1e-6;
/// A relative step of theirs that is rounding.
const SETTLED: f64 = 4.0 * f64::EPSILON;
/// Passes of Newton on what is recorded, and unknowns up to which there are any.
const REFINEMENTS: usize = 4;
const MOST_REFINED: usize = 60;

impl ImplicitModel {
    /// Newton blocks of the form begin where the reference is: where their equations have several solutions, at its own.
    pub(super) fn guess(&mut self, t: f64) -> Result<(), Failure> {
        let ImplicitModel { reference, form, map, x, .. } = self;
        reference.place(t, x);
        reference.frame.run(&map.of_guesses).map_err(|error| reference.failure(t, error))?;
        for (&(block, i), &register) in map.guesses.iter().zip(&map.of_guesses.outputs) {
            let value = reference.frame.r[register as usize];
            if value.is_finite() {
                form.start_solution(block, i, value);
            }
        }
        Ok(())
    }

    /// Unknowns from the state of the reference.
    pub(super) fn take_over(&mut self, t: f64, y: &mut [f64]) -> Result<(), Failure> {
        if self.map.twin {
            y.copy_from_slice(&self.x);
            return Ok(());
        }
        let ImplicitModel { reference, map, x, .. } = self;
        reference.place(t, x);
        reference.frame.run(&map.of_known).map_err(|error| reference.failure(t, error))?;
        for (&i, &register) in map.known.iter().zip(&map.of_known.outputs) {
            let value = reference.frame.r[register as usize];
            if value.is_finite() {
                y[i] = value;
            }
        }
        if self.map.unknown.is_empty() { Ok(()) } else { self.infer(t, y) }
    }

    /// Unknowns that the reference does not have, such as one of two reactions of which it knows the sum: the least that
    /// makes all other variables right.
    pub(super) fn infer(&mut self, t: f64, y: &mut [f64]) -> Result<(), Failure> {
        let ImplicitModel { reference, map, x, .. } = self;
        reference.place(t, x);
        reference.frame.run(&map.common_there).map_err(|error| reference.failure(t, error))?;
        let wanted: Vec<f64> = map.common_there.outputs.iter().map(|&r| reference.frame.r[r as usize]).collect();
        let (rows, columns) = (wanted.len(), self.map.unknown.len());
        let (mut matrix, mut residual) = (vec![0.0; rows * columns], vec![0.0; rows]);
        let still = vec![0.0; y.len()];
        self.map.unknown.iter().for_each(|&i| y[i] = 0.0);
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            for column in 0..columns {
                self.place(t, y, &still);
                self.form.still();
                self.form.frame.d[self.form.code.layout.states as usize + self.map.unknown[column]] = 1.0;
                self.form.frame.run_along(&self.map.common).map_err(|error| self.form.failure(t, error))?;
                for (row, &register) in self.map.common.outputs.iter().enumerate() {
                    matrix[row * columns + column] = self.form.frame.d[register as usize];
                    residual[row] = self.form.frame.r[register as usize] - wanted[row];
                }
            }
            // What does not read them, or only by what rounding leaves of terms that cancel, says nothing about them.
            let mut greatest = vec![0.0f64; columns];
            for row in matrix.chunks(columns) {
                greatest.iter_mut().zip(row).for_each(|(most, s)| *most = most.max(s.abs()));
            }
            for row in 0..rows {
                let slopes = &mut matrix[row * columns..][..columns];
                let good = residual[row].is_finite() && slopes.iter().all(|s| s.is_finite());
                if !good || slopes.iter().zip(&greatest).all(|(s, most)| s.abs() <= CANCELLED * most) {
                    slopes.fill(0.0);
                    residual[row] = 0.0;
                }
            }
            // Most of what they carry is linear in them: the second step is rounding then.
            let Some(step) = minimum_norm::step(&matrix, &residual, columns) else { break };
            let relative = |(&i, s): (&usize, &f64)| s.abs() / y[i].abs().max(s.abs()).max(f64::MIN_POSITIVE);
            let length = self.map.unknown.iter().zip(&step.step).map(relative).fold(0.0, f64::max);
            if !length.is_finite() || length < NOISE && length >= 0.5 * before {
                break;
            }
            self.map.unknown.iter().zip(&step.step).for_each(|(&i, s)| y[i] += s);
            if length <= SETTLED {
                break;
            }
            before = length;
        }
        Ok(())
    }

    /// Free rates from what the bonds carry in the reference, then the explicit ones.
    pub(super) fn take_rates(&mut self, t: f64, y: &[f64], yp: &mut [f64]) -> Result<(), Failure> {
        yp.fill(0.0);
        let free = self.map.free.len();
        if free > 0 {
            let ImplicitModel { reference, map, x, .. } = self;
            reference.place(t, x);
            reference.frame.run(&map.carried_there).map_err(|error| reference.failure(t, error))?;
            let wanted: Vec<f64> = map.carried_there.outputs.iter().map(|&r| reference.frame.r[r as usize]).collect();
            // What a bond carries is linear in the rates: one step of Newton.
            let mut matrix = vec![0.0; free * free];
            let mut right = wanted;
            for column in 0..free {
                self.place(t, y, yp);
                self.form.still();
                self.form.frame.d[self.form.code.layout.rates as usize + self.map.free[column]] = 1.0;
                let run = self.form.frame.run_along(&self.map.carried);
                run.map_err(|error: SolveError| self.form.failure(t, error))?;
                for (row, &register) in self.map.carried.outputs.iter().enumerate() {
                    matrix[row * free + column] = self.form.frame.d[register as usize];
                    if column == 0 {
                        right[row] -= self.form.frame.r[register as usize];
                    }
                }
            }
            if let Some(step) = minimum_norm::step(&matrix, &right, free) {
                self.map.free.iter().zip(&step.step).for_each(|(&i, s)| yp[i] = -s);
            }
        }
        let mut out = vec![0.0; y.len()];
        self.run_rates(t, y, yp, &mut out)?;
        for (i, value) in out.into_iter().enumerate() {
            if self.map.equations.explicit[i] {
                yp[i] = value;
            }
        }
        Ok(())
    }

    /// Where equations are missed since the reference does not have what a bond carries (it would take the rate of an
    /// input): rates as the unknowns move along the run of the reference, then the unknowns that it does not have.
    pub(super) fn settle(&mut self, t: f64, y: &mut [f64], yp: &mut [f64]) -> Result<(), Failure> {
        let n = y.len();
        let open: Vec<usize> = (0..n).filter(|&i| !self.map.equations.explicit[i]).collect();
        if self.map.twin || self.are_met(t, y, yp, &open)? {
            return Ok(());
        }
        let ImplicitModel { reference, map, x, .. } = self;
        reference.rates_at(t, x)?;
        let dx = reference.dx.clone();
        reference.place(t, x);
        reference.still();
        reference.let_time_pass(t);
        let states = reference.code.layout.states as usize;
        reference.frame.d[states..states + dx.len()].copy_from_slice(&dx);
        reference.frame.run_along(&map.of_known).map_err(|error| reference.failure(t, error))?;
        for (&i, &register) in map.known.iter().zip(&map.of_known.outputs) {
            if map.equations.differential[i] && !map.equations.explicit[i] {
                yp[i] = reference.frame.d[register as usize];
            }
        }
        let columns = self.map.unknown.len();
        for _ in 0..if columns == 0 { 0 } else { REFINEMENTS } {
            let (mut matrix, mut residual) = (vec![0.0; open.len() * columns], vec![0.0; open.len()]);
            for column in 0..columns {
                self.place(t, y, yp);
                self.form.still();
                self.form.frame.d[self.form.code.layout.states as usize + self.map.unknown[column]] = 1.0;
                let form = &mut self.form;
                form.frame.run_along(&form.code.rates).map_err(|error| form.failure(t, error))?;
                for (row, &i) in open.iter().enumerate() {
                    let register = form.code.rates.outputs[i] as usize;
                    matrix[row * columns + column] = form.frame.d[register];
                    residual[row] = form.frame.r[register];
                }
            }
            let Some(step) = minimum_norm::step(&matrix, &residual, columns) else { break };
            self.map.unknown.iter().zip(&step.step).for_each(|(&i, s)| y[i] += s);
        }
        let mut out = vec![0.0; n];
        self.run_rates(t, y, yp, &mut out)?;
        let explicit = (0..n).filter(|&i| self.map.equations.explicit[i]);
        explicit.for_each(|i| yp[i] = out[i]);
        Ok(())
    }

    /// Whether the equations that are not explicit are met.
    pub(super) fn are_met(&mut self, t: f64, y: &[f64], yp: &[f64], open: &[usize]) -> Result<bool, Failure> {
        let mut out = vec![0.0; y.len()];
        self.run_rates(t, y, yp, &mut out)?;
        let size = y.iter().chain(yp).fold(1e-3f64, |most, v| most.max(v.abs()));
        Ok(open.iter().all(|&i| out[i].abs() <= 1e-9 * size))
    }

    /// The unknowns and their rates with those that nothing controls computed from the others: errors of a multiplier of
    /// a higher index do not act back on the motion, so that no step is made shorter for them.
    pub(super) fn controlled(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        self.follow_back(t, y, yp)?;
        self.place(t, y, yp);
        // At an event rounding may have left the reference before a border that the form had passed: but where this one is about to
        // leave a side itself, the sides of the reference are those of its values.
        let held = self.reference.frame.conditions.held();
        if self.form.holds_its_sides(t)? {
            self.reference.frame.conditions.state = Hold::Follow;
        }
        let found = self.controlled_where_it_stands(t, y, yp);
        self.reference.frame.conditions.hold_again(&held);
        found
    }

    fn controlled_where_it_stands(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        let (mut whole, mut rates) = (y.to_vec(), yp.to_vec());
        self.take_over(t, &mut whole)?;
        for i in (0..y.len()).filter(|i| !self.map.uncontrolled.contains(i)) {
            whole[i] = y[i];
        }
        self.take_rates(t, &whole, &mut rates)?;
        self.settle(t, &mut whole, &mut rates)?;
        Ok((whole, rates))
    }

    /// The unknowns and their rates with free rates and algebraic unknowns made to fit the states: the integrator leaves of
    /// its Newton what its tolerance allows, divided by the step for rates. By the equations of this form alone, of
    /// index 1; as they are where Newton does not make them better.
    pub(super) fn consistent(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        let n = y.len();
        let (mut whole, mut rates) = (y.to_vec(), yp.to_vec());
        let rows: Vec<usize> = (0..n).filter(|&i| !self.map.equations.explicit[i]).collect();
        let higher = self.map.equations.indices.iter().any(|index| *index > 1);
        if rows.is_empty() || rows.len() > MOST_REFINED || higher {
            return Ok((whole, rates));
        }
        let (mut out, mut along, mut slope) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut before = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            self.run_rates(t, &whole, &rates, &mut out)?;
            let residual: Vec<f64> = rows.iter().map(|&row| out[row]).collect();
            let k = rows.len();
            let mut matrix = vec![0.0; k * k];
            for (column, &unknown) in rows.iter().enumerate() {
                along[unknown] = 1.0;
                match self.map.equations.differential[unknown] {
                    true => self.form.derivative_by_rates(t, &whole, &along, &mut slope)?,
                    false => self.form.directional_derivative(t, &whole, &along, &mut slope)?,
                }
                along[unknown] = 0.0;
                (0..k).for_each(|row| matrix[row * k + column] = slope[rows[row]]);
            }
            let Some(step) = minimum_norm::step(&matrix, &residual, k) else { break };
            let length = step.step.iter().map(|s| s.abs()).fold(0.0, f64::max);
            if step.rank < k {
                // Rates that the equations hold only differentiated.
                return if self.map.untold.is_empty() {
                    self.controlled(t, y, yp)
                } else {
                    Ok((y.to_vec(), yp.to_vec()))
                };
            }
            if !length.is_finite() || length >= before {
                break;
            }
            before = length;
            for (&unknown, s) in rows.iter().zip(&step.step) {
                let value = if self.map.equations.differential[unknown] { &mut rates } else { &mut whole };
                value[unknown] += s;
            }
            if length == 0.0 {
                break;
            }
        }
        Ok((whole, rates))
    }

    /// The state of the reference from the unknowns, both in the mode that ends here.
    pub(super) fn follow_back(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(), Failure> {
        self.place(t, y, yp);
        self.form.frame.run(&self.map.of_states).map_err(|error| self.form.failure(t, error))?;
        for (&k, &register) in self.map.states.iter().zip(&self.map.of_states.outputs) {
            self.x[k] = self.form.frame.r[register as usize];
        }
        self.form.frame.run(&self.map.of_positions).map_err(|error| self.form.failure(t, error))?;
        for (&(block, i), &register) in self.map.positions.iter().zip(&self.map.of_positions.outputs) {
            self.reference.start_solution(block, i, self.form.frame.r[register as usize]);
        }
        Ok(())
    }

    pub(super) fn place(&mut self, t: f64, y: &[f64], yp: &[f64]) {
        self.form.place(t, y);
        self.place_rates(yp);
    }

    pub(super) fn place_rates(&mut self, yp: &[f64]) {
        if self.form.code.program.implicit.is_some() {
            let rates = self.form.code.layout.rates as usize;
            self.form.frame.r[rates..rates + yp.len()].copy_from_slice(yp);
        }
    }

    /// Rates and residuals.
    pub(super) fn run_rates(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.place_rates(yp);
        self.form.rates(t, y, out)
    }
}
