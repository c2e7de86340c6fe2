//! All derivatives at once are those along directions: every model, along a run.

use crate::common;
use halfarrow_compiler::sparse::SparseMatrix;

use common::Sketch;
use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::equations::{LinearBlock, NewtonBlock};
use halfarrow_compiler::program::{Op, Program};
use halfarrow_exec::Model;
use halfarrow_sim::{Events, Method, Options, Sink, System, simulate};

/// Compares at a point; how many derivatives are there.
fn compare(name: &str, model: &mut Model, t: f64, x: &[f64]) -> usize {
    let pattern = model.sparsity().clone();
    let mut values = vec![f64::NAN; pattern.nonzeros()];
    assert_eq!(model.jacobian(t, x, &mut values), Ok(true), "{name}");
    let (mut along, mut product) = (vec![0.0; x.len()], vec![0.0; x.len()]);
    for column in 0..x.len() {
        along.fill(0.0);
        along[column] = 1.0;
        model.directional_derivative(t, x, &along, &mut product).unwrap_or_else(|why| panic!("{name} at {t}: {why:?}"));
        for (place, &row) in pattern.places(column).zip(pattern.column(column)) {
            let (here, there) = (values[place], product[row]);
            let size = product.iter().fold(there.abs(), |most, p| most.max(p.abs()));
            assert!((here - there).abs() <= 1e-10 * size, "{name} at {t}, row {row}, column {column}: {here} {there}");
        }
    }
    values.len()
}

struct Points<'a>(&'a mut Vec<(f64, Vec<f64>)>);

impl Sink for Points<'_> {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.0.push((t, values.to_vec()));
    }
}

/// Points of a run up to the first jump.
fn points(program: &Program) -> Vec<(f64, Vec<f64>)> {
    let mut model = Model::new(program.clone()).expect("parameters that fit");
    let names: Vec<String> = program.states.iter().map(|s| s.name.clone()).collect();
    model.record(&names.iter().map(String::as_str).collect::<Vec<_>>()).expect("states can be recorded");
    let mut x = model.initialise(0.0).expect("there is a start");
    let mut start = model.clone();
    start.handle_event(0.0, &mut x.clone()).expect("a start");
    let to = start.next_time_event(0.0).unwrap_or(0.4).min(0.4);
    let mut all = Vec::new();
    let options = Options { method: Method::Auto, to, every: Some(to / 3.0), ..Options::default() };
    let end = simulate(&mut model, &options, &mut x, &mut Points(&mut all)).map_or_else(|s| 0.5 * s.time, |_| to);
    all.retain(|(t, _)| *t < end);
    all
}

#[test]
fn every_model_has_its_derivatives_at_once() {
    let mut compared = 0;
    for (name, program) in common::models() {
        let mut model = Model::with_jacobian(program.clone()).expect("parameters that fit");
        for (t, x) in points(&program) {
            model.restart();
            // A law with several solutions may not be found again in the middle of a run.
            if model.handle_event(t, &mut x.clone()).is_err() {
                continue;
            }
            compared += compare(&name, &mut model, t, &x);
        }
    }
    assert!(compared > 400, "only {compared} derivatives were compared");
}

/// A block solved three times over with the same factors, in a Newton block that reads it, by all kinds of givens.
#[test]
fn blocks_are_differentiated_by_inputs_time_and_parameters() {
    let mut s = Sketch::default();
    let x = s.state("x");
    let three = s.number(3.0);
    let (k, u, t) = (s.parameter("k", three), s.input("u", 0.5), s.t);
    let ((a, ae), (b, be)) = (s.symbol("a"), s.symbol("b"));
    let one = s.number(1.0);
    let matrix = SparseMatrix::full(vec![vec![k, x], vec![one, u]]);
    let sine = s.call(Function::Sin, t);
    s.step(LinearBlock { unknowns: vec![a, b], matrix, right: vec![sine, x], elements: vec![] }.into());
    let (c, ce) = s.symbol("c");
    let exp = s.call(Function::Exp, ce);
    let product = s.x.mul(&[k, ae]);
    let terms = [exp, ce, product, be, u];
    let residual = s.x.add(&terms);
    s.step(NewtonBlock { unknowns: vec![c], body: vec![], residuals: vec![residual], elements: vec![] }.into());
    let rate = s.x.mul(&[ce, be]);
    s.rate("x", rate);
    s.observe("rate", rate);
    let program = halfarrow_compiler::program::schedule(&s.equations());
    let givens = [Op::State(0), Op::Input(0), Op::Time, Op::Parameter(0)];
    let differentiated = program.differentiate(&[program.states[0].rate], &givens);
    assert_eq!(differentiated.entries.iter().map(|e| e.column).collect::<Vec<_>>(), [0, 1, 2, 3]);
    let mut with = differentiated.program;
    for entry in &differentiated.entries {
        with.observed.push(halfarrow_compiler::program::Observed {
            name: format!("d{}", entry.column).into(),
            value: Ok(entry.value),
            unit: None,
            kind: halfarrow_compiler::equations::ObservedKind::Named,
            default: false,
        });
    }
    let mut model = Model::new(with).unwrap();
    let mut at = |x: f64, u: f64, t: f64, k: f64, what: &str| {
        model.set_parameter("k", k).unwrap();
        model.connect("u", &[0.0], &[u]).unwrap();
        model.record(&[what]).unwrap();
        model.handle_event(t, &mut [x]).unwrap();
        let mut out = [0.0];
        model.observe(t, &[x], &mut out).unwrap();
        out[0]
    };
    let (x, u, t, k) = (0.7, 0.4, 0.3, 2.5);
    for column in 0..4 {
        let step = |i: usize, h: f64| if i == column { h } else { 0.0 };
        let mut moved = |h: f64| at(x + step(0, h), u + step(1, h), t + step(2, h), k + step(3, h), "rate");
        let h = 1e-3;
        let difference = (8.0 * (moved(h) - moved(-h)) - (moved(2.0 * h) - moved(-2.0 * h))) / (12.0 * h);
        let exact = at(x, u, t, k, &format!("d{column}"));
        assert!((exact - difference).abs() < 1e-6 * exact.abs().max(1.0), "column {column}: {exact} {difference}");
        assert!(exact.abs() > 1e-3, "column {column} says nothing: {exact}");
    }
}
