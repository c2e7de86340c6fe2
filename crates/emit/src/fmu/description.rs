//! `modelDescription.xml` and `buildDescription.xml`.

use std::fmt::Write;

use halfarrow_compiler::program::{Block, Value};

use super::Version;
use super::dependence::{Knowns, at_start, knowns_of, starts};
use super::units::Units;
use super::variables::{Role, Variable, Variables};
use crate::c::Export;

/// The description of a model. `token` tells it from others.
pub(super) fn description(export: &Export, variables: &Variables, version: Version, name: &str, token: &str) -> String {
    let p = export.program;
    let mut units = Units::default();
    let shown: Vec<&Variable> =
        variables.all.iter().filter(|v| version == Version::V3 || v.role != Role::Indicator).collect();
    let names: Vec<(Option<String>, Option<String>)> = shown
        .iter()
        .map(|v| v.unit.as_ref().map(|u| units.note(u)).map_or((None, None), |(unit, display)| (Some(unit), display)))
        .collect();
    let convention = if shown.iter().all(|v| is_structured(&v.name)) { "structured" } else { "flat" };
    let indicators: usize = variables.all.iter().filter(|v| v.role == Role::Indicator).count();
    let (fmi, identity) = match version {
        Version::V2 => ("2.0", "guid"),
        Version::V3 => ("3.0", "instantiationToken"),
    };
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"{fmi}\" modelName=\"{}\" {identity}=\"{token}\" \
         generationTool=\"halfarrow {}\" variableNamingConvention=\"{convention}\"",
        escaped(&p.name),
        env!("CARGO_PKG_VERSION")
    );
    if version == Version::V2 {
        let _ = write!(text, " numberOfEventIndicators=\"{indicators}\"");
    }
    text += ">\n";
    text += &interfaces(export, version, name);
    let lines = units.lines();
    if !lines.is_empty() {
        text += "  <UnitDefinitions>\n";
        lines.iter().for_each(|line| text += &format!("    {line}\n"));
        text += "  </UnitDefinitions>\n";
    }
    text += "  <LogCategories>\n    <Category name=\"logStatusError\" description=\"What fails, with the elements concerned\"/>\n    <Category name=\"logStatusDiscard\" description=\"Points tried by the integrator at which the model has no value\"/>\n    <Category name=\"logStatusWarning\" description=\"What the run goes on with, but is not certain of\"/>\n  </LogCategories>\n";
    let _ = writeln!(text, "  <DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"{:?}\"/>", export.step);
    text += "  <ModelVariables>\n";
    let nominals = variables.nominals(export);
    for (v, names) in shown.iter().zip(&names) {
        text += &variable(v, names, version, &nominals, p.states.len());
    }
    text += "  </ModelVariables>\n";
    text += &structure(export, variables, version);
    text + "</fmiModelDescription>\n"
}

fn interfaces(export: &Export, version: Version, name: &str) -> String {
    let p = export.program;
    // Solutions and delays go on from step to step.
    let follows =
        p.blocks.values().any(|b| matches!(b, Block::Newton { .. })) || p.held.iter().any(|h| !h.kind.is_discrete());
    // Modes may be over where no indicator tells it, and margins are compared with what they have been.
    let follows = follows || export.has_modes();
    match version {
        Version::V2 => {
            let common =
                "canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\" providesDirectionalDerivative=\"true\"";
            let sources = format!(
                "    <SourceFiles>\n      <File name=\"{name}.c\"/>\n      <File name=\"fmi2.c\"/>\n    </SourceFiles>\n"
            );
            format!(
                "  <ModelExchange modelIdentifier=\"{name}\" completedIntegratorStepNotNeeded=\"{}\" {common}>\n{sources}  </ModelExchange>\n\
                 \x20 <CoSimulation modelIdentifier=\"{name}\" canHandleVariableCommunicationStepSize=\"true\" {common}>\n{sources}  </CoSimulation>\n",
                !follows
            )
        }
        Version::V3 => {
            let common = "canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\" \
                          providesDirectionalDerivatives=\"true\" providesAdjointDerivatives=\"true\"";
            format!(
                "  <ModelExchange modelIdentifier=\"{name}\" needsCompletedIntegratorStep=\"{follows}\" {common}/>\n\
                 \x20 <CoSimulation modelIdentifier=\"{name}\" canHandleVariableCommunicationStepSize=\"true\" \
                 fixedInternalStepSize=\"{:?}\" hasEventMode=\"true\" mightReturnEarlyFromDoStep=\"true\" {common}/>\n",
                export.step
            )
        }
    }
}

