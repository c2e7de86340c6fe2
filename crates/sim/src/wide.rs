//! Several runs of one system at once, each with parameters of its own: explicit methods of fixed step on vectors of lanes.
//!
//! Every lane goes its own way in time: its steps end at its own events and samples. A lane does to the last bit what its
//! system does alone.

use crate::driver::{Grid, Run, Stop, StopReason};
use crate::fixed_step::{FixedMethod, Tableau, target};
use crate::simulate::check_start;
use crate::{Affected, Failure, HybridSystem, Method, Options, Sink, Stopped, Summary};

/// Runs at once.
pub const LANES: usize = 16;

/// A number for each lane.
pub type Wide = [f64; LANES];

/// A system for each lane, whose rates and recorded values are computed together.
///
/// `failures` holds a failure for each lane that is out: its numbers mean nothing, and nobody looks at them. A lane that
/// fails puts its own there.
pub trait WideSystem {
    /// The system of a lane: its events and memory, and all that is not done together.
    fn lane(&mut self, lane: usize) -> &mut dyn HybridSystem;
    /// Rates at `(t, x)`, as [`System::rates`](crate::System::rates).
    fn rates(&mut self, t: &Wide, x: &[Wide], dx: &mut [Wide], failures: &mut [Option<Failure>; LANES]);
    /// Recorded values at `(t, x)`, as [`Events::observe`](crate::Events::observe).
    fn observe(&mut self, t: &Wide, x: &[Wide], out: &mut [Wide], failures: &mut [Option<Failure>; LANES]);
    /// Whether [`Events::accept`](crate::Events::accept) has something to do.
    fn remembers(&self) -> bool;
}

/// Integrates all lanes from the states `x`; a method of fixed step that is explicit. `wanted` says which lanes count.
///
/// Gives what came of each lane, as [`simulate`](crate::simulate) does, though without the number of evaluations, which are
/// shared, and without asking sinks after each step whether to go on; lanes that do not count have done nothing.
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
    let mut batch = Batch::new(system, options, step, x.len(), sinks);
    for (lane, wanted) in wanted.into_iter().enumerate() {
        if wanted {
            batch.alone(lane, x, Lane::start);
        } else {
            batch.lanes[lane].over = true;
        }
    }
    while batch.lanes.iter().any(|lane| !lane.over) {
        batch.step(tableau, x);
    }
    batch.outcomes()
}

/// Whether lanes can take this method.
pub fn is_wide(method: Method) -> bool {
    matches!(method, Method::Fixed(FixedMethod::Euler | FixedMethod::Heun | FixedMethod::Rk4))
}

/// One lane on its way.
struct Lane<'a> {
    run: Run<'a>,
    /// Where it has to stop at the latest.
    stop: Stop,
    /// Where its step ends.
    target: f64,
    ticks: Grid,
    /// Whether what happens where it stands is done with, samples included.
    settled: bool,
    over: bool,
}

/// All lanes on their way.
struct Batch<'a> {
    system: &'a mut dyn WideSystem,
    lanes: Vec<Lane<'a>>,
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
type Act<'a> = fn(&mut Lane<'a>, &mut dyn HybridSystem, &mut [f64]) -> Result<(), Failure>;

