//! The linearly implicit BDF method of two steps: one evaluation of the rates a step, with a Jacobian that is kept.
//!
//! With `f = A x + (f - A x)`, whatever the matrix `A`, the first part is taken by the backward differentiation formula of
//! order 2, and the second is extrapolated to the end of the step. For the move `d` of the last step, `ω` times as short as
//! this one, and its rates `f₋`, the end is `x + ω d + e` with `(a I - h A) e = h ((1 + ω) f - ω f₋) - ω d` and
//! `a = (1 + 2 ω) / (1 + ω)`: order 2 for any `A`, L-stable where `A` is the Jacobian. Source: [Ascher], SBDF.
//! A method of one step and two stages begins, of order 2 for any `A` too; where a solution turns sharply it is its first stage
//! alone, linearly implicit Euler. Source: [HundsdorferVerwer], IV.5, ROS2 with `γ = 1`, the derivative by time as a difference.
//!
//! So `A` need not be new, nor exact. It is the Jacobian of the first step, until it is another one along the way of the run, by so
//! much that steps would swing up. That is looked at every [`STEPS_A_LOOK`] steps, after an event, and where a step goes far from
//! where it was expected, which then is made from there anew. All columns are found at one state: of different states they would
//! lead a machine that moves in a plane out of it, and a stiff direction that turns would be another one in each.
//! Of large systems some columns are found at each of the following steps, so that none of these is a long one, at the next one where
//! a step has more to do than to go on; at once only where the step would go elsewhere.
//! Systems whose derivatives take long have it by [differences](System::compares_rates) of their rates: one evaluation more,
//! by code that has just run.

use super::matrix::StepMatrix;
use crate::{Failure, Sparsity, System};

/// Steps from one look at whether the Jacobian is still that of the way to the next.
const STEPS_A_LOOK: u32 = 8;

/// By how much at most a step may be longer than the one before. The formula is stable up to 1 + √2 where each is; a short one
/// between long ones, up to a sample, does not swing.
const LONGEST: f64 = 20.0;

/// Groups of columns that are found at each step while the Jacobian is found anew, unless that would take more steps than these.
const GROUPS_A_STEP: usize = 3;
const STEPS_TO_FIND: usize = 16;

/// The number of steps in which so many groups of columns are found; none where one finds all. Each takes neighbours, which are computed
/// by the same code.
fn steps_to_find(groups: usize) -> Option<usize> {
    (groups > GROUPS_A_STEP).then(|| groups.div_ceil(GROUPS_A_STEP).min(STEPS_TO_FIND))
}

/// A step is doubted whose move is another one than that before by so many times that, and by this part of a state.
const OTHER: f64 = 2.0;
const MUCH: f64 = 0.1;

/// Part of a step that is rounding: what is not further apart is the same time, or the same length.
const ROUNDING: f64 = 1e-9;

/// Part of the move of a step that another Jacobian may change: steps swing up from a third on. And part of a state below which a
/// move does not count.
const CHANGED: f64 = 0.2;
const SEEN: f64 = 1e-4;

/// Parts of a state, and of a move, over which rates are compared: a matrix that serves steps needs few digits, and what is 0 in it
/// but for rounding is to stay small, or a car that goes straight on leaves its plane. And the size of a state that is not known,
/// and the least that counts.
const BESIDE: f64 = 1.0 / (1 << 12) as f64;
const UNKNOWN: f64 = 1e-4;
const LEAST: f64 = 1e-6;
const ALONG: f64 = 1e-2;

/// What is remembered of earlier steps.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    /// The step before the present one, and the one that was tried last.
    before: Step,
    last: Step,
    /// Nonzeros of the Jacobian; none at the beginning.
    jacobian: Vec<f64>,
    /// The one that is to follow it.
    next: Next,
    /// What it was multiplied by in the matrix that was factored last; not a number where it is to be factored anew.
    scale: f64,
    /// Steps since it was looked at last.
    steps: u32,
    /// Whether something has happened since the last step.
    event: bool,
}

/// A Jacobian of which some columns are found at each step, all at one state.
#[derive(Clone, Debug, PartialEq)]
struct Next {
    /// Steps that find columns yet; 0 where none is wanted.
    steps: usize,
    /// Whether the last step has left that to the present one.
    waits: bool,
    at: Vec<f64>,
    jacobian: Vec<f64>,
}

