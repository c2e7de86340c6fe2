//! What a run would cost, where that can be known before: stops, steps and memory.

use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_exec as exec;
use halfarrow_sim::{Method, Options, System};

use crate::advice::rates_at_start;
use crate::error::Problem;

/// Stops, steps or oscillations beyond which a run is refused: it would take hours or days.
const MOST: f64 = 1e9;

/// Bytes of recorded values beyond which a run is refused.
const MOST_BYTES: f64 = 8.0 * 1024.0 * 1024.0 * 1024.0;

/// Time constants after which an oscillation is over.
const OVER: f64 = 40.0;

/// Refuses a run from `x` that would take days or more memory than there is, with what it would take.
pub(crate) fn check(system: &exec::Model, x: &[f64], options: &Options) -> Result<(), Problem> {
    let length = options.to - options.from;
    held(system, length)?;
    if let (Method::Fixed(_), Some(step)) = (options.method, options.step) {
        refuse_above(length / step, |n| format!("a step of {step:e} s makes {n} steps up to {:e} s", options.to), STEP)?;
    }
    let row = 8.0 * (system.observed() as f64 + 1.0);
    if let Some(every) = options.every {
        let bytes = row * length / every;
        if bytes > MOST_BYTES {
            let (points, gigabytes) = (count(length / every), count(bytes / 1e9));
            let reason = format!(
                "{points} points every {every:e} s take {gigabytes} GB of memory: take a longer --every, a shorter --to, or \
                 fewer variables by --record"
            );
            return Err(Problem::BadOption { reason });
        }
    }
    oscillations(system, x, options)
}

const STEP: &str = "take a longer step or a shorter --to";

/// Delays and samples: the run stops at each.
fn held(system: &exec::Model, length: f64) -> Result<(), Problem> {
    for held in &system.program().held {
        let Some(time) = system.constant(held.time).filter(|time| *time > 0.0) else { continue };
        let what = match held.kind {
            HeldKind::Delay => "a delay",
            HeldKind::Sample => "a sampling period",
        };
        let words = |n: String| format!("{what} of {time:e} s in the model makes the run stop {n} times");
        let remedy = match held.kind {
            HeldKind::Delay => "leave out a delay that short, or take a shorter --to",
            HeldKind::Sample => "take a longer period or a shorter --to",
        };
        refuse_above(length / time, words, remedy)?;
    }
    Ok(())
}

/// What oscillates without end is followed by every method of variable step.
fn oscillations(system: &exec::Model, x: &[f64], options: &Options) -> Result<(), Problem> {
    let length = options.to - options.from;
    if matches!(options.method, Method::Fixed(_)) || length < MOST * f64::EPSILON {
        return Ok(());
    }
    let radians = |[re, im]: &[f64; 2]| im.abs() * length.min(if *re < 0.0 { -OVER / re } else { f64::INFINITY });
    let fastest = rates_at_start(system, x).unwrap_or_default().into_iter().max_by(|a, b| radians(a).total_cmp(&radians(b)));
    let Some(fastest) = fastest else { return Ok(()) };
    let words = |n: String| {
        format!("up to {:e} s an oscillation of {:.3} rad/s, as there is at the start, goes on for {n} radians", options.to, fastest[1].abs())
    };
    refuse_above(radians(&fastest), words, "each takes some steps: take a shorter --to")
}

fn refuse_above(number: f64, words: impl Fn(String) -> String, remedy: &str) -> Result<(), Problem> {
    match number > MOST {
        true => Err(Problem::BadOption { reason: format!("{}: {remedy}", words(count(number))) }),
        false => Ok(()),
    }
}

/// A large number with two digits.
fn count(number: f64) -> String {
    if number < 1e4 { format!("{}", number.round()) } else { format!("{number:.1e}") }
}
