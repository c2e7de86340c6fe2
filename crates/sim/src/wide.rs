//! Several runs of one system at once, each with parameters of its own: explicit methods of fixed step on vectors of lanes.
//!
//! Every lane goes its own way in time: its steps end at its own jumps and samples. A lane does to the last bit what its
//! system does alone.

use crate::events::Sides;
use crate::fixed_step::{FixedMethod, Tableau};
use crate::grid::Grid;
use crate::shared::Counted;
use crate::{Failure, Method, Options, Sink, Stopped, Summary, System};

/// Runs at once.
pub const LANES: usize = 16;

/// A number for each lane.
pub type Wide = [f64; LANES];

/// A system for each lane, whose rates and recorded values are computed together.
///
/// `failures` holds a failure for each lane that is out: its numbers mean nothing, and nobody looks at them. A lane that
/// fails puts its own there.
pub trait WideSystem {
    /// The system of a lane: its jumps, switches and memory, and all that is not done together.
    fn lane(&mut self, lane: usize) -> &mut dyn System;
    /// Rates at `(t, x)`, as [`System::rates`].
    fn rates(&mut self, t: &Wide, x: &[Wide], dx: &mut [Wide], failures: &mut [Option<Failure>; LANES]);
    /// Recorded values at `(t, x)`, as [`System::observe`].
    fn observe(&mut self, t: &Wide, x: &[Wide], out: &mut [Wide], failures: &mut [Option<Failure>; LANES]);
    /// Whether [`System::accept`] has something to do.
    fn remembers(&self) -> bool;
}

/// Integrates all lanes from the states `x`; a method of fixed step that is explicit. `wanted` says which lanes count.
///
/// Gives what came of each lane, as [`simulate`](crate::simulate) does; lanes that do not count have done nothing.
///
/// # Panics
/// If the method is not explicit with a step of fixed length, or the options make no sense.
pub fn simulate_wide<S: Sink>(
    system: &mut dyn WideSystem,
    options: &Options,
    x: &mut [Wide],
    sinks: &mut [S; LANES],
    wanted: [bool; LANES],
) -> Vec<Result<Summary, Stopped>> {
    let (Method::Fixed(method), Some(step)) = (options.method, options.step) else {
        panic!("lanes need a method of fixed step, and its step")
    };
    let tableau = method.tableau().expect("lanes need an explicit method");
    let mut all = All::new(system, options, step, x.len());
    for (lane, sink) in sinks.iter_mut().enumerate() {
        if wanted[lane] {
            let state: Vec<f64> = x.iter().map(|x| x[lane]).collect();
            all.settle_lane(lane, state, x, sink, Lane::start);
        } else {
            all.lanes[lane].over = true;
        }
    }
    while all.lanes.iter().any(|lane| !lane.over) {
        all.step(tableau, x, sinks);
    }
    all.outcomes()
}

/// Whether lanes can take this method.
pub fn is_wide(method: Method) -> bool {
    matches!(method, Method::Fixed(FixedMethod::Euler | FixedMethod::Heun | FixedMethod::Rk4))
}

/// One lane on its way.
struct Lane {
    time: f64,
    target: f64,
    jump: Option<f64>,
    ticks: Grid,
    grid: Option<Grid>,
    sides: Sides,
    counts: Summary,
    /// Whether a sample was taken where the lane stands.
    sampled: bool,
    over: bool,
    values: Vec<f64>,
}

/// All lanes on their way.
struct All<'a> {
    system: &'a mut dyn WideSystem,
    options: &'a Options,
    lanes: Vec<Lane>,
    failures: [Option<Failure>; LANES],
    stages: Vec<Wide>,
    trial: Vec<Wide>,
    out: Vec<Wide>,
    /// The state of one lane.
    state: Vec<f64>,
    remembers: bool,
    arch: pulp::Arch,
}

/// What a lane does with its system where it stands.
type Act<S> = fn(&mut Lane, &Options, &mut dyn System, &mut [f64], &mut S) -> Result<(), Failure>;

