//! The variable-step methods: work and error on known solutions, jumps, switches, failures.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use crate::systems;

use std::ops::ControlFlow;

use halfarrow_sim::Method::{Auto, Bdf, Explicit, Radau};
use halfarrow_sim::{AbsoluteTolerance, Failure, Method, Options, Sink, simulate};
use systems::*;

fn options(method: Method, rtol: f64, to: f64) -> Options {
    Options { method, rtol, to, every: Some(0.01), ..Options::default() }
}

/// Bounds of the work and the error of a method on a system with a known solution, over 10 s.
macro_rules! work {
    ($name:ident: $method:ident, $system:expr, rtol = $rtol:expr => steps <= $steps:expr, rates <= $rates:expr, error < $error:expr) => {
        #[test]
        fn $name() {
            let mut system: Known = $system;
            let (samples, end) = system.run(&options($method, $rtol, 10.0));
            let summary = end.unwrap();
            assert_eq!(samples.times.len(), 1001);
            let error = system.error(&samples);
            assert!(summary.steps <= $steps && summary.rates <= $rates, "error {error:e}, {summary:?}");
            assert!(error < $error, "error {error:e}, {summary:?}");
        }
    };
}

work!(explicit_decay_6: Explicit, decay(), rtol = 1e-6 => steps <= 40, rates <= 250, error < 1e-6);
work!(explicit_decay_12: Explicit, decay(), rtol = 1e-12 => steps <= 560, rates <= 3400, error < 1e-12);
work!(explicit_oscillator_6: Explicit, oscillator(), rtol = 1e-6 => steps <= 60, rates <= 450, error < 1e-6);
work!(explicit_oscillator_12: Explicit, oscillator(), rtol = 1e-12 => steps <= 800, rates <= 4800, error < 2e-12);
work!(explicit_fast_12: Explicit, fast_oscillator(), rtol = 1e-12 => steps <= 80_000, rates <= 480_000, error < 2e-10);
work!(explicit_hyperbola_12: Explicit, hyperbola(), rtol = 1e-12 => steps <= 320, rates <= 2000, error < 1e-11);
work!(explicit_stepped_12: Explicit, stepped(), rtol = 1e-12 => steps <= 500, rates <= 3100, error < 1e-12);
work!(explicit_scales_6: Explicit, scales_apart(), rtol = 1e-6 => steps <= 70, rates <= 500, error < 1e-6);
work!(explicit_scales_12: Explicit, scales_apart(), rtol = 1e-12 => steps <= 1000, rates <= 6000, error < 2e-12);
work!(explicit_lopsided_12: Explicit, lopsided(), rtol = 1e-12 => steps <= 1120, rates <= 6800, error < 1e-11);
work!(bdf_decay_6: Bdf, decay(), rtol = 1e-6 => steps <= 220, rates <= 250, error < 1e-6);
work!(bdf_oscillator_6: Bdf, oscillator(), rtol = 1e-6 => steps <= 250, rates <= 300, error < 2e-6);
work!(bdf_oscillator_12: Bdf, oscillator(), rtol = 1e-12 => steps <= 2000, rates <= 2200, error < 2e-11);
work!(bdf_stepped_12: Bdf, stepped(), rtol = 1e-12 => steps <= 2200, rates <= 2500, error < 1e-11);
work!(bdf_scales_12: Bdf, scales_apart(), rtol = 1e-12 => steps <= 3000, rates <= 3300, error < 5e-11);
work!(bdf_lopsided_12: Bdf, lopsided(), rtol = 1e-12 => steps <= 4200, rates <= 4700, error < 2e-10);
work!(bdf_prothero_robinson_12: Bdf, prothero_robinson(), rtol = 1e-12 => steps <= 2200, rates <= 3000, error < 2e-12);
work!(bdf_rod_6: Bdf, rod(), rtol = 1e-6 => steps <= 300, rates <= 350, error < 1e-6);
work!(bdf_rod_12: Bdf, rod(), rtol = 1e-12 => steps <= 1900, rates <= 2100, error < 1e-11);
work!(radau_decay_6: Radau, decay(), rtol = 1e-6 => steps <= 55, rates <= 3500, error < 1e-7);
work!(radau_decay_12: Radau, decay(), rtol = 1e-12 => steps <= 520, rates <= 5700, error < 5e-12);
work!(radau_oscillator_6: Radau, oscillator(), rtol = 1e-6 => steps <= 70, rates <= 3400, error < 1e-6);
work!(radau_oscillator_12: Radau, oscillator(), rtol = 1e-12 => steps <= 630, rates <= 6300, error < 2e-11);
work!(radau_hyperbola_12: Radau, hyperbola(), rtol = 1e-12 => steps <= 400, rates <= 9200, error < 1e-12);
work!(radau_stepped_12: Radau, stepped(), rtol = 1e-12 => steps <= 500, rates <= 5700, error < 5e-12);
work!(radau_scales_12: Radau, scales_apart(), rtol = 1e-12 => steps <= 850, rates <= 8000, error < 2e-11);
work!(radau_lopsided_12: Radau, lopsided(), rtol = 1e-12 => steps <= 1000, rates <= 9500, error < 3e-11);
work!(radau_prothero_robinson_12: Radau, prothero_robinson(), rtol = 1e-12 => steps <= 60, rates <= 6500, error < 5e-9);
work!(radau_rod_6: Radau, rod(), rtol = 1e-6 => steps <= 70, rates <= 1400, error < 5e-8);
work!(radau_rod_12: Radau, rod(), rtol = 1e-12 => steps <= 560, rates <= 6500, error < 2e-11);
work!(auto_stays_explicit: Auto, oscillator(), rtol = 1e-6 => steps <= 60, rates <= 450, error < 1e-6);
work!(auto_turns_stiff: Auto, prothero_robinson(), rtol = 1e-9 => steps <= 700, rates <= 1200, error < 1e-9);
work!(auto_turns_stiff_on_a_large_system: Auto, rod(), rtol = 1e-9 => steps <= 850, rates <= 1200, error < 2e-9);
work!(auto_pulse: Auto, pulse(), rtol = 1e-6 => steps <= 60, rates <= 400, error < 1e-10);
work!(auto_late: Auto, late(), rtol = 1e-6 => steps <= 60, rates <= 700, error < 1e-6);

