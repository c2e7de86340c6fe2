//! Every model in C: the trajectory of the interpreter, to the last bit.
//!
//! All of them are compiled in one go, with every warning an error, and run as one program.

use crate::common;

use common::{Exported, Rows, STEPS, build, build_with, diodes, export, models, own, wishbone};
use halfarrow_compiler::algebra::math;
use halfarrow_emit::Method;
use halfarrow_sim::{Events, System};
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

#[test]
fn c_does_what_the_interpreter_does() {
    let mut all = Vec::new();
    for (i, path) in models().iter().enumerate() {
        let own = path.parent().is_some_and(|folder| folder.ends_with("tests/models"));
        let of_own = [Method::Heun, Method::ImplicitMidpoint, Method::LinearlyImplicitBdf2, Method::Rosenbrock];
        let methods = if own { &of_own[..] } else { &[Method::ALL[i % Method::ALL.len()]] };
        for &method in methods {
            all.push(export(path, method, 1e-3));
        }
    }
    all.extend([Method::Rk4, Method::ImplicitMidpoint].map(|method| export(&diodes(), method, 1e-3)));
    all.push(export(&wishbone(), Method::Rk4, 1e-3));
    assert!(all.len() >= 50, "{} models", all.len());
    check("c", &all, &driver(&all, &|_| (-1, 0.0)), |one| one.simulate(STEPS));
}

/// Parameters set before the start, the start values that follow them, a copy of the model in the middle of the run, and an
/// input that jumps.
#[test]
fn c_follows_parameters_and_inputs() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let model = |name: &str| root.join(name).join("model.bond");
    let cases = [
        (model("quarter_car"), "ks", 21e3),
        (model("slider_crank"), "l", 0.61),
        (model("series_springs"), "k1", 130.0),
        (model("rc_bridge_cubic"), "r1", 900.0),
        (own("delay"), "dead", 0.0331),
        (own("sampled"), "period", 5e-3),
        (own("bridge"), "c", 2e-6),
        (own("closure"), "coupler0", 1.0),
        (own("working_point"), "k", 0.4),
        (own("operating_points"), "v0", 12.0),
        (own("flat_start"), "p", 2.84),
        (own("freedom"), "v", -1.5),
        (own("when_bounce"), "e", 0.9),
        (own("when_beam"), "ratio", 0.4),
        (own("when_sampled"), "period", 6e-3),
        (own("when_four_bar"), "b", 0.52),
    ];
    let all: Vec<Exported> = cases.iter().map(|(path, ..)| export(path, Method::Heun, 1e-3)).collect();
    let of = |one: &Exported| {
        let at = all.iter().position(|e| e.written.name == one.written.name).expect("one of them");
        let (_, name, value) = &cases[at];
        (*name, *value)
    };
    let index = |one: &Exported| {
        let (name, value) = of(one);
        let place = one.model.program().parameters.iter().position(|p| p.name == name);
        (place.unwrap_or_else(|| panic!("{} has no {name}", one.written.name)) as i32, value)
    };
    check("parameters", &all, &driver(&all, &index), |one| {
        let (name, value) = of(one);
        let mut model = one.model.clone();
        model.set_parameter(name, value).expect("it can be set");
        if let Some(input) = model.program().inputs.first().map(|i| i.name.clone()) {
            let default = model.constant(model.program().inputs[0].default).expect("a default");
            model.connect(&input, &[0.0, 0.05, 0.05, 1.0], &[default, default, 1.5, 1.5]).expect("an input");
        }
        let start = model.initialise(0.0).expect("a start");
        one.simulate_from(model, start, STEPS)
    });
}

