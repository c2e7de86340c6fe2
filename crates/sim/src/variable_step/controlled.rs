//! A method that chooses its step, as the driver takes it: what begins a step, what follows from it.

use std::ops::DerefMut;

use super::Integrator;
use super::first_step::{first_step, seeing_inside};
use super::stiffness::Stiffness;
use super::tolerances::Tolerances;
use crate::driver::{Flow, Run, Stepper, is_at};
use crate::events::Events;
use crate::shared::Shared;
use crate::{Crawl, Failure, Summary, System};

/// Longest step of a system without states that moves with time, as a part of the run.
const SHORT: f64 = 1e-3;

/// Steps tried in vain one after the other that rounding may be the reason of.
const SUSPICIOUS: usize = 3;

/// Accepted steps after which rounding is looked for, and whenever they are twice as many.
const FIRST_LOOK: usize = 64;

/// Steps after which it is looked whether the run crawls, and whenever they are four times as many.
const MANY: usize = 4096;

/// Steps still to come, at the present pace, from which on it does.
const ENDLESS: f64 = 1e6;

/// Why a method hands over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum HandOver {
    /// The system is stiff.
    Stiff,
    /// States have outgrown the magnitudes that the tolerances were made for.
    Grown,
    /// Tolerances ask for less than rounding leaves; they no longer do. A step that still holds, in s.
    Cleared(f64),
}

/// How to go on at a time event.
#[derive(Clone, Copy)]
struct Resume {
    /// The step, in s.
    step: f64,
    /// It is known that the rates do not jump there.
    bends: bool,
}

/// An integrator, its tolerances, and what is watched while it works.
pub(super) struct Controlled<'i, 's> {
    shared: &'s Shared<'s>,
    method: &'i mut dyn Integrator,
    tolerances: &'i mut Tolerances,
    stiffness: Option<Stiffness>,
    /// Rates just before the last time event.
    end_rates: Vec<f64>,
    /// Step to go on with, where the run stands at a time event that left the state alone.
    resume: Option<Resume>,
    /// Whether the last time event was a mere corner, over which the method went on.
    corner: bool,
    /// Longest step allowed.
    most: Option<f64>,
    /// A first step that is known to do, in s.
    first: Option<f64>,
    /// Steps by this method.
    steps: usize,
    /// Where the step at hand started.
    from: f64,
    /// What it was first tried with, and how often in vain.
    tried: (f64, usize),
    /// Longest step since the last event.
    longest: f64,
    reason: Option<HandOver>,
}

impl<'i, 's> Controlled<'i, 's> {
    pub(super) fn new(
        run: &Run<'_>,
        shared: &'s Shared<'s>,
        method: &'i mut dyn Integrator,
        tolerances: &'i mut Tolerances,
        stiffness: Option<Stiffness>,
    ) -> Self {
        let states = method.state().len();
        // Without states no error tells how far a step may go: what time moves is followed in short ones.
        let blind = states == 0 && !shared.events().stands_still();
        let blind = blind.then_some(SHORT * (run.options.to - run.options.from));
        Controlled {
            shared,
            method,
            tolerances,
            stiffness,
            end_rates: vec![0.0; states],
            resume: None,
            corner: false,
            most: run.options.step.into_iter().chain(blind).reduce(f64::min),
            first: None,
            steps: 0,
            from: run.time,
            tried: (0.0, 0),
            longest: 0.0,
            reason: None,
        }
    }

    /// With a first step that is known to do.
    pub(super) fn from(self, first: Option<f64>) -> Self {
        Controlled { first, ..self }
    }

    /// Why it has handed over, if it has.
    pub(super) fn reason(&self) -> Option<HandOver> {
        self.reason
    }

    /// Adds what the method took.
    pub(super) fn add_work(&self, counts: &mut Summary) {
        self.method.add_work(counts);
    }

    fn hand_over(&mut self, reason: HandOver) -> Flow {
        self.reason = Some(reason);
        Flow::HandOver
    }

