//! Methods that choose their step.

mod first_step;
mod library;
mod magnitudes;
mod radau;
mod rounding;
mod stiffness;
mod tolerances;

pub use magnitudes::magnitudes;

use crate::events::{Chatter, first_crossing};
use crate::shared::Shared;
use crate::simulate::Run;
use crate::{Crawl, Failure, Method, Summary, System};
use first_step::first_step;
use stiffness::Stiffness;
use tolerances::Tolerances;

/// Parts of a step by which it is made to go beyond a crossing.
pub(crate) const MARGINS: [f64; 2] = [1e-3, 1e-6];

/// Longest step of a system without states, as a part of the run.
const SHORT: f64 = 1e-3;

/// A method of variable step between two restarts.
trait Integrator {
    /// Order of the first step after a restart.
    fn first_order(&self) -> usize;

    /// Starts anew at `(t, x)`, where the rates are `dx`, with a first step of about `h`.
    fn restart(&mut self, t: f64, x: &[f64], dx: &[f64], h: f64) -> Result<(), Failure>;

    /// Goes on at `(t, x)`, where the last step ended and the rates `dx` are what they were at its end, though they may
    /// change otherwise than before: with a first step of at most `h`.
    fn resume(&mut self, t: f64, x: &[f64], dx: &[f64], h: f64) -> Result<(), Failure>;

    /// The same at `(t, x)` where it is known that the rates do not jump.
    fn go_on(&mut self, t: f64, x: &[f64], h: f64) -> Result<(), Failure> {
        let mut rates = vec![0.0; x.len()];
        self.end_rates(&mut rates)?;
        self.resume(t, x, &rates, h)
    }

    /// Takes one step that meets the tolerances and ends at `stop` at the latest.
    fn step(&mut self, stop: f64) -> Result<(), Failure>;

    /// Where the last step ended.
    fn time(&self) -> f64;

    /// Where the last step started.
    fn start(&self) -> f64;

    /// Length of the step to come, as far as is known.
    fn next_step(&self) -> f64;

    /// The state where the last step ended.
    fn state(&self) -> &[f64];

    /// Writes the rates where the last step ended, in the mode of that step.
    fn end_rates(&self, dx: &mut [f64]) -> Result<(), Failure>;

    /// The state at a time inside the last step, to the accuracy of the step.
    fn between(&mut self, t: f64, x: &mut [f64]);

    /// The state at a time inside the last step, to the accuracy of its end.
    fn inside(&mut self, t: f64, x: &mut [f64]) {
        self.between(t, x);
    }

    /// Makes the last step again so that it ends at a time inside it, if [`between`](Integrator::between) is less exact
    /// than its end. `false` if that is not so, or cannot be done.
    fn shorten(&mut self, t: f64) -> bool {
        let _ = t;
        false
    }

    /// Steps tried in vain so far.
    fn rejected(&self) -> usize;

    /// Adds what it took so far, beside accepted steps and what the system counts.
    fn add_work(&self, counts: &mut Summary);
}

/// Steps tried in vain one after the other that rounding may be the reason of.
const SUSPICIOUS: usize = 3;

/// Accepted steps after which rounding is looked for, and whenever they are twice as many.
const FIRST_LOOK: usize = 64;

/// Steps after which it is looked whether the run crawls, and whenever they are four times as many.
const MANY: usize = 4096;

/// Steps still to come, at the present pace, from which on it does.
const ENDLESS: f64 = 1e6;

/// Why an integrator hands over.
enum End {
    /// The run is at its end.
    Done,
    /// The system is stiff.
    Stiff,
    /// States have outgrown the magnitudes that the tolerances were made for.
    Grown,
    /// Tolerances ask for less than rounding leaves; they no longer do. A step that still holds, in s.
    Cleared(f64),
}