fn variable(
    v: &Variable,
    (unit, display): &(Option<String>, Option<String>),
    version: Version,
    nominals: &[f64],
    states: usize,
) -> String {
    let (causality, variability, initial) = match v.role {
        Role::Time => ("independent", "continuous", None),
        Role::State | Role::Derivative(_) | Role::Indicator => ("local", "continuous", Some("calculated")),
        Role::Input => ("input", "continuous", None),
        Role::Parameter(true) => ("parameter", "tunable", Some("exact")),
        Role::Parameter(false) => ("parameter", "fixed", Some("exact")),
        Role::Calculated(true) => ("calculatedParameter", "tunable", Some("calculated")),
        Role::Calculated(false) => ("calculatedParameter", "fixed", Some("calculated")),
        Role::Output(false) => ("output", "continuous", Some("calculated")),
        Role::Output(true) => ("output", "discrete", Some("calculated")),
    };
    let attribute =
        |name: &str, value: Option<String>| value.map_or(String::new(), |v| format!(" {name}=\"{}\"", escaped(&v)));
    let derivative = match v.role {
        // By place in FMI 2, by value reference in FMI 3; states stand right behind time in both.
        Role::Derivative(state) => Some(if version == Version::V2 { state + 2 } else { state + 1 }),
        _ => None,
    };
    let nominal = match v.role {
        Role::State if v.reference <= states => nominals.get(v.reference - 1).filter(|n| **n != 1.0),
        _ => None,
    };
    let real = attribute("unit", unit.clone())
        + &attribute("displayUnit", display.clone())
        + &attribute("start", v.start.map(|s| format!("{s:?}")))
        + &attribute("derivative", derivative.map(|d| d.to_string()))
        + &attribute("nominal", nominal.map(|n| format!("{n:?}")));
    let head = format!(
        "name=\"{}\" valueReference=\"{}\" causality=\"{causality}\" variability=\"{variability}\"{}",
        escaped(&v.name),
        v.reference,
        attribute("initial", initial.map(str::to_string))
    );
    match version {
        Version::V2 => format!("    <ScalarVariable {head}>\n      <Real{real}/>\n    </ScalarVariable>\n"),
        Version::V3 => format!("    <Float64 {head}{real}/>\n"),
    }
}

/// An unknown: its value reference, and what it depends on.
type Unknown = (usize, Vec<usize>);

