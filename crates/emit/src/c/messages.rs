//! What failures mean, in words.

use std::fmt::Write;

use halfarrow_compiler::program::{Assumption, Clause, DomainKind, LawDomain, PivotGuard, first_of};

use super::fragment::{Fragment, Kind};
use super::plan::Plan;
use super::written::Written;
use crate::Real;

/// Failures, each with the texts of all places where it may happen.
fn texts(plan: &Plan) -> Vec<(&'static str, Vec<String>)> {
    let p = plan.program;
    let block =
        |text: &dyn Fn(&str) -> String| p.blocks.values().map(|b| text(&first_of(b.elements()))).collect::<Vec<_>>();
    let singular = |what: &str| {
        format!(
            "the equations of {what} have no unique solution: the machine is in a singular position or a modulus vanishes there"
        )
    };
    let not_finite = |what: String| {
        format!("{what} is not a finite number: look for a division by zero, or for a value that grows without bound")
    };
    let states = |text: &dyn Fn(&str) -> String| p.states.iter().map(|s| text(&s.name)).collect::<Vec<_>>();
    let conditions = plan.switches.iter().flat_map(|&c| vec![c; p.conditions[c].kind.switches()]);
    let range = match plan.export.real {
        Real::Double => "",
        Real::Float => "; a law may also leave the range of float where the search begins, as exp does above 88",
    };
    let group = |g: &super::start::Group| {
        let names: Vec<&str> = g.conditions.iter().map(|&c| p.start[c].name.as_str()).collect();
        format!("no start was found with {}: give start values that fit and are near to each other", names.join(", "))
    };
    let clauses = |text: &dyn Fn(&str) -> String| p.clauses.iter().map(|c| text(&c.name)).collect::<Vec<_>>();
    let actions = |text: &dyn Fn(&str, &str) -> String| {
        let of = |c: &Clause| c.actions.iter().map(|a| text(&c.name, &a.name)).collect::<Vec<_>>();
        p.clauses.iter().flat_map(of).collect::<Vec<_>>()
    };
    let resets = |text: &dyn Fn(&str) -> String| {
        let mut all = actions(&|_, action| text(action));
        all.push(text("what storages keep"));
        all
    };
    let laws = |text: &dyn Fn(&str) -> String| p.set_valued.iter().map(|l| text(&l.name)).collect::<Vec<_>>();
    let kept = match p.exchanges.independent.is_empty() || plan.mode.is_some() {
        true => "",
        false => {
            ", or where these variables do not tell the motion name others with `prefer`: exported code keeps its own"
        }
    };
    vec![
        ("VANISHED", p.pivot_guards.iter().map(vanished).collect()),
        ("SINGULAR", block(&singular)),
        (
            "NO_CONVERGENCE",
            block(&|what| format!("the iteration for {what} did not converge; a law may have no solution there, the step may be too long, or laws saturate so that nothing tells the unknowns any more{range}")),
        ),
        (
            "BRANCH",
            block(&|what| {
                format!("the equations of {what} have two solutions; the one that the run has followed ends here, or a step is too long to follow it")
            }),
        ),
        (
            "OFF_MOTION",
            block(&|what| {
                format!("the positions {what} cannot be followed: a step is too long for that, the machine is at its limit, or another motion leads through the same position; make the step shorter{kept}")
            }),
        ),
        ("PASSED", passed(plan)),
        (
            "NOT_PUT_BACK",
            vec!["no positions near are on the relations that their speeds keep: make the step shorter".into()],
        ),
        ("BOUND", block(&|what| format!("the equations of {what} are not solved within the bound on evaluations"))),
        ("OUT_OF_DOMAIN", p.domains.iter().map(domain).collect()),
        ("RATE_NOT_FINITE", states(&|name| not_finite(format!("the rate of {name}")))),
        ("STATE_NOT_FINITE", states(&|name| not_finite(name.to_string()))),
        ("DERIVATIVE_NOT_FINITE", states(&|name| not_finite(format!("the derivative of the rate of {name}")))),
        (
            "OUTPUT_NOT_FINITE",
            plan.export.recorded.iter().map(|&i| not_finite(p.observed[i].name.to_string())).collect(),
        ),
        (
            "CONDITION_NOT_FINITE",
            conditions.enumerate().map(|(i, _)| not_finite(format!("condition {}", i + 1))).collect(),
        ),
        ("INPUT_NOT_FINITE", p.inputs.iter().map(|i| not_finite(format!("the input {}", i.name))).collect()),
        ("NO_STEP", vec!["the iteration for the implicit midpoint step did not converge; the step may be too long".into()]),
        ("STEP_SINGULAR", states(&|name| singular(&format!("the step of {name}")))),
        ("TOO_MANY_JUMPS", vec!["more jumps than a step may hold: make the step shorter".into()]),
        (
            "NO_ROOM",
            plan.delays.iter().map(|(i, points)| format!("{} keeps more than {points} points: the step is shorter than the one exported for, or much jumps", p.held[*i].name)).collect(),
        ),
        ("NO_START", plan.groups.iter().map(group).collect()),
        (
            "BAD_PARAMETER",
            match &p.parameters[..] {
                [] => vec!["the model has no parameters".into()],
                all => all.iter().map(|p| format!("{} is set to a value that is not finite, or is a constant", p.name)).collect(),
            },
        ),
        ("OUT_OF_RANGE", out_of_range(plan)),
        ("NOT_STARTED", vec!["the model has not been started".into()]),
        ("EVENT_NOT_FINITE", actions(&|clause, action| not_finite(format!("the value that `{clause}` gives {action}")))),
        (
            "CONFLICT",
            actions(&|clause, action| {
                format!("two events at one instant give {action} different values, one of them is `{clause}`: say in one of them what holds where both happen")
            }),
        ),
        (
            "ENDLESS_EVENTS",
            clauses(&|name| {
                format!("events make each other happen over and over and time stands still, `{name}` among them; let one of them leave the condition of the other as it is, or put a gap between the conditions (hysteresis)")
            }),
        ),
        (
            "ACCUMULATION",
            clauses(&|name| {
                format!("`{name}` happens ever faster: its events accumulate, and what is beyond that the model does not say; end the run before it, or let a law take over where it gets fast, such as a spring and a damper")
            }),
        ),
        (
            "LOST",
            clauses(&|name| {
                format!("`{name}` holds further on after it has happened, and the way back that it began with was shorter than a step can tell: shorten the step, end the run before it, or let a law take over where events get fast, such as a contact (`constraint gap: x >= 0`)")
            }),
        ),
        (
            "RESET_DEPENDENT",
            resets(&|what| {
                format!("{what} cannot be reset: what is reset depends on each other there, or nothing that keeps an impulse takes part: reset one of those that move together")
            }),
        ),
        (
            "RESET_UNMET",
            resets(&|what| {
                format!("{what} cannot be reset: no impulse leads to the values that are asked for: look whether the laws of the storages have values there, and whether a constraint stands against them")
            }),
        ),
        (
            "CONSTRAINT_BROKEN",
            plan.events
                .constraints(p)
                .map(|c| format!("what events change does not fit the constraint {}: reset all positions that it reads, so that they fit each other", c.name))
                .collect(),
        ),
        ("NO_MODE", laws(&|name| format!("no branch of the set-valued laws fits after that of {name} has ended: look whether they contradict each other there, or whether a source asks for what no branch allows"))),
        ("STUCK", vec!["an impulse acts where what is stuck or in contact cannot be let go".into()]),
        ("OVERLAP", laws(&|name| format!("the sides of {name} overlap where the run begins: begin with a gap that is not negative"))),
        ("STRUCTURE", p.assumptions.iter().map(structure).collect()),
    ]
}

