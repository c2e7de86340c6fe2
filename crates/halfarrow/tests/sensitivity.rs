//! Exact sensitivities: against closed forms, against central differences of every model, through every kind of event; what has
//! no derivative is refused.

use halfarrow::{Error, FixedMethod, Form, Input, Method, Model, Record, Run, Source, Start, Trace};

pub(super) fn model(text: &str) -> Model {
    Model::from_text("model.bond", text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

pub(super) fn run(by: &[&str], to: f64) -> Run {
    Run {
        to,
        every: Some(to / 8.0),
        rtol: 1e-10,
        sensitivities: by.iter().map(|name| (*name).to_string()).collect(),
        ..Run::default()
    }
}

fn trace(model: &Model, run: &Run) -> Trace {
    model.simulate(run, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).trace
}

fn column<'t>(trace: &'t Trace, name: &str) -> &'t [f64] {
    let names: Vec<&str> = trace.columns.iter().map(|c| c.name.as_str()).collect();
    &trace.columns.iter().find(|c| c.name == name).unwrap_or_else(|| panic!("no {name} among {names:?}")).values
}

fn refusal(text: &str, run: &Run) -> String {
    match model(text).simulate(run, &mut |_| true) {
        Ok(_) => panic!("it is differentiated"),
        Err(error) => error.to_string(),
    }
}

/// The greatest miss of all derivatives by a parameter, each relative to its greatest value, against central differences of
/// runs with it a little less and a little more; those of variables that hardly move are measured by the others.
fn miss(model: &Model, name: &str, value: f64, run: &Run) -> f64 {
    let exact = trace(model, run);
    let step = if value == 0.0 { 1e-5 } else { 1e-5 * value.abs() };
    let beside = |value: f64| {
        let mut compiled = model.compile(Form::Minimal).expect("it is compiled");
        compiled.set(name, value).expect("a value beside");
        let run = Run { sensitivities: Vec::new(), rtol: 1e-11, ..run.clone() };
        compiled.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).trace
    };
    let (more, less) = (beside(value + step), beside(value - step));
    let own = more.columns.len();
    let all = exact.columns[own..].iter().flat_map(|c| &c.values).fold(0.0f64, |most, s| most.max(s.abs()));
    let mut worst = 0.0f64;
    for (k, slopes) in exact.columns[own..].iter().enumerate() {
        let size = slopes.values.iter().fold(0.0f64, |most, s| most.max(s.abs()));
        let rounding =
            more.columns[k].values.iter().fold(0.0f64, |most, v| most.max(v.abs())) * 1e-6 / value.abs().max(step);
        for (i, slope) in slopes.values.iter().enumerate() {
            let difference = (more.columns[k].values[i] - less.columns[k].values[i]) / (2.0 * step);
            worst = worst.max((difference - slope).abs() / (size + rounding + 1e-5 * all).max(f64::MIN_POSITIVE));
        }
    }
    worst
}

pub(super) const BALL: &str = "model Ball
param m = 1 kg, g = 9.81 m/s2, e = 0.8, h0 = 1 m
Se:weight(-m*g) -> 1:v -> I:ball(m)
state h' = v.f from h0
discrete n = 0
when h < 0 m {
    reset ball.f = -e*ball.f
    n = n + 1
}
";

pub(super) const CAR: &str = "model Car
param m = 300 kg, k = 18 kN/m, b = 900 N.s/m, g = 9.81 m/s2, q0 = 0.1 m
input lift : N = 0.1*m*g
Se:weight(m*g) -> 1:c
Se:up(lift) -> c
c -> I:body(m, p0 = 0.2*m)
c -> C:spring(e = k*q + 1e5*q^3, q0 = 2*q0)
c -> R:damper(b)
";

pub(super) const SAMPLED: &str = "model Sampled
param tau = 0.13 s, gain = 3, r = 2 ohm, ind = 0.1, cap = 0.05, late = 0.31 s
discrete level = gain
Se:supply((if t < late then 1 else 4)*level - sample(store.e, tau)) -> 1:loop -> R:wire(r)
loop -> I:coil(ind)
loop -> C:store(cap)
when every 2*tau {
    level = 0.5*level + coil.f
}
";

pub(super) const BELT: &str = "model Belt
param m = 2 kg, v = 3 m/s, late = 0.2 s, k = 50 N/m, n = 1.5
Sf:belt(if t < late then 0 else v) -> 0:a
a -> 1:j -> I:own(m)
a -> C:spring(k = k)
j -> TF:lever(n) -> 1:o -> I:other(2*m)
o -> R:drag(0.3)
when spring.q > 0.1 m {
    reset own.f = -0.5*own.f
}
";

