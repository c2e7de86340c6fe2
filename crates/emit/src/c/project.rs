//! A program that steps the model, and how to build it.

use halfarrow_compiler::program::Observed;
use halfarrow_compiler::unit::Unit;

use super::flags::Flags;
use super::template::{Filling, Words};
use super::written::Written;
use super::{Export, messages};
use crate::Real;

/// `main.c`.
pub(super) fn main(export: &Export, name: &str) -> String {
    let recorded: Vec<&Observed> = export.recorded.iter().map(|&i| &export.program.observed[i]).collect();
    let quoted = |text: &str| if text.contains(',') { format!("\"{text}\"") } else { text.to_string() };
    let field = |text: &str| format!(",{}", messages::escaped(&quoted(text))).replace('%', "%%");
    let names = printed(recorded.iter().map(|o| field(&o.name)), "    ");
    let unit = |o: &Observed| o.unit.as_ref().map(ToString::to_string).unwrap_or_default();
    let units = printed(recorded.iter().map(|o| field(&unit(o))), "        ");
    let print = |(i, o): (usize, &&Observed)| {
        let (digits, value) = match export.real {
            Real::Double => (17, format!("m->y[{i}]")),
            Real::Float => (9, format!("(double)m->y[{i}]")),
        };
        format!("    printf(\",%.{digits}g\", {});", declared(&value, o.unit.as_ref()))
    };
    let lines: Vec<String> = recorded.iter().enumerate().map(print).collect();
    let words = [("PRINT_OUTPUTS", lines.join("\n")), ("OUTPUT_NAMES", names), ("OUTPUT_UNITS", units)];
    let words = words.map(|(word, text)| (word, Written::of(text))).into();
    filling(name, words).text(include_str!("runtime/main.c"))
}

/// Fields in lines that print some of them each: compilers need not take strings of more than 4,095 characters.
fn printed(fields: impl Iterator<Item = String>, indent: &str) -> String {
    let mut lines = vec![String::new()];
    for field in fields {
        if lines[lines.len() - 1].len() + field.len() > 100 {
            lines.push(String::new());
        }
        *lines.last_mut().expect("there is one") += &field;
    }
    let print = |fields: String| format!("{indent}printf(\"{fields}\");");
    lines.into_iter().filter(|line| !line.is_empty()).map(print).collect::<Vec<_>>().join("\n")
}

/// With what templates are filled that compute nothing.
fn filling(model: &str, words: Words) -> Filling<'_> {
    Filling { flags: Flags::default(), words, model, real: Real::Double }
}

/// An output in the unit that the model declares for it, as C.
fn declared(si: &str, unit: Option<&Unit>) -> String {
    match unit.filter(|unit| !unit.is_si()) {
        None => si.to_string(),
        Some(unit) => {
            let offset = unit.to_si_f64(0.0);
            let factor = unit.to_si_f64(1.0) - offset;
            let shifted = if offset == 0.0 { si.to_string() } else { format!("({si} - {offset:?})") };
            format!("{shifted} / {factor:?} /* {} */", unit.to_string().replace("*/", "* /"))
        }
    }
}

/// `CMakeLists.txt`.
pub(super) fn cmake(name: &str) -> String {
    filling(name, Words::new()).text(include_str!("runtime/CMakeLists.txt"))
}
