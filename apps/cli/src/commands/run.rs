//! `simulate`.

use std::path::Path;

use halfarrow::{
    AuditReport, Deviation, DrawOptions, DriftReport, Error, Execution, FixedMethod, Gradient, Method, Model, Problem,
    Record, Reduce, Run, RunReport, Scene, Simulated, Slope, Start, Stopped, Trace, csv_text, extremes, listed,
    write_csv, write_parquet,
};
use serde_json::{Value, json};

use super::analyse::form;
use super::animation;
use super::picture::{check_names, write_picture};
use super::plots::{recorded, write_plots};
use super::with_model;
use crate::arguments::{self, Exec, Simulate, Solver};
use crate::page::Page;
use crate::screen::{self, Progress};
use crate::stop::Listener;

/// A trajectory.
pub fn simulate(arguments: &Simulate) -> u8 {
    with_model(&arguments.model, |model| {
        check_files(arguments)?;
        for path in &arguments.draw {
            write_picture(&model.draw(&DrawOptions::default())?, path)?;
        }
        let (run, own) = animation::filmed(arguments, model, run(arguments))?;
        let mut progress = Progress::new(arguments.to);
        let stop = Listener::new();
        let mut told: Vec<String> = Vec::new();
        let mut reach = |come: halfarrow::Progress<'_>| {
            if let Some(note) = come.note {
                screen::note(&format!("warning: {note}"));
                told.push(note.to_string());
            }
            progress.reach(come.time);
            !stop.is_asked()
        };
        let outcome = match &arguments.gradient {
            None => model.simulate(&run, &mut reach).map(|done| (done, None)),
            Some(number) => gradient(model, &run, number, &mut reach),
        };
        stop.over();
        progress.finish();
        match outcome {
            Ok((mut done, gradient)) => {
                let scene = animation::scene(arguments, model, &mut done, &own)?;
                finish(arguments, model, (&done, gradient.as_ref(), scene.as_ref()), (&told, None))?;
                Ok(0)
            }
            Err(Error::Run(stopped)) => {
                let Stopped { failure, trace, report } = *stopped;
                screen::note(&format!("error: {failure}"));
                let mut done = Simulated { trace, report };
                let scene = animation::scene(arguments, model, &mut done, &own)?;
                finish(arguments, model, (&done, None, scene.as_ref()), (&told, Some(&failure.to_string())))?;
                Ok(3)
            }
            Err(error) => Err(error),
        }
    })
}

/// What a gradient is of, and what it comes to.
type Differentiated = (String, Gradient);