/// What does not fit real numbers of single precision; nothing where they are double.
fn out_of_range(plan: &Plan) -> Vec<String> {
    let text = |what: String| format!("{what} does not fit float: it is too great, or too close to zero");
    let parameters = plan.program.parameters.iter().map(|p| text(format!("the parameter {}", p.name)));
    let derived = std::iter::once(text("what follows from parameters".into()));
    match plan.export.real {
        Real::Double => Vec::new(),
        Real::Float => parameters.chain(derived).collect(),
    }
}

fn vanished(guard: &PivotGuard) -> String {
    format!(
        "the equations of {} have no unique solution: they divide by {}, which vanishes there; the machine is in a singular position, unless another variable may stay independent: name it with `prefer`",
        first_of(&guard.elements),
        guard.divisor
    )
}

fn structure(a: &Assumption) -> String {
    format!(
        "with these parameters the equations are others: they were derived where {}; export the model anew with these values, as by `--set`",
        a.text
    )
}

fn domain(d: &LawDomain) -> String {
    let what = match d.elements.as_str() {
        "" => d.given.clone(),
        elements => format!("the law of {elements}"),
    };
    let asked = d.asked.as_ref().map_or(d.given.clone(), |(name, _)| format!("{} at that {name}", d.given));
    let needs = match d.kind {
        DomainKind::Positive => "the logarithm of a number that is not above zero".to_string(),
        DomainKind::NotNegative => "a root of a number below zero".to_string(),
        DomainKind::Within(low, high) => format!("a value outside of {low} to {high}"),
    };
    format!("{what} is asked for a value where it has none: {asked} needs {needs}")
}

/// That a position has been passed at which these variables do not tell the motion.
fn passed(plan: &Plan) -> Vec<String> {
    let remedy = match plan.mode {
        Some(_) => "make the step shorter; the table of modes may lack the variables that tell it there",
        None => "make the step shorter, or name others with `prefer`: here exported code keeps its own",
    };
    let what = plan.ratios().map_or_else(String::new, |ratios| ratios.tellers(plan.program));
    vec![format!("the motion does not follow from {what} at a position that has been passed: {remedy}")]
}