/// Greatest distance of the last sample from the solution, relative to the magnitude of its kind.
fn error_at_rest<const SECTIONS: usize>(method: Method, rtol: f64, to: f64) -> f64 {
    let mut system = ladder::<SECTIONS>();
    let (samples, end) = system.run(&Options { every: None, ..options(method, rtol, to) });
    assert!(end.is_ok(), "{SECTIONS} {method:?} {rtol:e}: {end:?}");
    let (last, exact) = (samples.values.last().unwrap(), (system.solution)(to));
    let error = |kind: usize| {
        let size = exact.iter().skip(kind).step_by(2).fold(0.0, |most: f64, x| most.max(x.abs()));
        let distance = last.iter().zip(&exact).skip(kind).step_by(2).map(|(x, exact)| (x - exact).abs() / size);
        distance.fold(0.0, f64::max)
    };
    error(0).max(error(1))
}

#[test]
fn a_ladder_at_rest_starts_and_comes_to_rest() {
    for (method, rtol, bound) in [
        (Auto, 1e-6, 5e-5),
        (Explicit, 1e-6, 5e-5),
        (Bdf, 1e-6, 1e-5),
        (Auto, 1e-12, 1e-10),
        (Bdf, 1e-12, 1e-10),
        (Radau, 1e-6, 1e-5),
        (Radau, 1e-12, 1e-10),
    ] {
        let error = error_at_rest::<10>(method, rtol, 0.02);
        assert!(error < bound, "{method:?} {rtol:e}: {error:e}");
    }
}

#[test]
fn long_ladders_start_from_rest() {
    // What runs down the ladder does not depend on how many sections follow that it has not reached.
    for (method, rtol, bound) in [(Auto, 1e-6, 1e-5), (Explicit, 1e-12, 1e-10), (Bdf, 1e-6, 5e-5), (Radau, 1e-6, 5e-5)]
    {
        let last = |system: &mut Known| {
            let (samples, end) = system.run(&Options { every: None, ..options(method, rtol, 5e-4) });
            assert!(end.is_ok(), "{method:?} {rtol:e}: {end:?}");
            samples.values.last().unwrap()[..60].to_vec()
        };
        let (long, short) = (last(&mut ladder::<300>()), last(&mut ladder::<100>()));
        for i in 0..60 {
            let distance = (long[i] - short[i]).abs() / [1e-4, 1e-5][i % 2];
            assert!(distance < bound, "{method:?} {rtol:e}, state {i}: {distance:e}");
        }
    }
}

