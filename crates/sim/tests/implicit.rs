//! Systems in implicit form: error, jumps, switches, samples, failures.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow_sim::{
    AbsoluteTolerance, Events, Failure, ImplicitSystem, Method, Options, Sink, Sparsity, Stopped, Summary, halves,
    halves_mut, simulate_implicit,
};

/// `(t, y, y', mode, out)`.
type Residual = fn(f64, &[f64], &[f64], usize, &mut [f64]);
/// Both derivatives row by row: `(t, y, y', dy, dyp)`.
type Derivatives = fn(f64, &[f64], &[f64], &mut [f64], &mut [f64]);

/// A system with a dense pattern. Its mode counts the jumps and crossings so far.
struct Form {
    index: Vec<u8>,
    start: (Vec<f64>, Vec<f64>),
    sparsity: Sparsity,
    residual: Residual,
    derivatives: Derivatives,
    /// Which equations hold a rate, if that is `y' - f`.
    differential: Option<Vec<bool>>,
    jumps: Vec<f64>,
    indicator: Option<fn(&[f64]) -> f64>,
    /// Makes the unknowns and rates consistent: `(mode, y, yp)`.
    settle: fn(usize, &mut [f64], &mut [f64]),
    mode: usize,
    accepted: Vec<f64>,
}

impl Form {
    fn new(index: &[u8], start: (&[f64], &[f64]), residual: Residual, derivatives: Derivatives) -> Form {
        Form {
            index: index.to_vec(),
            start: (start.0.to_vec(), start.1.to_vec()),
            sparsity: Sparsity::dense(index.len()),
            residual,
            derivatives,
            differential: None,
            jumps: vec![],
            indicator: None,
            settle: |_, _, _| {},
            mode: 0,
            accepted: vec![],
        }
    }

    /// In semi-explicit form.
    fn with_rates_in(mut self, differential: &[bool]) -> Form {
        self.differential = Some(differential.to_vec());
        self
    }

    fn run(&mut self, options: &Options) -> (Samples, Result<Summary, Stopped>) {
        let ((mut y, mut yp), mut samples) = (self.start.clone(), Samples::default());
        let end = simulate_implicit(self, options, &mut y, &mut yp, &mut samples);
        (samples, end)
    }
}

impl ImplicitSystem for Form {
    fn unknowns(&self) -> usize {
        self.index.len()
    }
    fn scales(&mut self, _: f64, _: f64) -> Result<Vec<f64>, Failure> {
        Ok(vec![0.0; self.index.len()])
    }
    fn index(&self, unknown: usize) -> u8 {
        self.index[unknown]
    }
    fn residual(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        (self.residual)(t, y, yp, self.mode, out);
        Ok(())
    }
    fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }
    fn jacobian(&mut self, t: f64, y: &[f64], yp: &[f64], dy: &mut [f64], dyp: &mut [f64]) -> Result<(), Failure> {
        let size = self.index.len();
        let (mut by_rows, mut rates_by_rows) = (vec![0.0; size * size], vec![0.0; size * size]);
        (self.derivatives)(t, y, yp, &mut by_rows, &mut rates_by_rows);
        for (place, (row, column)) in self.sparsity.entries().enumerate() {
            dy[place] = by_rows[row * size + column];
            dyp[place] = rates_by_rows[row * size + column];
        }
        Ok(())
    }
    fn semi_explicit(&self) -> Option<&[bool]> {
        self.differential.as_deref()
    }
}