/// The codes, as the lines of an enumeration.
pub(super) fn codes(plan: &Plan) -> Vec<(&'static str, &'static str)> {
    let meaning = |code: &str| match code {
        "VANISHED" => "a divisor vanishes",
        "SINGULAR" => "linear equations have no unique solution",
        "NO_CONVERGENCE" => "nonlinear equations have no solution, or none was found",
        "BRANCH" => "the solution that was followed ends",
        "PASSED" => "a position was passed at which independent variables do not tell the motion",
        "NOT_PUT_BACK" => "positions that cannot be put back onto what their speeds keep",
        "BOUND" => "the bound on evaluations is hit",
        "OUT_OF_DOMAIN" => "a law is asked for a value where it has none",
        "RATE_NOT_FINITE" => "a rate is no finite number",
        "STATE_NOT_FINITE" => "a state is no finite number",
        "DERIVATIVE_NOT_FINITE" => "a derivative of a rate is no finite number",
        "OUTPUT_NOT_FINITE" => "an output is no number",
        "CONDITION_NOT_FINITE" => "a condition is no number",
        "INPUT_NOT_FINITE" => "an input is no finite number",
        "NO_STEP" => "the implicit step was not solved",
        "STEP_SINGULAR" => "the implicit step has no unique solution",
        "TOO_MANY_JUMPS" => "more jumps than a step may hold",
        "NO_ROOM" => "a delay keeps more points than there is room for",
        "NO_START" => "no start was found for these parameters",
        "OUT_OF_RANGE" => "a parameter, or what follows from it, does not fit float",
        "BAD_PARAMETER" => "no such parameter, a constant, or a value that is not finite",
        "STRUCTURE" => "parameters for which the equations are others",
        "EVENT_NOT_FINITE" => "an event gives a value that is no finite number",
        "CONFLICT" => "two events at one instant give one thing different values",
        "ENDLESS_EVENTS" => "events at one instant set each other off without end",
        "ACCUMULATION" => "events come ever faster",
        "LOST" => "a condition holds further on after its event has led back across its border",
        "RESET_DEPENDENT" => "resets of what moves together",
        "RESET_UNMET" => "no impulse leads to what a reset asks for",
        "NO_MODE" => "no branch of the set-valued laws fits",
        "STUCK" => "an impulse acts on what cannot be let go",
        "OVERLAP" => "the sides of a contact overlap at the start",
        "CONSTRAINT_BROKEN" => "what events change does not fit a constraint",
        _ => "a step before the start",
    };
    texts(plan).into_iter().filter(|(code, _)| can_happen(code, plan)).map(|(code, _)| (code, meaning(code))).collect()
}

/// Whether a model can fail so.
fn can_happen(code: &str, plan: &Plan) -> bool {
    match code {
        "OUT_OF_RANGE" => plan.export.real == Real::Float,
        "EVENT_NOT_FINITE" | "CONFLICT" | "ENDLESS_EVENTS" | "ACCUMULATION" => !plan.program.clauses.is_empty(),
        "LOST" => !plan.events.returning.is_empty(),
        "RESET_DEPENDENT" | "RESET_UNMET" => plan.program.jumps.is_some(),
        "NO_MODE" | "STUCK" | "OVERLAP" => !plan.program.set_valued.is_empty(),
        "PASSED" => plan.may_pass(),
        "NOT_PUT_BACK" => !plan.relations().is_empty(),
        "CONSTRAINT_BROKEN" => !plan.events.positions.is_empty(),
        _ => true,
    }
}

/// The function that gives them, under a heading.
pub(super) fn messages(plan: &Plan) -> Vec<Fragment> {
    let (model, capitals) = (&plan.name, plan.name.to_ascii_uppercase());
    let (mut tables, mut cases) = (String::new(), String::new());
    for (code, texts) in texts(plan).iter().filter(|(code, texts)| !texts.is_empty() && can_happen(code, plan)) {
        let name = code.to_ascii_lowercase();
        let _ = writeln!(tables, "static const char *const ha_text_{name}[] = {{");
        for one in texts {
            let _ = writeln!(tables, "    \"{}\",", escaped(one));
        }
        tables += "};\n";
        let count = texts.len();
        let _ = writeln!(
            cases,
            "    case {capitals}_{code}:\n        return m->failure.where >= 0 && m->failure.where < {count} ? ha_text_{name}[m->failure.where] : \"\";"
        );
    }
    let message = format!(
        "\nconst char *{model}_message(const {model} *m)\n{{\n    switch (m->failure.code) {{\n{cases}    default:\n        return \"\";\n    }}\n}}"
    );
    // Tables of each mode have names of their own, which the function alone knows.
    let mut all = Fragment::new(Kind::Public(format!("{model}_message").into()));
    all.line(&Written::of(tables + &message));
    vec![Fragment::section("what failures mean"), all]
}

/// A text within quotes of C: what is not ASCII as bytes of UTF-8 in octal.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::new();
    for byte in text.bytes() {
        match byte {
            b'"' => out.push_str("\\\""),
            b'\\' => out.push_str("\\\\"),
            b'?' => out.push_str("\\?"),
            0x20..=0x7e => out.push(byte as char),
            byte => {
                let _ = write!(out, "\\{byte:03o}");
            }
        }
    }
    out
}
