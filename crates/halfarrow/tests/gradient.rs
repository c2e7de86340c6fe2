//! Gradients from runs followed backwards: against the same run differentiated forwards, of every model, by every method,
//! through every kind of event; against closed forms; what has no derivative is refused.

#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use super::sensitivity::{BALL, BELT, CAR, SAMPLED, collection, model, run};
use halfarrow::{
    Error, FixedMethod, Form, Gradient, Input, Method, Model, Record, Reduce, Run, Start, Sweep, Trace, Vary, Weighed,
};

/// Numbers between -1 and 1.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A sum of everything recorded, each sample with a weight of its own, columns by their size.
fn weigh(trace: &Trace) -> (f64, Vec<Vec<f64>>) {
    let mut next = numbers(7);
    let weights: Vec<Vec<f64>> = trace
        .columns
        .iter()
        .map(|column| {
            let size = column.values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
            let size = if size > 0.0 { size } else { 1.0 };
            column.values.iter().map(|_| next() / size).collect()
        })
        .collect();
    let columns = trace.columns.iter().zip(&weights);
    let value = columns.flat_map(|(c, w)| c.values.iter().zip(w)).map(|(v, w)| v * w).sum();
    (value, weights)
}

fn weighed((value, samples): (f64, Vec<Vec<f64>>)) -> Weighed {
    Weighed { value, samples, times: None }
}

fn gradient(model: &Model, run: &Run) -> Result<Gradient, Error> {
    model.gradient(run, &mut |trace| Ok(weighed(weigh(trace))), &mut |_| true)
}

/// The greatest difference between the way back and the way forth, of the terms that a derivative is the sum of.
fn miss(model: &Model, run: &Run) -> f64 {
    let back = gradient(model, run).unwrap_or_else(|error| panic!("{error}"));
    let forth = model.simulate(run, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).trace;
    let own = back.run.trace.columns.len();
    let (value, weights) = weigh(&back.run.trace);
    assert_eq!(back.value, value);
    assert_eq!(back.slopes.len(), run.sensitivities.len());
    let mut worst = 0.0f64;
    for (j, slope) in back.slopes.iter().enumerate() {
        assert_eq!(slope.name, run.sensitivities[j]);
        let terms: Vec<f64> = forth.columns[own * (j + 1)..own * (j + 2)]
            .iter()
            .zip(&weights)
            .flat_map(|(column, w)| column.values.iter().zip(w).map(|(s, w)| s * w))
            .collect();
        let (sum, size) = (terms.iter().sum::<f64>(), terms.iter().map(|term| term.abs()).sum::<f64>());
        let off = (sum - slope.slope).abs() / if size > 0.0 { size } else { 1.0 };
        if off > 1e-6 {
            eprintln!("{}: {} back, {sum} forth", slope.name, slope.slope);
        }
        worst = worst.max(off);
    }
    worst
}

const FIXED: [(Method, f64); 4] = [
    (Method::Fixed(FixedMethod::Rk4), 1e-11),
    (Method::Fixed(FixedMethod::Heun), 1e-11),
    (Method::Fixed(FixedMethod::Euler), 1e-11),
    (Method::Fixed(FixedMethod::ImplicitMidpoint), 1e-8),
];
const VARIABLE: [(Method, f64); 3] = [(Method::Explicit, 1e-7), (Method::Bdf, 1e-5), (Method::Radau, 1e-5)];

fn by_all_methods(model: &Model, asked: &Run, step: f64) {
    for (method, most) in FIXED {
        let worst = miss(model, &Run { method, step: Some(step), ..asked.clone() });
        assert!(worst <= most, "{method:?}: {worst:e}");
    }
    for (method, most) in VARIABLE {
        let worst = miss(model, &Run { method, ..asked.clone() });
        assert!(worst <= most, "{method:?}: {worst:e}");
    }
}

