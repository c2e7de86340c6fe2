//! How exact each state has to be.

use super::magnitudes::{guess_magnitudes, surroundings};
use super::rounding::rounding;
use crate::{AbsoluteTolerance, Failure, Options, System};

/// Growth of a state beyond its magnitude after which the tolerances are taken anew.
const GROWTH: f64 = 10.0;

/// Absolute tolerance relative to the magnitude of a state, as a part of the relative one: states that shrink by as much
/// keep their digits. One part at all tolerances, so that the work follows what is asked.
const SHARE: f64 = 1e-3;

/// Absolute tolerance relative to the magnitude of a state below which rounding would be mistaken for error.
const ROUNDING: f64 = 1e-15;

/// How far the error allowed in a step is above what rounding makes of it.
const CLEAR: f64 = 10.0;

/// What others leave unknown of a state, as part of its magnitude, from which on the state is itself made of rounding. Below it what
/// they do is told from rounding, as where a machine passes a position in which rates are rounding for a moment.
const NOISE: f64 = 1e-5;

/// Part of the way to the next jump at which rounding is looked for where a state has no magnitude yet: sources may grow.
const AHEAD: f64 = 0.1;

/// A magnitude that rates leave behind at once was noise: this part of what they make of the state.
const LEFT: f64 = 1e-6;

/// Magnitude of a state of which nothing is known. Small enough not to hide anything, large enough to divide by.
const UNKNOWN: f64 = 1e-100;

/// Relative and absolute tolerances of a variable-step method.
#[derive(Clone)]
pub(super) struct Tolerances {
    relative: f64,
    /// Given by the user; `None` if it is scaled.
    given: Option<Vec<f64>>,
    /// Magnitude of each state.
    magnitudes: Vec<f64>,
    /// Greatest absolute value of each state so far.
    greatest: Vec<f64>,
    /// Whether magnitudes were looked at for noise.
    looked: bool,
    /// What rounding of the rates makes of each state, as far as it was looked for: no error below it counts.
    floors: Vec<f64>,
}

impl Tolerances {
    /// Those of a run that starts at `x`.
    pub(super) fn new(options: &Options, system: &dyn System, x: &[f64]) -> Tolerances {
        let given = match &options.atol {
            AbsoluteTolerance::Scaled => None,
            AbsoluteTolerance::Same(atol) => Some(vec![*atol; x.len()]),
            AbsoluteTolerance::Each(atol) => Some(atol.clone()),
        };
        let greatest: Vec<f64> = x.iter().map(|x| x.abs()).collect();
        let mut magnitudes: Vec<f64> = greatest.iter().zip(system.scales()).map(|(x, scale)| x.max(*scale)).collect();
        magnitudes.iter_mut().for_each(|magnitude| *magnitude = magnitude.max(UNKNOWN));
        Tolerances { relative: options.rtol, given, magnitudes, greatest, looked: false, floors: vec![0.0; x.len()] }
    }

    /// The relative one.
    pub(super) fn relative(&self) -> f64 {
        self.relative
    }

    /// One for each state, `tightened` times what the user asks for.
    pub(super) fn absolute(&self, tightened: f64) -> Vec<f64> {
        match &self.given {
            Some(given) => given.iter().map(|given| tightened * given).collect(),
            None => {
                let share = tightened * self.share();
                self.magnitudes.iter().zip(&self.floors).map(|(m, floor)| (share * m).max(*floor)).collect()
            }
        }
    }

    /// Absolute tolerance of a state of magnitude 1.
    fn share(&self) -> f64 {
        (SHARE * self.relative).max(ROUNDING).min(self.relative)
    }

    /// Root of the mean square of `v`, each component relative to what is allowed at `x`.
    pub(super) fn norm(&self, v: &[f64], x: &[f64]) -> f64 {
        let allowed = |i: usize| match &self.given {
            Some(given) => self.relative * x[i].abs() + given[i],
            None => self.relative * x[i].abs() + (self.share() * self.magnitudes[i]).max(self.floors[i]),
        };
        let parts = v.iter().enumerate().map(|(i, v)| v / allowed(i));
        let sum: f64 = parts.map(|part| part * part).sum();
        (sum / v.len().max(1) as f64).sqrt()
    }

    /// The component of `v` that is greatest relative to what is allowed at `x`.
    pub(super) fn greatest_part(&self, v: &[f64], x: &[f64]) -> usize {
        let absolute = self.absolute(1.0);
        let part = |i: usize| v[i].abs() / (self.relative * x[i].abs() + absolute[i]);
        (0..v.len()).fold(0, |most, i| if part(i) > part(most) { i } else { most })
    }

    /// Magnitude of each state.
    pub(super) fn magnitudes(&self) -> &[f64] {
        &self.magnitudes
    }

    /// Takes notice of a state reached. `true` if the tolerances should be taken anew.
    pub(super) fn watch(&mut self, x: &[f64]) -> bool {
        self.greatest.iter_mut().zip(x).for_each(|(greatest, x)| *greatest = greatest.max(x.abs()));
        let share = self.share();
        let counted = self.magnitudes.iter().zip(&self.floors).map(|(magnitude, floor)| magnitude.max(floor / share));
        let mut grown = self.greatest.iter().zip(counted).map(|(greatest, counted)| greatest / counted);
        self.given.is_none() && grown.any(|growth| growth > GROWTH)
    }