/// A run that is followed backwards.
fn gradient(
    model: &Model,
    run: &Run,
    number: &str,
    reach: &mut dyn FnMut(halfarrow::Progress<'_>) -> bool,
) -> Result<(Simulated, Option<Differentiated>), Error> {
    let wanted = Reduce::parse(number)?;
    let name = || wanted.variable.clone();
    let record = match &run.record {
        Record::Default => Record::Also(vec![name()]),
        Record::Names(names) if !names.contains(&wanted.variable) => {
            Record::Names(names.iter().cloned().chain([name()]).collect())
        }
        other => other.clone(),
    };
    let run = Run { record, sensitivities: run.sensitivities.clone(), ..run.clone() };
    let found = model.gradient(&run, &mut |trace| wanted.objective(trace), reach)?;
    Ok((found.run.clone(), Some((number.trim().to_string(), found))))
}

fn run(arguments: &Simulate) -> Run {
    Run {
        to: arguments.to,
        every: arguments.every,
        at: Vec::new(),
        form: form(arguments.form),
        stiffness: arguments.stiffness,
        damping: arguments.damping,
        method: method(arguments.solver),
        step: arguments.step,
        rtol: arguments.rtol,
        atol: arguments.atol,
        project: arguments.project,
        minimum_norm: arguments.minimum_norm,
        inside: true,
        inputs: arguments.input.iter().map(|(name, path)| (name.clone(), path.into())).collect(),
        start: start(arguments.start),
        record: recorded(arguments, record(&arguments.record)),
        sensitivities: all_listed(&arguments.sensitivity),
        execution: execution(arguments.exec),
    }
}

/// The method that an option names.
pub(super) fn method(solver: Solver) -> Method {
    match solver {
        Solver::Auto => Method::Auto,
        Solver::Explicit => Method::Explicit,
        Solver::Bdf => Method::Bdf,
        Solver::Radau => Method::Radau,
        Solver::Euler => Method::Fixed(FixedMethod::Euler),
        Solver::Heun => Method::Fixed(FixedMethod::Heun),
        Solver::Rk4 => Method::Fixed(FixedMethod::Rk4),
        Solver::ImplicitMidpoint => Method::Fixed(FixedMethod::ImplicitMidpoint),
        Solver::LinearlyImplicitEuler => Method::Fixed(FixedMethod::LinearlyImplicitEuler),
        Solver::LinearlyImplicitBdf2 => Method::Fixed(FixedMethod::LinearlyImplicitBdf2),
        Solver::Rosenbrock => Method::Fixed(FixedMethod::Rosenbrock),
    }
}

/// What evaluates the model.
pub(super) fn execution(exec: Exec) -> Execution {
    match exec {
        Exec::Auto => Execution::Auto,
        Exec::Bytecode => Execution::Bytecode,
        Exec::Machine => Execution::Machine,
    }
}

/// What an option asks to record.
pub(super) fn record(names: &[String]) -> Record {
    match all_listed(names) {
        names if names.is_empty() => Record::Default,
        names if names == ["all"] => Record::All,
        names => Record::Names(names),
    }
}

/// The parts of lists, in order.
pub(super) fn all_listed(lists: &[String]) -> Vec<String> {
    lists.iter().flat_map(|list| listed(list)).map(str::to_string).collect()
}

/// Where an option says to start.
pub(super) fn start(start: arguments::Start) -> Start {
    match start {
        arguments::Start::Given => Start::Given,
        arguments::Start::Equilibrium => Start::Equilibrium,
    }
}

/// That everything can be written, before anything is computed.
fn check_files(arguments: &Simulate) -> Result<(), Problem> {
    for path in &arguments.out {
        if !is_stdout(path) && !["csv", "parquet"].contains(&extension(path).as_str()) {
            return Err(Problem::UnknownKind { path: path.clone(), known: vec!["csv", "parquet"] });
        }
    }
    for path in &arguments.animate {
        if !["html", "htm"].contains(&extension(path).as_str()) {
            return Err(Problem::UnknownKind { path: path.clone(), known: vec!["html"] });
        }
    }
    check_names(&arguments.plot)?;
    check_names(&arguments.draw)
}

fn extension(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).unwrap_or_default()
}

fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Writes and shows what was computed, and says what was not yet told; `error` says why it stopped, if it did. Of a run that
/// never began there is nothing to write.
fn finish(
    arguments: &Simulate,
    model: &Model,
    (done, gradient, scene): (&Simulated, Option<&Differentiated>, Option<&Scene>),
    (told, error): (&[String], Option<&str>),
) -> Result<(), Error> {
    if done.trace.samples() > 0 || error.is_none() {
        model.timed("write", || write_files(arguments, &done.trace))?;
        model.timed("draw", || write_plots(arguments, model, &run(arguments), done))?;
        model.timed("animate", || animation::write(arguments, scene))?;
    }
    let to_stdout = arguments.out.iter().any(|path| is_stdout(path));
    let untold = done.report.notes.iter().filter(|note| !told.contains(note));
    untold.for_each(|note| screen::note(&format!("warning: {note}")));
    if arguments.model.timings && !arguments.model.model.json {
        screen::note(tolerances(&done.report, Page::of(&arguments.page)).trim_end());
        screen::note(routines(&done.report, Page::of(&arguments.page)).trim_end());
    }
    if arguments.model.model.json {
        if !to_stdout {
            screen::print_json(&json_of(arguments, model, (done, gradient), error))?;
        }
    } else if to_stdout {
        screen::note(summary(&done.report).trim_end());
    } else if done.trace.samples() > 0 || error.is_none() {
        screen::print(&(values(&done.trace, Page::of(&arguments.page)) + &summary(&done.report)))?;
    }
    if let (Some(gradient), false, false) = (gradient, arguments.model.model.json, to_stdout) {
        screen::print(&slopes(gradient, done, Page::of(&arguments.page)))?;
    }
    Ok(())
}