impl Events for Form {
    fn next_time_event(&mut self, t: f64) -> Option<f64> {
        self.jumps.iter().copied().find(|&jump| jump > t)
    }
    fn indicators(&self) -> usize {
        usize::from(self.indicator.is_some())
    }
    fn event_indicators(&mut self, _: f64, point: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        if let Some(indicator) = self.indicator {
            g[0] = indicator(halves(point).0);
        }
        Ok(())
    }
    fn handle_event(&mut self, t: f64, point: &mut [f64]) -> Result<(), Failure> {
        self.mode += usize::from(t > 0.0);
        let (y, yp) = halves_mut(point);
        (self.settle)(self.mode, y, yp);
        Ok(())
    }
    fn accept(&mut self, t: f64, _: &[f64]) -> Result<(), Failure> {
        assert!(self.accepted.last().is_none_or(|&last| last <= t), "time ran backwards");
        self.accepted.push(t);
        Ok(())
    }
    fn observed(&self) -> usize {
        2 * self.index.len()
    }
    fn observe(&mut self, _: f64, point: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        out.copy_from_slice(point);
        Ok(())
    }
}

#[derive(Default)]
struct Samples {
    times: Vec<f64>,
    values: Vec<Vec<f64>>,
}

impl Sink for Samples {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.times.push(t);
        self.values.push(values.to_vec());
    }
}

fn bdf(rtol: f64, to: f64, every: Option<f64>) -> Options {
    Options { method: Method::Bdf, ..options(rtol, to, every) }
}

fn options(rtol: f64, to: f64, every: Option<f64>) -> Options {
    Options { method: Method::Radau, rtol, to, every, ..Options::default() }
}

/// Robertson's kinetics with the sum of all three as its third equation.
fn robertson() -> Form {
    Form::new(
        &[1; 3],
        (&[1.0, 0.0, 0.0], &[-0.04, 0.04, 0.0]),
        |_, y, yp, _, out| {
            let (slow, fast, back) = (0.04 * y[0], 3e7 * y[1] * y[1], 1e4 * y[1] * y[2]);
            out.copy_from_slice(&[yp[0] - back + slow, yp[1] - slow + back + fast, 1.0 - y[0] - y[1] - y[2]]);
        },
        |_, y, _, dy, dyp| {
            let (by_fast, by_last) = (1e4 * y[2], 1e4 * y[1]);
            dy[..3].copy_from_slice(&[0.04, -by_fast, -by_last]);
            dy[3..6].copy_from_slice(&[-0.04, by_fast + 6e7 * y[1], by_last]);
            dy[6..].fill(-1.0);
            (dyp[0], dyp[4]) = (1.0, 1.0);
        },
    )
    .with_rates_in(&[true, true, false])
}

#[test]
fn the_published_values_of_robertson_are_met() {
    let exact = [0.2083340149701255e-07, 0.8333360770334713e-13, 0.999999979166505];
    let radau = [(1e-4, 1e-3, 140), (1e-6, 3e-5, 260), (1e-10, 1e-7, 1100)].map(|run| (Method::Radau, run));
    let bdf = [(1e-6, 1e-3, 1250), (1e-8, 1e-4, 2500), (1e-10, 1e-6, 6000)].map(|run| (Method::Bdf, run));
    for (method, (rtol, bound, steps)) in radau.into_iter().chain(bdf) {
        let atol = AbsoluteTolerance::Each([1e-4, 1e-10, 1e-2].map(|share| share * rtol).to_vec());
        let (samples, end) = robertson().run(&Options { atol, method, ..options(rtol, 1e11, Some(1e11)) });
        let summary = end.unwrap();
        for (value, exact) in samples.values[1].iter().zip(exact) {
            assert!((value / exact - 1.0).abs() < bound, "{method:?} {rtol:e}: {value:e}, {summary:?}");
        }
        assert!(summary.steps <= steps, "{method:?} {rtol:e}: {summary:?}");
    }
}

#[test]
fn scaled_tolerances_carry_robertson_through() {
    let (samples, end) = robertson().run(&options(1e-6, 1e11, Some(1e11)));
    assert!((samples.values[1][0] / 0.2083340149701255e-07 - 1.0).abs() < 0.01, "{:?} {end:?}", samples.values);
}

