//! A true run passes; one wrong value does not.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow_audit::{Audit, Auditor, Run, audit, wanted};
use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{self, BondGraph, NoFiles};
use halfarrow_compiler::diagnostic::{Sources, render};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A mass on a damped spring behind a lever, pulled: `x'' = u - 2 d x' - x` with mass and stiffness 1.
const MODEL: &str = "model Oscillator
param d = 0.2
Se:pull(1) -> 1:v -> I:mass(1)
v -> R:damper(2*d)
v -> TF:lever(1/2)
lever -> 0:n -> C:spring(k = 4)
";

fn graph(text: &str) -> BondGraph {
    let mut sources = Sources::new();
    let file = sources.add("main.bond", text);
    let parsed = ast::parse(text, file);
    let result = bond_graph::elaborate(parsed.ast, sources, &NoFiles, &[]);
    let said = render(&result.diagnostics, &result.sources, false);
    result.graph.unwrap_or_else(|| panic!("{said}"))
}

type Columns = BTreeMap<String, Vec<f64>>;

/// The exact motion from rest: `x = 1 - e^{-dt} (cos wt + d/w sin wt)`.
fn motion(samples: usize) -> (Vec<f64>, Columns) {
    let (d, times): (f64, Vec<f64>) = (0.2, (0..=samples).map(|k| 5.0 * k as f64 / samples as f64).collect());
    let w = (1.0 - d * d).sqrt();
    let mut columns = Columns::new();
    for &t in &times {
        let (sin, cos, decay) = ((w * t).sin(), (w * t).cos(), (-d * t).exp());
        let x = 1.0 - decay * (cos + d / w * sin);
        let v = decay * sin / w;
        let force = 1.0 - 2.0 * d * v - x;
        // lever: e_in = e_out / 2, f_out = f_in / 2; the spring of stiffness 4 sees x/2.
        let row = [
            ("pull.e", 1.0),
            ("pull.f", v),
            ("v.f", v),
            ("mass.e", force),
            ("mass.f", v),
            ("mass.p", v),
            ("damper.e", 2.0 * d * v),
            ("damper.f", v),
            ("lever.in.e", x),
            ("lever.in.f", v),
            ("lever.out.e", 2.0 * x),
            ("lever.out.f", 0.5 * v),
            ("n.e", 2.0 * x),
            ("spring.e", 2.0 * x),
            ("spring.f", 0.5 * v),
            ("spring.q", 0.5 * x),
        ];
        row.into_iter().for_each(|(name, value)| columns.entry(name.to_string()).or_default().push(value));
    }
    (times, columns)
}

fn names(columns: &Columns) -> Vec<Arc<str>> {
    columns.keys().map(|name| name.as_str().into()).collect()
}

fn check(graph: &BondGraph, times: &[f64], columns: &Columns) -> Audit {
    let names = names(columns);
    let columns: Vec<&[f64]> = columns.values().map(Vec::as_slice).collect();
    let parameters = BTreeMap::from([("d".to_string(), 0.2)]);
    audit(graph, &Run { times, names: &names, columns: &columns, parameters: &parameters })
}

#[test]
fn the_exact_motion_passes() {
    let graph = graph(MODEL);
    let (times, columns) = motion(200);
    assert_eq!(wanted(&graph), columns.keys().cloned().collect::<Vec<_>>());
    let found = check(&graph, &times, &columns);
    assert!(found.unchecked.is_empty() && found.notes.is_empty(), "{found}");
    assert!(found.power.as_ref().unwrap().value < 1e-14, "{found}");
    assert!(found.residual.as_ref().unwrap().value < 1e-14, "{found}");
    let rates = found.rates.as_ref().unwrap();
    let energy = found.energy.as_ref().unwrap();
    assert!(rates.value < 1e-11 && energy.value < 1e-11, "{found}");
    assert!(rates.resolution < 1e-8 && energy.resolution < 1e-8, "{found}");
}

#[test]
fn any_single_wrong_value_is_found() {
    let graph = graph(MODEL);
    let (times, columns) = motion(100);
    for name in columns.keys() {
        let mut wrong = columns.clone();
        let value = &mut wrong.get_mut(name).unwrap()[40];
        *value *= 1.0 + 1e-6;
        let found = check(&graph, &times, &wrong);
        let beyond =
            |f: &Option<halfarrow_audit::Finding>| f.as_ref().is_some_and(|f| f.value > 1e-8 && f.time == times[40]);
        assert!(beyond(&found.residual) || beyond(&found.power), "{name}: {found}");
    }
}

