//! Machine code gives what the bytecode gives, to the last bit: every model along a run, and random programs; and it
//! gives its memory back.

use crate::common;
use crate::recipes;

use halfarrow_compiler::program::Program;
use halfarrow_exec::Model;
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::{Events, Method, Options, Sink, System, simulate};
use proptest::prelude::*;
use recipes::{Recipe, STATES, recipe};

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

fn compiled(model: &Model) -> Model {
    let mut model = model.clone();
    model.compile_machine().expect("machine code for this processor");
    model.compile_directional().expect("machine code for this processor");
    assert!(model.runs_machine_code());
    model
}

/// All that is evaluated at a point, by both.
fn compare(name: &str, bytecode: &mut Model, machine: &mut Model, t: f64, x: &[f64]) -> Result<(), TestCaseError> {
    let n = x.len();
    let (mut here, mut there) = (vec![0.0; n], vec![0.0; n]);
    let bits = |here: &[f64], there: &[f64], what: &str| {
        for (i, (&a, &b)) in here.iter().zip(there).enumerate() {
            prop_assert!(same(a, b), "{}, {} {} at {}: {:e} in bytecode, {:e} in machine code", name, what, i, t, a, b);
        }
        Ok(())
    };
    let results = (bytecode.rates(t, x, &mut here), machine.rates(t, x, &mut there));
    prop_assert_eq!(format!("{:?}", results.0), format!("{:?}", results.1));
    if results.0.is_err() {
        return Ok(());
    }
    bits(&here, &there, "rate")?;
    let v: Vec<f64> = (0..n).map(|i| [1.0, 0.0, -0.7][i % 3]).collect();
    let results =
        (bytecode.directional_derivative(t, x, &v, &mut here), machine.directional_derivative(t, x, &v, &mut there));
    prop_assert_eq!(format!("{:?}", results.0), format!("{:?}", results.1));
    if results.0.is_ok() {
        bits(&here, &there, "derivative")?;
    }
    let count = bytecode.sparsity().nonzeros();
    let (mut here, mut there) = (vec![0.0; count], vec![0.0; count]);
    let results = (bytecode.jacobian(t, x, &mut here), machine.jacobian(t, x, &mut there));
    prop_assert_eq!(format!("{:?}", results.0), format!("{:?}", results.1));
    bits(&here, &there, "entry of the Jacobian")?;
    let count = bytecode.observed();
    let (mut here, mut there) = (vec![0.0; count], vec![0.0; count]);
    let results = (bytecode.observe(t, x, &mut here), machine.observe(t, x, &mut there));
    prop_assert_eq!(format!("{:?}", results.0), format!("{:?}", results.1));
    if results.0.is_ok() {
        bits(&here, &there, "recorded value")?;
    }
    let count = bytecode.indicators();
    let (mut here, mut there) = (vec![0.0; count], vec![0.0; count]);
    let results = (bytecode.event_indicators(t, x, &mut here), machine.event_indicators(t, x, &mut there));
    prop_assert_eq!(format!("{:?}", results.0), format!("{:?}", results.1));
    bits(&here, &there, "switching function")
}

/// Everything that is recorded in a run, as bits.
#[derive(Default)]
struct Trace(Vec<(u64, Vec<u64>)>);

impl Sink for Trace {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.0.push((t.to_bits(), values.iter().map(|v| if v.is_nan() { 0 } else { v.to_bits() }).collect()));
    }
}

fn run(model: &mut Model, method: Method) -> (Trace, String) {
    let mut trace = Trace::default();
    model.record_all();
    let mut x = model.initialise(0.0).expect("there is a start");
    let step = matches!(method, Method::Fixed(_)).then_some(2e-4);
    let options = Options { method, step, to: 0.2, every: Some(0.01), ..Options::default() };
    let end = simulate(model, &options, &mut x, &mut trace);
    (trace, format!("{:?}", end.map(|_| ()).map_err(|stop| stop.failure)))
}

fn with_all(program: &Program) -> Model {
    let mut model = Model::with_jacobian(program.clone()).expect("parameters that fit");
    model.record_all();
    model
}

#[test]
fn every_model_runs_the_same() {
    for (name, program) in common::models() {
        let model = with_all(&program);
        for method in [Method::Fixed(FixedMethod::Heun), Method::Auto] {
            let (mut bytecode, mut machine) = (model.clone(), compiled(&model));
            let (here, there) = (run(&mut bytecode, method), run(&mut machine, method));
            assert_eq!(here.1, there.1, "{name}");
            assert!(here.0.0 == there.0.0, "{name}: the trajectories differ");
        }
        let (mut bytecode, mut machine) = (model.clone(), compiled(&model));
        let x = bytecode.initialise(0.0).expect("there is a start");
        assert_eq!(machine.initialise(0.0).as_ref(), Ok(&x));
        for (at, shift) in [0.0, 1e-3, -0.4, 1e6].into_iter().enumerate() {
            for model in [&mut bytecode, &mut machine] {
                model.restart();
                let _ = model.handle_event(0.0, &mut x.clone());
            }
            let moved: Vec<f64> = x.iter().enumerate().map(|(i, x)| x + shift * (1.0 + i as f64)).collect();
            compare(&name, &mut bytecode, &mut machine, at as f64 * 0.01, &moved).unwrap_or_else(|why| panic!("{why}"));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn random_programs_run_the_same(recipe in recipe(), x in prop::array::uniform3(-2.0f64..2.0)) {
        let program = halfarrow_compiler::program::schedule(&recipes::build(&recipe).0.equations());
        let mut bytecode = with_all(&program);
        let mut machine = compiled(&bytecode);
        for model in [&mut bytecode, &mut machine] {
            let _ = model.handle_event(0.7, &mut x.to_vec());
        }
        compare("a random program", &mut bytecode, &mut machine, 0.7, &x)?;
        let moved = x.map(|x| 1e5 * x);
        compare("a random program", &mut bytecode, &mut machine, 0.9, &moved)?;
    }
}

/// Chunks hand over to each other what is read later.
#[test]
fn long_programs_run_the_same() {
    let recipe: Recipe = (0..2500).map(|i: usize| ((i * 7 % 14) as u8, i * 31 + 5, i * 17 + 3)).collect();
    let program = halfarrow_compiler::program::schedule(&recipes::build(&recipe).0.equations());
    let mut bytecode = Model::with_jacobian(program).expect("parameters that fit");
    let mut machine = compiled(&bytecode);
    let x = [0.3, -0.2, 0.9];
    assert_eq!(x.len(), STATES);
    for model in [&mut bytecode, &mut machine] {
        let _ = model.handle_event(0.7, &mut x.to_vec());
    }
    compare("a long program", &mut bytecode, &mut machine, 0.7, &x).unwrap_or_else(|why| panic!("{why}"));
}
