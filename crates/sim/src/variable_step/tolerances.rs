//! How exact each state has to be.

use super::magnitudes::guess_magnitudes;
use crate::{AbsoluteTolerance, Failure, Options, System};

/// Growth of a state beyond its magnitude after which the tolerances are taken anew.
const GROWTH: f64 = 10.0;

/// Absolute tolerance relative to the magnitude of a state, as a part of the relative one: states that shrink by as much
/// keep their digits.
const SHARE: f64 = 1e-3;

/// Absolute tolerance relative to the magnitude of a state below which rounding would be mistaken for error.
const ROUNDING: f64 = 1e-12;

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
        Tolerances { relative: options.rtol, given, magnitudes, greatest, looked: false }
    }

    /// The relative one.
    pub(super) fn relative(&self) -> f64 {
        self.relative
    }

    /// One for each state.
    pub(super) fn absolute(&self) -> Vec<f64> {
        let scaled = || self.magnitudes.iter().map(|magnitude| self.share() * magnitude).collect();
        self.given.clone().unwrap_or_else(scaled)
    }

    /// Absolute tolerance of a state of magnitude 1.
    fn share(&self) -> f64 {
        (SHARE * self.relative).max(ROUNDING).min(self.relative)
    }

    /// Root of the mean square of `v`, each component relative to what is allowed at `x`.
    pub(super) fn norm(&self, v: &[f64], x: &[f64]) -> f64 {
        let allowed = |i: usize| match &self.given {
            Some(given) => self.relative * x[i].abs() + given[i],
            None => self.relative * x[i].abs() + self.share() * self.magnitudes[i],
        };
        let parts = v.iter().enumerate().map(|(i, v)| v / allowed(i));
        let sum: f64 = parts.map(|part| part * part).sum();
        (sum / v.len().max(1) as f64).sqrt()
    }

    /// Magnitude of each state.
    pub(super) fn magnitudes(&self) -> &[f64] {
        &self.magnitudes
    }

    /// Takes notice of a state reached. `true` if the tolerances should be taken anew.
    pub(super) fn watch(&mut self, x: &[f64]) -> bool {
        self.greatest.iter_mut().zip(x).for_each(|(greatest, x)| *greatest = greatest.max(x.abs()));
        let mut grown = self.greatest.iter().zip(&self.magnitudes).map(|(greatest, magnitude)| greatest / magnitude);
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
        self.magnitudes.iter_mut().zip(&before).for_each(|(magnitude, before)| *magnitude = magnitude.max(*before));
        guessed.map(|()| self.magnitudes != before)
    }

    /// Takes the greatest values so far for the magnitudes where they are larger.
    pub(super) fn grow(&mut self) {
        self.magnitudes
            .iter_mut()
            .zip(&self.greatest)
            .for_each(|(magnitude, greatest)| *magnitude = magnitude.max(*greatest));
    }
}