impl<'a> All<'a> {
    fn new(system: &'a mut dyn WideSystem, options: &'a Options, step: f64, states: usize) -> All<'a> {
        let lane = |lane: usize, system: &mut dyn WideSystem| {
            let (switches, observed) = (system.lane(lane).switches(), system.lane(lane).observed());
            Lane {
                time: options.from,
                target: options.from,
                jump: None,
                ticks: Grid::new(options.from, step),
                grid: options.every.map(|every| Grid::new(options.from, every)),
                sides: Sides::new(switches),
                counts: Summary::default(),
                sampled: false,
                over: false,
                values: vec![0.0; observed],
            }
        };
        let lanes: Vec<Lane> = (0..LANES).map(|i| lane(i, system)).collect();
        All {
            remembers: system.remembers(),
            arch: pulp::Arch::new(),
            out: vec![[0.0; LANES]; lanes[0].values.len()],
            lanes,
            system,
            options,
            failures: [const { None }; LANES],
            stages: vec![[0.0; LANES]; 4 * states],
            trial: vec![[0.0; LANES]; states],
            state: vec![0.0; states],
        }
    }

    /// A step of every lane that is not over.
    fn step<S: Sink>(&mut self, tableau: &Tableau, x: &mut [Wide], sinks: &mut [S; LANES]) {
        let (mut t, mut h) = ([0.0; LANES], [0.0; LANES]);
        for (i, lane) in self.lanes.iter_mut().enumerate() {
            if !lane.over {
                lane.aim(self.options, self.system.lane(i));
            }
            (t[i], h[i]) = (lane.time, lane.target - lane.time);
        }
        self.explicit(tableau, &t, &h, x);
        let mut due = [false; LANES];
        for i in 0..LANES {
            if self.lanes[i].over {
                continue;
            }
            if self.failures[i].is_some() {
                self.lanes[i].over = true;
                continue;
            }
            due[i] = self.arrive(i, x, &mut sinks[i]);
        }
        if due.contains(&true) {
            self.record(due, x, sinks);
        }
    }

    fn explicit(&mut self, tableau: &Tableau, t: &Wide, h: &Wide, x: &[Wide]) {
        let n = x.len();
        for (stage, (node, weights)) in tableau.nodes.iter().zip(tableau.stages).enumerate() {
            let (earlier, rest) = self.stages.split_at_mut(stage * n);
            self.arch.dispatch(Advance { x, h, weights, rates: earlier, out: &mut self.trial });
            let at: Wide = std::array::from_fn(|l| t[l] + node * h[l]);
            self.system.rates(&at, &self.trial, &mut rest[..n], &mut self.failures);
        }
        let Self { stages, trial, .. } = self;
        self.arch.dispatch(Advance { x, h, weights: tableau.weights, rates: stages, out: trial });
    }

    /// A lane has come to the end of its step. Gives whether a sample is due there that can be taken with those of others.
    fn arrive<S: Sink>(&mut self, i: usize, x: &mut [Wide], sink: &mut S) -> bool {
        let target = self.lanes[i].target;
        if let Some(state) = self.trial.iter().position(|value| !value[i].is_finite()) {
            let what = self.system.lane(i).state_name(state);
            self.fail(i, Failure::NotFinite { time: target, what });
            return false;
        }
        x.iter_mut().zip(&self.trial).for_each(|(x, trial)| x[i] = trial[i]);
        let lane = &mut self.lanes[i];
        lane.counts.steps += 1;
        let at_jump = lane.jump == Some(target);
        if !(at_jump || self.remembers || !lane.sides.is_empty()) {
            lane.time = target;
            return lane.is_due(self.options);
        }
        self.state.iter_mut().zip(&*x).for_each(|(state, x)| *state = x[i]);
        let state = std::mem::take(&mut self.state);
        self.state = self.settle_lane(i, state, x, sink, Lane::arrive);
        let lane = &self.lanes[i];
        !lane.over && !lane.sampled && lane.is_due(self.options)
    }

    /// Lets a lane act on its own, and puts its state back.
    fn settle_lane<S: Sink>(
        &mut self,
        i: usize,
        mut state: Vec<f64>,
        x: &mut [Wide],
        sink: &mut S,
        act: Act<S>,
    ) -> Vec<f64> {
        let done = act(&mut self.lanes[i], self.options, self.system.lane(i), &mut state, sink);
        x.iter_mut().zip(&state).for_each(|(x, state)| x[i] = *state);
        if let Err(failure) = done {
            self.fail(i, failure);
        } else if self.lanes[i].sampled && self.lanes[i].time >= self.options.to {
            self.lanes[i].over = true;
        }
        state
    }

    /// Samples of several lanes together.
    fn record<S: Sink>(&mut self, due: [bool; LANES], x: &[Wide], sinks: &mut [S; LANES]) {
        let t: Wide = std::array::from_fn(|l| self.lanes[l].time);
        let mut failures =
            std::array::from_fn(|l| if due[l] { None } else { Some(Failure::Interrupted { time: t[l] }) });
        self.system.observe(&t, x, &mut self.out, &mut failures);
        for (i, failure) in failures.into_iter().enumerate().filter(|(i, _)| due[*i]) {
            if let Some(failure) = failure {
                self.fail(i, failure);
                continue;
            }
            let lane = &mut self.lanes[i];
            lane.values.iter_mut().zip(&self.out).for_each(|(value, out)| *value = out[i]);
            lane.hand_over(self.options, &mut sinks[i]);
            lane.over = lane.time >= self.options.to;
        }
    }

    fn fail(&mut self, lane: usize, failure: Failure) {
        self.failures[lane] = Some(failure);
        self.lanes[lane].over = true;
    }

    #[allow(clippy::result_large_err, reason = "a run fails once")]
    fn outcomes(self) -> Vec<Result<Summary, Stopped>> {
        let outcome = |(lane, failure): (Lane, Option<Failure>)| match failure {
            None => Ok(lane.counts),
            Some(failure) => Err(Stopped { failure, time: lane.time, summary: lane.counts }),
        };
        self.lanes.into_iter().zip(self.failures).map(outcome).collect()
    }
}

