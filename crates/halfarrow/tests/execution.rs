//! Bytecode or machine code: the same trajectories, and what ran is told.

use halfarrow::{Execution, FixedMethod, Form, Method, Model, Run, Simulated, Source};

fn simulated(run: &Run) -> Simulated {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/double_pendulum/model.bond");
    let model = Model::new(Source::open(file.as_ref()).expect("a file"), &[]).expect("a model");
    model.simulate(run, &mut |_| true).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

fn bits(done: &Simulated) -> Vec<Vec<u64>> {
    let of = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect();
    done.trace.columns.iter().map(|column| of(&column.values)).chain([of(&done.trace.times)]).collect()
}

#[test]
fn whatever_evaluates_a_run_its_bits_are_the_same() {
    let fixed = Run { method: Method::Fixed(FixedMethod::Rk4), step: Some(1e-3), ..Run::default() };
    for run in [fixed, Run { rtol: 1e-8, ..Run::default() }, Run { form: Form::Lagrange, to: 0.2, ..Run::default() }] {
        let by = |execution| simulated(&Run { execution, ..run.clone() });
        let [auto, bytecode, machine] = [Execution::Auto, Execution::Bytecode, Execution::Machine].map(by);
        assert_eq!(bits(&auto), bits(&bytecode));
        assert_eq!(bits(&machine), bits(&bytecode));
        assert!(!bytecode.report.execution.is_empty());
        assert!(bytecode.report.execution.iter().all(|routine| !routine.machine && routine.by_bytecode > 0));
        assert!(machine.report.execution.iter().all(|routine| routine.machine && routine.by_bytecode == 0));
        assert!(auto.report.execution.iter().all(|routine| !routine.machine), "none of them is long");
    }
}

#[test]
fn a_long_run_becomes_machine_code_and_says_why() {
    let method = Method::Fixed(FixedMethod::Rk4);
    let done = simulated(&Run { method, step: Some(1e-3), to: 10.0, every: Some(10.0), ..Run::default() });
    let rates = &done.report.execution[0];
    assert!(rates.routine == "rates" && rates.machine, "{rates:?}");
    assert_eq!(rates.reason, format!("40000 evaluations to come, {} repay it", rates.repaid_after));
    let recorded = &done.report.execution[1];
    assert!(recorded.routine == "recorded" && !recorded.machine, "{recorded:?}");
}

/// A line of 1,000 sections, of which each has a law of its own to solve, and with more text.
fn line(more: &str) -> Model {
    let text = format!(
        "model Line
param n = 1000
param r = 1.5 ohm, c = 2 mF
for i in 1..n {{
    1:wire[i] -> R:r[i](r)
    wire[i] -> 0:node[i] -> C:c[i](c, q0 = if i == 2 then 1 mC else 0 mC)
    node[i] -> 1:leak[i] -> R:law[i](f = 0.01 A/V*e + 0.2 A/V^3*e^3)
    leak[i] -> R:lead[i](0.3 ohm)
    if i == 1 {{
        Se:source(2 V) -> wire[i]
    }} else {{
        node[i - 1] -> wire[i]
    }}
}}
{more}
"
    );
    Model::from_text("line.bond", &text, &[]).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

/// What stages a model has gone through.
fn stages(model: &Model) -> Vec<&'static str> {
    model.timings().iter().map(|stage| stage.stage).collect()
}

#[test]
fn a_model_of_equal_cells_continues_smaller_ones_and_has_the_bits_of_itself() {
    // What counts cells is divided in an index here, and so the second one is compiled as it stands.
    let (continued, stands) = (line(""), line("let middle = c[n/2].q"));
    let run = Run { to: 2e-3, ..Run::default() };
    let of =
        |model: &Model| model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{}", error.render(false)));
    let (first, second) = (of(&continued), of(&stands));
    assert!(!stages(&continued).contains(&"equations") && stages(&stands).contains(&"equations"));
    assert_eq!(bits(&first), bits(&second));
    let (first, second) = (&first.report.audit, &second.report.audit);
    assert_eq!((&first.residual, &first.rates, &first.energy), (&second.residual, &second.rates, &second.energy));
}

#[test]
fn cells_that_are_gone_through_together_have_the_bits_of_each() {
    let run = Run { to: 0.02, ..Run::default() };
    let by = |execution| {
        let run = Run { execution, ..run.clone() };
        line("").simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{}", error.render(false)))
    };
    let (auto, machine) = (by(Execution::Auto), by(Execution::Machine));
    assert!(auto.report.execution.iter().any(|routine| routine.reason.contains("equal cells together")));
    assert!(machine.report.execution.iter().all(|routine| routine.machine));
    assert_eq!(bits(&auto), bits(&machine));
}

#[test]
fn a_run_that_stops_tells_what_the_model_itself_tells() {
    let stop = "Se:root(1 V*sqrt(1 - t/(20 ms))) -> 1:other -> I:coil(1 H)\nother -> R:coil_loss(1 ohm)";
    let text = |count: &str| format!("{stop}\n{count}");
    let why = |more: &str| {
        let run = Run { to: 0.05, ..Run::default() };
        line(more).simulate(&run, &mut |_| true).expect_err("a run that stops").render(false)
    };
    assert_eq!(why(&text("")), why(&text("let middle = c[n/2].q")));
}
