//! `sweep`.

use std::sync::atomic::Ordering::Relaxed;

use halfarrow::{Error, Method, Problem, Reduce, Run, Samples, Sweep, SweepAudit, SweepDrift, SweepReport, Vary};
use serde_json::json;

use super::run::{all_listed, execution, method, misses, relation, start};
use super::{warn_of_step, with_model};
use crate::arguments;
use crate::screen::{self, Progress};
use crate::stop;

/// Failures that are shown to people.
const SHOWN: usize = 10;

/// Many sets of parameters.
pub fn sweep(arguments: &arguments::Sweep) -> u8 {
    with_model(&arguments.model, |model| {
        let sweep = asked(arguments)?;
        let notes = match (sweep.run.method, sweep.run.step) {
            (Method::Fixed(method), Some(step)) => warn_of_step(model, sweep.run.form, (method, step), sweep.run.start),
            _ => Vec::new(),
        };
        let mut bar: Option<Progress> = None;
        let stop = stop::on_signals();
        let outcome = model.sweep(&sweep, &arguments.out, &mut |done, sets| {
            bar.get_or_insert_with(|| Progress::of_sets(sets)).reach(done as f64);
            !stop.load(Relaxed)
        });
        if let Some(bar) = &bar {
            bar.finish();
        }
        let report = outcome?;
        report.notes.iter().for_each(|note| screen::note(&format!("warning: {note}")));
        let wrong = told(&report.audit);
        match arguments.model.model.json {
            true => {
                let mut object = json!(report);
                object["notes"] = notes.iter().chain(&report.notes).map(|note| json!(note)).collect();
                screen::print_json(&object)
            }
            false => screen::print(&text(&report, arguments)),
        }?;
        Ok(if report.failed == report.sets || wrong { 3 } else { 0 })
    })
}

/// Says what the audit found wrong; whether rows are not to be used.
fn told(audit: &SweepAudit) -> bool {
    for miss in audit.misses.iter().take(SHOWN) {
        miss.warnings.iter().for_each(|warning| screen::note(&format!("warning: set {}: {warning}", miss.set)));
    }
    if audit.misses.len() > SHOWN {
        screen::note(&format!("warning: ... and {} more sets", audit.misses.len() - SHOWN));
    }
    if audit.refused > 0 {
        screen::note(&format!(
            "error: {} of the {} sets that were audited do not satisfy the model; do not use the rows of these and of sets like \
             them",
            audit.refused, audit.sets
        ));
    }
    audit.refused > 0
}

fn asked(arguments: &arguments::Sweep) -> Result<Sweep, Error> {
    let run = Run {
        to: arguments.to,
        every: arguments.every,
        method: method(arguments.solver),
        step: arguments.step,
        rtol: arguments.rtol,
        project: arguments.project,
        inputs: arguments.input.iter().map(|(name, path)| (name.clone(), path.into())).collect(),
        start: start(arguments.start),
        execution: execution(arguments.exec),
        ..Run::default()
    };
    Ok(Sweep {
        run,
        vary: arguments.vary.iter().map(|text| Vary::parse(text)).collect::<Result<_, Problem>>()?,
        samples: arguments.samples.as_deref().map(Samples::read).transpose()?,
        reduce: all_listed(&arguments.reduce).iter().map(|text| Reduce::parse(text)).collect::<Result<_, Problem>>()?,
        restart: arguments.restart,
        units: arguments.units,
        part: None,
    })
}

fn text(report: &SweepReport, arguments: &arguments::Sweep) -> String {
    let mut text = String::new();
    for failure in report.failures.iter().take(SHOWN) {
        text += &format!("set {}: {}\n", failure.set, failure.reason);
    }
    if report.failed > SHOWN {
        text += &format!("... and {} more that failed\n", report.failed - SHOWN);
    }
    text += &format!("{}: {} sets", report.model, report.sets);
    if report.resumed > 0 {
        text += &format!(" ({} of them from before)", report.resumed);
    }
    if report.failed > 0 {
        text += &format!(", {} failed", report.failed);
    }
    text += &format!(" -> {}\ncolumns: {}\n", arguments.out.display(), report.columns.join(", "));
    let audit = &report.audit;
    text += &format!("audit of {} sets: {}", audit.sets, misses(&audit.greatest));
    if audit.doubtful + audit.refused > 0 {
        text += &format!("; {} doubtful, {} refused", audit.doubtful, audit.refused);
    }
    text += "\n";
    report.drift.iter().for_each(|drift| text += &drifted(drift));
    text
}

/// How far positions have drifted from what only their speeds keep, in the set where they have most.
fn drifted(drift: &SweepDrift) -> String {
    let end = match (drift.greatest, drift.set) {
        _ if drift.kind == "nonholonomic" => None,
        (None, _) => Some("is not known".to_string()),
        (Some(value), _) if value < drift.resolution => Some(format!("below {:.0e} at the end", drift.resolution)),
        (Some(value), Some(set)) => Some(format!("{value:.1e} at the end of set {set}, which has the most")),
        (Some(value), None) => Some(format!("{value:.1e} at the end, of the {} sets that were audited", drift.sets)),
    };
    relation(&drift.relation, drift.kind, end)
}
