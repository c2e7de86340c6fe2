//! Runs of one form at tighter and tighter tolerances: what an error costs.

use std::time::Duration;

use halfarrow_sim::Method;

use super::reference::Reference;
use super::subject::{Settings, Subject, is_over};
use crate::clock::Moment;

/// Loosest and tightest power of ten of the tolerances.
const RTOLS: std::ops::RangeInclusive<i32> = 2..=12;
/// A ladder goes on until the error is this part of what is asked.
const BEYOND: f64 = 0.05;
/// Runs shorter than this are repeated until they take as long together, so that a median means something.
const SHORT: Duration = Duration::from_millis(2);
/// Runs longer than this are repeated less often.
const LONG: Duration = Duration::from_millis(300);

/// One run: with what, how exact, how costly.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rung {
    pub method: Method,
    pub rtol: f64,
    /// Form `stiff`: stiffness of the springs.
    pub stiffness: Option<f64>,
    /// Greatest error of the motion.
    pub error: f64,
    /// Median of processor time for each simulated second.
    pub seconds: f64,
    /// Processor time of the first run.
    pub single: Duration,
    pub steps: usize,
    pub evaluations: usize,
}

/// How much is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Effort {
    /// The error that is asked for.
    pub error: f64,
    /// A run that takes longer ends its ladder; one that takes [`LONGEST`] times as long is given up.
    pub patience: Duration,
    /// When measuring this form ends.
    pub until: Option<Moment>,
}

/// A run is given up after so many times the patience.
pub(super) const LONGEST: u32 = 3;

impl Effort {
    /// When a run that begins now is given up.
    pub fn run_until(&self) -> Option<Moment> {
        let own = Moment::now() + LONGEST * self.patience;
        Some(self.until.map_or(own, |until| until.min(own)))
    }
}

/// The ladder of a form with a method, timed once, and whether a run of it was given up. `go_on` is asked before every run.
pub(super) fn ladder(
    subject: &Subject,
    reference: &Reference,
    method: Method,
    effort: Effort,
    go_on: &mut dyn FnMut() -> bool,
) -> (Vec<Rung>, bool) {
    let (mut rungs, mut given_up): (Vec<Rung>, bool) = (Vec::new(), false);
    for power in RTOLS {
        if !go_on() || is_over(effort.until) {
            break;
        }
        let settings = Settings { method, rtol: ten_to(-power), to: reference.to, until: effort.run_until() };
        let Some(rung) = rung(subject, reference, settings) else {
            given_up = is_over(settings.until);
            if given_up {
                break;
            }
            continue;
        };
        let enough = rung.error <= BEYOND * effort.error && rungs.len() > 1;
        let slow = rung.single > effort.patience;
        rungs.push(rung);
        if enough || slow {
            break;
        }
    }
    (rungs, given_up)
}

/// One run of a ladder, timed once; `None` if it stops before its end.
pub(super) fn rung(subject: &Subject, reference: &Reference, settings: Settings) -> Option<Rung> {
    let error = error_of(subject, reference, settings)?;
    let (single, summary) = subject.timed(settings).ok()?;
    Some(Rung {
        method: settings.method,
        rtol: settings.rtol,
        stiffness: None,
        error,
        seconds: single.as_secs_f64() / reference.to,
        single,
        steps: summary.steps,
        evaluations: summary.rates,
    })
}

/// Times all rungs in turn, again and again, so that a machine that gets slower for a while is so for all of them; medians.
pub(super) fn time(
    rungs: &mut [(Rung, &Subject)],
    to: f64,
    repeats: usize,
    until: Option<Moment>,
    go_on: &mut dyn FnMut(f64) -> bool,
) {
    let mut times: Vec<Vec<f64>> = vec![Vec::with_capacity(repeats); rungs.len()];
    for round in 0..repeats {
        if !go_on(round as f64 / repeats as f64) {
            break;
        }
        for ((rung, subject), times) in rungs.iter().zip(&mut times) {
            if rung.single > LONG && round >= 2 || is_over(until) {
                continue;
            }
            let settings = Settings { method: rung.method, rtol: rung.rtol, to, until };
            let batch = (SHORT.as_secs_f64() / rung.single.as_secs_f64().max(1e-7)).ceil().clamp(1.0, 1000.0) as usize;
            let runs = (0..batch).map_while(|_| subject.timed(settings).ok());
            let taken: Vec<f64> = runs.map(|(duration, _)| duration.as_secs_f64()).collect();
            if !taken.is_empty() {
                times.push(taken.iter().sum::<f64>() / taken.len() as f64);
            }
        }
    }
    for ((rung, _), times) in rungs.iter_mut().zip(times.iter_mut()) {
        // The first run of long ones counts as well.
        if rung.single > LONG {
            times.push(rung.single.as_secs_f64());
        }
        times.sort_by(f64::total_cmp);
        if let Some(median) = times.get(times.len() / 2) {
            rung.seconds = median / to;
        }
    }
}

