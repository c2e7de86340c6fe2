//! The fixed-step methods: order, work, invariants, jumps, no allocation.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

mod systems;

use halfarrow_sim::fixed_step::{FixedMethod, FixedStep};
use halfarrow_sim::{Failure, Method, Options, System};
use systems::{Known, decay, hyperbola, oscillator, stepped};

fn allocations_during(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}

fn options(method: FixedMethod, step: f64, to: f64) -> Options {
    Options { method: Method::Fixed(method), step: Some(step), to, ..Options::default() }
}

/// The work of a method on a system with a known solution, and a bound of its error.
macro_rules! work {
    ($name:ident: $method:ident, $system:expr, h = $h:expr, t = $t:expr => steps $steps:expr, rates $rates:expr, error < $error:expr) => {
        #[test]
        fn $name() {
            let mut system: Known = $system;
            let (samples, end) = system.run(&options(FixedMethod::$method, $h, $t));
            let summary = end.unwrap();
            assert_eq!((summary.steps, summary.rates), ($steps, $rates));
            let error = system.error(&samples);
            assert!(error < $error && error > $error / 10.0, "error {error:e}");
        }
    };
}

work!(euler_decay: Euler, decay(), h = 1e-3, t = 1.0 => steps 1000, rates 1000, error < 2e-4);
work!(heun_decay: Heun, decay(), h = 1e-3, t = 1.0 => steps 1000, rates 2000, error < 1e-7);
work!(rk4_decay: Rk4, decay(), h = 1e-2, t = 1.0 => steps 100, rates 400, error < 1e-10);
work!(midpoint_decay: ImplicitMidpoint, decay(), h = 1e-3, t = 1.0 => steps 1000, rates 2000, error < 1e-7);
work!(euler_oscillator: Euler, oscillator(), h = 1e-3, t = 10.0 => steps 10000, rates 10000, error < 1e-2);
work!(heun_oscillator: Heun, oscillator(), h = 1e-3, t = 10.0 => steps 10000, rates 20000, error < 2e-6);
work!(rk4_oscillator: Rk4, oscillator(), h = 1e-2, t = 10.0 => steps 1000, rates 4000, error < 1e-9);
work!(midpoint_oscillator: ImplicitMidpoint, oscillator(), h = 1e-3, t = 10.0 => steps 10000, rates 20000, error < 2e-6);
work!(rk4_stepped: Rk4, stepped(), h = 1e-2, t = 1.0 => steps 100, rates 400, error < 1e-10);
work!(rk4_stepped_between: Rk4, stepped(), h = 0.125, t = 1.0 => steps 10, rates 40, error < 2e-6);

#[test]
fn each_method_has_its_order() {
    let cases =
        [(FixedMethod::Euler, 1), (FixedMethod::Heun, 2), (FixedMethod::Rk4, 4), (FixedMethod::ImplicitMidpoint, 2)];
    for (method, order) in cases {
        let error = |h: f64| {
            let mut system = hyperbola();
            let (samples, end) = system.run(&options(method, h, 1.0));
            end.unwrap();
            system.error(&samples)
        };
        let observed = (error(1.0 / 64.0) / error(1.0 / 128.0)).log2();
        assert!((observed - order as f64).abs() < 0.1, "{method:?}: {observed}");
    }
}

#[test]
fn implicit_midpoint_keeps_the_energy() {
    let mut system = oscillator();
    let mut method = FixedStep::new(FixedMethod::ImplicitMidpoint, system.sparsity());
    let mut x = [0.6, 0.8];
    for step in 0..100_000 {
        method.step(&mut system, step as f64 * 0.1, 0.1, &mut x).unwrap();
    }
    let energy = x[0] * x[0] + x[1] * x[1];
    assert!((energy - 1.0).abs() < 1e-12, "{energy}");
}

#[test]
fn a_step_does_not_allocate() {
    for method in [FixedMethod::Euler, FixedMethod::Heun, FixedMethod::Rk4, FixedMethod::ImplicitMidpoint] {
        for mut system in [oscillator(), hyperbola()] {
            let mut stepper = FixedStep::new(method, system.sparsity());
            let mut x = system.start.clone();
            assert!(allocations_during(|| drop(std::hint::black_box(vec![0.0; 3]))) > 0);
            assert_eq!(allocations_during(|| stepper.step(&mut system, 0.0, 0.1, &mut x).unwrap()), 0, "{method:?}");
        }
    }
}

#[test]
fn lands_on_jumps_and_samples_both_sides() {
    let mut system = stepped();
    let (samples, end) = system.run(&options(FixedMethod::Rk4, 0.25, 1.0));
    assert_eq!(samples.times, [0.0, 0.25, 0.3, 0.3, 0.5, 0.75, 0.77, 0.77, 1.0]);
    assert_eq!(end.unwrap().jumps, 2);
}

#[test]
fn samples_on_a_grid_once_each() {
    let mut system = stepped();
    let (samples, end) = system.run(&Options { every: Some(0.1), ..options(FixedMethod::Rk4, 0.04, 0.95) });
    assert_eq!(samples.times, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95]);
    end.unwrap();
    assert!(system.error(&samples) < 1e-7);
}

#[test]
fn a_failure_keeps_what_was_computed() {
    // x' = x², from 1: infinite at t = 1.
    let mut system = hyperbola();
    system.rates = |_, x, _, dx| dx[0] = x[0] * x[0];
    let (samples, end) = system.run(&options(FixedMethod::Euler, 0.01, 10.0));
    let stopped = end.unwrap_err();
    assert!(matches!(stopped.failure, Failure::NotFinite { .. }), "{stopped:?}");
    assert_eq!(samples.times.last(), Some(&stopped.time));
    assert_eq!(samples.times.len(), stopped.summary.steps + 1);
    assert!(stopped.time > 1.0 && stopped.time < 1.2);
}

#[test]
fn newton_without_a_solution_says_so() {
    // x' = 1 + x² over a step in which the solution passes through infinity.
    let mut system = hyperbola();
    system.rates = |_, x, _, dx| dx[0] = 1.0 + x[0] * x[0];
    system.tangent = |_, x, v, _, jv| jv[0] = 2.0 * x[0] * v[0];
    let mut method = FixedStep::new(FixedMethod::ImplicitMidpoint, system.sparsity());
    let mut x = [1.0];
    let failure = method.step(&mut system, 0.0, 3.0, &mut x).unwrap_err();
    assert!(matches!(failure, Failure::NoConvergence { iterations: 20, .. }), "{failure}");
    assert_eq!(x, [1.0]);
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let refused = |options: Options| match decay().run(&options).1.unwrap_err().failure {
        Failure::BadOption { option, .. } => option,
        other => panic!("{other}"),
    };
    assert_eq!(refused(options(FixedMethod::Heun, 0.0, 1.0)), "step");
    assert_eq!(refused(Options { step: None, ..options(FixedMethod::Heun, 1.0, 1.0) }), "step");
    assert_eq!(refused(options(FixedMethod::Heun, 0.1, 0.0)), "to");
    assert_eq!(refused(Options { every: Some(-1.0), ..options(FixedMethod::Heun, 0.1, 1.0) }), "every");
    assert_eq!(refused(Options { rtol: 1e-15, ..Options::default() }), "rtol");
}
