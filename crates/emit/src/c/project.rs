//! A program that steps the model, and how to build it.

use std::fmt::Write;

use halfarrow_compiler::program::Observed;
use halfarrow_compiler::unit::Unit;

use super::{Export, messages, template};
use crate::Real;

/// `main.c`.
pub(super) fn main(export: &Export, name: &str) -> String {
    let recorded: Vec<&Observed> = export.recorded.iter().map(|&i| &export.program.observed[i]).collect();
    let field = |text: &str| format!(",{}", messages::escaped(text)).replace('%', "%%");
    let names: String = recorded.iter().map(|o| field(&o.name)).collect();
    let unit = |o: &Observed| o.unit.as_ref().map(ToString::to_string).unwrap_or_default();
    let units: String = recorded.iter().map(|o| field(&unit(o))).collect();
    let mut lines = String::new();
    for (i, o) in recorded.iter().enumerate() {
        let (digits, value) = match export.real {
            Real::Double => (17, format!("m->y[{i}]")),
            Real::Float => (9, format!("(double)m->y[{i}]")),
        };
        let _ = writeln!(lines, "    printf(\",%.{digits}g\", {});", declared(&value, o.unit.as_ref()));
    }
    let text = include_str!("runtime/main.c")
        .replace("PRINT_OUTPUTS\n", &lines)
        .replace("OUTPUT_NAMES", &names)
        .replace("OUTPUT_UNITS", &units)
        .replace("NAME.h", &format!("{name}.h"));
    template::name(&text, name)
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
    template::name(include_str!("runtime/CMakeLists.txt"), name)
}
