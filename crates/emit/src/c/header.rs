//! The header: what there is, with units, and what a step costs.

use std::fmt::Write;

use halfarrow_compiler::unit::Unit;

use super::cost::{Cost, MOST_JUMPS};
use super::plan::Plan;
use super::{Export, Names, messages, real, template};
use crate::Real;

/// The header file.
pub(super) fn header(export: &Export, plan: &Plan, names: &Names, cost: &Cost) -> String {
    let p = export.program;
    let mut text = String::from(include_str!("runtime/header.h"));
    let lines = cost.lines().into_iter().map(|line| format!(" *     {line}\n")).collect::<String>();
    let n = |count: usize| count.max(1).to_string();
    let s = &plan.sizes;
    let mut codes = String::new();
    for (i, (code, meaning)) in messages::codes(plan).iter().enumerate() {
        let _ = writeln!(codes, "    /* {meaning} */\n    MODEL_{code} = {},", i + 1);
    }
    let codes = codes.trim_end().trim_end_matches(',').to_string();
    let states = p.states.iter().map(|s| (s.name.clone(), s.unit.as_ref()));
    let inputs = p.inputs.iter().map(|s| (s.name.clone(), s.unit.as_ref()));
    let parameters = p.parameters.iter().zip(&export.start.parameters).map(|(s, value)| {
        let kind = if s.constant { ", constant" } else { "" };
        (format!("{}, {value:?} if not set{kind}", s.name), s.unit.as_ref())
    });
    let outputs = export.recorded.iter().map(|&i| (p.observed[i].name.clone(), p.observed[i].unit.as_ref()));
    let private = private_parts(export, plan);
    let words: Vec<(&str, String)> = vec![
        ("COST_LINES", lines.trim_end().to_string()),
        ("MODEL_NAME", comment(&p.name)),
        ("METHOD_NAME", export.method.name().replace('_', " ")),
        ("STEP_LENGTH", format!("{:?}", export.step)),
        ("NUMBER_STATES", p.states.len().to_string()),
        ("NUMBER_INPUTS", p.inputs.len().to_string()),
        ("NUMBER_PARAMETERS", p.parameters.len().to_string()),
        ("NUMBER_OUTPUTS", export.recorded.len().to_string()),
        ("NUMBER_INDICATORS", s.indicators.to_string()),
        ("SIZE_STATES", n(p.states.len())),
        ("SIZE_INPUTS", n(p.inputs.len())),
        ("SIZE_PARAMETERS", n(p.parameters.len())),
        ("SIZE_OUTPUTS", n(export.recorded.len())),
        ("NUMBER_JUMPS", MOST_JUMPS.to_string()),
        ("STATE_LINES", enumerators("X", &names.states, states)),
        ("INPUT_LINES", enumerators("U", &names.inputs, inputs)),
        ("PARAMETER_LINES", enumerators("P", &names.parameters, parameters)),
        ("OUTPUT_LINES", enumerators("Y", &names.outputs, outputs)),
        ("CODES", codes),
        ("PRIVATE_PARTS", private),
    ];
    let words = words.into_iter().map(|(word, text)| (word.to_string(), text)).collect();
    let flags = plan.flags();
    text = template::fill(&template::choose(&text, |word| flags.holds(word)), &words);
    template::name(&real::of(&text, export.real), &plan.name)
}

