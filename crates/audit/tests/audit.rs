//! A true run passes; one wrong value does not.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow_audit::{Audit, Run, audit, wanted};
use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{self, BondGraph, NoFiles};
use halfarrow_compiler::diagnostic::{Sources, render};
use std::collections::BTreeMap;

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

fn check(graph: &BondGraph, times: &[f64], columns: &Columns) -> Audit {
    let columns = columns.iter().map(|(name, c)| (name.clone(), c.as_slice())).collect();
    let parameters = BTreeMap::from([("d".to_string(), 0.2)]);
    audit(graph, &Run { times, columns: &columns, parameters: &parameters })
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
