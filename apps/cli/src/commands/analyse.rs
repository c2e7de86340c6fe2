//! `check`, `show`, `loops`, `equations`.

use std::time::Instant;

use halfarrow::{
    BriefEquations, CheckReport, Count, EquationsReport, EquationsSize, Error, Form, Length, LoopsReport, Model,
    Problem, Stage, StorageReport, write_whole,
};
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

/// Lines of a cell below its row, at most.
const LINES: usize = 4;

/// Zero-order causal paths and their fate.
pub fn loops(arguments: &arguments::Loops) -> u8 {
    with_model(&arguments.model, |model| {
        let model = model.in_mode(&arguments.branches.mode)?;
        match arguments.model.model.json {
            true => screen::print_json(&json!(model.loops()?)),
            false => {
                let page = Page::of(&arguments.page);
                let mut text = page.lines(&loops_text(&model.loops_in_brief(page.room(LINES))?, page));
                if text.contains('…') {
                    text += &page.line("What ends with … is longer: `--json` has all of it.");
                }
                screen::print(&text)
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
        let header = ["class", "between", "gain", "value", "break variables", "in minimal form"];
        text += &page.brief_table(header, rows, LINES);
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
    let mut rows = Vec::new();
    let mut rest = &report.storages[..];
    while let Some(first) = rest.first() {
        let (name, together) = match alike(rest) {
            Some((element, strands)) => (format!("{element}[{strands}]"), strands),
            None => (first.name.clone(), 1),
        };
        let (these, others) = rest.split_at(together);
        rest = others;
        let independent = if first.independent { "independent" } else { "dependent" };
        let follows = match these {
            [one] => one.follows.clone().unwrap_or_default(),
            strands => {
                let mut from: Vec<&str> = Vec::new();
                for name in strands.iter().flat_map(|s| &s.from) {
                    if !from.contains(&name.as_str()) {
                        from.push(name);
                    }
                }
                from.join(", ")
            }
        };
        rows.push([name, first.causality.to_string(), independent.to_string(), follows]);
    }
    let mut text = "\nStorages\n".to_string();
    text += &page.brief_table(["name", "causality", "", "follows from"], rows, LINES);
    for c in &report.conserved {
        text += &page.brief_line(&format!("Conserved: {} = {}", c.name, c.value), LINES);
    }
    text
}

/// The multibond and the number of its strands, if the next storages are all of these and stand alike.
fn alike(storages: &[StorageReport]) -> Option<(&str, usize)> {
    let first = storages.first()?;
    let (element, strands) = first.strand_of.as_ref()?;
    let of_it = storages.get(..*strands)?;
    let same = |s: &StorageReport| {
        (&s.strand_of, s.causality, s.independent) == (&first.strand_of, first.causality, first.independent)
    };
    of_it.iter().all(same).then_some((element, *strands))
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

/// Lines of equations as text up to which all of them are printed.
const ALL: usize = 2000;
/// Of longer ones: lines of each, at most.
const EACH: usize = 3;
/// Of longer ones: equations, and names of parts that fit a line, at most.
const MOST: usize = 300;

/// The equations.
pub fn equations(arguments: &arguments::Equations) -> u8 {
    with_model(&arguments.model, |model: &Model| -> Result<u8, Error> {
        let model = model.in_mode(&arguments.branches.mode)?;
        let (form, only, page) = (form(arguments.form), all_listed(&arguments.only), Page::of(&arguments.page));
        let as_text = !arguments.model.model.json && arguments.format == Format::Text;
        if as_text && only.is_empty() && !arguments.all && arguments.out.is_none() {
            let length = Length { width: page.columns(), lines: ALL, each: EACH, most: MOST };
            screen::print(&brief_text(&model.equations_in_brief(form, length)?, page))?;
            return Ok(0);
        }
        let report = model.equations_for(form, &only)?;
        let text = match arguments.format {
            _ if arguments.model.model.json && arguments.out.is_none() => format!("{:#}\n", json!(report)),
            Format::Json => format!("{:#}\n", json!(report)),
            Format::Text => page.lines(&equations_text(&report)),
            Format::Latex => latex_text(&report),
        };
        let Some(path) = &arguments.out else {
            screen::print(&text)?;
            return Ok(0);
        };
        write_whole(path, |out| out.write_all(text.as_bytes()))
            .map_err(|why| Problem::Unwritable { path: path.clone(), why: why.source.to_string() })?;
        match arguments.model.model.json {
            true => screen::print_json(&json!({"written": [path]})),
            false => screen::print(&format!("{} is written\n", path.display())),
        }?;
        Ok(0)
    })
}

/// Equations up to a length, and what is to be known of the rest.
fn brief_text(brief: &BriefEquations, page: Page) -> String {
    let indent = if brief.text.is_empty() { "" } else { "    " };
    let mut text = String::new();
    if let Some(size) = &brief.size {
        text += &size_text(size, brief, page);
    }
    let line = |line: &str| match brief.size {
        Some(_) => page.brief_line(line, EACH),
        None => page.line(line),
    };
    brief.text.iter().for_each(|l| text += &line(l));
    if !brief.legend.is_empty() && !brief.text.is_empty() {
        text += "\nwhere\n";
    }
    brief.legend.iter().for_each(|l| text += &line(&format!("{indent}{l}")));
    if !brief.events.is_empty() && !brief.text.is_empty() {
        text += "\n";
    }
    brief.events.iter().for_each(|l| text += &line(l));
    text + &page.lines(&ending(&brief.certificate, brief.form, &brief.counts, brief.index))
}

/// How large equations are of which not all are told, and how to get them.
fn size_text(size: &EquationsSize, brief: &BriefEquations, page: Page) -> String {
    let blocks = |unknowns: &[usize]| {
        let count = counted(unknowns.len(), "block");
        match unknowns {
            [] => count,
            [one] => format!("{count} of {}", counted(*one, "unknown")),
            _ => {
                let (least, most) = (unknowns.iter().min().unwrap_or(&0), unknowns.iter().max().unwrap_or(&0));
                let each =
                    if least == most { format!("{most} unknowns each") } else { format!("{least} to {most} unknowns") };
                format!("{count} of {each}, {} in all", unknowns.iter().sum::<usize>())
            }
        }
    };
    let rows = [
        ("states", size.states.to_string()),
        ("equations", size.equations.to_string()),
        ("names for parts of them", size.names.to_string()),
        ("linear equations solved together", blocks(&size.linear)),
        ("equations solved by iteration", blocks(&size.iterated)),
        ("operations of one evaluation", size.operations.map_or("-".to_string(), |n| n.to_string())),
    ];
    let mut text = page.table(["of the equations", ""], rows.map(|(name, value)| [name.to_string(), value]));
    let left = size.equations.saturating_sub(brief.text.len());
    let more = if left == 0 { String::new() } else { format!(", without {} at the end", counted(left, "equation")) };
    text += &page.line(&format!(
        "Text of more than {ALL} lines is too long to be read. Below each equation has {EACH} lines at most{more}, and of the \
         names {} are explained that fit a line. `--only NAME,...` tells the equations of some variables, `--all` prints \
         everything, and `--out FILE` writes it.",
        brief.legend.len()
    ));
    text + "\n"
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
    text + &ending(&report.certificate, report.form, &report.counts, report.index)
}

fn ending(certificate: &[String], form: Form, n: &Count, index: u8) -> String {
    let mut text = String::new();
    if !certificate.is_empty() {
        text += "\n";
    }
    certificate.iter().for_each(|line| text += &format!("{line}\n"));
    if form != Form::Minimal {
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