/// The height of the ball in closed form, with its derivatives by e, h0 and g.
fn height(t: f64, (g, e, h0): (f64, f64, f64)) -> [f64; 4] {
    let fall = (2.0 * h0 / g).sqrt();
    // Of the first fall, then of each flight: begin and speed in units of the first fall, with derivatives by e.
    let (mut begin, mut by_e, mut bounces) = (1.0, 0.0, 1);
    if t < fall {
        return [h0 - 0.5 * g * t * t, 0.0, 1.0, -0.5 * t * t];
    }
    while t > fall * (begin + 2.0 * libm::pow(e, f64::from(bounces))) {
        by_e += 2.0 * f64::from(bounces) * libm::pow(e, f64::from(bounces - 1));
        begin += 2.0 * libm::pow(e, f64::from(bounces));
        bounces += 1;
    }
    let (speed, speed_by_e) =
        (libm::pow(e, f64::from(bounces)), f64::from(bounces) * libm::pow(e, f64::from(bounces - 1)));
    let tau = t - fall * begin;
    let falls = speed * g * fall - g * tau;
    // By the duration of the first fall.
    let by_fall = speed * g * tau - falls * begin;
    [
        speed * g * fall * tau - 0.5 * g * tau * tau,
        speed_by_e * g * fall * tau - falls * fall * by_e,
        by_fall * fall / (2.0 * h0),
        speed * fall * tau - 0.5 * tau * tau - by_fall * fall / (2.0 * g),
    ]
}

#[test]
fn the_instants_of_bounces_move() {
    let ball = model(BALL);
    let by = ["e", "h(0)", "g", "h0", "m"];
    let methods = [
        (Method::Explicit, None),
        (Method::Radau, None),
        (Method::Bdf, None),
        (Method::Fixed(FixedMethod::Rk4), Some(0.01)),
        (Method::Fixed(FixedMethod::ImplicitMidpoint), Some(0.01)),
    ];
    for (method, step) in methods {
        let run = Run { method, step, ..run(&by, 2.2) };
        let found = trace(&ball, &run);
        for (i, &t) in found.times.iter().enumerate() {
            let exact = height(t, (9.81, 0.8, 1.0));
            let columns = ["h", "d(h)/d(e)", "d(h)/d(h(0))", "d(h)/d(g)"];
            for (name, exact) in columns.into_iter().zip(exact) {
                let value = column(&found, name)[i];
                assert!(
                    (value - exact).abs() <= 2e-8 * (1.0 + exact.abs()),
                    "{method:?} {name} at {t}: {value} for {exact}"
                );
            }
            assert_eq!(column(&found, "d(h)/d(h(0))")[i], column(&found, "d(h)/d(h0)")[i]);
            assert_eq!(column(&found, "d(h)/d(m)")[i], 0.0);
            assert_eq!(column(&found, "d(n)/d(e)")[i], 0.0);
        }
    }
}

#[test]
fn units_are_those_of_the_quotient() {
    let found = trace(&model(BALL), &run(&["g", "h(0)", "e"], 0.1));
    let unit = |name: &str| found.columns.iter().find(|c| c.name == name).map(|c| c.unit.clone()).expect("a column");
    assert_eq!(unit("d(h)/d(g)"), "(m)/(m/s2)");
    assert_eq!(unit("d(h)/d(h(0))"), "(m)/(m)");
    assert_eq!(unit("d(h)/d(e)"), "m");
}

/// Every model of the collection with its name, and how long it is worth to be run: what is fast is at rest soon, or has met
/// its end.
pub(super) fn collection() -> impl Iterator<Item = (String, Model, f64)> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let mut folders: Vec<_> = std::fs::read_dir(&folder).expect("models").flatten().map(|e| e.path()).collect();
    folders.sort();
    folders.into_iter().filter(|folder| folder.join("model.bond").exists()).map(|folder| {
        let model = Model::new(Source::open(&folder.join("model.bond")).expect("a file"), &[]).expect("a model");
        let short = [("electrostatic", 1e-4), ("rlc_ladder", 2e-3), ("rectifier", 0.03), ("wave_line", 0.01)];
        let name = folder.file_name().and_then(|n| n.to_str()).unwrap_or_default().to_string();
        let to = short.iter().find(|s| s.0 == name).map_or(0.25, |s| s.1);
        (name, model, to)
    })
}

