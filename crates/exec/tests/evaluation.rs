//! Rates, solve blocks and their failures: known values.

use crate::common;
use halfarrow_compiler::sparse::SparseMatrix;

use common::Sketch;
use halfarrow_compiler::algebra::{Expr, Function};
use halfarrow_compiler::equations::{EquationStep, LinearBlock, NewtonBlock};
use halfarrow_compiler::program::schedule;
use halfarrow_exec::Model;
use halfarrow_sim::{Affected, Events as _, Failure, System};

fn rates(model: &mut Model, t: f64, x: &[f64]) -> Vec<f64> {
    let mut dx = vec![0.0; x.len()];
    model.rates(t, x, &mut dx).unwrap();
    dx
}

#[test]
fn parameters_given_by_others_follow() {
    let mut s = Sketch::default();
    let two = s.number(2.0);
    let half = s.parameter("half", two); // overwritten below by its dependence on `whole`
    let three = s.number(3.0);
    let whole = s.parameter("whole", three);
    let sum = s.x.add(&[half, whole]);
    let both = s.parameter("both", sum);
    let x = s.state("x");
    let product = s.x.mul(&[both, x]);
    let rate = s.x.neg(product);
    s.rate("x", rate);
    let mut model = s.model();
    assert_eq!(rates(&mut model, 0.0, &[1.0]), [-5.0]);
    model.set_parameter("whole", 10.0).unwrap();
    assert_eq!((rates(&mut model, 0.0, &[1.0])[0], model.parameter("both")), (-12.0, Some(12.0)));
    model.set_parameter("both", 1.0).unwrap();
    assert_eq!(rates(&mut model, 0.0, &[1.0]), [-1.0]);
    assert!(model.set_parameter("nothing", 1.0).unwrap_err().to_string().contains("no parameter `nothing`"));
}

/// `k/x + x²/2 - sqrt(x) + x^1.5 + x^-2` at 4 with k = 3.
#[test]
fn powers_and_quotients() {
    let mut s = Sketch::default();
    let three = s.number(3.0);
    let k = s.parameter("k", three);
    let x = s.state("x");
    let quotient = s.x.div(k, x);
    let square = s.x.powi(x, 2);
    let half = s.x.ratio(1, 2);
    let halved = s.x.mul(&[half, square]);
    let root = s.x.sqrt(x);
    let minus = s.x.neg(root);
    let exponent = s.x.ratio(3, 2);
    let mixed = s.x.pow(x, exponent);
    let inverse = s.x.powi(x, -2);
    let rate = s.x.add(&[quotient, halved, minus, mixed, inverse]);
    s.rate("x", rate);
    let mut model = s.model();
    assert_eq!(rates(&mut model, 0.0, &[4.0]), [0.75 + 8.0 - 2.0 + 8.0 + 0.0625]);
    let mut jv = [0.0];
    model.directional_derivative(0.0, &[4.0], &[1.0], &mut jv).unwrap();
    let exact = -3.0 / 16.0 + 4.0 - 0.25 + 3.0 - 2.0 / 64.0;
    assert!((jv[0] - exact).abs() < 1e-15, "{} {exact}", jv[0]);
}

fn linear(singular: bool) -> Model {
    let mut s = Sketch::default();
    let (a, b) = (s.state("a"), s.state("b"));
    let (u, ue) = s.symbol("u");
    let (v, ve) = s.symbol("v");
    let three = s.number(3.0);
    let other = if singular { s.x.mul(&[three, a]) } else { b };
    let elements = vec![s.element("R1"), s.element("R2")];
    // a u + 3 v = 1; b u + 9 v = 2 with b = 3 a is singular.
    let (one, two, nine) = (s.number(1.0), s.number(2.0), s.number(9.0));
    s.step(
        LinearBlock {
            unknowns: vec![u, v],
            matrix: SparseMatrix::full(vec![vec![a, three], vec![other, nine]]),
            right: vec![one, two],
            elements,
        }
        .into(),
    );
    s.rate("a", ue);
    s.rate("b", ve);
    s.model()
}

#[test]
fn a_linear_block_is_solved_and_differentiated() {
    let mut model = linear(false);
    // With a = 2, b = 1: 2u + 3v = 1, u + 9v = 2.
    let x = [2.0, 1.0];
    let dx = rates(&mut model, 0.0, &x);
    assert!((dx[0] - 0.2).abs() < 1e-15 && (dx[1] - 0.2).abs() < 1e-15, "{dx:?}");
    // Derivative by a: A [u' v'] = -[u 0], so u' = -9u/15, v' = u/15.
    let mut jv = [0.0; 2];
    model.directional_derivative(0.0, &x, &[1.0, 0.0], &mut jv).unwrap();
    assert!((jv[0] + 0.12).abs() < 1e-15 && (jv[1] - 0.2 / 15.0).abs() < 1e-15, "{jv:?}");
}