fn write_files(arguments: &Simulate, trace: &Trace) -> Result<(), Error> {
    for path in &arguments.out {
        let unwritable = |why: String| Problem::Unwritable { path: path.clone(), why };
        match extension(path).as_str() {
            _ if is_stdout(path) => screen::print(&csv_text(trace, arguments.units))?,
            "parquet" => write_parquet(trace, path).map_err(|why| unwritable(why.source.to_string()))?,
            _ => write_csv(trace, path, arguments.units).map_err(|why| unwritable(why.source.to_string()))?,
        }
    }
    Ok(())
}

/// The report, the columns and, if they are written nowhere else, the values.
fn json_of(
    arguments: &Simulate,
    model: &Model,
    (done, gradient): (&Simulated, Option<&Differentiated>),
    error: Option<&str>,
) -> Value {
    let mut object = json!(done.report);
    if let Some((of, gradient)) = gradient {
        let without: serde_json::Map<_, _> =
            gradient.without.iter().map(|(name, why)| (name.clone(), json!(why))).collect();
        object["gradient"] = json!({"of": of, "value": gradient.value, "slopes": gradient.slopes, "without": without});
    }
    if let Some(error) = error {
        object["error"] = json!(error);
    }
    let columns = done.trace.columns.iter();
    object["columns"] = columns.clone().map(|c| json!({"name": c.name, "unit": c.unit})).collect();
    object["samples"] = json!(done.trace.samples());
    if arguments.out.is_empty() {
        object["t"] = json!(done.trace.times);
        object["values"] = columns.map(|c| (c.name.clone(), json!(c.values))).collect::<serde_json::Map<_, _>>().into();
    }
    object["complete"] = json!(done.report.reached >= arguments.to);
    if arguments.model.timings {
        object["timings"] = json!(done.report.timings);
        object["timings"]["stages"] = json!(model.timings());
        object["tolerances"] = json!(done.report.tolerances);
    }
    object
}

/// How exact each state was kept.
fn tolerances(report: &RunReport, page: Page) -> String {
    let rows = report.tolerances.iter().take(shown(report.tolerances.len()));
    let rows = rows.map(|kept| [kept.name.clone(), screen::short(kept.scale), format!("{:.1e}", kept.absolute)]);
    page.table(["state", "scale (SI)", "error allowed in a step"], rows)
        + &more(report.tolerances.len(), "--json has them")
}

/// What ran as machine code, and why.
fn routines(report: &RunReport, page: Page) -> String {
    let rows = report.execution.iter().map(|routine| {
        let code = if routine.machine { "machine code" } else { "bytecode" };
        [routine.routine.to_string(), routine.instructions.to_string(), code.to_string(), routine.reason.clone()]
    });
    page.table(["evaluated", "instructions", "by", "why"], rows)
}

/// Tables of more rows than this show the first [`FIRST`] of them.
const LONG: usize = 60;
const FIRST: usize = 20;

/// How many of so many rows are shown.
fn shown(rows: usize) -> usize {
    if rows > LONG { FIRST } else { rows }
}

/// What is said of those that are not.
fn more(rows: usize, where_else: &str) -> String {
    if rows > LONG { format!("and {} more: {where_else}\n", rows - FIRST) } else { String::new() }
}

/// Start, end, least and greatest value of every column.
fn values(trace: &Trace, page: Page) -> String {
    let columns = trace.columns.len();
    let rows = trace.columns.iter().take(shown(columns)).map(|c| {
        let first = c.values.first().copied().unwrap_or(f64::NAN);
        let last = c.values.last().copied().unwrap_or(f64::NAN);
        let [least, greatest] = extremes(&trace.times, &c.values);
        let [first, last, least, greatest] = [first, last, least, greatest].map(screen::short);
        [c.name.clone(), c.unit.clone(), first, last, least, greatest]
    });
    page.table(["variable", "unit", "start", "end", "least", "greatest"], rows)
        + &more(columns, "name those of interest with --record, or write all with --out")
}

