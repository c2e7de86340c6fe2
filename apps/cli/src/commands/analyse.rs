//! `check`, `show`, `loops`, `equations`.

use std::time::Instant;

use halfarrow::{CheckReport, EquationsReport, Error, Form, LoopsReport, Model, Stage};
use serde_json::json;

use super::run::all_listed;
use super::{note_timings, overrides, source, with_model};
use crate::arguments::{self, Format, ModelArguments};
use crate::page::Page;
use crate::screen;

/// All diagnostics.
pub fn check(arguments: &ModelArguments) -> u8 {
    let begun = Instant::now();
    let source = source(&arguments.model).map_err(Error::from);
    let report = match source.and_then(|source| CheckReport::of(source, &overrides(arguments))) {
        Ok(report) => report,
        Err(error) => return screen::fail(&error, arguments.model.json),
    };
    if arguments.timings {
        note_timings(&report.timings, begun);
    }
    screen::warn(&report.found);
    let printed = if arguments.model.json {
        screen::print_json(&report.to_json())
    } else if report.errors == 0 {
        let odd = if report.warnings == 0 { "nothing to say".to_string() } else { counted(report.warnings, "warning") };
        screen::print(&format!("{}: {odd}\n", arguments.model.file.display()))
    } else {
        let errors = counted(report.errors, "error");
        let warnings = counted(report.warnings, "warning");
        screen::note(&format!("{}: {errors}, {warnings}", arguments.model.file.display()));
        Ok(())
    };
    screen::printed(printed, u8::from(report.errors > 0))
}

