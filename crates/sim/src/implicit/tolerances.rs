//! How exact each unknown of a system in implicit form has to be.

use crate::{AbsoluteTolerance, Failure, ImplicitSystem, Options};

/// Absolute tolerance relative to the magnitude of an unknown, as a part of the relative one.
const SHARE: f64 = 1e-3;

/// Absolute tolerance relative to the magnitude of an unknown below which rounding would be mistaken for error.
const ROUNDING: f64 = 1e-15;

/// Part of the greatest unknown of its sort that is not told apart in any of them: its last digit.
const BESIDE: f64 = 2e-16;

/// Part of what its equations balance below which an unknown does not count.
const NOISE: f64 = 1e-12;

/// Part of what its equations balance that an unknown of which nothing else is known is taken to have.
const GUESS: f64 = 1e-3;

/// Part of the time in which known unknowns would change altogether over which unknown ones are let grow.
const SHORT: f64 = 0.01;

/// Part of the way to the next stop over which they are let grow at most.
const PART: f64 = 1e-3;

/// A magnitude is rounding where what the rates make of its unknown in a short time is beyond it by so many times.
const LEFT: f64 = 1e-6;

/// By how much magnitudes have to grow for tolerances to be taken anew.
const GROWTH: f64 = 10.0;

/// Relative and absolute tolerances.
pub(super) struct Tolerances {
    relative: f64,
    /// Given by the user; `None` if they are scaled.
    given: Option<Vec<f64>>,
    /// Magnitude of each unknown, which grows with it; 0 where it is not known yet.
    magnitudes: Vec<f64>,
    absolute: Vec<f64>,
    /// What sort each unknown is of, and the greatest magnitude of each sort.
    sorts: Vec<usize>,
    greatest: Vec<f64>,
    /// Whether magnitudes were looked at for rounding.
    looked: bool,
}

impl Tolerances {
    /// Those of a run of `system` from `t` on, where it stands.
    ///
    /// # Errors
    /// What the system reports.
    pub(super) fn new(options: &Options, t: f64, system: &mut dyn ImplicitSystem) -> Result<Tolerances, Failure> {
        let size = system.unknowns();
        let given = match &options.atol {
            AbsoluteTolerance::Scaled => None,
            AbsoluteTolerance::Same(atol) => Some(vec![*atol; size]),
            AbsoluteTolerance::Each(atol) => Some(atol.clone()),
        };
        let absolute = given.clone().unwrap_or(vec![0.0; size]);
        let magnitudes = system.scales(t, options.to - t)?;
        let sorts = system.sorts();
        let greatest = vec![0.0; sorts.iter().max().map_or(0, |most| most + 1)];
        Ok(Tolerances { relative: options.rtol, given, magnitudes, absolute, sorts, greatest, looked: false })
    }

    /// The relative one.
    pub(super) fn relative(&self) -> f64 {
        self.relative
    }

    /// One for each unknown.
    pub(super) fn absolute(&self) -> &[f64] {
        &self.absolute
    }

    /// Magnitude of each unknown; 0 where it is not known.
    pub(super) fn magnitudes(&self) -> &[f64] {
        &self.magnitudes
    }

    /// Takes notice of values reached. `true` if a tolerance is another one now.
    pub(super) fn watch(&mut self, y: &[f64]) -> bool {
        if self.given.is_some() {
            return false;
        }
        let mut changed = false;
        let share = (SHARE * self.relative).max(ROUNDING).min(self.relative);
        self.greatest.fill(0.0);
        for ((magnitude, y), &sort) in self.magnitudes.iter_mut().zip(y).zip(&self.sorts) {
            *magnitude = magnitude.max(y.abs());
            self.greatest[sort] = self.greatest[sort].max(*magnitude);
        }
        // The forces across a car that drives straight on are no more than what rounding of those along it leaves, and have no
        // digits of their own.
        for ((magnitude, absolute), &sort) in self.magnitudes.iter().zip(&mut self.absolute).zip(&self.sorts) {
            let least = (BESIDE * self.greatest[sort]).max(f64::MIN_POSITIVE);
            let before = std::mem::replace(absolute, (share * magnitude).max(least));
            changed |= before != *absolute;
        }
        changed
    }

