//! Several runs of one system at once, each with parameters of its own: explicit methods of fixed step on vectors of lanes.
//!
//! Every lane goes its own way in time: its steps end at its own events and samples. What is not the same arithmetic for all,
//! as events, exchanges of independent variables or steps that have to end sooner, a lane does by itself, by the driver's own
//! functions. So it does to the last bit what its system does alone.
//!
//! Lanes whose modes differ cannot be computed together. Those of the mode that most are in go on, and the others wait until
//! theirs has the most; where few are left in each, one goes on alone until it changes its mode.

use crate::driver::{Flow, Grid, Run, Stop, StopReason};
use crate::fixed_step::{FixedMethod, FixedStep, Tableau, Ticks, target};
use crate::shared::Counted;
use crate::simulate::check_start;
use crate::{Failure, HybridSystem, Method, Options, Sink, Stopped, Summary};
use std::collections::BTreeMap;

/// Runs at once.
pub const LANES: usize = 16;

/// So many lanes of one mode at least are computed together: fewer are sooner done one by one.
const TOGETHER: usize = 6;

/// A number for each lane.
pub type Wide = [f64; LANES];

/// A system for each lane, whose rates and recorded values are computed together.
///
/// `failures` holds a failure for each lane that is out: its numbers mean nothing, and nobody looks at them. A lane that
/// fails puts its own there. The others are in one mode.
pub trait WideSystem {
    /// The system of a lane: its events and memory, and all that is not done together.
    fn lane(&mut self, lane: usize) -> &mut dyn HybridSystem;
    /// The number of the mode that a lane is in.
    fn mode(&self, lane: usize) -> u32;
    /// Whether lanes may change their modes.
    fn may_change_mode(&self) -> bool;
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
/// shared, and without asking all sinks after each step whether to go on; lanes that do not count have done nothing.
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
    let mut batch = Batch::new(system, options, (method, step), x.len(), sinks);
    for (lane, wanted) in wanted.into_iter().enumerate() {
        if wanted {
            batch.alone(lane, x, Lane::start);
        } else {
            batch.lanes[lane].over = true;
        }
    }
    while let Some(next) = batch.next() {
        match next {
            Next::Together(lanes) => batch.step(tableau, x, lanes),
            Next::Alone(lane) => batch.go_on_alone(lane, x),
        }
    }
    batch.outcomes()
}

/// Whether lanes can take this method.
pub fn is_wide(method: Method) -> bool {
    matches!(method, Method::Fixed(FixedMethod::Euler | FixedMethod::Heun | FixedMethod::Rk4))
}

/// Who goes on.
enum Next {
    /// These lanes, by a step.
    Together([bool; LANES]),
    /// This one, to its end or to another mode.
    Alone(usize),
}

/// One lane on its way.
struct Lane<'a> {
    run: Run<'a>,
    /// Where it has to stop at the latest.
    stop: Stop,
    /// Where its step ends.
    target: f64,
    ticks: Grid,
    step: f64,
    /// What happens where it stands.
    reason: StopReason,
    over: bool,
}

/// All lanes on their way.
struct Batch<'a> {
    system: &'a mut dyn WideSystem,
    lanes: Vec<Lane<'a>>,
    failures: [Option<Failure>; LANES],
    /// Lanes that take part in the present step; a failure for each of the others, and for those whose step fails.
    stepped: [bool; LANES],
    out_of_step: [Option<Failure>; LANES],
    stages: Vec<Wide>,
    trial: Vec<Wide>,
    out: Vec<Wide>,
    /// The state of one lane, and the method by which it goes on alone.
    state: Vec<f64>,
    method: FixedStep,
    /// Whether each lane looks at what happens where each step ends.
    looks: bool,
    arch: pulp::Arch,
}

/// What a lane does with its system where it stands.
type Act<'a> = fn(&mut Lane<'a>, &mut dyn HybridSystem, &mut [f64]) -> Result<(), Failure>;

