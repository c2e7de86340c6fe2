//! The Bombardier Iltis of `examples/iltis` against values published for it: U. Frik, G. Leister, W. Schwartz, "Simulation of
//! the IAVSD Road Vehicle Benchmark Bombardier Iltis", Vehicle System Dynamics 22 (1993) 215-253.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::f64::consts::PI;
use std::path::Path;

use halfarrow::{Compiled, Form, Linearize, Model, Override, Point, Run, Simulated, Start};

fn model(name: &str, set: &[(&str, &str)]) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/iltis").join(name);
    let set: Vec<Override> =
        set.iter().map(|(name, value)| Override { name: (*name).into(), value: (*value).into() }).collect();
    Model::load(&path, &set).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// What the car has at the start of a run.
fn at(start: Start, car: &Compiled) -> Simulated {
    let run = Run { to: 1e-6, start, ..Run::default() };
    car.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

#[track_caller]
fn near(done: &Simulated, name: &str, expected: f64, off: f64) {
    let column = done.trace.columns.iter().find(|c| c.name == name);
    let found = column.unwrap_or_else(|| panic!("nothing called {name}")).values[0];
    assert!(
        (found - expected).abs() <= off,
        "{name}: {found} instead of {expected}: off by {:.1e}",
        (found - expected).abs()
    );
}

/// As drawn its springs have the nominal forces; it comes to rest where it is published to, with loads that pass through the
/// centres of the wheels to the last digit, and with those that act where a leaning wheel stands but for what that lean does.
#[test]
fn the_iltis_stands_as_published() {
    let mut car = model("standing.bond", &[]).compile(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let drawn = at(Start::Given, &car);
    for (name, nominal) in [
        ("load_f", 3829.6),
        ("load_r", 3593.6),
        ("shock_f", -128.0),
        ("shock_r", -128.0),
        ("leaf_f", -2728.9),
        ("leaf_r", -2728.9),
    ] {
        near(&drawn, name, nominal, 0.15);
    }
    let forces = [
        ("load_f", 3831.31),
        ("load_r", 3591.91),
        ("shock_f", -335.29),
        ("shock_r", -241.64),
        ("leaf_f", -3068.62),
        ("leaf_r", -2885.51),
    ];
    let rests = |car: &Compiled, force: f64, way: f64, pitch: f64| {
        let rest = at(Start::Equilibrium, car);
        near(&rest, "z", 0.57 - 7.083e-3, way);
        near(&rest, "pitch", 0.1465 * PI / 180.0, pitch);
        for (name, expected) in forces {
            near(&rest, name, expected, force);
        }
        rest
    };
    rests(&car, 0.1, 1e-5, 2e-6);
    car.set("at_centre", 1.0).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let rest = rests(&car, 0.01, 1e-6, 1e-6);
    near(&rest, "link_f", -1408.51, 0.1);
    near(&rest, "link_r", -1335.52, 0.1);
}

/// Frequencies in Hz and parts of critical damping of the modes at 20 m/s, the fastest first, those below 1 Hz left out.
fn modes(shock_spring: &str) -> Vec<[f64; 2]> {
    let car = model("flat.bond", &[("shock_spring", shock_spring)]);
    let wanted = Linearize { at: Point::Time(3.0), ..Linearize::default() };
    let report = car.linearize(&wanted).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let swing = report.modes.iter().filter(|m| m.pole[1] > 2.0 * PI);
    let mut modes: Vec<_> = swing.map(|m| [m.pole[1] / (2.0 * PI), m.damping]).collect();
    modes.sort_by(|a, b| b[0].total_cmp(&a[0]));
    modes
}

const HOP: [[f64; 2]; 4] = [[13.49, 0.3274], [13.0, 0.3386], [12.84, 0.3453], [11.36, 0.3489]];

#[track_caller]
fn agree(found: &[[f64; 2]], published: &[[f64; 2]], part: f64, damping: f64) {
    for (found, published) in found.iter().zip(published) {
        assert!((found[0] / published[0] - 1.0).abs() <= part, "{found:?} instead of {published:?}");
        assert!((found[1] - published[1]).abs() <= damping, "{found:?} instead of {published:?}");
    }
}

/// The wheels hop as published.
#[test]
fn the_wheels_of_the_iltis_hop_as_published() {
    agree(&modes("1")[..4], &HOP, 0.02, 0.015);
}

/// Bounce and pitch are those of a car whose shock absorbers have no springs, and the wheels hop as published then too.
#[test]
fn the_iltis_without_springs_in_its_shock_absorbers_swings_as_published() {
    let modes = modes("0");
    agree(&modes[..4], &HOP, 0.015, 0.01);
    agree(&modes[4..], &[[1.473, 0.5026], [1.284, 0.4434]], 0.022, 0.01);
    assert_eq!(modes.len(), 6);
}

/// With multipliers and break variables it does as by its minimal form, though what acts across a car that drives straight on is
/// rounding of what acts along it, and has no digits of its own.
#[test]
fn the_iltis_drives_straight_on_in_the_classical_forms() {
    let car = model("flat.bond", &[]);
    let end = |form: Form| {
        let run = Run { to: 0.05, every: Some(0.05), rtol: 1e-9, form, ..Run::default() };
        car.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
    };
    let minimal = end(Form::Minimal);
    for form in [Form::Lagrange, Form::Break, Form::Relaxed] {
        let classical = end(form);
        assert!(classical.report.steps < 200, "{form}: {} steps", classical.report.steps);
        for name in ["x", "load_fl", "load_rr"] {
            let of = |done: &Simulated| done.trace.columns.iter().find(|c| c.name == name).map(|c| c.values[1]);
            let (a, b) = (of(&minimal).expect("a value"), of(&classical).expect("a value"));
            assert!((a - b).abs() < 1e-6 * a.abs(), "{form}, {name}: {a} and {b}");
        }
    }
}