/// The error of the motion; `None` if the run stops before its end.
pub(super) fn error_of(subject: &Subject, reference: &Reference, settings: Settings) -> Option<f64> {
    let variables = subject.variables();
    let names = reference.motion(&variables);
    let trace = subject.sampled(settings, reference.to / super::reference::POINTS, &names).ok()?;
    Some(reference.apart(&trace, true).value)
}

/// The runs that no other beats in both error and time, the least exact first.
pub(super) fn front(rungs: &[Rung]) -> Vec<&Rung> {
    let mut sorted: Vec<&Rung> = rungs.iter().filter(|r| r.error.is_finite()).collect();
    sorted.sort_by(|a, b| a.seconds.total_cmp(&b.seconds).then(a.error.total_cmp(&b.error)));
    let mut front: Vec<&Rung> = Vec::new();
    for rung in sorted {
        if front.last().is_none_or(|last| rung.error < last.error) {
            front.push(rung);
        }
    }
    front
}

/// What the error costs, in s for each simulated second: between two runs of the front by a straight line in logarithms.
/// The cheaper of these two and the more exact one come with it. `None` if no run is as exact.
pub(super) fn cost_at(rungs: &[Rung], error: f64) -> Option<(f64, Rung)> {
    let front = front(rungs);
    let good = front.iter().position(|r| r.error <= error)?;
    let exact = front[good];
    let Some(rough) = good.checked_sub(1).map(|before| front[before]) else {
        return Some((exact.seconds, exact.clone()));
    };
    let [log_error, log_exact, log_rough] = [error, exact.error.max(1e-300), rough.error].map(libm::log);
    let part = (log_error - log_rough) / (log_exact - log_rough);
    let [fast, slow] = [rough.seconds, exact.seconds].map(libm::log);
    Some((libm::exp(fast + part * (slow - fast)), exact.clone()))
}

/// The order of convergence: the slope of a straight line through logarithms of stiffness and error, by least squares.
pub(super) fn order(points: &[(f64, f64)]) -> Option<f64> {
    if points.len() < 2 {
        return None;
    }
    let logs: Vec<[f64; 2]> = points.iter().map(|p| [libm::log(p.0), libm::log(p.1)]).collect();
    let count = logs.len() as f64;
    let mean = |k: usize| logs.iter().map(|p| p[k]).sum::<f64>() / count;
    let (x, y) = (mean(0), mean(1));
    let products: f64 = logs.iter().map(|p| (p[0] - x) * (p[1] - y)).sum();
    let squares: f64 = logs.iter().map(|p| (p[0] - x) * (p[0] - x)).sum();
    Some(-products / squares)
}

/// Ten to a power, correctly rounded.
pub(super) fn ten_to(power: i32) -> f64 {
    format!("1e{power}").parse().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rung(error: f64, seconds: f64) -> Rung {
        let single = Duration::ZERO;
        Rung { method: Method::Radau, rtol: error, stiffness: None, error, seconds, single, steps: 0, evaluations: 0 }
    }

    #[test]
    fn the_cost_of_an_error_lies_between_its_neighbours() {
        let rungs = [rung(1e-4, 1.0), rung(1e-8, 100.0), rung(1e-5, 200.0)];
        let (cost, exact) = cost_at(&rungs, 1e-6).expect("a cost");
        assert!((cost - 10.0).abs() < 1e-9 && exact.error == 1e-8, "{cost}");
        assert_eq!(cost_at(&rungs, 1e-3).expect("a cost").0, 1.0);
        assert!(cost_at(&rungs, 1e-9).is_none());
    }

    #[test]
    fn the_order_is_the_slope() {
        let points = [1e2, 1e3, 1e4].map(|k: f64| (k, 3.0 / k));
        assert!((order(&points).expect("an order") - 1.0).abs() < 1e-12);
        assert!(order(&points[..1]).is_none());
    }
}