    /// Starts the method where the run stands, or goes on with it over a corner, where neither the state nor its rates
    /// jump: rows of an input table are such corners.
    fn begin(&mut self, time: f64, stop: f64, x: &[f64]) -> Result<(), Failure> {
        let mut rates = vec![0.0; x.len()];
        let longest = (stop - time).min(self.most.unwrap_or(f64::INFINITY));
        let resume = self.resume.take();
        let known = resume.as_ref().map(|resume| resume.step).or(self.first);
        if let Some(step) = known.and_then(|step| self.seeing_inside((time, x), step, longest)) {
            (self.first, self.corner) = (None, false);
            self.shared.system().rates(time, x, &mut rates)?;
            return self.method.restart(time, x, &rates, step);
        }
        if let Some(Resume { step, bends: true }) = resume {
            self.corner = true;
            return self.method.continue_at(time, x, step.min(longest));
        }
        if let Some(Resume { step, .. }) = resume {
            self.shared.system().rates(time, x, &mut rates)?;
            self.corner = self.is_corner(&rates, x);
            if self.corner {
                return self.method.resume(time, x, &rates, step.min(longest));
            }
        }
        if let Some(step) = self.first.take() {
            self.shared.system().rates(time, x, &mut rates)?;
            return self.method.restart(time, x, &rates, step.min(longest));
        }
        let order = self.method.first_order();
        let step = {
            let system = &mut *self.shared.system();
            first_step(system, self.tolerances, order, time, x, longest, &mut rates)?
        };
        let step = self.seeing_inside((time, x), step, longest).unwrap_or(step);
        self.method.restart(time, x, &rates, step)
    }

    /// A shorter step, if this one may miss what time alone does before the next event, which is so far away.
    fn seeing_inside(&mut self, here: (f64, &[f64]), step: f64, longest: f64) -> Option<f64> {
        let looks = self.method.sees_ends_alone();
        looks.then(|| seeing_inside(&mut *self.shared.system(), self.tolerances, here, step.min(longest), longest))?
    }

    /// Goes on from a point that was moved where the last step ended.
    fn take_over(&mut self, time: f64, x: &[f64]) -> Result<(), Failure> {
        if self.method.state() == x {
            return Ok(());
        }
        let mut rates = vec![0.0; x.len()];
        self.shared.system().rates(time, x, &mut rates)?;
        let step = self.method.next_step();
        self.method.resume(time, x, &rates, step)
    }

    /// Whether the step that ended at `x` would not have told `rates` from its own.
    fn is_corner(&self, rates: &[f64], x: &[f64]) -> bool {
        let jump: Vec<f64> = self.end_rates.iter().zip(rates).map(|(before, after)| after - before).collect();
        let length = self.method.time() - self.method.start();
        self.tolerances.norm(&jump, x) * length <= 1.0
    }

    /// Says so if the run crawls, and which state asks for it: the one whose rate changes most over the next step for what is
    /// allowed of it.
    fn watch_pace(&mut self, run: &mut Run<'_>, x: &[f64]) {
        let steps = run.counts.steps;
        let due = steps >= MANY && steps.is_power_of_two() && steps.trailing_zeros().is_multiple_of(2);
        let (time, step) = (run.time, self.method.time() - self.method.start());
        let pace = step.max((time - run.options.from) / steps as f64);
        if !due || (run.options.to - time) / pace < ENDLESS {
            return;
        }
        let system = &mut *self.shared.system();
        let (mut here, mut there) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        let next = |here: &[f64]| -> Vec<f64> { x.iter().zip(here).map(|(x, rate)| x + step * rate).collect() };
        let known =
            system.rates(time, x, &mut here).is_ok() && system.rates(time + step, &next(&here), &mut there).is_ok();
        if known && !x.is_empty() {
            there.iter_mut().zip(&here).for_each(|(there, here)| *there -= here);
            let state = system.state_name(self.tolerances.greatest_part(&there, x));
            run.report_crawl(&Crawl { time, steps, step, state });
        }
    }

