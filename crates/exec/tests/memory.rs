//! What a run remembers can be saved and restored: it goes on with the same bits, also in another instance of the same code.

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::program::Program;
use halfarrow_exec::{Compiled, ImplicitModel, Memory, Model, Setup};
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::fixed_step::History;
use halfarrow_sim::{Events, Position, Stepwise, halves_mut};
use std::sync::Arc;

/// Jumps, conditions of the state, a delay, samples, a table at an input, and a diode whose current is solved for.
const TEXT: &str = "model S
param k = 4, stop = 0.02, T = 0.013
input u = 1
Se:pull(if t < T then 2*u else u*sin(40*t)) -> 1:a -> I:m(0.1)
a -> C:spring(k = k)
a -> R:wall(e = if spring.q > stop then 50*f else 0.2*f)
let late = delay(m.f, 5*T)
let seen = sample(m.f, T)
a -> Se:control(0.5*late + 0.1*seen)
Se:mains(5*cos(60*t)) -> 1:loop -> R:rs(10)
loop -> 0:node -> R:diode(f = 1e-9*(exp(e/0.05) - 1))
node -> R:load(f = 0.001*e + 0.01*e^3)
loop -> I:coil(0.01)
output q = spring.q
output v = node.e
";

fn program(form: Form) -> Program {
    let text = Text { name: "s.bond", text: TEXT, files: &NoFiles, overrides: &[] };
    compile(text, form).unwrap_or_else(|found| panic!("{}", found.render(false))).ir
}

fn setup(compiled: &Compiled) -> Setup {
    let mut setup = Setup::new(compiled);
    setup.set_parameter(compiled, "k", 5.0).expect("a parameter");
    setup.connect(compiled, "u", &[0.0, 0.1, 0.1, 0.4], &[1.0, 0.8, 1.2, 1.0]).expect("an input");
    setup
}

/// A run in a moment: all that it takes to go on.
type Saved = (Position, Option<History>, Memory, Vec<f64>);

/// Steps from one number of a step to another, and what was recorded at each of them.
fn go(model: &mut Model, run: &mut Stepwise, x: &mut [f64], steps: std::ops::Range<usize>) -> Vec<u64> {
    let mut out = vec![0.0; model.observed()];
    let mut bits = Vec::new();
    for step in steps {
        run.advance(model, 2e-3 * (step + 1) as f64, x).expect("a step");
        model.observe(run.time(), x, &mut out).expect("values");
        bits.extend(out.iter().chain(&*x).map(|value| value.to_bits()));
    }
    bits
}

#[test]
fn a_run_goes_on_with_the_same_bits() {
    let compiled = Arc::new(Compiled::new(program(Form::Minimal)));
    use FixedMethod::{LinearlyImplicitBdf2, Rk4, Rosenbrock};
    for (machine, method) in
        [(false, Rk4), (true, Rk4), (false, Rosenbrock), (false, LinearlyImplicitBdf2), (true, LinearlyImplicitBdf2)]
    {
        let instance = || {
            let mut model = Model::of(compiled.clone()).expect("parameters that fit");
            model.set_up(&setup(&compiled)).expect("what can be solved");
            if machine {
                let _ = model.compile_machine();
            }
            model
        };
        let mut model = instance();
        let mut x = model.initialise(0.0).expect("a start");
        let mut run = Stepwise::new(method, 0.0, &model);
        run.start(&mut model, &mut x).expect("a start");
        go(&mut model, &mut run, &mut x, 0..97);
        let saved: Saved = (run.position().clone(), run.history().cloned(), model.memory(), x.clone());
        let whole = go(&mut model, &mut run, &mut x, 97..250);
        assert!(run.summary().crossings > 0 && run.summary().jumps > 30, "{:?}", run.summary());
        assert_ne!(model.memory(), saved.2);

        let again = |model: &mut Model| {
            let (position, history, memory, mut x) = saved.clone();
            let mut run = Stepwise::new(method, 0.0, model);
            run.restore(&position, history.as_ref());
            model.restore(&memory);
            assert_eq!(model.memory(), memory);
            go(model, &mut run, &mut x, 97..250)
        };
        assert_eq!(again(&mut model), whole, "in the same instance");
        assert_eq!(again(&mut instance()), whole, "in a new one");
        // Threads share the code.
        let other = std::thread::scope(|scope| scope.spawn(|| again(&mut instance())).join()).expect("no panic");
        assert_eq!(other, whole, "in another thread");
    }
}

/// The same of a form beside the minimal one: residuals and recorded values around the point, and events after it.
#[test]
fn a_form_goes_on_with_the_same_bits() {
    let minimal = Model::new(program(Form::Minimal)).expect("parameters that fit");
    let mut model = ImplicitModel::new(program(Form::Lagrange), minimal).expect("parameters that fit");
    let (y, yp) = model.initialise(0.0).expect("a start");
    let mut point = [y, yp].concat();
    let go = |model: &mut ImplicitModel, point: &mut Vec<f64>, from: usize| {
        let mut out = vec![0.0; model.observed()];
        let mut bits = Vec::new();
        for step in from..from + 20 {
            let t = 7e-3 * step as f64;
            halves_mut(point).0.iter_mut().for_each(|y| *y += 1e-3 * y.abs().min(1.0));
            model.handle_event(t, point).expect("an event");
            model.accept(t, point).expect("a point");
            model.observe(t, point, &mut out).expect("values");
            bits.extend(out.iter().chain(&*point).map(|value| value.to_bits()));
        }
        bits
    };
    go(&mut model, &mut point, 0);
    let (memory, saved) = (model.memory(), point.clone());
    let whole = go(&mut model, &mut point, 20);
    model.restore(&memory);
    assert_eq!(go(&mut model, &mut saved.clone(), 20), whole);
}

#[test]
fn code_is_shared() {
    fn shared_by_threads<T: Send + Sync>(_: &T) {}
    let compiled = Arc::new(Compiled::new(program(Form::Minimal)));
    shared_by_threads(&compiled);
    let model = Model::of(compiled.clone()).expect("parameters that fit");
    let wide = halfarrow_exec::WideModel::new(&model);
    // The code of the sixteen lanes is that of the model.
    assert!(Arc::ptr_eq(model.compiled(), &compiled));
    assert!(Arc::strong_count(&compiled) >= 2 + halfarrow_sim::wide::LANES);
    drop(wide);
    assert_eq!(Arc::strong_count(&compiled), 2);
}
