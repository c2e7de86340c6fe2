//! Parameters that change after the equations were derived: where they break what was decided by the values before, the
//! equations are derived anew or the run is refused, and never go on with those of another machine.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::path::Path;

use halfarrow::{Error, FixedMethod, Form, Method, Model, Override, Record, Reduce, Run, Sweep, SweepReport, Vary};
use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_exec as exec;
use halfarrow_sim::{Failure, System};

fn fault(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/faults/{name}.bond"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn set(name: &str, value: f64) -> Override {
    Override { name: name.into(), value: format!("{value:?}") }
}

fn run_of(method: Method) -> Run {
    Run { to: 1.0, method, step: Some(1e-2), ..Run::default() }
}

/// A sweep of these parameters, and its rows.
fn sweep(model: &Model, vary: &[&str], kept: &str, method: Method) -> (SweepReport, Vec<Vec<f64>>) {
    let folder = temp_dir::TempDir::new().unwrap();
    let out = folder.path().join("r.csv");
    let sweep = Sweep {
        run: run_of(method),
        vary: vary.iter().map(|v| Vary::parse(v).unwrap()).collect(),
        samples: None,
        reduce: vec![Reduce::parse(&format!("final({kept})")).unwrap()],
        restart: true,
        units: false,
        part: None,
    };
    let report = model.sweep(&sweep, &out, &mut |_, _| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let text = std::fs::read_to_string(&out).unwrap();
    let row = |line: &str| line.split(',').map(|f| f.parse().expect("a number")).collect();
    (report, text.lines().skip(1).map(row).collect())
}

/// The last value of a run of the model with these parameters, whatever its audit says; `None` if there is none.
fn alone(text: &str, set: &[Override], kept: &str, method: Method) -> Option<f64> {
    let model = Model::from_text("alone.bond", text, set).ok()?;
    let run = Run { record: Record::Names(vec![kept.into()]), ..run_of(method) };
    let trace = match model.simulate(&run, &mut |_| true) {
        Ok(done) => done.trace,
        Err(Error::Run(stopped)) if matches!(stopped.failure, Failure::Untrue { .. }) => stopped.trace,
        Err(_) => return None,
    };
    trace.columns[0].values.last().copied()
}

/// The model as a program, with all parameters at their defaults.
fn program(text: &str) -> exec::Model {
    let text = Text { name: "model.bond", text, files: &NoFiles, overrides: &[] };
    let reached = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false)));
    exec::Model::new(reached.ir).unwrap()
}

/// A transformer whose ratio vanishes at the defaults: the storages behind it have no freedom of their own there.
const DIFFERENCE: &str = "model Difference\nparam a = 1, b = 1, m1 = 1, m2 = 2, r = 0.5\n1:x -> I:I1(m1, f0 = 1)\n\
                          x -> TF:t(a - b) -> 1:y\ny -> I:I2(m2)\ny -> R:R1(r)\n";

#[test]
fn a_sweep_over_values_that_change_the_structure_gives_what_runs_alone_give() {
    let cases = [(fault("sweep_structural_zero"), "b=list(1,2,-1,0.5,1)"), (DIFFERENCE.into(), "b=list(2,1,-1,0,1)")];
    for (text, vary) in cases {
        for method in [Method::Fixed(FixedMethod::Rk4), Method::Auto] {
            let model = Model::from_text("model.bond", &text, &[]).unwrap();
            let (report, rows) = sweep(&model, &[vary], "I1.f", method);
            assert_eq!((report.failed, report.audit.sets, report.audit.refused), (0, 5, 0), "{report:?}");
            for row in &rows {
                let wanted = alone(&text, &[set("b", row[1])], "I1.f", method).expect("a run");
                assert!((row[2] - wanted).abs() <= 1e-6, "b = {}: {}, alone {wanted}", row[1], row[2]);
            }
            let ends: Vec<f64> = rows.iter().map(|row| row[2]).collect();
            assert!(ends.iter().any(|end| (end - ends[0]).abs() > 0.1), "{ends:?}");
        }
    }
}

#[test]
fn a_model_whose_equations_no_longer_hold_does_not_start() {
    let mut model = program(DIFFERENCE);
    model.initialise(0.0).unwrap();
    model.set_parameter("b", 2.0).unwrap();
    let failure = model.broken().expect("a - b is not zero");
    assert!(matches!(&failure, Failure::Structure { assumed } if assumed == "a - b is zero"), "{failure:?}");
    assert!(failure.to_string().contains("--set"), "{failure}");
    assert!(model.initialise(0.0).is_err());
    // Another parameter mends it; set at once, nothing breaks on the way.
    model.set_parameter("a", 2.0).unwrap();
    assert!(model.broken().is_none() && model.initialise(0.0).is_ok());
    model.set_parameters([("a", 0.3), ("b", 0.3)]).unwrap();
    assert!(model.broken().is_none());
    // What vanishes but for rounding vanishes.
    model.set_parameters([("a", 0.1 + 0.2), ("b", 0.3)]).unwrap();
    assert!(model.broken().is_none());
    // No structure rests on the others.
    model.set_parameters([("m1", 7.0), ("m2", 1e-9), ("r", -3.0), ("a", 2.0), ("b", 2.0)]).unwrap();
    assert!(model.broken().is_none());
    // Here the coupling stays in, and nothing has to be derived anew.
    let mut model = program(&fault("sweep_structural_zero"));
    model.set_parameter("b", 2.0).unwrap();
    assert!(model.broken().is_none());
}

