//! Systems with known solutions.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]
#![allow(dead_code)]

use halfarrow_sim::{Events, Failure, Options, Sink, Sparsity, Stopped, Summary, System, simulate};

/// Rates, and event indicators: `(t, x, mode, out)`.
type Function = fn(f64, &[f64], &Mode, &mut [f64]);

/// Between which time events, and with which signs of its event indicators, the system is.
#[derive(Clone, Debug, Default)]
pub struct Mode {
    /// Jumps crossed so far.
    pub interval: usize,
    /// Sign of each event indicator.
    pub signs: Vec<bool>,
}

/// A system with a known solution.
#[derive(Clone)]
pub struct Known {
    pub start: Vec<f64>,
    pub scales: Vec<f64>,
    pub sparsity: Sparsity,
    pub rates: Function,
    /// `(t, x, v, mode, out)`.
    pub tangent: fn(f64, &[f64], &[f64], &Mode, &mut [f64]),
    /// Derivative of the rates by time: `(t, x, out)`.
    pub drift: fn(f64, &[f64], &mut [f64]),
    pub solution: fn(f64) -> Vec<f64>,
    pub jumps: Vec<f64>,
    pub indicators: Function,
    /// Changes the state at a jump or crossing: `(t, mode before, x)`.
    pub reset: fn(f64, &Mode, &mut [f64]),
    pub mode: Mode,
    /// Latest time at which anything was evaluated since the last jump.
    pub latest: f64,
    /// Times accepted.
    pub accepted: Vec<f64>,
}

impl Known {
    pub fn new(
        start: &[f64],
        rates: Function,
        tangent: fn(f64, &[f64], &[f64], &Mode, &mut [f64]),
        solution: fn(f64) -> Vec<f64>,
    ) -> Known {
        Known {
            start: start.to_vec(),
            scales: vec![0.0; start.len()],
            sparsity: Sparsity::dense(start.len()),
            rates,
            tangent,
            drift: |_, _, out| out.fill(0.0),
            solution,
            jumps: vec![],
            indicators: |_, _, _, _| {},
            reset: |_, _, _| {},
            mode: Mode::default(),
            latest: f64::NEG_INFINITY,
            accepted: vec![],
        }
    }

    /// With event indicators, `count` of them.
    pub fn with_indicators(mut self, count: usize, indicators: Function) -> Known {
        self.mode.signs = vec![false; count];
        self.indicators = indicators;
        self
    }

    /// Greatest distance from the solution relative to the greatest magnitude of each state.
    pub fn error(&self, samples: &Samples) -> f64 {
        let exact: Vec<Vec<f64>> = samples.times.iter().map(|&t| (self.solution)(t)).collect();
        (0..self.start.len())
            .map(|i| {
                let size = exact.iter().fold(0.0, |most: f64, x| most.max(x[i].abs()));
                let error =
                    exact.iter().zip(&samples.values).fold(0.0, |most: f64, (x, y)| most.max((x[i] - y[i]).abs()));
                if error == 0.0 { 0.0 } else { error / size }
            })
            .fold(0.0, f64::max)
    }

    /// Runs it from its start.
    pub fn run(&mut self, options: &Options) -> (Samples, Result<Summary, Stopped>) {
        let (mut x, mut samples) = (self.start.clone(), Samples::default());
        let end = simulate(self, options, &mut x, &mut samples);
        (samples, end)
    }
}

impl System for Known {
    fn states(&self) -> usize {
        self.start.len()
    }
    fn scales(&self) -> &[f64] {
        &self.scales
    }
    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        self.latest = self.latest.max(t);
        (self.rates)(t, x, &self.mode, dx);
        match dx.iter().all(|rate| rate.is_finite()) {
            true => Ok(()),
            false => Err(Failure::NotFinite { time: t, what: "a rate".into() }),
        }
    }
    fn directional_derivative(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        (self.tangent)(t, x, v, &self.mode, jv);
        Ok(())
    }
    fn time_derivative(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        (self.drift)(t, x, out);
        Ok(())
    }
    fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }
}

