//! Runs beside each other, and variables over each other.

use std::collections::BTreeSet;

use super::decimate::decimate;
use crate::chart::{Chart, Curve, Panel, Scale, ScaleKind, chart};
use crate::{Column, Trace};

/// Points of a curve that are drawn at least; of more the extremes.
const SLOTS: usize = 560;

/// What to plot of runs, and how.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PlotOptions {
    /// Names of what goes upwards; empty: everything that was recorded.
    pub vars: Vec<String>,
    /// Name of what goes to the right; `None`: the time.
    pub x: Option<String>,
    /// Whether the axis to the right is logarithmic, and the one upwards.
    pub log: [bool; 2],
}

impl PlotOptions {
    /// Whether a plot over time with nothing chosen is meant.
    pub fn is_plain(&self) -> bool {
        *self == PlotOptions::default()
    }
}

/// Plots runs with their names over the same axes as SVG: a panel for each unit, a curve for each variable and run.
///
/// ```
/// use halfarrow_sim::Sink;
/// let mut trace = halfarrow_trace::Trace::new([("spring.q", "m"), ("body.f", "m/s")]);
/// (0..9).for_each(|i| trace.sample(f64::from(i), &[f64::from(i), f64::from(i * i)]));
/// let phase = halfarrow_trace::PlotOptions { vars: vec!["body.f".into()], x: Some("spring.q".into()), ..Default::default() };
/// let svg = halfarrow_trace::plot_runs(&[("", &trace)], "Spring", &phase).unwrap();
/// assert!(svg.contains("spring.q in m") && svg.contains("body.f"));
/// ```
///
/// # Errors
/// The name of a variable that no run has.
pub fn plot_runs(runs: &[(&str, &Trace)], title: &str, options: &PlotOptions) -> Result<String, String> {
    let known = |name: &str| runs.iter().find_map(|(_, trace)| trace.column(name));
    let vars: Vec<&Column> = match &options.vars[..] {
        [] => all(runs).into_iter().filter(|c| Some(&c.name) != options.x.as_ref()).collect(),
        names => names.iter().map(|name| known(name).ok_or(name.clone())).collect::<Result<_, String>>()?,
    };
    let x = match &options.x {
        None => Scale { label: "t".into(), unit: "s".into(), kind: kind(options.log[0]) },
        Some(name) => {
            let column = known(name).ok_or(name.clone())?;
            Scale { label: name.clone(), unit: column.unit.clone(), kind: kind(options.log[0]) }
        }
    };
    let mut units: Vec<&str> = Vec::new();
    vars.iter().for_each(|c| {
        if !units.contains(&c.unit.as_str()) {
            units.push(&c.unit)
        }
    });
    let height = if units.len() == 1 { 320.0 } else { 170.0 };
    let panel = |unit: &&str| {
        let own: Vec<&Column> = vars.iter().filter(|c| c.unit == **unit).copied().collect();
        let label =
            if own.len() < 4 { own.iter().map(|c| &c.name[..]).collect::<Vec<_>>().join(", ") } else { String::new() };
        let label = if label.chars().count() > 26 { String::new() } else { label };
        let curves =
            own.iter().flat_map(|var| runs.iter().filter_map(|run| curve(var, run, options, runs.len()))).collect();
        let y = Scale { label, unit: unit.to_string(), kind: kind(options.log[1]) };
        Panel { x: x.clone(), y, height, equal: false, curves, guides: Vec::new() }
    };
    Ok(chart(&Chart { title: title.to_string(), note: String::new(), panels: units.iter().map(panel).collect() }))
}

/// The columns of all runs, each name once.
fn all<'t>(runs: &[(&str, &'t Trace)]) -> Vec<&'t Column> {
    let mut seen = BTreeSet::new();
    runs.iter().flat_map(|(_, trace)| &trace.columns).filter(|c| seen.insert(&c.name)).collect()
}

fn kind(log: bool) -> ScaleKind {
    if log { ScaleKind::Logarithmic } else { ScaleKind::Linear }
}

/// A variable of a run; `None` if the run does not have it.
fn curve(var: &Column, (run, trace): &(&str, &Trace), options: &PlotOptions, runs: usize) -> Option<Curve> {
    let values = &trace.column(&var.name)?.values;
    let points = match &options.x {
        Some(x) => trace.column(x)?.values.iter().zip(values).map(|(x, y)| [*x, *y]).collect(),
        None => with_gaps(decimate(&trace.times, values, SLOTS)),
    };
    let name = match (runs, run.is_empty()) {
        (1, _) | (_, true) => var.name.clone(),
        _ => format!("{} · {run}", var.name),
    };
    Some(Curve { name, points, marks: false, dashed: false })
}

/// The runs of finite values as one curve, with a gap between them.
fn with_gaps(runs: Vec<Vec<[f64; 2]>>) -> Vec<[f64; 2]> {
    let mut points: Vec<[f64; 2]> = Vec::new();
    for run in runs {
        if !points.is_empty() {
            points.push([f64::NAN; 2]);
        }
        points.extend(run);
    }
    points
}