/// The parts of the model that are nobody's affair, with what they are.
fn private_parts(export: &Export, plan: &Plan) -> String {
    let p = export.program;
    let s = &plan.sizes;
    let (nx, nu) = (p.states.len(), p.inputs.len());
    let n = |count: usize| count.max(1);
    let mut text = String::new();
    let mut part = |wanted: bool, line: String| {
        if wanted {
            let _ = writeln!(text, "    {line}");
        }
    };
    part(true, format!("double c[{}]; /* what follows from parameters */", n(s.derived)));
    let single = export.real == Real::Float;
    let parameters = p.parameters.len();
    part(single && parameters > 0, format!("ha_wide p_exact[{parameters}]; /* parameters in double precision */"));
    part(s.exact > 0, format!("ha_wide c_exact[{}]; /* of what follows from them, what time needs */", s.exact));
    part(
        single,
        format!("double rest[{0}], trial_rest[{0}]; /* of states, what is less than their last digit */", n(nx)),
    );
    part(true, format!("double k[{}]; /* conserved constants */", n(p.conserved.len())));
    part(true, format!("double z[{}]; /* held signals */", n(p.held.len())));
    part(true, format!("unsigned char set[{}]; /* which parameters are set */", n(p.parameters.len())));
    part(true, "int changed; /* whether any is set */".into());
    part(!p.assumptions.is_empty(), "int broken; /* which assumption parameters break, from 1 */".into());
    part(true, "int begun; /* whether the run has begun */".into());
    part(true, "int cross_due; /* whether a parameter or an input has jumped */".into());
    part(true, "ha_wide crossed; /* when the last jump was crossed */".into());
    part(true, format!("double u_crossed[{}]; /* inputs then */", n(nu)));
    part(true, format!("double u_default[{}]; /* inputs that nobody sets */", n(nu)));
    part(true, "ha_wide tick_from, tick_next, tick_index, tick_rate; /* times of steps */".into());
    let conditions = p.conditions.len();
    part(conditions > 0, format!("ha_wide held[{}]; /* conditions as held */", n(conditions)));
    let clocks = p
        .conditions
        .values()
        .filter(|c| {
            matches!(
                c.trigger,
                halfarrow_compiler::program::EventTrigger::LinearTime
                    | halfarrow_compiler::program::EventTrigger::CurvedTime
            )
        })
        .count();
    part(clocks > 0, "int clock_hold; /* what is done with those of time */".into());
    part(clocks > 0, "ha_wide clock_next; /* when they change next */".into());
    part(clocks > 0, format!("ha_wide clock_operand[{0}], clock_rate[{0}];", n(clocks)));
    let switches = plan.switches.len();
    part(switches > 0, "int state_hold; /* what is done with those of the state */".into());
    part(switches > 0, format!("int sides[{}]; /* sides of the indicators */", n(s.indicators)));
    part(switches > 0, format!("double operands[{}], beyond[{}];", n(switches), n(s.indicators)));
    part(!plan.delays.is_empty(), format!("MODEL_delay delays[{}];", n(plan.delays.len())));
    part(!plan.delays.is_empty(), format!("MODEL_point points[{}];", n(plan.delays.iter().map(|d| d.1).sum())));
    part(!plan.samples.is_empty(), format!("MODEL_sample samples[{}];", n(plan.samples.len())));
    let held = p.held.len();
    part(held > 0, format!("double source[{0}], source_rate[{0}]; /* what is delayed or sampled */", n(held)));
    let newton = plan.newton.len();
    part(
        newton > 0,
        format!(
            "double memory[{}]; /* solutions of Newton blocks, where they were found, their Jacobians */",
            n(s.memory)
        ),
    );
    part(newton > 0, format!("int following[{}]; /* whether they are followed */", n(newton)));
    part(s.factored > 0, format!("double factors[{}]; /* of matrices of parameters alone */", n(s.factors)));
    part(s.factored > 0, format!("int factors_order[{}], factored[{}];", n(s.factors_order), n(s.factored)));
    part(true, format!("double stages[{}], trial[{}], dx[{}];", n(nx * export.method.stages()), n(nx), n(nx)));
    part(true, format!("double beside[{}]; /* a state beside another one */", n(nx)));
    part(true, format!("double w[{}]; /* values from one piece of code to the next */", n(s.crossing)));
    part(s.wide > 0, format!("ha_wide wide[{}]; /* the same, where they follow from time alone */", s.wide));
    part(
        true,
        format!(
            "double along[{}], along_out[{}]; /* directions of derivatives */",
            n(s.directions[4]),
            n(nx.max(export.recorded.len()))
        ),
    );
    part(true, format!("double shown[{}];", n(export.recorded.len())));
    part(s.order > 0, format!("double work[{}]; /* for solve blocks */", n(s.work)));
    part(s.order > 0, format!("int order[{}];", n(s.order)));
    let implicit = export.method.is_implicit();
    part(implicit, format!("double matrix[{}], matrix_scale[{1}], matrix_work[{1}];", n(nx * nx), n(nx)));
    part(implicit && single, format!("double matrix_columns[{}];", n(nx)));
    let half_way = single && export.method == crate::Method::ImplicitMidpoint;
    part(half_way, format!("double half_way[{}]; /* from the beginning of a step to its middle */", n(nx)));
    part(implicit, format!("int matrix_order[{}];", n(nx)));
    part(implicit, format!("double middle[{0}], sizes[{0}], correction[{0}], direction[{0}], product[{0}];", n(nx)));
    text.trim_end().to_string()
}

fn enumerators<'a>(letter: &str, names: &[String], about: impl Iterator<Item = (String, Option<&'a Unit>)>) -> String {
    let lines = names.iter().zip(about).enumerate().map(|(i, (name, (about, unit)))| {
        let unit = match unit {
            None => String::new(),
            Some(unit) if unit.is_si() => format!(", in {unit}"),
            // All numbers here are SI numbers.
            Some(unit) => format!(", in {} (declared in {unit})", unit.to_si_unit()),
        };
        let comma = if i + 1 < names.len() { "," } else { "" };
        format!("    MODEL_{letter}_{name} = {i}{comma} /* {} */", comment(&format!("{about}{unit}")))
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// A text within a comment.
pub(super) fn comment(text: &str) -> String {
    text.replace("*/", "* /").replace("/*", "/ *").replace(['\n', '\r'], " ")
}
