//! Every form of every model, evaluated along runs of the minimal one: the equations hold, the variables agree, and the
//! derivatives are those of the residuals.

use std::path::PathBuf;

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::causal_graph::CausalGraph;
use halfarrow_compiler::compile::{Text, to_causal_graph};
use halfarrow_compiler::equations::{Form, derive_equations};
use halfarrow_compiler::program::{Program, schedule};
use halfarrow_exec::{ImplicitModel, Model};
use halfarrow_sim::{Events, ImplicitSystem, Method, Options, Sink, simulate};

/// Agreement of variables, relative to the greatest of the run.
const AGREES: f64 = 1e-8;

fn models() -> Vec<(String, CausalGraph)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("the models are there") {
        for file in ["model.bond", "forced.bond"] {
            let path = entry.as_ref().expect("a folder").path().join(file);
            // Between points that are far apart for its diodes, Newton does not follow a solution.
            if path.parent().is_some_and(|folder| folder.ends_with("rectifier")) {
                continue;
            }
            let Ok(text) = std::fs::read_to_string(&path) else { continue };
            let name = path.to_string_lossy().rsplit('/').take(2).collect::<Vec<_>>().join(" of ");
            let text = Text { name: &name, text: &text, files: &NoFiles, overrides: &[] };
            let causal = to_causal_graph(text).unwrap_or_else(|found| panic!("{}", found.render(false)));
            found.push((name, causal.ir));
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found
}

/// A point of a run.
struct Point {
    t: f64,
    x: Vec<f64>,
}

/// Keeps a few points; a jump starts a new mode, at which this stops.
struct Points<'a> {
    all: &'a mut Vec<Point>,
}

impl Sink for Points<'_> {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.all.push(Point { t, x: values.to_vec() });
    }
}

fn minimal(causal: &CausalGraph) -> Model {
    let equations = derive_equations(causal, Form::Minimal).unwrap_or_else(|faults| panic!("{faults:?}"));
    Model::new(schedule(&equations)).expect("parameters that fit")
}

/// Points of a run of the minimal form up to the first jump.
fn points(causal: &CausalGraph) -> Vec<Point> {
    let mut model = minimal(causal);
    let names: Vec<String> = model.program().states.iter().map(|s| s.name.clone()).collect();
    model.record(&names.iter().map(String::as_str).collect::<Vec<_>>()).expect("states can be recorded");
    let mut x = model.initialise(0.0).expect("there is a start");
    let mut start = model.clone();
    start.handle_event(0.0, &mut x.clone()).expect("a start");
    let to = start.next_time_event(0.0).unwrap_or(1.0).min(1.0);
    let mut all = Vec::new();
    let options = Options { method: Method::Auto, to, every: Some(to / 4.0), rtol: 1e-9, ..Options::default() };
    // A model that ends early, where plates touch, has the points before that.
    let end =
        simulate(&mut model, &options, &mut x, &mut Points { all: &mut all }).map_or_else(|s| 0.5 * s.time, |_| to);
    all.retain(|p| p.t == 0.0 || p.t < end);
    all
}

/// All variables that both forms have, with their greatest values.
fn compare(name: &str, form: Form, model: &mut ImplicitModel, reference: &mut Model, points: &[Point]) {
    let here: Vec<String> = observed(model.program());
    let there: Vec<String> = observed(reference.program());
    let common: Vec<&str> = here.iter().filter(|n| there.contains(n)).map(String::as_str).collect();
    model.record(&common).expect("they have values");
    reference.record(&common).expect("they have values");
    let n = model.unknowns();
    let (mut y, mut yp) = model.start_at(points[0].t, &points[0].x).unwrap_or_else(|f| panic!("{name} {form:?}: {f}"));
    reference.handle_event(points[0].t, &mut points[0].x.clone()).expect("a start");
    let (mut ours, mut theirs) = (vec![0.0; common.len()], vec![0.0; common.len()]);
    let mut greatest = vec![0.0f64; common.len()];
    let mut apart = vec![0.0f64; common.len()];
    let mut out = vec![0.0; n];
    for point in points {
        model.at(point.t, &point.x, &mut y, &mut yp).unwrap_or_else(|f| panic!("{name} {form:?}: {f}"));
        model.observe(point.t, &[&y[..], &yp].concat(), &mut ours).expect("values");
        reference.handle_event(point.t, &mut point.x.clone()).expect("a point");
        reference.observe(point.t, &point.x, &mut theirs).expect("values");
        for i in 0..common.len() {
            greatest[i] = greatest[i].max(theirs[i].abs());
            apart[i] = apart[i].max((ours[i] - theirs[i]).abs());
        }
        model.residual(point.t, &y, &yp, &mut out).expect("residuals");
        let sizes = sizes(model, point.t, &y, &yp);
        for (i, (out, size)) in out.iter().zip(&sizes).enumerate() {
            let held = out.abs() <= AGREES * size;
            assert!(held, "{name} {form:?}: {} misses by {out} of {size} at {}", model.equation_name(i), point.t);
        }
    }
    let whole = greatest.iter().fold(0.0f64, |most, g| most.max(*g));
    for i in 0..common.len() {
        let allowed = AGREES * greatest[i].max(1e-4 * whole);
        assert!(apart[i] <= allowed, "{name} {form:?}: {} is off by {} of {}", common[i], apart[i], greatest[i]);
    }
}