/// What a law is missed by does not depend on how it is written: as numbers times variables, or as something that only comes to
/// the same.
#[test]
fn laws_of_straight_lines_are_measured_as_others_are() {
    let straight = graph(MODEL);
    let bent = MODEL.replace("R:damper(2*d)", "R:damper(e = 2*d*(f + 1e-300*f^3))");
    let bent = graph(&bent.replace("C:spring(k = 4)", "C:spring(e = 4*(q + 1e-300*q^3))"));
    let (times, columns) = motion(100);
    for (name, off) in [("damper.e", 1e-3), ("damper.f", 1e-6), ("spring.q", 1e-9), ("spring.e", 3.0), ("mass.p", 1e-4)]
    {
        let mut wrong = columns.clone();
        wrong.get_mut(name).unwrap()[40] *= 1.0 + off;
        let [one, other] = [&straight, &bent].map(|graph| check(graph, &times, &wrong));
        for (one, other) in [(one.residual, other.residual), (one.rates, other.rates), (one.energy, other.energy)] {
            let (one, other) = (one.unwrap(), other.unwrap());
            assert_eq!((one.time, &one.place), (other.time, &other.place), "{name}");
            assert!((one.value - other.value).abs() <= 1e-6 * other.value, "{name}: {one}, {other}");
        }
    }
}

/// Large models are looked at in parts; one wrong value is found in whichever it is.
#[test]
fn a_wrong_value_is_found_among_thousands_of_laws() {
    const MANY: usize = 20_000;
    let text = format!("model Net\nSe:u(1 V) -> 0:n\nfor i in 1..{MANY} {{\n    n -> R:r[i](i * 1 ohm)\n}}\n");
    let graph = graph(&text);
    let mut columns = Columns::new();
    let mut add = |name: String, value: f64| _ = columns.insert(name, vec![value; 2]);
    for i in 1..=MANY {
        add(format!("r[{i}].e"), 1.0);
        add(format!("r[{i}].f"), 1.0 / i as f64);
    }
    add("n.e".to_string(), 1.0);
    add("u.e".to_string(), 1.0);
    add("u.f".to_string(), (1..=MANY).map(|i| 1.0 / i as f64).sum());
    let found = check(&graph, &[0.0, 1.0], &columns);
    assert!(found.unchecked.is_empty() && found.residual.as_ref().unwrap().value < 1e-13, "{found}");
    for i in [1, 8_192, 8_193, MANY] {
        let mut wrong = columns.clone();
        wrong.get_mut(&format!("r[{i}].f")).unwrap()[1] *= 2.0;
        let residual = check(&graph, &[0.0, 1.0], &wrong).residual.unwrap();
        assert_eq!((residual.time, residual.place), (1.0, format!("r[{i}]: its law")));
        assert!((residual.value - 1.0).abs() < 1e-4, "{}", residual.value);
    }
}

#[test]
fn a_run_that_drifts_is_found_by_its_rates() {
    let graph = graph(MODEL);
    let (times, mut columns) = motion(200);
    // Every law holds at every sample, but the spring takes up more than flows into it.
    for (name, factor) in
        [("spring.q", 1.0), ("spring.e", 4.0), ("n.e", 4.0), ("lever.out.e", 4.0), ("lever.in.e", 2.0)]
    {
        columns.get_mut(name).unwrap().iter_mut().zip(&times).for_each(|(v, t)| *v += factor * 1e-6 * t);
    }
    columns.get_mut("mass.e").unwrap().iter_mut().zip(&times).for_each(|(v, t)| *v -= 2e-6 * t);
    let found = check(&graph, &times, &columns);
    assert!(found.residual.as_ref().unwrap().value < 1e-14, "{found}");
    assert!(found.rates.as_ref().unwrap().value > 1e-6, "{found}");
    assert!(found.energy.as_ref().unwrap().value > 1e-7, "{found}");
}

#[test]
fn what_is_not_recorded_is_said() {
    let graph = graph(MODEL);
    let (times, mut columns) = motion(10);
    columns.remove("damper.e");
    columns.get_mut("mass.f").unwrap()[3] = f64::NAN;
    let found = check(&graph, &times, &columns);
    assert!(found.unchecked.iter().any(|u| u.contains("damper")), "{found}");
    assert!(found.residual.unwrap().value.is_nan());
}

#[test]
fn a_spring_that_stiffens_in_time_is_said_to_make_energy() {
    let graph = graph("model M\nSe:u(1) -> 1:v -> C:spring(k = 1 + t)\nv -> R:d(1)\n");
    let found = check(&graph, &[], &Columns::new());
    assert_eq!(found.notes, ["spring makes or eats energy: its law changes with t"]);
}

#[test]
fn an_implicit_law_with_an_if_at_its_root_is_measured_by_what_its_variables_make_of_it() {
    let graph = graph("model M\nSe:u(1) -> 1:v -> I:mass(1)\nv -> R:r(0 = if f > 0 then e - 2*f else e - 3*f)\n");
    let times: Vec<f64> = (0..50).map(|k| 0.02 * k as f64).collect();
    let mut columns = Columns::new();
    for t in &times {
        let f = 0.5 * (1.0 - (-2.0 * t).exp()) + 0.1 * (-2.0 * t).exp();
        let row = [
            ("u.e", 1.0),
            ("u.f", f),
            ("v.f", f),
            ("mass.e", 1.0 - 2.0 * f),
            ("mass.f", f),
            ("mass.p", f),
            ("r.e", 2.0 * f * (1.0 + 1e-15)),
            ("r.f", f),
        ];
        row.into_iter().for_each(|(name, value)| columns.entry(name.to_string()).or_default().push(value));
    }
    let found = check(&graph, &times, &columns);
    assert!(found.unchecked.is_empty() && found.residual.as_ref().unwrap().value < 1e-13, "{found}");
    columns.get_mut("r.e").unwrap()[20] *= 1.001;
    let found = check(&graph, &times, &columns);
    assert!((1e-4..1e-2).contains(&found.residual.unwrap().value));
}