/// Every model of the collection, by all parameters that are given as numbers and do not shape it.
#[test]
fn all_models_agree_with_the_way_forth() {
    let mut compared = 0;
    for (name, model, to) in collection() {
        let compiled = model.compile(Form::Minimal).expect("equations");
        let parameters = compiled.interface().parameters;
        let by: Vec<&str> = parameters
            .iter()
            .filter(|p| !p.constant && !p.shapes && p.value != 0.0)
            .map(|p| p.name.as_str())
            .filter(|name| model.simulate(&run(&[name], to), &mut |_| true).is_ok())
            .take(6)
            .collect();
        let asked = run(&by, to);
        for (method, step, most) in
            [(Method::Auto, None, 1e-5), (Method::Fixed(FixedMethod::Rk4), Some(to / 1024.0), 1e-9)]
        {
            let asked = Run { method, step, ..asked.clone() };
            // A step that is too long for a stiff model fails both ways.
            if step.is_some() && model.simulate(&asked, &mut |_| true).is_err() {
                continue;
            }
            let worst = miss(&model, &asked);
            assert!(worst <= most, "{name} by {method:?}: {worst:e}");
            compared += by.len();
        }
    }
    assert!(compared > 150, "{compared}");
}

#[test]
fn bounces_are_followed_back() {
    let ball = model(BALL);
    let asked = run(&["e", "h(0)", "g", "h0", "m"], 2.2);
    let fixed = FIXED.into_iter().filter(|(method, _)| !matches!(method, Method::Fixed(FixedMethod::Euler)));
    for (method, step, most) in
        fixed.map(|(m, most)| (m, Some(0.01), most)).chain(VARIABLE.map(|(m, most)| (m, None, most)))
    {
        let worst = miss(&ball, &Run { method, step, ..asked.clone() });
        assert!(worst <= most, "{method:?}: {worst:e}");
    }
    // The height of the first flight after the first bounce, in closed form.
    let asked = Run { at: vec![0.6], every: None, record: Record::Names(vec!["h".into()]), ..run(&["e", "g"], 0.6) };
    let last = Reduce::parse("final(h)").expect("a reduction");
    let found = ball.gradient(&asked, &mut |trace| last.objective(trace), &mut |_| true).expect("a gradient");
    let (g, fall) = (9.81f64, (2.0 / 9.81f64).sqrt());
    let tau = 0.6 - fall;
    assert!((found.value - (0.8 * g * fall * tau - 0.5 * g * tau * tau)).abs() < 1e-9);
    assert!((found.slopes[0].slope - g * fall * tau).abs() < 1e-8, "{:?}", found.slopes);
    // d(fall)/dg = -fall/(2g).
    let by_fall = 0.8 * g * tau - (0.8 * g * fall - g * tau);
    let by_g = 0.8 * fall * tau - 0.5 * tau * tau - by_fall * fall / (2.0 * g);
    assert!((found.slopes[1].slope - by_g).abs() < 1e-8, "{:?}", found.slopes);
}

#[test]
fn starts_inputs_and_equilibria_are_followed_back() {
    let car = model(CAR);
    by_all_methods(&car, &run(&["m", "k", "b", "g", "q0", "spring.q(0)"], 0.5), 1e-3);
    let given = Run { inputs: vec![("lift".into(), Input::Constant(50.0))], ..run(&["lift", "m"], 0.5) };
    by_all_methods(&car, &given, 1e-3);
    let times: Vec<f64> = (0..20).map(|i| 0.03 * f64::from(i)).collect();
    let values = times.iter().map(|t| 300.0 * libm::sin(9.0 * t)).collect();
    let moving = Run { inputs: vec![("lift".into(), Input::Series { times, values })], ..run(&["k", "m", "b"], 0.5) };
    by_all_methods(&car, &moving, 1e-3);
    by_all_methods(&car, &Run { start: Start::Equilibrium, ..run(&["m", "k", "g"], 0.5) }, 1e-3);
}

#[test]
fn samples_periods_and_jumps_are_followed_back() {
    let circuit = model(SAMPLED);
    let all = Run { record: Record::All, ..run(&["tau", "gain", "late", "cap", "r", "coil.f(0)"], 0.9) };
    by_all_methods(&circuit, &all, 1e-4);
    let belt = model(BELT);
    by_all_methods(&belt, &Run { record: Record::All, ..run(&["m", "v", "late", "k", "n"], 1.0) }, 1e-3);
}

