//! Equations as a LaTeX document of their own.

use std::fmt::Write;

use halfarrow_compiler::textbook::{Shown, Style, print, print_events, print_meanings, print_symbol};

/// A document with the equations, what their names stand for, and the start values of the states.
///
/// `start`: one value a state, in SI units; without values, if it is shorter. It needs the packages amsmath and geometry.
pub fn document(shown: &Shown, start: &[f64]) -> String {
    let equations = &shown.equations;
    let mut text = format!(
        "\\documentclass{{article}}\n\\usepackage{{amsmath}}\n\\usepackage[margin=2cm]{{geometry}}\n\\allowdisplaybreaks\n\
         \\begin{{document}}\n\\section*{{{}}}\n",
        plain(&equations.graph.name)
    );
    if !equations.graph.doc.is_empty() {
        let _ = writeln!(text, "{}\n", plain(&equations.graph.doc));
    }
    text += &aligned(&print(shown, Style::Latex));
    let legend = print_meanings(shown, Style::Latex);
    if !legend.is_empty() {
        let _ = write!(text, "where\n{}", aligned(&legend));
    }
    let events = print_events(shown, Style::Latex);
    if !events.is_empty() {
        let lines: Vec<String> = events.iter().map(|line| format!("  & {line}")).collect();
        let _ = write!(text, "Events\n\\begin{{align*}}\n{}\n\\end{{align*}}\n", lines.join(" \\\\\n"));
    }
    if !start.is_empty() && start.len() == equations.states.len() {
        let lines: Vec<String> = equations
            .states
            .iter()
            .zip(start)
            .map(|(state, value)| {
                let unit =
                    state.unit.as_ref().map(|u| format!(" \\; \\mathrm{{{}}}", plain(&u.to_si_unit().to_string())));
                let symbol = print_symbol(shown, state.symbol, Style::Latex);
                format!("{symbol}(0) = {}{}", scientific(*value), unit.unwrap_or_default())
            })
            .collect();
        let _ = write!(text, "At the start\n{}", aligned(&lines));
    }
    text + "\\end{document}\n"
}

fn aligned(lines: &[String]) -> String {
    let lines: Vec<String> = lines.iter().map(|line| format!("  {}", line.replacen(" = ", " &= ", 1))).collect();
    format!("\\begin{{align*}}\n{}\n\\end{{align*}}\n", lines.join(" \\\\\n"))
}

fn scientific(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{mantissa} \\cdot 10^{{{exponent}}}"),
        None => text,
    }
}

/// Text without commands.
fn plain(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '\\' => out.push_str("\\textbackslash{}"),
            '{' | '}' | '_' | '&' | '%' | '#' | '$' => {
                out.push('\\');
                out.push(c);
            }
            '^' => out.push_str("\\textasciicircum{}"),
            '~' => out.push_str("\\textasciitilde{}"),
            c => out.push(c),
        }
    }
    out
}