/// Integrates to the end.
pub(crate) fn run<'s>(run: &mut Run<'_>, shared: &'s Shared<'s>, x: &mut [f64]) -> Result<(), Failure> {
    run.start(x)?;
    let mut tolerances = Tolerances::new(run.options, &*shared.system(), x);
    let mut chatter = Chatter::new(run.options.to - run.options.from);
    let mut stiff = run.options.method == Method::Bdf && !x.is_empty();
    // A step to go on with where only the tolerances have changed.
    let mut step = None;
    loop {
        let atol = tolerances.clone();
        run.tell_tolerances(atol.magnitudes(), &atol.absolute(1.0));
        let kept = step.take();
        let end = if run.options.method == Method::Radau {
            let mut method = radau::OnStates::new(shared, &atol);
            Drive::new(run, shared, &mut method, &mut tolerances, &mut chatter, None).from(kept).run(x)
        } else if stiff {
            library::with_bdf(shared, &atol, |method| {
                Drive::new(run, shared, method, &mut tolerances, &mut chatter, None).run(x)
            })
        } else {
            let watch = (run.options.method == Method::Auto).then(|| Stiffness::new(&atol));
            library::with_explicit(shared, &atol, |method| {
                Drive::new(run, shared, method, &mut tolerances, &mut chatter, watch).from(kept).run(x)
            })
        };
        match end {
            Ok(End::Done) => return Ok(()),
            Ok(End::Grown) => {
                let end = next_stop(run, shared);
                tolerances.grow(&mut *shared.system(), run.time, x, end - run.time);
            }
            Ok(End::Cleared(kept)) => step = Some(kept),
            Ok(End::Stiff) => stiff = true,
            Err(Failure::StepTooSmall { .. }) if becomes_known(run, shared, &mut tolerances, x) => {}
            Err(Failure::StepTooSmall { .. }) if run.options.method == Method::Auto && !stiff => stiff = true,
            Err(failure) => return Err(failure),
        }
        run.counts.stiff |= stiff && run.options.method == Method::Auto;
    }
}

/// A state of unknown magnitude that leaves 0 fails every test. `true` if its magnitude can be guessed a little later.
fn becomes_known(run: &Run<'_>, shared: &Shared<'_>, tolerances: &mut Tolerances, x: &[f64]) -> bool {
    let interval = next_stop(run, shared) - run.time;
    let system = &mut *shared.system();
    let later = 1e-3 * interval;
    tolerances.guess(system, run.time + later, x, later).unwrap_or(false)
        || tolerances.clear_rounding(system, (run.time, x), later, interval)
}

/// The next jump known in advance, or the end of the run.
fn next_stop(run: &Run<'_>, shared: &Shared<'_>) -> f64 {
    let jump = shared.system().next_jump(run.time);
    jump.map_or(run.options.to, |jump| jump.min(run.options.to))
}

/// How to go on at an announced jump.
#[derive(Clone, Copy)]
struct Resume {
    /// The step, in s.
    step: f64,
    /// It is known that the rates do not jump there.
    bends: bool,
}

/// One integrator at work on a run.
struct Drive<'r, 'a, 'i, 's> {
    run: &'r mut Run<'a>,
    shared: &'s Shared<'s>,
    method: &'i mut dyn Integrator,
    tolerances: &'r mut Tolerances,
    chatter: &'r mut Chatter,
    stiffness: Option<Stiffness>,
    interpolated: Vec<f64>,
    /// Rates just before the last announced jump.
    end_rates: Vec<f64>,
    /// Step to go on with, where the run stands at an announced jump that left the state alone.
    resume: Option<Resume>,
    /// Whether the last announced jump was a mere corner, over which the method went on.
    corner: bool,
    /// Longest step.
    longest: Option<f64>,
    /// A first step that is known to do, in s.
    first: Option<f64>,
    /// Steps by this method.
    steps: usize,
}

impl<'r, 'a, 'i, 's> Drive<'r, 'a, 'i, 's> {
    fn new(
        run: &'r mut Run<'a>,
        shared: &'s Shared<'s>,
        method: &'i mut dyn Integrator,
        tolerances: &'r mut Tolerances,
        chatter: &'r mut Chatter,
        stiffness: Option<Stiffness>,
    ) -> Self {
        let interpolated = vec![0.0; method.state().len()];
        let end_rates = interpolated.clone();
        // Without states no error tells how far a step may go: laws are followed in short ones.
        let options = run.options;
        let blind = interpolated.is_empty().then_some(SHORT * (options.to - options.from));
        let longest = options.step.into_iter().chain(blind).reduce(f64::min);
        Drive {
            run,
            shared,
            method,
            tolerances,
            chatter,
            stiffness,
            interpolated,
            end_rates,
            resume: None,
            corner: false,
            longest,
            first: None,
            steps: 0,
        }
    }

