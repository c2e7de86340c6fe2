//! `sweep`.

use halfarrow::{Error, Problem, Reduce, Run, Samples, Sweep, SweepReport, Vary};
use serde_json::json;

use super::run::{method, start};
use super::with_model;
use crate::arguments;
use crate::screen::{self, Progress};

/// Failures that are shown to people.
const SHOWN: usize = 10;

/// Many sets of parameters.
pub fn sweep(arguments: &arguments::Sweep) -> u8 {
    with_model(&arguments.model, |model| {
        let sweep = asked(arguments)?;
        let mut bar: Option<Progress> = None;
        let outcome = model.sweep(&sweep, &arguments.out, &mut |done, sets| {
            bar.get_or_insert_with(|| Progress::of_sets(sets)).reach(done as f64);
            true
        });
        if let Some(bar) = &bar {
            bar.finish();
        }
        let report = outcome?;
        match arguments.model.model.json {
            true => screen::print_json(&json!(report)),
            false => screen::print(&text(&report, arguments)),
        }
        Ok(if report.failed == report.sets { 3 } else { 0 })
    })
}

fn asked(arguments: &arguments::Sweep) -> Result<Sweep, Error> {
    let run = Run {
        to: arguments.to,
        every: arguments.every,
        method: method(arguments.solver),
        step: arguments.step,
        rtol: arguments.rtol,
        inputs: arguments.input.iter().map(|(name, path)| (name.clone(), path.into())).collect(),
        start: start(arguments.start),
        ..Run::default()
    };
    Ok(Sweep {
        run,
        vary: arguments.vary.iter().map(|text| Vary::parse(text)).collect::<Result<_, Problem>>()?,
        samples: arguments.samples.as_deref().map(Samples::read).transpose()?,
        reduce: arguments.reduce.iter().map(|text| Reduce::parse(text)).collect::<Result<_, Problem>>()?,
        restart: arguments.restart,
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
    text + &format!(" -> {}\ncolumns: {}\n", arguments.out.display(), report.columns.join(", "))
}