    /// Root of the mean square of `v`, each component relative to what is allowed at `y`.
    pub(super) fn norm(&self, v: &[f64], y: &[f64]) -> f64 {
        let allowed = |i: usize| self.relative * y[i].abs() + self.absolute[i];
        let parts = v.iter().enumerate().map(|(i, v)| v / allowed(i));
        (parts.map(|part| part * part).sum::<f64>() / v.len().max(1) as f64).sqrt()
    }

    /// Guesses the magnitudes that are not known where the system stands at `(t, y, y')`, `interval` s before the next stop:
    /// as what a short step of the implicit rule of Euler makes of them. A low guess costs steps, a high one accuracy.
    ///
    /// # Errors
    /// What the system reports.
    pub(super) fn guess(
        &mut self,
        system: &mut dyn ImplicitSystem,
        t: f64,
        (y, yp): (&[f64], &[f64]),
        interval: f64,
    ) -> Result<(), Failure> {
        // What is there may be rounding, and then its time would be as well: what is known besides comes first.
        let told = !self.looked && self.magnitudes.iter().any(|&magnitude| magnitude > 0.0);
        if !told {
            self.watch(y);
        }
        let time = self.short_time(yp, interval);
        let looked = std::mem::replace(&mut self.looked, true);
        if self.given.is_some() || (looked && self.magnitudes.iter().all(|&magnitude| magnitude > 0.0)) {
            return Ok(());
        }
        let entries = system.sparsity().nonzeros();
        let (mut dy, mut dyp) = (vec![0.0; entries], vec![0.0; entries]);
        system.jacobian(t, y, yp, &mut dy, &mut dyp)?;
        let matrix: Vec<f64> = dy.iter().zip(&dyp).map(|(dy, dyp)| dyp / time + dy).collect();
        if !told {
            self.silence(system, &matrix);
        }
        if self.magnitudes.iter().all(|&magnitude| magnitude > 0.0) {
            self.watch(y);
            return Ok(());
        }
        let grown = grown(system, t + time, y, &matrix);
        let unknown: Vec<usize> = (0..y.len()).filter(|&i| self.magnitudes[i] == 0.0).collect();
        if told {
            self.spread(system, &matrix);
            // An equation in which an unknown hardly counts tells it too great.
            let balanced = self.balanced(system, &matrix);
            for &i in unknown.iter().filter(|&&i| balanced[i] > 0.0) {
                self.magnitudes[i] = self.magnitudes[i].min(balanced[i]);
            }
        }
        unknown.iter().for_each(|&i| self.magnitudes[i] = self.magnitudes[i].max(grown[i]));
        self.spread(system, &matrix);
        // What grew may be rounding: never less than a part of what the equations balance.
        let balanced = self.balanced(system, &matrix);
        unknown.iter().for_each(|&i| self.magnitudes[i] = grown[i].max(GUESS * balanced[i]));
        self.watch(y);
        Ok(())
    }

    /// Takes magnitudes anew where the system stands at `(t, y, y')` and no step is short enough: what its rates leave behind at
    /// once was rounding, as where an event moves what stood still. `true` if any has grown by far.
    ///
    /// # Errors
    /// What the system reports.
    pub(super) fn renew(
        &mut self,
        system: &mut dyn ImplicitSystem,
        t: f64,
        (y, yp): (&[f64], &[f64]),
        interval: f64,
    ) -> Result<bool, Failure> {
        if self.given.is_some() {
            return Ok(false);
        }
        let before = self.magnitudes.clone();
        let left = |magnitude: f64, rate: f64| magnitude < LEFT * PART * interval * rate.abs();
        let noise = self.magnitudes.iter_mut().zip(yp).filter(|(magnitude, rate)| left(**magnitude, **rate));
        noise.for_each(|(magnitude, _)| *magnitude = 0.0);
        self.looked = false;
        self.guess(system, t, (y, yp), interval)?;
        self.magnitudes.iter_mut().zip(&before).for_each(|(now, before)| *now = now.max(*before));
        self.watch(y);
        Ok(self.magnitudes.iter().zip(&before).any(|(now, before)| *now > GROWTH * before))
    }

