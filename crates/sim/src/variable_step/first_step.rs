//! The length of the first step after a start or a jump.

use super::tolerances::Tolerances;
use crate::{Failure, System};

/// A state that changes by itself in this part of the time is zero but for rounding.
const LEAST: f64 = 4.0 * f64::EPSILON;
/// Times the trial step is shortened tenfold because the system fails there.
const MOST_TRIALS: usize = 30;

/// A first step for a method of order `order` from `(t, x)`, at most `longest`, and writes the rates there to `rates`.
/// Source: [HNW], II.4, "Starting step size".
pub(super) fn first_step(
    system: &mut dyn System,
    tolerances: &Tolerances,
    order: usize,
    t: f64,
    x: &[f64],
    longest: f64,
    rates: &mut [f64],
) -> Result<f64, Failure> {
    system.rates(t, x, rates)?;
    if x.is_empty() {
        return Ok(longest);
    }
    let (size, speed) = (tolerances.norm(x, x), tolerances.norm(rates, x));
    // A state that is zero but for rounding says nothing about the time in which it changes.
    let unknown = size < 1e-5 || speed < 1e-5 || size / speed <= LEAST * t.abs();
    let mut trial = if unknown { 1e-6 * longest } else { 0.01 * size / speed }.min(longest);
    for _ in 0..MOST_TRIALS {
        if let Some(bend) = bend(system, tolerances, t, x, trial, rates) {
            let sharpest = speed.max(bend);
            let root = 1.0 / (order as f64 + 1.0);
            let step =
                if sharpest <= 1e-15 { (trial * 1e-3).max(1e-6 * longest) } else { libm::pow(0.01 / sharpest, root) };
            return Ok(step.min(100.0 * trial).min(longest));
        }
        trial /= 10.0;
    }
    Ok(trial)
}

/// Size of the second derivative over a trial step; `None` if the system fails there.
fn bend(system: &mut dyn System, tolerances: &Tolerances, t: f64, x: &[f64], trial: f64, rates: &[f64]) -> Option<f64> {
    let end: Vec<f64> = x.iter().zip(rates).map(|(x, rate)| x + trial * rate).collect();
    let mut change = vec![0.0; x.len()];
    system.rates(t + trial, &end, &mut change).ok()?;
    change.iter_mut().zip(rates).for_each(|(change, rate)| *change -= rate);
    Some(tolerances.norm(&change, x) / trial).filter(|bend| bend.is_finite())
}

/// Parts of the time to the next event at which rates are looked at.
const INSIDE: [f64; 3] = [0.23, 0.5, 0.81];
/// A step longer than this part of it may miss what happens there.
const LONG: f64 = 0.1;
/// What such a step is shortened to.
const SHORT: f64 = 0.02;

/// A shorter step from `(t, x)` than `step`, where the next event is `longest` away, for a method that sees only the ends of its
/// steps: where time alone makes more of the rates inside than both ends tell, as a pulse between two events does that begins and
/// ends at 0.
pub(super) fn seeing_inside(
    system: &mut dyn System,
    tolerances: &Tolerances,
    (t, x): (f64, &[f64]),
    step: f64,
    longest: f64,
) -> Option<f64> {
    if step <= LONG * longest || x.is_empty() {
        return None;
    }
    let mut at = |part: f64| {
        let mut rates = vec![0.0; x.len()];
        system.rates(t + part * longest, x, &mut rates).ok().map(|()| rates)
    };
    let (Some(begin), Some(end)) = (at(0.0), at(1.0)) else { return None };
    let hides = INSIDE.into_iter().any(|part| {
        let Some(mut inside) = at(part) else { return true };
        let straight = begin.iter().zip(&end).map(|(begin, end)| begin + part * (end - begin));
        inside.iter_mut().zip(straight).for_each(|(rate, straight)| *rate -= straight);
        let most = tolerances.norm(&inside, x) * longest;
        most.is_nan() || most > 1.0
    });
    hides.then_some(SHORT * longest)
}
