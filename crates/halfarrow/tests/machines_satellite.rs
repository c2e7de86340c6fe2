//! The satellite of `examples/satellite` against equations of its own (`reference.py` there) and closed forms.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::path::Path;

use halfarrow::{FixedMethod, Method, Model, Run, Simulated, Verdict};

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/satellite")
}

fn model(name: &str) -> Model {
    Model::load(&folder().join(name), &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// A run that the audit has nothing against.
fn run(name: &str, run: &Run) -> Simulated {
    let done = model(name).simulate(run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert_eq!(done.report.audit.verdict, Verdict::Holds, "{:?}", done.report.audit);
    done
}

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    let found = done.trace.columns.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("nothing called {name}")).values
}

/// All that a table of the example says of the times of a run, within a part of the greatest value of each of its columns.
#[track_caller]
fn agrees(done: &Simulated, table: &str, part: f64) {
    let table = std::fs::read_to_string(folder().join(table)).expect("the table");
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().expect("a head").split(',').collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|x| x.parse().expect("a number")).collect()).collect();
    let times = &done.trace.times;
    let mut compared = 0;
    for (at, name) in names.iter().enumerate().skip(1) {
        let most = rows.iter().fold(0.0f64, |most, row| most.max(row[at].abs()));
        let found = column(done, name);
        for row in &rows {
            let Some(k) = times.iter().position(|t| (t - row[0]).abs() < 1e-9) else { continue };
            let off = (found[k] - row[at]).abs();
            assert!(
                off <= part * most,
                "{name} at {} s: {} instead of {}, off by {off:.1e}",
                row[0],
                found[k],
                row[at]
            );
            compared += 1;
        }
    }
    assert!(compared >= 2 * (names.len() - 1), "{compared}");
}

/// The angular momentum of all, along the axes of the world, stays as it is at the start.
#[track_caller]
fn keeps_its_momentum(done: &Simulated, off: f64) {
    for name in ["H[1]", "H[2]", "H[3]"] {
        let values = column(done, name);
        let most = values.iter().fold(0.0f64, |most, v| most.max((v - values[0]).abs()));
        assert!(most <= off, "{name} changes by {most:.1e} from {}", values[0]);
    }
}

fn rk4(to: f64, every: f64) -> Run {
    Run { to, method: Method::Fixed(FixedMethod::Rk4), step: Some(1e-3), every: Some(every), ..Run::default() }
}

/// Six ways of the hull, four wheels, two hinges, and beside them four currents.
#[test]
fn the_satellite_turns_to_where_it_is_told() {
    let done = run("slew.bond", &Run { to: 150.0, rtol: 1e-9, every: Some(5.0), ..Run::default() });
    let flows: Vec<&str> =
        done.report.tolerances.iter().map(|s| s.name.as_str()).filter(|name| name.ends_with(".f")).collect();
    assert_eq!(flows.iter().filter(|name| name.ends_with("coil.f")).count(), 4, "{flows:?}");
    assert_eq!(flows.len(), 16, "{flows:?}");
    agrees(&done, "slew.csv", 1e-8);
    keeps_its_momentum(&done, 1e-11);
    assert!(column(&done, "off").last().is_some_and(|off| *off < 0.03));
    let done = run("slew.bond", &rk4(10.0, 5.0));
    agrees(&done, "slew.csv", 1e-8);
    keeps_its_momentum(&done, 1e-13);
}

/// About the axis of its middle inertia it turns over again and again, as Jacobi's functions say.
#[test]
fn the_satellite_with_locked_wheels_tumbles() {
    let done = run("tumble.bond", &Run { to: 100.0, rtol: 1e-9, every: Some(2.0), ..Run::default() });
    agrees(&done, "tumble.csv", 1e-9);
    keeps_its_momentum(&done, 1e-7);
    let spin = column(&done, "w[3]");
    assert!(spin[0] > 0.99 && spin.last().is_some_and(|w| *w < -0.99), "it has turned over");
}

/// What the wheels had goes to the hull, as two exponentials say.
#[test]
fn short_circuited_wheels_give_their_momentum_to_the_hull() {
    let done = run("dump.bond", &Run { to: 20.0, rtol: 1e-9, every: Some(1.0), ..Run::default() });
    agrees(&done, "dump.csv", 1e-8);
    keeps_its_momentum(&done, 1e-9);
    let done = run("dump.bond", &rk4(3.0, 1.0));
    agrees(&done, "dump.csv", 1e-8);
    keeps_its_momentum(&done, 1e-12);
}