impl<'a> Batch<'a> {
    fn new<S: Sink>(
        system: &'a mut dyn WideSystem,
        options: &'a Options,
        (method, step): (FixedMethod, f64),
        states: usize,
        sinks: &'a mut [S; LANES],
    ) -> Batch<'a> {
        let lane = |(lane, sink): (usize, &'a mut S)| Lane {
            run: Run::new(options, sink, &*system.lane(lane)),
            stop: Stop { time: options.from, is_event: false },
            target: options.from,
            ticks: Grid::new(options.from, step),
            step,
            reason: StopReason::StepEnd,
            over: false,
        };
        let lanes: Vec<Lane<'a>> = sinks.iter_mut().enumerate().map(lane).collect();
        Batch {
            looks: system.remembers() || system.may_change_mode() || options.project,
            arch: pulp::Arch::new(),
            out: vec![[0.0; LANES]; system.lane(0).observed()],
            method: FixedStep::new(method, system.lane(0).sparsity()),
            lanes,
            system,
            failures: [const { None }; LANES],
            stepped: [true; LANES],
            out_of_step: [const { None }; LANES],
            stages: vec![[0.0; LANES]; 4 * states],
            trial: vec![[0.0; LANES]; states],
            state: vec![0.0; states],
        }
    }

    /// Who goes on next; nobody where all are over.
    fn next(&self) -> Option<Next> {
        let open: [bool; LANES] = std::array::from_fn(|l| !self.lanes[l].over);
        if !open.contains(&true) {
            return None;
        }
        if !self.system.may_change_mode() {
            return Some(Next::Together(open));
        }
        let mut modes: BTreeMap<u32, usize> = BTreeMap::new();
        (0..LANES).filter(|&l| open[l]).for_each(|l| *modes.entry(self.system.mode(l)).or_default() += 1);
        let (mode, count) = modes.into_iter().rev().max_by_key(|&(_, count)| count)?;
        if count >= TOGETHER {
            return Some(Next::Together(std::array::from_fn(|l| open[l] && self.system.mode(l) == mode)));
        }
        let time = |l: &usize| self.lanes[*l].run.time;
        (0..LANES).filter(|&l| open[l]).min_by(|a, b| time(a).total_cmp(&time(b))).map(Next::Alone)
    }

    /// A step of these lanes.
    fn step(&mut self, tableau: &Tableau, x: &mut [Wide], lanes: [bool; LANES]) {
        let (mut t, mut h) = ([0.0; LANES], [0.0; LANES]);
        for (i, lane) in self.lanes.iter_mut().enumerate() {
            if lanes[i] {
                lane.target = target(&mut lane.ticks, lane.run.time, lane.run.next_sample(), lane.stop.time);
            }
            (t[i], h[i]) = (lane.run.time, lane.target - lane.run.time);
        }
        self.only(lanes);
        self.explicit(tableau, (&t, &h), x);
        let mut due = [None; LANES];
        for i in (0..LANES).filter(|&l| lanes[l]) {
            let outcome = self.out_of_step[i].take().map_or(Ok(()), Err);
            due[i] = self.arrive(i, x, outcome);
        }
        if due.iter().any(Option::is_some) {
            self.record(due, x);
        }
        if self.system.may_change_mode() {
            let good: Vec<usize> = (0..LANES).filter(|&l| lanes[l] && self.failures[l].is_none()).collect();
            good.into_iter().for_each(|l| self.alone(l, x, Lane::exchange));
        }
    }

    /// Only these lanes take part in the next step.
    fn only(&mut self, lanes: [bool; LANES]) {
        if self.stepped != lanes {
            let out_of = |l: usize| (!lanes[l]).then(|| Failure::Interrupted { time: self.lanes[l].run.time });
            (self.out_of_step, self.stepped) = (std::array::from_fn(out_of), lanes);
        }
    }

    fn explicit(&mut self, tableau: &Tableau, (t, h): (&Wide, &Wide), x: &[Wide]) {
        let n = x.len();
        for (stage, (node, weights)) in tableau.nodes.iter().zip(tableau.stages).enumerate() {
            let (earlier, rest) = self.stages.split_at_mut(stage * n);
            self.arch.dispatch(Advance { x, h, weights, rates: earlier, out: &mut self.trial });
            let at: Wide = std::array::from_fn(|l| t[l] + node * h[l]);
            self.system.rates(&at, &self.trial, &mut rest[..n], &mut self.out_of_step);
        }
        let Self { stages, trial, .. } = self;
        self.arch.dispatch(Advance { x, h, weights: tableau.weights, rates: stages, out: trial });
    }

    /// A lane has come to the end of its step. Gives as which time a sample is due there that can be taken with those of
    /// others.
    fn arrive(&mut self, i: usize, x: &mut [Wide], outcome: Result<(), Failure>) -> Option<f64> {
        let lane = &mut self.lanes[i];
        let at_event = lane.stop.is_event && lane.stop.time == lane.target;
        let finite = outcome.is_ok() && self.trial.iter().all(|value| value[i].is_finite());
        if !finite || at_event || self.looks || lane.run.looks_at_every_step() {
            self.method.take_over(self.trial.iter().map(|value| value[i]));
            self.by_itself(i, x, |lane, system, method, x| {
                let target = lane.target;
                lane.arrive(&mut Ticks::made(method, Counted::new(system), target, outcome), x)
            });
        } else {
            x.iter_mut().zip(&self.trial).for_each(|(x, trial)| x[i] = trial[i]);
            lane.run.counts.steps += 1;
            (lane.run.time, lane.reason) = (lane.target, StopReason::StepEnd);
        }
        let lane = &self.lanes[i];
        if lane.over || lane.reason != StopReason::StepEnd { None } else { lane.run.due() }
    }

    /// Lets a lane go on alone, to its end or to another mode.
    fn go_on_alone(&mut self, i: usize, x: &mut [Wide]) {
        self.by_itself(i, x, Lane::drive);
    }

    /// Lets a lane act on its own, and puts its state back.
    fn alone(&mut self, i: usize, x: &mut [Wide], act: Act<'a>) {
        self.by_itself(i, x, |lane, system, _, x| act(lane, system, x));
    }

    /// The same with a method to go on by.
    fn by_itself(
        &mut self,
        i: usize,
        x: &mut [Wide],
        act: impl FnOnce(&mut Lane<'a>, &mut dyn HybridSystem, &mut FixedStep, &mut [f64]) -> Result<(), Failure>,
    ) {
        let Batch { state, lanes, system, method, .. } = self;
        state.iter_mut().zip(&*x).for_each(|(state, x)| *state = x[i]);
        let done = act(&mut lanes[i], system.lane(i), method, state);
        x.iter_mut().zip(&*state).for_each(|(x, state)| x[i] = *state);
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

    /// The end of a step that has been made, of a lane that has something to look at there, or whose step has failed.
    fn arrive(&mut self, made: &mut Ticks<'_, '_>, x: &mut [f64]) -> Result<(), Failure> {
        self.reason = self.run.reach(made, self.stop, x)?;
        match self.reason {
            StopReason::StepEnd => return Ok(()),
            StopReason::Exchange => self.begin_again(),
            _ => self.run.handle_stop(made.system().events(), self.reason, x)?,
        }
        self.stop = self.run.next_stop(made.system().events());
        self.over = self.run.time >= self.run.to;
        Ok(())
    }

    /// Looks whether it goes on in another mode.
    fn exchange(&mut self, system: &mut dyn HybridSystem, x: &mut [f64]) -> Result<(), Failure> {
        if self.reason != StopReason::Exchange && self.run.exchange(system, x, false)? {
            self.begin_again();
            self.stop = self.run.next_stop(system);
        }
        Ok(())
    }

    /// Another mode begins: ticks are sought anew, as a run by itself does.
    fn begin_again(&mut self) {
        self.ticks = Grid::new(self.run.options.from, self.step);
    }

    /// Goes on alone, to its end or to another mode.
    fn drive(&mut self, system: &mut dyn HybridSystem, method: &mut FixedStep, x: &mut [f64]) -> Result<(), Failure> {
        let every = (self.run.options.from, self.step);
        let flow = self.run.drive(&mut Ticks::new(method, Counted::new(&mut *system), every), x)?;
        self.over = flow == Flow::GoOn;
        self.begin_again();
        self.stop = self.run.next_stop(system);
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