impl Events for Known {
    fn next_time_event(&mut self, t: f64) -> Option<f64> {
        self.jumps.iter().copied().find(|&jump| jump > t)
    }
    fn indicators(&self) -> usize {
        self.mode.signs.len()
    }
    fn event_indicators(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        (self.indicators)(t, x, &self.mode, g);
        Ok(())
    }
    fn handle_event(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        (self.reset)(t, &self.mode, x);
        self.mode.interval = self.jumps.iter().filter(|&&jump| jump <= t).count();
        let mut values = vec![0.0; self.mode.signs.len()];
        (self.indicators)(t, x, &self.mode, &mut values);
        self.mode.signs = values.iter().map(|&value| value > 0.0).collect();
        self.latest = t;
        Ok(())
    }
    fn accept(&mut self, t: f64, _: &[f64]) -> Result<(), Failure> {
        assert!(self.accepted.last().is_none_or(|&last| last <= t), "time ran backwards");
        self.accepted.push(t);
        Ok(())
    }
    fn observed(&self) -> usize {
        self.start.len()
    }
    fn observe(&mut self, _: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        out.copy_from_slice(x);
        Ok(())
    }
}

/// All samples of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    pub times: Vec<f64>,
    pub values: Vec<Vec<f64>>,
}

impl Sink for Samples {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.times.push(t);
        self.values.push(values.to_vec());
    }
}

/// `x' = -x`.
pub fn decay() -> Known {
    Known::new(&[1.0], |_, x, _, dx| dx[0] = -x[0], |_, _, v, _, jv| jv[0] = -v[0], |t| vec![(-t).exp()])
}

/// A mass on a spring, 1 rad/s.
pub fn oscillator() -> Known {
    Known::new(
        &[1.0, 0.0],
        |_, x, _, dx| (dx[0], dx[1]) = (x[1], -x[0]),
        |_, _, v, _, jv| (jv[0], jv[1]) = (v[1], -v[0]),
        |t| vec![t.cos(), -t.sin()],
    )
}

/// `x' = -x² `, nonlinear.
pub fn hyperbola() -> Known {
    Known::new(
        &[1.0],
        |_, x, _, dx| dx[0] = -x[0] * x[0],
        |_, x, v, _, jv| jv[0] = -2.0 * x[0] * v[0],
        |t| vec![1.0 / (1.0 + t)],
    )
}

/// `x' = cos t - k (x - sin t)`: stiff, driven, and still exactly `sin t`; `y' = -y²` beside it.
pub fn driven() -> Known {
    const K: f64 = 1e4;
    let mut system = Known::new(
        &[0.0, 1.0],
        |t, x, _, dx| (dx[0], dx[1]) = (t.cos() - K * (x[0] - t.sin()), -x[1] * x[1]),
        |_, x, v, _, jv| (jv[0], jv[1]) = (-K * v[0], -2.0 * x[1] * v[1]),
        |t| vec![t.sin(), 1.0 / (1.0 + t)],
    );
    system.drift = |t, _, out| (out[0], out[1]) = (-t.sin() + K * t.cos(), 0.0);
    system
}

/// `x' = x cos t`, in which everything depends on time.
pub fn swinging() -> Known {
    let mut system = Known::new(
        &[1.0],
        |t, x, _, dx| dx[0] = x[0] * t.cos() * (1.0 + 0.1 * x[0]),
        |t, x, v, _, jv| jv[0] = t.cos() * (1.0 + 0.2 * x[0]) * v[0],
        |t| {
            let grown = t.sin().exp();
            vec![grown / (1.1 - 0.1 * grown)]
        },
    );
    system.drift = |t, x, out| out[0] = -x[0] * t.sin() * (1.0 + 0.1 * x[0]);
    system
}

/// `x' = a - x`, `a` steps from 0 to 1 at 0.3 s and to -2 at 0.77 s; exactly linear in between.
pub fn stepped() -> Known {
    let mut system = Known::new(
        &[1.0],
        |_, x, mode, dx| dx[0] = [0.0, 1.0, -2.0][mode.interval] - x[0],
        |_, _, v, _, jv| jv[0] = -v[0],
        |t| {
            let relax = |x: f64, a: f64, t: f64| a + (x - a) * (-t).exp();
            let first = relax(1.0, 0.0, t.min(0.3));
            let second = if t > 0.3 { relax(first, 1.0, t.min(0.77) - 0.3) } else { first };
            vec![if t > 0.77 { relax(second, -2.0, t - 0.77) } else { second }]
        },
    );
    system.jumps = vec![0.3, 0.77];
    system
}

