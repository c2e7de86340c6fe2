//! Closed loops: positions that follow from others, and runs past positions where one set of variables does not do.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::fs;
use std::path::Path;

use halfarrow::{Error, Failure, FixedMethod, Form, Method, Model, Record, Reduce, Run, Simulated, Sweep, Vary};

fn model(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn run(text: &str, run: &Run) -> Simulated {
    let run = Run { record: Record::All, ..run.clone() };
    model(text).simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    let found = done.trace.columns.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("nothing called {name}")).values
}

fn last(done: &Simulated, name: &str) -> f64 {
    *column(done, name).last().expect("there are samples")
}

fn greatest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, v| v.abs().max(most))
}

/// The names of the states of the minimal form.
fn states(text: &str) -> Vec<String> {
    let report = model(text).equations(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    report.states.into_iter().map(|s| s.name).collect()
}

const OVER: &str = "model Over
param m = 1 kg, g = 9.81 m/s2
1:u -> I:mx(m, f0 = 7)
Se:w(-m*g) -> 1:v -> I:my(m)
state x' = u.f from 0
state y' = v.f from -1
constraint rod: x^2 + y^2 - 1 = 0
output E = 0.5*m*(u.f^2 + v.f^2) + m*g*y : J
";

/// The same pendulum by its angle.
const ANGLE: &str = "model Angle
state phi' = w.f from 0
1:w -> I:J(1, f0 = 7)
Se:weight(-9.81*sin(phi)) -> w
";

/// Neither `x` nor `y` tells the motion everywhere: each takes over from the other, whatever the method.
#[test]
fn a_pendulum_by_x_and_y_alone_turns_over() {
    assert_eq!(states(OVER), ["mx.f", "x"]);
    let exact = Run { to: 5.0, rtol: 1e-12, every: Some(0.1), ..Run::default() };
    let angle = run(ANGLE, &exact);
    let turns = last(&angle, "phi") / std::f64::consts::TAU;
    assert!(turns > 3.0, "{turns}");
    for (method, step, error) in [
        (Method::Explicit, None, 1e-9),
        (Method::Bdf, None, 1e-7),
        (Method::Radau, None, 1e-7),
        (Method::Fixed(FixedMethod::Rk4), Some(1e-4), 1e-8),
    ] {
        let over = run(OVER, &Run { method, step, ..exact.clone() });
        assert!(over.report.exchanges > 10, "{method:?}: {}", over.report.exchanges);
        for (k, phi) in column(&angle, "phi").iter().enumerate() {
            let (x, y) = (column(&over, "x")[k], column(&over, "y")[k]);
            assert!((x - phi.sin()).abs() < error && (y + phi.cos()).abs() < error, "{method:?} {k}: {x} {y} {phi}");
            // The rod carries the weight and turns the motion: with its gradient 2 x, 2 y.
            let speed = column(&angle, "J.f")[k];
            let wanted = -0.5 * (speed * speed + 9.81 * phi.cos());
            let force = column(&over, "rod.e")[k];
            assert!((force - wanted).abs() < 1e3 * error, "{method:?} {k}: {force} {wanted}");
        }
        assert!(greatest(column(&over, "rod.drift")) < 1e-14, "{method:?}");
    }
}

const SLIDER: &str = "model Slider
param r = 0.1 m, l = 0.3 m, speed = 100 rad/s
state theta' = w.f from 0.3 rad
state x' = slide.f
guess x = 0.4 m
";

/// A thousand turns past both dead centres: no drift.
#[test]
fn a_driven_slider_crank_keeps_its_rod() {
    let text = format!(
        "{SLIDER}Sf:drive(speed) -> 1:w\n1:slide -> I:slider(0.5 kg)\nconstraint rod: (x - r*cos(theta))^2 + (r*sin(theta))^2 - l^2 = 0\n"
    );
    let turns = 1000.0 * std::f64::consts::TAU / 100.0;
    let done = run(&text, &Run { to: turns, rtol: 1e-8, every: Some(turns / 1999.0), ..Run::default() });
    for (theta, x) in column(&done, "theta").iter().zip(column(&done, "x")) {
        let wanted = 0.1 * theta.cos() + (0.09 - 0.01 * theta.sin() * theta.sin()).sqrt();
        assert!((x - wanted).abs() < 1e-14, "{theta}: {x} {wanted}");
    }
}

/// A free one without friction keeps its energy through its turns.
#[test]
fn a_free_slider_crank_keeps_its_energy() {
    let text = format!(
        "{SLIDER}1:w -> I:crank(0.002 kg.m2, f0 = 30 rad/s)\n1:slide -> I:slider(0.5 kg)\nconstraint rod: (x - r*cos(theta))^2 + (r*sin(theta))^2 - l^2 = 0\noutput E = 0.001*w.f^2 + 0.25*slide.f^2\n"
    );
    assert_eq!(states(&text), ["crank.f", "theta"]);
    let done = run(&text, &Run { to: 10.0, rtol: 1e-12, every: Some(0.01), ..Run::default() });
    let energy = column(&done, "E");
    assert!(last(&done, "theta") > 100.0, "it turns");
    let drift = energy.iter().map(|e| (e / energy[0] - 1.0).abs()).fold(0.0, f64::max);
    assert!(drift < 1e-9, "{drift}");
}

const ROCKERS: &str = "model Rockers
param a = 0.4 m, b = 0.2 m, c = 0.4 m, d = 0.5 m
state th1' = crank.f from 1.2 rad
state th2' = coupler.f
state th3' = rocker.f
1:crank -> I:I1(0.01 kg.m2, f0 = 6)
1:coupler -> I:I2(0.002 kg.m2)
1:rocker -> I:I3(0.01 kg.m2)
constraint along: a*cos(th1) + b*cos(th2) = d + c*cos(th3)
constraint across: a*sin(th1) + b*sin(th2) = c*sin(th3)
guess th2 = 0.5 rad, th3 = 1.5 rad
output E = 0.005*crank.f^2 + 0.001*coupler.f^2 + 0.005*rocker.f^2 : J
";

/// The coupler alone turns over: by its angle the motion is regular everywhere, by that of the crank it ends at the limits.
#[test]
fn a_double_rocker_passes_the_limits_of_its_cranks() {
    let exact = Run { to: 5.0, rtol: 1e-12, every: Some(0.05), ..Run::default() };
    let wanted = run(&format!("{ROCKERS}prefer coupler.f\n"), &exact);
    assert_eq!(wanted.report.exchanges, 0);
    let done = run(ROCKERS, &exact);
    assert!(done.report.exchanges > 20, "{}", done.report.exchanges);
    assert!(last(&done, "th2").abs() > 8.0 * std::f64::consts::TAU, "it turns over");
    for name in ["th1", "th2", "th3", "crank.f", "rocker.f"] {
        for (k, (a, b)) in column(&done, name).iter().zip(column(&wanted, name)).enumerate() {
            assert!((a - b).abs() < 1e-6 * (1.0 + b.abs()), "{name} {k}: {a} {b}");
        }
    }
    let energy = column(&done, "E");
    let drift = energy.iter().map(|e| (e / energy[0] - 1.0).abs()).fold(0.0, f64::max);
    assert!(drift < 1e-9, "{drift}");
    for drift in ["along.drift", "across.drift"] {
        assert!(greatest(column(&done, drift)) < 1e-13, "{drift}");
    }
}

const PARALLELOGRAM: &str = "model Parallelogram
param a = 0.2 m, d = 0.5 m
state th1' = c1.f from 0.7 rad
state th2' = c2.f from 0.7 rad
state ph' = bar.f from 0 rad
1:c1 -> I:I1(0.01 kg.m2, f0 = 3)
1:c2 -> I:I2(0.01 kg.m2)
1:bar -> I:Ib(0.02 kg.m2)
constraint x12: a*cos(th1) + d*cos(ph) = d + a*cos(th2)
constraint y12: a*sin(th1) + d*sin(ph) = a*sin(th2)
";

const THIRD_CRANK: &str = "state th3' = c3.f from 0.7 rad
1:c3 -> I:I3(0.01 kg.m2)
constraint x13: a*cos(th1) + 0.5*d*cos(ph) = 0.5*d + a*cos(th3)
constraint y13: a*sin(th1) + 0.5*d*sin(ph) = a*sin(th3)
";

/// The bar stays level and the cranks turn as one, through flat positions, where it could as well begin to swing; a crank
/// more changes nothing but the inertia, though its constraints are two and one motion is left.
#[test]
fn a_parallelogram_passes_its_flat_positions() {
    let driven = "c1 -> R:drag(0.001)\nSe:push(0.02*sin(t)) -> c1\n";
    for (text, cranks) in [(PARALLELOGRAM.to_string(), 2), (format!("{PARALLELOGRAM}{THIRD_CRANK}"), 3)] {
        let text = format!("{text}{driven}");
        let warned = model(&text).check().unwrap_or_else(|e| panic!("{}", e.render(false)));
        let said = warned.render(false);
        assert_eq!(said.contains("C004"), cranks == 3, "{said}");
        assert_eq!(said.contains("kept by the others wherever the machine can be"), cranks == 3, "{said}");
        let exact = Run { to: 20.0, rtol: 1e-11, every: Some(0.0971), ..Run::default() };
        let inertia = 0.01 * f64::from(cranks);
        let one = format!("model One\nstate th1' = c1.f from 0.7\n1:c1 -> I:I1({inertia}, f0 = 3)\n{driven}");
        let wanted = run(&one, &exact);
        // Of a third crank the rates are rounding where its angle vanishes, beside a tighter tolerance of the multistep method.
        let multistep = if cranks == 3 { (Method::Bdf, 1e-9, 1e-5) } else { (Method::Bdf, 1e-11, 1e-6) };
        for (method, rtol, error) in [(Method::Explicit, 1e-11, 1e-7), multistep] {
            let done = run(&text, &Run { method, rtol, ..exact.clone() });
            for (k, wanted) in column(&wanted, "th1").iter().enumerate() {
                for crank in ["th1", "th2", "th3"].into_iter().take(cranks as usize) {
                    let th = column(&done, crank)[k];
                    assert!((th - wanted).abs() < error, "{cranks} {method:?} {crank} {k}: {th} {wanted}");
                }
                assert!(column(&done, "ph")[k].abs() < error, "{cranks} {method:?} {k}");
            }
        }
    }
}

/// A machine that its constraints hold fast is told so: they are not taken for repetitions.
#[test]
fn what_cannot_move_is_not_taken_for_repetition() {
    let text = format!("{PARALLELOGRAM}{}", THIRD_CRANK.replace("0.5*d", "0.4*d + 0.01"));
    let said = model(&text).simulate(&Run { to: 1.0, ..Run::default() }, &mut |_| true);
    let said = said.err().map(|e| e.render(false)).expect("it cannot be assembled and move");
    assert!(said.contains("error"), "{said}");
}

/// Where an input says the position, the motion asks for no derivative of the input; what takes one is not there, and says
/// so.
#[test]
fn a_position_given_by_an_input_moves_others_without_its_rate() {
    let text = "model Led
input z = 0.1
state x' = u.f
state y' = v.f from 0.2
1:u -> I:a(2)
1:v -> I:b(2)
Se:pull(3*(x - y)) -> v
constraint led: x = z
";
    assert_eq!(states(text), ["b.f", "y"]);
    let wanted = Run { to: 3.0, rtol: 1e-10, every: Some(0.1), ..Run::default() };
    let done = run(text, &wanted);
    for (t, y) in done.trace.times.iter().zip(column(&done, "y")) {
        assert!((y - 0.1 - 0.1 * (1.5f64.sqrt() * t).cos()).abs() < 1e-9, "{t}: {y}");
    }
    let asked = Run { record: Record::Names(vec!["a.e".into()]), ..wanted };
    let refused = model(text).simulate(&asked, &mut |_| true).expect_err("nobody gives the rate");
    assert!(refused.render(false).contains("time derivative of the input z"), "{}", refused.render(false));
}

/// A motor that drives a crank longer than its rod: the machine locks where the rod stands upright, and the run says so
/// there, whatever the method.
#[test]
fn a_machine_that_is_driven_past_its_limit_stops_there() {
    let text = "model Locks
param r = 0.5, l = 0.3
state th' = w.f from 0
state ph' = rod.f from 0
state x' = slide.f
guess x = 0.8
Sf:motor(10) -> 1:w
1:rod -> R:pin(0.1)
1:slide -> R:guide(1)
constraint along: x = r*cos(th) + l*cos(ph)
constraint across: r*sin(th) + l*sin(ph) = 0
";
    let limit = (0.3f64 / 0.5).asin() / 10.0;
    for (method, step, rtol) in [
        (Method::Auto, None, 1e-6),
        (Method::Explicit, None, 1e-9),
        (Method::Bdf, None, 1e-6),
        (Method::Radau, None, 1e-6),
        (Method::Fixed(FixedMethod::Rk4), Some(1e-4), 1e-6),
    ] {
        let wanted = Run { to: 5.0, method, step, rtol, record: Record::All, ..Run::default() };
        let stopped = match model(text).simulate(&wanted, &mut |_| true) {
            Err(halfarrow::Error::Run(stopped)) => stopped,
            Err(other) => panic!("{method:?}: {}", other.render(false)),
            Ok(_) => panic!("{method:?} runs on"),
        };
        assert!((stopped.report.reached - limit).abs() < 1e-3, "{method:?}: {}", stopped.report.reached);
    }
}

const ON_A_BASE: &str = "model OnABase
1:u -> I:mx(1, f0 = 7)
Se:w(-9.81) -> 1:v -> I:my(1)
state x' = u.f from 0
state y' = v.f
guess y = -1
constraint rod: (x - 0.2*t)^2 + y^2 = 1
output E = 0.5*((u.f - 0.2)^2 + v.f^2) + 9.81*y
";

const ON_A_CART: &str = "model OnACart
1:base -> I:mb(1)
1:u -> I:mx(1, f0 = 7)
Se:w(-9.81) -> 1:v -> I:my(1)
state b' = base.f from 0
state x' = u.f from 0
state y' = v.f
guess y = -1
constraint rod: (x - b)^2 + y^2 = 1
output E = 0.5*(base.f^2 + u.f^2 + v.f^2) + 9.81*y
";

/// The part of its greatest value by which an output leaves what it was at the start.
fn drift(done: &Simulated, name: &str) -> f64 {
    let values = column(done, name);
    values.iter().map(|v| (v - values[0]).abs()).fold(0.0, f64::max) / greatest(values)
}

/// A base that moves evenly changes nothing, a free cart moves along: the rod turns over for a hundred seconds, whichever
/// variables the modeller prefers. What is recorded decides nothing: momenta that are states at the start have values after
/// an exchange too.
#[test]
fn pendulums_on_moving_bases_turn_over() {
    let exact = Run { to: 100.0, rtol: 1e-11, every: Some(0.05), ..Run::default() };
    for (text, pivot) in [
        (ON_A_BASE.to_string(), None),
        (ON_A_CART.to_string(), Some("b")),
        (format!("{ON_A_CART}prefer v.f\n"), Some("b")),
        (format!("{ON_A_CART}prefer u.f\n"), Some("b")),
    ] {
        let done = run(&text, &exact);
        assert!(done.report.exchanges > 100, "{}\n{text}", done.report.exchanges);
        assert!(drift(&done, "E") < 1e-8, "{}\n{text}", drift(&done, "E"));
        let base = |k: usize| pivot.map_or(0.2 * done.trace.times[k], |b| column(&done, b)[k]);
        for (k, (x, y)) in column(&done, "x").iter().zip(column(&done, "y")).enumerate() {
            assert!(((x - base(k)).hypot(*y) - 1.0).abs() < 1e-13, "{k}");
        }
        let default = model(&text).simulate(&Run { record: Record::Default, ..exact.clone() }, &mut |_| true);
        let default = default.unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)));
        assert_eq!(column(&default, "y"), column(&done, "y"));
    }
    // The momentum of the start, as it is defined, in the variables that took over.
    let done = run(ON_A_BASE, &Run { to: 5.0, ..exact });
    for (k, pi) in column(&done, "mx.pi").iter().enumerate() {
        let (x, y) = (column(&done, "x")[k], column(&done, "y")[k]);
        let ratio = (0.2 * done.trace.times[k] - x) / y;
        let wanted = column(&done, "mx.p")[k] + ratio * column(&done, "my.p")[k];
        assert!((pi - wanted).abs() <= 1e-9 * (1.0 + ratio * ratio), "{k}: {pi} {wanted}");
    }
}