fn observed(program: &Program) -> Vec<String> {
    program.observed.iter().filter(|o| o.value.is_ok()).map(|o| o.name.to_string()).collect()
}

/// The size of the terms of each equation: entries of the Jacobian times unknowns and rates.
fn sizes(model: &mut ImplicitModel, t: f64, y: &[f64], yp: &[f64]) -> Vec<f64> {
    let pattern = model.sparsity().clone();
    let (mut dy, mut dyp) = (vec![0.0; pattern.nonzeros()], vec![0.0; pattern.nonzeros()]);
    model.jacobian(t, y, yp, &mut dy, &mut dyp).expect("derivatives");
    let mut sizes = vec![1e-6; y.len()];
    for ((row, column), (a, b)) in pattern.entries().zip(dy.iter().zip(&dyp)) {
        sizes[row] += (a * y[column]).abs() + (b * yp[column]).abs();
    }
    sizes
}

/// Exact derivatives against differences.
fn check_derivatives(name: &str, form: Form, model: &mut ImplicitModel, t: f64, y: &[f64], yp: &[f64]) {
    let n = y.len();
    let pattern = model.sparsity().clone();
    let (mut dy, mut dyp) = (vec![0.0; pattern.nonzeros()], vec![0.0; pattern.nonzeros()]);
    model.jacobian(t, y, yp, &mut dy, &mut dyp).expect("derivatives");
    let mut full = [vec![0.0; n * n], vec![0.0; n * n]];
    for ((row, column), (a, b)) in pattern.entries().zip(dy.iter().zip(&dyp)) {
        full[0][row * n + column] = *a;
        full[1][row * n + column] = *b;
    }
    let (mut above, mut below) = (vec![0.0; n], vec![0.0; n]);
    for (rates, full) in full.iter().enumerate() {
        for column in 0..n {
            let point = if rates == 1 { yp } else { y };
            // A charge in C is small where a speed in m/s is not; what is 0 tells nothing of its size.
            let size = point[column].abs();
            let step = 1e-5 * if size > 1e-9 { size } else { 1e-2 };
            let moved = |h: f64| {
                let mut moved = point.to_vec();
                moved[column] += h;
                moved
            };
            let mut at = |h: f64, out: &mut [f64]| {
                let moved = moved(h);
                let (y, yp) = if rates == 1 { (y, &moved[..]) } else { (&moved[..], yp) };
                model.residual(t, y, yp, out).expect("residuals");
            };
            at(step, &mut above);
            at(-step, &mut below);
            let scale = (0..n).fold(0.0f64, |most, row| most.max(full[row * n + column].abs()));
            for row in 0..n {
                let slope = (above[row] - below[row]) / (2.0 * step);
                let size = scale.max(above[row].abs().max(below[row].abs()) * 1e-10 / step).max(1e-9);
                let apart = (slope - full[row * n + column]).abs();
                assert!(
                    apart <= 1e-4 * size,
                    "{name} {form:?}: row {row} column {column} rates {rates}: {apart} of {size}"
                );
            }
        }
    }
}

#[test]
fn all_forms_of_all_models_say_the_same() {
    let (mut applied, mut failed) = (0, Vec::new());
    for (name, causal) in models() {
        let points = points(&causal);
        for form in Form::ALL {
            let equations = match derive_equations(&causal, form) {
                Ok(equations) => equations,
                Err(faults) => {
                    println!("{name} {form:?}: {}", faults.0[0].title);
                    continue;
                }
            };
            println!("{name} {form:?}: {:?} index {} {:?}", equations.counts, equations.index, equations.indices);
            let check = || check(&name, form, &causal, schedule(&equations), &points);
            match std::panic::catch_unwind(std::panic::AssertUnwindSafe(check)) {
                Ok(()) => applied += 1,
                Err(why) => {
                    failed.push(why.downcast_ref::<String>().cloned().unwrap_or_else(|| format!("{name} {form:?}")))
                }
            }
        }
    }
    assert!(failed.is_empty(), "{} of {} fail:\n{}", failed.len(), applied + failed.len(), failed.join("\n"));
    assert!(applied > 250, "only {applied} forms apply");
}

fn check(name: &str, form: Form, causal: &CausalGraph, program: Program, points: &[Point]) {
    let mut reference = minimal(causal);
    reference.initialise(0.0).expect("there is a start");
    let mut model = ImplicitModel::new(program, reference.clone()).expect("parameters that fit");
    compare(name, form, &mut model, &mut reference, points);
    let last = &points[points.len() - 1];
    let (y, yp) = model.start_at(last.t, &last.x).expect("a start");
    if y.len() <= 20 && form != Form::Stiff {
        check_derivatives(name, form, &mut model, last.t, &y, &yp);
    }
}