fn structure(export: &Export, variables: &Variables, version: Version) -> String {
    let p = export.program;
    let unknown = |v: &Variable, knowns: &Knowns| (v.reference, variables.references(p, knowns));
    // Parameters do not change while time runs.
    let running = |v: &Variable, value: Value| {
        let mut knowns = knowns_of(p, &[value]);
        knowns.parameters.clear();
        unknown(v, &knowns)
    };
    let begin = starts(p);
    let (mut outputs, mut derivatives, mut initial, mut indicators): (
        Vec<Unknown>,
        Vec<Unknown>,
        Vec<Unknown>,
        Vec<Unknown>,
    ) = Default::default();
    let mut next = 0;
    let mut operands = super::variables::indicators(p).into_iter();
    for v in &variables.all {
        match v.role {
            Role::State => initial.push(unknown(v, &begin[v.reference - 1])),
            Role::Derivative(state) => {
                let rate = p.states[state].rate;
                derivatives.push(running(v, rate));
                initial.push(unknown(v, &at_start(p, &begin, &[rate])));
            }
            Role::Calculated(_) => {
                let parameter = v.reference - 1 - 2 * p.states.len() - p.inputs.len();
                initial.push(unknown(v, &knowns_of(p, &[p.parameters[parameter].default])));
            }
            Role::Output(_) => {
                if let Ok(value) = p.observed[export.recorded[next]].value.clone() {
                    outputs.push(running(v, value));
                    initial.push(unknown(v, &at_start(p, &begin, &[value])));
                }
                next += 1;
            }
            Role::Indicator => {
                indicators.push(operands.next().map_or((v.reference, Vec::new()), |value| running(v, value)));
            }
            Role::Time | Role::Input | Role::Parameter(_) => {}
        }
    }
    // In another mode of set-valued laws they may depend on anything.
    let dependencies = |on: String| match export.modes.is_empty() {
        true => format!(" dependencies=\"{on}\""),
        false => String::new(),
    };
    let mut text = "  <ModelStructure>\n".to_string();
    match version {
        Version::V2 => {
            for (element, unknowns) in
                [("Outputs", outputs), ("Derivatives", derivatives), ("InitialUnknowns", initial)]
            {
                if unknowns.is_empty() {
                    continue;
                }
                let _ = writeln!(text, "    <{element}>");
                for (reference, on) in unknowns {
                    let place = |r: usize| variables.place(r).map_or(0, |p| p + 1);
                    let _ = writeln!(
                        text,
                        "      <Unknown index=\"{}\"{}/>",
                        place(reference),
                        dependencies(list(&mut on.into_iter().map(place)))
                    );
                }
                let _ = writeln!(text, "    </{element}>");
            }
        }
        Version::V3 => {
            let all = [
                ("Output", outputs),
                ("ContinuousStateDerivative", derivatives),
                ("InitialUnknown", initial),
                ("EventIndicator", indicators),
            ];
            for (element, unknowns) in all {
                for (reference, on) in unknowns {
                    let on = dependencies(list(&mut on.into_iter()));
                    let _ = writeln!(text, "    <{element} valueReference=\"{reference}\"{on}/>");
                }
            }
        }
    }
    text + "  </ModelStructure>\n"
}

fn list(numbers: &mut dyn Iterator<Item = usize>) -> String {
    numbers.map(|n| n.to_string()).collect::<Vec<_>>().join(" ")
}

/// How the sources are built, for FMI 3.0.
pub(super) fn build(name: &str, sources: &[String]) -> String {
    let files: String = sources.iter().map(|s| format!("      <SourceFile name=\"{s}\"/>\n")).collect();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiBuildDescription fmiVersion=\"3.0\">\n  <BuildConfiguration modelIdentifier=\"{name}\">\n    \
         <SourceFileSet language=\"C99\">\n{files}    </SourceFileSet>\n  </BuildConfiguration>\n</fmiBuildDescription>\n"
    )
}

/// A text within quotes of XML.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// Whether a name follows the grammar of structured names: identifiers with dots between them, or one within `der()`.
fn is_structured(name: &str) -> bool {
    let inner = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')')).unwrap_or(name);
    inner.split('.').all(|part| {
        let (word, index) = part.split_once('[').map_or((part, None), |(word, index)| (word, Some(index)));
        let starts = word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        let digits = |s: &str| !s.is_empty() && s.chars().all(|c| c.is_ascii_digit());
        starts
            && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && index.is_none_or(|i| i.strip_suffix(']').is_some_and(|i| i.split(',').all(digits)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_follow_the_grammar() {
        for good in ["a", "a.b_1", "der(a.b)", "cell[3].q", "m[1,2]"] {
            assert!(is_structured(good), "{good}");
        }
        for bad in ["φ", "a.", "1a", "der(a", "a[x]", "a'"] {
            assert!(!is_structured(bad), "{bad}");
        }
        assert_eq!(escaped("a<\"b\">&"), "a&lt;&quot;b&quot;&gt;&amp;");
    }
}