/// What a step has found at its end serves the next one, also where an input has changed meanwhile that moves nothing which can jump.
#[test]
fn c_goes_on_with_what_steps_found_at_their_end() {
    let text = std::fs::read_to_string(wishbone()).expect("a model").replace("model Wishbone", "model Driven");
    let more = "input torque = 0\nSe:motor(torque) -> lower.axis\noutput power = motor.e*motor.f\n";
    let path = common::folder("ahead_models").join("driven.bond");
    std::fs::write(&path, text + more).expect("a model");
    let all = [Method::Euler, Method::Rk4, Method::LinearlyImplicitBdf2].map(|method| export(&path, method, 1e-3));
    for one in &all {
        let known = one.written.source.contains("ha_find_ahead(m, *end, m->trial)");
        assert!(known && !one.written.source.contains("m->u[i] != m->u_crossed[i]"), "{}", one.written.name);
    }
    let torque = |i: usize| 20.0 * (i * 7 % 11) as f64;
    let step = "if (i < steps) { \\\n";
    let text = driver(&all, &|_| (-1, 0.0));
    assert!(text.contains(step));
    let text = text.replace(step, &format!("{step}            m.u[0] = 20.0 * (double)(i * 7 % 11); \\\n"));
    check("ahead", &all, &text, |one| one.step_with(STEPS, |model, i| model.set_input(0, torque(i))));
}

/// Columns of a Jacobian that is found by comparing rates are computed from what these have in common, at once and in the course of
/// steps, while the rack moves the loops of the car.
#[test]
fn c_compares_rates_in_parts() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/iltis");
    let text = std::fs::read_to_string(folder.join("flat.bond")).expect("a model").replace("model Flat", "model Bends");
    let (input, import) = ("input rack = 0 m", "import \"car.bond\"");
    assert!(text.contains(input) && text.contains(import));
    let text = text.replace(input, "let rack = 0.005*(1 + sign(t - 0.031)) + 0.01*sin(20*t)");
    let text = text.replace(import, &format!("import \"{}\"", folder.join("car.bond").display()));
    let path = common::folder("parts_models").join("bends.bond");
    std::fs::write(&path, text).expect("a model");
    let all = [export(&path, Method::LinearlyImplicitBdf2, 1e-3)];
    assert!(all[0].written.source.contains("return ha_rates_part_0(m, t, x, out);"));
    check("parts", &all, &driver(&all, &|_| (-1, 0.0)), |one| one.simulate(STEPS));
}

/// What fails is said with the elements concerned, where the interpreter stops.
#[test]
fn c_says_what_fails() {
    let falling = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy/falling.bond");
    let all = [export(&falling, Method::Heun, 1e-3), export(&own("ending"), Method::Heun, 1e-3)];
    let said = ["a root of a number below zero", "the equations of fold have two solutions"];
    let steps = 400;
    let text = driver(&all, &|_| (-1, 0.0)).replace(&format!("({STEPS},"), &format!("({steps},"));
    let output = build("failures", &all, &text).run(&[]);
    for ((one, said), text) in all.iter().zip(said).zip(output.split("== ").skip(1)) {
        let (rows, failure) = one.simulate(steps);
        let found = text.lines().find_map(|line| line.strip_prefix("! ")).unwrap_or_default();
        assert!(failure.is_some() && found.contains(said), "{}: {found:?}, but {failure:?}", one.written.name);
        assert_eq!(text.lines().filter(|l| !l.starts_with('!')).count(), rows.len() + 1, "{}", one.written.name);
    }
}

/// A run that the caller takes from step to step, as in real time, has the same results at events.
#[test]
fn c_does_at_events_what_a_run_by_steps_does() {
    let names = [
        "when_beam",
        "when_bounce",
        "when_four_bar",
        "when_gears",
        "when_order",
        "when_relay",
        "when_springs",
        "unsteady_ratio",
    ];
    let all: Vec<Exported> = names
        .iter()
        .zip([Method::Rk4, Method::Rosenbrock].iter().cycle())
        .map(|(name, &method)| export(&own(name), method, 1e-3))
        .collect();
    check("by_steps", &all, &driver(&all, &|_| (-1, 0.0)), |one| one.step(STEPS));
}

