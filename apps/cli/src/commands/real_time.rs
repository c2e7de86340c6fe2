//! `run`.

use std::io::{self, IsTerminal};
use std::net::{SocketAddr, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use halfarrow::{Durations, Feed, Form, Method, OnMiss, Problem, RealTimeReport, RealTimeRun, Statistics, frequency};
use serde_json::json;

use super::run::{drifts, execution, method, record, start};
use super::{warn_of_step, with_model};
use crate::arguments::{self, RunArguments};
use crate::page::Page;
use crate::screen;
use crate::stop;

/// Time from one look at a run to the next.
const LOOK: Duration = Duration::from_millis(250);

/// A run against the wall clock.
pub fn run(arguments: &RunArguments) -> u8 {
    with_model(&arguments.model, |model| {
        let run = asked(arguments)?;
        let notes = warn_of_step(model, Form::Minimal, (run.method, 1.0 / run.rate), run.start);
        let stop = stop::on_signals();
        let (statistics, over) = (Statistics::default(), AtomicBool::new(false));
        let outcome = std::thread::scope(|scope| {
            if io::stderr().is_terminal() && !arguments.model.model.json {
                scope.spawn(|| watch(&statistics, &over));
            }
            let outcome = model.run_real_time(&run, &statistics, &stop);
            over.store(true, Relaxed);
            outcome
        });
        let report = outcome?;
        report
            .notes
            .iter()
            .chain(&report.audit.warnings)
            .for_each(|warning| screen::note(&format!("warning: {warning}")));
        if let Some(error) = &report.error {
            screen::note(&format!("error: {error}"));
        }
        match arguments.model.model.json {
            true => {
                let mut object = json!(report);
                object["notes"] = notes.iter().chain(&report.notes).map(|note| json!(note)).collect();
                screen::print_json(&object)
            }
            false => screen::print(&text(&report, Page::of(&arguments.page))),
        }?;
        Ok(if report.error.is_some() { 3 } else { 0 })
    })
}

fn asked(arguments: &RunArguments) -> Result<RealTimeRun, Problem> {
    let bad = |reason: String| Problem::BadOption { reason };
    let Method::Fixed(method) = method(arguments.solver) else {
        return Err(bad("a run against the clock needs a method with fixed step: euler, heun, rk4, implicit_midpoint, linearly_implicit_euler, linearly_implicit_bdf2 or rosenbrock".into()));
    };
    let rate = frequency(&arguments.rate)
        .ok_or_else(|| bad(format!("`{}` is no frequency: write `1kHz`, `500 Hz` or `500`", arguments.rate)))?;
    Ok(RealTimeRun {
        rate,
        length: arguments.length,
        method,
        inputs: arguments.input.iter().map(|text| source(text)).collect::<Result<_, _>>()?,
        output: arguments.output.as_deref().map(address).transpose()?,
        record: record(&arguments.record),
        start: start(arguments.start),
        on_miss: match arguments.on_miss {
            arguments::OnMiss::CatchUp => OnMiss::CatchUp,
            arguments::OnMiss::Skip => OnMiss::Skip,
        },
        bound: Some(arguments.bound),
        project: arguments.project,
        execution: execution(arguments.exec),
    })
}

fn source(text: &str) -> Result<Feed, Problem> {
    match text.split_once('=') {
        _ if text == "stdin" || text == "-" => Ok(Feed::Stdin),
        _ if text.contains("://") => address(text).map(Feed::Udp),
        Some((name, path)) => Ok(Feed::File(name.trim().to_string(), path.trim().into())),
        None => Ok(Feed::Table(text.into())),
    }
}

/// The address of `udp://host:port`.
fn address(text: &str) -> Result<SocketAddr, Problem> {
    let found = text.strip_prefix("udp://").and_then(|host| host.to_socket_addrs().ok()?.next());
    let reason = || format!("`{text}` is no address: write `udp://127.0.0.1:5000`");
    found.ok_or_else(|| Problem::BadOption { reason: reason() })
}

/// Shows how a run goes on, on one line that is written anew.
fn watch(statistics: &Statistics, over: &AtomicBool) {
    let bar = indicatif::ProgressBar::new_spinner();
    while !over.load(Relaxed) {
        bar.set_message(line(statistics));
        bar.tick();
        std::thread::sleep(LOOK);
    }
    bar.finish_and_clear();
}

fn line(statistics: &Statistics) -> String {
    format!(
        "t = {:.1} s, {} misses; step {} (median), {} (longest); late by {} (median), {} (most)",
        statistics.time(),
        statistics.misses(),
        duration(statistics.step.quantile(0.5)),
        duration(statistics.step.most()),
        duration(statistics.jitter.quantile(0.5)),
        duration(statistics.jitter.most()),
    )
}

fn text(report: &RealTimeReport, page: Page) -> String {
    let row = |name: &str, d: &Durations| {
        [name.into(), duration(d.median), duration(d.p99), duration(d.p999), duration(d.max)]
    };
    let rows = [row("step", &report.step), row("late by", &report.jitter)];
    let mut text = page.table(["", "median", "99 %", "99.9 %", "longest"], rows);
    text += &bars("how long steps took", &report.step);
    text += &bars("how late ticks began", &report.jitter);
    text += &format!(
        "{} to t = {} s at {} Hz: {} ticks, {} misses",
        report.model,
        screen::short(report.reached),
        screen::short(report.rate),
        report.ticks,
        report.misses
    );
    text += match (report.misses, report.on_miss) {
        (0, _) => "",
        (_, "skip") => ", late ticks left out",
        _ => ", late ticks caught up",
    };
    if report.skipped > 0 {
        text += &format!(" ({} left out)", report.skipped);
    }
    text += "\n";
    if let Some(modes) = report.modes {
        text += &match (modes.all, modes.possible) {
            (Some(all), Some(possible)) => {
                format!(
                    "modes: {possible} of the {all} that the set-valued laws can have have equations, made before the run\n"
                )
            }
            _ => format!("modes: those of {} set-valued laws are too many to be made before the run\n", modes.laws),
        };
    }
    if report.received + report.rejected > 0 {
        text += &format!("inputs: {} taken, {} could not be read\n", report.received, report.rejected);
    }
    if report.sent + report.lost > 0 {
        text += &format!("outputs: {} sent, {} lost: t,{}\n", report.sent, report.lost, report.outputs.join(","));
    }
    if report.projections > 0 {
        text += &format!("positions put back {} times\n", report.projections);
    }
    text + &drifts(&report.drift)
}

/// A histogram with a line for each factor of 2.
fn bars(title: &str, durations: &Durations) -> String {
    let mut lines: Vec<(f64, u64)> = Vec::new();
    for &(upper, count) in &durations.histogram {
        let end = libm::exp2(libm::ceil(libm::log2(upper * 1e9) - 1e-9)) * 1e-9;
        match lines.last_mut() {
            Some((last, sum)) if *last == end => *sum += count,
            _ => lines.push((end, count)),
        }
    }
    let most = lines.iter().map(|l| l.1).max().unwrap_or(1) as f64;
    let mut text = format!("{title}\n");
    for (end, count) in lines {
        let length = libm::ceil(count as f64 / most * 40.0) as usize;
        text += &format!("  below {:>9} {:>9}  {}\n", duration(end), count, "█".repeat(length));
    }
    text
}

/// A duration in the unit that fits.
fn duration(seconds: f64) -> String {
    let (factor, unit) = match seconds {
        s if s < 1e-6 => (1e9, "ns"),
        s if s < 1e-3 => (1e6, "µs"),
        s if s < 1.0 => (1e3, "ms"),
        _ => (1.0, "s"),
    };
    format!("{:.3} {unit}", seconds * factor)
}
