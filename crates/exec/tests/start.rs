//! Start values and equilibria.

use crate::common;

use common::Sketch;
use halfarrow_compiler::algebra::{Expr, Function};
use halfarrow_exec::{EquilibriumError, StartError};

/// Two inertias of 2 and 3 kg through a lever of 2: `v2 = 2 v1`; the states are `v1` and a free `q`.
fn lever() -> (Sketch, Expr, Expr, Expr) {
    let mut s = Sketch::default();
    let (v1, q) = (s.state("I1.f"), s.state("C.q"));
    let two = s.number(2.0);
    let v2 = s.x.mul(&[two, v1]);
    s.observe("I2.f", v2);
    s.rate("I1.f", q);
    s.rate("C.q", v1);
    (s, v1, v2, q)
}

#[test]
fn a_dependent_start_value_determines_the_independent_one() {
    let (mut s, _, v2, _) = lever();
    s.start("I2.f", v2, 3.0);
    assert_eq!(s.model().initialise(0.0), Ok(vec![1.5, 0.0]));
}

#[test]
fn start_values_that_say_the_same_are_fine() {
    let (mut s, v1, v2, _) = lever();
    s.start("I1.f", v1, 0.1);
    s.start("I2.f", v2, 0.2);
    assert_eq!(s.model().initialise(0.0).unwrap()[0], 0.1);
}

#[test]
fn contradicting_start_values_are_all_named_and_fitting_ones_offered() {
    let (mut s, v1, v2, q) = lever();
    s.start("I1.f", v1, 1.0);
    s.start("C.q", q, 5.0);
    s.start("I2.f", v2, 3.0);
    let Err(StartError::Conflict(conflict)) = s.model().initialise(0.0) else { panic!("no conflict") };
    let names: Vec<&str> = conflict.values.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["I1.f", "I2.f"]);
    let [a, b] = &conflict.values[..] else { panic!() };
    assert_eq!((a.asked, b.asked), (1.0, 3.0));
    assert!((2.0 * a.fitting - b.fitting).abs() < 1e-12, "{conflict:?}");
    assert!(a.fitting > 1.0 && a.fitting < 1.5 && b.fitting < 3.0);
}

#[test]
fn remaining_freedom_is_as_near_to_zero_as_it_may_be() {
    let mut s = Sketch::default();
    let (a, b, c) = (s.state("a"), s.state("b"), s.state("c"));
    let sum = s.x.add(&[a, b]);
    s.start("sum", sum, 3.0);
    [("a", b), ("b", c), ("c", a)].into_iter().for_each(|(name, rate)| s.rate(name, rate));
    let x = s.model().initialise(0.0).unwrap();
    assert!((x[0] - 1.5).abs() < 1e-14 && (x[1] - 1.5).abs() < 1e-14 && x[2] == 0.0, "{x:?}");
}

/// A crank: the start gives the height `sin(phi) = 0.5` and the speed of the tip, `cos(phi) w = 2`.
#[test]
fn curved_start_values_are_solved() {
    let mut s = Sketch::default();
    let (phi, w) = (s.state("phi"), s.state("w"));
    let (sin, cos) = (s.call(Function::Sin, phi), s.call(Function::Cos, phi));
    let speed = s.x.mul(&[cos, w]);
    s.start("tip.f", speed, 2.0);
    s.start("height", sin, 0.5);
    s.rate("phi", w);
    s.rate("w", phi);
    let x = s.model().initialise(0.0).unwrap();
    let exact = [std::f64::consts::PI / 6.0, 4.0 / 3.0f64.sqrt()];
    assert!(x.iter().zip(exact).all(|(x, e)| (x - e).abs() < 1e-14), "{x:?}");
}

#[test]
fn a_height_out_of_reach_is_refused() {
    let mut s = Sketch::default();
    let phi = s.state("phi");
    let sin = s.call(Function::Sin, phi);
    s.start("height", sin, 1.5);
    s.rate("phi", phi);
    assert!(s.model().initialise(0.0).is_err());
}

