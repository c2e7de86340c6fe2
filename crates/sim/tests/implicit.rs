//! Systems in implicit form: error, jumps, switches, samples, failures.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow_sim::{
    AbsoluteTolerance, Failure, ImplicitSystem, Method, Options, Sink, Sparsity, Stopped, Summary, simulate_implicit,
};

/// `(t, y, y', mode, out)`.
type Residual = fn(f64, &[f64], &[f64], usize, &mut [f64]);
/// Both derivatives row by row: `(t, y, y', dy, dyp)`.
type Derivatives = fn(f64, &[f64], &[f64], &mut [f64], &mut [f64]);

/// A system with a dense pattern. Its mode counts the jumps and crossings so far.
struct Form {
    index: Vec<u8>,
    start: (Vec<f64>, Vec<f64>),
    scales: Vec<f64>,
    sparsity: Sparsity,
    residual: Residual,
    derivatives: Derivatives,
    linear: bool,
    jumps: Vec<f64>,
    switch: Option<fn(&[f64]) -> f64>,
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
            scales: vec![0.0; index.len()],
            sparsity: Sparsity::dense(index.len()),
            residual,
            derivatives,
            linear: true,
            jumps: vec![],
            switch: None,
            settle: |_, _, _| {},
            mode: 0,
            accepted: vec![],
        }
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
    fn scales(&self) -> &[f64] {
        &self.scales
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
        self.linear.then_some(&[])
    }
    fn observe(&mut self, _: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        out[..y.len()].copy_from_slice(y);
        out[y.len()..].copy_from_slice(yp);
        Ok(())
    }
    fn observed(&self) -> usize {
        2 * self.index.len()
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        self.jumps.iter().copied().find(|&jump| jump > t)
    }
    fn cross_jump(&mut self, t: f64, y: &mut [f64], yp: &mut [f64]) -> Result<(), Failure> {
        self.mode += usize::from(t > 0.0);
        (self.settle)(self.mode, y, yp);
        Ok(())
    }
    fn accept(&mut self, t: f64, _: &[f64], _: &[f64]) -> Result<(), Failure> {
        assert!(self.accepted.last().is_none_or(|&last| last <= t), "time ran backwards");
        self.accepted.push(t);
        Ok(())
    }
    fn switches(&self) -> usize {
        usize::from(self.switch.is_some())
    }
    fn switch_values(&mut self, _: f64, y: &[f64], _: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        if let Some(switch) = self.switch {
            g[0] = switch(y);
        }
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
}

#[test]
fn the_published_values_of_robertson_are_met() {
    let exact = [0.2083340149701255e-07, 0.8333360770334713e-13, 0.999999979166505];
    for (rtol, bound, steps) in [(1e-4, 1e-3, 140), (1e-6, 3e-5, 260), (1e-10, 1e-7, 1100)] {
        let atol = AbsoluteTolerance::Each([1e-4, 1e-10, 1e-2].map(|share| share * rtol).to_vec());
        let (samples, end) = robertson().run(&Options { atol, ..options(rtol, 1e11, Some(1e11)) });
        let summary = end.unwrap();
        assert!(summary.steps <= steps, "{summary:?}");
        for (value, exact) in samples.values[1].iter().zip(exact) {
            assert!((value / exact - 1.0).abs() < bound, "{rtol:e}: {value:e}");
        }
    }
}

#[test]
fn scaled_tolerances_carry_robertson_through() {
    let (samples, end) = robertson().run(&options(1e-6, 1e11, Some(1e11)));
    assert!((samples.values[1][0] / 0.2083340149701255e-07 - 1.0).abs() < 0.01, "{:?} {end:?}", samples.values);
}

/// `y' + y'³ + y` as it is for `cos t`: the rate has no factor.
fn cubic() -> Form {
    let mut form = Form::new(
        &[1],
        (&[1.0], &[0.0]),
        |t, y, yp, _, out| out[0] = yp[0] + yp[0].powi(3) + y[0] + t.sin() + t.sin().powi(3) - t.cos(),
        |_, _, yp, dy, dyp| (dy[0], dyp[0]) = (1.0, 1.0 + 3.0 * yp[0].powi(2)),
    );
    form.linear = false;
    form
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
        form.linear = false;
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
    );
    form.jumps = vec![0.3, 0.77];
    form.settle = |mode, y, yp| {
        y[1] = LEVELS[mode];
        (yp[0], yp[1]) = (y[1] - y[0], 0.0);
    };
    form
}

#[test]
fn jumps_are_met_to_the_last_bit() {
    let mut form = stepped();
    let (samples, end) = form.run(&options(1e-10, 1.0, None));
    assert_eq!(end.unwrap().jumps, 2);
    for jump in [0.3, 0.77] {
        assert_eq!(samples.times.iter().filter(|&&t| t == jump).count(), 2, "both sides of {jump}");
        assert!(form.accepted.contains(&jump));
    }
    let relax = |x: f64, a: f64, t: f64| a + (x - a) * (-t).exp();
    let exact = relax(relax((-0.3_f64).exp(), 1.0, 0.47), -2.0, 0.23);
    let last = samples.values.last().unwrap();
    assert!((last[0] - exact).abs() < 1e-9 && last[1] == -2.0, "{last:?} {exact}");
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
    );
    form.switch = Some(|y| y[0]);
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
    let (samples, end) = ball().run(&options(1e-9, 1.3485, None));
    assert_eq!(end.unwrap().switches, 8);
    let found: Vec<f64> = samples.times.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect();
    assert_eq!(found.len(), 8);
    found.iter().zip(&bounces).for_each(|(t, exact)| assert!((t - exact).abs() < 1e-9, "{t} {exact}"));
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
    let stopped = stepped().run(&Options { method: Method::Explicit, ..options(1e-6, 1.0, None) }).1.unwrap_err();
    assert!(matches!(stopped.failure, Failure::BadMethod { .. }), "{stopped:?}");
}
