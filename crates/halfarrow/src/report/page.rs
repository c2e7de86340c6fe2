//! The page.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::curves::{LIBRARY, LIBRARY_STYLE, SCRIPT, data};
use super::{Content, FormPart, FormText, PathRow};
use crate::audited::Deviation;
use crate::compare::{CompareReport, Row};
use crate::run::Simulated;
use halfarrow_compiler::equations::Form;

const STYLE: &str = include_str!("page.css");

/// Nothing in it points outside: style, pictures, formulas and the program that zooms curves stand in the text.
pub(super) fn page(content: &Content) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (content.title) }
                style { (PreEscaped(STYLE)) (PreEscaped(LIBRARY_STYLE)) }
            }
            body {
                (head(content))
                main {
                    (drawing(content))
                    (causality(content))
                    (paths(content))
                    (equations(content))
                    (comparison(content))
                    (run(content))
                    (audit(content))
                }
                (scripts(content))
                footer { "Written by halfarrow " (env!("CARGO_PKG_VERSION")) "." }
            }
        }
    };
    page.into_string()
}

fn head(content: &Content) -> Markup {
    let parts = [
        ("graph", "Bond graph"),
        ("causality", "Causality"),
        ("paths", "Causal paths"),
        ("equations", "Equations"),
        ("comparison", "Comparison"),
        ("run", "Motion"),
        ("audit", "Audit"),
    ];
    html! {
        header {
            h1 { (content.title) }
            p.soft { "Model " code { (content.name) } }
            nav {
                @for (id, name) in parts {
                    @if id != "comparison" || content.comparison.is_some() { a href={ "#" (id) } { (name) } }
                }
            }
            dl.facts {
                @for (name, value) in &content.facts { div { dt { (name) } dd { (value) } } }
            }
            @if !content.warnings.is_empty() {
                ul.plain { @for warning in &content.warnings { li { "Warning: " (warning) } } }
            }
        }
    }
}

/// A picture as part of the page; its name space goes without saying there.
fn figure(svg: &str, class: &str) -> Markup {
    let inline = svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1);
    html! { figure class=(class) { (PreEscaped(inline)) } }
}

fn math(inner: &str) -> Markup {
    html! { math displaystyle="true" { mrow { (PreEscaped(inner)) } } }
}

fn drawing(content: &Content) -> Markup {
    html! {
        section id="graph" {
            h2 { "Bond graph" }
            (figure(&content.drawing, "drawing"))
            p.soft { "Half arrows show where power counts as positive, strokes the end that an effort runs towards. Bonds are "
                "numbered as they are written in the model; coloured bonds lie on zero-order causal paths." }
        }
    }
}

fn causality(content: &Content) -> Markup {
    html! {
        section id="causality" {
            h2 { "Causality, and what decided it" }
            div.wide { table {
                thead { tr { th { "element" } th { "kind" } th { "law" } th { "causality" } th { "why" } } }
                tbody { @for d in &content.decided { tr {
                    td.name { (d.name) } td { (d.kind) } td { code { (d.law) } } td { (d.causality) } td { (d.why) }
                } } }
            } }
            @if !content.dependent.is_empty() {
                h3 { "Dependent storages" }
                ul.math { @for line in &content.dependent { li { (math(line)) } } }
            }
            @if !content.conserved.is_empty() {
                h3 { "Conserved quantities" }
                ul.plain { @for line in &content.conserved { li { code { (line) } } } }
            }
        }
    }
}

fn paths(content: &Content) -> Markup {
    html! {
        section id="paths" {
            h2 { "Zero-order causal paths" }
            @if content.paths.is_empty() {
                p { "There are none: every variable follows from states and sources in order." }
            } @else {
                div.wide { table {
                    thead { tr {
                        th { "class" } th { "between" } th { "gain" } th.number { "value" } th { "break variables" }
                        th { "fate in the minimal form" }
                    } }
                    tbody { @for path in &content.paths { (path_row(path)) } }
                } }
                @if !content.paths_complete {
                    p.soft { "There are more paths: shown is one for every break variable and every dependent storage." }
                }
                p.soft { "Class 1 runs between two storages, 2 between two resistors, 3 from a resistor around an open loop "
                    "back to itself, 4 inside the junction structure." }
            }
        }
    }
}

/// A path, and below it its way, over the whole width.
fn path_row(path: &PathRow) -> Markup {
    html! {
        tr.path {
            td { (path.class) } td.name { (path.between) } td { (math(&path.gain)) }
            td.number { @match path.value { Some(value) => (number(value)), None => "–" } }
            td { code { (path.breaks) } } td { (path.fate) }
        }
        tr.route { td {} td colspan="5" { (path.route) span.bonds { "bonds " (path.bonds) } } }
    }
}