/// The same by every method: positions against a run that is exact.
#[test]
fn methods_agree_on_moving_bases() {
    for text in [ON_A_BASE, ON_A_CART] {
        let exact = Run { to: 3.0, rtol: 1e-12, every: Some(0.1), ..Run::default() };
        let wanted = run(text, &exact);
        for (method, step, error) in [
            (Method::Explicit, None, 1e-8),
            (Method::Bdf, None, 1e-6),
            (Method::Radau, None, 1e-6),
            (Method::Fixed(FixedMethod::Rk4), Some(1e-4), 1e-7),
            (Method::Fixed(FixedMethod::Heun), Some(1e-4), 1e-3),
            (Method::Fixed(FixedMethod::ImplicitMidpoint), Some(1e-4), 1e-3),
            (Method::Fixed(FixedMethod::Rosenbrock), Some(1e-4), 1e-5),
        ] {
            let done = run(text, &Run { method, step, ..exact.clone() });
            assert!(done.report.exchanges > 3, "{method:?}: {}", done.report.exchanges);
            for (a, b) in column(&done, "y").iter().zip(column(&wanted, "y")) {
                assert!((a - b).abs() < error, "{method:?}: {a} {b}\n{text}");
            }
        }
    }
}

/// What a free cart carries: a chain that turns over. Its level momentum is conserved; which states a constant could stand
/// for would change with the variables that are independent, so that it stays a sum of states.
#[test]
fn a_chain_on_a_cart_keeps_energy_and_momentum() {
    let done = run_of("cart_with_chain", &Run { to: 100.0, rtol: 1e-11, every: Some(0.1), ..Run::default() });
    assert!(done.report.exchanges > 500, "{}", done.report.exchanges);
    assert!(drift(&done, "E") < 2e-8, "{}", drift(&done, "E"));
    for k in 0..done.trace.times.len() {
        let momentum = column(&done, "Ib.p")[k] + column(&done, "Iu1.p")[k] + column(&done, "Iu2.p")[k];
        assert!((momentum / 23.04 - 1.0).abs() < 1e-9, "{momentum}");
    }
}