/// A force that changes where `x` passes 0: the sample behind the jump stands on the border, where the run has gone over and
/// the condition by itself has not.
#[test]
fn a_condition_on_its_border_is_read_as_the_run_held_it() {
    let graph = graph("model M\nSe:u(if x > 0 then 1 else 2) -> 1:v -> I:mass(1)\nstate x' = v.f from -1\n");
    let jump = 0.5 * (5.0f64.sqrt() - 1.0);
    let speed = 1.0 + 2.0 * jump;
    let motion = |on_border: f64, force: f64| {
        let (mut times, mut columns) = (Vec::new(), Columns::new());
        let mut add = |t: f64, [force, speed, x]: [f64; 3]| {
            times.push(t);
            for name in ["u.e", "mass.e"] {
                columns.entry(name.to_string()).or_default().push(force);
            }
            for name in ["u.f", "v.f", "mass.f", "mass.p"] {
                columns.entry(name.to_string()).or_default().push(speed);
            }
            columns.entry("x".to_string()).or_default().push(x);
        };
        for k in 0..=40 {
            let t = jump * f64::from(k) / 40.0;
            add(t, [2.0, 1.0 + 2.0 * t, if k == 40 { on_border } else { -1.0 + t + t * t }]);
        }
        for k in 0..=40 {
            let t = f64::from(k) / 40.0;
            let x = if k == 0 { on_border } else { speed * t + 0.5 * t * t };
            add(jump + t, [if k == 0 { force } else { 1.0 }, speed + t, x]);
        }
        check(&graph, &times, &columns)
    };
    for on_border in [0.0, -1e-16, 1e-16] {
        let found = motion(on_border, 1.0);
        assert!(found.unchecked.is_empty() && found.residual.as_ref().unwrap().value < 1e-13, "{on_border}: {found}");
    }
    assert!(motion(0.0, 1.5).residual.unwrap().value > 0.1);
    assert!(motion(-1e-6, 1.0).residual.unwrap().value > 0.1);
}

#[test]
fn a_run_in_parts_is_judged_as_the_whole() {
    let graph = graph(MODEL);
    let (times, mut columns) = motion(400);
    columns.get_mut("damper.e").unwrap()[30] += 1e-3;
    columns.get_mut("spring.e").unwrap()[333] += 1e-5;
    let whole = check(&graph, &times, &columns);
    let names = names(&columns);
    let mut auditor = Auditor::new(&Arc::new(graph), &mut |name| names.iter().position(|known| **known == *name));
    let parameters = BTreeMap::from([("d".to_string(), 0.2)]);
    for (from, to) in [(0, 100), (99, 250), (249, 401)] {
        let part: Vec<&[f64]> = columns.values().map(|c| &c[from..to]).collect();
        auditor.take(&Run { times: &times[from..to], names: &names, columns: &part, parameters: &parameters });
    }
    let parts = auditor.finish();
    for (part, whole) in [(parts.residual, whole.residual), (parts.power, whole.power)] {
        let (part, whole) = (part.unwrap(), whole.unwrap());
        assert_eq!((part.time, &part.place), (whole.time, &whole.place));
        // What stands beside is looked at in the middle of each part.
        assert!((part.value - whole.value).abs() < 1e-6 * whole.value, "{part} {whole}");
    }
}

#[test]
fn rest_with_rounding_errors_is_rest() {
    let graph = graph(MODEL);
    let times: Vec<f64> = (0..100).map(|k| 0.1 * k as f64).collect();
    let mut columns = Columns::new();
    // The spring holds the pull; flows and what they make are rounding errors of one sign or another.
    let held = [("pull.e", 1.0), ("lever.in.e", 1.0), ("lever.out.e", 2.0), ("n.e", 2.0), ("spring.e", 2.0)];
    for (k, _) in times.iter().enumerate() {
        let noise = |i: usize| 1e-17 * ((k * 7 + i * 13) % 11) as f64;
        for (i, name) in wanted(&graph).into_iter().enumerate() {
            let value = held.iter().find(|(held, _)| *held == name).map_or(noise(i), |(_, value)| *value);
            let value = if name == "spring.q" { 0.5 } else { value };
            columns.entry(name).or_default().push(value);
        }
    }
    let found = check(&graph, &times, &columns);
    for finding in [found.power, found.energy, found.residual, found.rates] {
        assert!(finding.as_ref().unwrap().value < 1e-9, "{finding:?}");
    }
}