#[test]
fn a_singular_block_names_its_elements() {
    let failure = linear(true).rates(0.5, &[2.0, 0.0], &mut [0.0; 2]).unwrap_err();
    assert_eq!(failure, Failure::Singular { time: 0.5, what: "R1, R2".into() });
}

/// A voltage `x` over a resistor and a diode in series: `x = r i + e`, `i = is (exp(e/vt) - 1)`; the unknown is `e`.
/// If `reverse`, a current `x` is forced through the diode instead: below `-is` there is no voltage.
fn diode(reverse: bool) -> Sketch {
    let mut s = Sketch::default();
    let x = s.state("x");
    let (e, ee) = s.symbol("e");
    let (i, ie) = s.symbol("i");
    let (is, vt, r) = (s.number(1e-12), s.number(0.026), s.number(100.0));
    let ratio = s.x.div(ee, vt);
    let exp = s.call(Function::Exp, ratio);
    let one = s.number(1.0);
    let less = s.x.sub(exp, one);
    let current = s.x.mul(&[is, less]);
    let residual = if reverse {
        s.x.sub(ie, x)
    } else {
        let drop = s.x.mul(&[r, ie]);
        let sum = s.x.add(&[drop, ee]);
        s.x.sub(sum, x)
    };
    let elements = vec![s.element("D1")];
    s.step(NewtonBlock { unknowns: vec![e], body: vec![(i, current)], residuals: vec![residual], elements }.into());
    s.rate("x", ie);
    s.observe("e", ee);
    s
}

#[test]
fn a_diode_is_solved_to_rounding_from_nothing() {
    let mut model = diode(false).model();
    for x in [-50.0, 0.0, 0.3, 5.0, 300.0] {
        let i = rates(&mut model, 0.0, &[x])[0];
        let e = x - 100.0 * i;
        let exact = 1e-12 * (halfarrow_exec::math::call(Function::Exp, e / 0.026) - 1.0);
        assert!((i - exact).abs() <= 1e-11 * exact.abs() + 1e-16, "{x}: {i} {exact}");
        let mut jv = [0.0];
        model.directional_derivative(0.0, &[x], &[1.0], &mut jv).unwrap();
        let slope = (i + 1e-12) / 0.026;
        assert!((jv[0] - slope / (1.0 + 100.0 * slope)).abs() <= 1e-9 * jv[0].abs() + 1e-18, "{x}: {}", jv[0]);
    }
}

#[test]
fn a_law_without_a_solution_says_so() {
    let mut model = diode(true).model();
    assert!((rates(&mut model, 0.0, &[1e-3])[0] - 1e-3).abs() < 1e-18);
    let failure = model.rates(0.25, &[-2e-12], &mut [0.0]).unwrap_err();
    assert!(matches!(&failure, Failure::OutOfDomain { time: 0.25, what, .. } if what == "D1"), "{failure:?}");
    assert!(failure.to_string().contains("no value of e solves its equation"), "{failure}");
}

/// `y² = x` has two roots: the one found belongs to the branch accepted before, whatever was tried in between.
#[test]
fn only_accepted_steps_move_the_starting_point() {
    let mut s = Sketch::default();
    let x = s.state("x");
    let (y, ye) = s.symbol("y");
    let square = s.x.powi(ye, 2);
    let residual = s.x.sub(square, x);
    let elements = vec![s.element("R1")];
    s.step(NewtonBlock { unknowns: vec![y], body: vec![], residuals: vec![residual], elements }.into());
    s.rate("x", ye);
    let mut model = s.model();
    let first = rates(&mut model, 0.0, &[4.0])[0];
    assert!((first.abs() - 2.0).abs() < 1e-15);
    let far = rates(&mut model, 0.0, &[1e6])[0];
    assert_eq!(rates(&mut model, 0.0, &[4.0])[0].to_bits(), first.to_bits(), "a trial far away leaves no trace");
    model.accept(0.0, &[4.0]).unwrap();
    assert!((rates(&mut model, 0.0, &[9.0])[0] - first.signum() * 3.0).abs() < 1e-15);
    assert!((far.abs() - 1e3).abs() < 1e-12);
}

#[test]
fn a_cubic_law_at_rest_is_solved() {
    // x = 2 f + 3 f³ at x = 0 and elsewhere; and a bare cube, whose slope vanishes at the solution.
    for (linear, x, exact) in [(2.0, 0.0, 0.0), (2.0, 5.0, 1.0), (0.0, 24.0, 2.0), (0.0, 0.0, 0.0)] {
        let mut s = Sketch::default();
        let state = s.state("x");
        let (f, fe) = s.symbol("f");
        let (two, three) = (s.number(linear), s.number(3.0));
        let cube = s.x.powi(fe, 3);
        let terms = [s.x.mul(&[two, fe]), s.x.mul(&[three, cube])];
        let sum = s.x.add(&terms);
        let residual = s.x.sub(sum, state);
        s.step(NewtonBlock { unknowns: vec![f], body: vec![], residuals: vec![residual], elements: vec![] }.into());
        s.rate("x", fe);
        let f = rates(&mut s.model(), 0.0, &[x])[0];
        assert!((f - exact).abs() < 1e-15, "{linear} {x}: {f}");
    }
}