/// Where two motions meet, as where a parallelogram lies flat and where a kite folds, C goes on in the smooth one, in shorter
/// steps where one ends beside such a position, to the bits of the interpreter.
#[test]
fn c_passes_positions_where_motions_meet() {
    let flat = "model Flat\nparam a = 0.2, d = 0.5\nstate th1' = c1.f from 0.7\nstate th2' = c2.f from 0.7\n\
        state ph' = bar.f from 0\n1:c1 -> I:I1(0.01, f0 = 3)\n1:c2 -> I:I2(0.01)\n1:bar -> I:Ib(0.02)\n\
        constraint x: a*cos(th1) + d*cos(ph) = d + a*cos(th2)\n\
        constraint y: a*sin(th1) + d*sin(ph) = a*sin(th2)\n";
    let kite = "model Kite\nparam a = 0.2, b = 0.2, c = 0.5, d = 0.5\n1:crank -> I:one(1, f0 = 10)\n\
        1:coupler -> I:two(0.5)\n1:rocker -> I:three(0.7)\nstate th1' = crank.f from 0.6\n\
        state th2' = coupler.f\nstate th3' = rocker.f\n\
        constraint along: a*cos(th1) + b*cos(th2) = d + c*cos(th3)\n\
        constraint across: a*sin(th1) + b*sin(th2) = c*sin(th3)\nguess th2 = 0.5, th3 = 1.5\n";
    let folder = common::folder("flat_models");
    let all = [("flat", flat, 3e-2), ("kite", kite, 2e-2)].map(|(name, text, step)| {
        let path = folder.join(format!("{name}.bond"));
        std::fs::write(&path, text).expect("a model");
        export(&path, Method::Rk4, step)
    });
    check("flat", &all, &driver(&all, &|_| (-1, 0.0)), |one| one.step(STEPS));
}

/// Positions that only speeds keep are put back to the bits of the interpreter, also where events move them, and where relations
/// repeat each other.
#[test]
fn c_puts_positions_back_as_the_interpreter_does() {
    let twice = "model Twice\nstate th' = w.f from 0.4\nstate a' = u.f\nstate b' = v.f\n1:w -> I:wheel(1, f0 = 3)\n\
        w -> TF:one(f_out = 0.5*cos(th)) -> 1:u -> I:first(0.2)\nw -> TF:two(f_out = cos(th)*(1 + sin(th))) -> 1:v -> I:second(0.3)\n\
        v -> C:spring(k = 5)\n";
    let folder = common::folder("put_back_models");
    let mut all = Vec::new();
    let path = folder.join("twice.bond");
    std::fs::write(&path, twice).expect("a model");
    for (path, step) in [(common::speeds(), 4e-3), (path, 2e-2)] {
        for method in [Method::Rk4, Method::Heun, Method::Rosenbrock, Method::ImplicitMidpoint] {
            all.push(common::export_projecting(&path, method, step));
        }
    }
    assert!(all.iter().all(|one| one.written.header.contains("double drift[2];")), "it can be read");
    check("put_back", &all, &driver(&all, &|_| (-1, 0.0)), |one| one.step(STEPS));
}