#[test]
fn signs_that_were_used_are_assumed_and_no_others() {
    let text = "model Signs\nparam p = 2, g = 3, h = 1, k = 4\n1:a -> I:m(1, f0 = 1)\na -> C:c(k = k)\n\
                a -> R:r(e = g*abs(p*f))\na -> R:s(e = h*f)\n";
    for (name, breaks) in [("p", true), ("g", false), ("h", false)] {
        let mut model = program(text);
        let value = -model.parameter(name).unwrap();
        model.set_parameter(name, value).unwrap();
        assert_eq!(model.broken().is_some(), breaks, "{name}: {:?}", model.broken());
        let model = Model::from_text("model.bond", text, &[]).unwrap();
        let vary = format!("{name}=list(1,-1,2)");
        let (report, rows) = sweep(&model, &[&vary], "m.f", Method::Fixed(FixedMethod::Rk4));
        assert_eq!(report.failed, 0, "{report:?}");
        for row in rows {
            let wanted = alone(text, &[set(name, row[1])], "m.f", Method::Fixed(FixedMethod::Rk4)).expect("a run");
            assert!((row[2] - wanted).abs() <= 1e-12, "{name} = {}: {}, alone {wanted}", row[1], row[2]);
        }
    }
}

/// Gyrators whose moduli were divided by in an attempt that was given up: the equations hold for all of them.
#[test]
fn what_was_tried_and_given_up_refuses_no_value() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/two_class3_C/model.bond");
    let text = std::fs::read_to_string(path).unwrap();
    for (a, b) in [(4.0, 4.0), (0.0, 4.0), (1.5, 0.0)] {
        let mut model = program(&text);
        model.set_parameters([("a", a), ("b", b)]).unwrap();
        assert!(model.broken().is_none(), "a = {a}, b = {b}: {:?}", model.broken());
        let vary = [format!("a=list(1.5,{a:?})"), format!("b=list(4,{b:?})")];
        let vary: Vec<&str> = vary.iter().map(String::as_str).collect();
        let model = Model::from_text("model.bond", &text, &[]).unwrap();
        let (report, rows) = sweep(&model, &vary, "f1", Method::Fixed(FixedMethod::Rk4));
        assert_eq!(report.failed, 0, "{report:?}");
        let wanted = alone(&text, &[set("a", a), set("b", b)], "f1", Method::Fixed(FixedMethod::Rk4)).expect("a run");
        let found = rows.last().unwrap()[3];
        assert!((found - wanted).abs() <= 1e-12, "a = {a}, b = {b}: {found}, alone {wanted}");
    }
}

/// A time of a delay that is above zero by the values of its parameters only is above zero whenever they are set.
#[test]
fn compound_times_stay_above_zero() {
    let text = "model Late\nparam a = 0.3, b = 0.1\n1:x -> I:m(1, f0 = 1)\nx -> R:r(0.2)\n\
                let late = delay(m.f, a - b)\nSe:back(-late) -> x\n";
    let mut model = program(text);
    model.set_parameter("b", 0.2).unwrap();
    assert!(model.broken().is_none());
    model.set_parameter("b", 0.4).unwrap();
    let failure = model.broken().expect("a - b is below zero");
    assert!(matches!(&failure, Failure::Structure { assumed } if assumed == "a - b is above zero"), "{failure:?}");
    assert!(model.initialise(0.0).is_err());
    let model = Model::from_text("model.bond", text, &[]).unwrap();
    let (report, rows) = sweep(&model, &["b=list(0.1,0.4)"], "m.f", Method::Fixed(FixedMethod::Rk4));
    assert_eq!((report.failed, rows[0][2].is_finite(), rows[1][2].is_finite()), (1, true, false), "{rows:?}");
}

/// Divisors that read a momentum of which no equation is left: there is no step before which they could be looked at.
#[test]
fn a_divisor_that_nothing_evaluates_is_not_guarded() {
    let text = "model Product\n0:j0\n0:j1\nTF:t1(1 - i.p)\nTF:t2(i.p - 2)\nI:i(1)\n\
                t1 -> j0\nj1 -> t2\nt2 -> j0\nj0 -> t1\nj1 -> i\n";
    assert_eq!(System::states(&program(text)), 0);
}

