//! `compare`.

use halfarrow::{Compare, CompareReport, Error, Row};
use serde_json::json;

use super::picture::{check_names, write_picture};
use super::with_model;
use crate::arguments;
use crate::page::Page;
use crate::screen::{self, Progress};

/// All formulations beside each other.
pub fn compare(arguments: &arguments::Compare) -> u8 {
    with_model(&arguments.model, |model| {
        check_names(&arguments.plot)?;
        let wanted = Compare {
            to: arguments.to,
            error: arguments.error,
            inputs: arguments.input.iter().map(|(name, path)| (name.clone(), path.into())).collect(),
            repeats: arguments.repeats,
            patience: arguments.patience,
            budget: arguments.budget,
        };
        let page = Page::of(&arguments.page);
        let json = arguments.model.model.json;
        let forms = with_bar(|go_on| model.compared_forms(&wanted, go_on))?;
        if !json {
            // Sizes are known long before times are.
            screen::print(&page.lines(&sizes(model.name(), forms.rows(), page)))?;
        }
        let report = with_bar(|go_on| forms.measured(go_on))?;
        for path in &arguments.plot {
            write_picture(&report.plot(), path)?;
        }
        match json {
            true => screen::print_json(&json!(report)),
            false => screen::print(&page.lines(&times(&report, page))),
        }?;
        match report.refused()[..] {
            [] => Ok(0),
            ref forms => {
                let forms = forms.join(", ");
                screen::note(&format!("error: results of {forms} do not satisfy the model, as the audit found"));
                Ok(3)
            }
        }
    })
}

/// Does something while a bar shows how far it is.
fn with_bar<T>(work: impl FnOnce(&mut dyn FnMut(f64, &str) -> bool) -> Result<T, Error>) -> Result<T, Error> {
    let mut bar = Progress::new(1.0);
    let done = work(&mut |part, form| {
        bar.part(part, form);
        true
    });
    bar.finish();
    done
}

/// What each form is, and how large.
fn sizes(model: &str, rows: &[Row], page: Page) -> String {
    let header = ["form", "unknowns", "index", "loops", "largest", "operations", "compiled in"];
    let cells = |row: &Row| {
        let number = |n: Option<usize>| n.map_or("-".to_string(), |n| n.to_string());
        [
            row.form.to_string(),
            format!("{} + {}", number(row.differential), number(row.algebraic)),
            row.index.map_or("-".to_string(), |index| index.to_string()),
            row.loops.map_or("-".to_string(), |l| format!("{} + {}", l.linear, l.iterated)),
            number(row.loops.map(|l| l.largest)),
            number(row.flops),
            row.seconds_to_compile.map_or("-".to_string(), seconds),
        ]
    };
    let mut text = format!("{model}: its forms (unknowns: differential + algebraic; loops: linear + nonlinear)\n");
    text += &page.table(header, rows.iter().filter(|row| row.differential.is_some()).map(cells));
    for row in rows {
        text += &format!("{}: {}\n", row.form, row.reason.as_deref().unwrap_or(row.meaning));
    }
    text
}

fn seconds(seconds: f64) -> String {
    if seconds < 0.1 { format!("{:.1} ms", 1e3 * seconds) } else { format!("{seconds:.1} s") }
}

/// What they take, at equal error.
fn times(report: &CompareReport, page: Page) -> String {
    let short = screen::short;
    let mut text = String::new();
    if report.reference.is_some() {
        text += &format!("\n{} to {} s, times at an error of {:.0e}\n", report.model, short(report.to), report.error);
        let header = ["form", "solver", "steps", "time for 1 s", "ratio", "disagreement", "energy"];
        text += &page.table(header, report.rows.iter().filter(|row| row.differential.is_some()).map(cells));
    }
    for row in report.rows.iter().filter(|row| row.differential.is_some()) {
        if let Some(reason) = &row.reason {
            text += &format!("{}: {reason}\n", row.form);
        }
        if let Some(order) = row.order {
            text += &format!("{}: converges with order {order:.2} in its stiffness\n", row.form);
        }
    }
    if let Some(reference) = &report.reference {
        let (by, to) = (reference.confirmed_by, reference.confirmed_to);
        let confirmed = if to.is_nan() { String::new() } else { format!(", confirmed by {by} to {to:.0e}") };
        text += &format!("reference: minimal at rtol 1e-12{confirmed}\n");
    }
    report.notes.iter().for_each(|note| text += &format!("{note}\n"));
    text
}

fn cells(row: &Row) -> [String; 7] {
    let number = |n: Option<usize>| n.map_or("-".to_string(), |n| n.to_string());
    let small = |x: Option<f64>| x.map_or("-".to_string(), |x| format!("{x:.0e}"));
    [
        row.form.to_string(),
        row.solver.unwrap_or("-").to_string(),
        number(row.steps),
        row.time_text().unwrap_or("-".to_string()),
        row.times_minimal.map_or("-".to_string(), |ratio| format!("{ratio:.1}")),
        small(row.max_error),
        energy(row),
    ]
}

/// The miss of energy; one that the steps cannot resolve is said to be below that.
fn energy(row: &Row) -> String {
    match (row.energy_error, row.energy_resolution) {
        (Some(miss), Some(resolution)) if miss < resolution => format!("< {resolution:.0e}"),
        (Some(miss), _) => format!("{miss:.0e}"),
        _ => "-".to_string(),
    }
}