    /// Guesses the magnitudes that are not known where the system stands at `(t, x)`, `interval` s before the next jump.
    /// `true` if any is known now that was not.
    ///
    /// # Errors
    /// What the system reports.
    pub(super) fn guess(&mut self, system: &mut dyn System, t: f64, x: &[f64], interval: f64) -> Result<bool, Failure> {
        let looked = std::mem::replace(&mut self.looked, true);
        if self.given.is_some() || (looked && self.magnitudes.iter().all(|&magnitude| magnitude > UNKNOWN)) {
            return Ok(false);
        }
        let before = self.magnitudes.clone();
        self.magnitudes.iter_mut().filter(|magnitude| **magnitude == UNKNOWN).for_each(|magnitude| *magnitude = 0.0);
        let guessed = guess_magnitudes(system, (t, x), interval, &mut self.magnitudes);
        self.grow(system, t, x, interval);
        self.magnitudes.iter_mut().zip(&before).for_each(|(magnitude, before)| *magnitude = magnitude.max(*before));
        if !looked && self.has_unknown() {
            self.clear_rounding(system, (t, x), AHEAD * interval, interval);
            return guessed.map(|()| true);
        }
        guessed.map(|()| self.magnitudes != before)
    }

    /// Takes the greatest values so far for the magnitudes where they are larger, and what those around make of the others,
    /// where the system stands at `(t, x)`, `interval` s before the next jump.
    pub(super) fn grow(&mut self, system: &mut dyn System, t: f64, x: &[f64], interval: f64) {
        let raise = |magnitudes: &mut [f64], by: &[f64]| {
            magnitudes.iter_mut().zip(by).for_each(|(magnitude, by)| *magnitude = magnitude.max(*by));
        };
        raise(&mut self.magnitudes, &self.greatest);
        if let Some(couplings) = surroundings(system, (t, x), interval) {
            let least = couplings.least(&self.magnitudes);
            raise(&mut self.magnitudes, &least);
        }
    }

    /// Takes magnitudes anew where the system stands at `(t, x)`, as it is `later` s on, `interval` s before the next jump: what
    /// an event has moved is far beyond them, and what the rates leave behind at once was noise. `true` if any has grown by far.
    pub(super) fn renew(&mut self, system: &mut dyn System, (t, x): (f64, &[f64]), later: f64, interval: f64) -> bool {
        if self.given.is_some() {
            return false;
        }
        let before = self.magnitudes.clone();
        self.watch(x);
        self.magnitudes.iter_mut().zip(&self.greatest).for_each(|(m, greatest)| *m = m.max(*greatest));
        let mut rates = vec![0.0; x.len()];
        if system.rates(t + later, x, &mut rates).is_ok() {
            let noise = self.magnitudes.iter_mut().zip(&rates).filter(|(m, rate)| **m < LEFT * later * rate.abs());
            noise.for_each(|(m, _)| *m = 0.0);
        }
        if guess_magnitudes(system, (t + later, x), interval, &mut self.magnitudes).is_ok() {
            self.grow(system, t, x, interval);
        }
        self.magnitudes.iter_mut().zip(&before).for_each(|(m, before)| *m = m.max(*before));
        self.magnitudes.iter().zip(&before).any(|(m, before)| *m > GROWTH * before)
    }

    /// Whether nothing is known of a state: nothing has moved it, and nothing would.
    pub(super) fn has_unknown(&self) -> bool {
        self.given.is_none() && self.magnitudes.contains(&UNKNOWN)
    }

    /// Looks for what rounding of the rates makes of the states around `(t, x)` in steps of `h`, `interval` s before the next
    /// jump. `true` if errors were counted that are less: the tolerances should be taken anew.
    pub(super) fn clear_rounding(
        &mut self,
        system: &mut dyn System,
        (t, x): (f64, &[f64]),
        h: f64,
        interval: f64,
    ) -> bool {
        if self.given.is_some() {
            return false;
        }
        let Some(couplings) = surroundings(system, (t, x), interval) else { return false };
        let reach = couplings.shortest.max(h);
        let before = self.absolute(1.0);
        for time in [t, t + h] {
            // What becomes of states that have a magnitude is looked for again when they have it.
            let ahead = time > t;
            if ahead && !self.has_unknown() {
                break;
            }
            let Some(rounding) = rounding(system, time, x, &self.magnitudes) else { continue };
            let clear: Vec<f64> = rounding.iter().map(|rounding| CLEAR * reach * rounding).collect();
            let mut passed_on = clear.clone();
            couplings.pass_on(reach, &mut passed_on);
            for (state, (own, passed_on)) in clear.into_iter().zip(passed_on).enumerate() {
                let is_noise = passed_on > NOISE * self.magnitudes[state];
                let clear = if is_noise { passed_on } else { own };
                if clear.is_finite() && (!ahead || self.magnitudes[state] == UNKNOWN) {
                    self.floors[state] = self.floors[state].max(clear);
                }
            }
        }
        before.iter().zip(&self.floors).any(|(before, floor)| *floor > 2.0 * before)
    }
}