/// Every model of the collection, by all parameters that are given as numbers and do not shape it.
#[test]
fn all_models_agree_with_differences() {
    let (mut compared, mut contradicting) = (0, 0);
    for (name, model, to) in collection() {
        let compiled = model.compile(Form::Minimal).expect("equations");
        let parameters = compiled.interface().parameters;
        for parameter in parameters.iter().filter(|p| !p.constant && !p.shapes && p.value != 0.0).take(2) {
            let asked = Run { every: Some(to / 8.0), ..run(&[&parameter.name], to) };
            if let Err(error) = model.simulate(&asked, &mut |_| true) {
                // Start values that fit at one value only: with another one there is no run.
                assert!(error.to_string().contains("contradict"), "{name}: {error}");
                let mut other = compiled.clone();
                other.set(&parameter.name, 1.01 * parameter.value).expect("a value");
                let run = Run { sensitivities: Vec::new(), ..asked };
                assert!(other.simulate(&run, &mut |_| true).expect_err("no start").to_string().contains("contradict"));
                contradicting += 1;
                continue;
            }
            let worst = miss(&model, &parameter.name, parameter.value, &asked);
            assert!(worst < 2e-4, "{name} by {}: {worst:e}", parameter.name);
            compared += 1;
        }
    }
    assert!(compared > 60 && contradicting < 4, "{compared}, {contradicting}");
}

#[test]
fn what_starts_and_rests_moves() {
    let car = model(CAR);
    for (name, value) in [("m", 300.0), ("k", 18e3), ("q0", 0.1), ("g", 9.81)] {
        for start in [Start::Given, Start::Equilibrium] {
            if start == Start::Equilibrium && name == "q0" {
                continue;
            }
            let asked = Run { start, ..run(&[name], 0.5) };
            let worst = miss(&car, name, value, &asked);
            assert!(worst < 1e-3, "{name} from {start:?}: {worst:e}");
        }
    }
    // A start value, and an input given as a number.
    let by_input = trace(
        &car,
        &Run { inputs: vec![("lift".into(), Input::Constant(50.0))], ..run(&["lift", "spring.q(0)"], 0.5) },
    );
    let with = |lift: f64| {
        trace(&car, &Run { inputs: vec![("lift".into(), Input::Constant(lift))], rtol: 1e-12, ..run(&[], 0.5) })
    };
    let (more, less) = (with(51.0), with(49.0));
    let last = |t: &Trace, name: &str| *column(t, name).last().expect("samples");
    let difference = 0.5 * (last(&more, "spring.q") - last(&less, "spring.q"));
    assert!((last(&by_input, "d(spring.q)/d(lift)") - difference).abs() < 1e-8);
    assert_eq!(column(&by_input, "d(spring.q)/d(spring.q(0))")[0], 1.0);
}

#[test]
fn samples_periods_and_sources_of_time_move() {
    let circuit = model(SAMPLED);
    for (name, value) in [("tau", 0.13), ("gain", 3.0), ("late", 0.31), ("cap", 0.05)] {
        let worst = miss(&circuit, name, value, &Run { record: Record::All, ..run(&[name], 0.9) });
        assert!(worst < 1e-6, "{name}: {worst:e}");
    }
}

/// A source of speed that jumps: momentum is conserved, and what is conserved moves with the masses and the jump.
#[test]
fn speeds_that_jump_with_a_source_move() {
    let belt = model(BELT);
    for (name, value) in [("m", 2.0), ("v", 3.0), ("late", 0.2), ("k", 50.0), ("n", 1.5)] {
        let worst = miss(&belt, name, value, &Run { record: Record::All, ..run(&[name], 1.0) });
        assert!(worst < 1e-4, "{name}: {worst:e}");
    }
}

#[test]
fn methods_agree() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/quarter_car/model.bond");
    let car = Model::new(Source::open(&path).expect("a file"), &[]).expect("a model");
    let asked = Run { rtol: 1e-9, ..run(&["ks", "b", "road", "spring.q(0)"], 0.3) };
    let exact = trace(&car, &Run { method: Method::Explicit, rtol: 1e-12, ..asked.clone() });
    let methods = [
        (Method::Explicit, None, 1e-6),
        (Method::Bdf, None, 1e-5),
        (Method::Radau, None, 1e-6),
        (Method::Auto, None, 1e-6),
        (Method::Fixed(FixedMethod::Rk4), Some(1e-4), 1e-6),
        (Method::Fixed(FixedMethod::Heun), Some(1e-4), 1e-3),
        (Method::Fixed(FixedMethod::ImplicitMidpoint), Some(1e-4), 1e-3),
    ];
    for (method, step, most) in methods {
        let found = trace(&car, &Run { method, step, ..asked.clone() });
        for (a, b) in found.columns.iter().zip(&exact.columns) {
            let size = b.values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
            let worst = a.values.iter().zip(&b.values).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
            assert!(worst <= most * size, "{method:?} {}: {worst:e} of {size:e}", a.name);
        }
    }
    let asked = Run { method: Method::Fixed(FixedMethod::Rosenbrock), step: Some(1e-4), ..asked };
    let error = car.simulate(&asked, &mut |_| true).expect_err("no second derivatives").to_string();
    assert!(error.contains("second derivatives"), "{error}");
}

