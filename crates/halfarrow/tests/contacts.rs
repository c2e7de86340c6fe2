//! Machines whose parts meet: contacts behind joints and in closed loops, against programs that know nothing of bonds.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow::{FixedMethod, Method, Model, Override, Record, Run, Simulated};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/contacts").join(name)
}

/// A machine of `tests/contacts/`, run with everything recorded.
fn machine(name: &str, set: &[(&str, &str)], run: &Run) -> Simulated {
    let set: Vec<Override> =
        set.iter().map(|(name, value)| Override { name: (*name).into(), value: (*value).into() }).collect();
    let model = Model::load(&folder(name).join("model.bond"), &set).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let run = Run { record: Record::All, ..run.clone() };
    model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{name}: {}", e.render(false)))
}

fn written(text: &str, run: &Run) -> Simulated {
    let model = Model::from_text("machine.bond", &format!("model Machine\n{text}"), &[]);
    let model = model.unwrap_or_else(|e| panic!("{}", e.render(false)));
    let run = Run { record: Record::All, ..run.clone() };
    model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    let found = done.trace.columns.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("nothing called {name}")).values
}

fn last(done: &Simulated, name: &str) -> f64 {
    *column(done, name).last().expect("a value")
}

fn reference(name: &str) -> Value {
    let text = std::fs::read_to_string(folder(name).join("reference.json")).expect("a reference");
    serde_json::from_str(&text).expect("JSON")
}

fn number(value: &Value) -> f64 {
    value.as_str().and_then(|text| text.parse().ok()).expect("a number")
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().expect("a list").iter().map(number).collect()
}

#[track_caller]
fn close(found: f64, expected: f64, off: f64, what: &str) {
    assert!((found - expected).abs() <= off, "{what}: {found} instead of {expected}, off by {:.1e}", found - expected);
}

/// The rows of a run, every step of it recorded, from which contacts part: those after an impulse.
fn impacts(done: &Simulated, contacts: &[&str]) -> Vec<usize> {
    let impulses: Vec<&[f64]> = contacts.iter().map(|name| column(done, &format!("{name}.impulse"))).collect();
    let times = &done.trace.times;
    let changes = |k: usize| impulses.iter().any(|impulse| impulse[k] != impulse[k - 1]);
    (1..times.len()).filter(|&k| times[k] == times[k - 1] && changes(k)).collect()
}

const MACHINES: [(&str, &[&str]); 4] = [
    ("rocking_block", &["left", "right"]),
    ("four_bar_stop", &["stop"]),
    ("tip_on_floor", &["floor"]),
    ("slider_stop", &["stop"]),
];

/// Each machine between its impacts, and what each impact leaves, by three methods.
#[test]
fn machines_meet_their_references() {
    for (name, contacts) in MACHINES {
        let reference = reference(name);
        let times = numbers(&reference["t"]);
        for (method, step, part) in [
            (Method::Explicit, None, 1e-9),
            (Method::Radau, None, 1e-8),
            (Method::Fixed(FixedMethod::Rk4), Some(5e-4), 1e-7),
        ] {
            let run = Run { method, step, to: times[times.len() - 1], rtol: 1e-12, ..Run::default() };
            let sampled = machine(name, &[], &Run { every: Some(0.05), ..run.clone() });
            for (variable, wanted) in reference["values"].as_object().expect("variables") {
                let (values, wanted) = (column(&sampled, variable), numbers(wanted));
                let size = wanted.iter().fold(0.0f64, |most, v| most.max(v.abs()));
                for (t, wanted) in times.iter().zip(&wanted) {
                    let at = |time: &f64| (time - t).abs() < 1e-9;
                    let k = sampled.trace.times.iter().position(at).expect("a sample");
                    close(values[k], *wanted, part * size, &format!("{name}, {method:?}: {variable} at {t} s"));
                }
            }
            let all = machine(name, &[], &Run { every: None, ..run });
            let rows = impacts(&all, contacts);
            let list = reference["impacts"].as_array().expect("impacts");
            let until = all.trace.times.last().expect("a time");
            for (k, impact) in list.iter().enumerate().filter(|(_, impact)| number(&impact["t"]) < *until) {
                let (row, what) = (rows[k], format!("{name}, {method:?}: impact {}", k + 1));
                close(all.trace.times[row], number(&impact["t"]), part, &what);
                let after = impact["after"].as_object().expect("values").iter();
                for (variable, wanted) in after.filter(|(variable, _)| !variable.starts_with("pin")) {
                    let values = column(&all, variable);
                    let size = values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
                    close(values[row], number(wanted), part * size, &format!("{what}: {variable}"));
                }
            }
        }
    }
}