#[test]
fn conserved_constants_are_fixed_by_the_start() {
    let mut s = Sketch::default();
    let q = s.state("q1");
    let total = s.conserved("total");
    let other = s.x.sub(total, q);
    s.observe("q2", other);
    s.rate("q1", other);
    s.start("q1", q, 1.0);
    s.start("q2", other, 4.0);
    let mut model = s.model();
    assert_eq!(model.initialise(0.0), Ok(vec![1.0]));
    let (mut out, x) = ([0.0; 2], [1.0]);
    halfarrow_sim::Events::observe(&mut model, 0.0, &x, &mut out).unwrap();
    assert_eq!(out, [1.0, 4.0]);
}

#[test]
fn many_direct_start_values_take_linear_time() {
    let n = 10_000;
    let mut s = Sketch::default();
    let states: Vec<Expr> = (0..n).map(|i| s.state(&format!("x{i}"))).collect();
    for (i, &x) in states.iter().enumerate() {
        s.rate(&format!("x{i}"), x);
        s.start(&format!("x{i}"), x, i as f64);
    }
    let x = s.model().initialise(0.0).unwrap();
    assert!(x.iter().enumerate().all(|(i, &x)| x == i as f64));
}

/// `phi'' = -sin(phi) - 0.1 w + torque`.
fn pendulum(torque: f64, start: f64) -> Sketch {
    let mut s = Sketch::default();
    let (phi, w) = (s.state("phi"), s.state("w"));
    let sin = s.call(Function::Sin, phi);
    let (damping, torque, minus) = (s.number(-0.1), s.number(torque), s.number(-1.0));
    let terms = [s.x.mul(&[minus, sin]), s.x.mul(&[damping, w]), torque];
    let rate = s.x.add(&terms);
    s.rate("phi", w);
    s.rate("w", rate);
    s.start("phi", phi, start);
    s
}

#[test]
fn a_pendulum_comes_to_rest() {
    let mut model = pendulum(0.5, 0.2).model();
    let x = model.initialise(0.0).unwrap();
    let rest = model.equilibrium(0.0, &x).unwrap();
    assert!((rest.x[0] - std::f64::consts::PI / 6.0).abs() < 1e-14 && rest.x[1] == 0.0, "{rest:?}");
    assert_eq!(rest.free, 0);
}

#[test]
fn too_great_a_torque_leaves_no_rest() {
    let mut model = pendulum(1.5, 0.2).model();
    let x = model.initialise(0.0).unwrap();
    let Err(EquilibriumError::None(rates)) = model.equilibrium(0.0, &x) else { panic!() };
    assert!(!rates.is_empty());
}

#[test]
fn a_falling_body_has_no_equilibrium() {
    let mut s = Sketch::default();
    let v = s.state("v");
    let g = s.number(-9.81);
    s.rate("v", g);
    s.start("v", v, 1.0);
    let mut model = s.model();
    assert_eq!(model.equilibrium(0.0, &[1.0]), Err(EquilibriumError::None(vec![("v".into(), -9.81)])));
}

/// Two tanks, joined: any level is at rest, and the nearest is the mean.
#[test]
fn on_a_line_of_equilibria_the_nearest_is_taken() {
    let mut s = Sketch::default();
    let (a, b) = (s.state("a"), s.state("b"));
    let (flow, back) = (s.x.sub(b, a), s.x.sub(a, b));
    s.rate("a", flow);
    s.rate("b", back);
    let mut model = s.model();
    let rest = model.equilibrium(0.0, &[1.0, 4.0]).unwrap();
    assert!((rest.x[0] - 2.5).abs() < 1e-14 && (rest.x[1] - 2.5).abs() < 1e-14);
    assert_eq!(rest.free, 1);
}

/// `x' = x³ - 3 x + 3`: between the start and the only equilibrium, at -2.1, the rate has a minimum of 1 and a maximum
/// of 5, and the motion runs away from it.
#[test]
fn an_equilibrium_behind_two_folds_is_reached_by_taking_the_loads_away() {
    let mut s = Sketch::default();
    let x = s.state("x");
    let (three, minus) = (s.number(3.0), s.number(-3.0));
    let terms = [s.x.mul(&[x, x, x]), s.x.mul(&[minus, x]), three];
    let rate = s.x.add(&terms);
    s.rate("x", rate);
    s.start("x", x, 1.5);
    let mut model = s.model();
    let start = model.initialise(0.0).unwrap();
    let rest = model.equilibrium(0.0, &start).unwrap();
    let x = rest.x[0];
    assert!((-2.11..-2.10).contains(&x) && (x * x * x - 3.0 * x + 3.0).abs() < 1e-13, "{rest:?}");
}
