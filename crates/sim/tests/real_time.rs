//! Runs against a clock, here one that the test moves.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use crate::systems;

use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::real_time::{Clock, Exchange, OnMiss, Pace, Statistics, run_real_time};
use halfarrow_sim::{Failure, System};
use systems::{Known, decay, hyperbola, stepped};

/// A clock on which time passes only by waiting and by what it is told that work takes.
struct Script {
    now: f64,
    /// Times of the ticks that were waited for.
    waited: Vec<f64>,
    /// Time that every look at the clock takes.
    work: fn(usize) -> f64,
    looks: usize,
}

impl Clock for Script {
    fn now(&mut self) -> f64 {
        self.looks += 1;
        self.now += (self.work)(self.looks);
        self.now
    }
    fn wait(&mut self, until: f64) {
        if self.waited.len() < self.waited.capacity() {
            self.waited.push(until);
        }
        self.now = self.now.max(until);
    }
}

fn script(work: fn(usize) -> f64) -> Script {
    Script { now: 0.0, waited: Vec::with_capacity(1000), work, looks: 0 }
}

/// Keeps the last output, and ends the run at a time.
struct Last {
    t: f64,
    value: f64,
    end: f64,
}

impl Exchange<Known> for Last {
    fn input(&mut self, t: f64, _: &mut Known) -> bool {
        t < self.end
    }
    fn output(&mut self, t: f64, values: &[f64]) {
        (self.t, self.value) = (t, values[0]);
    }
}

fn run(system: &mut Known, pace: Pace, clock: &mut Script, statistics: &Statistics) -> (Last, Result<(), Failure>) {
    let mut last = Last { t: 0.0, value: 0.0, end: f64::INFINITY };
    let mut x = system.start.clone();
    let end = run_real_time(system, FixedMethod::Rk4, &pace, &mut x, clock, &mut last, statistics);
    (last, end.map(drop).map_err(|stopped| stopped.failure))
}

const PACE: Pace = Pace { step: 0.01, ticks: Some(100), on_miss: OnMiss::CatchUp, project: false };

#[test]
fn a_tick_a_step() {
    let (statistics, mut clock) = (Statistics::default(), script(|_| 1e-4));
    let (last, end) = run(&mut decay(), PACE, &mut clock, &statistics);
    end.unwrap();
    assert_eq!(last.t, 1.0);
    assert!((last.value - (-1.0f64).exp()).abs() < 1e-10);
    assert_eq!((statistics.ticks(), statistics.misses(), statistics.time()), (100, 0, 1.0));
    assert!((clock.now - 1.0).abs() < 0.02, "{}", clock.now);
    // The step lies between two looks at the clock.
    assert!((statistics.step.quantile(0.5) - 1e-4).abs() < 2e-5);
    assert!((statistics.jitter.most() - 1e-4).abs() < 1e-6);
}

#[test]
fn jumps_are_met_inside_ticks() {
    let (mut system, statistics) = (stepped(), Statistics::default());
    let pace = Pace { step: 0.04, ticks: Some(25), ..PACE };
    let (last, end) = run(&mut system, pace, &mut script(|_| 0.0), &statistics);
    end.unwrap();
    let exact = (system.solution)(1.0)[0];
    assert!((last.value - exact).abs() < 2e-8, "{} {exact}", last.value);
    assert_eq!(system.mode.interval, 2);
}

#[test]
fn a_miss_is_caught_up_or_left_out() {
    // Of the four looks at the clock in a tick, one in the third tick takes 35 ms.
    let slow = |look: usize| if look == 12 { 0.035 } else { 0.0 };
    let statistics = Statistics::default();
    let mut clock = script(slow);
    run(&mut decay(), PACE, &mut clock, &statistics).1.unwrap();
    assert_eq!((statistics.ticks(), statistics.misses(), statistics.skipped()), (100, 3, 0));
    assert!((clock.now - 0.99).abs() < 1e-9, "back in time: {}", clock.now);

    let statistics = Statistics::default();
    let mut clock = script(slow);
    let pace = Pace { on_miss: OnMiss::Skip, ..PACE };
    let (last, end) = run(&mut decay(), pace, &mut clock, &statistics);
    end.unwrap();
    assert_eq!((statistics.ticks(), statistics.misses(), statistics.skipped()), (100, 1, 3));
    assert_eq!(last.t, 1.0);
    assert!((clock.now - 1.02).abs() < 1e-9, "behind by three ticks: {}", clock.now);
}

#[test]
fn the_exchange_ends_the_run() {
    let (mut system, statistics) = (decay(), Statistics::default());
    let mut last = Last { t: 0.0, value: 0.0, end: 0.25 };
    let mut x = system.start.clone();
    let pace = Pace { ticks: None, ..PACE };
    run_real_time(&mut system, FixedMethod::Heun, &pace, &mut x, &mut script(|_| 0.0), &mut last, &statistics).unwrap();
    assert_eq!(last.t, 0.25);
}

#[test]
fn a_failure_stops_it_with_its_time() {
    let mut system = hyperbola();
    system.rates = |_, x, _, dx| dx[0] = x[0] * x[0];
    let pace = Pace { ticks: None, ..PACE };
    let end = run(&mut system, pace, &mut script(|_| 0.0), &Statistics::default()).1;
    assert!(matches!(end, Err(Failure::NotFinite { time, .. }) if time > 0.9 && time < 1.2), "{end:?}");
}

#[test]
fn a_tick_takes_no_memory() {
    use FixedMethod::{Heun, ImplicitMidpoint, LinearlyImplicitBdf2, Rosenbrock};
    for method in [Heun, ImplicitMidpoint, Rosenbrock, LinearlyImplicitBdf2] {
        let count = |ticks: u64| {
            let mut system = decay();
            system.accepted = Vec::with_capacity(10_000);
            let (mut x, mut clock, statistics) = (system.start.clone(), script(|_| 1e-6), Statistics::default());
            let mut last = Last { t: 0.0, value: 0.0, end: f64::INFINITY };
            let pace = Pace { ticks: Some(ticks), ..PACE };
            allocation_counter::measure(|| {
                run_real_time(&mut system, method, &pace, &mut x, &mut clock, &mut last, &statistics).unwrap();
            })
            .count_total
        };
        assert_eq!(count(1), count(500), "{method:?}");
    }
    let _ = decay().states();
}