/// A mass on a spring, 100 rad/s: 160 periods in 10 s.
pub fn fast_oscillator() -> Known {
    Known::new(
        &[1.0, 0.0],
        |_, x, _, dx| (dx[0], dx[1]) = (100.0 * x[1], -100.0 * x[0]),
        |_, _, v, _, jv| (jv[0], jv[1]) = (100.0 * v[1], -100.0 * v[0]),
        |t| vec![(100.0 * t).cos(), -(100.0 * t).sin()],
    )
}

/// The chemical kinetics of Robertson, stiff over eleven decades of time. Source of the values at 1e11 s: [IVPTestSet].
pub fn robertson() -> Known {
    Known::new(
        &[1.0, 0.0, 0.0],
        |_, x, _, dx| {
            let (slow, fast, back) = (0.04 * x[0], 3e7 * x[1] * x[1], 1e4 * x[1] * x[2]);
            (dx[0], dx[1], dx[2]) = (back - slow, slow - back - fast, fast);
        },
        |_, x, v, _, jv| {
            let (slow, fast) = (0.04 * v[0], 6e7 * x[1] * v[1]);
            let back = 1e4 * (v[1] * x[2] + x[1] * v[2]);
            (jv[0], jv[1], jv[2]) = (back - slow, slow - back - fast, fast);
        },
        |_| vec![0.2083340149701255e-07, 0.8333360770334713e-13, 0.999999979166505],
    )
}

/// `x' = -λ (x - cos t) - sin t`, stiff, with the solution `cos t`.
pub fn prothero_robinson() -> Known {
    const RATE: f64 = 1e6;
    Known::new(
        &[1.0],
        |t, x, _, dx| dx[0] = -RATE * (x[0] - t.cos()) - t.sin(),
        |_, _, v, _, jv| jv[0] = -RATE * v[0],
        |t| vec![t.cos()],
    )
}

/// Two masses of very different scale: a charge of 1e-13 C that starts at 0 and follows a motion of 1e5.
pub fn scales_apart() -> Known {
    Known::new(
        &[1e5, 0.0, 0.0],
        |_, x, _, dx| (dx[0], dx[1], dx[2]) = (x[1], -x[0], 1e-18 * x[0] - 3.0 * x[2]),
        |_, _, v, _, jv| (jv[0], jv[1], jv[2]) = (v[1], -v[0], 1e-18 * v[0] - 3.0 * v[2]),
        |t| vec![1e5 * t.cos(), -1e5 * t.sin(), 1e-14 * (3.0 * t.cos() + t.sin() - 3.0 * (-3.0 * t).exp())],
    )
}

/// Heat along a rod of 100 cells that starts as one sine arc: a pattern of three diagonals.
pub fn rod() -> Known {
    const CELLS: usize = 100;
    fn flow(x: &[f64], dx: &mut [f64]) {
        let at = |i: usize| if i == 0 || i > CELLS { 0.0 } else { x[i - 1] };
        (1..=CELLS).for_each(|i| dx[i - 1] = 1e4 * (at(i - 1) - 2.0 * at(i) + at(i + 1)));
    }
    fn arc(cell: usize) -> f64 {
        (std::f64::consts::PI * (cell + 1) as f64 / (CELLS + 1) as f64).sin()
    }
    let start: Vec<f64> = (0..CELLS).map(arc).collect();
    let mut system = Known::new(
        &start,
        |_, x, _, dx| flow(x, dx),
        |_, _, v, _, jv| flow(v, jv),
        |t| {
            let decay = 4e4 * (0.5 * std::f64::consts::PI / (CELLS + 1) as f64).sin().powi(2);
            (0..CELLS).map(|cell| arc(cell) * (-decay * t).exp()).collect()
        },
    );
    let near = |i: usize| (i.saturating_sub(1)..=(i + 1).min(CELLS - 1)).collect();
    system.sparsity = Sparsity::from_columns((0..CELLS).map(near));
    system
}