    /// Gives what is still not known what its equations balance, one equation further at a time.
    fn spread(&mut self, system: &dyn ImplicitSystem, matrix: &[f64]) {
        let unknown: Vec<usize> = (0..self.magnitudes.len()).filter(|&i| self.magnitudes[i] == 0.0).collect();
        for _ in 0..unknown.len() {
            let (before, balanced) = (self.magnitudes.clone(), self.balanced(system, matrix));
            let free = unknown.iter().filter(|&&i| before[i] == 0.0);
            free.for_each(|&i| self.magnitudes[i] = balanced[i]);
            if self.magnitudes == before {
                break;
            }
        }
    }

    /// A time in which what is known changes little.
    fn short_time(&self, yp: &[f64], interval: f64) -> f64 {
        let times = self.magnitudes.iter().zip(yp).map(|(magnitude, rate)| magnitude / rate.abs());
        let shortest = times.filter(|time| *time > 0.0 && time.is_finite()).fold(f64::INFINITY, f64::min);
        (SHORT * shortest).min(PART * interval)
    }

    /// Forgets magnitudes that are mere rounding of what their equations balance.
    fn silence(&mut self, system: &dyn ImplicitSystem, matrix: &[f64]) {
        let balanced = self.balanced(system, matrix);
        let noise = |(magnitude, balanced): (&mut f64, f64)| {
            if *magnitude < NOISE * balanced {
                *magnitude = 0.0;
            }
        };
        self.magnitudes.iter_mut().zip(balanced).for_each(noise);
    }

    /// The value of each unknown at which it would balance the other known terms of one of its equations: the least of them;
    /// 0 if none has any.
    fn balanced(&self, system: &dyn ImplicitSystem, matrix: &[f64]) -> Vec<f64> {
        // The two greatest terms of each equation, the first with its unknown.
        let mut sizes = vec![(0.0_f64, 0, 0.0_f64); self.magnitudes.len()];
        for ((row, column), entry) in system.sparsity().entries().zip(matrix) {
            let (size, (first, _, second)) = (entry.abs() * self.magnitudes[column], sizes[row]);
            match size > first {
                true => sizes[row] = (size, column, first),
                false => sizes[row].2 = second.max(size),
            }
        }
        let mut balanced = vec![f64::INFINITY; sizes.len()];
        for ((row, column), entry) in system.sparsity().entries().zip(matrix).filter(|(_, entry)| **entry != 0.0) {
            let (first, greatest, second) = sizes[row];
            let value = if greatest == column { second } else { first } / entry.abs();
            balanced[column] = if value > 0.0 { balanced[column].min(value) } else { balanced[column] };
        }
        // Where a slope is infinite, the other equations tell nothing of the unknown's size.
        let steep = system.sparsity().entries().zip(matrix).filter(|(_, entry)| !entry.is_finite());
        steep.for_each(|((_, column), _)| balanced[column] = 0.0);
        balanced.iter_mut().filter(|value| value.is_infinite()).for_each(|value| *value = 0.0);
        balanced
    }
}

/// How far a step of the implicit rule of Euler moves each unknown; 0 where that cannot be had.
fn grown(system: &mut dyn ImplicitSystem, t: f64, y: &[f64], matrix: &[f64]) -> Vec<f64> {
    let mut change = vec![0.0; y.len()];
    if system.residual(t, y, &vec![0.0; y.len()], &mut change).is_err() {
        return vec![0.0; y.len()];
    }
    if !crate::radau::solve(system.sparsity(), matrix, &mut change) {
        return vec![0.0; y.len()];
    }
    change.iter().map(|change| if change.is_finite() { change.abs() } else { 0.0 }).collect()
}