/// What the pins of the four-bar take of the blow, from the momenta of its bars; these balance to the last digits, and of the
/// energy the square of the restitution is left.
#[test]
fn the_pins_of_a_four_bar_share_the_blow_at_its_coupler() {
    let done = machine("four_bar_stop", &[], &Run { to: 1.0, rtol: 1e-12, every: None, ..Run::default() });
    let reference = reference("four_bar_stop");
    let (a, b, c, px, py): (f64, f64, f64, f64, f64) = (0.2, 0.5, 0.4, 0.3, 0.1);
    for (k, row) in impacts(&done, &["stop"]).into_iter().enumerate() {
        let gained = |name: &str| column(&done, name)[row] - column(&done, name)[row - 1];
        let [th1, th2, th3] = ["th1", "th2", "th3"].map(|name| column(&done, name)[row].sin_cos());
        let stop = column(&done, "stop.impulse")[row];
        // Pins upon the coupler at its ends, `A` and -`B`: moments about the centres of crank and rocker. Unknown is A.
        let [[x1, y1, j1], [x2, y2, j2], [x3, y3, j3]] =
            [1, 2, 3].map(|n| ["X", "Y", "J"].map(|q| gained(&format!("{q}{n}.p"))));
        // O = p1 + A, B = A + stop - p2, C = p3 - B.
        let crank = |ax: f64, ay: f64| a / 2.0 * (th1.0 * (x1 + 2.0 * ax) - th1.1 * (y1 + 2.0 * ay)) - j1;
        let moment = |(sin, cos): (f64, f64), x: f64, y: f64| cos * y - sin * x;
        let coupler = |ax: f64, ay: f64| {
            let (bx, by) = (ax + stop - x2, ay - y2);
            let at_stop = -(px * th2.0 + py * th2.1) * stop;
            -b / 2.0 * moment(th2, ax + bx, ay + by) + at_stop - j2
        };
        let rocker = |ax: f64, ay: f64| {
            let (bx, by) = (ax + stop - x2, ay - y2);
            c / 2.0 * moment(th3, 2.0 * bx - x3, 2.0 * by - y3) - j3
        };
        // Two equations for A, linear.
        let rows = [&crank as &dyn Fn(f64, f64) -> f64, &coupler].map(|f| {
            let at_zero = f(0.0, 0.0);
            [f(1.0, 0.0) - at_zero, f(0.0, 1.0) - at_zero, -at_zero]
        });
        let det = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0];
        let ax = (rows[0][2] * rows[1][1] - rows[0][1] * rows[1][2]) / det;
        let ay = (rows[0][0] * rows[1][2] - rows[0][2] * rows[1][0]) / det;
        close(rocker(ax, ay), 0.0, 1e-12, "the third balance of moments");
        let pins = [x1 + ax, y1 + ay, ax, ay, ax + stop - x2, ay - y2, x3 - (ax + stop - x2), y3 - (ay - y2)];
        let wanted = &reference["impacts"][k]["after"];
        for (found, name) in pins.into_iter().zip(["Ox", "Oy", "Ax", "Ay", "Bx", "By", "Cx", "Cy"]) {
            close(found, number(&wanted[format!("pin {name}")]), 1e-9, &format!("impact {}: pin {name}", k + 1));
        }
        let kinetic = column(&done, "kinetic");
        close(kinetic[row], 0.25 * kinetic[row - 1], 1e-12, "kinetic energy");
    }
}

/// A slender block: what Housner's linear theory says of its ratio and of its period as a function of the amplitude.
#[test]
fn a_slender_block_rocks_as_housner_says() {
    let (b, h) = (0.1f64, 3.0f64);
    let (alpha, radius) = ((b / h).atan(), b.hypot(h));
    let p = (3.0 * 9.81 / (4.0 * radius)).sqrt();
    for part in [0.1f64, 0.5, 0.9] {
        let tilt = format!("{} rad", part * alpha);
        let run = Run { to: 3.5 / p, rtol: 1e-11, every: None, ..Run::default() };
        let done = machine("rocking_block", &[("h", "3 m"), ("start", &tilt)], &run);
        let row = impacts(&done, &["left", "right"])[0];
        let quarter = (1.0 / (1.0 - part)).acosh() / p;
        close(done.trace.times[row] / quarter, 1.0, alpha * alpha / 4.0, "a quarter of its period");
        let speed = column(&done, "turn.f");
        close(speed[row] / speed[row - 1], 1.0 - 1.5 * alpha.sin().powi(2), 1e-12, "the ratio");
    }
}

