//! Jumps in time, switches of the state, inputs, delays and samples, run by the integrators.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use crate::common;

use common::Sketch;
use halfarrow_compiler::algebra::{Comparison, Function};
use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_exec::Model;
use halfarrow_sim::{Events, Method, Options, Sink, Summary, System, simulate};

struct Last(Rows);

impl Sink for Last {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.0.push((t, values.to_vec()));
    }
}

type Rows = Vec<(f64, Vec<f64>)>;

fn run(model: &mut Model, to: f64, rtol: f64) -> (Vec<f64>, Summary, Rows) {
    let mut x = model.initialise(0.0).unwrap();
    let mut sink = Last(Vec::new());
    let options = Options { to, rtol, method: Method::Explicit, ..Options::default() };
    let summary = simulate(model, &options, &mut x, &mut sink).unwrap();
    (x, summary, sink.0)
}

fn jumps(model: &mut Model, to: f64) -> Vec<f64> {
    let mut x = model.initialise(0.0).unwrap();
    let (mut t, mut found) = (0.0, Vec::new());
    model.handle_event(t, &mut x).unwrap();
    while let Some(next) = model.next_time_event(t).filter(|&next| next <= to) {
        assert!(next > t);
        found.push(next);
        t = next;
        model.handle_event(t, &mut x).unwrap();
    }
    found
}

#[test]
fn a_step_in_time_has_two_sides() {
    for relation in [Comparison::Lt, Comparison::Le] {
        let mut s = Sketch::default();
        s.state("x");
        let (border, a, b) = (s.number(0.3), s.number(1.0), s.number(-2.0));
        let t = s.t;
        let condition = s.x.compare(relation, t, border);
        let rate = s.x.select(condition, a, b);
        s.rate("x", rate);
        let mut model = s.model();
        let (mut x, mut dx) = (model.initialise(0.0).unwrap(), [0.0]);
        model.handle_event(0.0, &mut x).unwrap();
        assert_eq!(model.next_time_event(0.0), Some(0.3));
        model.rates(0.3, &x, &mut dx).unwrap();
        assert_eq!(dx, [1.0]);
        model.handle_event(0.3, &mut x).unwrap();
        model.rates(0.3, &x, &mut dx).unwrap();
        assert_eq!((dx, model.next_time_event(0.3)), ([-2.0], None));
        let (x, summary, _) = run(&mut model, 1.0, 1e-6);
        assert!((x[0] - (0.3 - 1.4)).abs() < 1e-15, "{x:?}");
        assert_eq!(summary.jumps, 1);
    }
}

/// Pulses: `if mod(t, 0.1) < 0.03 then 1 else 0`.
#[test]
fn pulses_jump_at_their_edges_to_the_last_bit() {
    let mut s = Sketch::default();
    s.state("x");
    let (period, on, one, zero) = (s.number(0.1), s.number(0.03), s.number(1.0), s.number(0.0));
    let t = s.t;
    let phase = s.x.call(Function::Mod, &[t, period]);
    let condition = s.less(phase, on);
    let rate = s.x.select(condition, one, zero);
    s.rate("x", rate);
    let mut model = s.model();
    let found = jumps(&mut model, 100.0);
    assert_eq!(found.len(), 2000);
    for (i, &t) in found.iter().enumerate() {
        let exact = 0.1 * i.div_ceil(2) as f64 + if i % 2 == 0 { 0.03 } else { 0.0 };
        assert!((t - exact).abs() <= 4.0 * f64::EPSILON * exact.max(1.0), "{i}: {t} {exact}");
    }
    let (x, ..) = run(&mut model, 2.0, 1e-6);
    assert!((x[0] - 0.6).abs() < 1e-13, "{x:?}");
}

/// A condition may read time itself: nothing is computed of it, and it runs all the same.
#[test]
fn whole_seconds_are_met() {
    let mut s = Sketch::default();
    s.state("x");
    let t = s.t;
    let rate = s.call(Function::Floor, t);
    s.rate("x", rate);
    let mut model = s.model();
    assert_eq!(jumps(&mut model, 3.5), [1.0, 2.0, 3.0]);
    let (x, ..) = run(&mut model, 3.5, 1e-6);
    assert!((x[0] - 4.5).abs() < 1e-13, "{x:?}");
}

/// A curve in time is searched: `if sin(5 t²) > 0.5`, narrower and narrower.
#[test]
fn changes_on_a_curve_are_found_in_order() {
    let mut s = Sketch::default();
    s.state("x");
    let square = s.x.powi(s.t, 2);
    let five = s.number(5.0);
    let angle = s.x.mul(&[five, square]);
    let sin = s.call(Function::Sin, angle);
    let half = s.number(0.5);
    let rate = s.x.compare(Comparison::Gt, sin, half);
    s.rate("x", rate);
    let found = jumps(&mut s.model(), 6.0);
    let pi = std::f64::consts::PI;
    let exact = (0..).flat_map(|k| [1.0 / 6.0, 5.0 / 6.0].map(|a| ((a + 2.0 * k as f64) * pi / 5.0).sqrt()));
    let exact: Vec<f64> = exact.take_while(|&t| t <= 6.0).collect();
    assert_eq!(found.len(), exact.len());
    found.iter().zip(&exact).for_each(|(t, e)| assert!((t - e).abs() < 1e-13, "{t} {e}"));
}