/// What has become of the Jacobian along the rates.
enum Change {
    /// It serves.
    Little,
    /// Steps would swing up with time.
    Some,
    /// The next step goes elsewhere.
    Much,
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
    way: Vec<f64>,
    move_on: Vec<f64>,
    /// The state at which columns are found, and the rates there.
    at: Vec<f64>,
    rates_at: Vec<f64>,
}

impl LinearlyImplicitBdf2 {
    pub(super) fn new(sparsity: &Sparsity) -> LinearlyImplicitBdf2 {
        let states = sparsity.states();
        let (before, last) = (Step::none(states), Step::none(states));
        let next = Next { steps: 0, waits: false, at: vec![0.0; states], jacobian: vec![0.0; sparsity.nonzeros()] };
        let jacobian = Vec::with_capacity(sparsity.nonzeros());
        LinearlyImplicitBdf2 {
            history: History { before, last, jacobian, next, scale: f64::NAN, steps: 0, event: false },
            groups: sparsity.groups(),
            sparsity: sparsity.clone(),
            matrix: StepMatrix::new(sparsity, 1),
            factored: false,
            point: vec![0.0; states],
            rates: vec![0.0; states],
            way: vec![0.0; states],
            move_on: vec![0.0; states],
            at: vec![0.0; states],
            rates_at: vec![0.0; states],
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

    /// Finds the Jacobian where a run begins, and factors it, so that the first step does not. Where there are no rates, or no factors,
    /// that step tells.
    pub(super) fn prepare(&mut self, system: &mut dyn System, (t, h): (f64, f64), x: &[f64]) {
        if system.rates(t, x, &mut self.history.last.rates).is_ok() {
            self.renew(system, (t, h), x, false);
            let _ = self.factor(system, t, h);
        }
    }

    /// A step without a trace, apart from the end.
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

    /// Finds the Jacobian anew where it is due.
    fn renew(&mut self, system: &mut dyn System, (t, h): (f64, f64), x: &[f64], goes_on: bool) {
        let event = std::mem::take(&mut self.history.event);
        self.history.steps += u32::from(goes_on);
        let History { jacobian, steps, next, before, .. } = &mut self.history;
        let follows = next.steps > 0;
        let looks = event || (!follows && *steps >= STEPS_A_LOOK);
        next.waits = follows && !next.waits && (looks || !before.ends_at(t));
        let finds = follows && !next.waits;
        if jacobian.is_empty() {
            self.find_all(system, (t, h), x);
        } else if looks {
            self.history.steps = 0;
            self.look(system, (t, h), x);
        }
        if finds {
            self.find_some(system, (t, h));
        }
    }

    /// Looks at the Jacobian, and sees to another one where it is due. Whether it has been found at once.
    fn look(&mut self, system: &mut dyn System, (t, h): (f64, f64), x: &[f64]) -> bool {
        match self.change(system, (t, h), x) {
            Change::Little => return false,
            Change::Some if steps_to_find(self.groups.len()).is_some() => {
                self.want_next(x);
                return false;
            }
            Change::Some | Change::Much => self.find_all(system, (t, h), x),
        }
        true
    }

    /// Finds the Jacobian at once.
    fn find_all(&mut self, system: &mut dyn System, (t, h): (f64, f64), x: &[f64]) {
        let History { jacobian, last, scale, steps, next, .. } = &mut self.history;
        jacobian.resize(self.sparsity.nonzeros(), 0.0);
        (*scale, *steps, next.steps) = (f64::NAN, 0, 0);
        self.at.copy_from_slice(x);
        self.rates_at.copy_from_slice(&last.rates);
        let mut values = std::mem::take(jacobian);
        for group in 0..self.groups.len() {
            // Where there are no derivatives, or no rates beside the state, they stay as they are.
            let _ = self.find(system, (t, h), group, &mut values);
        }
        self.history.jacobian = values;
    }

    /// From now on a Jacobian at this state is found, unless one is.
    fn want_next(&mut self, x: &[f64]) {
        let next = &mut self.history.next;
        if next.steps == 0 {
            next.steps = steps_to_find(self.groups.len()).unwrap_or(1);
            next.at.copy_from_slice(x);
        }
    }

    /// Finds some columns of the Jacobian that is to follow, which takes the place of the present one where it is whole.
    fn find_some(&mut self, system: &mut dyn System, (t, h): (f64, f64)) {
        let next = &mut self.history.next;
        let (left, all) = (next.steps, steps_to_find(self.groups.len()).unwrap_or(1));
        if left == 0 {
            return;
        }
        self.at.copy_from_slice(&next.at);
        let mut values = std::mem::take(&mut next.jacobian);
        let begun = !system.compares_rates() || system.rates(t, &self.at, &mut self.rates_at).is_ok();
        let end_of = |step: usize| (step * self.groups.len()).div_ceil(all);
        let found = begun
            && (end_of(all - left)..end_of(all - left + 1)).all(|group| self.find(system, (t, h), group, &mut values));
        let History { jacobian, next, scale, steps, .. } = &mut self.history;
        next.jacobian = values;
        next.steps = if found { left - 1 } else { 0 };
        if found && next.steps == 0 {
            std::mem::swap(jacobian, &mut next.jacobian);
            (*scale, *steps) = (f64::NAN, 0);
        }
    }

    /// Finds a group of columns at the state `self.at`. Whether there were derivatives, or rates beside it.
    fn find(&mut self, system: &mut dyn System, (t, h): (f64, f64), group: usize, values: &mut [f64]) -> bool {
        let LinearlyImplicitBdf2 { groups, sparsity, point, rates, at, rates_at, .. } = self;
        let group = &groups[group];
        let compares = system.compares_rates();
        let found = if compares {
            point.copy_from_slice(at);
            for &column in group {
                let size = at[column].abs().max((h * rates_at[column]).abs());
                // Away from zero, so that what is the mirror image of something is compared on its mirror image.
                let beside = BESIDE * size.max(known_size(system, column));
                point[column] += if at[column] < 0.0 { -beside } else { beside };
            }
            system.rates(t, point, rates)
        } else {
            point.fill(0.0);
            group.iter().for_each(|&column| point[column] = 1.0);
            system.directional_derivative(t, at, point, rates)
        };
        if found.is_err() {
            return false;
        }
        for &column in group {
            for (place, &row) in sparsity.places(column).zip(sparsity.column(column)) {
                values[place] = match compares {
                    true => (rates[row] - rates_at[row]) / (point[column] - at[column]),
                    false => rates[row],
                };
            }
        }
        true
    }

    /// What has become of the Jacobian along the rates.
    fn change(&mut self, system: &mut dyn System, (t, h): (f64, f64), x: &[f64]) -> Change {
        let LinearlyImplicitBdf2 { history, point, rates, way, matrix, .. } = self;
        let History { last, jacobian, scale, .. } = &*history;
        if !self.factored && (scale.is_nan() || matrix.factor_values(system, t, jacobian, *scale).is_err()) {
            return Change::Much;
        }
        self.factored = true;
        (0..x.len()).for_each(|i| way[i] = h * last.rates[i]);
        let compares = system.compares_rates();
        let found = if compares {
            (0..x.len()).for_each(|i| point[i] = x[i] + ALONG * way[i]);
            let found = system.rates(t, point, rates);
            (0..x.len()).for_each(|i| rates[i] = (rates[i] - last.rates[i]) / ALONG);
            found
        } else {
            system.directional_derivative(t, x, way, rates)
        };
        if found.is_err() {
            return Change::Much;
        }
        // Beside what moves a state, where that is another one by a part of all that pushes and pulls.
        point.fill(0.0);
        for ((row, column), value) in self.sparsity.entries().zip(jacobian) {
            let term = value * way[column];
            rates[row] -= term;
            point[row] += term.abs();
        }
        for (rate, pushed) in rates.iter_mut().zip(point.iter_mut()) {
            *pushed = f64::from(rate.abs() > MUCH * *pushed);
            *rate *= scale;
        }
        matrix.solve(rates);
        let mut change = Change::Little;
        for i in 0..x.len() {
            // Exact derivatives need no size: what is 0 is 0 in them.
            let size = x[i].abs().max(if compares { known_size(system, i) } else { 0.0 });
            let (other, counts) = (rates[i].abs(), way[i].abs().max(SEEN * size));
            if other <= CHANGED * counts {
                continue;
            }
            if !other.is_finite() || (other > MUCH * size && point[i] != 0.0) {
                return Change::Much;
            }
            change = Change::Some;
        }
        change
    }

    /// Whether the end of a step is far from where the one before leads. `end` has what is added to that.
    fn is_doubtful(&self, x: &[f64], end: &[f64]) -> bool {
        let far = |i: usize| end[i].abs() > OTHER * self.move_on[i].abs() && end[i].abs() > MUCH * x[i].abs();
        !(0..x.len()).all(|i| end[i].is_finite() && !far(i))
    }

    /// Solves for the end of the step; where that is doubtful, once more with a new Jacobian.
    fn solve(
        &mut self,
        system: &mut dyn System,
        (t, h): (f64, f64),
        x: &[f64],
        end: &mut [f64],
    ) -> Result<(), Failure> {
        let before = &self.history.before;
        let ratio = h / before.length;
        if before.ends_at(t) && ratio <= LONGEST {
            self.solve_on(system, (t, h), ratio, x, end)?;
            if self.is_doubtful(x, end) && self.look(system, (t, h), x) {
                return self.begin(system, (t, h), 1, x, end);
            }
            (0..x.len()).for_each(|i| end[i] = x[i] + (self.move_on[i] + end[i]));
            return Ok(());
        }
        self.begin(system, (t, h), 2, x, end)
    }

    /// Solves for the end of a step without one before it: of order 1, or of order 2.
    fn begin(
        &mut self,
        system: &mut dyn System,
        (t, h): (f64, f64),
        order: u32,
        x: &[f64],
        end: &mut [f64],
    ) -> Result<(), Failure> {
        self.factor(system, t, h)?;
        let LinearlyImplicitBdf2 { history, matrix, point, rates, way, .. } = self;
        system.rates(t + h, x, rates)?;
        (0..x.len()).for_each(|i| way[i] = h * rates[i]);
        matrix.solve(way);
        (0..x.len()).for_each(|i| end[i] = x[i] + way[i]);
        let beyond = if order == 2 { system.rates(t + h, end, point) } else { return Ok(()) };
        if beyond.is_ok() {
            for i in 0..x.len() {
                point[i] = h * (point[i] - (rates[i] - history.last.rates[i])) - 2.0 * way[i];
            }
            matrix.solve(point);
            (0..x.len()).for_each(|i| end[i] = x[i] + (1.5 * way[i] + 0.5 * point[i]));
        }
        Ok(())
    }

    /// What is added to the move that goes on as the step before did.
    fn solve_on(
        &mut self,
        system: &mut dyn System,
        (t, h): (f64, f64),
        ratio: f64,
        x: &[f64],
        end: &mut [f64],
    ) -> Result<(), Failure> {
        let own = (1.0 + 2.0 * ratio) / (1.0 + ratio);
        self.factor(system, t, h / own)?;
        let History { before, last, .. } = &self.history;
        for i in 0..x.len() {
            self.move_on[i] = ratio * (x[i] - before.from[i]);
            let rates = (1.0 + ratio) * last.rates[i] - ratio * before.rates[i];
            end[i] = (h * rates - self.move_on[i]) / own;
        }
        self.matrix.solve(end);
        Ok(())
    }

    /// Factors the matrix for a multiple of the Jacobian, unless it has been.
    fn factor(&mut self, system: &dyn System, t: f64, wanted: f64) -> Result<(), Failure> {
        let History { jacobian, scale, .. } = &mut self.history;
        let serves = (*scale - wanted).abs() <= ROUNDING * wanted;
        if !serves {
            (*scale, self.factored) = (wanted, false);
        }
        if !self.factored {
            self.matrix.factor_values(system, t, jacobian, *scale)?;
            self.factored = true;
        }
        Ok(())
    }
}

/// The size of a state as far as it is known. That of a speed that is 0 may be rounding.
fn known_size(system: &dyn System, state: usize) -> f64 {
    let known = system.scales()[state];
    if known > 0.0 { known.max(LEAST) } else { UNKNOWN }
}