/// Each set of a sweep exchanges its variables where it has to: rows are those of runs alone, with fixed steps too.
#[test]
fn sweeps_of_pendulums_on_a_moving_base_turn_over() {
    let text = ON_A_BASE.replace("f0 = 7", "f0 = v0").replacen("1:u ->", "param v0 = 7\n1:u ->", 1);
    let folder = temp_dir::TempDir::new().expect("a folder");
    for (method, step) in [(Method::Auto, None), (Method::Fixed(FixedMethod::Rk4), Some(1e-3))] {
        let run = Run { to: 3.0, rtol: 1e-9, method, step, ..Run::default() };
        let sweep = Sweep {
            run: run.clone(),
            vary: vec![Vary::parse("v0=list(6,7,9)").expect("values")],
            samples: None,
            reduce: vec![Reduce::parse("final(y)").expect("a reduction")],
            restart: false,
            units: false,
            part: None,
        };
        let out = folder.path().join("rows.csv");
        let report =
            model(&text).sweep(&sweep, &out, &mut |_, _| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
        assert_eq!((report.sets, report.failed), (3, 0), "{method:?}");
        let rows = std::fs::read_to_string(&out).expect("rows");
        for row in rows.lines().skip(1) {
            let row: Vec<f64> = row.split(',').map(|f| f.parse().expect("a number")).collect();
            let alone = text.replace("v0 = 7", &format!("v0 = {}", row[1]));
            let alone = model(&alone).simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
            assert_eq!(row[2], last(&alone, "y"), "{method:?} {row:?}");
        }
        std::fs::remove_file(&out).expect("it is there");
    }
}

/// A base whose speed is an input: its rate is not known, so that momenta are states whatever variables are independent.
#[test]
fn a_pendulum_on_a_base_of_given_speed_turns_over() {
    let driven = "input speed = 0.2\nSf:drive(speed) -> 1:base\nstate b' = base.f from 0\n1:u ->";
    let text = ON_A_BASE.replace("0.2*t", "b").replacen("1:u ->", driven, 1);
    let done = run(&text, &Run { to: 20.0, rtol: 1e-11, every: Some(0.05), ..Run::default() });
    assert!(done.report.exchanges > 20, "{}", done.report.exchanges);
    assert!(drift(&done, "E") < 1e-8, "{}", drift(&done, "E"));
}

/// A run that has changed its independent variables leaves nothing behind: the next one, with other parameters too, begins as
/// if it were the first.
#[test]
fn a_model_runs_again_after_exchanges() {
    let wanted = Run { to: 2.0, record: Record::All, every: Some(0.1), ..Run::default() };
    let mut kept = model(OVER).compile(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let again = || kept.simulate(&wanted, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let (first, second) = (again(), again());
    assert!(first.report.exchanges > 2);
    assert_eq!(first.trace, second.trace);
    kept.set("m", 2.0).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let heavy = kept.simulate(&wanted, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert_eq!(heavy.trace, run(&OVER.replace("m = 1 kg", "m = 2 kg"), &wanted).trace);
}

/// Where others become independent all that is carried over is known, what follows from parameters alone too.
#[test]
fn what_parameters_determine_is_carried_over() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/exchanged_mode.bond");
    let text = fs::read_to_string(path).expect("the model is there");
    let done = run(&text, &Run { to: 0.3, rtol: 1e-12, every: Some(0.1), ..Run::default() });
    assert!(done.report.exchanges > 0);
}

/// Kites, antiparallelograms and a rod as long as its crank pass the positions through which another motion leads, by every
/// method and also where a step of fixed length ends close beside one: no energy is made or lost there. Efforts may be
/// rounding where a sample lies beside one; then the audit says so.
#[test]
fn no_step_leaps_into_another_motion() {
    let four_bar = |sides: [f64; 4], guess: [f64; 2]| {
        let [a, b, c, d] = sides;
        format!(
            "model Bars\n1:crank -> I:one(1, f0 = 10)\n1:coupler -> I:two(0.5)\n1:rocker -> I:three(0.7)\n\
             state th1' = crank.f from 0.6\nstate th2' = coupler.f\nstate th3' = rocker.f\n\
             constraint along: {a}*cos(th1) + {b}*cos(th2) = {d} + {c}*cos(th3)\n\
             constraint across: {a}*sin(th1) + {b}*sin(th2) = {c}*sin(th3)\n\
             guess th2 = {}, th3 = {}\n\
             output E = (one.p*one.f + two.p*two.f + three.p*three.f)/2\n",
            guess[0], guess[1]
        )
    };
    let slider = "model Slider\n1:crank -> I:wheel(1, f0 = 10)\n1:rod -> I:bar(0.5)\n1:piston -> I:mass(0.7)\n\
        state th' = crank.f from 0.6\nstate ph' = rod.f\nstate x' = piston.f\n\
        constraint along: 0.2*cos(th) + 0.2*cos(ph) = x\nconstraint across: 0.2*sin(th) = 0.2*sin(ph)\n\
        guess ph = 0.6, x = 0.3\noutput E = (wheel.p*wheel.f + bar.p*bar.f + mass.p*mass.f)/2\n";
    let models = [
        ("kite", four_bar([0.2, 0.2, 0.5, 0.5], [0.5, 1.5])),
        ("antiparallelogram", four_bar([0.2, 0.5, 0.2, 0.5], [-0.5, -1.5])),
        ("slider", slider.to_string()),
    ];
    let fixed = |method, step| Run { to: 10.0, method, step: Some(step), every: Some(0.1), ..Run::default() };
    let variable = |method, rtol| Run { to: 10.0, method, rtol, every: Some(0.1), ..Run::default() };
    for (name, text) in models {
        for (run_with, drift) in [
            (fixed(Method::Fixed(FixedMethod::Rk4), 1e-3), 1e-4),
            (fixed(Method::Fixed(FixedMethod::Rk4), 3e-3), 1e-4),
            (fixed(Method::Fixed(FixedMethod::Rk4), 1e-2), 1e-3),
            (fixed(Method::Fixed(FixedMethod::Heun), 1e-3), 2e-3),
            (variable(Method::Explicit, 1e-6), 1e-3),
            (variable(Method::Explicit, 1e-10), 1e-7),
            (variable(Method::Radau, 1e-7), 1e-4),
        ] {
            let run_with = Run { record: Record::All, ..run_with };
            let done = match model(&text).simulate(&run_with, &mut |_| true) {
                Ok(done) => done,
                Err(Error::Run(stopped)) if matches!(stopped.failure, Failure::Untrue { .. }) => continue,
                Err(error) => panic!("{name}: {}", error.render(false)),
            };
            let energy = column(&done, "E");
            let most = energy.iter().fold(0.0f64, |most, e| most.max((e / energy[0] - 1.0).abs()));
            assert!(most < drift, "{name} {:?} {:?} {:e}: {most:e}", run_with.method, run_with.step, run_with.rtol);
        }
    }
}

/// Where a source says how fast the crank turns no state depends on the positions behind it: they are followed all the same,
/// in steps short enough to see them.
#[test]
fn what_a_motor_of_given_speed_drives_stays_in_its_motion() {
    let flat = "model P\nSf:motor(6) -> 1:a\nstate th1' = a.f from 0.7\nstate th2' = b.f\nstate ph' = bar.f\n\
        1:b -> I:I2(0.01)\n1:bar -> I:Ib(0.02)\nguess th2 = 0.7\n\
        constraint x: 0.2*cos(th1) + 0.5*cos(ph) = 0.5 + 0.2*cos(th2)\n\
        constraint y: 0.2*sin(th1) + 0.5*sin(ph) = 0.2*sin(th2)\n";
    let rod = "model R\nSf:motor(10) -> 1:w\nstate th1' = w.f from 0.3\nstate x' = slide.f\n1:slide -> I:sl(0.5)\n\
        guess x = 0.4\nconstraint rod: (x - 0.2*cos(th1))^2 + (0.2*sin(th1))^2 = 0.04\n";
    for (method, rtol) in
        [(Method::Explicit, 1e-6), (Method::Explicit, 1e-9), (Method::Radau, 1e-4), (Method::Bdf, 1e-6)]
    {
        let every = Run { to: 3.0, method, rtol, every: Some(0.0371), ..Run::default() };
        let done = run(flat, &every);
        for (th1, th2) in column(&done, "th1").iter().zip(column(&done, "th2")) {
            assert!((th1 - th2).abs() < 1e-10, "{method:?} {rtol:e}: {th1} {th2}");
        }
        let done = run(rod, &every);
        for (th1, x) in column(&done, "th1").iter().zip(column(&done, "x")) {
            assert!((x - 0.4 * th1.cos()).abs() < 1e-10, "{method:?} {rtol:e}: {th1} {x}");
        }
    }
}

/// A model of `models/`, run with everything recorded.
fn run_of(name: &str, run: &Run) -> Simulated {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/linkages").join(name).join("model.bond");
    let run = Run { record: Record::All, ..run.clone() };
    let model = Model::load(&path, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
    model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// A line that is straight and a curve of the sixth degree, whatever the tolerance of the motion along them.
#[test]
fn linkages_draw_their_curves() {
    for rtol in [1e-4, 1e-8] {
        let wanted = Run { to: 20.0, rtol, every: Some(0.01), ..Run::default() };
        let line = run_of("peaucellier", &wanted);
        let (x, y) = (column(&line, "xq"), column(&line, "yq"));
        assert!(greatest(y) > 0.2, "it moves");
        let bend = x.iter().map(|x| (x - 0.8625).abs()).fold(0.0, f64::max);
        assert!(bend < 1e-14, "{rtol}: {bend}");
        // Q is the inverse of P, so that it stands on the ray through P.
        for (y, theta) in y.iter().zip(column(&line, "theta")) {
            assert!((y - 0.8625 * (0.5 * theta).tan()).abs() < 1e-13, "{rtol}: {y} {theta}");
        }
        let eight = run_of("watt_linkage", &wanted);
        let middle = greatest(column(&eight, "y"));
        assert!(middle > 0.1, "it moves: {middle}");
        let miss = greatest(column(&eight, "sextic"));
        assert!(miss < 1e-16, "{rtol}: {miss}");
    }
}

/// A crank-rocker of Grashof: the crank turns over, the rocker swings.
const CRANK_ROCKER: &str = "model CrankRocker
param a = 0.2 m, b = 0.5 m, c = 0.4 m, d = 0.55 m
state th1' = crank.f from 0.6 rad
state th2' = coupler.f
state th3' = rocker.f
guess th2 = 0.6 rad, th3 = 1.5 rad
1:crank -> I:I1(0.05 kg.m2, f0 = 20)
1:coupler -> I:I2(0.002 kg.m2)
1:rocker -> I:I3(0.01 kg.m2)
constraint along: a*cos(th1) + b*cos(th2) = d + c*cos(th3)
constraint across: a*sin(th1) + b*sin(th2) = c*sin(th3)
output E = 0.025*crank.f^2 + 0.001*coupler.f^2 + 0.005*rocker.f^2 : J
";

/// Angles of coupler and rocker from that of the crank: the joint between them is where two circles meet.
fn crank_rocker(th1: f64) -> (f64, f64) {
    let (a, b, c, d) = (0.2, 0.5, 0.4, 0.55);
    let (x, y) = (a * th1.cos(), a * th1.sin());
    let (dx, dy) = (d - x, -y);
    let square = dx * dx + dy * dy;
    let part = (square + b * b - c * c) / (2.0 * square);
    let high = (b * b / square - part * part).sqrt();
    let (jx, jy) = (x + part * dx - high * dy, y + part * dy + high * dx);
    ((jy - y).atan2(jx - x), jy.atan2(jx - d))
}

/// A thousand turns under a torque with drag, and a thousand free ones: positions stay those of the crank, energy its own.
#[test]
fn a_crank_rocker_turns_a_thousand_times() {
    let driven = format!("{CRANK_ROCKER}Se:motor(0.4) -> crank\ncrank -> R:drag(0.02)\n");
    for (text, rtol, free) in [(driven, 1e-8, false), (CRANK_ROCKER.to_string(), 1e-12, true)] {
        let done = run(&text, &Run { to: 330.0, rtol, every: Some(0.1571), ..Run::default() });
        assert!(last(&done, "th1") > 1000.0 * std::f64::consts::TAU, "{}", last(&done, "th1"));
        assert_eq!(done.report.exchanges, 0);
        let mut worst = 0.0f64;
        for (k, th1) in column(&done, "th1").iter().enumerate() {
            let (th2, th3) = crank_rocker(*th1);
            worst = worst.max((column(&done, "th2")[k] - th2).abs()).max((column(&done, "th3")[k] - th3).abs());
        }
        assert!(worst < 1e-10, "{worst}");
        if free {
            let energy = column(&done, "E");
            let drift = energy.iter().map(|e| (e / energy[0] - 1.0).abs()).fold(0.0, f64::max);
            assert!(drift < 1e-9, "{drift}");
        }
    }
}

/// A sleigh on one edge behind its centre of mass, after Chaplygin: it swings round until it runs straight. The speed along
/// the edge is a hyperbolic tangent, the turning a hyperbolic secant, the angle a Gudermannian.
#[test]
fn a_sleigh_on_one_edge_turns_round() {
    let (m, j, l, phi0, s0, w0) = (2.0f64, 0.3f64, 0.4f64, 0.3f64, -0.6f64, 1.5f64);
    let text = format!(
        "model Sleigh\nparam m = {m}, j = {j}, l = {l}\nstate phi' = w.f from {phi0}\nstate x' = u.f\nstate y' = v.f\n\
         1:w -> I:turn(j, f0 = {w0})\n1:u -> I:Iu(m, f0 = {})\n1:v -> I:Iv(m)\n\
         constraint edge: v.f*cos(phi) - u.f*sin(phi) = l*w.f\n",
        s0 * phi0.cos() - l * w0 * phi0.sin()
    );
    let about = j + m * l * l;
    let speed = (s0 * s0 + about / m * w0 * w0).sqrt();
    let rate = l * m * speed / about;
    let begin = (s0 / speed).atanh();
    let gudermann = |z: f64| 2.0 * (0.5 * z).tanh().atan();
    for (method, rtol, error) in
        [(Method::Explicit, 1e-12, 1e-10), (Method::Bdf, 1e-10, 1e-7), (Method::Radau, 1e-10, 1e-8)]
    {
        let done = run(&text, &Run { to: 6.0, method, rtol, every: Some(0.05), ..Run::default() });
        for (k, t) in done.trace.times.iter().enumerate() {
            let z = rate * t + begin;
            let turning = speed * (m / about).sqrt() / z.cosh();
            let phi = phi0 + (about / m).sqrt() / l * (gudermann(z) - gudermann(begin));
            let along = column(&done, "u.f")[k] * phi.cos() + column(&done, "v.f")[k] * phi.sin();
            let found = [column(&done, "w.f")[k] - turning, column(&done, "phi")[k] - phi, along - speed * z.tanh()];
            assert!(greatest(&found) < error, "{method:?} {t}: {found:?}");
        }
    }
}

/// A disc that rolls upright in the plane draws a circle, and its contact carries what turns the motion.
#[test]
fn a_disc_rolls_in_a_circle() {
    let (r, phi0, turn, spin) = (0.25f64, 0.3f64, 0.7f64, 9.0f64);
    let text = "model Disc\nparam m = 2, j = 0.3, k = 0.1, r = 0.25\nstate phi' = turn.f from 0.3\nstate x' = u.f\n\
        state y' = v.f\n1:turn -> I:upright(k, f0 = 0.7)\n1:spin -> I:wheel(j, f0 = 9)\n1:u -> I:Iu(m)\n1:v -> I:Iv(m)\n\
        constraint along: u.f = r*cos(phi)*spin.f\nconstraint across: v.f = r*sin(phi)*spin.f\n";
    let done = run(text, &Run { to: 20.0, rtol: 1e-11, every: Some(0.1), ..Run::default() });
    let radius = r * spin / turn;
    for (k, t) in done.trace.times.iter().enumerate() {
        let phi = phi0 + turn * t;
        let found = [
            column(&done, "x")[k] - radius * (phi.sin() - phi0.sin()),
            column(&done, "y")[k] - radius * (phi0.cos() - phi.cos()),
            column(&done, "spin.f")[k] - spin,
            column(&done, "along.e")[k] + 2.0 * r * spin * turn * phi.sin(),
            column(&done, "across.e")[k] - 2.0 * r * spin * turn * phi.cos(),
        ];
        assert!(greatest(&found) < 1e-9, "{t}: {found:?}");
    }
}

/// Operations of one evaluation of a linkage of `n` cells.
fn operations(name: &str, n: usize) -> usize {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/linkages").join(name).join("model.bond");
    let size = halfarrow::Override { name: "n".into(), value: n.to_string() };
    let model = Model::load(&path, &[size]).unwrap_or_else(|e| panic!("{}", e.render(false)));
    model.compile(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false))).operations()
}

/// Compares operations with those of `linkages/operations.txt`, `UPDATE=1` writes these anew; then they grow from one size to
/// the next as the cells do.
fn work_grows_with_the_cells(name: &str, sizes: &[usize]) {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/linkages/operations.txt");
    let mut table: Vec<String> = fs::read_to_string(&golden).unwrap_or_default().lines().map(String::from).collect();
    let before = table.clone();
    let counted: Vec<usize> = sizes.iter().map(|&n| operations(name, n)).collect();
    for (n, count) in sizes.iter().zip(&counted) {
        let (key, line) = (format!("{name} {n}: "), format!("{name} {n}: {count}"));
        match table.iter().position(|old| old.starts_with(&key)) {
            Some(old) => table[old] = line,
            None => table.push(line),
        }
    }
    if std::env::var_os("UPDATE").is_some() {
        fs::write(&golden, table.join("\n") + "\n").expect("written");
    } else {
        assert_eq!(table, before);
    }
    let cell = |k: usize| (counted[k] - counted[k - 1]) as f64 / (sizes[k] - sizes[k - 1]) as f64;
    let last = sizes.len() - 1;
    assert!(cell(last) < 1.05 * cell(last - 1), "{name}: {counted:?}");
}

/// A scissor lift and a row of parallelograms have one degree of freedom, and each cell adds the same work to a step.
#[test]
fn the_work_of_linkages_grows_with_their_cells() {
    work_grows_with_the_cells("scissors", &[1, 5, 10, 20]);
    work_grows_with_the_cells("n_four_bars", &[1, 10, 20, 40]);
}

/// The same for long ones; compiling them takes a minute or two.
#[test]
#[ignore = "long"]
fn the_work_of_long_linkages_grows_with_their_cells() {
    work_grows_with_the_cells("scissors", &[10, 20, 40]);
    work_grows_with_the_cells("n_four_bars", &[40, 80, 160]);
}

/// A scissor lift of forty stages against the equation of the one angle at which all its bars stand.
#[test]
#[ignore = "long"]
fn a_long_scissor_lift_moves_by_one_angle() {
    let n = 40;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/linkages/scissors/model.bond");
    // The spring holds a weight that grows with the square of the stages.
    let set = [("n", n.to_string()), ("k", "300 kN/m".to_string())];
    let set = set.map(|(name, value)| halfarrow::Override { name: name.into(), value });
    let options = Run { to: 1.0, rtol: 1e-11, every: Some(0.1), record: Record::All, ..Run::default() };
    let model = Model::load(&path, &set).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let done = model.simulate(&options, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let squares = f64::from(n * (4 * n * n - 1)) / 3.0;
    let one = format!(
        "model One\nlet mass = 2*{n}*(0.5*sin(phi)^2 + 0.1) + {squares:e}*cos(phi)^2\n\
         let slope = {:e}*sin(phi)*cos(phi)\n\
         let torque = 300000*sin(phi)*(cos(phi) - 0.65) - 2*9.81*{n}^2*cos(phi)\n\
         state phi' = w from 0.6\nstate w' = (torque - slope*w^2/2)/mass from 0\n",
        4.0 * 0.5 * (f64::from(n) - squares)
    );
    let reduced = run(&one, &options);
    for (k, phi) in column(&reduced, "phi").iter().enumerate() {
        for bar in ["a[1]", "b[1]", "a[40]", "b[40]"] {
            let found = column(&done, bar)[k];
            assert!((found - phi).abs() < 1e-8, "{bar} is {found}, not {phi}");
        }
    }
}

/// A row of parallelograms through its flat positions, five turns of which are enough to lie flat six times: all cranks turn as
/// one, as a pendulum of one angle does, whatever their number.
#[test]
fn parallelograms_in_a_row_pass_their_flat_positions() {
    for (n, methods) in [
        (1, &[(Method::Explicit, 1e-12, 1e-7), (Method::Radau, 1e-10, 1e-6)][..]),
        (40, &[(Method::Explicit, 1e-12, 1e-7)][..]),
    ] {
        let size = [halfarrow::Override { name: "n".into(), value: n.to_string() }];
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/linkages/n_four_bars/model.bond");
        let model = Model::load(&path, &size).unwrap_or_else(|e| panic!("{}", e.render(false)));
        let (inertia, moment) = ((n + 1) as f64 / 3.0 + n as f64, 9.81 * ((n + 1) as f64 / 2.0 + n as f64));
        let one = format!(
            "model One\nstate th' = w.f from {:e}\n1:w -> I:J({inertia:e}, f0 = 1)\nSe:load(-{moment:e}*cos(th)) -> w\n",
            std::f64::consts::FRAC_PI_2
        );
        for &(method, rtol, part) in methods {
            let options = Run { to: 5.0, rtol, method, every: Some(0.25), record: Record::All, ..Run::default() };
            let reduced = run(&one, &Run { rtol: 1e-12, method: Method::Explicit, ..options.clone() });
            let done = model.simulate(&options, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
            assert!(last(&done, "th[0]") > 5.0 * std::f64::consts::PI);
            for (k, th) in column(&reduced, "th").iter().enumerate() {
                for crank in [0, n] {
                    let found = column(&done, &format!("th[{crank}]"))[k];
                    assert!((found - th).abs() < part, "{n}, {method:?}: th[{crank}] is {found}, not {th}");
                }
                let tilt = column(&done, &format!("tilt[{n}]"))[k];
                assert!(tilt.abs() < 1e-9, "{n}, {method:?}: {tilt}");
            }
        }
    }
}

/// Linkages against their references, which know closed forms of positions and Lagrange's equation alone.
#[test]
fn linkages_meet_their_references() {
    let names = [
        "cart_with_chain",
        "double_pendulum_points",
        "moving_base",
        "n_four_bars",
        "peaucellier",
        "scissors",
        "seven_body",
        "turning_on_moving_base",
        "watt_linkage",
    ];
    for name in names {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/linkages").join(name);
        let text = std::fs::read_to_string(folder.join("reference.json")).expect("a reference");
        let reference: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let numbers = |list: &serde_json::Value| -> Vec<f64> {
            let all = list.as_array().expect("a list").iter();
            all.map(|v| v.as_str().and_then(|v| v.parse().ok()).expect("a number")).collect()
        };
        let times = numbers(&reference["t"]);
        let tolerance = reference["tolerance"].as_f64().expect("a number");
        // All times are multiples of it.
        let (to, every) = (times[times.len() - 1], times[0].min(0.1));
        let done = run_of(name, &Run { to, rtol: 1e-12, every: Some(every), ..Run::default() });
        for (variable, wanted) in reference["values"].as_object().expect("variables") {
            let (values, wanted) = (column(&done, variable), numbers(wanted));
            let size = wanted.iter().fold(0.0f64, |most, v| most.max(v.abs())).max(1e-6);
            for (t, wanted) in times.iter().zip(&wanted) {
                let k = (t / every).round() as usize;
                let off = (values[k] - wanted).abs();
                assert!(off <= tolerance * size, "{name}: {variable} at {t} s is {}, not {wanted}", values[k]);
            }
        }
    }
}

/// A zero compliance that holds a known displacement is a `constraint` whose bonds are drawn.
#[test]
fn a_drawn_zero_compliance_holds_a_displacement() {
    let bead = |held: &str| {
        format!(
            "model Bead\n1:x -> I:mx(2)\n1:y -> I:my(2)\nstate px' = x.f from 3\nstate py' = y.f from 4\nSe:g(-9.81) -> y\n{held}"
        )
    };
    let by_bonds = |a: &str, b: &str| {
        bead(&format!(
            "x -> TF:a(m = {a}) -> 0:push\ny -> TF:b(m = {b}) -> push\nZC:rod(q = px^2 + py^2 - 25) -> push\n"
        ))
    };
    let drawn = by_bonds("-2*px", "-2*py");
    let written = bead("constraint rod: px^2 + py^2 = 25\n");
    assert_eq!(states(&drawn), states(&written));
    let options = Run { to: 1.0, rtol: 1e-10, ..Run::default() };
    let (drawn, written) = (run(&drawn, &options), run(&written, &options));
    for name in ["px", "py", "rod.e", "rod.drift"] {
        let (a, b) = (last(&drawn, name), last(&written, name));
        assert!((a - b).abs() < 1e-9, "{name}: {a} by bonds, {b} by a constraint");
    }
    // Bonds by which the displacement does not change at the flow of its bond.
    let wrong = model(&by_bonds("1", "1")).simulate(&options, &mut |_| true);
    let refused = wrong.expect_err("it is refused").render(false);
    assert!(refused.contains("does not satisfy the model"), "{refused}");
}

/// Sensors read efforts by blocks that borrow the factors of others, in routines that do not make them: with other independent
/// variables they have to make them themselves.
#[test]
fn sensors_do_not_stop_an_exchange_of_variables() {
    let text = include_str!("faults/sensors_in_a_loop.bond");
    let run = |text: &str| {
        let model = Model::from_text("loop.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
        let states = Record::Names(vec!["b1.inertia.x.f".into(), "j2.x.q".into()]);
        let run = Run { to: 1.5, rtol: 1e-8, record: states, ..Run::default() };
        let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
        assert!(done.report.exchanges > 0);
        done.trace.columns.iter().map(|c| *c.values.last().expect("a value")).collect::<Vec<f64>>()
    };
    let without: String =
        text.lines().filter(|line| !line.contains("FrameSensor")).map(|line| format!("{line}\n")).collect();
    for (with, without) in run(text).into_iter().zip(run(&without)) {
        assert!((with - without).abs() < 1e-5, "{with} and {without}");
    }
}
