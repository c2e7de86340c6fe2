//! The fixed-step methods: order, work, invariants, jumps, no allocation.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use crate::systems;

use halfarrow_sim::fixed_step::{FixedMethod, FixedStep};
use halfarrow_sim::{Failure, Method, Options, Stepwise, Summary, System, simulate};
use systems::{Known, Samples, ball, decay, driven, hyperbola, oscillator, stepped, swinging};

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

work!(linearly_implicit_decay: LinearlyImplicitEuler, decay(), h = 1e-3, t = 1.0 => steps 1000, rates 1000, error < 1e-3);
work!(linearly_implicit_bdf2_decay: LinearlyImplicitBdf2, decay(), h = 1e-3, t = 1.0 => steps 1000, rates 1003, error < 5e-7);
work!(linearly_implicit_bdf2_oscillator: LinearlyImplicitBdf2, oscillator(), h = 1e-3, t = 10.0 => steps 10000, rates 10003, error < 1e-5);
work!(rosenbrock_decay: Rosenbrock, decay(), h = 1e-2, t = 1.0 => steps 100, rates 300, error < 5e-8);
work!(rosenbrock_stepped: Rosenbrock, stepped(), h = 1e-2, t = 1.0 => steps 100, rates 300, error < 1e-7);

const ALL: [(FixedMethod, i32); 7] = [
    (FixedMethod::Euler, 1),
    (FixedMethod::Heun, 2),
    (FixedMethod::Rk4, 4),
    (FixedMethod::ImplicitMidpoint, 2),
    (FixedMethod::LinearlyImplicitEuler, 1),
    (FixedMethod::LinearlyImplicitBdf2, 2),
    (FixedMethod::Rosenbrock, 3),
];

fn error(mut system: Known, method: FixedMethod, h: f64, to: f64) -> f64 {
    let (samples, end) = system.run(&options(method, h, to));
    end.unwrap();
    system.error(&samples)
}

#[test]
fn each_method_has_its_order() {
    for (method, order) in ALL {
        for system in [hyperbola(), swinging()] {
            let of = |h: f64| error(system.clone(), method, h, 1.0);
            if of(1.0 / 128.0) < 1e-13 {
                continue; // RODAS3 happens to be exact on the hyperbola
            }
            let observed = (of(1.0 / 128.0) / of(1.0 / 256.0)).log2();
            assert!((observed - f64::from(order)).abs() < 0.12, "{method:?}: {observed}");
        }
    }
}

/// Steps a hundred times longer than the shortest time of the system: linearly implicit methods follow its solution, and
/// the derivative by time is what keeps their order.
#[test]
fn linearly_implicit_methods_take_long_steps() {
    use FixedMethod::{LinearlyImplicitBdf2, LinearlyImplicitEuler, Rosenbrock};
    for (method, bound) in [(LinearlyImplicitEuler, 1e-2), (LinearlyImplicitBdf2, 1e-3), (Rosenbrock, 1e-5)] {
        let coarse = error(driven(), method, 1e-2, 1.0);
        assert!(coarse < bound, "{method:?}: {coarse:e}");
    }
}

/// A time constant that shortens from 1 s to 10 µs within a second, a hundredth of the step: the Jacobian that is kept is that of
/// some steps ago.
#[test]
fn a_jacobian_that_is_kept_follows_what_changes() {
    fn hardness(t: f64) -> f64 {
        (t * 1e5_f64.ln()).exp()
    }
    let mut system = Known::new(
        &[1.0],
        |t, x, _, dx| dx[0] = -hardness(t) * (x[0] - t.cos()) - t.sin(),
        |t, _, v, _, jv| jv[0] = -hardness(t) * v[0],
        |t| vec![t.cos()],
    );
    let (samples, end) = system.run(&options(FixedMethod::LinearlyImplicitBdf2, 1e-3, 1.0));
    let summary = end.unwrap();
    assert!(summary.steps == 1000 && summary.rates < 1010, "{summary:?}");
    let error = system.error(&samples);
    assert!(error < 1e-6, "{error:e}");
}

/// A step in vain moves nothing, and the run goes on as without it: there may be any number of them.
#[test]
fn steps_in_vain_leave_no_trace() {
    let run = |vain: usize| {
        let mut system = swinging();
        let mut method = FixedStep::new(FixedMethod::LinearlyImplicitBdf2, system.sparsity());
        let mut x = system.start.clone();
        for step in 0..100 {
            let t = f64::from(step) * 0.01;
            (0..vain).for_each(|_| method.rehearse(&mut system, t, 0.01, &mut x.clone()).unwrap());
            method.step(&mut system, t, 0.01, &mut x).unwrap();
        }
        x
    };
    assert_eq!(run(0), run(3));
}

const STATES: usize = 40;

/// One stiff direction among these states, which turns once in six seconds.
fn turning(t: f64, x: &[f64], dx: &mut [f64]) {
    let direction = |i: usize| (t + i as f64).cos() / 20_f64.sqrt();
    let along: f64 = (0..x.len()).map(|i| direction(i) * x[i]).sum();
    (0..x.len()).for_each(|i| dx[i] = -1e4 * along * direction(i));
}

