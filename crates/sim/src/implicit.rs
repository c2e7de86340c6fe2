//! A whole run of a system in implicit form.

mod drive;
mod semi_explicit;
mod tolerances;

use std::cell::RefCell;

use semi_explicit::SemiExplicit;

use crate::scene::Implicit;
use crate::shared::Shared;
use crate::simulate::Run;
use crate::{Failure, ImplicitSystem, Method, Options, Sink, Stopped, Summary};

/// Integrates `system` in implicit form from the unknowns `y` and their rates `yp` at `options.from` to `options.to`, and
/// leaves the last ones reached in `y` and `yp`. The method is [`Method::Radau`], or [`Method::Bdf`] for semi-explicit
/// systems of index 1.
///
/// Start values may be rough: [`cross_jump`](ImplicitSystem::cross_jump), which is called at the start, makes them
/// consistent. Samples by `Radau` are exact: where a step does not end at one, it is made again up to there, so that
/// `F = 0` holds in every sample as well as at the ends of steps.
///
/// # Errors
/// The run stopped; what was computed so far is with the sink, and `y` and `yp` belong to `Stopped::time`.
#[allow(clippy::result_large_err, reason = "a run fails once")]
pub fn simulate_implicit(
    system: &mut dyn ImplicitSystem,
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
        Err(failure) => Err(Stopped { failure, time: options.from, summary: Summary::default() }),
    }
}

/// Which equations hold a rate.
fn semi_explicit_of_index_1(system: &dyn ImplicitSystem) -> Result<Vec<bool>, Failure> {
    if (0..system.unknowns()).any(|unknown| system.index(unknown) > 1) {
        return Err(Failure::BadMethod { expected: "radau for an index above 1" });
    }
    let refused = Failure::BadMethod { expected: "radau for equations that are not solved for their rates" };
    system.semi_explicit().map(<[bool]>::to_vec).ok_or(refused)
}

#[allow(clippy::result_large_err, reason = "a run fails once")]
fn by_radau(
    system: &mut dyn ImplicitSystem,
    options: &Options,
    y: &mut [f64],
    yp: &mut [f64],
    sink: &mut dyn Sink,
) -> Result<Summary, Stopped> {
    let mut point = [&*y, &*yp].concat();
    let shared = RefCell::new(Implicit(system));
    let mut run = Run::new(&shared, options, sink);
    let end = drive::run(&mut run, &shared, &mut point);
    let (time, summary) = (run.time, run.counts);
    let (last, rates) = crate::scene::halves(&point);
    y.copy_from_slice(last);
    yp.copy_from_slice(rates);
    end.map(|()| summary).map_err(|failure| Stopped { failure, time, summary })
}

#[allow(clippy::result_large_err, reason = "a run fails once")]
fn by_bdf(
    system: &mut dyn ImplicitSystem,
    differential: Vec<bool>,
    options: &Options,
    y: &mut [f64],
    yp: &mut [f64],
    sink: &mut dyn Sink,
) -> Result<Summary, Stopped> {
    let scales = system.scales(options.from, options.to - options.from);
    let scales = scales.map_err(|failure| Stopped { failure, time: options.from, summary: Summary::default() })?;
    let mut states = SemiExplicit::new(system, differential.clone(), scales);
    let end = {
        let shared = Shared::semi_explicit(&mut states, differential);
        let mut run = Run::new(shared.scene(), options, sink);
        let end = crate::variable_step::run(&mut run, &shared, y);
        let (time, system) = (run.time, shared.system());
        let summary = Summary { rates: system.rates, tangents: system.tangents, ..run.counts };
        end.map(|()| summary).map_err(|failure| Stopped { failure, time, summary })
    };
    yp.copy_from_slice(states.last_rates());
    end
}
