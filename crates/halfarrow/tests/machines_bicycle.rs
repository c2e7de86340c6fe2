//! The bicycle of `examples/bicycle` against published eigenvalues and an independent program (`reference.py` there).
//! J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab, "Linearized Dynamics Equations for the Balance and Steer of a
//! Bicycle: a Benchmark and Review", Proceedings of the Royal Society A 463 (2007) 1955-1982.

use std::fs;
use std::path::{Path, PathBuf};

use halfarrow::{Compiled, FixedMethod, Form, Linearize, Method, Model, Override, Record, Run, Simulated};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/bicycle")
}

fn bicycle(set: &[(&str, f64)]) -> Model {
    let set: Vec<Override> =
        set.iter().map(|(name, value)| Override { name: (*name).into(), value: value.to_string() }).collect();
    Model::load(&folder().join("bicycle.bond"), &set).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// Table 2 of the benchmark: castering, both parts of weave, capsize.
#[track_caller]
fn has_eigenvalues(speed: f64, published: [f64; 4]) {
    let model = bicycle(&[("speed", speed), ("lean_rate", 0.0)]);
    let report = model.linearize(&Linearize::default()).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let [castering, real, imaginary, capsize] = published;
    for wanted in [[castering, 0.0], [real, imaginary], [real, -imaginary], [capsize, 0.0]] {
        let off = |pole: &[f64; 2]| (pole[0] - wanted[0]).abs().max((pole[1] - wanted[1]).abs());
        let least = report.poles.iter().map(off).fold(f64::INFINITY, f64::min);
        assert!(least < 1e-13 * wanted[0].abs().max(1.0), "{wanted:?} missed by {least:.0e}: {:?}", report.poles);
    }
    // What is left: place, direction, speed.
    let still = report.poles.iter().filter(|pole| pole[0].abs().max(pole[1].abs()) < 1e-6);
    assert_eq!((still.count(), report.poles.len()), (4, 8));
}

#[test]
fn the_bicycle_weaves_and_capsizes_as_published() {
    has_eigenvalues(1.0, [-7.11008014637442, 3.52696170990070, 0.80774027519930, -3.13423125066578]);
    has_eigenvalues(5.0, [-14.07838969279822, -0.77534188219585, 4.46486771378823, -0.32286642900409]);
    has_eigenvalues(10.0, [-24.62459635017404, -3.72016840437287, 10.90681139476287, 0.16105338653172]);
}

fn rows(name: &str) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(folder().join(name)).expect("a file");
    let numbers = |line: &str| line.split(',').map(|v| v.parse().expect("a number")).collect();
    text.lines().skip(1).map(numbers).collect()
}

const COMPARED: [&str; 9] = ["rolls", "leans", "steers", "pitches", "yaws", "x", "y", "load_front", "grip_front"];

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    let found = done.trace.columns.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("nothing called {name}")).values
}

/// Motion within `motion`, forces within 300 times that, and energy within it by its parts.
#[track_caller]
fn agrees(bicycle: &Compiled, file: &str, run: Run, motion: f64) {
    let rows = rows(file);
    let names = COMPARED.iter().chain(&["energy"]).map(|n| n.to_string()).collect();
    let run = Run { to: rows[rows.len() - 1][0], every: Some(0.1), record: Record::Names(names), ..run };
    let done = bicycle.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert!(done.report.audit.warnings.is_empty(), "{:?}", done.report.audit.warnings);
    for row in &rows {
        let at = done.trace.times.iter().position(|t| (t - row[0]).abs() < 1e-9).expect("a sample");
        for (k, name) in COMPARED.iter().enumerate() {
            let (found, wanted) = (column(&done, name)[at], row[k + 1]);
            let bound = if k < 7 { motion } else { 300.0 * motion };
            assert!((found - wanted).abs() < bound, "{name} at {} s: {found} instead of {wanted}", row[0]);
        }
    }
    let energy = column(&done, "energy");
    assert!(energy.iter().all(|e| (e / energy[0] - 1.0).abs() < motion), "{energy:?}");
}

/// At 4.6 m/s it comes upright again; at 3 m/s its weave grows, until it leans by 13 degrees and steers by 20.
#[test]
fn the_bicycle_rolls_as_lagrange_has_it() {
    let mut bicycle = bicycle(&[]).compile(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let exact = Run { rtol: 1e-10, ..Run::default() };
    agrees(&bicycle, "run.csv", exact.clone(), 1e-9);
    let stepped = Run { method: Method::Fixed(FixedMethod::Rk4), step: Some(1e-3), ..Run::default() };
    agrees(&bicycle, "run.csv", stepped, 1e-9);
    for (name, value) in [("speed", 3.0), ("lean_rate", 0.05)] {
        bicycle.set(name, value).unwrap_or_else(|e| panic!("{}", e.render(false)));
    }
    agrees(&bicycle, "fall.csv", exact, 1e-9);
}

/// Its joints turn by angles of 0 at the start, by whose sines no form divides.
#[test]
fn every_form_rides_the_bicycle() {
    let end = |form: Form| {
        let run =
            Run { to: 0.05, form, record: Record::Names(vec!["lean.q".into(), "steer.q".into()]), ..Run::default() };
        let done = bicycle(&[]).simulate(&run, &mut |_| true);
        let done = done.unwrap_or_else(|e| panic!("{}: {}", form.name(), e.render(false)));
        done.trace.columns.iter().map(|c| *c.values.last().expect("a value")).collect::<Vec<f64>>()
    };
    let minimal = end(Form::Minimal);
    for form in [Form::Kane, Form::Lagrange, Form::Break, Form::Relaxed, Form::Inverted] {
        for (found, expected) in end(form).into_iter().zip(&minimal) {
            assert!((found - expected).abs() < 1e-5, "{}: {found} instead of {expected}", form.name());
        }
    }
}