/// `y' + y'³ + y` as it is for `cos t`: the rate has no factor.
fn cubic() -> Form {
    Form::new(
        &[1],
        (&[1.0], &[0.0]),
        |t, y, yp, _, out| out[0] = yp[0] + yp[0].powi(3) + y[0] + t.sin() + t.sin().powi(3) - t.cos(),
        |_, _, yp, dy, dyp| (dy[0], dyp[0]) = (1.0, 1.0 + 3.0 * yp[0].powi(2)),
    )
}

#[test]
fn rates_may_enter_nonlinearly() {
    for (rtol, steps, bound) in [(1e-4, 50, 1e-4), (1e-8, 180, 5e-8), (1e-12, 900, 1e-10)] {
        let (samples, end) = cubic().run(&options(rtol, 10.0, Some(0.1)));
        let summary = end.unwrap();
        assert_eq!(samples.times.len(), 101);
        for (t, values) in samples.times.iter().zip(&samples.values) {
            let error = (values[0] - t.cos()).abs().max((values[1] + t.sin()).abs());
            assert!(error < bound, "{rtol:e}, {t} s: {error:e}, {summary:?}");
        }
        assert!(summary.steps <= steps, "{rtol:e}: {summary:?}");
    }
}

#[test]
fn of_several_solutions_the_one_at_the_start_is_kept() {
    // y'² = 4 y from 1: (1 + t)² or (1 - t)².
    for (rate, end) in [(2.0, 4.0), (-2.0, 0.25)] {
        let mut form = Form::new(
            &[1],
            (&[1.0], &[rate]),
            |_, y, yp, _, out| out[0] = yp[0] * yp[0] - 4.0 * y[0],
            |_, _, yp, dy, dyp| (dy[0], dyp[0]) = (-4.0, 2.0 * yp[0]),
        );
        let to = if rate > 0.0 { 1.0 } else { 0.5 };
        let (samples, summary) = form.run(&options(1e-8, to, None));
        let last = samples.values.last().unwrap()[0];
        assert!((last - end).abs() < 1e-8, "{last}, {summary:?}");
    }
}

/// `x' = z - x`, `z` is 0, then 1 from 0.3 s on, then -2 from 0.77 s on.
fn stepped() -> Form {
    const LEVELS: [f64; 3] = [0.0, 1.0, -2.0];
    let mut form = Form::new(
        &[1, 1],
        (&[1.0, 5.0], &[0.0, 0.0]),
        |_, y, yp, mode, out| (out[0], out[1]) = (yp[0] - y[1] + y[0], LEVELS[mode] - y[1]),
        |_, _, _, dy, dyp| {
            dy.copy_from_slice(&[1.0, -1.0, 0.0, -1.0]);
            dyp[0] = 1.0;
        },
    )
    .with_rates_in(&[true, false]);
    form.jumps = vec![0.3, 0.77];
    form.settle = |mode, y, yp| {
        y[1] = LEVELS[mode];
        (yp[0], yp[1]) = (y[1] - y[0], 0.0);
    };
    form
}

#[test]
fn jumps_are_met_to_the_last_bit() {
    for options in [options(1e-10, 1.0, None), bdf(1e-10, 1.0, None)] {
        let mut form = stepped();
        let (samples, end) = form.run(&options);
        assert_eq!(end.unwrap().jumps, 2);
        for jump in [0.3, 0.77] {
            assert_eq!(samples.times.iter().filter(|&&t| t == jump).count(), 2, "both sides of {jump}");
            assert!(form.accepted.contains(&jump));
        }
        let relax = |x: f64, a: f64, t: f64| a + (x - a) * (-t).exp();
        let exact = relax(relax((-0.3_f64).exp(), 1.0, 0.47), -2.0, 0.23);
        let last = samples.values.last().unwrap();
        assert!((last[0] - exact).abs() < 1e-9 && (last[1] + 2.0).abs() < 1e-12, "{last:?} {exact}");
        assert!((last[2] - (-2.0 - exact)).abs() < 1e-9, "{last:?} {exact}");
    }
}