fn counted(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// A stage as text.
pub fn show(arguments: &arguments::Show) -> u8 {
    let stage = match arguments.stage {
        arguments::Stage::Ast => Stage::Ast,
        arguments::Stage::BondGraph => Stage::BondGraph,
        arguments::Stage::CausalGraph => Stage::CausalGraph,
        arguments::Stage::CausalPaths => Stage::CausalPaths,
        arguments::Stage::Equations => Stage::Equations,
        arguments::Stage::Program => Stage::Program,
    };
    let shown = source(&arguments.model.model).map_err(Error::from);
    let printed =
        match shown.and_then(|source| stage.show_in(source, &overrides(&arguments.model), &arguments.branches.mode)) {
            Ok(text) if arguments.model.model.json => screen::print_json(&json!({"stage": stage.name(), "text": text})),
            Ok(text) => screen::print(&text),
            Err(error) => return screen::fail(&error, arguments.model.model.json),
        };
    screen::printed(printed, 0)
}

/// Zero-order causal paths and their fate.
pub fn loops(arguments: &arguments::Loops) -> u8 {
    with_model(&arguments.model, |model| {
        let report = model.in_mode(&arguments.branches.mode)?.loops()?;
        match arguments.model.model.json {
            true => screen::print_json(&json!(report)),
            false => {
                let page = Page::of(&arguments.page);
                screen::print(&page.lines(&loops_text(&report, page)))
            }
        }?;
        Ok(0)
    })
}

fn loops_text(report: &LoopsReport, page: Page) -> String {
    let mut text = match report.paths.len() {
        0 => format!("{}: no zero-order causal path\n", report.model),
        n => format!("{}: {}\n", report.model, counted(n, "zero-order causal path")),
    };
    if !report.kept.is_empty() {
        let (are, each) = if report.kept.len() == 1 { ("is", "it") } else { ("are", "each") };
        text += &format!(
            "{} {are} independent, and no storage has {}: the drawing and the equations take {each} as a source at its \
             junction.\nThese are the paths with strokes given by hand, storages first:\n",
            report.kept.join(", "),
            if report.kept.len() == 1 { "it" } else { "them" },
        );
    }
    if !report.paths.is_empty() {
        let value = |v: Option<f64>| v.map_or("-".to_string(), screen::short);
        let rows = report.paths.iter().map(|p| {
            let between = p.elements.join(" - ");
            [
                p.class.to_string(),
                between,
                p.gain.clone(),
                value(p.gain_value),
                p.breaks.join(", "),
                p.resolution.clone(),
            ]
        });
        text += &page.table(["class", "between", "gain", "value", "break variables", "in minimal form"], rows);
    }
    if !report.complete {
        text += "There are more paths: shown is one for every break variable.\n";
    }
    for component in report.components.iter().filter(|c| c.singular) {
        let breaks = component.breaks.join(", ");
        let told =
            format!("The determinant of the paths through {breaks} vanishes: alone they have no unique solution.");
        text += &page.line(&told);
    }
    text + &storages_text(report, page) + &counts_text(report, page)
}

fn storages_text(report: &LoopsReport, page: Page) -> String {
    if report.storages.is_empty() {
        return String::new();
    }
    let rows = report.storages.iter().map(|s| {
        let independent = if s.independent { "independent" } else { "dependent" };
        [s.name.clone(), s.causality.to_string(), independent.to_string(), s.follows.clone().unwrap_or_default()]
    });
    let mut text = "\nStorages\n".to_string();
    text += &page.table(["name", "causality", "", "follows from"], rows);
    for c in &report.conserved {
        text += &page.line(&format!("Conserved: {} = {}", c.name, c.value));
    }
    text
}

fn counts_text(report: &LoopsReport, page: Page) -> String {
    let c = &report.counts;
    let forms = [("break variables", c.break_form), ("inverted", c.inverted), ("minimal", c.minimal)];
    let rows = forms.map(|(name, n)| [name.to_string(), n.differential.to_string(), n.algebraic.to_string()]);
    let mut text = "\nEquations in each form\n".to_string();
    text += &page.table(["form", "differential", "algebraic"], rows);
    text += &format!("Independent storages: {}\n", report.dof);
    match &report.state_matrix {
        Some(a) if a.regular => text + "State matrix: regular, all storages take derivative causality\n",
        Some(a) => {
            let stay = a.integral.join(", ");
            let (rank, order) = (a.rank, a.order);
            text + &page.line(&format!("State matrix: rank {rank} of {order}, {stay} cannot take derivative causality"))
        }
        None => text,
    }
}

/// The equations.
pub fn equations(arguments: &arguments::Equations) -> u8 {
    with_model(&arguments.model, |model: &Model| -> Result<u8, Error> {
        let report = model
            .in_mode(&arguments.branches.mode)?
            .equations_for(form(arguments.form), &all_listed(&arguments.only))?;
        match (arguments.model.model.json, arguments.format) {
            (true, _) | (_, Format::Json) => screen::print_json(&json!(report)),
            (_, Format::Text) => screen::print(&Page::of(&arguments.page).lines(&equations_text(&report))),
            (_, Format::Latex) => screen::print(&latex_text(&report)),
        }?;
        Ok(0)
    })
}

/// The formulation that is meant.
pub fn form(form: arguments::Form) -> Form {
    match form {
        arguments::Form::Minimal => Form::Minimal,
        arguments::Form::Kane => Form::Kane,
        arguments::Form::Inverted => Form::Inverted,
        arguments::Form::Break => Form::Break,
        arguments::Form::Relaxed => Form::Relaxed,
        arguments::Form::Lagrange => Form::Lagrange,
        arguments::Form::Stiff => Form::Stiff,
    }
}

fn equations_text(report: &EquationsReport) -> String {
    let mut text: String = report.text.iter().map(|line| format!("{line}\n")).collect();
    let indent = if text.is_empty() { "" } else { "    " };
    if !report.legend.is_empty() && !text.is_empty() {
        text += "\nwhere\n";
    }
    report.legend.iter().for_each(|line| text += &format!("{indent}{line}\n"));
    if !report.events_text.is_empty() && !text.is_empty() {
        text += "\n";
    }
    report.events_text.iter().for_each(|line| text += &format!("{line}\n"));
    if !report.certificate.is_empty() {
        text += "\n";
    }
    report.certificate.iter().for_each(|line| text += &format!("{line}\n"));
    if report.form != Form::Minimal {
        let (n, index) = (&report.counts, report.index);
        text += &format!("\n{} differential, {} algebraic, index {index}\n", n.differential, n.algebraic);
    }
    text
}

fn latex_text(report: &EquationsReport) -> String {
    let mut text = aligned("align", &report.latex);
    if !report.latex_legend.is_empty() {
        text += &format!("where\n{}", aligned("align*", &report.latex_legend));
    }
    if !report.events_latex.is_empty() {
        let lines: Vec<String> = report.events_latex.iter().map(|line| format!("  & {line}")).collect();
        text += &format!("\\begin{{align*}}\n{}\n\\end{{align*}}\n", lines.join(" \\\\\n"));
    }
    text
}

fn aligned(environment: &str, lines: &[String]) -> String {
    let lines: Vec<String> = lines.iter().map(|line| format!("  {}", line.replacen(" = ", " &= ", 1))).collect();
    format!("\\begin{{{environment}}}\n{}\n\\end{{{environment}}}\n", lines.join(" \\\\\n"))
}
