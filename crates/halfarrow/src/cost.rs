//! What a run would cost, where that can be known before: stops, steps and memory.

use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::program::Trigger;
use halfarrow_exec as exec;
use halfarrow_sim::{Method, Options};

use crate::advice::fast_at_start;
use crate::error::Problem;

/// Stops, steps or oscillations beyond which a run is refused: it would take hours or days.
const MOST: f64 = 1e9;

/// Part of the memory that is free which recorded values may take.
const MOST_MEMORY: f64 = 0.75;

/// Bytes of memory where the system does not say how many are free.
const MEMORY: f64 = 4.0 * 1024.0 * 1024.0 * 1024.0;

/// Time constants after which an oscillation is over.
const OVER: f64 = 40.0;

/// Refuses a run from `x` that records so many values at each point, if it would take days or more memory than there is, and
/// says what it would take.
pub(crate) fn check(system: &exec::Model, x: &[f64], options: &Options, recorded: usize) -> Result<(), Problem> {
    check_stops(system, options)?;
    let length = options.to - options.from;
    let fixed = options.step.filter(|_| matches!(options.method, Method::Fixed(_)));
    if let Some(every) = options.every.or(fixed) {
        memory(length / every, every, recorded)?;
    }
    if fixed.is_none() { oscillations(system, x, options) } else { Ok(()) }
}

/// The same where nothing is recorded point by point.
pub(crate) fn check_stops(system: &exec::Model, options: &Options) -> Result<(), Problem> {
    let length = options.to - options.from;
    held(system, length)?;
    let (Method::Fixed(_), Some(step)) = (options.method, options.step) else { return Ok(()) };
    refuse_above(length / step, |n| format!("a step of {step:e} s makes {n} steps up to {:e} s", options.to), STEP)
}

/// The points that are recorded.
fn memory(points: f64, every: f64, recorded: usize) -> Result<(), Problem> {
    let bytes = points * 8.0 * (recorded as f64 + 1.0);
    let free = free_memory();
    if bytes <= MOST_MEMORY * free {
        return Ok(());
    }
    let (points, needed, there) = (count(points), count(bytes / 1e9), count(free / 1e9));
    let reason = format!(
        "{points} points every {every:e} s take {needed} GB of memory, of which {there} GB are free: take a longer --every, a \
         shorter --to, or fewer variables by --record"
    );
    Err(Problem::BadOption { reason })
}

/// Bytes that are free, as Linux tells it.
fn free_memory() -> f64 {
    let told = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = told.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kilobytes = line.and_then(|line| line.trim().trim_end_matches("kB").trim().parse::<f64>().ok());
    kilobytes.map_or(MEMORY, |kilobytes| 1024.0 * kilobytes)
}

const STEP: &str = "take a longer step or a shorter --to";

/// Delays, samples and periodic events: the run stops at each.
pub(crate) fn held(system: &exec::Model, length: f64) -> Result<(), Problem> {
    const LONGER: &str = "take a longer period or a shorter --to";
    let program = system.program();
    let held = program.held.iter().filter_map(|held| match held.kind {
        HeldKind::Delay => Some((held.time, "a delay", "leave out a delay that short, or take a shorter --to")),
        HeldKind::Sample => Some((held.time, "a sampling period", LONGER)),
        HeldKind::Discrete | HeldKind::Impulse => None,
    });
    let every = program.clauses.iter().filter_map(|clause| match clause.trigger {
        Trigger::Every(period) => Some((period, "a `when every`", LONGER)),
        Trigger::Becomes(_) => None,
    });
    for (time, what, remedy) in held.chain(every) {
        let Some(time) = system.constant(time).filter(|time| *time > 0.0) else { continue };
        let words = |n: String| format!("{what} of {time:e} s in the model makes the run stop {n} times");
        refuse_above(length / time, words, remedy)?;
    }
    Ok(())
}

/// What oscillates without end is followed by every method of variable step.
fn oscillations(system: &exec::Model, x: &[f64], options: &Options) -> Result<(), Problem> {
    let length = options.to - options.from;
    let radians = |[re, im]: &[f64; 2]| im.abs() * length.min(if *re < 0.0 { -OVER / re } else { f64::INFINITY });
    let rates = fast_at_start(system, x, MOST / length).unwrap_or_default();
    let Some(most) = rates.into_iter().max_by(|a, b| radians(a).total_cmp(&radians(b))) else { return Ok(()) };
    let frequency = most[1].abs();
    let words = |n: String| {
        format!(
            "an oscillation of {frequency:.3} rad/s, as there is at the start, goes on for {n} radians up to {:e} s",
            options.to
        )
    };
    refuse_above(radians(&most), words, "each takes some steps: take a shorter --to")
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