/// A ball that falls from 1 m and keeps half its speed at each bounce, with its weight as an algebraic unknown.
fn ball() -> Form {
    let mut form = Form::new(
        &[1; 3],
        (&[1.0, 0.0, -9.81], &[0.0, -9.81, 0.0]),
        |_, y, yp, _, out| out.copy_from_slice(&[yp[0] - y[1], yp[1] - y[2], -9.81 - y[2]]),
        |_, _, _, dy, dyp| {
            dy.copy_from_slice(&[0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, -1.0]);
            (dyp[0], dyp[4]) = (1.0, 1.0);
        },
    )
    .with_rates_in(&[true, true, false]);
    form.indicator = Some(|y| y[0]);
    form.settle = |mode, y, yp| {
        if mode > 0 && y[0] <= 0.0 {
            (y[0], y[1]) = (f64::MIN_POSITIVE, -0.5 * y[1]);
        }
        (yp[0], yp[1], yp[2]) = (y[1], y[2], 0.0);
    };
    form
}

#[test]
fn every_bounce_is_found() {
    let first = (2.0_f64 / 9.81).sqrt();
    let bounces: Vec<f64> = (0..8).map(|n| first * (1.0 + 2.0 * (1.0 - 0.5_f64.powi(n)))).collect();
    for options in [options(1e-9, 1.3485, None), bdf(1e-9, 1.3485, None)] {
        let (samples, end) = ball().run(&options);
        assert_eq!(end.unwrap().crossings, 8);
        let found: Vec<f64> = samples.times.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect();
        assert_eq!(found.len(), 8);
        found.iter().zip(&bounces).for_each(|(t, exact)| assert!((t - exact).abs() < 1e-9, "{t} {exact}"));
    }
}

const CELLS: usize = 40;

/// Heat along a rod of cells that starts as one sine arc: temperatures, then the flow into each cell and out of the last.
fn rod() -> Form {
    const SIZE: usize = 2 * CELLS + 1;
    fn arc(cell: usize) -> f64 {
        (std::f64::consts::PI * (cell + 1) as f64 / (CELLS + 1) as f64).sin()
    }
    let temperatures: Vec<f64> = (0..CELLS).map(arc).collect();
    let at = |i: usize| if i == 0 || i > CELLS { 0.0 } else { temperatures[i - 1] };
    let flows: Vec<f64> = (0..=CELLS).map(|i| 1e3 * (at(i) - at(i + 1))).collect();
    let rates: Vec<f64> = (0..CELLS).map(|i| flows[i] - flows[i + 1]).chain(vec![0.0; CELLS + 1]).collect();
    let start = [temperatures, flows].concat();
    let mut form = Form::new(
        &[1; SIZE],
        (&start, &rates),
        |_, y, yp, _, out| {
            let at = |i: usize| if i == 0 || i > CELLS { 0.0 } else { y[i - 1] };
            (0..CELLS).for_each(|i| out[i] = yp[i] - y[CELLS + i] + y[CELLS + i + 1]);
            (0..=CELLS).for_each(|i| out[CELLS + i] = y[CELLS + i] - 1e3 * (at(i) - at(i + 1)));
        },
        |_, _, _, dy, dyp| {
            for i in 0..CELLS {
                dyp[i * SIZE + i] = 1.0;
                (dy[i * SIZE + CELLS + i], dy[i * SIZE + CELLS + i + 1]) = (-1.0, 1.0);
                (dy[(CELLS + i) * SIZE + i], dy[(CELLS + i + 1) * SIZE + i]) = (1e3, -1e3);
            }
            (CELLS..SIZE).for_each(|i| dy[i * SIZE + i] = 1.0);
        },
    );
    let column = |i: usize| match i < CELLS {
        true => vec![i, CELLS + i, CELLS + i + 1],
        false => [Some(i), (i - CELLS).checked_sub(1), Some(i - CELLS).filter(|&row| row < CELLS)]
            .into_iter()
            .flatten()
            .collect(),
    };
    form.sparsity = Sparsity::from_columns((0..SIZE).map(column));
    form.differential = Some((0..SIZE).map(|i| i < CELLS).collect());
    form
}

