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
