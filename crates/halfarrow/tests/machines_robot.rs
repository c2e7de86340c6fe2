//! The robot of `examples/robot` against the recursive Newton-Euler algorithm (`reference.py` there).

use std::fs;
use std::path::{Path, PathBuf};

use halfarrow::{Compiled, FixedMethod, Form, Method, Model, Override, Record, Run, Simulated};

const JOINTS: [&str; 6] = ["waist", "shoulder", "elbow", "roll", "bend", "twist"];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/robot")
}

fn robot(set: &[(String, String)]) -> Compiled {
    let set: Vec<Override> =
        set.iter().map(|(name, value)| Override { name: name.clone(), value: value.clone() }).collect();
    let model = Model::load(&folder().join("robot.bond"), &set).unwrap_or_else(|e| panic!("{}", e.render(false)));
    model.compile(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// The numbers of a file, row by row, without its head.
fn rows(name: &str) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(folder().join(name)).expect("a file");
    let numbers = |line: &str| line.split(',').map(|v| v.parse().expect("a number")).collect();
    text.lines().skip(1).map(numbers).collect()
}

fn simulated(robot: &Compiled, names: Vec<String>, run: Run) -> Simulated {
    let run = Run { record: Record::Names(names), ..run };
    let done = robot.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    for miss in [&done.report.audit.power, &done.report.audit.residual].into_iter().flatten() {
        assert!(miss.value < 1e-12, "{miss:?}");
    }
    done
}

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    let found = done.trace.columns.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("nothing called {name}")).values
}

fn of_joints(what: &str) -> Vec<String> {
    JOINTS.iter().map(|joint| format!("{joint}.{what}")).collect()
}

/// Angles, speeds and currents at the end of the first move and of the run.
#[test]
fn the_robot_moves_as_newton_and_euler_have_it() {
    let robot = robot(&[]);
    let names: Vec<String> = ["angle", "speed", "i"].into_iter().flat_map(of_joints).collect();
    let rows = rows("run.csv");
    let off = |run: Run| {
        let done = simulated(&robot, names.clone(), Run { to: 2.5, every: Some(0.1), ..run });
        let mut worst = [0.0_f64; 3];
        for row in &rows {
            let at = done.trace.times.iter().position(|t| (t - row[0]).abs() < 1e-9).expect("a sample");
            for (k, name) in names.iter().enumerate() {
                worst[k / 6] = worst[k / 6].max((column(&done, name)[at] - row[k + 1]).abs());
            }
        }
        worst
    };
    let exact = off(Run { rtol: 1e-9, ..Run::default() });
    assert!(exact[0] < 1e-9 && exact[1] < 1e-8 && exact[2] < 1e-7, "{exact:?}");
    let stepped = off(Run { method: Method::Fixed(FixedMethod::Rk4), step: Some(1e-3), ..Run::default() });
    assert!(stepped[0] < 1e-5 && stepped[1] < 2e-4 && stepped[2] < 1e-3, "{stepped:?}");
}

/// Accelerations of the joints at five states.
#[test]
fn the_robot_is_accelerated_as_newton_and_euler_have_it() {
    let mut robot = robot(&[]);
    let names = of_joints("acceleration");
    for row in rows("accelerations.csv") {
        for joint in 0..6 {
            for (name, value) in [("q0", row[joint]), ("w0", row[joint + 6])] {
                robot.set(&format!("{name}[{}]", joint + 1), value).unwrap_or_else(|e| panic!("{}", e.render(false)));
            }
        }
        let done = simulated(&robot, names.clone(), Run { to: 1e-6, ..Run::default() });
        for (joint, name) in names.iter().enumerate() {
            let (found, wanted) = (column(&done, name)[0], row[joint + 12]);
            assert!((found - wanted).abs() < 1e-11 * wanted.abs(), "{name}: {found} instead of {wanted}");
        }
    }
}