#[test]
fn a_controller_without_a_gain_gets_it() {
    let text = "model Controlled\nparam kp = 3, ki = 0, kd = 0\n1:a -> I:m(1, f0 = 1)\na -> R:r(0.2)\n\
                state x' = m.f\nlet u = pid(1 - x, kp, ki, kd, filter = 0.1)\nSe:drive(u) -> a\n";
    let model = Model::from_text("model.bond", text, &[]).unwrap();
    let (report, rows) = sweep(&model, &["ki=list(0,2)", "kd=list(0,0.3)"], "m.f", Method::Fixed(FixedMethod::Rk4));
    assert_eq!(report.failed, 0, "{report:?}");
    for row in &rows {
        let with = [set("ki", row[1]), set("kd", row[2])];
        let wanted = alone(text, &with, "m.f", Method::Fixed(FixedMethod::Rk4)).expect("a run");
        assert!((row[3] - wanted).abs() <= 1e-12, "{row:?}, alone {wanted}");
    }
    assert!((rows[0][3] - rows[1][3]).abs() > 1e-3 && (rows[0][3] - rows[2][3]).abs() > 1e-3, "{rows:?}");
}

/// Numbers that look random, the same every time.
struct Draw(u64);

impl Draw {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n
    }
}

const MODULI: [&str; 4] = ["-1", "0", "1", "2"];

/// Junctions in a ring or a tree, storages and resistors at them, and between some of them two-ports whose moduli are
/// parameters.
fn random_graph(draw: &mut Draw) -> String {
    let junctions = 3 + draw.below(3);
    let mut text = String::from("model Random\n");
    let moduli: Vec<&str> = (0..3).map(|_| MODULI[draw.below(4)]).collect();
    text += &format!("param p0 = {}, p1 = {}, p2 = {}\n", moduli[0], moduli[1], moduli[2]);
    text += "1:j0\nSe:drive(1) -> j0\nj0 -> I:m(1.5)\nj0 -> R:loss(0.7)\n";
    for j in 1..junctions {
        text += &format!("{}:j{j}\n", draw.below(2));
        text += &match draw.below(4) {
            0 => format!("j{j} -> I:i{j}(0.{})\n", 3 + draw.below(6)),
            1 => format!("j{j} -> C:c{j}(k = {})\n", 1 + draw.below(9)),
            2 => format!("j{j} -> R:r{j}(0.{})\n", 1 + draw.below(9)),
            _ => format!("j{j} -> I:i{j}(2)\nj{j} -> R:r{j}(1.{})\n", draw.below(9)),
        };
    }
    let ratios = ["p0", "p1", "p2", "p0 - p1", "p1*p2"];
    for (n, j) in (1..junctions).chain([1 + draw.below(junctions - 1), 1 + draw.below(junctions - 1)]).enumerate() {
        let from = if n + 1 < junctions { draw.below(j) } else { draw.below(junctions) };
        if from == j {
            continue;
        }
        text += &match draw.below(3) {
            0 => format!("j{from} -> j{j}\n"),
            1 => format!("j{from} -> GY:g{n}({}) -> j{j}\n", ratios[draw.below(5)]),
            _ => format!("j{from} -> TF:t{n}({}) -> j{j}\n", ratios[draw.below(5)]),
        };
    }
    text
}

#[test]
fn random_graphs_give_in_a_sweep_what_they_give_alone() {
    let mut draw = Draw(7);
    let (mut compared, mut anew, mut failed) = (0, 0, 0);
    let method = Method::Fixed(FixedMethod::ImplicitMidpoint);
    for _ in 0..20 {
        let text = random_graph(&mut draw);
        let Ok(model) = Model::from_text("random.bond", &text, &[]) else { continue };
        if alone(&text, &[], "m.f", method).is_none() {
            continue;
        }
        let mut at_defaults = program(&text);
        let lists = ["p0=list(-1,0,1,2)", "p1=list(-1,0,1,2)", "p2=list(1,2,0)"];
        let (_, rows) = sweep(&model, &lists, "m.f", method);
        for row in rows {
            let names = ["p0", "p1", "p2"];
            let with: Vec<Override> = names.iter().zip(&row[1..]).map(|(name, value)| set(name, *value)).collect();
            let wanted = alone(&text, &with, "m.f", method);
            let values = names.into_iter().zip(row[1..].iter().copied());
            anew += usize::from(at_defaults.set_parameters(values).is_err() || at_defaults.broken().is_some());
            failed += usize::from(wanted.is_none());
            compared += 1;
            let found = Some(row[4]).filter(|_| row[5] == 0.0);
            let agree = match (found, wanted) {
                (Some(found), Some(wanted)) => (found - wanted).abs() <= 1e-6 * wanted.abs().max(1.0),
                (found, wanted) => found.is_none() == wanted.is_none(),
            };
            assert!(agree, "{row:?}, alone {wanted:?}\n{text}");
        }
    }
    assert!(compared > 300 && anew > 30 && failed < compared / 2, "{compared} compared, {anew} anew, {failed} failed");
}