/// What goes wrong at events stops the run where it stops in the interpreter, and says why.
#[test]
fn c_says_what_fails_at_events() {
    let moving = "1:v -> I:m(1, f0 = 1)\nstate x' = v.f from 0\ndiscrete n = 0\n";
    let joined = "1:v -> I:m(1, f0 = 1)\n1:w -> I:k(2)\nstate x' = v.f from 0\nstate y' = w.f from 0\n\
        constraint fit: x^2 + x = 2*y\n";
    let cases = [
        (moving, "when x > 0.1 { n = 1 }\nwhen x > 0.1 { n = 2 }", "two events at one instant give n different values"),
        (
            "Se:g(-9.81) -> 1:v -> I:m(1)\nstate h' = v.f from 0.01\n",
            "when h < 0 { reset m.f = -1e-6*m.f }",
            "`when h < 0` holds further on after it has happened",
        ),
        (
            moving,
            "when x > 0.1 { n = 1 }\nwhen n > 0.5 { n = 0 }\nwhen n < 0.5 and x > 0.1 { n = 1 }",
            "events make each other happen over and over",
        ),
        (
            moving,
            "v -> TF:gear(2) -> 1:w -> I:big(5)\nwhen x > 0.1 { reset m.f = 1; reset big.f = 7 }",
            "m.f cannot be reset: what is reset depends on each other",
        ),
        (
            moving,
            "when x > 0.1 { reset m.f = log(x - 3) }",
            "the value that `when x > 0.1` gives m.f is not a finite number",
        ),
        (
            moving,
            "v -> C:c(e = q^2 + 1)\nwhen x > 0.05 { reset c.e = -1 }",
            "c.e cannot be reset: no impulse leads to the values",
        ),
        (joined, "when t > 0.05 { reset x = 1; reset y = 3 }", "what events change does not fit the constraint"),
        (joined, "when every 0.05 { reset x = 1; reset y = 3 }", "what events change does not fit the constraint"),
    ];
    let folder = common::folder("failures_at_events_models");
    let all: Vec<Exported> = cases
        .iter()
        .zip(Method::ALL.iter().cycle())
        .enumerate()
        .map(|(i, ((head, clauses, _), &method))| {
            let path = folder.join(format!("fails{i}.bond"));
            std::fs::write(&path, format!("model Fails{i}\n{head}{clauses}\n")).expect("a model");
            export(&path, method, 1e-3)
        })
        .collect();
    let output = build("failures_at_events", &all, &driver(&all, &|_| (-1, 0.0))).run(&[]);
    for ((one, (_, clauses, wanted)), text) in all.iter().zip(cases).zip(output.split("== ").skip(1)) {
        compare(one, text, &one.simulate(STEPS)).unwrap_or_else(|fault| panic!("{clauses}: {fault}"));
        let said = text.lines().find_map(|line| line.strip_prefix("! ")).unwrap_or_default();
        assert!(said.contains(wanted), "{clauses}: {said:?}");
    }
}

/// There is room for the balance of so many impulses, and no more.
#[test]
fn balances_of_too_many_impulses_are_refused() {
    let folder = common::folder("balances");
    let write = |bodies: usize| {
        let path = folder.join("many.bond");
        let bodies = format!("for i in 1..{bodies} {{ 1:v[i] -> I:m[i](i, f0 = 1) }}\n");
        std::fs::write(&path, format!("model Many\n{bodies}when t > 0.01 {{ reset m[1].f = 2 }}\n")).expect("a model");
        common::export_as(common::read_program(&path), Method::Heun, 1e-3, (false, halfarrow_emit::Real::Double))
    };
    assert!(matches!(write(200), Err(halfarrow_emit::EmitError::Impulses(201))));
    let most = [write(199).expect("there is room")];
    check("balances", &most, &driver(&most, &|_| (-1, 0.0)), |one| one.simulate(STEPS));
}