/// Impacts come ever faster, of one corner and the other in turn; they end at a time that is a sum of integrals, and each
/// corner carries half of the weight from there on.
#[test]
fn a_block_rocks_itself_to_rest() {
    // On ice nothing holds the corners: of the turning (J - m b²)/(J + m b²) is left.
    let text = "param m = 1 kg, b = 0.1 m, h = 0.3 m, g = 9.81 m/s2
Se:weight(-m*g) -> 1:up -> I:rise(m)
1:turn -> I:spin(m*(b^2 + h^2)/3)
state tilt' = turn.f from 0.15 rad
state y' = up.f from b*sin(0.15) + h*cos(0.15)
constraint left: y - b*sin(tilt) - h*cos(tilt) >= 0 m
constraint right: y + b*sin(tilt) - h*cos(tilt) >= 0 m
";
    let (m, b, h, g) = (1.0, 0.1f64, 0.3f64, 9.81);
    let spin = m * (b * b + h * h) / 3.0;
    let ratio = (spin - m * b * b) / (spin + m * b * b);
    let height = |tilt: f64| b * tilt.sin() + h * tilt.cos();
    let slope = |tilt: f64| b * tilt.cos() - h * tilt.sin();
    let inertia = |tilt: f64| spin + m * slope(tilt).powi(2);
    // Time from rest at a tilt to upright, by Simpson's rule with tilt (1 - s²).
    let swing = |tilt: f64| {
        let slowness = |s: f64| {
            let (now, half) = (tilt * (1.0 - s * s), tilt * s * s / 2.0);
            // Of the fall over s², without a difference: the sines and cosines as products.
            let middle = tilt - half;
            let sinc = if half > 0.0 { half.sin() / half } else { 1.0 };
            let fall = tilt * sinc * (b * middle.cos() - h * middle.sin());
            2.0 * tilt / (2.0 * m * g * fall / inertia(now)).sqrt()
        };
        let n = 2000;
        let weight = |k: usize| if k == 0 || k == n { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
        (0..=n).map(|k| weight(k) * slowness(k as f64 / n as f64)).sum::<f64>() / (3.0 * n as f64)
    };
    let mut speed = (2.0 * m * g * (height(0.15) - h) / inertia(0.0)).sqrt();
    let mut end = swing(0.15);
    for _ in 0..60 {
        speed *= ratio;
        // Where it rests: Newton's method for the height, unless that is a straight line to rounding.
        let rise = inertia(0.0) * speed * speed / (2.0 * m * g);
        let mut tilt = rise / b;
        (0..30).filter(|_| rise > 1e-9).for_each(|_| tilt -= (height(tilt) - h - rise) / slope(tilt));
        end += 2.0 * swing(tilt);
    }
    // The last flights are lower than the gap is known: below 1e-6 rad/s it rests.
    for (method, off) in [(Method::Explicit, 1e-6), (Method::Radau, 1e-6)] {
        let done = written(text, &Run { method, to: 1.0, rtol: 1e-11, every: None, ..Run::default() });
        assert!(done.report.steps < 2000, "{}", done.report.steps);
        let both = |k: &usize| column(&done, "left.e")[*k] > 0.0 && column(&done, "right.e")[*k] > 0.0;
        let row = (0..done.trace.times.len()).find(both).expect("it comes to rest");
        close(done.trace.times[row], end, off, "the end");
        close(last(&done, "left.e"), m * g / 2.0, 1e-9, "half of the weight");
        close(last(&done, "right.e"), m * g / 2.0, 1e-9, "half of the weight");
        close(last(&done, "turn.f"), 0.0, 1e-14, "rest");
    }
}

/// A floor acts where it is touched: a body that an impact has lifted from it is caught in the air by another one, and
/// nothing else pushes it there.
#[test]
fn what_impulses_have_opened_stays_open() {
    let text = "Se:wa(-10) -> 1:a -> I:ma(1)
1:b -> I:mb(1, f0 = 4)
Se:wc(-10) -> 1:c -> I:mc(1, f0 = -1)
state xa' = a.f from 0
state xb' = b.f from -1
state xc' = c.f from 3.2
constraint floor: xa >= 0 (restitution = 0.5)
constraint below: xa - xb >= 0 (restitution = 1)
constraint above: xc - xa >= 0 (restitution = 0)
";
    let done = written(text, &Run { to: 0.7, rtol: 1e-11, every: None, ..Run::default() });
    let rows = impacts(&done, &["above"]);
    let (t, row) = (done.trace.times[rows[0]], rows[0]);
    // One is thrown up with 4 m/s after 0.25 s, the other falls all the time.
    let speeds = [4.0 - 10.0 * (t - 0.25), -1.0 - 10.0 * t];
    close(column(&done, "ma.f")[row], (speeds[0] + speeds[1]) / 2.0, 1e-9, "a common speed");
    close(column(&done, "floor.impulse")[row], 0.0, 0.0, "the floor");
}

/// Newton's cradle of three and five balls. Those that touch act all at once, with the least energy in what they exchange: each
/// of the others leaves with 2/n of the speed, and a note says so. Those that are a little apart hand it on one by one.
#[test]
fn cradles_by_either_rule() {
    for n in [3, 5] {
        for gap in [0.0, 1e-9] {
            let mut text = String::new();
            for k in 0..n {
                text += &format!("1:v{k} -> I:m{k}(0.5, f0 = {})\n", u8::from(k == 0));
                // The first has a way to go.
                let at = if k == 0 { -0.5 } else { 0.1 * f64::from(k) + gap * f64::from(k) };
                text += &format!("state x{k}' = v{k}.f from {at:e}\n");
            }
            for k in 1..n {
                text += &format!("constraint c{k}: x{k} - x{} >= 0.1 (restitution = 1)\n", k - 1);
            }
            let done = written(&text, &Run { to: 1.0, rtol: 1e-10, ..Run::default() });
            let together = gap == 0.0;
            for k in 0..n {
                let all = if k == 0 { 2.0 / f64::from(n) - 1.0 } else { 2.0 / f64::from(n) };
                let wanted = if together { all } else { f64::from(u8::from(k == n - 1)) };
                close(last(&done, &format!("m{k}.f")), wanted, 1e-12, &format!("ball {k} of {n}, {gap} m apart"));
            }
            let told = done.report.notes.iter().any(|note| note.contains("are shared out all at once"));
            assert_eq!(told, together, "{:?}", done.report.notes);
        }
    }
}

/// A corner of a body in space: what moves only by rounding, sideways, keeps no impulse from settling.
#[test]
fn a_corner_of_a_body_in_space_is_hit() {
    let text = "import std.multibody
World:world -> Free:free(x0 = [0, 0, 0.5], e0 = [0.99, 0.08, 0.05, 0.1]) -> 1[frame]:box
box -> Body:b(m = 2, J = diag([0.02, 0.03, 0.04]))
constraint corner: box.r[3] + 0.2*box.R[3,1] + 0.1*box.R[3,2] - 0.05*box.R[3,3] >= 0 m (restitution = 0.2)
";
    let done = written(text, &Run { to: 0.4, rtol: 1e-11, every: None, ..Run::default() });
    let rows = impacts(&done, &["corner"]);
    assert!(rows.len() > 1, "it is hit again");
    // The way down along the axes of the body, the arm of the corner, and what the corner gives way by for an impulse.
    let (arm, inertia, [a, b, c, d]) = ([0.2, 0.1, -0.05], [0.02, 0.03, 0.04], [0.99, 0.08, 0.05, 0.1f64]);
    let double = 2.0 / (a * a + b * b + c * c + d * d);
    let up = [double * (b * d - a * c), double * (c * d + a * b), 1.0 - double * (b * b + c * c)];
    let turn = [arm[1] * up[2] - arm[2] * up[1], arm[2] * up[0] - arm[0] * up[2], arm[0] * up[1] - arm[1] * up[0]];
    let height = 0.5 + (0..3).map(|i| arm[i] * up[i]).sum::<f64>();
    let way = 0.5 + (0..3).map(|i| turn[i] * turn[i] / inertia[i]).sum::<f64>();
    let impulse = 1.2 * (2.0 * 9.81 * height).sqrt() / way;
    close(column(&done, "corner.impulse")[rows[0]], impulse, 1e-9, "the impulse");
    for (i, axis) in ["x", "y", "z"].iter().enumerate() {
        let speed = column(&done, &format!("b.inertia.{axis}.f"))[rows[0]];
        close(speed, turn[i] * impulse / inertia[i], 1e-8, &format!("turning about {axis}"));
    }
}

/// The place of a frame decides nothing at the start but whether it is touched: joints begin where they are said to.
#[test]
fn contacts_behind_joints_leave_the_start_alone() {
    let run = Run { to: 1e-6, every: None, ..Run::default() };
    let done = machine("tip_on_floor", &[], &run);
    assert_eq!((column(&done, "one.angle")[0], column(&done, "two.angle")[0]), (0.3, -0.5));
    // A tip that lies on the floor at the start is carried by it.
    let depth = format!("{:e} m", -(0.6 * 0.3f64.sin() + 0.5 * (-0.2f64).sin()));
    let lying = machine("tip_on_floor", &[("depth", &depth)], &run);
    close(column(&lying, "one.angle")[0], 0.3, 1e-15, "an angle");
    close(column(&lying, "two.angle")[0], -0.5, 1e-15, "an angle");
    assert!(last(&lying, "floor.e") > 1.0, "{}", last(&lying, "floor.e"));
}