    /// Whether the system proves stiff, `stop` being the next time event or the end.
    fn is_stiff(&mut self, run: &Run<'_>, stop: f64, x: &[f64]) -> bool {
        let (time, step) = (run.time, self.method.time() - self.method.start());
        let remaining = if self.corner { run.options.to } else { stop } - time;
        let system = &mut *self.shared.system();
        let Some(stiffness) = self.stiffness.as_mut() else { return false };
        stiffness.watch(system, self.tolerances, (time, x), step, remaining)
    }

    /// Whether the steps are many, or the last one was tried so often in vain, that it may be rounding that asks for it.
    fn may_be_rounding(&self) -> bool {
        self.tried.1 >= SUSPICIOUS || (self.steps >= FIRST_LOOK && self.steps.is_power_of_two())
    }
}

impl Stepper for Controlled<'_, '_> {
    const DENSE: bool = true;

    fn events(&mut self) -> impl DerefMut<Target = dyn Events + '_> {
        self.shared.events()
    }

    fn begin_interval(&mut self, run: &mut Run<'_>, stop: f64, x: &[f64]) -> Result<Flow, Failure> {
        let guessed = self.tolerances.guess(&mut *self.shared.system(), run.time, x, stop - run.time)?;
        if guessed {
            return Ok(self.hand_over(HandOver::Grown));
        }
        self.longest = 0.0;
        self.begin(run.time, stop, x).map(|()| Flow::GoOn)
    }

    fn step(&mut self, from: f64, _: f64, stop: f64, x: &[f64]) -> Result<f64, Failure> {
        self.take_over(from, x)?;
        let stop_now = self.most.map_or(stop, |most| stop.min(from + most));
        let (rejected, tried) = (self.method.rejected(), self.method.next_step());
        self.method.step(stop_now)?;
        self.from = from;
        self.steps += 1;
        self.tried = (tried, self.method.rejected() - rejected);
        let end = self.method.time();
        Ok(if is_at(end, stop, self.method.start()) { stop } else { end })
    }

    fn accept(&mut self, end: f64, x: &mut [f64]) {
        self.longest = self.longest.max(end - self.from);
        x.copy_from_slice(self.method.state());
    }

    fn interpolate(&mut self, t: f64, x: &mut [f64]) {
        self.method.interpolate(t, x);
    }

    fn sample(&mut self, t: f64, x: &mut [f64]) {
        self.method.interpolate_to_end_accuracy(t, x);
    }

    fn shorten(&mut self, t: f64) -> bool {
        self.method.shorten(t)
    }

    fn before_event(&mut self, corner: bool) -> Result<(), Failure> {
        if corner { Ok(()) } else { self.method.end_rates(&mut self.end_rates) }
    }

    fn after_event(&mut self, corner: bool, x: &[f64]) {
        let step = self.longest.max(self.method.next_step());
        self.resume = (x == self.method.state()).then_some(Resume { step, bends: corner });
    }

    fn forget(&mut self) {
        self.resume = None;
    }

    fn supervise(&mut self, run: &mut Run<'_>, stop: f64, x: &[f64]) -> Result<Flow, Failure> {
        self.watch_pace(run, x);
        if self.tolerances.watch(x) {
            return Ok(self.hand_over(HandOver::Grown));
        }
        if self.is_stiff(run, stop, x) {
            return Ok(self.hand_over(HandOver::Stiff));
        }
        if run.time < stop && self.may_be_rounding() {
            let (time, interval) = (run.time, stop - run.time);
            let system = &mut *self.shared.system();
            if self.tolerances.clear_rounding(system, (time, x), self.tried.0.min(interval), interval) {
                self.reason = Some(HandOver::Cleared(self.method.next_step()));
                return Ok(Flow::HandOver);
            }
        }
        Ok(Flow::GoOn)
    }
}