#[test]
fn what_nothing_moves_does_no_harm() {
    // The second state stands still, the third moves only once the first has, the fourth follows the third.
    for method in [Explicit, Bdf, Radau, Auto] {
        let mut system = Known::new(
            &[0.0; 4],
            |_, x, _, dx| dx.copy_from_slice(&[1.0, 0.0, 1e-9 * x[0].powi(8), 1e6 * x[2]]),
            |_, x, v, _, jv| jv.copy_from_slice(&[0.0, 0.0, 8e-9 * x[0].powi(7) * v[0], 1e6 * v[2]]),
            |t| vec![t, 0.0, 1e-9 * t.powi(9) / 9.0, 1e-3 * t.powi(10) / 90.0],
        );
        let (samples, end) = system.run(&options(method, 1e-9, 1.0));
        assert!(end.is_ok(), "{method:?}: {end:?}");
        assert!(system.error(&samples) < 1e-7, "{method:?}: {:e}, {end:?}", system.error(&samples));
    }
}

#[test]
fn what_acts_by_its_square_is_seen_from_rest() {
    // A plate that a charge pulls by its square: at rest the Jacobian does not know that the charge acts on it.
    for method in [Explicit, Bdf, Radau, Auto] {
        let mut system = Known::new(
            &[0.0; 3],
            |_, x, _, dx| dx.copy_from_slice(&[1e-13 - x[0], 1e20 * x[0] * x[0], 1e3 * x[1]]),
            |_, x, v, _, jv| jv.copy_from_slice(&[-v[0], 2e20 * x[0] * v[0], 1e3 * v[1]]),
            |t| {
                let (d, dd) = ((-t).exp(), (-2.0 * t).exp());
                let pull = t - 2.0 * (1.0 - d) + 0.5 * (1.0 - dd);
                let way = 0.5 * t * t - 2.0 * (t - 1.0 + d) + 0.5 * (t - 0.5 * (1.0 - dd));
                vec![1e-13 * (1.0 - d), 1e-6 * pull, 1e-3 * way]
            },
        );
        system.scales = vec![1e-13, 0.0, 0.0];
        let (samples, end) = system.run(&options(method, 1e-9, 1.0));
        let summary = end.unwrap();
        assert!(summary.steps < 500 && !summary.stiff, "{method:?}: {summary:?}");
        assert!(system.error(&samples) < 1e-7, "{method:?}: {:e}", system.error(&samples));
    }
}

#[test]
fn stiff_methods_meet_the_published_values_of_robertson() {
    for (method, rtol, bound) in
        [(Bdf, 1e-6, 1e-3), (Auto, 1e-8, 1e-5), (Bdf, 1e-10, 1e-7), (Radau, 1e-6, 3e-5), (Radau, 1e-10, 1e-7)]
    {
        let mut system = robertson();
        let atol = AbsoluteTolerance::Each([1e-4, 1e-10, 1e-2].map(|share| share * rtol).to_vec());
        let options = Options { method, rtol, atol, to: 1e11, every: Some(1e11), ..Options::default() };
        let (samples, end) = system.run(&options);
        let exact = (system.solution)(1e11);
        for (value, exact) in samples.values[1].iter().zip(exact) {
            assert!((value / exact - 1.0).abs() < bound, "{method:?} {rtol:e}: {value:e}, {end:?}");
        }
    }
}

#[test]
fn scaled_tolerances_carry_robertson_through() {
    let mut system = robertson();
    let (samples, end) = system.run(&Options { to: 1e11, every: Some(1e11), ..Options::default() });
    assert!(end.unwrap().stiff);
    assert!((samples.values[1][0] / 0.2083340149701255e-07 - 1.0).abs() < 0.01, "{samples:?}");
}

#[test]
fn jumps_are_met_to_the_last_bit() {
    for method in [Explicit, Bdf, Radau] {
        let mut system = stepped();
        let (samples, end) = system.run(&Options { every: None, ..options(method, 1e-9, 1.0) });
        assert_eq!(end.unwrap().jumps, 2);
        for jump in [0.3, 0.77] {
            assert_eq!(samples.times.iter().filter(|&&t| t == jump).count(), 2, "both sides of {jump}");
            assert!(system.accepted.contains(&jump));
        }
        assert_eq!(samples.times.last(), Some(&1.0));
        assert!(system.error(&samples) < 1e-8);
    }
}