/// A number, and its derivatives; beside each what a change of one percent does.
fn slopes((of, gradient): &Differentiated, done: &Simulated, page: Page) -> String {
    let variable = of.split_once('(').map_or("", |(_, rest)| rest.trim_end_matches(')').trim());
    let unit = done.trace.columns.iter().find(|c| c.name == variable).map_or("", |c| c.unit.as_str());
    let per = |by: &str| match (unit, by) {
        (unit, "") => unit.to_string(),
        ("" | "1", by) => format!("1/({by})"),
        (unit, by) => format!("({unit})/({by})"),
    };
    // Of many those that matter most.
    let mut sorted: Vec<_> = gradient.slopes.iter().collect();
    if gradient.slopes.len() > LONG {
        let effect = |slope: &Slope| (slope.at.unwrap_or(0.0) * slope.slope).abs();
        sorted.sort_by(|a, b| effect(b).total_cmp(&effect(a)));
    }
    let rows = sorted.into_iter().take(shown(gradient.slopes.len())).map(|slope| {
        let percent = slope.at.map_or(String::new(), |at| screen::short(0.01 * at * slope.slope));
        [slope.name.clone(), screen::short(slope.slope), per(&slope.unit), percent]
    });
    let without = gradient.without.iter().map(|(name, why)| format!("not by {name}: {why}\n"));
    format!("{of} = {} {unit}\n", screen::short(gradient.value))
        + &page.table(["by", "derivative", "unit", "of 1 %"], rows)
        + &more(gradient.slopes.len(), "--json has them")
        + &without.collect::<String>()
}

fn summary(report: &RunReport) -> String {
    let mut text = format!("{} to t = {} s: {} steps", report.model, screen::short(report.reached), report.steps);
    if report.rejected > 0 {
        text += &format!(" ({} more rejected)", report.rejected);
    }
    text += &format!(", {} evaluations", report.evaluations);
    if report.stiff {
        text += ", the stiff method took over";
    }
    if report.jumps + report.switches > 0 {
        text += &format!(", {} jumps and {} switches met", report.jumps, report.switches);
    }
    if report.exchanges > 0 {
        text += &format!(", {} exchanges of independent variables", report.exchanges);
    }
    if report.projections > 0 {
        text += &format!(", positions put back {} times", report.projections);
    }
    if report.corners > 0 {
        text += &format!(", {} corners of inputs", report.corners);
    }
    let gained: f64 = report.audit.events.values().sum();
    let events = match report.audit.events.is_empty() {
        true => String::new(),
        false => format!("; events changed the energy by {gained:.6} J"),
    };
    text + &format!("\naudit: {}{events}\n{}", misses(&report.audit), drifts(&report.audit.drift))
}

/// How far positions have drifted from what only their speeds keep.
pub(super) fn drifts(all: &[DriftReport]) -> String {
    let line = |drift: &DriftReport| {
        let end = match (drift.value, drift.greatest) {
            (None, _) => "is not known".into(),
            (Some(value), _) if value.abs() < drift.resolution => format!("below {:.0e}", drift.resolution),
            (Some(value), None) => format!("{value:.1e} at the end"),
            (Some(value), Some(greatest)) => format!("{value:.1e} at the end, {greatest:.1e} at most"),
        };
        relation(&drift.relation, drift.kind, Some(end).filter(|_| drift.kind != "nonholonomic"))
    };
    all.iter().map(line).collect()
}

/// A line about a relation of some kind: how far positions have drifted from it, if it binds positions.
pub(super) fn relation(text: &str, kind: &str, drifted: Option<String>) -> String {
    let Some(drifted) = drifted else {
        return format!("nonholonomic: {} = 0 binds speeds and no positions\n", brief(text));
    };
    let open = match kind {
        "closed" => "",
        "open" => " = 0, of positions without a closed form,",
        _ => " = 0, which may or may not bind positions,",
    };
    format!("drift: {}{open} {drifted}\n", brief(text))
}

/// A relation by its beginning where it is long; the whole of it is in JSON.
fn brief(relation: &str) -> String {
    const LONGEST: usize = 300;
    match relation.char_indices().nth(LONGEST) {
        Some((end, _)) => {
            format!("{}… ({} characters, all of them with --json)", &relation[..end], relation.chars().count())
        }
        None => relation.into(),
    }
}

/// The greatest miss of each kind.
pub(super) fn misses(audit: &AuditReport) -> String {
    let parts =
        [("power", &audit.power), ("energy", &audit.energy), ("residual", &audit.residual), ("rates", &audit.rates)];
    let misses = parts.iter().filter_map(|(name, miss)| miss.as_ref().map(|m| format!("{name} {}", missed(m))));
    misses.collect::<Vec<_>>().join(", ")
}

/// A miss; one that the samples cannot resolve is said to be below that.
fn missed(miss: &Deviation) -> String {
    if miss.value < miss.resolution { format!("below {:.0e}", miss.resolution) } else { format!("{:.0e}", miss.value) }
}