#[test]
fn an_input_bends_and_jumps_where_its_points_do() {
    let mut s = Sketch::default();
    s.state("x");
    let road = s.input("road", 7.0);
    s.rate("x", road);
    let mut model = s.model();
    assert!((run(&mut model, 1.0, 1e-6).0[0] - 7.0).abs() < 1e-14);
    model.connect("road", &[0.0, 1.0, 1.0, 2.0, 3.0], &[0.0, 1.0, 5.0, 5.0, 7.0]).unwrap();
    let (x, summary, samples) = run(&mut model, 4.0, 1e-6);
    assert!((x[0] - (0.5 + 5.0 + 6.0 + 7.0)).abs() < 1e-13, "{x:?}");
    assert_eq!((summary.jumps, summary.corners), (1, 2));
    assert_eq!(samples.iter().filter(|(t, _)| *t == 1.0).count(), 2);
    assert!(model.connect("rod", &[0.0], &[0.0]).is_err());
}

/// `x' = -sqrt(x)` while `x > 0`: `x = (1 - t/2)²`, empty at 2, where the root has no value beyond.
#[test]
fn a_tank_runs_empty() {
    let mut s = Sketch::default();
    let x = s.state("x");
    let root = s.x.sqrt(x);
    let zero = s.number(0.0);
    let out = s.x.neg(root);
    let condition = s.x.compare(Comparison::Gt, x, zero);
    let rate = s.x.select(condition, out, zero);
    s.rate("x", rate);
    s.start("x", x, 1.0);
    let mut model = s.model();
    assert_eq!(model.indicators(), 1);
    assert!((run(&mut model, 1.0, 1e-10).0[0] - 0.25).abs() < 1e-9);
    let (x, ..) = run(&mut model, 3.0, 1e-8);
    assert!(x[0].abs() < 1e-8, "{x:?}");
}

/// A body between two stops, `x'' = -k (x - 1)` beyond 1, `-k (x + 1)` beyond -1: the period is known.
#[test]
fn stops_are_met_by_switches() {
    let mut s = Sketch::default();
    let (x, v) = (s.state("x"), s.state("v"));
    let (one, minus, zero, k) = (s.number(1.0), s.number(-1.0), s.number(0.0), s.number(100.0));
    let (above, below) = (s.x.sub(x, one), s.x.add(&[x, one]));
    let high = s.x.call(Function::Max, &[above, zero]);
    let low = s.x.call(Function::Min, &[below, zero]);
    let sum = s.x.add(&[high, low]);
    let rate = s.x.mul(&[minus, k, sum]);
    s.rate("x", v);
    s.rate("v", rate);
    s.start("v", v, 1.0);
    let mut model = s.model();
    let period = 4.0 + 2.0 * std::f64::consts::PI / 10.0;
    let (x, summary, _) = run(&mut model, 3.0 * period, 1e-10);
    assert!(x[0].abs() < 1e-8 && (x[1] - 1.0).abs() < 1e-8, "{x:?}");
    assert_eq!(summary.crossings, 12);
}

/// `x' = -x(t - 1)`, 1 before the start: on [1, 2] `x = 1 - t + (t-1)²/2`.
#[test]
fn a_delay_gives_what_was() {
    let mut s = Sketch::default();
    let x = s.state("x");
    let late = s.held("late", HeldKind::Delay, x, 1.0);
    let rate = s.x.neg(late);
    s.rate("x", rate);
    s.start("x", x, 1.0);
    let mut model = s.model();
    let x = run(&mut model, 3.0, 1e-9).0[0];
    let t: f64 = 3.0;
    let exact = 1.0 - t + (t - 1.0).powi(2) / 2.0 - (t - 2.0).powi(3) / 6.0;
    assert!((x - exact).abs() < 1e-9, "{x} {exact}");
}

/// A jump of the source arrives later, exactly.
#[test]
fn a_delayed_jump_arrives_exactly() {
    let mut s = Sketch::default();
    s.state("x");
    let (border, one, zero) = (s.number(0.25), s.number(1.0), s.number(0.0));
    let t = s.t;
    let condition = s.less(t, border);
    let step = s.x.select(condition, zero, one);
    let late = s.held("late", HeldKind::Delay, step, 0.1);
    s.rate("x", late);
    let mut model = s.model();
    let x = run(&mut model, 1.0, 1e-6).0[0];
    assert!((x - 0.65).abs() < 1e-14, "{x}");
}

/// `x' = -sample(x, T)`: `x` is multiplied by `1 - T` at each sample.
#[test]
fn samples_are_held_between_multiples_of_the_period() {
    let mut s = Sketch::default();
    let x = s.state("x");
    let held = s.held("held", HeldKind::Sample, x, 0.1);
    let rate = s.x.neg(held);
    s.rate("x", rate);
    s.start("x", x, 1.0);
    let (x, summary, _) = run(&mut s.model(), 1.0, 1e-9);
    assert!((x[0] - 0.9f64.powi(10)).abs() < 1e-14, "{x:?}");
    assert!(summary.jumps >= 9);
}
