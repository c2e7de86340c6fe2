//! Methods that choose their step.

mod controlled;
mod first_step;
mod library;
mod magnitudes;
mod radau;
mod rounding;
mod stiffness;
mod tolerances;

pub use magnitudes::magnitudes;

use crate::driver::{Flow, Run};
use crate::shared::Shared;
use crate::{Failure, Method, Summary};
use controlled::{Controlled, HandOver};
pub(crate) use library::KeptFactors;
use stiffness::Stiffness;
use tolerances::Tolerances;

/// A method of variable step between two restarts.
trait Integrator {
    /// Order of the first step after a restart.
    fn first_order(&self) -> usize;

    /// Whether rates are taken at the ends of steps alone.
    fn sees_ends_alone(&self) -> bool {
        false
    }

    /// Starts anew at `(t, x)`, where the rates are `dx`, with a first step of about `h`.
    fn restart(&mut self, t: f64, x: &[f64], dx: &[f64], h: f64) -> Result<(), Failure>;

    /// Goes on at `(t, x)`, where the last step ended and the rates `dx` are what they were at its end, though they may
    /// change otherwise than before: with a first step of at most `h`.
    fn resume(&mut self, t: f64, x: &[f64], dx: &[f64], h: f64) -> Result<(), Failure>;

    /// The same at `(t, x)` where it is known that the rates do not jump.
    fn continue_at(&mut self, t: f64, x: &[f64], h: f64) -> Result<(), Failure> {
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
    fn interpolate(&mut self, t: f64, x: &mut [f64]);

    /// The state at a time inside the last step, to the accuracy of its end.
    fn interpolate_to_end_accuracy(&mut self, t: f64, x: &mut [f64]) {
        self.interpolate(t, x);
    }

    /// Makes the last step again so that it ends at a time inside it, if [`interpolate`](Integrator::interpolate) is less exact
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

/// Integrates to the end.
pub(crate) fn run<'s>(run: &mut Run<'_>, shared: &'s Shared<'s>, x: &mut [f64]) -> Result<(), Failure> {
    run.start(&mut *shared.events(), x)?;
    let mut tolerances = Tolerances::new(run.options, &*shared.system(), x);
    let (method, project) = (run.options.method, run.options.project);
    let mut stiff = method == Method::Bdf && !x.is_empty();
    // A step to go on with where only the tolerances have changed.
    let mut step = None;
    let mut told = false;
    loop {
        let atol = tolerances.clone();
        // They are told of the states with which the run begins.
        if !told {
            run.report_tolerances(atol.magnitudes(), &atol.absolute(1.0));
        }
        shared.events().note_magnitudes(run.time, x, atol.magnitudes())?;
        let kept = step.take();
        let mut drive = |integrator: &mut dyn Integrator, first, stiffness| {
            let mut stepper = Controlled::new(run, shared, integrator, &mut tolerances, stiffness).from(first);
            let end = run.drive(&mut stepper, x);
            stepper.add_work(&mut run.counts);
            end.map(|flow| (flow, stepper.reason()))
        };
        let end = if method == Method::Radau || (stiff && project) {
            drive(&mut radau::OnStates::new(shared, &atol), kept, None)
        } else if stiff {
            library::with_bdf(shared, &atol, |integrator| drive(integrator, None, None))
        } else {
            let watch = (method == Method::Auto).then(|| Stiffness::new(&atol));
            library::with_explicit(shared, &atol, |integrator| drive(integrator, kept, watch))
        };
        match end {
            Ok((Flow::GoOn, _)) => return Ok(()),
            // Its states are others.
            Ok((Flow::HandOver, None)) => {
                *shared.kept_factors().borrow_mut() = None;
                tolerances = Tolerances::new(run.options, &*shared.system(), x);
                told = true;
            }
            Ok((_, Some(HandOver::Grown))) => {
                let end = run.next_stop(&mut *shared.events()).time;
                tolerances.grow(&mut *shared.system(), run.time, x, end - run.time);
            }
            Ok((_, Some(HandOver::Cleared(kept)))) => step = Some(kept),
            Ok((_, Some(HandOver::Stiff))) => stiff = true,
            Err(Failure::StepTooSmall { .. }) if becomes_known(run, shared, &mut tolerances, x) => {}
            Err(Failure::StepTooSmall { .. }) if method == Method::Auto && !stiff => stiff = true,
            Err(Failure::StepTooSmall { .. }) if are_renewed(run, shared, &mut tolerances, x) => {}
            Err(failure) => return Err(failure),
        }
        run.counts.stiff |= stiff && method == Method::Auto;
    }
}

/// What an event has moved far beyond its magnitude fails every test. `true` if magnitudes are others now.
fn are_renewed(run: &Run<'_>, shared: &Shared<'_>, tolerances: &mut Tolerances, x: &[f64]) -> bool {
    let interval = run.next_stop(&mut *shared.events()).time - run.time;
    tolerances.renew(&mut *shared.system(), (run.time, x), 1e-3 * interval, interval)
}

/// A state of unknown magnitude that leaves 0 fails every test. `true` if its magnitude can be guessed a little later.
fn becomes_known(run: &Run<'_>, shared: &Shared<'_>, tolerances: &mut Tolerances, x: &[f64]) -> bool {
    let interval = run.next_stop(&mut *shared.events()).time - run.time;
    let system = &mut *shared.system();
    let later = 1e-3 * interval;
    tolerances.guess(system, run.time + later, x, later).unwrap_or(false)
        || tolerances.clear_rounding(system, (run.time, x), later, interval)
}
