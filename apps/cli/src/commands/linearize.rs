//! `linearize`.

use halfarrow::{Linearize, LinearizeReport, Point, ReachReport, Stability, SymbolicReport};
use serde_json::json;

use super::picture::{check_names, write_picture};
use super::run::all_listed;
use super::with_model;
use crate::arguments;
use crate::page::Page;
use crate::screen::{self, short};

/// Matrices, poles, zeros, frequency response.
pub fn linearize(arguments: &arguments::Linearize) -> u8 {
    with_model(&arguments.model, |model| {
        check_names(&arguments.plot)?;
        check_names(&arguments.nyquist)?;
        let report = model.linearize(&wanted(arguments))?;
        for path in &arguments.plot {
            write_picture(&report.bode(), path)?;
        }
        for path in &arguments.nyquist {
            write_picture(&report.nyquist(), path)?;
        }
        match arguments.model.model.json {
            true => screen::print_json(&json!(report)),
            false => {
                let page = Page::of(&arguments.page);
                screen::print(&page.lines(&text(&report, page)))
            }
        }?;
        Ok(0)
    })
}

fn wanted(arguments: &arguments::Linearize) -> Linearize {
    let given = |names: &[String]| (!names.is_empty()).then(|| all_listed(names));
    Linearize {
        at: match arguments.at {
            arguments::Point::Start => Point::Start,
            arguments::Point::Equilibrium => Point::Equilibrium,
            arguments::Point::Time(t) => Point::Time(t),
        },
        inputs: given(&arguments.inputs),
        outputs: given(&arguments.outputs),
        symbolic: arguments.symbolic,
        series: arguments.input.iter().map(|(name, path)| (name.clone(), path.into())).collect(),
    }
}

fn text(report: &LinearizeReport, page: Page) -> String {
    let at = match report.at {
        "time" => format!("at t = {} s", short(report.t)),
        "start" => "at the start".to_string(),
        other => format!("at the {other}"),
    };
    let mut text = format!("{} {at}\n", report.model);
    let unit = |u: &Option<String>| u.clone().unwrap_or_default();
    let states = report.states.iter().map(|s| [s.name.clone(), unit(&s.unit), short(s.value), short(s.rate)]);
    text += &page.table(["state", "unit", "value", "rate"], states);
    if !report.positions.is_empty() {
        let positions = report.positions.iter().map(|p| [p.name.clone(), unit(&p.unit), short(p.value)]);
        text += &page.table(["follows", "unit", "value"], positions);
    }
    let (inputs, outputs): (Vec<&str>, Vec<&str>) = (
        report.inputs.iter().map(|t| t.name.as_str()).collect(),
        report.outputs.iter().map(|t| t.name.as_str()).collect(),
    );
    let names: Vec<&str> = report.states.iter().map(|s| s.name.as_str()).collect();
    if names.len() <= 12 {
        text += &matrix(page, "A", &report.a, &names, &names);
        text += &matrix(page, "B", &report.b, &names, &inputs);
        text += &matrix(page, "C", &report.c, &outputs, &names);
        text += &matrix(page, "D", &report.d, &outputs, &inputs);
    } else {
        text += "The matrices are large: --json has them.\n";
    }
    let modes = report.modes.iter().map(|m| {
        let time = m.time_constant.map_or("-".to_string(), short);
        [complex(m.pole), short(m.natural_frequency), short(m.damping), time]
    });
    text += "\nPoles\n";
    text += &page.table(["pole in 1/s", "natural frequency in rad/s", "damping", "time constant in s"], modes);
    text += match report.stability {
        Stability::Asymptotic => "All poles are left of the imaginary axis.\n",
        Stability::Marginal => "No pole is right of the imaginary axis, but not all are left of it.\n",
        Stability::Unstable => "Not all poles are left of the imaginary axis: motions grow.\n",
    };
    text += &match &report.zeros {
        None => "Zeros: they do not come out\n".to_string(),
        Some(zeros) if zeros.is_empty() => "Zeros: none\n".to_string(),
        Some(zeros) => {
            let upper = zeros.iter().filter(|z| z[1] >= 0.0).map(|z| complex(*z));
            format!("Zeros: {}\n", upper.collect::<Vec<_>>().join(", "))
        }
    };
    text += &reach("Controllability", &report.controllability);
    text += &reach("Observability", &report.observability);
    if let Some(symbolic) = &report.symbolic {
        text += &page.lines(&symbolic_text(symbolic, &names, &inputs, &outputs));
    }
    report.notes.iter().for_each(|note| text += &format!("{note}\n"));
    text
}

/// `-1 ± 2i`, or a real number.
fn complex([re, im]: [f64; 2]) -> String {
    match im == 0.0 {
        true => short(re),
        false if re == 0.0 => format!("± {} i", short(im.abs())),
        false => format!("{} ± {} i", short(re), short(im.abs())),
    }
}

fn matrix(page: Page, name: &str, rows: &[Vec<f64>], down: &[&str], across: &[&str]) -> String {
    if down.is_empty() || across.is_empty() {
        return format!("{name}: empty\n");
    }
    let header = std::iter::once(name.to_string()).chain(across.iter().map(ToString::to_string));
    let lines = rows
        .iter()
        .zip(down)
        .map(|(row, name)| std::iter::once(name.to_string()).chain(row.iter().map(|&v| short(v))).collect::<Vec<_>>());
    page.wide_table(header.collect(), lines)
}

fn reach(what: &str, report: &ReachReport) -> String {
    let rank = report.rank.map_or("not found".to_string(), |rank| format!("{rank} of {}", report.order));
    let mut text = format!("{what}: rank {rank}");
    if let (Some(rank), Some(order)) = (report.structural_rank, report.structural_order) {
        text += &format!(", by causal paths {rank} of {order}");
    }
    if !report.unattained.is_empty() {
        text += &format!("; no causal path to {}", report.unattained.join(", "));
    }
    if !report.integral.is_empty() {
        text += &format!("; {} cannot take derivative causality", report.integral.join(", "));
    }
    text += "\n";
    if let Some(note) = &report.note {
        text += &format!("    {note}\n");
    }
    text
}

fn symbolic_text(report: &SymbolicReport, states: &[&str], inputs: &[&str], outputs: &[&str]) -> String {
    let mut text = "\nIn symbols, what is not 0\n".to_string();
    let matrices = [
        ("A", &report.a, states, states),
        ("B", &report.b, states, inputs),
        ("C", &report.c, outputs, states),
        ("D", &report.d, outputs, inputs),
    ];
    for (name, rows, down, across) in matrices {
        for (row, down) in rows.iter().zip(down) {
            for (entry, across) in row.iter().zip(across).filter(|(entry, _)| *entry != "0") {
                text += &format!("  {name}[{down}, {across}] = {entry}\n");
            }
        }
    }
    for transfer in &report.transfer {
        text += &format!("  {} / {} = {}\n", transfer.output, transfer.input, transfer.text);
    }
    if let Some(note) = &report.note {
        text += &format!("  {note}\n");
    }
    text
}