/// A ball that falls from 1 m and keeps half its speed at each bounce; 9.81 m/s².
pub fn ball() -> Known {
    let mut system = Known::new(
        &[1.0, 0.0],
        |_, x, _, dx| (dx[0], dx[1]) = (x[1], -9.81),
        |_, _, v, _, jv| (jv[0], jv[1]) = (v[1], 0.0),
        |_| vec![],
    )
    .with_indicators(1, |_, x, _, g| g[0] = x[0]);
    system.reset = |t, mode, x| {
        if mode.signs[0] && x[0] <= 0.0 && t > 0.0 {
            (x[0], x[1]) = (f64::MIN_POSITIVE, -0.5 * x[1]);
        }
    };
    system
}

/// A mass between two springs, one of them engaged only for `x > 0`: stiffness 4 there, 1 for `x < 0`.
pub fn lopsided() -> Known {
    let mut system = Known::new(
        &[0.0, 1.0],
        |_, x, mode, dx| (dx[0], dx[1]) = (x[1], if mode.signs[0] { -4.0 * x[0] } else { -x[0] }),
        |_, _, v, mode, jv| (jv[0], jv[1]) = (v[1], if mode.signs[0] { -4.0 * v[0] } else { -v[0] }),
        |t| {
            let (half, period) = (0.5 * std::f64::consts::PI, 1.5 * std::f64::consts::PI);
            let phase = t.rem_euclid(period);
            let slow = phase - half;
            if phase <= half {
                vec![0.5 * (2.0 * phase).sin(), (2.0 * phase).cos()]
            } else {
                vec![-slow.sin(), -slow.cos()]
            }
        },
    )
    .with_indicators(1, |_, x, _, g| g[0] = x[0]);
    system.mode.signs = vec![true];
    system
}

/// A relay that pushes towards 0 with full force: it has no solution beyond 1 s.
pub fn relay() -> Known {
    Known::new(
        &[1.0],
        |_, _, mode, dx| dx[0] = if mode.signs[0] { -1.0 } else { 1.0 },
        |_, _, _, _, jv| jv[0] = 0.0,
        |t| vec![1.0 - t],
    )
    .with_indicators(1, |_, x, _, g| g[0] = x[0])
}

/// `x' = -2 √x`, which has no rate for `x < 0`: `(1 - t)²` until 1 s.
pub fn draining() -> Known {
    Known::new(
        &[1.0],
        |_, x, _, dx| dx[0] = -2.0 * x[0].sqrt(),
        |_, x, v, _, jv| jv[0] = -v[0] / x[0].sqrt(),
        |t| vec![(1.0 - t).powi(2)],
    )
}

/// A pulse of 1 µs and area 1 at 5 s into an integrator.
pub fn pulse() -> Known {
    let mut system = Known::new(
        &[0.0],
        |_, _, mode, dx| dx[0] = if mode.interval == 1 { 1e6 } else { 0.0 },
        |_, _, _, _, jv| jv[0] = 0.0,
        |t| vec![((t - 5.0) * 1e6).clamp(0.0, 1.0)],
    );
    system.jumps = vec![5.0, 5.000001];
    system
}

/// Two signals of 1 rad/s, and a count of how often their difference to 0.999 has changed its sign: twice a period,
/// 0.09 s apart.
pub fn grazing() -> Known {
    let mut system = oscillator().with_indicators(1, |_, x, _, g| g[0] = x[1] - 0.999);
    system.reset = |_, _, _| {};
    system
}

/// Rest at 0 until 5 s, then `x' = (t - 5)²`, which nobody announces.
pub fn late() -> Known {
    Known::new(
        &[0.0],
        |t, _, _, dx| dx[0] = (t - 5.0).max(0.0).powi(2),
        |_, _, _, _, jv| jv[0] = 0.0,
        |t| vec![(t - 5.0).max(0.0).powi(3) / 3.0],
    )
}