/// Loops that are solved by iteration, laws with kinks, tables; more parameters than states.
#[test]
fn implicit_laws_and_kinks_are_followed_back() {
    let text = "model Net
param a[8] = [1, 2, 3, 4, 5, 6, 7, 8], u = 4
Se:s(u*cos(3*t)) -> 1:j
j -> I:coil(0.5*a[1])
j -> 0:node[1]
node[1] -> C:store[1](0.2*a[2])
node[1] -> 1:b[1] -> 0:node[2]
b[1] -> R:cubic[1](e = a[3]*f + f^3)
node[2] -> R:cubic[2](f = a[4]*e + 0.5*e^3)
node[2] -> R:kink(f = max(e, a[5]*e))
node[2] -> 1:c -> C:store[2](0.1*a[6])
c -> R:cubic[3](e = a[7]*f + abs(f)*f*a[8])
";
    let names: Vec<String> = (1..=8).map(|i| format!("a[{i}]")).chain(["u".to_string()]).collect();
    let by: Vec<&str> = names.iter().map(String::as_str).collect();
    by_all_methods(&model(text), &Run { record: Record::All, ..run(&by, 2.0) }, 1e-3);
}

#[test]
fn reductions_are_those_of_sweeps() {
    let drop =
        model("model Drop\nparam m = 2 kg, b = 1\nSe:weight(9.81*m) -> 1:j -> I:mass(m, f0 = -1)\nj -> R:air(b)\n");
    let by = ["m", "b"];
    for kind in ["initial", "final", "min", "max", "max_abs", "mean", "rms"] {
        let wanted = Reduce::parse(&format!("{kind}(mass.f)")).expect("a reduction");
        let asked = Run { record: Record::Names(vec!["mass.f".into()]), every: Some(0.01), ..run(&by, 1.0) };
        let found = drop.gradient(&asked, &mut |trace| wanted.objective(trace), &mut |_| true).expect("a gradient");
        for (name, value, slope) in [("m", 2.0, &found.slopes[0]), ("b", 1.0, &found.slopes[1])] {
            let beside = |value: f64| {
                let mut compiled = drop.compile(Form::Minimal).expect("equations");
                compiled.set(name, value).expect("a value");
                let run = Run { sensitivities: Vec::new(), rtol: 1e-12, ..asked.clone() };
                let trace = compiled.simulate(&run, &mut |_| true).expect("a run").trace;
                wanted.objective(&trace).expect("a number").value
            };
            let difference = (beside(value + 1e-4) - beside(value - 1e-4)) / 2e-4;
            assert!((slope.slope - difference).abs() < 1e-6, "{kind} by {name}: {} for {difference}", slope.slope);
        }
    }
    let wanted = Reduce::parse("time_of_max(mass.f)").expect("a reduction");
    let asked = Run { record: Record::Names(vec!["mass.f".into()]), ..run(&by, 1.0) };
    let error = drop.gradient(&asked, &mut |trace| wanted.objective(trace), &mut |_| true).expect_err("no derivative");
    assert!(error.to_string().contains("time_of_max has no derivative"), "{error}");
}