#[test]
fn a_divisor_that_vanishes_stops_the_run() {
    let mut s = Sketch::default();
    let x = s.state("x");
    let cos = s.call(Function::Cos, x);
    let one = s.number(1.0);
    let pivot = s.x.sub(cos, one);
    let rate = s.x.recip(pivot);
    let elements = vec![s.element("crank")];
    s.step(EquationStep::Guard { pivot, elements });
    s.rate("x", rate);
    let mut model = s.model();
    assert!(rates(&mut model, 0.0, &[1.0])[0] < 0.0);
    let failure = model.rates(2.0, &[0.0], &mut [0.0]).unwrap_err();
    let divisor = "cos(x) - 1".into();
    assert_eq!(failure, Failure::Vanished { time: 2.0, what: "crank".into(), divisor });
}

#[test]
fn a_rate_without_a_value_names_its_state() {
    let mut s = Sketch::default();
    let x = s.state("body.p");
    let log = s.call(Function::Log, x);
    s.rate("body.p", log);
    let failure = s.model().rates(1.0, &[-1.0], &mut [0.0]).unwrap_err();
    assert_eq!(failure, Failure::NotFinite { time: 1.0, what: Affected::Rate("body.p".into()) });
}

/// What only outputs need is not computed while integrating.
#[test]
fn reactions_are_left_out_of_the_rates() {
    let mut s = Sketch::default();
    let x = s.state("x");
    let (reaction, re) = s.symbol("reaction");
    let value = s.call(Function::Exp, x);
    s.step(EquationStep::Assign { symbol: reaction, value });
    let rate = s.x.neg(x);
    s.rate("x", rate);
    s.hidden("r", re);
    let program = schedule(&s.equations());
    let rate = program.routine(&[program.states[0].rate]);
    assert_eq!(rate.code.steps.len(), 1);
    let mut model = Model::new(program).unwrap();
    model.record(&["r"]).unwrap();
    let mut out = [0.0];
    model.observe(0.0, &[1.0], &mut out).unwrap();
    assert!((out[0] - std::f64::consts::E).abs() < 1e-15);
    assert!(model.record(&["q"]).unwrap_err().to_string().contains("no variable `q`"));
}

/// A ladder: each rate reads its neighbours, and registers are reused.
#[test]
fn a_ladder_is_sparse_and_small() {
    let n = 300;
    let mut s = Sketch::default();
    let states: Vec<Expr> = (0..n).map(|i| s.state(&format!("x{i}"))).collect();
    for i in 0..n {
        let mut terms = vec![s.x.mul(&[states[i], states[i]])];
        terms.extend((i > 0).then(|| states[i - 1]));
        terms.extend((i + 1 < n).then(|| states[i + 1]));
        let sum = s.x.add(&terms);
        s.rate(&format!("x{i}"), sum);
    }
    let model = s.model();
    assert_eq!(model.sparsity().nonzeros(), 3 * n - 2);
    assert_eq!(model.sparsity().column(5), [4, 5, 6]);
}

/// Prints how long a ladder of 10,000 sections takes to become a model: `cargo test --release -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn measure_a_long_ladder() {
    let n = 10_000;
    let mut s = Sketch::default();
    let one = s.number(1.0);
    let states: Vec<Expr> = (0..n).map(|i| s.state(&format!("x{i}"))).collect();
    let parameters: Vec<Expr> = (0..n).map(|i| s.parameter(&format!("r{i}"), one)).collect();
    let mut flows = Vec::new();
    for i in 0..n {
        let (flow, e) = s.symbol(&format!("f{i}"));
        let next = if i + 1 < n { states[i + 1] } else { one };
        let drop = s.x.sub(states[i], next);
        let value = s.x.div(drop, parameters[i]);
        s.step(EquationStep::Assign { symbol: flow, value });
        s.hidden(&format!("R{i}.f"), e);
        flows.push(e);
    }
    for i in 0..n {
        let before = if i > 0 { flows[i - 1] } else { one };
        let rate = s.x.sub(before, flows[i]);
        s.rate(&format!("x{i}"), rate);
        s.start(&format!("x{i}"), states[i], 1.0);
    }
    let equations = s.equations();
    let start = std::time::Instant::now();
    let program = schedule(&equations);
    let scheduled = start.elapsed();
    let mut model = Model::new(program).unwrap();
    let made = start.elapsed();
    let x = model.initialise(0.0).unwrap();
    let begun = start.elapsed();
    rates(&mut model, 0.0, &x);
    println!("scheduled {scheduled:?}, made {made:?}, begun {begun:?}");
}