/// A ladder of `SECTIONS` coils and capacitors, everything at rest, with a source of 10 V at one end and a resistor at the
/// other: momenta in Vs and charges in C, coil by capacitor. It rests at 10 V behind every coil as soon as the waves have
/// died away, and keeps the law of energy until then.
pub fn ladder<const SECTIONS: usize>() -> Known {
    const COIL: f64 = 1e-3;
    const CAPACITOR: f64 = 1e-6;
    const WIRE: f64 = 5.0;
    fn flow(x: &[f64], supply: f64, dx: &mut [f64]) {
        let sections = x.len() / 2;
        let voltage = |i: usize| if i == 0 { supply } else { x[2 * i - 1] / CAPACITOR };
        let current = |i: usize| if i < sections { x[2 * i] / COIL } else { voltage(sections) / 50.0 };
        for i in 0..sections {
            dx[2 * i] = voltage(i) - WIRE * current(i) - voltage(i + 1);
            dx[2 * i + 1] = current(i) - current(i + 1);
        }
    }
    let mut system = Known::new(
        &vec![0.0; 2 * SECTIONS],
        |_, x, _, dx| flow(x, 10.0, dx),
        |_, _, v, _, jv| flow(v, 0.0, jv),
        |_| {
            let current = 10.0 / (50.0 + WIRE * SECTIONS as f64);
            (0..SECTIONS).flat_map(|i| [COIL * current, CAPACITOR * (10.0 - WIRE * current * (i + 1) as f64)]).collect()
        },
    );
    let near = |i: usize| (i.saturating_sub(1)..=(i + 1).min(2 * SECTIONS - 1)).collect();
    system.sparsity = Sparsity::from_columns((0..2 * SECTIONS).map(near));
    system
}

/// `x' = a - x`, where `a` runs up and down between 0 and 1 in straight lines, one every 10 ms.
pub fn zigzag() -> Known {
    const ROW: f64 = 0.01;
    fn input(t: f64, interval: usize) -> f64 {
        let part = t / ROW - interval as f64;
        if interval.is_multiple_of(2) { part } else { 1.0 - part }
    }
    let mut system = Known::new(
        &[1.0],
        |t, x, mode, dx| dx[0] = input(t, mode.interval) - x[0],
        |_, _, v, _, jv| jv[0] = -v[0],
        |t| {
            // In a row that starts at `x` with `a` of slope `s`: the line `a - s`, and what decays towards it.
            let row = |x: f64, interval: usize, time: f64| {
                let slope = if interval.is_multiple_of(2) { 1.0 / ROW } else { -1.0 / ROW };
                let start = (interval % 2) as f64;
                start + slope * time - slope + (x - start + slope) * (-time).exp()
            };
            let rows = (t / ROW + 1e-9).floor() as usize;
            let x = (0..rows).fold(1.0, |x, interval| row(x, interval, ROW));
            vec![row(x, rows, t - rows as f64 * ROW)]
        },
    );
    system.jumps = (1..=1000).map(|i| i as f64 * ROW).collect();
    system
}

/// `x' = a - x`, where `a` is a table of `sin t` with a row every ms, straight in between.
pub fn table_of_a_sine() -> Known {
    const ROW: f64 = 1e-3;
    let mut system = Known::new(
        &[1.0],
        |t, x, mode, dx| {
            let (start, end) = (mode.interval as f64 * ROW, (mode.interval + 1) as f64 * ROW);
            dx[0] = start.sin() + (t - start) / ROW * (end.sin() - start.sin()) - x[0];
        },
        |_, _, v, _, jv| jv[0] = -v[0],
        |t| vec![0.5 * (t.sin() - t.cos()) + 1.5 * (-t).exp()],
    );
    system.jumps = (1..=10_000).map(|i| i as f64 * ROW).collect();
    system
}

/// A mass that hangs on a spring in equilibrium, to rounding, until the hook is drawn up and down from 1 s on: velocity
/// in m/s, length in m.
pub fn hanging() -> Known {
    let mut system = Known::new(
        &[0.0, 9.81 / 3.0],
        |t, x, mode, dx| {
            let hook = if mode.interval == 0 { 0.0 } else { 0.2 * (t - 1.0).sin() };
            (dx[0], dx[1]) = (3.0 * x[1] - 9.81 * (1.0 + f64::EPSILON), hook - x[0]);
        },
        |_, _, v, _, jv| (jv[0], jv[1]) = (3.0 * v[1], -v[0]),
        |t| {
            let (late, root) = ((t - 1.0).max(0.0), 3.0_f64.sqrt());
            let velocity = 0.3 * (late.sin() - (root * late).sin() / root);
            vec![velocity, 9.81 / 3.0 + 0.1 * (late.cos() - (root * late).cos())]
        },
    );
    system.jumps = vec![1.0];
    system
}
