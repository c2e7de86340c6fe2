//! The header: what there is, with units, and what a step costs.

use std::fmt::Write;

use halfarrow_compiler::unit::Unit;

use super::cost::{Cost, most_jumps};
use super::flags::Flags;
use super::plan::Plan;
use super::template::{Filling, Words};
use super::written::Written;
use super::{Names, members, messages};

/// The header file of a model of these modes.
pub(super) fn header(plans: &[Plan], names: &Names, cost: &Cost) -> String {
    let plan = &plans[0];
    let (export, p) = (plan.export, plan.program);
    let capitals = plan.name.to_ascii_uppercase();
    let lines = cost.lines().into_iter().map(|line| format!(" *     {line}\n")).collect::<String>();
    let indicators = plans.iter().map(|plan| plan.sizes.indicators).max().unwrap_or(0);
    let mut codes = String::new();
    let mut all: Vec<(&str, &str)> = Vec::new();
    for code in plans.iter().flat_map(messages::codes) {
        if !all.contains(&code) {
            all.push(code);
        }
    }
    for (i, (code, meaning)) in all.iter().enumerate() {
        let _ = writeln!(codes, "    /* {meaning} */\n    {capitals}_{code} = {},", i + 1);
    }
    let codes = codes.trim_end().trim_end_matches(',').to_string();
    let states = p.states.iter().map(|s| match plans.len() {
        1 => (s.name.clone(), s.unit.as_ref()),
        _ => ("of the present mode".to_string(), None),
    });
    let inputs = p.inputs.iter().map(|s| (s.name.clone(), s.unit.as_ref()));
    let parameters = p.parameters.iter().zip(&export.start.parameters).map(|(s, value)| {
        let kind = if s.constant { ", constant" } else { "" };
        (format!("{}, {value:?} if not set{kind}", s.name), s.unit.as_ref())
    });
    let outputs = export.recorded.iter().map(|&i| (p.observed[i].name.to_string(), p.observed[i].unit.as_ref()));
    let words: Vec<(&str, String)> = vec![
        ("COST_LINES", lines.trim_end().to_string()),
        ("MODEL_NAME", comment(&p.name)),
        ("METHOD_NAME", export.method.name().replace('_', " ")),
        ("STEP_LENGTH", format!("{:?}", export.step)),
        ("NUMBER_STATES", p.states.len().to_string()),
        ("NUMBER_INPUTS", p.inputs.len().to_string()),
        ("NUMBER_PARAMETERS", p.parameters.len().to_string()),
        ("NUMBER_OUTPUTS", export.recorded.len().to_string()),
        ("NUMBER_INDICATORS", indicators.to_string()),
        ("NUMBER_JUMPS", most_jumps(plan).to_string()),
        ("STATE_LINES", enumerators((&capitals, "X"), &names.states, states)),
        ("INPUT_LINES", enumerators((&capitals, "U"), &names.inputs, inputs)),
        ("PARAMETER_LINES", enumerators((&capitals, "P"), &names.parameters, parameters)),
        ("OUTPUT_LINES", enumerators((&capitals, "Y"), &names.outputs, outputs)),
        ("CODES", codes),
        ("PUBLIC_PARTS", members::lines(&members::public(plans), plan)),
        ("PRIVATE_PARTS", members::lines(&members::private(plans), plan)),
    ];
    let words: Words = words.into_iter().map(|(word, text)| (word, Written::of(text))).collect();
    let flags = plans.iter().map(Plan::flags).fold(Flags::default(), Flags::or);
    let filling = Filling { flags, words, model: &plan.name, real: export.real };
    filling.text(include_str!("runtime/header.h"))
}

fn enumerators<'a>(
    (capitals, letter): (&str, &str),
    names: &[String],
    about: impl Iterator<Item = (String, Option<&'a Unit>)>,
) -> String {
    let lines = names.iter().zip(about).enumerate().map(|(i, (name, (about, unit)))| {
        let unit = match unit {
            None => String::new(),
            Some(unit) if unit.is_si() => format!(", in {unit}"),
            // All numbers here are SI numbers.
            Some(unit) => format!(", in {} (declared in {unit})", unit.to_si_unit()),
        };
        let comma = if i + 1 < names.len() { "," } else { "" };
        format!("    {capitals}_{letter}_{name} = {i}{comma} /* {} */", comment(&format!("{about}{unit}")))
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// A text within a comment.
pub(super) fn comment(text: &str) -> String {
    text.replace("*/", "* /").replace("/*", "/ *").replace(['\n', '\r'], " ")
}
