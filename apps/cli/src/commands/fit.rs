//! `fit`.

use std::sync::atomic::Ordering::Relaxed;

use halfarrow::{Error, Fit, FitParameter, FitReport, Loss, Model, PlotOptions, Problem, Profile, Run, Sigma, Trace};
use serde_json::json;

use super::picture::{check_names, write_picture};
use super::run::{all_listed, execution, method, start};
use super::with_model;
use crate::arguments;
use crate::page::Page;
use crate::screen;
use crate::stop;

/// Parameters from measurements.
pub fn fit(arguments: &arguments::Fit) -> u8 {
    with_model(&arguments.model, |model| {
        check_names(&arguments.plot)?;
        let stop = stop::on_signals();
        let report = model.fit(&asked(arguments)?, &mut |_| !stop.load(Relaxed))?;
        draw(arguments, model, &report)?;
        match arguments.model.model.json {
            true => screen::print_json(&json!(report)),
            false => screen::print(&text(&report)),
        }?;
        Ok(if report.success { 0 } else { 3 })
    })
}

fn asked(arguments: &arguments::Fit) -> Result<Fit, Error> {
    let pairs = |lists: &[String], option: &str| -> Result<Vec<(String, String)>, Problem> {
        let pair = |text: String| match text.split_once('=') {
            Some((name, value)) => Ok((name.trim().to_string(), value.trim().to_string())),
            None => Err(Problem::BadOption { reason: format!("`{text}` is no pair: write --{option} NAME={option}") }),
        };
        all_listed(lists).into_iter().map(pair).collect()
    };
    let sigma = |(name, text): (String, String)| match (text.strip_prefix('@'), text.parse()) {
        (Some(column), _) => Ok((name, Sigma::Column(column.trim().to_string()))),
        (None, Ok(value)) => Ok((name, Sigma::Number(value))),
        (None, Err(_)) => {
            let reason = format!(
                "the standard deviation of `{name}` is `{text}`: give a number, or a column of the data as @NAME"
            );
            Err(Problem::BadOption { reason })
        }
    };
    let (columns, files): (Vec<_>, Vec<_>) = arguments.input.iter().partition(|(_, from)| from.starts_with('@'));
    Ok(Fit {
        run: Run {
            to: arguments.to.unwrap_or(f64::INFINITY),
            method: method(arguments.solver),
            step: arguments.step,
            rtol: arguments.rtol,
            inputs: files.into_iter().map(|(name, path)| (name.clone(), path.into())).collect(),
            start: start(arguments.start),
            execution: execution(arguments.exec),
            ..Run::default()
        },
        data: arguments.data.clone(),
        outputs: pairs(&arguments.outputs, "outputs")?,
        columns: columns.into_iter().map(|(name, from)| (name.clone(), from[1..].trim().to_string())).collect(),
        sigma: pairs(&arguments.sigma, "sigma")?.into_iter().map(sigma).collect::<Result<_, _>>()?,
        parameters: all_listed(&arguments.params)
            .iter()
            .map(|text| FitParameter::parse(text))
            .collect::<Result<_, _>>()?,
        tolerance: arguments.tolerance,
        starts: arguments.starts,
        loss: (loss(arguments.loss), arguments.loss_scale),
        profiles: all_listed(&arguments.profile),
    })
}

fn loss(loss: arguments::Loss) -> Loss {
    match loss {
        arguments::Loss::Linear => Loss::Linear,
        arguments::Loss::SoftL1 => Loss::SoftL1,
        arguments::Loss::Huber => Loss::Huber,
        arguments::Loss::Cauchy => Loss::Cauchy,
        arguments::Loss::Arctan => Loss::Arctan,
    }
}

/// Measurements and the fitted model over each other, what is left over below.
fn draw(arguments: &arguments::Fit, model: &Model, report: &FitReport) -> Result<(), Error> {
    if arguments.plot.is_empty() {
        return Ok(());
    }
    let several = report.runs.len() > 1;
    let called = |what: &str, run: &halfarrow::FittedRun| match several {
        true => format!("{what}, {}", run.name),
        false => what.to_string(),
    };
    let traces: Vec<(String, &Trace)> = report
        .runs
        .iter()
        .flat_map(|run| [(called("measured", run), &run.measured), (called("fitted", run), &run.fitted)])
        .collect();
    let named: Vec<(&str, &Trace)> = traces.iter().map(|(name, trace)| (name.as_str(), *trace)).collect();
    let vars =
        report.runs.first().map_or(Vec::new(), |run| run.measured.columns.iter().map(|c| c.name.clone()).collect());
    let picture = model.plot_runs(&named, &PlotOptions { vars, ..PlotOptions::default() })?;
    arguments.plot.iter().try_for_each(|path| write_picture(&picture, path))
}

/// A profile as a table, and what it tells.
fn profiled(profile: &Profile) -> String {
    let rows = profile.values.iter().zip(&profile.sums);
    let rows = rows.map(|(value, sum)| [screen::short(*value), format!("{sum:.6e}")]);
    let end = |end: Option<f64>, open: &str| end.map_or(open.to_string(), screen::short);
    let (low, high) = profile.interval;
    Page::usual().table([profile.name.as_str(), "least sum of squares"], rows)
        + &format!(
            "{:.0} % interval of {} by its profile: {} to {}\n",
            100.0 * profile.level,
            profile.name,
            end(low, "below all these"),
            end(high, "above all these")
        )
}

fn text(report: &FitReport) -> String {
    let row = |p: &halfarrow::Estimate| {
        let remark = match p.error {
            None => "not told by the data",
            Some(_) if p.at_bound => "at its bound",
            Some(_) => "",
        };
        let error = p.error.map_or("-".to_string(), screen::short);
        let interval =
            p.interval.map_or("-".to_string(), |(a, b)| format!("{} to {}", screen::short(a), screen::short(b)));
        [
            p.name.clone(),
            screen::short(p.value),
            error,
            interval,
            p.unit.clone().unwrap_or_default(),
            remark.to_string(),
        ]
    };
    let header = ["parameter", "value", "standard error", "95 % interval", "unit", ""];
    let mut text = Page::usual().table(header, report.parameters.iter().map(row));
    text += &format!(
        "sum of squares {:.6e} of {} measurements, {} degrees of freedom; {} runs, {} of them with derivatives\n",
        report.cost, report.measurements, report.freedom, report.evaluations, report.jacobians
    );
    for combination in &report.unidentified {
        let shares: Vec<String> = combination.iter().map(|(name, share)| format!("{share:+.2} {name}")).collect();
        text += &format!("the data do not tell: {} (relative changes)\n", shares.join(" "));
    }
    if report.starts.len() > 1 {
        let same = |cost: f64| (cost - report.cost).abs() <= 1e-6 * report.cost.abs() + 1e-12;
        let (ran, there) = report
            .starts
            .iter()
            .filter_map(|start| start.cost)
            .fold((0, 0), |(ran, there), cost| (ran + 1, there + usize::from(same(cost))));
        text +=
            &format!("{} searches, {ran} from where the model runs, {there} of them ended here\n", report.starts.len());
    }
    report.profiles.iter().for_each(|profile| text += &profiled(profile));
    if !report.success {
        text += &format!("the search has not come to its end: {}\n", report.ended);
    }
    text
}
