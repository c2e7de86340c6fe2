//! The linearly implicit BDF method of two steps: one evaluation of the rates a step, with a Jacobian that is kept.
//!
//! With `f = A x + (f - A x)`, whatever the matrix `A`, the first part is taken by the backward differentiation formula of
//! order 2, and the second is extrapolated to the end of the step. For the move `d` of the last step, `ω` times as short as
//! this one, and its rates `f₋`, the end is `x + ω d + e` with `(a I - h A) e = h ((1 + ω) f - ω f₋) - ω d` and
//! `a = (1 + 2 ω) / (1 + ω)`: order 2 for any `A`, L-stable where `A` is the Jacobian. The linearly implicit
//! Euler method begins, with the rates at the end of the step and the state at its beginning. Source: [Ascher], SBDF.
//!
//! So `A` need not be new, nor exact. It is the Jacobian of the first step, of which one group of columns is found anew every
//! [`STEPS_A_PART`] steps. Where an event changes it along the way of the run so much that steps would swing up, all of it is.
//! Systems whose derivatives take long have it by [differences](System::compares_rates) of their rates: one evaluation more,
//! by code that has just run.

use super::matrix::StepMatrix;
use crate::{Failure, Sparsity, System};

/// Steps from one group of columns of the Jacobian that is found anew to the next.
const STEPS_A_PART: u32 = 8;

/// By how much at most a step may be longer than the one before: the formula is stable up to 1 + √2.
const LONGEST: f64 = 2.0;

/// Part of a step that is rounding: what is not further apart is the same time, or the same length.
const ROUNDING: f64 = 1e-9;

/// Part of the move of a step that another Jacobian may change, and part of a state below which a move does not count.
const CHANGED: f64 = 0.5;
const SEEN: f64 = 0.01;

/// Parts of a state, and of a step along the rates, over which rates are compared: half of the digits. And the size of a state
/// that is not known, at least.
const BESIDE: f64 = 1.0 / (1 << 26) as f64;
const UNKNOWN: f64 = 1e-4;
const ALONG: f64 = 1e-6;

/// What is remembered of earlier steps.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    /// The step before the present one, and the one that was tried last.
    before: Step,
    last: Step,
    /// Nonzeros of the Jacobian; none at the beginning.
    jacobian: Vec<f64>,
    /// What it was multiplied by in the matrix that was factored last; not a number where it is to be factored anew.
    scale: f64,
    /// The group of columns that is found anew next, and steps since the last one.
    part: usize,
    steps: u32,
    /// Whether something has happened since the last step.
    event: bool,
}

/// A step from a time and state on.
#[derive(Clone, Debug, PartialEq)]
struct Step {
    /// Where it ended; not a number where it does not count.
    end: f64,
    length: f64,
    from: Vec<f64>,
    rates: Vec<f64>,
}

impl Step {
    fn none(states: usize) -> Step {
        Step { end: f64::NAN, length: 1.0, from: vec![0.0; states], rates: vec![0.0; states] }
    }

    fn ends_at(&self, t: f64) -> bool {
        (t - self.end).abs() <= ROUNDING * self.length
    }
}

/// Working space of the method.
pub(super) struct LinearlyImplicitBdf2 {
    history: History,
    sparsity: Sparsity,
    /// Columns that do not meet in any row.
    groups: Vec<Vec<usize>>,
    matrix: StepMatrix,
    /// Whether the matrix has been factored for the history.
    factored: bool,
    point: Vec<f64>,
    rates: Vec<f64>,
    move_on: Vec<f64>,
}

impl LinearlyImplicitBdf2 {
    pub(super) fn new(sparsity: &Sparsity) -> LinearlyImplicitBdf2 {
        let states = sparsity.states();
        let (before, last) = (Step::none(states), Step::none(states));
        let jacobian = Vec::with_capacity(sparsity.nonzeros());
        LinearlyImplicitBdf2 {
            history: History { before, last, jacobian, scale: f64::NAN, part: 0, steps: 0, event: false },
            groups: sparsity.groups(),
            sparsity: sparsity.clone(),
            matrix: StepMatrix::new(sparsity, 1),
            factored: false,
            point: vec![0.0; states],
            rates: vec![0.0; states],
            move_on: vec![0.0; states],
        }
    }

    pub(super) fn history(&self) -> &History {
        &self.history
    }

    pub(super) fn restore(&mut self, history: &History) {
        self.history.clone_from(history);
        self.factored = false;
    }

    /// Earlier steps tell nothing of what comes.
    pub(super) fn leave(&mut self) {
        self.history.before.end = f64::NAN;
        self.history.last.end = f64::NAN;
        self.history.event = true;
    }

    /// Writes the end of the step to `end`. The step that ended where this one begins has been accepted.
    pub(super) fn step(
        &mut self,
        system: &mut dyn System,
        t: f64,
        h: f64,
        x: &[f64],
        end: &mut [f64],
    ) -> Result<(), Failure> {
        let History { before, last, .. } = &mut self.history;
        let goes_on = last.ends_at(t);
        if goes_on {
            std::mem::swap(before, last);
        } else if !before.ends_at(t) {
            before.end = f64::NAN;
        }
        last.end = f64::NAN;
        system.rates(t, x, &mut last.rates)?;
        self.renew(system, (t, h), x, goes_on);
        self.solve(system, (t, h), x, end)?;
        let last = &mut self.history.last;
        last.from.copy_from_slice(x);
        (last.end, last.length) = (t + h, h);
        Ok(())
    }