/// Samples that events are taken at move with these: a capacitor is fullest where a pulse ends, a room warmest where its heater is
/// switched off, a ball fastest where it meets the ground. Derivatives in closed form.
#[test]
fn numbers_follow_the_instants_of_events() {
    let pulse = "model M\nparam T1 = 0.5, A = 2\nSe:s(if t < T1 then A else 0) -> 1:l -> R:r(1)\nl -> C:c(1)\n\
                 output v = c.e, i = r.f, u = s.e\n";
    let room = "model M\nparam P = 120, hi = 24, lo = 21\ndiscrete on = 1\nSf:h(P*on) -> 0:room\n\
                room -> C:w(c = 900, e0 = 20)\nroom -> R:r(0.3)\nwhen w.e > hi { on = 0 }\nwhen w.e < lo { on = 1 }\n\
                output T = w.e\n";
    let ball = "model M\nparam g = 9.81, h0 = 1\nSe:w(-g) -> 1:v -> I:m(1)\nstate h' = v.f from h0\n\
                when h < 0 { reset m.f = -0.5*m.f }\noutput f = v.f, height = h\n";
    let (left, speed) = ((-0.5_f64).exp(), (2.0 * 9.81_f64).sqrt());
    for (text, to, number, by, wanted) in [
        (pulse, 1.0, "max(v)", ["T1", "A"], [2.0 * left, 1.0 - left]),
        (pulse, 1.0, "min(i)", ["T1", "A"], [-2.0 * left, left - 1.0]),
        (pulse, 1.0, "mean(u)", ["T1", "A"], [2.0, 0.5]),
        (pulse, 1.0, "rms(u)", ["T1", "A"], [2.0_f64.sqrt(), 0.5_f64.sqrt()]),
        (room, 100.0, "max(T)", ["hi", "P"], [1.0, 0.0]),
        (ball, 1.0, "max_abs(f)", ["g", "h0"], [0.5 * speed / 9.81, 0.5 * speed]),
        (ball, 1.0, "min(height)", ["g", "h0"], [0.0, 0.0]),
    ] {
        let wanted_of = Reduce::parse(number).expect("a reduction");
        for (method, step, inside) in [
            (Method::Auto, None, false),
            (Method::Auto, None, true),
            (Method::Bdf, None, false),
            (Method::Bdf, None, true),
            (Method::Radau, None, true),
            (Method::Fixed(FixedMethod::Rk4), Some(0.01), true),
        ] {
            let variable = number.split(['(', ')']).nth(1).expect("a variable");
            let record = Record::Names(vec![variable.into()]);
            let asked = Run { method, step, inside, record, rtol: 1e-9, every: None, ..run(&by, to) };
            let found = model(text).gradient(&asked, &mut |trace| wanted_of.objective(trace), &mut |_| true);
            let found = found.unwrap_or_else(|error| panic!("{number} by {method:?}: {error}"));
            for (slope, wanted) in found.slopes.iter().zip(wanted) {
                let missed = (slope.slope - wanted).abs();
                assert!(
                    missed < 1e-5 * speed,
                    "{number} by {} with {method:?}, inside {inside}: {} for {wanted}",
                    slope.name,
                    slope.slope
                );
            }
        }
    }
}

