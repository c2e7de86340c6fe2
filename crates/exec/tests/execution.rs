//! What runs as machine code, and from when on: counted, so the same everywhere.

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_exec::{Evaluated, Executed, Execution, Expected, Model, Reason};
use halfarrow_sim::{Events, System};

/// A line of resistors and capacitors, and its start.
fn ladder(sections: usize) -> (Model, Vec<f64>) {
    let text = format!(
        "model Ladder\nparam n = {sections}\nfor i in 1..n {{\n1:wire[i] -> R:r[i](1)\n\
         wire[i] -> 0:node[i] -> C:c[i](1)\nif i == 1 {{\nSe:source(1) -> wire[i]\n}} else {{\nnode[i - 1] -> wire[i]\n}}\n}}\n"
    );
    let text = Text { name: "ladder.bond", text: &text, files: &NoFiles, overrides: &[] };
    let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
    let mut model = Model::new(program).expect("parameters that fit");
    model.record_all();
    let x = model.initialise(0.0).expect("there is a start");
    (model, x)
}

/// The rates and what is recorded, evaluated so often, as bits.
fn evaluated(model: &mut Model, x: &[f64], count: usize) -> Vec<u64> {
    let (mut dx, mut values) = (vec![0.0; x.len()], vec![0.0; model.observed()]);
    for _ in 0..count {
        model.rates(0.0, x, &mut dx).expect("rates");
    }
    model.observe(0.0, x, &mut values).expect("values");
    dx.iter().chain(&values).map(|value| value.to_bits()).collect()
}

fn of(model: &Model, what: Evaluated) -> Executed {
    model.executed().into_iter().find(|executed| executed.what == what).expect("it was evaluated")
}

#[test]
fn of_known_length_a_run_is_machine_code_where_that_is_repaid() {
    let mut table = String::new();
    for sections in [1, 10, 100, 1000] {
        for rates in [1e3, 1e4, 1.3e4, 2e4, 1e6] {
            let (mut model, x) = ladder(sections);
            model
                .execute(Execution::Auto, Some(Expected { rates, steps: rates / 2.0 }))
                .expect("there is machine code");
            evaluated(&mut model, &x, 1);
            let [rates_by, recorded_by] = [Evaluated::Rates, Evaluated::Recorded]
                .map(|what| ["bytecode", "machine"][usize::from(of(&model, what).machine)]);
            let Executed { instructions, repaid_after, ref reason, .. } = of(&model, Evaluated::Rates);
            assert_eq!(*reason, Reason::Expected(rates));
            table += &format!("{sections} {instructions} {repaid_after} {rates}: {rates_by}, {recorded_by}\n");
        }
    }
    assert_eq!(table, include_str!("execution.txt"), "\n{table}");
}

#[test]
fn of_unknown_length_a_run_becomes_machine_code_when_that_is_repaid() {
    let (mut model, x) = ladder(40);
    model.execute(Execution::Auto, None).expect("there is machine code");
    let bits = evaluated(&mut model, &x, 1);
    let repaid = of(&model, Evaluated::Rates).repaid_after;
    assert_eq!(evaluated(&mut model, &x, repaid as usize - 2), bits);
    let rates = of(&model, Evaluated::Rates);
    assert!(!rates.machine && rates.by_bytecode == repaid - 1, "{rates:?}");
    assert_eq!(evaluated(&mut model, &x, 2), bits);
    let rates = of(&model, Evaluated::Rates);
    assert!(rates.machine && rates.by_bytecode == repaid && rates.reason == Reason::Counted, "{rates:?}");
    assert!(!of(&model, Evaluated::Recorded).machine, "that was evaluated three times");
}

#[test]
fn one_chunk_and_many_have_the_bits_of_the_bytecode() {
    for sections in [5, 60, 63, 200, 1000] {
        let [here, there] = [Execution::Bytecode, Execution::Machine].map(|execution| {
            let (mut model, x) = ladder(sections);
            model.execute(execution, None).expect("there is machine code");
            let bits = evaluated(&mut model, &x, 3);
            let rates = of(&model, Evaluated::Rates);
            assert_eq!(rates.machine, execution == Execution::Machine);
            assert_eq!(rates.by_bytecode, if rates.machine { 0 } else { 3 });
            assert_eq!(rates.reason, Reason::Asked);
            bits
        });
        assert_eq!(here, there, "{sections} sections");
    }
}
