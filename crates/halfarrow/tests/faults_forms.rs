//! Small models on which forms, laws of vanishing or infinite slope, and nodes that float went wrong.

use std::fs;
use std::path::Path;

use halfarrow::{Error, Export, FixedMethod, Form, Input, Method, Model, Record, Run, Simulated, Target};

const FORMS: [Form; 6] = [Form::Minimal, Form::Kane, Form::Inverted, Form::Break, Form::Relaxed, Form::Lagrange];

fn fault(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults").join(format!("{name}.bond"));
    Model::load(&path, &[]).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn text(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn run(form: Form, to: f64, names: &[&str]) -> Run {
    let names = names.iter().map(|n| n.to_string()).collect();
    Run { to, every: Some(to), form, rtol: 1e-9, record: Record::Names(names), ..Run::default() }
}

/// The last values of a run.
fn ends(model: &Model, run: &Run) -> Result<Vec<f64>, Error> {
    let done = model.simulate(run, &mut |_| true)?;
    Ok(last(&done))
}

fn last(done: &Simulated) -> Vec<f64> {
    let names = done.trace.columns.iter().filter(|c| c.name != "t");
    names.map(|c| *c.values.last().expect("a value")).collect()
}

fn agree(a: &[f64], b: &[f64], tolerance: f64, what: &str) {
    let scale = b.iter().fold(1e-300f64, |most, v| most.max(v.abs()));
    let apart = a.iter().zip(b).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
    assert!(a.len() == b.len() && apart <= tolerance * scale, "{what}: {a:?} and {b:?}");
}

#[test]
fn momenta_are_kept_where_a_source_jumps() {
    let model = fault("jump_inverted");
    for form in FORMS {
        let end = ends(&model, &run(form, 1.0, &["a.f", "b.f"])).unwrap_or_else(|e| panic!("{}: {e}", form.name()));
        agree(&end, &[0.5, 0.5], 1e-9, form.name());
    }
    let model = fault("jump_inverted2");
    let minimal = ends(&model, &run(Form::Minimal, 1.0, &["I1.f", "I2.f"])).unwrap();
    for form in [Form::Inverted, Form::Break, Form::Relaxed, Form::Lagrange] {
        let end = ends(&model, &run(form, 1.0, &["I1.f", "I2.f"])).unwrap_or_else(|e| panic!("{}: {e}", form.name()));
        agree(&end, &minimal, 1e-7, form.name());
    }
}

/// Two inductances that share a flow which jumps, in every way in which a source can.
#[test]
fn every_kind_of_jump_is_the_same_in_every_form() {
    let csv = std::env::temp_dir().join(format!("halfarrow_jump_{}.csv", std::process::id()));
    fs::write(&csv, "t,u\n0,0\n0.3,0\n0.3,1\n1,1\n").unwrap();
    let sources = [
        ("if t < 0.3 then 0 else 1", ""),
        ("if mod(t, 0.4) < 0.3 then 0 else 1", ""),
        ("sample(t, 0.3)", ""),
        ("sample(x + t, 0.3)", "state x' = la.f from 0\n"),
        ("floor(4*t)", ""),
        ("delay(if t < 0.1 then 0 else 1, 0.2)", ""),
        ("if x > 0.3 then 1 else 0", "state x' = 1 from 0\n"),
        ("u", "input u = 0\n"),
    ];
    for (source, before) in sources {
        let graph = format!(
            "model Jump\n{before}Sf:s({source}) -> 0:n\nn -> 1:a -> I:la(1)\na -> R:ra(0.5)\nn -> 1:b -> I:lb(3)\nb -> R:rb(0.2)\n"
        );
        let model = text(&graph);
        let inputs: Vec<(String, Input)> =
            if source == "u" { vec![("u".to_string(), csv.clone().into())] } else { Vec::new() };
        let of = |form| {
            let run = Run { inputs: inputs.clone(), ..run(form, 1.0, &["la.f", "lb.f"]) };
            ends(&model, &run)
        };
        let minimal = of(Form::Minimal).unwrap_or_else(|e| panic!("{source}: {e}"));
        let mut told = 0;
        for form in FORMS {
            match of(form) {
                Ok(end) => {
                    agree(&end, &minimal, 1e-6, &format!("{source} {}", form.name()));
                    told += 1;
                }
                // The rate of a speed takes that of the source: refused with the reason.
                Err(error) => assert!(error.to_string().contains("derivative"), "{source} {}: {error}", form.name()),
            }
        }
        assert!(told >= 3, "{source}: {told}");
    }
    let _ = fs::remove_file(csv);
}

#[test]
fn speeds_that_jump_are_not_exported() {
    let export = |form| fault("jump_inverted").export(&Export { target: Target::C, form, ..Export::default() });
    assert!(export(Form::Minimal).is_ok());
    let error = export(Form::Kane).expect_err("a state that jumps").to_string();
    assert!(error.contains("jumps") && error.contains("minimal"), "{error}");
}

/// A factor the other way round is used as it is given: at 0 it passes nothing on.
#[test]
fn factors_from_out_to_in_may_vanish() {
    let lever = |two_port: &str| {
        text(&format!(
            "model M\nstate x' = w.f from 0\n0:n -> C:c(1, e0 = 2)\n1:w -> I:m(1, f0 = 1)\nw -> I:m2(1)\nw -> R:r(0.3)\n{two_port}\n"
        ))
    };
    let swing = |two_port: &str| {
        text(&format!("model M\nlet x = t - 1\n1:n -> C:c(1, q0 = 2)\nn -> R:r(1)\n0:k -> C:kk(1)\n{two_port}\n"))
    };
    let pairs = [
        (lever("n -> TF:t(e_out = x) -> w"), lever("w -> TF:t(f_out = -x) -> n"), ["m.f", "c.q"]),
        (swing("n -> GY:t(f_out = x) -> k"), swing("n -> GY:g(1) -> 1:j -> TF:t(f_out = x) -> k"), ["c.q", "kk.q"]),
    ];
    for (given, turned, names) in &pairs {
        let wanted = ends(turned, &run(Form::Minimal, 2.0, names)).unwrap_or_else(|e| panic!("{e}"));
        for form in FORMS {
            let found = ends(given, &run(form, 2.0, names)).unwrap_or_else(|e| panic!("{}: {e}", form.name()));
            agree(&found, &wanted, 1e-7, form.name());
        }
        // The factor is 0 exactly at a step.
        let method = Method::Fixed(FixedMethod::Rk4);
        let fixed = Run { method, step: Some(0.125), ..run(Form::Minimal, 2.0, names) };
        agree(&ends(given, &fixed).unwrap_or_else(|e| panic!("{e}")), &wanted, 1e-3, "rk4");
    }
}

/// At the start rounding may put an argument on the side that the law does not take; when it leaves 0 the side changes.
#[test]
fn a_side_taken_at_rest_is_left() {
    let model = fault("root_at_rest");
    let done =
        model.simulate(&run(Form::Minimal, 0.4, &["r8.e", "r8.f"]), &mut |_| true).unwrap_or_else(|e| panic!("{e}"));
    let [e, f] = last(&done)[..] else { panic!("two values") };
    assert!((f - 0.552 * e.signum() * e.abs().sqrt()).abs() < 1e-12, "{e} and {f}");
    assert!(f > 0.03, "it has moved: {f}");
}

/// The slope before a kink tells nothing of the way behind it. The reference is the same circuit with the diode solved for its
/// effort.
#[test]
fn kinks_of_laws_are_crossed() {
    let given = fault("kinked_diode");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/kinked_diode.bond");
    let source = fs::read_to_string(path).expect("the model is there");
    let turned = text(&source.replace("f = if e > 0 then e/0.02 else e/1e5", "e = if f > 0 then 0.02*f else 1e5*f"));
    let names = ["coil.f", "cout.q"];
    let wanted = ends(&turned, &run(Form::Minimal, 1e-3, &names)).unwrap_or_else(|e| panic!("{e}"));
    for method in [Method::Auto, Method::Radau, Method::Bdf] {
        let found = ends(&given, &Run { method, ..run(Form::Minimal, 1e-3, &names) });
        let found = found.unwrap_or_else(|e| panic!("{method:?}: {e}"));
        // Where the diode blocks, the coil's current is 1e-4 of what it was.
        agree(&found, &wanted, 1e-5, "kinks");
    }
}

#[test]
fn a_vanishing_slope_does_not_hide_a_flow() {
    let model = fault("break_rate");
    for form in FORMS {
        let end = ends(&model, &run(form, 1.0, &["c1.f", "c2.f"])).unwrap_or_else(|e| panic!("{}: {e}", form.name()));
        agree(&end, &[0.363904, 0.534648], 3e-6, form.name());
    }
}

#[test]
fn a_law_without_a_state_stops_where_its_solution_ends() {
    let model = fault("fold_static");
    let methods =
        [(Method::Auto, None), (Method::Explicit, None), (Method::Bdf, None), (Method::Radau, None)].into_iter();
    let fixed = [1e-2, 3e-3, 1e-3].map(|step| (Method::Fixed(FixedMethod::Rk4), Some(step)));
    for (method, step) in methods.chain(fixed) {
        for record in [Record::Default, Record::Names(vec!["a.f".to_string()])] {
            let run = Run { to: 2.0, method, step, record, ..Run::default() };
            let Err(Error::Run(stopped)) = model.simulate(&run, &mut |_| true) else { panic!("{method:?} goes on") };
            let time = stopped.report.reached;
            assert!((0.045..=0.0661).contains(&time), "{method:?} {step:?}: {time}");
            assert!(stopped.failure.to_string().contains("two solutions"), "{}", stopped.failure);
        }
    }
    // The outer branch goes on until the source comes back below the fold.
    let model = text("model Fold\nSe:s(0.4 + sin(6*t)) -> 1:j -> R:a(e = f^3 - f)\nj -> R:b(0.1)\n");
    let Err(Error::Run(stopped)) = model.simulate(&Run { to: 2.0, ..Run::default() }, &mut |_| true) else {
        panic!("it goes on")
    };
    // 0.4 + sin(6 t) = -0.32863 where it falls.
    assert!((stopped.report.reached - 0.6593).abs() < 3e-3, "{}", stopped.report.reached);
}

/// Against an integration of the same circuit with a leakage of 1e-12 S beside each diode, by other means: classical
/// Runge-Kutta with steps of 20 us, node voltages by Newton in each stage.
#[test]
fn a_bridge_of_diodes_without_leakage_runs() {
    let model = fault("bridge_rectifier");
    let exact = [(0.01, 9.46245337), (0.02, 9.50519915), (0.05, 9.50718417), (0.1, 9.50718436)];
    for form in [Form::Minimal, Form::Kane, Form::Lagrange] {
        let run = Run { to: 0.1, every: Some(0.01), form, ..Run::default() };
        let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}: {e}", form.name()));
        let vdc = &done.trace.columns.iter().find(|c| c.name == "vdc").expect("an output").values;
        for (t, value) in exact {
            let here = vdc[(t / 0.01f64).round() as usize];
            assert!((here - value).abs() < 3e-5, "{} at {t}: {here}", form.name());
        }
        assert!(done.report.notes.iter().any(|n| n.contains("float")), "{:?}", done.report.notes);
    }
    let run =
        Run { to: 0.1, every: Some(0.01), method: Method::Fixed(FixedMethod::Rk4), step: Some(1e-4), ..Run::default() };
    let done = model.simulate(&run, &mut |_| true).unwrap();
    let vdc = done.trace.columns.iter().find(|c| c.name == "vdc").expect("an output").values[10];
    assert!((vdc - 9.50718436).abs() < 1e-3, "{vdc}");
}

#[test]
fn infinite_slopes_are_passed() {
    // q' = 1 - sqrt(q): t = -2 (s + log(1 - s)) with s = sqrt(q), at 0.1.
    let exact = 0.0805484;
    for method in [Method::Auto, Method::Explicit, Method::Bdf, Method::Radau] {
        for law in ["e = f*abs(f)", "f = sign(e)*sqrt(abs(e))", "e = f^2*sign(f)"] {
            let model = text(&format!("model Orifice\nSf:pump(1) -> 0:n -> C:tank(1)\nn -> R:o({law})\n"));
            let run = Run { method, ..run(Form::Minimal, 0.1, &["tank.q"]) };
            let end = ends(&model, &run).unwrap_or_else(|e| panic!("{method:?} {law}: {e}"));
            agree(&end, &[exact], 2e-3, &format!("{method:?} {law}"));
        }
    }
    let model = fault("hydraulic_orifice");
    let exact = ends(&model, &Run { method: Method::Explicit, ..run(Form::Minimal, 0.1, &["x", "p"]) }).unwrap();
    for method in [Method::Auto, Method::Bdf, Method::Radau] {
        let end = ends(&model, &Run { method, ..run(Form::Minimal, 0.1, &["x", "p"]) });
        agree(&end.unwrap_or_else(|e| panic!("{method:?}: {e}")), &exact, 1e-3, &format!("{method:?}"));
    }
}

/// A sequence of numbers that is always the same.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % n
    }

    fn of<'a>(&mut self, all: &[&'a str]) -> &'a str {
        all[self.below(all.len())]
    }
}

