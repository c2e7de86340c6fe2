//! A whole run of a system in implicit form.

mod collocated;
mod semi_explicit;
mod tolerances;

use collocated::Collocated;
use semi_explicit::SemiExplicit;

use crate::driver::{Flow, Run};
use crate::shared::Shared;
use crate::simulate::{check_start, counted_in};
use crate::{Affected, Failure, HybridImplicitSystem, ImplicitSystem, Method, Options, Sink, Stopped, Summary, halves};

/// Integrates `system` in implicit form from the unknowns `y` and their rates `yp` at `options.from` to `options.to`, and
/// leaves the last ones reached in `y` and `yp`, unless events have led to other unknowns. The method is [`Method::Radau`](crate::Method::Radau), or [`Method::Bdf`] for semi-explicit
/// systems of index 1.
///
/// Start values may be rough: [`handle_event`](crate::Events::handle_event), which is called at the start, makes them
/// consistent. Samples by `Radau` are exact: where a step does not end at one, it is made again up to there, so that
/// `F = 0` holds in every sample as well as at the ends of steps.
///
/// # Errors
/// The run stopped; what was computed so far is with the sink, and `y` and `yp` belong to `Stopped::time`.
#[allow(clippy::result_large_err, reason = "a run fails once")]
pub fn simulate_implicit(
    system: &mut dyn HybridImplicitSystem,
    options: &Options,
    y: &mut [f64],
    yp: &mut [f64],
    sink: &mut dyn Sink,
) -> Result<Summary, Stopped> {
    let checked = options.check(y.len()).and_then(|()| match options.method {
        Method::Radau => Ok(None),
        Method::Bdf => semi_explicit_of_index_1(system).map(Some),
        _ => Err(Failure::BadMethod { expected: "radau for equations in implicit form" }),
    });
    match checked {
        Ok(None) => by_radau(system, options, y, yp, sink),
        Ok(Some(differential)) => by_bdf(system, differential, options, y, yp, sink),
        Err(failure) => Run::new(options, sink, &*system).ended(Err::<(), _>(failure)),
    }
}

/// Which equations hold a rate.
fn semi_explicit_of_index_1(system: &dyn ImplicitSystem) -> Result<Vec<bool>, Failure> {
    if system.changes_unknowns() {
        return Err(Failure::BadMethod { expected: "radau for unknowns that change at events" });
    }
    if (0..system.unknowns()).any(|unknown| system.index(unknown) > 1) {
        return Err(Failure::BadMethod { expected: "radau for an index above 1" });
    }
    let refused = Failure::BadMethod { expected: "radau for equations that are not solved for their rates" };
    system.semi_explicit().map(<[bool]>::to_vec).ok_or(refused)
}

#[allow(clippy::result_large_err, reason = "a run fails once")]
fn by_radau(
    system: &mut dyn HybridImplicitSystem,
    options: &Options,
    y: &mut [f64],
    yp: &mut [f64],
    sink: &mut dyn Sink,
) -> Result<Summary, Stopped> {
    let mut point = [&*y, &*yp].concat();
    let mut run = Run::new(options, sink, &*system);
    let end = radau(&mut run, system, &mut point);
    let (last, rates) = halves(&point);
    if last.len() == y.len() {
        y.copy_from_slice(last);
        yp.copy_from_slice(rates);
    }
    run.ended(end)
}

fn radau(run: &mut Run<'_>, system: &mut dyn HybridImplicitSystem, point: &mut Vec<f64>) -> Result<(), Failure> {
    check_point(&*system, run.time, point)?;
    run.start(system, point)?;
    loop {
        if let Some(next) = system.new_point() {
            *point = next;
            check_point(&*system, run.time, point)?;
        }
        let mut stepper = Collocated::new(run, system)?;
        let end = run.drive(&mut stepper, point);
        stepper.add_work(&mut run.counts);
        if end? == Flow::GoOn {
            return Ok(());
        }
    }
}

/// Whether all unknowns and rates are finite where a run starts.
fn check_point(system: &dyn HybridImplicitSystem, time: f64, point: &[f64]) -> Result<(), Failure> {
    let Some(value) = point.iter().position(|value| !value.is_finite()) else { return Ok(()) };
    let unknowns = system.unknowns();
    let what = match value < unknowns {
        true => Affected::variable(system.unknown_name(value)),
        false => Affected::Rate(system.unknown_name(value - unknowns)),
    };
    Err(Failure::NotFinite { time, what })
}

#[allow(clippy::result_large_err, reason = "a run fails once")]
fn by_bdf(
    system: &mut dyn HybridImplicitSystem,
    differential: Vec<bool>,
    options: &Options,
    y: &mut [f64],
    yp: &mut [f64],
    sink: &mut dyn Sink,
) -> Result<Summary, Stopped> {
    let scales = match system.scales(options.from, options.to - options.from) {
        Ok(scales) => scales,
        Err(failure) => return Run::new(options, sink, &*system).ended(Err::<(), _>(failure)),
    };
    let mut states = SemiExplicit::new(system, differential.clone(), scales);
    let mut run = Run::new(options, sink, &states);
    let checked = check_start(&states, options.from, y);
    let end = {
        let shared = Shared::semi_explicit(&mut states, differential);
        let end = checked.and_then(|()| crate::variable_step::run(&mut run, &shared, y));
        counted_in(run.ended(end), shared.system().work())
    };
    yp.copy_from_slice(states.last_rates());
    end
}
