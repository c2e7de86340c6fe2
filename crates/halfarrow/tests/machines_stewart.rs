//! The Stewart-Gough platform of `examples/stewart` against thirteen bodies with all their coordinates and multipliers, virtual
//! work (`reference.py` there), and lengths by the points alone.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::path::Path;

use halfarrow::{Compiled, FixedMethod, Form, Method, Model, Run, Simulated, Verdict};

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/stewart")
}

fn model(name: &str) -> Compiled {
    let model = Model::load(&folder().join(name), &[]).and_then(|model| model.compile(Form::Minimal));
    model.unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// By the method of Runge and Kutta, in steps of a millisecond.
fn rk4(to: f64) -> Run {
    Run { to, method: Method::Fixed(FixedMethod::Rk4), step: Some(1e-3), every: Some(0.1), ..Run::default() }
}

/// A run that the audit has nothing against.
fn run(model: &Compiled, run: &Run) -> Simulated {
    let done = model.simulate(run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert_eq!(done.report.audit.verdict, Verdict::Holds, "{:?}", done.report.audit);
    done
}

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    let found = done.trace.columns.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("nothing called {name}")).values
}

/// The head and the rows of a table of the example.
fn table(name: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let table = std::fs::read_to_string(folder().join(name)).expect("the table");
    let mut lines = table.lines();
    let names = lines.next().expect("a head").split(',').map(String::from).collect();
    (names, lines.map(|line| line.split(',').map(|x| x.parse().expect("a number")).collect()).collect())
}

/// All that a table says of the times of a run.
#[track_caller]
fn agrees(done: &Simulated, name: &str, way: f64, force: f64) {
    let (names, rows) = table(name);
    let mut compared = 0;
    for (at, name) in names.iter().enumerate().skip(1) {
        let most = if name.starts_with("force") { force } else { way };
        for row in &rows {
            let Some(k) = done.trace.times.iter().position(|t| (t - row[0]).abs() < 1e-9) else { continue };
            let off = (column(done, name)[k] - row[at]).abs();
            assert!(off <= most, "{name} at {} s is off by {off:.1e} from {}", row[0], row[at]);
            compared += 1;
        }
    }
    assert!(compared >= 10 * (names.len() - 1), "{compared}");
}

const BASE: [f64; 6] = [-12.0, 12.0, 108.0, 132.0, 228.0, 252.0];
const SEAT: [f64; 6] = [-48.0, 48.0, 72.0, 168.0, 192.0, 288.0];

/// Lengths of the legs by a pose: place, and turns about x, the new y, the new z.
fn lengths(pose: [f64; 6]) -> [f64; 6] {
    let [x, y, z, a, b, c] = pose;
    let ((sa, ca), (sb, cb), (sc, cc)) = (a.sin_cos(), b.sin_cos(), c.sin_cos());
    std::array::from_fn(|i| {
        let (base, seat) = (BASE[i].to_radians(), SEAT[i].to_radians());
        let (p, q) = (0.7 * seat.cos(), 0.7 * seat.sin());
        let u = x + cb * cc * p - cb * sc * q - base.cos();
        let v = y + (ca * sc + sa * sb * cc) * p + (ca * cc - sa * sb * sc) * q - base.sin();
        let w = z + (sa * sc - ca * sb * cc) * p + (sa * cc + ca * sb * sc) * q;
        (u * u + v * v + w * w).sqrt()
    })
}

const POSE: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// Thirteen bodies and six loops: six ways to move are left, those of the platform. On six springs it swings as all coordinates
/// with multipliers do; legs have the lengths that the points say; energy is kept.
#[test]
fn a_stewart_platform_swings_on_springs() {
    let springs = model("springs.bond");
    let done = run(&springs, &rk4(1.0));
    agrees(&done, "springs.csv", 1e-8, 0.0);
    assert!(done.report.audit.energy.as_ref().is_some_and(|e| e.value < 1e-8), "{:?}", done.report.audit);
    let done = run(&springs, &Run { to: 2.0, rtol: 1e-9, every: Some(0.1), ..Run::default() });
    let states: Vec<&str> = done.report.tolerances.iter().map(|s| s.name.as_str()).collect();
    let joints = ["to_x", "to_y", "to_z", "by_roll", "by_pitch", "by_yaw"];
    let platform = ["rate.f", "q"].map(|v| joints.map(|joint| format!("machine.{joint}.{v}"))).concat();
    assert_eq!(states, platform);
    agrees(&done, "springs.csv", 1e-9, 0.0);
    for k in 0..done.trace.times.len() {
        for (i, length) in lengths(POSE.map(|name| column(&done, name)[k])).into_iter().enumerate() {
            let off = (column(&done, &format!("length[{}]", i + 1))[k] - length).abs();
            assert!(off <= 1e-13, "leg {} is off by {off:.1e}", i + 1);
        }
    }
}

#[test]
fn a_stewart_platform_follows_its_path() {
    let done = run(&model("motion.bond"), &rk4(2.5));
    agrees(&done, "motion.csv", 2e-9, 2e-5);
    assert!(column(&done, "off").iter().all(|off| *off < 6e-3));
}

/// Held by its legs it is where their lengths say, and they carry what virtual work of all weights says.
#[test]
fn the_legs_of_a_stewart_platform_carry_its_weight() {
    let done = run(&model("held.bond"), &Run { to: 1e-3, every: Some(1e-3), ..Run::default() });
    let (names, rows) = table("held.csv");
    for (name, expected) in names.iter().zip(&rows[0]) {
        let off = (column(&done, name)[0] - expected).abs();
        assert!(off <= if name.starts_with("force") { 1e-7 } else { 1e-10 }, "{name} is off by {off:.1e}");
    }
}
