//! Systems with known solutions.
#![allow(dead_code)]

use halfarrow_sim::{Failure, Options, Sink, Sparsity, Stopped, Summary, System, simulate};

/// Rates, and values of the switching functions: `(t, x, mode, out)`.
type Function = fn(f64, &[f64], &Mode, &mut [f64]);

/// Between which jumps, and on which sides of the switches, the system is.
#[derive(Clone, Debug, Default)]
pub struct Mode {
    /// Jumps crossed so far.
    pub interval: usize,
    /// Side of each switching function.
    pub sides: Vec<bool>,
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
    pub solution: fn(f64) -> Vec<f64>,
    pub jumps: Vec<f64>,
    pub switches: Function,
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
            solution,
            jumps: vec![],
            switches: |_, _, _, _| {},
            reset: |_, _, _| {},
            mode: Mode::default(),
            latest: f64::NEG_INFINITY,
            accepted: vec![],
        }
    }

    /// With switching functions, `count` of them.
    pub fn with_switches(mut self, count: usize, switches: Function) -> Known {
        self.mode.sides = vec![false; count];
        self.switches = switches;
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
    fn tangent(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        (self.tangent)(t, x, v, &self.mode, jv);
        Ok(())
    }
    fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }
    fn observe(&mut self, _: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        out.copy_from_slice(x);
        Ok(())
    }
    fn observed(&self) -> usize {
        self.start.len()
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        self.jumps.iter().copied().find(|&jump| jump > t)
    }
    fn cross_jump(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        (self.reset)(t, &self.mode, x);
        self.mode.interval = self.jumps.iter().filter(|&&jump| jump <= t).count();
        let mut values = vec![0.0; self.mode.sides.len()];
        (self.switches)(t, x, &self.mode, &mut values);
        self.mode.sides = values.iter().map(|&value| value > 0.0).collect();
        self.latest = t;
        Ok(())
    }
    fn accept(&mut self, t: f64, _: &[f64]) -> Result<(), Failure> {
        assert!(self.accepted.last().is_none_or(|&last| last <= t), "time ran backwards");
        self.accepted.push(t);
        Ok(())
    }
    fn switches(&self) -> usize {
        self.mode.sides.len()
    }
    fn switch_values(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        (self.switches)(t, x, &self.mode, g);
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