/// Between its steps a run is known as exactly as at them: heights of a throw and of a ball that bounces, of which a few long
/// steps tell the greatest value, the mean and their derivatives.
#[test]
fn numbers_of_long_steps_are_those_of_the_motion() {
    let throw =
        "model Throw\nparam v0 = 8\nSe:w(-9.81) -> 1:v -> I:b(1, f0 = v0)\nstate h' = v.f from 0\noutput y = h\n";
    let ball = "model Ball\nparam v0 = 8\nSe:w(-9.81) -> 1:v -> I:m(1, f0 = v0)\nstate h' = v.f from 0\n\
                when h < 0 { reset m.f = -0.5*m.f }\noutput y = h\n";
    let g = 9.81_f64;
    // Of pieces of parabolas: what each starts with and how long it is, after h = v t - g t²/2 from 0.
    let flights = |v0: f64, bounces: bool| -> Vec<[f64; 2]> {
        let first = 2.0 * v0 / g;
        if bounces && first < 2.0 { vec![[v0, first], [0.5 * v0, 2.0 - first]] } else { vec![[v0, 2.0]] }
    };
    let mean = |v0: f64, bounces: bool| {
        let of = |[v, t]: [f64; 2]| v * t * t / 2.0 - g * t * t * t / 6.0;
        flights(v0, bounces).into_iter().map(of).sum::<f64>() / 2.0
    };
    let rms = |v0: f64, bounces: bool| {
        let of = |[v, t]: [f64; 2]| v * v * t.powi(3) / 3.0 - v * g * t.powi(4) / 4.0 + g * g * t.powi(5) / 20.0;
        (flights(v0, bounces).into_iter().map(of).sum::<f64>() / 2.0).sqrt()
    };
    for (text, bounces) in [(throw, false), (ball, true)] {
        let numbers: [(&str, &dyn Fn(f64) -> f64); 3] = [
            ("max(y)", &|v0| v0 * v0 / (2.0 * g)),
            ("mean(y)", &|v0| mean(v0, bounces)),
            ("rms(y)", &|v0| rms(v0, bounces)),
        ];
        for (number, of) in numbers {
            let wanted = Reduce::parse(number).expect("a reduction");
            for method in [Method::Auto, Method::Radau] {
                let record = Record::Names(vec!["y".into()]);
                let asked = Run { method, inside: true, every: None, record, rtol: 1e-9, ..run(&["v0"], 2.0) };
                let found = model(text).gradient(&asked, &mut |trace| wanted.objective(trace), &mut |_| true);
                let found = found.unwrap_or_else(|error| panic!("{number} by {method:?}: {error}"));
                let slope = (of(8.0 + 1e-5) - of(8.0 - 1e-5)) / 2e-5;
                assert!((found.value - of(8.0)).abs() < 1e-8, "{number} by {method:?}: {} {}", found.value, of(8.0));
                let missed = (found.slopes[0].slope - slope).abs();
                assert!(missed < 1e-7, "{number} by {method:?}: {} {slope}", found.slopes[0].slope);
            }
            let sweep = Sweep {
                run: Run { to: 2.0, rtol: 1e-9, ..Run::default() },
                vary: vec![Vary::parse("v0=list(8)").expect("one value")],
                samples: None,
                reduce: vec![wanted],
                restart: false,
                units: false,
                part: None,
            };
            let (columns, _) = model(text).sweep_columns(&sweep, &mut |_, _| true).expect("a sweep");
            let value = columns.iter().find(|column| column.name == number).expect("a column").values[0];
            assert!((value - of(8.0)).abs() < 1e-8, "{number}: {value} {}", of(8.0));
        }
    }
}

#[test]
fn without_names_it_is_by_all_parameters() {
    let drop = model("model Drop\nparam m = 2 kg, twice = 2*m\nconst c = 3\nSe:w(c*twice) -> 1:j -> I:mass(m)\n");
    let found = gradient(&drop, &run(&[], 1.0)).expect("a gradient");
    let names: Vec<&str> = found.slopes.iter().map(|slope| slope.name.as_str()).collect();
    assert_eq!(names, ["m", "twice"]);
    assert_eq!((found.slopes[0].unit.as_str(), found.slopes[0].at), ("kg", Some(2.0)));
}

#[test]
fn what_has_no_derivative_is_refused() {
    let refusal = |text: &str, run: &Run| match gradient(&model(text), run) {
        Ok(_) => panic!("it is differentiated"),
        Err(error) => error.to_string(),
    };
    let delayed = "model M\nparam m = 1\nSe:s(delay(1 - mass.f, 0.1)) -> I:mass(m)\n";
    assert!(refusal(delayed, &run(&["m"], 1.0)).contains("delayed"));
    let plain = "model M\nparam mass = 1\nSe:s(1) -> I:m(mass)\n";
    assert!(refusal(plain, &Run { form: Form::Kane, ..run(&["mass"], 1.0) }).contains("minimal"));
    let rosenbrock = Run { method: Method::Fixed(FixedMethod::Rosenbrock), step: Some(0.1), ..run(&["mass"], 1.0) };
    assert!(refusal(plain, &rosenbrock).contains("second derivatives"));
    let pad = "model S\nparam v = 1, fc = 2\n1:j -> I:m(1, f0 = v)\nj -> R:pad(friction = fc)\n";
    assert!(refusal(pad, &run(&["v"], 2.0)).contains("another branch"));
    let alone = "model M\nstate x' = -x from 1\noutput y = x\n";
    assert!(refusal(alone, &run(&[], 1.0)).contains("no parameter that may change"));
    let short =
        model(plain).gradient(&run(&["mass"], 1.0), &mut |_| Ok(weighed((0.0, vec![vec![1.0]]))), &mut |_| true);
    let short = short.expect_err("too few").to_string();
    assert!(short.contains("1 columns of 9 samples, not 1 of 1"), "{short}");
}