/// Rates at points beside the run, of which the solution goes on from the one accepted: at time 0 the current of the mains is 0
/// but for the rounding of others, wherever the state is. Both programs give the same bits, and those of the diodes' law.
#[test]
fn unknowns_that_are_rounding_hide_no_solution() {
    let rectifier = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/rectifier/model.bond");
    let all = [export(&rectifier, Method::Heun, 1e-5)];
    let charges = [1e-12, 3e-11, 1e-9, 2.5e-8, 1e-6, 2.5e-6, 7e-5];
    let mut text = String::from(common::DRIVER.split("#define").next().expect("a head"));
    let name = &all[0].written.name;
    let points: Vec<String> = charges.iter().map(|x| format!("{x:?}")).collect();
    let _ = write!(
        text,
        "int main(void)\n{{\n    static {name} m;\n    static const double x[] = {{{}}};\n    int i;\n    \
         if ({name}_reset(&m) != 0 || {name}_start(&m, 0.0) != 0) {{\n        return 1;\n    }}\n    \
         for (i = 0; i < {}; ++i) {{\n        double rate = 0.0;\n        \
         if ({name}_rates(&m, 0.0, &x[i], &rate) != 0) {{\n            return 2;\n        }}\n        bits(rate);\n    }}\n    \
         return 0;\n}}\n",
        points.join(", "),
        charges.len()
    );
    let output = build("hidden", &all, &text).run(&[]);
    let (mut model, mut x) = (all[0].model.clone(), all[0].start.clone());
    model.handle_event(0.0, &mut x).expect("a start");
    model.accept(0.0, &x).expect("a start");
    for (found, charge) in output.split_whitespace().zip(charges) {
        let mut rate = [0.0];
        model.rates(0.0, &[charge], &mut rate).expect("a solution");
        assert_eq!(u64::from_str_radix(found, 16).expect("bits"), rate[0].to_bits(), "at {charge}");
        let voltage = charge / 10e-6;
        let diode = 1e-9 * (math::exp(-0.5 * voltage / 50e-3) - 1.0) - 1e-6 * 0.5 * voltage;
        let wanted = 2.0 * diode - voltage / 1e3;
        assert!((rate[0] - wanted).abs() <= 1e-9 * wanted.abs(), "{} but {wanted}", rate[0]);
    }
}

/// No undefined behaviour, nothing read that was not written; clang sees no warning and gives the same bits.
#[test]
fn c_is_clean() {
    let all: Vec<Exported> = ["contact", "bridge", "tables", "delay", "mesh", "net", "net_cubic"]
        .iter()
        .chain(&[
            "when_beam",
            "when_four_bar",
            "when_gears",
            "when_order",
            "when_relay",
            "when_sampled",
            "when_springs",
            "unsteady_ratio",
        ])
        .map(|name| export(&own(name), Method::ImplicitMidpoint, 1e-3))
        .chain([common::export_projecting(&common::speeds(), Method::ImplicitMidpoint, 4e-3)])
        .collect();
    let driver = driver(&all, &|_| (-1, 0.0));
    let checked =
        build_with("undefined", &all, &driver, &["-O0", "-g", "-fsanitize=undefined", "-fno-sanitize-recover=all"]);
    let wanted = checked.run(&[]);
    let required = std::env::var_os("HALFARROW_C_TOOLS").is_some();
    let there = |tool: &str| Command::new(tool).arg("--version").output().is_ok_and(|out| out.status.success());
    if required || there("clang") {
        let with_clang = common::build_by("clang", "clang", &all, &driver, &["-O2"]);
        assert!(with_clang.run(&[]) == wanted, "clang gives other bits");
    }
    if required || there("valgrind") {
        let plain = build_with("plain", &all, &driver, &["-O1", "-g"]);
        assert!(plain.run(&[]) == wanted, "-O1 gives other bits");
        let out = Command::new("valgrind")
            .args(["--error-exitcode=9", "--leak-check=full", "--quiet"])
            .arg(plain.path())
            .output()
            .expect("valgrind runs");
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        assert!(String::from_utf8_lossy(&out.stdout) == wanted, "valgrind gives other bits");
    }
}

/// Builds and runs models and compares each with what is wanted of it.
pub fn check(name: &str, all: &[Exported], driver: &str, wanted: impl Fn(&Exported) -> (Rows, Option<String>)) {
    let output = build(name, all, driver).run(&[]);
    let mut faults = Vec::new();
    let mut texts = output.split("== ").skip(1);
    for one in all {
        let text = texts.next().expect("each model says something");
        if let Err(fault) = compare(one, text, &wanted(one)) {
            faults.push(format!("{}: {fault}", one.written.name));
        }
    }
    assert!(faults.is_empty(), "{} of {}\n{}", faults.len(), all.len(), faults.join("\n"));
}

