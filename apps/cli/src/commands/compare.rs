//! `compare`.

use halfarrow::{Compare, CompareReport, Row};
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
        let mut bar = Progress::new(1.0);
        let compared = model.compare(&wanted, &mut |part, form| {
            bar.part(part, form);
            true
        });
        bar.finish();
        let report = compared?;
        for path in &arguments.plot {
            write_picture(&report.plot(), path)?;
        }
        match arguments.model.model.json {
            true => screen::print_json(&json!(report)),
            false => {
                let page = Page::of(&arguments.page);
                screen::print(&page.lines(&text(&report, page)))
            }
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

fn text(report: &CompareReport, page: Page) -> String {
    let short = screen::short;
    let header = [
        "form",
        "unknowns",
        "index",
        "operations",
        "solver",
        "steps",
        "time for 1 s",
        "ratio",
        "disagreement",
        "energy",
    ];
    let rows = report.rows.iter().filter(|row| row.differential.is_some()).map(cells);
    let mut text = format!("{} to {} s, times at an error of {:.0e}\n", report.model, short(report.to), report.error);
    text += &page.table(header, rows);
    for row in &report.rows {
        if let Some(reason) = &row.reason {
            text += &format!("{}: {reason}\n", row.form);
        }
        if let Some(order) = row.order {
            text += &format!("{}: converges with order {order:.2} in its stiffness\n", row.form);
        }
    }
    let reference = &report.reference;
    let (by, to) = (reference.confirmed_by, reference.confirmed_to);
    text += &format!("reference: minimal at rtol 1e-12, confirmed by {by} to {to:.0e}\n");
    report.notes.iter().for_each(|note| text += &format!("{note}\n"));
    text
}

fn cells(row: &Row) -> [String; 10] {
    let number = |n: Option<usize>| n.map_or("-".to_string(), |n| n.to_string());
    let small = |x: Option<f64>| x.map_or("-".to_string(), |x| format!("{x:.0e}"));
    [
        row.form.to_string(),
        format!("{} + {}", number(row.differential), number(row.algebraic)),
        row.index.map_or("-".to_string(), |index| index.to_string()),
        number(row.flops),
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