#[test]
fn a_thousand_jumps() {
    let mut system = stepped();
    system.jumps = (1..1000).map(|i| i as f64 * 1e-3).collect();
    system.rates = |_, x, mode, dx| dx[0] = (mode.interval % 2) as f64 * 2.0 - 1.0 - 0.0 * x[0];
    let (samples, end) = system.run(&Options { every: Some(0.1), ..options(Auto, 1e-6, 1.0) });
    assert_eq!(end.unwrap().jumps, 999);
    assert!((samples.values.last().unwrap()[0] - 1.0).abs() < 1e-12, "{samples:?}");
    assert_eq!(samples.times, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]);
}

#[test]
fn corners_do_not_start_anew() {
    // 1000 rows in 10 s: an explicit step a row, 6 evaluations and one beyond the corner; BDF looks at five places of a row.
    for (method, steps, rates) in
        [(Explicit, 1000, 7003), (Auto, 1000, 7003), (Bdf, 25_000, 50_500), (Radau, 25_000, 40_000)]
    {
        let mut system = zigzag();
        let (samples, end) = system.run(&options(method, 1e-6, 10.0));
        let summary = end.unwrap();
        assert!(summary.steps <= steps && summary.rates <= rates, "{method:?}: {summary:?}");
        let error = system.error(&samples);
        assert!(error < 1e-6, "{method:?}: {error:e}, {summary:?}");
    }
}

#[test]
fn fine_tables_cost_few_steps_a_row() {
    for (method, steps, rates) in [(Explicit, 1000, 7003), (Auto, 1000, 7003), (Bdf, 6500, 13_500), (Radau, 6500, 8500)]
    {
        let mut system = table_of_a_sine();
        let (samples, end) = system.run(&options(method, 1e-6, 1.0));
        let summary = end.unwrap();
        assert!(summary.steps <= steps && summary.rates <= rates, "{method:?}: {summary:?}");
        let error = system.error(&samples);
        assert!(error < 1e-6, "{method:?}: {error:e}, {summary:?}");
    }
}

#[test]
fn rounding_is_not_taken_for_a_magnitude() {
    // In equilibrium the velocity is 0 and its rate what rounding leaves; a system may take that for its scale.
    for (method, scale, steps) in
        [(Explicit, 0.0, 100), (Explicit, 1e-17, 100), (Auto, 1e-17, 100), (Bdf, 1e-17, 600), (Radau, 1e-17, 600)]
    {
        let mut system = hanging();
        system.scales[0] = scale;
        let (samples, end) = system.run(&options(method, 1e-6, 10.0));
        let summary = end.unwrap();
        assert!(summary.steps <= steps && summary.rejected <= 30, "{method:?}: {summary:?}");
        let error = system.error(&samples);
        assert!(error < 1e-5, "{method:?}: {error:e}, {summary:?}");
    }
}

#[test]
fn every_bounce_is_found() {
    // Half the speed is kept: each flight takes half the time of the one before.
    let first = (2.0_f64 / 9.81).sqrt();
    let bounces: Vec<f64> = (0..8).map(|n| first * (1.0 + 2.0 * (1.0 - 0.5_f64.powi(n)))).collect();
    for method in [Explicit, Bdf, Radau] {
        let (samples, end) = ball().run(&Options { every: None, ..options(method, 1e-9, 1.3485) });
        assert_eq!(end.unwrap().crossings, 8);
        let found: Vec<f64> = samples.times.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect();
        assert_eq!(found.len(), 8);
        found.iter().zip(&bounces).for_each(|(t, exact)| assert!((t - exact).abs() < 1e-9, "{t} {exact}"));
    }
}

#[test]
fn bounces_without_end_are_reported() {
    for (mut system, time) in [(ball(), 3.0 * (2.0_f64 / 9.81).sqrt()), (relay(), 1.0)] {
        let stopped = system.run(&options(Explicit, 1e-6, 2.0)).1.unwrap_err();
        assert!(matches!(stopped.failure, Failure::Chattering { .. }), "{stopped:?}");
        assert!((stopped.time - time).abs() < 1e-6);
    }
}