#[test]
fn what_has_no_derivative_is_refused() {
    let delayed = "model M\nparam m = 1\nSe:s(delay(1 - mass.f, 0.1)) -> I:mass(m)\n";
    assert!(refusal(delayed, &run(&["m"], 1.0)).contains("delayed"));
    let shaped = "model M\nparam n = 3, m = 1\n1:j\nfor i in 1..n { j -> I:m[i](m) }\nSe:s(1) -> j\n";
    assert!(refusal(shaped, &run(&["n"], 1.0)).contains("shapes"));
    let plain = "model M\nparam mass = 1\nSe:s(1) -> I:m(mass)\n";
    let unknown = refusal(plain, &run(&["mas"], 1.0));
    assert!(unknown.contains("did you mean `mass`?"), "{unknown}");
    let start = refusal(plain, &run(&["s.q(0)"], 1.0));
    assert!(start.contains("m.p(0)") || start.contains("m.f(0)"), "{start}");
    assert!(refusal(plain, &run(&["mass", "mass"], 1.0)).contains("twice"));
    assert!(refusal(plain, &Run { form: Form::Kane, ..run(&["mass"], 1.0) }).contains("minimal"));
    // A ball that just touches the floor at the top of its flight.
    let touch = "model T\nparam v = 1\nSe:w(-1) -> 1:j -> I:b(1, f0 = v)\nstate h' = j.f from 0\nwhen h >= 0.5 { reset b.f = 0 }\n";
    if let Err(Error::Run(stopped)) = model(touch).simulate(&run(&["v"], 3.0), &mut |_| true) {
        assert!(stopped.to_string().contains("only touched"), "{stopped}");
    }
    // Two at once, that parameters take apart.
    let two = "model T
param a = 1, b = 1
Se:w(1) -> 1:j -> I:m(1)
state x' = a*j.f from 0
state y' = b*j.f from 0
when x > 1 { reset m.f = 0.5*m.f }
when y > 1 { reset m.f = 0.5*m.f }
";
    let apart = refusal(two, &run(&["a"], 3.0));
    assert!(apart.contains("together") && apart.contains("when x > 1"), "{apart}");
    // Friction that comes to stick.
    let pad = "model S\nparam v = 1, fc = 2\n1:j -> I:m(1, f0 = v)\nj -> R:pad(friction = fc)\n";
    let stuck = refusal(pad, &run(&["v"], 2.0));
    assert!(stuck.contains("pad") && stuck.contains("another branch"), "{stuck}");
}

/// Derivatives are not taken over into other independent variables: where a run needs these they are named as the reason, not the
/// length of its steps.
#[test]
fn other_independent_variables_are_the_reason() {
    let text = "model FourBar\nimport std.multibody\nparam m = 1 kg\nWorld:world -> 1[frame]:ground\nCutInline:joint(n = [0, 1, 0])\n\
                ground -> Revolute:crank(n = [0, 1, 0], q0 = -1 rad, w0 = 5 rad/s) -> 1[frame]:a\n\
                a -> Body:bar(m = m, J = diag([1e-3, 4e-3, 4e-3]), c = [0.1, 0, 0])\n\
                a -> FixedTranslation:pin(d = [0.2, 0, 0]) -> Revolute:knee(n = [0, 1, 0], q0 = 0.5 rad) -> 1[frame]:b\n\
                b -> Body:coupler(m = 2 kg, J = diag([1e-3, 0.04, 0.04]), c = [0.15, 0, 0])\n\
                b -> FixedTranslation:tip(d = [0.3, 0, 0]) -> joint.a\n\
                ground -> FixedTranslation:base(d = [0.6, 0, 0]) -> Revolute:rocker(n = [0, 1, 0], q0 = -1.5 rad) -> 1[frame]:c\n\
                c -> Body:swing(m = 1.5 kg, J = diag([1e-3, 0.02, 0.02]), c = [0.2, 0, 0])\nc -> FixedTranslation:top(d = [0.4, 0, 0]) -> joint.b\n";
    model(text).simulate(&run(&[], 1.0), &mut |_| true).unwrap_or_else(|error| panic!("{error}"));
    let why = refusal(text, &run(&["m"], 1.0));
    assert!(why.contains("the motion has no derivative") && why.contains("other independent variables"), "{why}");
}