/// A graph of junctions in a ring or a chain with storages whose laws are exponential, bounded, of slope zero at 0, or
/// given the other way round.
fn graph(random: &mut Random) -> String {
    let inertances =
        ["1", "2.5", "f = 2*(exp(p) - 1)", "f = 2*p/sqrt(1 + p^2)", "f = p^3", "p = f^3", "f = tanh(p)", "p = sinh(f)"];
    let compliances = ["1", "0.4", "e = exp(q) - 1", "e = q^3", "q = e^3", "e = tanh(q)", "e = q*abs(q)"];
    let resistors =
        ["3", "e = f^3", "f = e^3", "e = f*abs(f)", "e = tanh(f) + 0.2*f", "0 = e - 2*f - f^3", "f = exp(e) - 1"];
    let sources = ["1", "sin(3*t)", "if t < 0.5 then 0 else 1", "t"];
    let n = 2 + random.below(3);
    let kinds: Vec<&str> = (0..n).map(|_| random.of(&["0", "1"])).collect();
    let mut text = String::from("model N\n");
    for (i, kind) in kinds.iter().enumerate() {
        text += &format!("{kind}:j{i}\n");
    }
    let ring = usize::from(n > 2 && random.below(3) == 0);
    for i in 0..n - 1 + ring {
        let (a, b) = (i, (i + 1) % n);
        text += &match random.below(5) {
            0 => format!("j{a} -> TF:t{i}({}) -> j{b}\n", random.of(&["2", "-1", "0.5"])),
            1 => format!("j{a} -> MGY:g{i}({}) -> j{b}\n", random.of(&["2", "1.5 + 0.5*sin(t)"])),
            _ => format!("j{a} -> j{b}\n"),
        };
    }
    for i in 0..n {
        for k in 0..1 + random.below(3) {
            text += &match random.below(7) {
                0..3 => format!("j{i} -> I:I{i}{k}({})\n", random.of(&inertances)),
                3 => format!("j{i} -> C:C{i}{k}({})\n", random.of(&compliances)),
                4 => format!("j{i} -> R:R{i}{k}({})\n", random.of(&resistors)),
                5 => format!("Se:e{i}{k}({}) -> j{i}\n", random.of(&sources)),
                _ => format!("Sf:f{i}{k}({}) -> j{i}\n", random.of(&sources)),
            };
        }
    }
    text
}

#[test]
fn no_form_of_a_random_graph_panics() {
    for name in ["panic_kane", "panic_kane_big"] {
        for form in FORMS {
            assert!(fault(name).equations(form).is_ok(), "{name} {}", form.name());
        }
    }
    let count = std::env::var("HALFARROW_GRAPHS").ok().and_then(|n| n.parse().ok()).unwrap_or(30);
    let (mut random, mut derived) = (Random(7), 0);
    for number in 0..count {
        let graph = graph(&mut random);
        let Ok(model) = Model::from_text("random.bond", &graph, &[]) else { continue };
        for form in FORMS {
            let call = || model.equations(form).is_ok();
            let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(call));
            derived += usize::from(done.unwrap_or_else(|_| panic!("graph {number} {}:\n{graph}", form.name())));
        }
    }
    assert!(derived > count, "{derived} of {count} graphs");
}

/// A source of value zero leaves the rows of all that reads it, near or far: what nothing moves is a constant.
#[test]
fn a_constraint_at_rest_moves_nothing() {
    let report = fault("constraint_at_rest").equations(Form::Minimal).expect("equations");
    assert!(report.states.is_empty() && report.legend.join(" ").contains("K1 = q_C12"), "{:?}", report.legend);
}
