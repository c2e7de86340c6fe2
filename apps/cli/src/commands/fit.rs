//! `fit`.

use std::sync::atomic::Ordering::Relaxed;

use halfarrow::{Error, Fit, FitParameter, FitReport, Problem, Run};
use serde_json::json;

use super::run::{all_listed, execution, method, start};
use super::with_model;
use crate::arguments;
use crate::page::Page;
use crate::screen;
use crate::stop;

/// Parameters from measurements.
pub fn fit(arguments: &arguments::Fit) -> u8 {
    with_model(&arguments.model, |model| {
        let stop = stop::on_signals();
        let report = model.fit(&asked(arguments)?, &mut |_| !stop.load(Relaxed))?;
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
    let number = |(name, text): (String, String)| match text.parse() {
        Ok(value) => Ok((name, value)),
        Err(_) => {
            Err(Problem::BadOption { reason: format!("the standard deviation of `{name}` is `{text}`, no number") })
        }
    };
    Ok(Fit {
        run: Run {
            to: arguments.to.unwrap_or(f64::INFINITY),
            method: method(arguments.solver),
            step: arguments.step,
            rtol: arguments.rtol,
            inputs: arguments.input.iter().map(|(name, path)| (name.clone(), path.into())).collect(),
            start: start(arguments.start),
            execution: execution(arguments.exec),
            ..Run::default()
        },
        data: arguments.data.clone(),
        outputs: pairs(&arguments.outputs, "outputs")?,
        sigma: pairs(&arguments.sigma, "sigma")?.into_iter().map(number).collect::<Result<_, _>>()?,
        parameters: all_listed(&arguments.params)
            .iter()
            .map(|text| FitParameter::parse(text))
            .collect::<Result<_, _>>()?,
        tolerance: arguments.tolerance,
    })
}

fn text(report: &FitReport) -> String {
    let row = |p: &halfarrow::Estimate| {
        let remark = match p.error {
            None => "not told by the data",
            Some(_) if p.at_bound => "at its bound",
            Some(_) => "",
        };
        let error = p.error.map_or("-".to_string(), |error| format!("{error:.5}"));
        [p.name.clone(), format!("{:.6}", p.value), error, p.unit.clone().unwrap_or_default(), remark.to_string()]
    };
    let header = ["parameter", "value", "standard error", "unit", ""];
    let mut text = Page::usual().table(header, report.parameters.iter().map(row));
    text += &format!(
        "sum of squares {:.6e} of {} measurements, {} degrees of freedom; {} runs, {} of them with derivatives\n",
        report.cost, report.measurements, report.freedom, report.evaluations, report.jacobians
    );
    for combination in &report.unidentified {
        let shares: Vec<String> = combination.iter().map(|(name, share)| format!("{share:+.2} {name}")).collect();
        text += &format!("the data do not tell: {} (relative changes)\n", shares.join(" "));
    }
    if !report.success {
        text += &format!("the search has not come to its end: {}\n", report.ended);
    }
    text
}