fn equations(content: &Content) -> Markup {
    html! {
        section id="equations" {
            h2 { "Equations" }
            @for form in &content.forms { (form_part(form)) }
        }
    }
}

fn form_part(part: &FormPart) -> Markup {
    let names: Vec<&str> = part.forms.iter().map(|form| described(*form)).collect();
    html! {
        div.form {
            @match &part.content {
                Err(reason) => { (headings(&names, "")) p.soft { "Does not apply: " (reason) } }
                Ok(text) => { (headings(&names, &text.counts)) (form_text(text)) (remarked(part)) }
            }
        }
    }
}

/// How the equations came about; where several forms have them, with the name of the form.
fn remarked(part: &FormPart) -> Markup {
    let of = |form: Form| if part.forms.len() > 1 { format!("{}: ", form.name()) } else { String::new() };
    html! {
        @if part.remarks.iter().any(|r| !r.1.is_empty()) {
            ul.plain { @for (form, lines) in &part.remarks { @for line in lines { li { (of(*form)) (line) } } } }
        }
    }
}

/// The names of forms whose equations are the same, and their size.
fn headings(names: &[&str], counts: &str) -> Markup {
    html! {
        @for (i, name) in names.iter().enumerate() {
            h3 class=[(i > 0).then_some("same")] { (name) @if i + 1 == names.len() && !counts.is_empty() { span.count { (counts) } } }
        }
    }
}

fn described(form: Form) -> &'static str {
    match form {
        Form::Minimal => "Minimal form: independent variables, nothing else",
        Form::Kane => "Kane’s form: an equation for each independent speed",
        Form::Inverted => "Inverted form: storages on zero-order paths in derivative causality",
        Form::Break => "Classical form: break variables and multipliers",
        Form::Relaxed => "Classical form with relaxed causality: resistors first",
        Form::Lagrange => "Lagrange’s form: a multiplier for every constraint",
        Form::Stiff => "Stiff form: a spring with a damper for every constraint",
    }
}

fn form_text(text: &FormText) -> Markup {
    html! {
        div.wide { table.equations { tbody {
            @for (left, right) in &text.equations {
                tr { td { (math(left)) } td { math { mo { "=" } } } td { (math(right)) } }
            }
        } } }
        @if text.left_out > 0 { p.soft { "and " (text.left_out) " more equations" } }
        @if !text.meanings.is_empty() {
            p.soft { "where" }
            ul.math { @for line in &text.meanings { li { (math(line)) } } }
            @if text.meanings_left_out > 0 { p.soft { "and " (text.meanings_left_out) " more names" } }
        }
        @let cut = |math: &String| math.contains('…');
        @if text.left_out + text.meanings_left_out > 0 || text.meanings.iter().chain(text.equations.iter().map(|e| &e.1)).any(cut) {
            p.soft { "All of it: " code { "halfarrow equations MODEL --out FILE" } "." }
        }
        @let unknowns: Vec<&(String, &str)> = text.unknowns.iter().filter(|u| u.1 != "storage").collect();
        @if !unknowns.is_empty() {
            p.soft { @for (i, (symbol, cause)) in unknowns.into_iter().enumerate() {
                @if i > 0 { ", " }
                math { (PreEscaped(symbol)) } " " (cause)
            } }
        }
    }
}

fn comparison(content: &Content) -> Markup {
    let (report, svg) = match &content.comparison {
        None => return html! {},
        Some(Err(reason)) => {
            return html! { section id="comparison" { h2 { "Comparison of the forms" } p { "There is none: " (reason) "." } } };
        }
        Some(Ok(compared)) => compared,
    };
    html! {
        section id="comparison" {
            h2 { "Comparison of the forms" }
            p { "Runs to " (number(report.to)) " s; times are processor time for a simulated second at an error of the motion of "
                (number(report.error)) ", with the method that serves each form best." }
            div.wide { table {
                thead { tr {
                    th { "form" } th.number { "differential" } th.number { "algebraic" } th.number { "index" }
                    th.number { "operations" } th { "method" } th.number { "steps" } th.number { "time" } th.number { "ratio" }
                    th.number { "disagreement" } th.number { "energy" }
                } }
                tbody { @for row in &report.rows { (compared(row)) } }
            } }
            (remarks(report))
            (figure(svg, "plot"))
        }
    }
}

fn compared(row: &Row) -> Markup {
    let count = |n: Option<usize>| n.map_or("–".to_string(), |n| n.to_string());
    let energy = match (row.energy_error, row.energy_resolution) {
        (Some(miss), Some(resolution)) if miss < resolution => format!("< {}", number(round(resolution))),
        (Some(miss), _) => number(round(miss)),
        _ => "–".to_string(),
    };
    html! { tr {
        td.name { (row.form) } td.number { (count(row.differential)) } td.number { (count(row.algebraic)) }
        td.number { (row.index.map_or("–".to_string(), |i| i.to_string())) } td.number { (count(row.flops)) }
        td { (row.solver.unwrap_or("–")) } td.number { (count(row.steps)) }
        td.number { (row.time_text().unwrap_or("–".to_string())) }
        td.number { (row.times_minimal.map_or("–".to_string(), |r| format!("{r:.1}"))) }
        td.number { (row.max_error.map_or("–".to_string(), |e| number(round(e)))) } td.number { (energy) }
    } }
}