    /// With a first step that is known to do.
    fn from(self, first: Option<f64>) -> Self {
        Drive { first, ..self }
    }

    fn run(mut self, x: &mut [f64]) -> Result<End, Failure> {
        let end = self.pieces(x);
        self.method.add_work(&mut self.run.counts);
        end
    }

    /// From jump to jump.
    fn pieces(&mut self, x: &mut [f64]) -> Result<End, Failure> {
        while self.run.time < self.run.options.to {
            let to = self.run.options.to;
            let jump = self.shared.system().next_jump(self.run.time).filter(|&jump| jump <= to);
            if let Some(end) = self.piece(jump.unwrap_or(to), jump.is_some(), x)? {
                return Ok(end);
            }
        }
        Ok(End::Done)
    }

    /// From here to `stop`, where there may be a jump, or to a crossing before it.
    fn piece(&mut self, stop: f64, jump: bool, x: &mut [f64]) -> Result<Option<End>, Failure> {
        if is_at(self.run.time, stop, self.run.time) {
            self.run.reach(stop, x)?;
            if jump {
                self.run.meet(stop);
            }
            return if jump { self.run.settle_at_jump(x) } else { self.run.settle(x) }.map(|()| None);
        }
        let interval = stop - self.run.time;
        if self.tolerances.guess(&mut *self.shared.system(), self.run.time, x, interval)? {
            return Ok(Some(End::Grown));
        }
        self.set_off(stop, x)?;
        let mut longest: f64 = 0.0;
        while self.run.time < stop {
            let stop_now = self.longest.map_or(stop, |longest| stop.min(self.run.time + longest));
            let (rejected, tried) = (self.method.rejected(), self.method.next_step());
            self.method.step(stop_now)?;
            self.run.counts.steps += 1;
            self.steps += 1;
            let in_vain = self.method.rejected() - rejected;
            let end = if is_at(self.method.time(), stop, self.method.start()) { stop } else { self.method.time() };
            let (end, crossing) = self.exact_crossing(end)?;
            if let Some((time, switch)) = crossing {
                self.cross(time, switch, x)?;
                return Ok(None);
            }
            longest = longest.max(end - self.run.time);
            x.copy_from_slice(self.method.state());
            self.run.reach(end, x)?;
            self.samples_before(end)?;
            if jump && end == stop {
                let bends = self.run.meet(stop);
                if !bends {
                    self.method.end_rates(&mut self.end_rates)?;
                }
                self.run.settle_at_jump(x)?;
                let same = x == self.method.state();
                let step = longest.max(self.method.next_step());
                self.resume = same.then_some(Resume { step, bends });
            } else {
                self.run.settle(x)?;
            }
            self.watch_pace(x);
            if let Some(end) = self.hand_over(stop, x) {
                return Ok(Some(end));
            }
            if self.run.time < stop && self.may_be_rounding(in_vain) {
                let (time, interval) = (self.run.time, stop - self.run.time);
                let system = &mut *self.shared.system();
                if self.tolerances.clear_rounding(system, (time, x), tried.min(interval), interval) {
                    return Ok(Some(End::Cleared(self.method.next_step())));
                }
            }
        }
        Ok(None)
    }

    /// Says so if the run crawls, and which state asks for it: the one whose rate changes most over the next step for what is
    /// allowed of it.
    fn watch_pace(&mut self, x: &[f64]) {
        let steps = self.run.counts.steps;
        let due = steps >= MANY && steps.is_power_of_two() && steps.trailing_zeros().is_multiple_of(2);
        let (time, step) = (self.run.time, self.method.time() - self.method.start());
        let pace = step.max((time - self.run.options.from) / steps as f64);
        if !due || (self.run.options.to - time) / pace < ENDLESS {
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
            self.run.tell_crawl(&Crawl { time, steps, step, state });
        }
    }