#[test]
fn two_crossings_in_one_step_are_both_found() {
    for (method, rtol) in [(Explicit, 1e-3), (Explicit, 1e-6), (Bdf, 1e-4), (Radau, 1e-4)] {
        let (_, end) = grazing().run(&options(method, rtol, 10.0));
        assert_eq!(end.unwrap().crossings, 2, "{method:?} {rtol:e}");
    }
}

#[test]
fn trial_steps_out_of_the_domain_are_taken_back() {
    for method in [Explicit, Bdf, Radau, Auto] {
        let mut system = draining();
        let (samples, end) = system.run(&options(method, 1e-9, 0.999));
        end.unwrap();
        assert!(system.error(&samples) < 1e-7, "{:e}", system.error(&samples));
    }
}

#[test]
fn a_failure_of_the_system_is_handed_on_with_what_was_computed() {
    for method in [Explicit, Bdf, Radau, Auto] {
        let mut system = draining();
        system.rates = |_, x, _, dx| dx[0] = -1.0 - x[0].sqrt();
        let (samples, end) = system.run(&options(method, 1e-6, 10.0));
        let stopped = end.unwrap_err();
        assert!(stopped.failure.to_string().contains("a rate is not a finite number"), "{stopped:?}");
        assert!(stopped.time > 0.6 && stopped.time < 0.62, "{stopped:?}");
        assert!(samples.times.len() > 60 && *samples.times.last().unwrap() <= stopped.time);
    }
}

#[test]
fn a_solution_that_escapes_is_reported() {
    for method in [Explicit, Bdf, Radau, Auto] {
        let mut system = hyperbola();
        system.rates = |_, x, _, dx| dx[0] = x[0] * x[0];
        system.tangent = |_, x, v, _, jv| jv[0] = 2.0 * x[0] * v[0];
        let stopped = system.run(&options(method, 1e-6, 2.0)).1.unwrap_err();
        assert!((stopped.time - 1.0).abs() < 1e-4, "{stopped:?}");
    }
}

#[test]
fn a_failure_at_the_start_is_reported() {
    let mut system = draining();
    system.start = vec![-1.0];
    let stopped = system.run(&options(Auto, 1e-6, 1.0)).1.unwrap_err();
    assert_eq!((stopped.time, stopped.failure.time()), (0.0, Some(0.0)));
}

#[test]
fn a_jacobian_that_is_not_a_number_does_no_harm() {
    for mut system in [prothero_robinson(), rod()] {
        system.tangent = |_, _, _, _, jv| jv.fill(f64::NAN);
        let (samples, end) = system.run(&options(Bdf, 1e-6, 1e-3));
        end.unwrap();
        assert!(system.error(&samples) < 1e-5);
    }
}