/// A program that runs all models and prints the bits of their outputs; with the number of a parameter for each, and its
/// value, if it is not below 0.
pub fn driver(all: &[Exported], set: &dyn Fn(&Exported) -> (i32, f64)) -> String {
    let mut text = String::from(common::DRIVER);
    for one in all {
        let name = &one.written.name;
        let _ = writeln!(text, "RUN({name}, {})", name.to_uppercase());
    }
    text += "int main(void)\n{\n";
    for one in all {
        let _ = writeln!(text, "    run_{}({STEPS}, {}, {:?});", one.written.name, set(one).0, set(one).1);
    }
    text + "    return 0;\n}\n"
}

fn compare(one: &Exported, text: &str, (wanted, failure): &(Rows, Option<String>)) -> Result<(), String> {
    let rows: Vec<Vec<u64>> = text
        .lines()
        .skip(1)
        .filter(|line| !line.starts_with('!'))
        .map(|line| line.split_whitespace().map(|w| u64::from_str_radix(w, 16).expect("bits")).collect())
        .collect();
    let said = text.lines().find_map(|line| line.strip_prefix("! "));
    for (i, (found, wanted)) in rows.iter().zip(wanted).enumerate() {
        for (k, (&found, &wanted)) in found.iter().zip(wanted).enumerate() {
            if found != wanted.to_bits() {
                let what = if k == 0 { "t" } else { one.outputs[k - 1].as_str() };
                let found = f64::from_bits(found);
                return Err(format!("{what} is {found:?} at step {i}, but {wanted:?}: {:e}", found - wanted));
            }
        }
    }
    match (said, failure) {
        (None, None) if rows.len() == wanted.len() => Ok(()),
        (Some(_), Some(_)) if rows.len() == wanted.len() => Ok(()),
        (said, failure) => Err(format!("{} rows, but {}: {said:?}, but {failure:?}", rows.len(), wanted.len())),
    }
}

/// Parameters for which the equations are others have a status of their own: no run starts or goes on with them.
#[test]
fn c_refuses_parameters_for_which_the_equations_are_others() {
    let all = [export(&common::difference(), Method::Heun, 1e-3)];
    let name = &all[0].written.name;
    let upper = name.to_uppercase();
    let mut text = String::from("#include <stdio.h>\n\n");
    let _ = write!(
        text,
        "int main(void)\n{{\n    static {name} m;\n    int said[8];\n    int i;\n    \
         said[0] = {name}_reset(&m);\n    said[1] = {name}_set_parameter(&m, {upper}_P_b, 2.0);\n    \
         puts({name}_message(&m));\n    said[2] = {name}_start(&m, 0.0);\n    \
         said[3] = {name}_set_parameter(&m, {upper}_P_a, 2.0);\n    said[4] = {name}_start(&m, 0.0);\n    \
         said[5] = {name}_step(&m);\n    (void){name}_set_parameter(&m, {upper}_P_b, 1.0);\n    said[6] = {name}_step(&m);\n    \
         (void){name}_set_parameter(&m, {upper}_P_a, 1.0);\n    said[7] = {name}_step(&m);\n    \
         for (i = 0; i < 8; ++i) {{\n        printf(\"%d \", said[i] == {upper}_STRUCTURE ? 1 : said[i] == {upper}_OK ? 0 : 9);\n    }}\n    \
         return 0;\n}}\n"
    );
    let output = build("structure", &all, &text).run(&[]);
    assert!(output.contains("derived where a - b is zero"), "{output}");
    assert!(output.trim_end().ends_with("0 1 1 0 0 0 1 0"), "{output}");
}