impl<'a> Batch<'a> {
    fn new<S: Sink>(
        system: &'a mut dyn WideSystem,
        options: &'a Options,
        step: f64,
        states: usize,
        sinks: &'a mut [S; LANES],
    ) -> Batch<'a> {
        let lane = |(lane, sink): (usize, &'a mut S)| Lane {
            run: Run::new(options, sink, &*system.lane(lane)),
            stop: Stop { time: options.from, is_event: false },
            target: options.from,
            ticks: Grid::new(options.from, step),
            settled: false,
            over: false,
        };
        let lanes: Vec<Lane<'a>> = sinks.iter_mut().enumerate().map(lane).collect();
        Batch {
            remembers: system.remembers(),
            arch: pulp::Arch::new(),
            out: vec![[0.0; LANES]; system.lane(0).observed()],
            lanes,
            system,
            failures: [const { None }; LANES],
            stages: vec![[0.0; LANES]; 4 * states],
            trial: vec![[0.0; LANES]; states],
            state: vec![0.0; states],
        }
    }

    /// A step of every lane that is not over.
    fn step(&mut self, tableau: &Tableau, x: &mut [Wide]) {
        let (mut t, mut h) = ([0.0; LANES], [0.0; LANES]);
        for (i, lane) in self.lanes.iter_mut().enumerate() {
            if !lane.over {
                lane.target = target(&mut lane.ticks, lane.run.time, lane.run.next_sample(), lane.stop.time);
            }
            (t[i], h[i]) = (lane.run.time, lane.target - lane.run.time);
        }
        self.explicit(tableau, &t, &h, x);
        let mut due = [None; LANES];
        for (i, due) in due.iter_mut().enumerate() {
            self.lanes[i].over |= self.failures[i].is_some();
            if !self.lanes[i].over {
                *due = self.arrive(i, x);
            }
        }
        if due.iter().any(Option::is_some) {
            self.record(due, x);
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

    /// A lane has come to the end of its step. Gives as which time a sample is due there that can be taken with those of
    /// others.
    fn arrive(&mut self, i: usize, x: &mut [Wide]) -> Option<f64> {
        let target = self.lanes[i].target;
        if let Some(state) = self.trial.iter().position(|value| !value[i].is_finite()) {
            let what = Affected::variable(self.system.lane(i).state_name(state));
            self.fail(i, Failure::NotFinite { time: target, what });
            return None;
        }
        x.iter_mut().zip(&self.trial).for_each(|(x, trial)| x[i] = trial[i]);
        let lane = &mut self.lanes[i];
        lane.run.counts.steps += 1;
        lane.settled = false;
        let at_event = lane.stop.is_event && lane.stop.time == target;
        if at_event || self.remembers || lane.run.looks_at_every_step() {
            self.alone(i, x, Lane::arrive);
        } else {
            lane.run.time = target;
        }
        let lane = &self.lanes[i];
        if lane.over || lane.settled { None } else { lane.run.due() }
    }

    /// Lets a lane act on its own, and puts its state back.
    fn alone(&mut self, i: usize, x: &mut [Wide], act: Act<'a>) {
        let mut state = std::mem::take(&mut self.state);
        state.iter_mut().zip(&*x).for_each(|(state, x)| *state = x[i]);
        let done = act(&mut self.lanes[i], self.system.lane(i), &mut state);
        x.iter_mut().zip(&state).for_each(|(x, state)| x[i] = *state);
        self.state = state;
        if let Err(failure) = done {
            self.fail(i, failure);
        }
    }

    /// Samples of several lanes together.
    fn record(&mut self, due: [Option<f64>; LANES], x: &[Wide]) {
        let t: Wide = std::array::from_fn(|l| self.lanes[l].run.time);
        let out_of = |l: usize| due[l].is_none().then_some(Failure::Interrupted { time: t[l] });
        let mut failures = std::array::from_fn(out_of);
        self.system.observe(&t, x, &mut self.out, &mut failures);
        for (i, failure) in failures.into_iter().enumerate() {
            let Some(label) = due[i] else { continue };
            if let Some(failure) = failure {
                self.fail(i, failure);
                continue;
            }
            let lane = &mut self.lanes[i];
            lane.run.record_values(label, self.out.iter().map(|out| out[i]));
            lane.over = lane.run.time >= lane.run.to;
        }
    }

    fn fail(&mut self, lane: usize, failure: Failure) {
        self.failures[lane] = Some(failure);
        self.lanes[lane].over = true;
    }

    #[allow(clippy::result_large_err, reason = "a run fails once")]
    fn outcomes(self) -> Vec<Result<Summary, Stopped>> {
        let outcome = |(lane, failure): (Lane<'_>, Option<Failure>)| lane.run.ended(failure.map_or(Ok(()), Err));
        self.lanes.into_iter().zip(self.failures).map(outcome).collect()
    }
}

impl Lane<'_> {
    fn start(&mut self, system: &mut dyn HybridSystem, x: &mut [f64]) -> Result<(), Failure> {
        check_start(system, self.run.time, x)?;
        self.run.start(system, x)?;
        self.stop = self.run.next_stop(system);
        Ok(())
    }

    /// The end of a step of a lane that has events or memory.
    fn arrive(&mut self, system: &mut dyn HybridSystem, x: &mut [f64]) -> Result<(), Failure> {
        let crossed = self.run.has_crossed(system, self.target, x)?;
        let reason = self.run.arrive(system, self.target, self.stop, crossed, x)?;
        if reason == StopReason::StepEnd {
            return Ok(());
        }
        self.run.handle_stop(system, reason, x)?;
        self.settled = true;
        self.stop = self.run.next_stop(system);
        self.over = self.run.time >= self.run.to;
        Ok(())
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