#[test]
fn the_sink_may_stop_the_run() {
    struct Impatient(Vec<f64>);
    impl Sink for Impatient {
        fn sample(&mut self, t: f64, _: &[f64]) {
            self.0.push(t);
        }
        fn progress(&mut self, t: f64) -> ControlFlow<()> {
            if t > 3.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }
    let (mut system, mut sink) = (oscillator(), Impatient(vec![]));
    let mut x = system.start.clone();
    let stopped = simulate(&mut system, &options(Auto, 1e-6, 10.0), &mut x, &mut sink).unwrap_err();
    assert_eq!(stopped.failure, Failure::Interrupted { time: stopped.time });
    assert!((x[0] - stopped.time.cos()).abs() < 1e-5 && *sink.0.last().unwrap() <= stopped.time);
}

/// Of two events that time cannot tell apart the first is a mere corner, and the second moves the state.
#[test]
fn a_state_that_jumps_right_after_a_corner() {
    for method in [Explicit, Bdf, Radau, Auto] {
        let mut system = Known::new(
            &[0.0],
            |_, _, _, dx| dx[0] = 1.0,
            |_, _, _, _, jv| jv[0] = 0.0,
            |t| vec![t + f64::from(t > 0.5)],
        );
        system.jumps = vec![0.5, 0.5_f64.next_up()];
        system.reset = |t, _, x| x[0] += f64::from(t > 0.5);
        let (samples, end) = system.run(&options(method, 1e-6, 1.0));
        assert_eq!(end.unwrap().jumps, 2, "{method:?}");
        let last = samples.values.last().unwrap()[0];
        assert!((last - 2.0).abs() < 1e-12, "{method:?}: {last}");
    }
}

/// What watches sees every step and both sides of every event, whatever is sampled.
#[test]
fn every_step_is_watched() {
    #[derive(Default)]
    struct Watching {
        seen: Vec<(f64, f64)>,
        sampled: Vec<(f64, f64)>,
    }
    impl Sink for Watching {
        fn sample(&mut self, t: f64, values: &[f64]) {
            self.sampled.push((t, values[0]));
        }
        fn watches(&self) -> bool {
            true
        }
        fn watch(&mut self, t: f64, values: &[f64]) -> Result<(), Failure> {
            self.seen.push((t, values[0]));
            if t > 0.9 { Err(Failure::Interrupted { time: t }) } else { Ok(()) }
        }
    }
    let fixed = Method::Fixed(halfarrow_sim::fixed_step::FixedMethod::Rk4);
    for method in [Explicit, Bdf, Radau, fixed] {
        let run = |every| {
            let (mut system, mut sink) = (stepped(), Watching::default());
            let options = Options { every, step: Some(0.01), ..options(method, 1e-6, 1.0) };
            let mut x = system.start.clone();
            let stopped = simulate(&mut system, &options, &mut x, &mut sink).unwrap_err();
            assert!(matches!(stopped.failure, Failure::Interrupted { time } if time > 0.9), "{stopped}");
            sink
        };
        let Watching { mut seen, sampled } = run(None);
        seen.pop();
        assert_eq!(seen, sampled, "{method:?}");
        let times = run(Some(0.25)).sampled;
        assert_eq!(times.iter().map(|s| s.0).collect::<Vec<_>>(), [0.0, 0.25, 0.5, 0.75], "{method:?}");
    }
}

#[test]
fn no_state_at_all() {
    let mut system = Known::new(&[], |_, _, _, _| {}, |_, _, _, _, _| {}, |_| vec![]);
    for method in [Explicit, Bdf, Radau, Auto] {
        system.accepted.clear();
        let (samples, end) = system.run(&options(method, 1e-6, 1.0));
        end.unwrap();
        assert_eq!(samples.times.len(), 101);
    }
}

#[test]
fn the_longest_step_is_kept() {
    for method in [Explicit, Bdf, Radau] {
        let (samples, end) = decay().run(&Options { every: None, step: Some(0.05), ..options(method, 1e-3, 10.0) });
        assert!(samples.times.windows(2).all(|pair| pair[1] - pair[0] <= 0.05 + 1e-12));
        assert!(end.unwrap().steps >= 200);
    }
}

#[test]
fn a_machine_that_only_its_square_moves_starts_from_rest() {
    // An electrostatic actuator: its force is the square of a charge that starts at 0, so that magnitudes cannot be guessed.
    const GAP: f64 = 8.8541878128e-12 * 4e-8;
    for (method, rtol, bound) in [(Auto, 1e-6, 1e-5), (Bdf, 1e-6, 1e-5), (Radau, 1e-6, 1e-5), (Radau, 1e-12, 1e-10)] {
        let mut system = Known::new(
            &[0.0; 3],
            |_, x, _, dx| {
                dx[0] = (4.0 - x[0] * (2e-6 - x[1]) / GAP) / 1e8;
                dx[1] = x[2];
                dx[2] = (x[0] * x[0] / (2.0 * GAP) - 5e-6 * x[2] - x[1]) / 1e-9;
            },
            |_, x, v, _, jv| {
                jv[0] = (-v[0] * (2e-6 - x[1]) + x[0] * v[1]) / GAP / 1e8;
                jv[1] = v[2];
                jv[2] = (x[0] * v[0] / GAP - 5e-6 * v[2] - v[1]) / 1e-9;
            },
            |_| vec![1.1790628968132471e-12, 1.3376904193216418e-6, 0.029_090_111_116_053_725],
        );
        system.scales[0] = 1e-12;
        let (samples, end) = system.run(&Options { every: None, ..options(method, rtol, 1e-4) });
        let (last, exact) = (samples.values.last().unwrap(), (system.solution)(1e-4));
        let error = last.iter().zip(exact).map(|(x, exact)| (x / exact - 1.0).abs()).fold(0.0, f64::max);
        assert!(error < bound, "{method:?} {rtol:e}: {error:e}, {last:?}, {end:?}");
    }
}