#[test]
fn many_unknowns_are_solved_sparsely() {
    let decay = 4e3 * (0.5 * std::f64::consts::PI / (CELLS + 1) as f64).sin().powi(2);
    for (options, bound) in
        [(options(1e-8, 1.0, None), 1e-7), (options(1e-12, 1.0, None), 1e-9), (bdf(1e-8, 1.0, None), 1e-6)]
    {
        let (samples, end) = rod().run(&options);
        let (last, start) = (samples.values.last().unwrap(), rod().start.0);
        let shrunk = (-decay).exp();
        for (value, start) in last.iter().zip(&start) {
            let error = (value - shrunk * start).abs() / (shrunk * start.abs().max(1e-2));
            assert!(error < bound, "{:?}: {error:e}, {end:?}", options.method);
        }
    }
}

#[test]
fn what_cannot_be_solved_is_named() {
    // The second unknown is in no equation.
    let mut form = Form::new(
        &[1, 1],
        (&[1.0, 0.0], &[-1.0, 0.0]),
        |_, y, yp, _, out| (out[0], out[1]) = (yp[0] + y[0], yp[0] + y[0]),
        |_, _, _, dy, dyp| {
            dy.copy_from_slice(&[1.0, 0.0, 1.0, 0.0]);
            dyp.copy_from_slice(&[1.0, 0.0, 1.0, 0.0]);
        },
    );
    let stopped = form.run(&options(1e-6, 1.0, None)).1.unwrap_err();
    assert!(matches!(stopped.failure, Failure::Singular { .. }), "{stopped:?}");
    assert!(stopped.failure.to_string().contains("unknown 2"), "{stopped}");
}

#[test]
fn a_law_without_solution_is_reported() {
    // y² + 1 = t has none before 1 s; from 2 s back to 1 s there is one, and none before.
    let mut form = Form::new(
        &[1],
        (&[1.0], &[0.0]),
        |t, y, _, _, out| out[0] = y[0] * y[0] + t - 1.0,
        |_, y, _, dy, _| dy[0] = 2.0 * y[0],
    );
    let stopped = form.run(&options(1e-6, 2.0, None)).1.unwrap_err();
    assert!((stopped.time - 1.0).abs() < 1e-3, "{stopped:?}");
    assert!(stopped.failure.to_string().contains("equation 1"), "{stopped}");
}

#[test]
fn other_methods_are_refused() {
    let mut refused = cubic().run(&bdf(1e-6, 1.0, None)).1.map_err(|stopped| stopped.failure);
    assert!(matches!(refused, Err(Failure::BadMethod { .. })), "{refused:?}");
    refused = Form { index: vec![1, 2], ..stepped() }.run(&bdf(1e-6, 1.0, None)).1.map_err(|stopped| stopped.failure);
    assert!(matches!(refused, Err(Failure::BadMethod { .. })), "{refused:?}");
    let stopped = stepped().run(&Options { method: Method::Explicit, ..options(1e-6, 1.0, None) }).1.unwrap_err();
    assert!(matches!(stopped.failure, Failure::BadMethod { .. }), "{stopped:?}");
}

const LAGS: usize = 8;