    /// The same without a trace, apart from the end.
    pub(super) fn rehearse(
        &mut self,
        system: &mut dyn System,
        t: f64,
        x: &[f64],
        end: &mut [f64],
    ) -> Result<(), Failure> {
        system.rates(t, x, end)?;
        if self.factored {
            self.matrix.solve(end);
        }
        end.copy_from_slice(x);
        Ok(())
    }

    /// Finds anew what is due of the Jacobian.
    fn renew(&mut self, system: &mut dyn System, (t, h): (f64, f64), x: &[f64], goes_on: bool) {
        let event = std::mem::take(&mut self.history.event);
        if self.history.jacobian.is_empty() || (event && self.is_another(system, (t, h), x)) {
            self.history.jacobian.resize(self.sparsity.nonzeros(), 0.0);
            (0..self.groups.len()).for_each(|part| self.take_part(system, (t, h), x, part));
            (self.history.part, self.history.steps) = (0, 0);
        } else if goes_on {
            self.history.steps += 1;
            if self.history.steps == STEPS_A_PART {
                self.take_part(system, (t, h), x, self.history.part);
                let next = self.history.part + 1;
                (self.history.part, self.history.steps) = (if next < self.groups.len() { next } else { 0 }, 0);
            }
        }
    }

    /// Finds a group of columns anew. Where there are no derivatives, or no rates beside the state, they stay as they are.
    fn take_part(&mut self, system: &mut dyn System, (t, h): (f64, f64), x: &[f64], part: usize) {
        let Some(group) = self.groups.get(part) else { return };
        let LinearlyImplicitBdf2 { history, sparsity, point, rates, .. } = self;
        let (values, last) = (&mut history.jacobian, &history.last);
        history.scale = f64::NAN;
        let compares = system.compares_rates();
        let found = if compares {
            point.copy_from_slice(x);
            for &column in group {
                let known = system.scales()[column];
                let size = x[column].abs().max((h * last.rates[column]).abs());
                point[column] += BESIDE * size.max(if known > 0.0 { known } else { UNKNOWN });
            }
            system.rates(t, point, rates)
        } else {
            point.fill(0.0);
            group.iter().for_each(|&column| point[column] = 1.0);
            system.directional_derivative(t, x, point, rates)
        };
        if found.is_err() {
            return;
        }
        for &column in group {
            for (place, &row) in sparsity.places(column).zip(sparsity.column(column)) {
                values[place] = match compares {
                    true => (rates[row] - last.rates[row]) / (point[column] - x[column]),
                    false => rates[row],
                };
            }
        }
    }

    /// Whether the Jacobian along the rates is so much another one that the move of a step would be.
    fn is_another(&mut self, system: &mut dyn System, (t, h): (f64, f64), x: &[f64]) -> bool {
        let LinearlyImplicitBdf2 { history, point, rates, .. } = self;
        let last = &history.last;
        let found = if system.compares_rates() {
            let way = ALONG * h;
            (0..x.len()).for_each(|i| point[i] = x[i] + way * last.rates[i]);
            let found = system.rates(t, point, rates);
            (0..x.len()).for_each(|i| rates[i] = (rates[i] - last.rates[i]) / way);
            found
        } else {
            system.directional_derivative(t, x, &last.rates, rates)
        };
        for ((row, column), value) in self.sparsity.entries().zip(&history.jacobian) {
            rates[row] -= value * last.rates[column];
        }
        let counts = |i: usize| (h * last.rates[i]).abs().max(SEEN * x[i].abs());
        found.is_err() || (0..x.len()).any(|i| (h * (h * rates[i])).abs() > CHANGED * counts(i))
    }

    /// Solves for the end of the step.
    fn solve(
        &mut self,
        system: &mut dyn System,
        (t, h): (f64, f64),
        x: &[f64],
        end: &mut [f64],
    ) -> Result<(), Failure> {
        let History { before, last, jacobian, scale, .. } = &mut self.history;
        let ratio = h / before.length;
        let ratio = if before.ends_at(t) && ratio <= LONGEST { ratio } else { 0.0 };
        let own = (1.0 + 2.0 * ratio) / (1.0 + ratio);
        let wanted = h / own;
        let serves = (*scale - wanted).abs() <= ROUNDING * wanted;
        if !serves {
            (*scale, self.factored) = (wanted, false);
        }
        if !self.factored {
            self.matrix.factor_values(system, t, jacobian, *scale)?;
            self.factored = true;
        }
        if ratio == 0.0 {
            system.rates(t + h, x, &mut self.rates)?;
            self.move_on.fill(0.0);
            (0..x.len()).for_each(|i| end[i] = h * self.rates[i]);
        } else {
            for i in 0..x.len() {
                self.move_on[i] = ratio * (x[i] - before.from[i]);
                let rates = (1.0 + ratio) * last.rates[i] - ratio * before.rates[i];
                end[i] = (h * rates - self.move_on[i]) / own;
            }
        }
        self.matrix.solve(end);
        for i in 0..x.len() {
            end[i] = x[i] + (self.move_on[i] + end[i]);
        }
        Ok(())
    }
}