impl Lane {
    /// Where the step that starts now has to end, as in a run alone.
    fn aim(&mut self, options: &Options, system: &mut dyn System) {
        self.sampled = false;
        self.ticks.pass(self.time);
        self.jump = system.next_jump(self.time);
        let tick = self.ticks.next();
        let target = tick.min(self.grid.as_ref().map_or(tick, Grid::next));
        let slack = self.ticks.slack();
        let target = if target + slack >= options.to { options.to } else { target };
        self.target = self.jump.filter(|&jump| jump <= target + slack && jump <= options.to).unwrap_or(target);
    }

    fn start<S: Sink>(
        &mut self,
        options: &Options,
        system: &mut dyn System,
        x: &mut [f64],
        sink: &mut S,
    ) -> Result<(), Failure> {
        if let Some(state) = x.iter().position(|value| !value.is_finite()) {
            return Err(Failure::NotFinite { time: self.time, what: system.state_name(state) });
        }
        self.cross(system, x)?;
        system.accept(self.time, x)?;
        self.sample(options, system, x, sink)
    }

    /// The end of a step of a lane that has jumps, switches or memory.
    fn arrive<S: Sink>(
        &mut self,
        options: &Options,
        system: &mut dyn System,
        x: &mut [f64],
        sink: &mut S,
    ) -> Result<(), Failure> {
        let switched = self.sides.crossed(&mut Counted::new(system), self.target, x)?.is_some();
        let at_jump = self.jump == Some(self.target);
        self.counts.switches += usize::from(switched);
        if at_jump {
            self.counts.meet(system.is_corner(self.target));
        }
        self.time = self.target;
        system.accept(self.time, x)?;
        if switched || at_jump {
            if self.grid.is_none() {
                self.sample(options, system, x, sink)?;
            }
            self.cross(system, x)?;
            if self.is_due(options) {
                self.sample(options, system, x, sink)?;
            }
        }
        Ok(())
    }

    fn cross(&mut self, system: &mut dyn System, x: &mut [f64]) -> Result<(), Failure> {
        system.cross_jump(self.time, x)?;
        self.sides.take(&mut Counted::new(system), self.time, x)
    }

    fn sample<S: Sink>(
        &mut self,
        options: &Options,
        system: &mut dyn System,
        x: &[f64],
        sink: &mut S,
    ) -> Result<(), Failure> {
        system.observe(self.time, x, &mut self.values)?;
        if let Some(value) = self.values.iter().position(|value| value.is_nan()) {
            return Err(Failure::NotFinite { time: self.time, what: system.observed_name(value) });
        }
        self.hand_over(options, sink);
        Ok(())
    }

    /// Hands over the values, as those of the time on the grid that is meant.
    fn hand_over<S: Sink>(&mut self, options: &Options, sink: &mut S) {
        let due = self.grid.as_ref().filter(|grid| grid.is_due(self.time)).map_or(self.time, Grid::next);
        let label = if self.time >= options.to { options.to } else { due };
        sink.sample(label, &self.values);
        if let Some(grid) = &mut self.grid {
            grid.pass(label);
        }
        self.sampled = true;
    }

    /// Whether a sample is due where the lane stands.
    fn is_due(&self, options: &Options) -> bool {
        self.time >= options.to || self.grid.as_ref().is_none_or(|grid| grid.is_due(self.time))
    }
}

/// `out = x + h · Σ weight · rates`, as one at a time.
struct Advance<'a> {
    x: &'a [Wide],
    h: &'a Wide,
    weights: &'a [f64],
    rates: &'a [Wide],
    out: &'a mut [Wide],
}

/// A type of its own, not a closure: only then is all of it compiled for the vectors of the machine.
impl pulp::WithSimd for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Advance { x, h, weights, rates, out } = self;
        let states = x.len();
        for (i, (out, x)) in out.iter_mut().zip(x).enumerate() {
            let mut sum = [-0.0; LANES];
            for (stage, weight) in weights.iter().enumerate() {
                let rate = &rates[stage * states + i];
                (0..LANES).for_each(|l| sum[l] += weight * rate[l]);
            }
            *out = std::array::from_fn(|l| x[l] + h[l] * sum[l]);
        }
    }
}
