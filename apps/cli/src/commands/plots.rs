//! What `simulate --plot` plots: chosen variables and axes, further runs over the same axes.

use std::path::Path;

use halfarrow::{Error, Model, Override, PlotOptions, Problem, Record, Run, Simulated, Trace, listed, read_trace};

use super::picture::write_picture;
use super::run::all_listed;
use crate::arguments::{PlotLog, Simulate};

/// The variables that a plot needs beside what is recorded anyway.
pub fn recorded(arguments: &Simulate, record: Record) -> Record {
    let wanted: Vec<String> = options(arguments).vars.into_iter().chain(arguments.plot_x.clone()).collect();
    match record {
        Record::Default if !wanted.is_empty() => Record::Also(wanted),
        Record::Names(names) => {
            let more = wanted.into_iter().filter(|name| !names.contains(name)).collect::<Vec<_>>();
            Record::Names([names, more].concat())
        }
        record => record,
    }
}

fn options(arguments: &Simulate) -> PlotOptions {
    let log = arguments.plot_log;
    PlotOptions {
        vars: all_listed(&arguments.plot_vars),
        x: arguments.plot_x.clone(),
        log: [matches!(log, Some(PlotLog::X | PlotLog::Xy)), matches!(log, Some(PlotLog::Y | PlotLog::Xy))],
    }
}

/// Writes the plots of a run, with the runs that are to lie over it.
pub fn write_plots(arguments: &Simulate, model: &Model, run: &Run, done: &Simulated) -> Result<(), Error> {
    if arguments.plot.is_empty() {
        return Ok(());
    }
    let options = options(arguments);
    let picture = if options.is_plain() && arguments.overlay.is_empty() {
        model.plot(&done.trace)
    } else {
        let others = arguments.overlay.iter().map(|what| Ok((what.as_str(), other(model, run, &done.trace, what)?)));
        let others = others.collect::<Result<Vec<(&str, Trace)>, Error>>()?;
        let own = if others.is_empty() { "" } else { "as given" };
        let further = others.iter().map(|(name, trace)| (*name, trace));
        let runs: Vec<(&str, &Trace)> = std::iter::once((own, &done.trace)).chain(further).collect();
        model.plot_runs(&runs, &options)?
    };
    arguments.plot.iter().try_for_each(|path| write_picture(&picture, path))
}

/// A run to lie over the one that was asked for: of a file, or with other parameters.
fn other(model: &Model, run: &Run, own: &Trace, what: &str) -> Result<Trace, Error> {
    if Path::new(what).extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
        return Ok(read_trace(Path::new(what), own)?);
    }
    let pair = |text: &str| {
        let parts = text.split_once('=').map(|(name, value)| (name.trim().to_string(), value.trim().to_string()));
        let (name, value) = parts.filter(|(name, value)| !name.is_empty() && !value.is_empty()).ok_or_else(|| {
            let reason = format!("`{what}` is neither a .csv file nor parameters as in `k=20e3,b=5`");
            Error::from(Problem::BadOption { reason })
        })?;
        Ok(Override { name, value })
    };
    let set = listed(what).into_iter().map(pair).collect::<Result<Vec<Override>, Error>>()?;
    Ok(model.with(&set)?.simulate(run, &mut |_| true)?.trace)
}