/// How many columns of a large Jacobian each step finds, and the greatest error. Something happens before steps where that is said.
fn columns_found(happens: fn(usize) -> bool) -> (Vec<usize>, f64) {
    use std::cell::Cell;
    thread_local!(static DERIVATIVES: Cell<usize> = const { Cell::new(0) });
    let solution = |t: f64| (0..STATES).map(|i| (t + i as f64).sin()).collect();
    let mut system = Known::new(
        &[0.0; STATES],
        |t, x, _, dx| {
            let beside: Vec<f64> = (0..STATES).map(|i| x[i] - (t + i as f64).sin()).collect();
            turning(t, &beside, dx);
            (0..STATES).for_each(|i| dx[i] += (t + i as f64).cos());
        },
        |t, _, v, _, jv| {
            DERIVATIVES.with(|count| count.set(count.get() + 1));
            turning(t, v, jv);
        },
        solution,
    );
    let mut method = FixedStep::new(FixedMethod::LinearlyImplicitBdf2, system.sparsity());
    let mut x: Vec<f64> = solution(0.0);
    let (mut found, mut error) = (vec![], 0.0_f64);
    for step in 0..6000 {
        DERIVATIVES.set(0);
        if happens(step) {
            method.leave();
        }
        method.step(&mut system, step as f64 * 1e-3, 1e-3, &mut x).unwrap();
        found.push(DERIVATIVES.get());
        let exact: Vec<f64> = solution((step + 1) as f64 * 1e-3);
        error = x.iter().zip(exact).fold(error, |most, (x, exact)| most.max((x - exact).abs()));
    }
    (found, error)
}

/// No step finds more than a few columns of a large Jacobian, but the first. Found at once every time, steps are 15 times as near.
#[test]
fn a_large_jacobian_is_found_over_several_steps() {
    let (mut found, error) = columns_found(|_| false);
    assert_eq!(found.remove(0), STATES);
    // Fourteen steps find 40 columns, and a look at the Jacobian takes one derivative.
    let times = found.iter().filter(|&&count| count == 3).count() / 12;
    assert!(*found.iter().max().unwrap() <= 3 && times > 20, "{times}");
    assert!(error < 3e-5, "{error:e}");
}

/// A step that begins anew has its own to do: it leaves columns to the next one, but not for ever.
#[test]
fn columns_are_found_where_nothing_happens() {
    let (found, error) = columns_found(|step| step % 5 == 0);
    let most = (1..6000).filter(|step| step % 5 == 0).map(|step| found[step]).max();
    assert!(most == Some(1) && error < 1e-3, "{most:?} {error:e}");
    let (found, error) = columns_found(|_| true);
    let times = found.iter().filter(|&&count| count > 1).count();
    assert!(times > 2000 && error < 1e-2, "{times} {error:e}");
}

/// A heated rod of many states: sparse matrices.
#[test]
fn linearly_implicit_methods_take_sparse_matrices() {
    const N: usize = 80;
    let near = |i: usize| (i.saturating_sub(1)..=(i + 1).min(N - 1)).collect();
    let mut system = Known::new(&[0.0; N], rod, |_, _, v, mode, jv| rod(0.0, v, mode, jv), |_| vec![0.0; N]);
    system.sparsity = halfarrow_sim::Sparsity::from_columns((0..N).map(near));
    system.start[N / 2] = 1.0;
    fn rod(_: f64, x: &[f64], _: &systems::Mode, dx: &mut [f64]) {
        for i in 0..x.len() {
            let left = if i > 0 { x[i - 1] } else { x[i] };
            let right = if i + 1 < x.len() { x[i + 1] } else { x[i] };
            dx[i] = 1e3 * (left - 2.0 * x[i] + right);
        }
    }
    let run = |sparsity: halfarrow_sim::Sparsity| {
        let mut system = system.clone();
        let mut method = FixedStep::new(FixedMethod::Rosenbrock, &sparsity);
        system.sparsity = sparsity;
        let mut x = system.start.clone();
        (0..50).for_each(|step| method.step(&mut system, 1e-2 * f64::from(step), 1e-2, &mut x).unwrap());
        assert_eq!(allocations_during(|| method.step(&mut system, 0.5, 1e-2, &mut x).unwrap()), 0);
        x
    };
    let (sparse, dense) = (run(system.sparsity.clone()), run(halfarrow_sim::Sparsity::dense(N)));
    let sum: f64 = sparse.iter().sum();
    assert!((sum - 1.0).abs() < 1e-12, "heat is kept: {sum}");
    for (a, b) in sparse.iter().zip(&dense) {
        assert!((a - b).abs() < 1e-14, "{a} {b}");
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
    for (method, _) in ALL {
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

/// A run in the caller's hands, a step at a time, is the run at once; saved in its middle it goes on alike.
#[test]
fn step_by_step_is_the_same_run() {
    for (method, _) in ALL {
        for make in [stepped as fn() -> Known, ball] {
            let mut whole = make();
            let mut at_once = whole.start.clone();
            let options = options(method, 1.0 / 64.0, 2.0);
            let summary = simulate(&mut whole, &options, &mut at_once, &mut Samples::default()).unwrap();

            let mut system = make();
            let mut x = system.start.clone();
            let mut run = Stepwise::new(method, 0.0, &system);
            run.start(&mut system, &mut x).unwrap();
            let mut saved = None;
            for step in 1..=128 {
                run.advance(&mut system, f64::from(step) / 64.0, &mut x).unwrap();
                if step == 50 {
                    saved = Some((run.position().clone(), run.history().cloned(), system.clone(), x.clone()));
                }
            }
            assert_eq!(x, at_once, "{method:?}");
            let count = |s: Summary| (s.steps, s.jumps, s.crossings);
            assert_eq!(count(run.summary()), count(summary), "{method:?}");

            let (position, history, mut system, mut x) = saved.expect("it was saved");
            run.restore(&position, history.as_ref());
            for step in 51..=128 {
                run.advance(&mut system, f64::from(step) / 64.0, &mut x).unwrap();
            }
            assert_eq!((x, count(run.summary())), (at_once, count(summary)), "{method:?}");
        }
    }
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
