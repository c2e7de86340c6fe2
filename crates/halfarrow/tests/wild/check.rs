//! What must hold of any model, whatever it is made of.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use halfarrow::{Error, Form, Method, Model, Record, Run, Simulated, Start, Verdict};

/// A property that does not hold: which, and how.
pub struct Fault {
    pub what: &'static str,
    pub details: String,
}

fn fault<T>(what: &'static str, details: impl Into<String>) -> Result<T, Fault> {
    Err(Fault { what, details: details.into() })
}

/// What came of the models of a test.
#[derive(Debug, Default)]
pub struct Seen {
    pub models: usize,
    /// Refused with a reason, before a run.
    pub refused: usize,
    /// The run stopped with a reason.
    pub stopped: usize,
    /// Runs to the end.
    pub ran: usize,
    /// Runs of other forms beside them.
    pub others: usize,
    /// Models found at rest.
    pub resting: usize,
    /// Runs given up since they crawl.
    pub slow: usize,
}

const FORMS: [Form; 5] = [Form::Kane, Form::Break, Form::Relaxed, Form::Lagrange, Form::Inverted];
/// What may be left between two forms; where the inverse of a cube may rest, the root of what the tolerance leaves of what moves it.
const SAME: f64 = 1e-4;
const SAME_AT_A_ROOT: f64 = 1e-2;
/// What rests stays to this part; what a root makes of it, to the root of that.
const STAYS: f64 = 1e-5;
const PATIENCE: Duration = Duration::from_millis(1500);

/// Checks a model; the first property that does not hold.
pub fn check(text: &str, seen: &mut Seen) -> Result<(), Fault> {
    let checked = catch_unwind(AssertUnwindSafe(|| holds(text, seen)));
    checked.unwrap_or_else(|panic| {
        let words = panic.downcast_ref::<String>().cloned();
        fault("panic", words.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string)).unwrap_or_default())
    })
}

fn holds(text: &str, seen: &mut Seen) -> Result<(), Fault> {
    seen.models += 1;
    let model = match Model::from_text("wild.bond", text, &[]) {
        Ok(model) => model,
        Err(error) => return fault("refused as text", error.render(false)),
    };
    let _ = model.loops();
    names_are_unique(&model)?;
    let Some(minimal) = run(&model, Form::Minimal, Start::Given, 0.4, seen)? else { return Ok(()) };
    seen.ran += 1;
    audited(&minimal, "minimal")?;
    for form in FORMS {
        if let Some(other) = run(&model, form, Start::Given, 0.4, &mut Seen::default())? {
            seen.others += 1;
            agree(&minimal, &other, form, if text.contains("^3") { SAME_AT_A_ROOT } else { SAME })?;
        }
    }
    rests(&model, text, seen)
}

/// No two unknowns of a form have one name.
fn names_are_unique(model: &Model) -> Result<(), Fault> {
    for form in FORMS.into_iter().chain([Form::Minimal, Form::Stiff]) {
        let Ok(report) = model.equations(form) else { continue };
        let mut names: Vec<&String> = report.states.iter().map(|s| &s.name).collect();
        names.extend(report.algebraic.iter().map(|a| &a.name));
        names.sort();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return fault("two unknowns of one name", format!("{} of {form:?}", twice[0]));
        }
    }
    Ok(())
}

/// A run to its end; `None` where the model or the run is refused with a reason.
fn run(model: &Model, form: Form, start: Start, to: f64, seen: &mut Seen) -> Result<Option<Simulated>, Fault> {
    let run = Run {
        to,
        every: Some(to / 8.0),
        form,
        method: Method::Auto,
        rtol: 1e-9,
        start,
        record: Record::All,
        ..Run::default()
    };
    let begun = Instant::now();
    let result = model.simulate(&run, &mut |_| begun.elapsed() < PATIENCE);
    match result {
        Ok(done) => Ok(Some(done)),
        Err(Error::Run(stopped)) => {
            seen.slow += usize::from(begun.elapsed() >= PATIENCE);
            seen.stopped += 1;
            match stopped.failure {
                // The audit caught what should have been right.
                halfarrow::Failure::Untrue { .. } if form == Form::Minimal => fault("untrue", stopped.to_string()),
                _ => Ok(None),
            }
        }
        Err(_) => {
            seen.refused += 1;
            Ok(None)
        }
    }
}

/// What the audit measured is small.
fn audited(done: &Simulated, form: &str) -> Result<(), Fault> {
    let audit = &done.report.audit;
    // Where everything rests, rounding is all that there is to be missed.
    if form == "at rest" && audit.verdict == Verdict::Holds {
        return Ok(());
    }
    for (name, miss, allowed) in
        [("power", &audit.power, 1e-7_f64), ("residual", &audit.residual, 1e-7), ("rates", &audit.rates, 1e-3)]
    {
        if let Some(miss) = miss
            && (miss.value.is_nan() || miss.value > allowed.max(miss.resolution))
        {
            let details = format!("{form}: {name} missed by {:.0e} at {} s: {}", miss.value, miss.time, miss.place);
            return fault("audit", details);
        }
    }
    Ok(())
}

/// Every variable that both forms have is the same.
fn agree(minimal: &Simulated, other: &Simulated, form: Form, same: f64) -> Result<(), Fault> {
    let most = minimal.trace.columns.iter().flat_map(|c| &c.values).fold(0.0f64, |m, v| m.max(v.abs()));
    for column in &minimal.trace.columns {
        let Some(twin) = other.trace.columns.iter().find(|c| c.name == column.name) else { continue };
        let size = column.values.iter().fold(1e-3 * most, |m, v| m.max(v.abs()));
        // Samples at a jump may stand on either side of it.
        for (i, (a, b)) in column.values.iter().zip(&twin.values).enumerate() {
            if (a - b).abs() > same * size || a.is_nan() != b.is_nan() {
                let details = format!("{form:?}: {} is {a} by the minimal form and {b} at sample {i}", column.name);
                return fault("forms disagree", details);
            }
        }
    }
    Ok(())
}

/// A start at rest stays there.
fn rests(model: &Model, text: &str, seen: &mut Seen) -> Result<(), Fault> {
    if text.contains("(t)") || text.contains("*t)") || text.contains("if t") {
        return Ok(());
    }
    let Some(still) = run(model, Form::Minimal, Start::Equilibrium, 0.05, &mut Seen::default())? else { return Ok(()) };
    seen.resting += 1;
    let roots = text.contains("abs(") || text.contains("^3");
    let most = still.trace.columns.iter().flat_map(|c| &c.values).fold(0.0f64, |m, v| m.max(v.abs()));
    for column in &still.trace.columns {
        let (first, last) = (column.values[0], column.values[column.values.len() - 1]);
        let is_state = [".q", ".p"].iter().any(|kind| column.name.ends_with(kind));
        let stays = STAYS * most.max(1e-3);
        if (first - last).abs() > if is_state || !roots { stays } else { stays.sqrt() } {
            return fault("leaves its equilibrium", format!("{} goes from {first} to {last}", column.name));
        }
    }
    audited(&still, "at rest")
}