fn remarks(report: &CompareReport) -> Markup {
    html! {
        ul.plain {
            @for row in &report.rows {
                @if let Some(reason) = &row.reason { li { (row.form) ": " (reason) } }
                @if let Some(order) = row.order {
                    li { (row.form) ": converges with order " (format!("{order:.2}")) " in its stiffness" }
                }
            }
            @if let Some(reference) = &report.reference {
                li { "Errors are measured against the minimal form at a relative tolerance of 10" sup { "−12" }
                    @if !reference.confirmed_to.is_nan() {
                        ", which " (reference.confirmed_by) " confirms to " (number(round(reference.confirmed_to)))
                    }
                    "." }
            }
            @for note in &report.notes { li { (note) } }
        }
    }
}

fn run(content: &Content) -> Markup {
    html! {
        section id="run" {
            h2 { "Motion" }
            @match &content.run {
                Ok((done, svg)) => {
                    div id="curves" {}
                    (figure(svg, "plot still"))
                    p.soft { "Minimal form to " (number(content.to)) " s: " (done.report.steps) " steps, "
                        (done.report.evaluations) " evaluations." }
                    @if !done.report.notes.is_empty() {
                        ul.plain { @for note in &done.report.notes { li { (note) } } }
                    }
                }
                Err(reason) => p { "The run stopped: " (reason) }
            }
        }
    }
}

/// The curves of the run as data, and what draws them so that they can be zoomed and read off.
fn scripts(content: &Content) -> Markup {
    let Ok((done, _)) = &content.run else { return html! {} };
    html! {
        script { (PreEscaped(LIBRARY.trim_start_matches(|c| c != '\n'))) }
        script { "const runs = " (PreEscaped(data(&done.trace))) ";\n" (PreEscaped(SCRIPT)) }
    }
}

fn audit(content: &Content) -> Markup {
    let Ok((done, _)) = &content.run else { return html! {} };
    html! {
        section id="audit" {
            h2 { "Audit" }
            p { "Computed from the recorded values and the bond graph alone, by code that shares nothing with the equations." }
            (misses(done))
            @for list in [&done.report.audit.warnings, &done.report.audit.notes, &done.report.audit.unchecked] {
                @if !list.is_empty() { ul.plain { @for line in list { li { (line) } } } }
            }
        }
    }
}

fn misses(done: &Simulated) -> Markup {
    let audit = &done.report.audit;
    let kinds: [(&str, &Option<Deviation>); 4] = [
        ("power of the junction structure", &audit.power),
        ("energy: stored less supplied and dissipated", &audit.energy),
        ("laws of junctions and elements", &audit.residual),
        ("stored quantities against their rates", &audit.rates),
    ];
    html! {
        div.wide { table {
            thead { tr { th { "what is checked" } th.number { "greatest miss" } th.number { "at t in s" } th { "where" } } }
            tbody { @for (kind, miss) in kinds { tr {
                td { (kind) }
                @match miss {
                    Some(m) => {
                        td.number { @if m.value < m.resolution { "< " (number(round(m.resolution))) } @else { (number(round(m.value))) } }
                        td.number { (number(m.time)) } td { (m.place) }
                    }
                    None => { td.number { "–" } td.number { "–" } td { "could not be checked" } }
                }
            } } }
        } }
        p.soft { "Relative to the greatest magnitude of its kind; a miss below what the samples resolve is shown by that bound." }
    }
}

/// A number with few digits, as people write it.
fn number(x: f64) -> String {
    let size = x.abs();
    let text = match size {
        0.0 => "0".to_string(),
        s if (1e-3..1e5).contains(&s) => {
            let digits = (3 - libm::log10(s).floor() as i32).clamp(0, 6) as usize;
            let text = format!("{x:.digits$}");
            if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
        }
        _ => {
            let text = format!("{x:.3e}");
            let (mantissa, power) = text.split_once('e').unwrap_or((&text, "0"));
            let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
            let raised: String = power.chars().map(raised).collect();
            if mantissa == "1" { format!("10{raised}") } else { format!("{mantissa}·10{raised}") }
        }
    };
    text.replace('-', "−")
}

/// One digit of a number: more of an error says nothing.
fn round(x: f64) -> f64 {
    format!("{x:.0e}").parse().unwrap_or(x)
}

fn raised(c: char) -> char {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize])
}