    /// Whether the steps are many, or the last one was tried so often in vain, that it may be rounding that asks for it.
    fn may_be_rounding(&self, in_vain: usize) -> bool {
        in_vain >= SUSPICIOUS || (self.steps >= FIRST_LOOK && self.steps.is_power_of_two())
    }

    /// Starts the method where the run stands, or goes on with it over a corner, where neither the state nor its rates
    /// jump: rows of an input table are such corners.
    fn set_off(&mut self, stop: f64, x: &[f64]) -> Result<(), Failure> {
        let (time, mut rates) = (self.run.time, vec![0.0; x.len()]);
        let longest = (stop - time).min(self.longest.unwrap_or(f64::INFINITY));
        let resume = self.resume.take();
        if let Some(Resume { step, bends: true }) = resume {
            self.corner = true;
            return self.method.go_on(time, x, step.min(longest));
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
        self.method.restart(time, x, &rates, step)
    }

    /// Whether the step that ended at `x` would not have told `rates` from its own.
    fn is_corner(&self, rates: &[f64], x: &[f64]) -> bool {
        let jump: Vec<f64> = self.end_rates.iter().zip(rates).map(|(before, after)| after - before).collect();
        let length = self.method.time() - self.method.start();
        self.tolerances.norm(&jump, x) * length <= 1.0
    }

    /// The first crossing of a switching function in the step that ends at `end`, which it is, and where the step ends now:
    /// where its end is more exact than its inside, it is made again to just beyond the crossing.
    fn exact_crossing(&mut self, mut end: f64) -> Result<(f64, Option<(f64, usize)>), Failure> {
        let mut crossing = self.crossing(end)?;
        for margin in MARGINS {
            let Some((time, _)) = crossing else { break };
            let beyond = time + margin * (time - self.run.time);
            if beyond >= end || !self.method.shorten(beyond) {
                break;
            }
            end = beyond;
            crossing = self.crossing(end)?;
        }
        Ok((end, crossing))
    }

    /// The first crossing of a switching function in the step that ends at `end`, and which it is.
    fn crossing(&mut self, end: f64) -> Result<Option<(f64, usize)>, Failure> {
        let (shared, method, x) = (self.shared, &mut *self.method, &mut self.interpolated);
        first_crossing(&mut self.run.sides, self.run.time, end, |sides, t| {
            method.between(t, x);
            sides.crossed(&mut *shared.system(), t, x)
        })
    }

    /// Goes back to a crossing inside the last step and over it.
    fn cross(&mut self, time: f64, switch: usize, x: &mut [f64]) -> Result<(), Failure> {
        if self.chatter.is_one(time) {
            return Err(Failure::Chattering { time, what: self.run.scene().switch_name(switch) });
        }
        self.method.between(time, x);
        self.run.reach(time, x)?;
        self.samples_before(time)?;
        self.run.counts.switches += 1;
        self.run.settle_at_jump(x)
    }

    /// Samples of the grid inside the last step, before `end`.
    fn samples_before(&mut self, end: f64) -> Result<(), Failure> {
        while let Some(t) = self.run.sample_before(end) {
            self.method.inside(t, &mut self.interpolated);
            self.run.record(t, t, &self.interpolated)?;
        }
        Ok(())
    }

    /// Whether another integrator should go on from here.
    fn hand_over(&mut self, stop: f64, x: &[f64]) -> Option<End> {
        let (time, step) = (self.run.time, self.method.time() - self.method.start());
        let remaining = if self.corner { self.run.options.to } else { stop } - time;
        if self.tolerances.watch(x) {
            return Some(End::Grown);
        }
        let system = &mut *self.shared.system();
        let stiffness = self.stiffness.as_mut()?;
        stiffness.watch(system, self.tolerances, (time, x), step, remaining).then_some(End::Stiff)
    }
}

/// Whether `time` is `stop` to rounding, after a step from `start`.
pub(crate) fn is_at(time: f64, stop: f64, start: f64) -> bool {
    (stop - time).abs() <= 4000.0 * f64::EPSILON * (time - start) + 200.0 * f64::EPSILON * time.abs()
}