/// A chain of lags, all at 0, into the first of which 1 enters; the last unknown is what leaves the chain.
fn lags() -> Form {
    const SIZE: usize = LAGS + 1;
    let mut rates = [0.0; SIZE];
    rates[0] = 1.0;
    Form::new(
        &[1; SIZE],
        (&[0.0; SIZE], &rates),
        |_, y, yp, _, out| {
            (0..LAGS).for_each(|i| out[i] = yp[i] + y[i] - if i == 0 { 1.0 } else { y[i - 1] });
            out[LAGS] = 1e-6 * y[LAGS - 1] - y[LAGS];
        },
        |_, _, _, dy, dyp| {
            for i in 0..LAGS {
                (dy[i * SIZE + i], dyp[i * SIZE + i]) = (1.0, 1.0);
                if i > 0 {
                    dy[i * SIZE + i - 1] = -1.0;
                }
            }
            (dy[SIZE * SIZE - 2], dy[SIZE * SIZE - 1]) = (1e-6, -1.0);
        },
    )
    .with_rates_in(&[[true; LAGS].as_slice(), &[false]].concat())
}

#[test]
fn what_starts_at_rest_needs_no_tolerances() {
    let exact = |t: f64| {
        let terms = (0..LAGS).scan(1.0, |term, k| {
            let this = *term;
            *term *= t / (k + 1) as f64;
            Some(this)
        });
        1.0 - (-t).exp() * terms.sum::<f64>()
    };
    for (options, bound, steps) in [
        (options(1e-6, 10.0, Some(1.0)), 1e-5, 400),
        (options(1e-10, 10.0, Some(1.0)), 1e-9, 2000),
        (bdf(1e-6, 10.0, Some(1.0)), 1e-4, 2000),
    ] {
        let (samples, end) = lags().run(&options);
        let summary = end.unwrap();
        assert!(summary.steps <= steps, "{:?}: {summary:?}", options.method);
        for (t, values) in samples.times.iter().zip(&samples.values).skip(3) {
            let error = (values[LAGS - 1] / exact(*t) - 1.0).abs().max((1e6 * values[LAGS] / exact(*t) - 1.0).abs());
            assert!(error < bound, "{:?}, {t} s: {error:e}, {summary:?}", options.method);
        }
    }
}

/// A pendulum of 1 m released level: position, speed and tension, with its length as the constraint.
fn pendulum() -> Form {
    Form::new(
        &[1, 1, 2, 2, 3],
        (&[1.0, 0.0, 0.0, 0.0, 0.0], &[0.0, 0.0, 0.0, -9.81, 0.0]),
        |_, y, yp, _, out| {
            let [x, h, u, w, tension] = *y else { unreachable!() };
            let length = x * x + h * h - 1.0;
            out.copy_from_slice(&[yp[0] - u, yp[1] - w, yp[2] + tension * x, yp[3] + tension * h + 9.81, length]);
        },
        |_, y, _, dy, dyp| {
            let [x, h, _, _, tension] = *y else { unreachable!() };
            let entries = [(0, 2, -1.0), (1, 3, -1.0), (2, 0, tension), (2, 4, x), (3, 1, tension), (3, 4, h)];
            entries.iter().for_each(|(row, column, value)| dy[5 * row + column] = *value);
            (dy[20], dy[21]) = (2.0 * x, 2.0 * h);
            (0..4).for_each(|i| dyp[6 * i] = 1.0);
        },
    )
    .with_rates_in(&[true, true, true, true, false])
}

#[test]
fn a_pendulum_of_index_3_keeps_length_and_energy_in_every_sample() {
    for (rtol, steps, length, energy) in [(1e-6, 1000, 1e-8, 1e-3), (1e-10, 6000, 1e-11, 1e-7)] {
        let (samples, end) = pendulum().run(&options(rtol, 10.0, Some(0.05)));
        let summary = end.unwrap();
        assert_eq!(samples.times.len(), 201);
        for (t, values) in samples.times.iter().zip(&samples.values) {
            let [x, h, u, w] = values[..4] else { unreachable!() };
            let drift = (x * x + h * h - 1.0).abs();
            let lost = (0.5 * (u * u + w * w) + 9.81 * h).abs() / 9.81;
            assert!(drift < length && lost < energy, "{rtol:e}, {t} s: {drift:e} {lost:e}, {summary:?}");
        }
        assert!(summary.steps <= steps, "{summary:?}");
    }
}
