//! Multibonds, ports with signals, and `std.multibody` against closed forms.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::f64::consts::{FRAC_PI_3, PI};

use halfarrow::{Execution, FixedMethod, Form, Linearize, Method, Model, Point, Record, Run, Simulated};

fn model(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn run(text: &str, run: &Run) -> Simulated {
    let run = Run { record: Record::All, ..run.clone() };
    model(text).simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    let found = done.trace.columns.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("nothing called {name}")).values
}

fn times(done: &Simulated) -> &[f64] {
    &done.trace.times
}

fn last(done: &Simulated, name: &str) -> f64 {
    *column(done, name).last().expect("there are samples")
}

#[track_caller]
fn close(found: f64, expected: f64, off: f64) {
    assert!((found - expected).abs() <= off, "{found} instead of {expected}: off by {:.1e}", (found - expected).abs());
}

#[test]
fn what_stands_often_in_equations_has_a_name() {
    let turning = "model Turning\nimport std.multibody\n\
        World:world -> Free:joint() -> Body:body(m = 2, J = diag([0.1, 0.2, 0.3]))\n";
    let report = model(turning).equations(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let lines = [report.text, report.legend].concat();
    let norms = |line: &String| line.matches("joint.turning.e[1]² + joint.turning.u[1]²").count();
    assert_eq!(lines.iter().map(norms).sum::<usize>(), 1, "{lines:#?}");
    // No pull of the earth along x and y.
    assert!(lines.iter().all(|line| !line.contains(" 0 ")), "{lines:#?}");
    assert!(lines[..3].iter().all(|line| line.chars().count() < 80), "{lines:#?}");
}

/// Names and number of the states of the minimal form.
fn states(text: &str) -> Vec<String> {
    let report = model(text).equations(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    report.states.into_iter().map(|s| s.name).collect()
}

/// Jacobi's elliptic functions sn, cn, dn of `u` and parameter `m`, by the arithmetic-geometric mean.
fn jacobi(u: f64, m: f64) -> [f64; 3] {
    let (mut a, mut b, mut c) = (1.0f64, (1.0 - m).sqrt(), m.sqrt());
    let mut steps = vec![(a, c)];
    while c.abs() > 1e-16 {
        (a, b, c) = ((a + b) / 2.0, (a * b).sqrt(), (a - b) / 2.0);
        steps.push((a, c));
    }
    let last = steps.len() - 1;
    let mut phi = 2f64.powi(last as i32) * a * u;
    for &(a, c) in steps[1..].iter().rev() {
        phi = (phi + (c / a * phi.sin()).asin()) / 2.0;
    }
    let sn = phi.sin();
    [sn, phi.cos(), (1.0 - m * sn * sn).sqrt()]
}

/// A body that nothing holds turns over about its middle axis: Euler's equations in Jacobi's functions.
#[test]
fn a_free_body_turns_over() {
    let text = "model Tumble
1[3]:w -> I[3]:body([1, 2, 3], f0 = [1, 0, 0.5])
w -> GY[3]:ejs(skew(body.p))
";
    let [i1, i2, i3] = [1.0, 2.0, 3.0f64];
    // Twice the energy, and the square of the angular momentum: below 2 E I2 the body turns about its first axis.
    let (e, l) = (i1 + i3 * 0.25, i1 * i1 + i3 * i3 * 0.25);
    assert!(l < e * i2);
    let rate = ((i2 - i1) * (e * i3 - l) / (i1 * i2 * i3)).sqrt();
    let parameter = (i3 - i2) * (l - e * i1) / ((i2 - i1) * (e * i3 - l));
    let [x, y, z] = [(e * i3 - l, i1, i3), (l - e * i1, i2, i2), (l - e * i1, i3, i3)]
        .map(|(above, own, far)| (above / (own * (far - i1))).sqrt());
    let done = run(text, &Run { to: 20.0, rtol: 1e-12, every: Some(0.5), ..Run::default() });
    for (k, t) in times(&done).iter().enumerate() {
        let [sn, cn, dn] = jacobi(rate * t, parameter);
        close(column(&done, "body.x.f")[k], x * dn, 1e-9);
        close(column(&done, "body.y.f")[k], y * sn, 1e-9);
        close(column(&done, "body.z.f")[k], z * cn, 1e-9);
    }
}

/// The length of a quaternion is a relation of positions with a closed form, from which its drift is told.
#[test]
fn a_quaternion_keeps_its_length() {
    let text = "model Tumble
import std.multibody
World:world -> Free:free(w0 = [0.1, 3, 0.2]) -> Body:body(m = 1, J = diag([1, 2, 3]))
";
    let done = run(text, &Run { to: 5.0, every: Some(0.1), ..Run::default() });
    let [drift] = done.report.audit.drift.as_slice() else { panic!("{:?}", done.report.audit.drift) };
    let squares = |k: usize| (1..=4).map(|i| column(&done, &format!("free.turning.e[{i}]"))[k].powi(2)).sum::<f64>();
    let lengthened = squares(times(&done).len() - 1) - squares(0);
    close(drift.value.expect("it is known").abs(), lengthened.abs() / 2.0, 1e-14);
    assert_eq!(drift.kind, "closed");
}

/// A body that moves freely and turns together with a hinged one that it stands aligned with at the start: its own inertia about its
/// centre of mass is added to that of the pendulum, which keeps its energy.
#[test]
fn two_bodies_that_turn_together_start_aligned() {
    let text = "model Orientation\nimport std.multibody\nCutOrientation:joint\nWorld:world -> 1[frame]:ground\n\
                ground -> Free:fr(x0 = [0.3, 0, 0], w0 = [0.1, 0.5, 0.2], v0 = [0.1, 0.3, 0.2]) -> 1[frame]:b\n\
                b -> Body:coupler(m = 2 kg, J = diag([1e-3, 0.04, 0.04]), c = [0.2, 0, 0])\n\
                ground -> Revolute:rocker(n = [0, 1, 0], q0 = -0.5 rad) -> 1[frame]:c\n\
                c -> Body:swing(m = 1.5 kg, J = diag([1e-3, 0.02, 0.02]), c = [0.2, 0, 0])\n\
                c -> joint.a\nb -> joint.b\n";
    let done = run(text, &Run { to: 1.0, every: Some(0.05), rtol: 1e-11, ..Run::default() });
    let inertia = 0.02 + 1.5 * 0.2 * 0.2 + 0.04;
    let energy = |q: f64, w: f64| 0.5 * inertia * w * w - 1.5 * 9.81 * 0.2 * q.sin();
    close(column(&done, "rocker.speed")[0], 0.5, 1e-15);
    let first = energy(column(&done, "rocker.angle")[0], 0.5);
    for (q, w) in column(&done, "rocker.angle").iter().zip(column(&done, "rocker.speed")) {
        close(energy(*q, *w), first, 1e-9);
    }
    assert!(last(&done, "rocker.angle") > 1.0, "it falls");
}

/// Frames that turn together meet on the side on which they are alike, not turned by half a turn, however far apart they begin; and
/// states follow from where the start is, which may be far from where it is looked for.
#[test]
fn frames_that_turn_together_are_alike() {
    let slide = "model Slide\nimport std.multibody\nWorld:world -> FixedRotation:lean(n = [0, 1, 0], angle = 0.5) -> 1[frame]:base\n\
                 base -> Prismatic:x(n = [1, 0, 0], v0 = 3) -> Prismatic:y(n = [0, 1, 0]) -> Prismatic:z -> Spherical:turning(e0 = [0.1, 1, 0, 0]) -> 1[frame]:loose\n\
                 loose -> Body:b(m = 2, J = diag([0.2, 0.2, 0.2]), c = [0.3, 0.1, -0.2])\n\
                 CutPrismatic:cut(n = [1, 0, 0])\nbase -> cut.a\nloose -> cut.b\n";
    let done = run(slide, &Run { to: 1.0, ..Run::default() });
    for turned in 2..=4 {
        close(last(&done, &format!("turning.e[{turned}]")), 0.0, 1e-12);
    }
    close(last(&done, "x.way"), 3.0 + 9.81 / 2.0 * 0.5f64.sin(), 1e-6);
    // A hinge whose axis points the other way at first.
    let hinge = "model Hinge\nimport std.multibody\nWorld:world(g = [0, -9.81, 0]) -> 1[frame]:base\n\
                 base -> Free:way(e0 = [0.1, 1, 0.1, 0]) -> 1[frame]:loose -> Body:b(m = 2, J = diag([0.2, 0.2, 0.2]), c = [0.3, 0, 0])\n\
                 CutRevolute:pin(n = [0, 0, 1])\nbase -> pin.a\nloose -> pin.b\n";
    let done = run(hinge, &Run { to: 0.5, ..Run::default() });
    let e: Vec<f64> = (1..=4).map(|k| last(&done, &format!("way.turning.e[{k}]"))).collect();
    let square: f64 = e.iter().map(|e| e * e).sum();
    close((e[0] * e[0] + e[3] * e[3]) / square, 1.0, 1e-9);
    // One that is carried by a pendulum beside one that falls: 169 degrees apart.
    let text = "model Falling\nimport std.multibody\nWorld:world(g = [-10, -8, -8]) -> 1[frame]:ground\n\
                ground -> Free:one(x0 = [0.6, -0.2, 0.6]) -> 1[frame]:a -> Body:b1(m = 1.1, J = diag([0.11, 0.06, 0.12]), c = [0.3, -0.2, 0.1])\n\
                ground -> Spherical:ball(e0 = [0.03, 0.6, 2.5, 0.8]) -> 1[frame]:b -> Body:b2(m = 3, J = diag([0.3, 0.2, 0.5]), c = [-0.3, 0.1, 0.05])\n\
                b -> Free:two(x0 = [0.5, -0.4, 0.1], e0 = [0.9, 1.7, -0.1, -0.3]) -> 1[frame]:c -> Body:b4(m = 0.5, J = diag([0.05, 0.04, 0.05]), c = [0, -0.2, 0.4])\n\
                CutOrientation:alike\na -> alike.a\nc -> alike.b\nb -> FrameSensor:sensor\n";
    let alone = "model Pendulum\nimport std.multibody\nWorld:world(g = [-10, -8, -8]) -> 1[frame]:ground\n\
                 ground -> Spherical:ball(e0 = [0.03, 0.6, 2.5, 0.8]) -> 1[frame]:b -> Body:b2(m = 3, J = diag([0.3, 0.2, 0.5]), c = [-0.3, 0.1, 0.05])\n\
                 b -> FrameSensor:sensor\n";
    let exact = Run { to: 1.0, every: Some(1.0), rtol: 1e-10, ..Run::default() };
    let [together, alone] = [text, alone].map(|text| run(text, &exact));
    for k in 1..=4 {
        assert!(column(&together, "one.turning.e[1]")[0] == 1.0);
        close(column(&together, &format!("ball.e[{k}]"))[0], column(&alone, &format!("ball.e[{k}]"))[0], 1e-14);
    }
    for way in 1..=3 {
        let w = format!("sensor.w[{way}]");
        close(last(&together, &w), last(&alone, &w), 1e-8);
    }
}

/// What falls freely with its joints at rest carries nothing in them but rounding, which is held against the weights, however many
/// levers these are away; and falls as a stone does.
#[test]
fn a_machine_that_is_let_go_falls_as_one() {
    let text = "model Thrown\nimport std.multibody\nWorld:world(g = [1, -2, -9]) -> Free:way(e0 = [0.9, 0.1, 0.3, 0.2]) -> 1[frame]:a\n\
                a -> Body:hull(m = 1.4, J = diag([0.14, 0.2, 0.12]), c = [0.1, 0.2, -0.1])\n\
                a -> FixedTranslation:arm(d = [-0.3, -0.3, 0.2]) -> FixedRotation:lean(n = [0, 1, 0.3], angle = 1.6) -> Revolute:knee(n = [0.4, -0.1, 0.7], q0 = 0.6) -> 1[frame]:b\n\
                b -> Body:shank(m = 0.7, J = diag([0.05, 0.06, 0.07]), c = [0.1, -0.05, 0.1])\n\
                b -> FixedTranslation:foot(d = [0.7, 0.1, 0.03]) -> Universal:ankle(n1 = [1, 0.2, 0], n2 = [-0.1, 0.5, 1], q1 = 0.3, q2 = 0.2) -> Body:sole(m = 1.2, J = diag([0.12, 0.09, 0.1]), c = [0.2, 0.1, -0.1])\n";
    for rtol in [1e-6, 1e-10] {
        let done = run(text, &Run { to: 1.0, rtol, ..Run::default() });
        for (name, fallen) in [("way.x.q", 0.5), ("way.y.q", -1.0), ("way.z.q", -4.5), ("knee.q", 0.6)] {
            close(last(&done, name), fallen, 1e-12);
        }
    }
}

/// A body that hangs on a ball joint, drawn as one that moves freely and a cut joint, goes on where one of its speeds tells another
/// by equations of their own that vanish, as long as the three that are independent tell all of them.
#[test]
fn a_free_body_hangs_on_a_ball_joint() {
    let body = "1[frame]:b -> Body:bob(m = 2 kg, J = diag([0.2, 0.15, 0.1]), c = [0.2, -0.3, -0.1])";
    let text = format!(
        "model Hung\nimport std.multibody\nWorld:world -> 1[frame]:ground\n\
         ground -> Free:way(x0 = [0, 0, -1], e0 = [-1, -0.4, -0.5, 0.04]) -> {body}\n\
         b -> FixedTranslation:eye(d = [1, 0.5, 0.3]) -> pin.b\nground -> pin.a\nCutSpherical:pin\nb -> FrameSensor:sensor\n"
    );
    let exact = Run { to: 3.0, every: Some(0.5), rtol: 1e-9, ..Run::default() };
    let done = run(&text, &exact);
    let e: Vec<String> = (1..=4).map(|k| format!("{:e}", column(&done, &format!("way.turning.e[{k}]"))[0])).collect();
    let tree = format!(
        "model Tree\nimport std.multibody\nWorld:world -> Spherical:ball(e0 = [{}]) -> FixedTranslation:arm(d = [-1, -0.5, -0.3]) -> {body}\n\
         b -> FrameSensor:sensor\n",
        e.join(", ")
    );
    let tree = run(&tree, &exact);
    for name in (1..=3).flat_map(|k| [format!("sensor.w[{k}]"), format!("sensor.r[{k}]")]) {
        let most = column(&tree, &name).iter().fold(0.0f64, |most, v| most.max(v.abs()));
        column(&done, &name).iter().zip(column(&tree, &name)).for_each(|(a, b)| close(*a, *b, 1e-6 * most));
    }
}

/// A pendulum that falls from level, by x, y and an angle of which a pin leaves one: now this, now that one is independent, and so
/// are their rates. Closed form: Jacobi's functions with a half as their parameter.
#[test]
fn a_pendulum_by_three_coordinates_swings_through() {
    let text = "model Level\nimport std.multibody\nWorld:world(g = [0, -9.81, 0]) -> 1[frame]:ground\n\
                ground -> Planar:j(x0 = 1) -> 1[frame]:f\nf -> Body:b(m = 1, J = diag([0.1, 0.1, 0.1]))\n\
                f -> FixedTranslation:arm(d = [-1, 0, 0]) -> pin.a\nground -> pin.b\nCutRevolute:pin\n";
    assert_eq!(states(text).len(), 2);
    let done = run(text, &Run { to: 3.0, every: Some(0.1), rtol: 1e-11, ..Run::default() });
    for (t, q) in times(&done).iter().zip(column(&done, "j.turning.q")) {
        let [_, cn, dn] = jacobi((9.81f64 / 1.1).sqrt() * t, 0.5);
        close(*q, 2.0 * (0.5f64.sqrt() * cn / dn).asin() - PI / 2.0, 1e-8);
    }
}

/// A top on its point, at the two rates at which it goes round without nodding: C w3 W - A W^2 cos(th) = m g l.
#[test]
fn a_top_precesses_steadily() {
    let (a, c, mgl, theta, spin) = (0.02, 0.005, 0.981, FRAC_PI_3, 60.0);
    let root = f64::sqrt((c * spin) * (c * spin) - 4.0 * a * mgl * f64::cos(theta));
    for around in [(c * spin - root) / (2.0 * a * theta.cos()), (c * spin + root) / (2.0 * a * theta.cos())] {
        for joint in [
            format!("Spherical:point(e0 = [cos(theta/2), sin(theta/2), 0, 0], w0 = [0, {around}*sin(theta), 60])"),
            // About x, y and z in turn: the axis of the top leans about x.
            format!("SphericalCardan:point(q1 = theta, w1 = 0, w2 = {around}*sin(theta), w3 = 60)"),
        ] {
            let text = format!(
                "model Top
import std.multibody
param theta = {theta}
World:world -> {joint} -> FixedTranslation:stem(d = [0, 0, 0.1])
stem -> Body:top(m = 1, J = diag([0.01, 0.01, 0.005]))
output up = top.a.R[3,3]
output x = top.a.r[1]
output y = top.a.r[2]
"
            );
            let to = 1.0;
            let done = run(&text, &Run { to, rtol: 1e-12, step: Some(0.01), ..Run::default() });
            for (k, t) in times(&done).iter().enumerate() {
                let angle = around * t;
                close(column(&done, "up")[k], theta.cos(), 1e-9);
                close(column(&done, "x")[k], 0.1 * theta.sin() * angle.sin(), 1e-9);
                close(column(&done, "y")[k], -0.1 * theta.sin() * angle.cos(), 1e-9);
            }
        }
    }
}

/// Two shafts at an angle with a cardan joint between them: tan(b) = tan(a)/cos(bend).
#[test]
fn a_universal_joint_turns_unevenly() {
    let text = "model Cardan
import std.multibody
param bend = 0.5235987755982988
World:world(g = [0, 0, 0]) -> 1[frame]:ground
ground -> Revolute:input(n = [1, 0, 0], w0 = 2, fixed = 1) -> 1[frame]:yoke -> Body:first(m = 1, J = diag([0.1, 1, 1]))
yoke -> Universal:cross(n1 = [0, 1, 0], n2 = [0, 0, 1], q2 = bend) -> 1[frame]:shaft
shaft -> Body:second(m = 1, J = diag([0.2, 1, 1]))
// The second shaft turns in a bearing whose axis leans by the bend.
ground -> FixedRotation:lean(n = [0, 0, 1], angle = bend) -> Revolute:output(n = [1, 0, 0]) -> bearing.b
CutOrientation:bearing
shaft -> bearing.a
";
    turns_unevenly(text, "output.speed");
}

/// Two shafts that lean by 30 degrees and a universal joint between them, through full turns: by how much the second is faster.
fn turns_unevenly(text: &str, output: &str) -> Simulated {
    assert_eq!(states(text).len(), 2, "{:?}", states(text));
    let done = run(text, &Run { to: 10.0, rtol: 1e-11, every: Some(0.05), ..Run::default() });
    assert!(last(&done, "input.angle") > 15.0);
    let (sin, cos) = (PI / 6.0).sin_cos();
    for k in 0..times(&done).len() {
        // The first axis of the cross is y: at an angle of 0 it lies in the plane of the shafts, and tan(b) = tan(a)/cos(bend).
        let a = column(&done, "input.angle")[k];
        let ratio = column(&done, output)[k] / column(&done, "input.speed")[k];
        close(ratio, cos / (1.0 - sin * sin * a.cos() * a.cos()), 1e-9);
    }
    done
}

/// The same joint closes a loop: the second shaft stands in a ball bearing that slides along it, at its far end.
#[test]
fn a_universal_joint_that_closes_a_loop_turns_unevenly() {
    let text = "model Cardan
import std.multibody
param bend = 0.5235987755982988
World:world(g = [0, 0, 0]) -> 1[frame]:ground
ground -> Revolute:input(n = [1, 0, 0], w0 = 2, fixed = 1) -> 1[frame]:yoke -> Body:first(m = 1, J = diag([0.1, 1, 1]))
ground -> FixedRotation:lean(n = [0, 0, 1], angle = bend) -> FixedTranslation:far(d = [0.7, 0, 0]) -> Prismatic:along(n = [1, 0, 0]) -> SphericalCardan:bearing -> 1[frame]:shaft
shaft -> Body:second(m = 1, J = diag([0.2, 1, 1]))
CutUniversal:cross(n1 = [0, 1, 0], n2 = [0, 0, 1])
yoke -> cross.a
shaft -> FixedTranslation:fork(d = [-0.7, 0, 0]) -> cross.b
";
    let done = turns_unevenly(text, "bearing.roll.speed");
    for k in 0..times(&done).len() {
        close(column(&done, "along.way")[k].hypot(column(&done, "bearing.yaw.angle")[k]), 0.0, 1e-9);
    }
}

/// What a cut joint leaves free to a body with six ways to move is what the joint of that kind gives: on a slope a slide goes
/// down a parabola, a body on a plane too and turns about its centre, and in a guide it swings as on a prismatic and a ball joint.
#[test]
fn cut_joints_leave_what_their_joints_give() {
    let free = "-> Prismatic:x(n = [1, 0, 0], v0 = 3) -> Prismatic:y(n = [0, 1, 0]) -> Prismatic:z -> SphericalCardan:turning(w1 = 1, w2 = 0.5)";
    let (sin, cos) = 0.5f64.sin_cos();
    let sliding = |cut: &str, center: &str| {
        format!(
            "model Slope
import std.multibody
World:world -> FixedRotation:lean(n = [0, 1, 0], angle = 0.5) -> 1[frame]:base
base {free} -> 1[frame]:loose -> Body:b(m = 2, J = diag([0.2, 0.2, 0.2]), c = {center})
{cut}
base -> cut.a
loose -> cut.b
"
        )
    };
    let exact = Run { to: 0.5, rtol: 1e-11, every: Some(0.05), ..Run::default() };
    let way = |t: f64| 3.0 * t + 9.81 / 2.0 * sin * t * t;
    let slide = sliding("CutPrismatic:cut(n = [1, 0, 0])", "[0.3, 0.1, -0.2]").replace("w1 = 1, w2 = 0.5", "");
    assert_eq!(states(&slide).len(), 2, "{:?}", states(&slide));
    let done = run(&slide, &exact);
    times(&done).iter().zip(column(&done, "x.way")).for_each(|(t, x)| close(*x, way(*t), 1e-9));
    for still in ["y.way", "z.way", "turning.roll.angle", "turning.pitch.angle", "turning.yaw.angle"] {
        close(last(&done, still), 0.0, 1e-12);
    }
    let plane = sliding("CutInplane:cut(n = [0, 0, 1])", "[0, 0, 0]");
    assert_eq!(states(&plane).len(), 10, "{:?}", states(&plane));
    let done = run(&plane, &exact);
    times(&done).iter().zip(column(&done, "x.way")).for_each(|(t, x)| close(*x, way(*t), 1e-9));
    close(last(&done, "z.way"), 0.0, 1e-12);
    // The force of the plane acts at the centre, a sphere of inertia keeps turning, and the plane carries the weight across it.
    close(
        last(&done, "b.inertia.x.f").hypot(last(&done, "b.inertia.y.f")).hypot(last(&done, "b.inertia.z.f")),
        f64::hypot(1.0, 0.5),
        1e-9,
    );
    close(last(&done, "cut.above.e").abs(), 2.0 * 9.81 * cos, 1e-8);
    let guide = sliding("CutInline:cut(n = [0.6, 0, 0.8])", "[0.3, 0.1, -0.2]")
        .replace("v0 = 3", "v0 = 1.8")
        .replace("Prismatic:z", "Prismatic:z(v0 = 2.4)");
    let guide = guide
        + "base -> Prismatic:guide(n = [0.6, 0, 0.8], v0 = 3) -> SphericalCardan:ball(w1 = 1, w2 = 0.5) -> Body:same(m = 2, J = diag([0.2, 0.2, 0.2]), c = [0.3, 0.1, -0.2])\n";
    assert_eq!(states(&guide).len(), 16, "{:?}", states(&guide));
    let done = run(&guide, &exact);
    for (cut, tree, factor) in [
        ("x.way", "guide.way", 0.6),
        ("z.way", "guide.way", 0.8),
        ("turning.roll.angle", "ball.roll.angle", 1.0),
        ("turning.yaw.angle", "ball.yaw.angle", 1.0),
    ] {
        column(&done, cut).iter().zip(column(&done, tree)).for_each(|(c, t)| close(*c, factor * t, 1e-9));
    }
    assert!(last(&done, "ball.yaw.angle").abs() > 0.1);
}

/// The planar model by transformers and the frames of space tell the same double pendulum.
#[test]
fn a_double_pendulum_of_frames_is_that_of_transformers() {
    let plane =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/double_pendulum/model.bond"));
    let exact = Run { to: 3.0, rtol: 1e-12, every: Some(0.1), ..Run::default() };
    let plane = run(&plane.expect("the model is there"), &exact);
    // Points: all inertia is in the masses.
    let text = "model Frames
import std.multibody
component Point(param m; in a : frame) {
    a.v -> 1[3]:v -> I[3]:mass(m)
    a.w -> 1[3]:w
    v -> GY[3]:turning(m*transpose(skew(w.f)))
    Se[3]:weight(m*(transpose(a.R)*a.g)) -> v
}
World:world -> Revolute:one(n = [0, 1, 0], q0 = -0.9) -> FixedTranslation:rod1(d = [0, 0, -0.6]) -> 1[frame]:elbow
elbow -> Point:m1(m = 1.2)
elbow -> Revolute:two(n = [0, 1, 0], q0 = 1.3) -> FixedTranslation:rod2(d = [0, 0, -0.9]) -> Point:m2(m = 0.8)
output phi1 = -one.q
output phi2 = -one.q - two.q
";
    let space = run(text, &exact);
    for name in ["phi1", "phi2"] {
        for (k, value) in column(&space, name).iter().enumerate() {
            close(*value, column(&plane, name)[k], 1e-9);
        }
    }
}

const FOUR_BAR: &str = "model FourBar
import std.multibody
World:world -> 1[frame]:ground -> Revolute:a1(n = [0, 1, 0], q0 = 0.3, w0 = 25, fixed = 1) -> 1[frame]:crank
crank -> FixedTranslation:c1(d = [0.2, 0, 0]) -> Revolute:a2(n = [0, 1, 0]) -> 1[frame]:coupler
crank -> Body:crank_body(m = 1, J = diag([0.001, 0.01, 0.01]), c = [0.1, 0, 0])
coupler -> Body:coupler_body(m = 1, J = diag([0.001, 0.03, 0.03]), c = [0.25, 0, 0])
coupler -> FixedTranslation:c2(d = [0.5, 0, 0])
ground -> FixedTranslation:g(d = [0.5, 0, 0]) -> Revolute:a3(n = [0, 1, 0], q0 = 1.2) -> 1[frame]:rocker
rocker -> Body:rocker_body(m = 1, J = diag([0.001, 0.02, 0.02]), c = [0.2, 0, 0])
rocker -> FixedTranslation:c3(d = [0.4, 0, 0])
CutRevolute:close(n = [0, 1, 0])
c2 -> close.a
c3 -> close.b
output gap = norm(close.a.r - close.b.r)
";

/// A hinge in space closes a plane loop: three of its five conditions hold anyway, one degree of freedom is left, and the loop
/// stays closed while the crank turns round.
#[test]
fn a_four_bar_in_space_has_one_degree_of_freedom() {
    assert_eq!(states(FOUR_BAR), ["a1.rate.f", "a1.q"]);
    let done = run(FOUR_BAR, &Run { to: 5.0, rtol: 1e-10, every: Some(0.01), ..Run::default() });
    assert!(last(&done, "a1.q").abs() > 12.0, "the crank turns round: {}", last(&done, "a1.q"));
    assert!(column(&done, "gap").iter().all(|gap| *gap < 1e-12));
}

/// Energy along the motion of a chain of bodies in space whose joints turn about axes in all directions.
#[test]
fn chains_in_space_keep_their_energy() {
    let mut text = String::from("model Chain\nimport std.multibody\nWorld:world -> 1[frame]:end0\n");
    for i in 1..=5 {
        let axis = ["[1, 0, 0]", "[0, 0.6, 0.8]", "[0, 1, 0]"][i % 3];
        text += &format!("end{} -> Revolute:j{i}(n = {axis}, q0 = 0.{i}, w0 = {i} - 2) -> 1[frame]:hub{i}\n", i - 1);
        text += &format!(
            "hub{i} -> Body:b{i}(m = 1, J = [[0.02, 0.001, 0], [0.001, 0.03, 0], [0, 0, 0.01]], c = [0, 0.05, -0.25])\n"
        );
        text += &format!("hub{i} -> FixedTranslation:t{i}(d = [0, 0, -0.5]) -> 1[frame]:end{i}\n");
    }
    let parts: Vec<String> = (1..=5)
        .map(|i| {
            format!(
                "0.5*dot(b{i}.mass.p, b{i}.mass.f) + 0.5*dot(b{i}.inertia.p, b{i}.inertia.f) + 9.81*(b{i}.a.r[3] + dot([b{i}.a.R[3,1], b{i}.a.R[3,2], b{i}.a.R[3,3]], [0, 0.05, -0.25]))"
            )
        })
        .collect();
    text += &format!("output E = {}\n", parts.join(" + "));
    assert_eq!(states(&text).len(), 10);
    let done = run(&text, &Run { to: 2.0, rtol: 1e-12, every: Some(0.1), ..Run::default() });
    let energy = column(&done, "E");
    assert!(energy[0].abs() > 1.0);
    for e in energy {
        close(*e, energy[0], 1e-9);
    }
}

/// Forms agree on a pendulum of two bodies in space.
#[test]
fn forms_agree_in_space() {
    let text = "model Two
import std.multibody
World:world -> Revolute:j1(n = [0, 1, 0], q0 = 0.5, w0 = 1) -> 1[frame]:h1 -> Body:b1(m = 1, J = diag([0.02, 0.03, 0.01]), c = [0, 0, -0.2])
h1 -> FixedTranslation:t1(d = [0, 0, -0.4]) -> Revolute:j2(n = [1, 0, 0], q0 = 0.2) -> Body:b2(m = 2, J = diag([0.02, 0.03, 0.01]), c = [0, 0, -0.3])
";
    let exact = Run { to: 0.5, rtol: 1e-11, ..Run::default() };
    let minimal = run(text, &exact);
    for form in [Form::Kane, Form::Inverted, Form::Lagrange] {
        let other = run(text, &Run { form, ..exact.clone() });
        for name in ["j1.q", "j2.q", "j1.rate.f", "b2.mass.x.f", "b2.inertia.z.f"] {
            close(last(&other, name), last(&minimal, name), 1e-8);
        }
    }
}

/// Operations of an evaluation of the rates of the wishbone below, under a free hull.
const OPERATIONS: usize = 6353;

/// Two arms, an upright and a tie rod.
const WISHBONE: &str = "model Wishbone
import std.multibody
World:world -> 1[frame]:chassis
chassis -> FixedTranslation:la(d = [0, 0.3, -0.1]) -> Revolute:lower(n = [1, 0, 0], q0 = 0.05) -> 1[frame]:lower_arm
lower_arm -> Body:lower_body(m = 5, J = diag([0.05, 0.02, 0.06]), c = [0, 0.2, 0])
chassis -> FixedTranslation:ua(d = [0, 0.35, 0.2]) -> Revolute:upper(n = [1, 0, 0]) -> 1[frame]:upper_arm
upper_arm -> Body:upper_body(m = 3, J = diag([0.03, 0.01, 0.04]), c = [0, 0.15, 0])
lower_arm -> FixedTranslation:lb(d = [0, 0.4, 0]) -> Spherical:ball() -> 1[frame]:upright
upright -> Body:knuckle(m = 20, J = diag([0.5, 0.8, 0.5]), c = [0, 0.05, 0.15])
upper_arm -> FixedTranslation:ub(d = [0, 0.3, 0]) -> top.a
upright -> FixedTranslation:ut(d = [0, -0.03, 0.3]) -> top.b
CutSpherical:top
Rod:tie(l = 0.38)
chassis -> FixedTranslation:ti(d = [-0.12, 0.3, 0]) -> tie.a
upright -> FixedTranslation:to(d = [-0.12, -0.02, 0.1]) -> tie.b
SpringDamper:spring(k = 40e3, l0 = 0.45, c = 2e3)
chassis -> FixedTranslation:sa(d = [0, 0.35, 0.3]) -> spring.a
lower_arm -> FixedTranslation:sb(d = [0, 0.25, 0]) -> spring.b
output gap = norm(top.a.r - top.b.r)
output tie_length = norm(tie.a.r - tie.b.r)
";

/// A double wishbone: two hinged arms, an upright between ball joints, a tie rod. One degree of freedom is left, the loops stay
/// closed, and on its spring it comes to rest.
#[test]
fn a_double_wishbone_moves_one_way() {
    let done = run(WISHBONE, &Run { to: 2.0, rtol: 1e-8, every: Some(0.05), ..Run::default() });
    let mut rates = states(WISHBONE);
    rates.retain(|name| name.ends_with(".f"));
    assert_eq!(rates, ["lower.rate.f"]);
    assert!(column(&done, "gap").iter().all(|gap| *gap < 1e-11));
    column(&done, "tie_length").iter().for_each(|l| close(*l, 0.38, 1e-11));
    close(last(&done, "lower.rate.f"), 0.0, 1e-4);
}

/// Its loop is solved by gains, its mass matrix has each entry once: operations of an evaluation, not seconds.
#[test]
fn a_double_wishbone_under_a_hull_takes_few_operations() {
    let free = "World:world -> Free:floating() -> 1[frame]:chassis\nchassis -> Body:hull(m = 1500, J = diag([220, 940, 1050]))";
    let text = WISHBONE.replace("World:world -> 1[frame]:chassis", free);
    let compiled = model(&text).compile(Form::Minimal).expect("equations");
    assert!(compiled.operations() <= OPERATIONS, "{} operations", compiled.operations());
}

/// Gains, positions and what follows them have the same bits by bytecode and by machine code.
#[test]
fn a_loop_in_space_runs_the_same_by_machine_code() {
    let runs = [Execution::Bytecode, Execution::Machine].map(|execution| {
        let method = Method::Fixed(FixedMethod::Rk4);
        let fixed = Run { to: 0.2, method, step: Some(1e-3), every: Some(0.01), execution, ..Run::default() };
        run(WISHBONE, &fixed).trace
    });
    for (one, other) in runs[0].columns.iter().zip(&runs[1].columns) {
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&one.values), bits(&other.values), "{}", one.name);
    }
}

/// Along its axis a screwless hinge falls freely while it turns at a constant rate.
#[test]
fn a_cylindrical_joint_falls_and_turns() {
    let text = "model Pin
import std.multibody
World:world -> Cylindrical:pin(n = [0, 0, 1], way0 = 2) -> Body:ring(m = 3, J = diag([1, 1, 2]))
Se:motor(4) -> pin.turn
";
    let done = run(text, &Run { to: 1.5, rtol: 1e-12, ..Run::default() });
    close(last(&done, "pin.sliding.way"), 2.0 - 4.905 * 2.25, 1e-9);
    close(last(&done, "pin.turning.speed"), 3.0, 1e-9);
}

/// In its plane a body that is pushed at its centre moves on a parabola and keeps turning.
#[test]
fn a_planar_joint_leaves_three_ways_to_move() {
    let text = "model Puck
import std.multibody
World:world(g = [0, -9.81, 0]) -> Planar:table(x0 = 1) -> Body:puck(m = 2, J = diag([1, 1, 0.5]))
Se:push(6) -> table.x
Se:spin(0.25) -> table.axis
";
    assert_eq!(states(text).len(), 6);
    let done = run(text, &Run { to: 1.0, rtol: 1e-12, ..Run::default() });
    close(last(&done, "table.along_x.way"), 1.0 + 1.5, 1e-9);
    close(last(&done, "table.along_y.way"), -4.905, 1e-9);
    close(last(&done, "table.turning.angle"), 0.25, 1e-9);
}

/// A free body on a parabola turns as one that is held at its centre; by its quaternion and by joints beside each other.
#[test]
fn a_free_body_flies() {
    let text = "model Flight
import std.multibody
World:world -> Free:air(x0 = [1, 2, 3], v0 = [4, 0, 5], w0 = [1, 0, 0.6]) -> Body:stone(m = 2, J = diag([1, 2, 3]))
World:hall(g = [0, 0, 0]) -> Spherical:hold(w0 = [1, 0, 0.6]) -> Body:held(m = 2, J = diag([1, 2, 3]))
output r = stone.a.r
";
    let done = run(text, &Run { to: 2.0, rtol: 1e-12, every: Some(0.1), ..Run::default() });
    for (k, t) in times(&done).iter().enumerate() {
        close(column(&done, "r[1]")[k], 1.0 + 4.0 * t, 1e-9);
        close(column(&done, "r[2]")[k], 2.0, 1e-9);
        close(column(&done, "r[3]")[k], 3.0 + 5.0 * t - 4.905 * t * t, 1e-9);
        for s in ["x", "y", "z"] {
            close(
                column(&done, &format!("stone.inertia.{s}.f"))[k],
                column(&done, &format!("held.inertia.{s}.f"))[k],
                1e-9,
            );
        }
    }
}

/// A spring between two points of two bodies: the distance of two masses swings about its length.
#[test]
fn two_masses_swing_on_a_spring() {
    let text = "model Dumbbell
import std.multibody
World:world(g = [0, 0, 0]) -> 1[frame]:ground
ground -> Prismatic:left(n = [0.6, 0, 0.8], q0 = 0) -> 1[frame]:a -> Body:one(m = 1, J = diag([1, 1, 1]))
ground -> Prismatic:right(n = [0.6, 0, 0.8], q0 = 1.5) -> 1[frame]:b -> Body:two(m = 3, J = diag([1, 1, 1]))
SpringDamper:spring(k = 12, l0 = 1)
a -> spring.a
b -> spring.b
";
    let done = run(text, &Run { to: 3.0, rtol: 1e-12, every: Some(0.1), ..Run::default() });
    for (k, t) in times(&done).iter().enumerate() {
        close(column(&done, "spring.length")[k], 1.0 + 0.5 * (4.0 * t).cos(), 1e-9);
    }
}

/// Lines between the ends of two arms that are turned: their lengths, and what a force along them asks of the drives.
#[test]
fn lines_push_their_ends_apart() {
    let text = "model Lines
import std.multibody
World:world(g = [0, 0, 0]) -> 1[frame]:ground
ground -> Revolute:j -> FixedTranslation:arm(d = [1, 0, 0]) -> 1[frame]:a
ground -> FixedTranslation:away(d = [3, 0, 0]) -> Revolute:k -> FixedTranslation:crank(d = [0.5, 0, 0]) -> 1[frame]:b
Sf:turn_j(0.7) -> j.axis
Sf:turn_k(-1.1) -> k.axis
%line
a -> line.a
b -> line.b
Se:push(2) -> line.axis
";
    let (n, arm, crank) = ([0.6, 0.8], 1.0, 0.5);
    let run_of = |line: &str| {
        run(&text.replace("%line", line), &Run { to: 3.0, rtol: 1e-12, every: Some(0.1), ..Run::default() })
    };
    let straight = run_of("Line:line");
    let along = run_of("LineAlong:line(n = [0.6, 0.8, 0])");
    for (i, t) in times(&straight).iter().enumerate() {
        let ((sj, cj), (sk, ck)) = ((0.7 * t).sin_cos(), (-1.1 * t).sin_cos());
        // From one end to the other, and the same by the angles.
        let d = [3.0 + crank * ck - arm * cj, crank * sk - arm * sj];
        let by_j = [arm * sj, -arm * cj];
        let by_k = [-crank * sk, crank * ck];
        let length = d[0].hypot(d[1]);
        let e = d.map(|x| x / length);
        let u = [n[0] * cj - n[1] * sj, n[0] * sj + n[1] * cj];
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        // The direction along the arm turns with it.
        let turned = dot([-u[1], u[0]], d);
        for (done, length, by_j, by_k) in
            [(&straight, length, dot(e, by_j), dot(e, by_k)), (&along, dot(u, d), dot(u, by_j) + turned, dot(u, by_k))]
        {
            close(column(done, "line.length")[i], length, 1e-9);
            close(column(done, "line.speed")[i], 0.7 * by_j - 1.1 * by_k, 1e-9);
            close(column(done, "line.force")[i], -2.0, 1e-12);
            close(column(done, "turn_j.e")[i], -2.0 * by_j, 1e-9);
            close(column(done, "turn_k.e")[i], -2.0 * by_k, 1e-9);
        }
    }
}

/// What a matrix transformer says, row by row, with all its strands.
#[test]
fn a_matrix_transformer_hands_on_power() {
    let text = "model Rows
Se[3]:push([1, 2, 3]) -> 1[3]:v -> TF[2, 3]:map([[1, 0, 2], [0, -1, 1]]) -> 1[2]:u
v -> R[3]:friction([1, 2, 3])
u -> R[2]:load([[2, 1], [1, 2]])
output lost = dot(map.in.e, map.in.f) - dot(map.out.e, map.out.f)
output off = map.out[1].f - v[1].f - 2*v.z.f
";
    let done = run(text, &Run { to: 0.1, ..Run::default() });
    close(last(&done, "lost"), 0.0, 1e-14);
    close(last(&done, "off"), 0.0, 1e-14);
    // (diag(1, 2, 3) + MᵀLM) f = e, solved by hand elimination in exact fractions: residuals are zero.
    let m = [[1.0, 0.0, 2.0], [0.0, -1.0, 1.0]];
    let l = [[2.0, 1.0], [1.0, 2.0]];
    let f: Vec<f64> = ["x", "y", "z"].iter().map(|s| last(&done, &format!("v.{s}.f"))).collect();
    let u: Vec<f64> = m.iter().map(|row| row.iter().zip(&f).map(|(a, b)| a * b).sum()).collect();
    let e: Vec<f64> = l.iter().map(|row| row.iter().zip(&u).map(|(a, b)| a * b).sum()).collect();
    for i in 0..3 {
        let back = m[0][i] * e[0] + m[1][i] * e[1];
        close([1.0, 2.0, 3.0][i] * f[i] + back, [1.0, 2.0, 3.0][i], 1e-13);
    }
}

/// A matrix gyrator between two sides: efforts at `out` from flows at `in`.
#[test]
fn a_matrix_gyrator_turns_flows_into_efforts() {
    let text = "model Motor
Sf[2]:turn([1, 2]) -> GY[3, 2]:k([[1, 2], [3, 4], [5, 6]]) -> R[3]:coil([1, 2, 4])
";
    let done = run(text, &Run { to: 0.1, ..Run::default() });
    for (s, e) in [("x", 5.0), ("y", 11.0), ("z", 17.0)] {
        close(last(&done, &format!("coil.{s}.e")), e, 1e-13);
    }
    // e_in = Mᵀ f_out
    close(last(&done, "turn.x.e"), 5.0 + 3.0 * 5.5 + 5.0 * 4.25, 1e-13);
}

/// One axis by the joint's own port: a motor, and a port left open.
#[test]
fn a_joint_is_driven_at_its_axis() {
    let text = "model Driven
import std.multibody
World:world(g = [0, 0, 0]) -> Revolute:j(n = [0, 0, 1]) -> Body:arm(m = 2, J = diag([1, 1, 1.5]), c = [0.5, 0, 0])
Se:motor(3 N.m) -> j.axis
";
    let done = run(text, &Run { to: 2.0, rtol: 1e-12, ..Run::default() });
    close(last(&done, "j.angle"), 0.5 * 3.0 / 2.0 * 4.0, 1e-9);
}

/// A force at the end of an arm and a torque, along the axes of the body or of the world.
#[test]
fn forces_and_torques_from_signals() {
    let text = "model Pushed
import std.multibody
World:world(g = [0, 0, 0]) -> 1[frame]:ground
ground -> Revolute:j(n = [0, 1, 0]) -> 1[frame]:hub -> Body:arm(m = 1, J = diag([1, 1.5, 1]))
Force:push(force = [0, 0, -1])
hub -> FixedTranslation:out(d = [0.5, 0, 0]) -> push.a
Torque:twist(torque = [0, 0.25, 0])
hub -> twist.a
ground -> Revolute:k(q0 = 0.4) -> Prismatic:slide(n = [1, 0, 0]) -> 1[frame]:far -> Body:puck(m = 2, J = diag([1, 1, 1]))
Force:steady(world = 1, force = [0.4*t, 0.3*t, 0])
far -> steady.a
Torque:turn(world = 1, torque = [0, 0, -far.r[1]*0.3*t + far.r[2]*0.4*t])
far -> turn.a
";
    let done = run(text, &Run { to: 2.0, rtol: 1e-12, ..Run::default() });
    close(last(&done, "j.speed"), 0.75 / 1.5 * 2.0, 1e-9);
    // The torque of the force about the ground is taken away: the slide keeps its direction and moves along it.
    close(last(&done, "k.angle"), 0.4, 1e-9);
    close(last(&done, "slide.way"), (0.4 * f64::cos(0.4) + 0.3 * f64::sin(0.4)) / 2.0 * 8.0 / 6.0, 1e-9);
}

/// Each way to move of a body on a bushing has its own frequency; and no energy is lost in large motions.
#[test]
fn a_bushing_has_the_frequencies_of_its_stiffness() {
    let text = "model Mount
import std.multibody
World:world(g = [0, 0, 0]) -> 1[frame]:ground -> Free:air -> 1[frame]:hub -> Body:engine(m = 2, J = diag([0.1, 0.2, 0.3]))
Bushing:rubber(K = diag([200, 800, 1800, 10, 80, 270]), C = diag([2, 2, 2, 0.1, 0.1, 0.1]))
ground -> rubber.a
hub -> rubber.b
";
    let wanted = Linearize { at: Point::Start, ..Linearize::default() };
    let report = model(text).linearize(&wanted).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let swings: Vec<[f64; 2]> = report.poles.iter().copied().filter(|p| p[1] > 1.0).collect();
    assert_eq!(swings.len(), 6);
    for (m, k, c) in [
        (2.0, 200.0, 2.0),
        (2.0, 800.0, 2.0),
        (2.0, 1800.0, 2.0),
        (0.1, 10.0, 0.1),
        (0.2, 80.0, 0.1),
        (0.3, 270.0, 0.1),
    ] {
        let (re, im) = (-c / (2.0 * m), f64::sqrt(k / m - c * c / (4.0 * m * m)));
        let found = swings.iter().any(|p| (p[0] - re).abs() < 1e-9 * im && (p[1] - im).abs() < 1e-9 * im);
        assert!(found, "{re} {im}: {swings:?}");
    }
    let loose = "model Loose
import std.multibody
World:world(g = [0, 0, 0]) -> 1[frame]:ground -> Free:air(x0 = [0.1, 0, 0.2], v0 = [0, 1, 0], w0 = [6, 5, 4]) -> 1[frame]:hub -> Body:engine(m = 2, J = diag([0.1, 0.2, 0.3]))
Bushing:rubber(K = diag([200, 800, 1800, 10, 80, 270]))
ground -> rubber.a
hub -> rubber.b
output E = 0.5*dot(engine.mass.p, engine.mass.f) + 0.5*dot(engine.inertia.p, engine.inertia.f) + 100*rubber.way[1]^2 + 400*rubber.way[2]^2 + 900*rubber.way[3]^2 + 5*rubber.angle[1]^2 + 40*rubber.angle[2]^2 + 135*rubber.angle[3]^2
";
    let done = run(loose, &Run { to: 1.0, rtol: 1e-12, ..Run::default() });
    let energy = column(&done, "E");
    energy.iter().for_each(|e| close(*e, energy[0], 1e-8));
    assert!(column(&done, "rubber.angle[1]").iter().any(|a| a.abs() > 0.3));
}

/// A body that slides over the ground on its lowest point comes to rest after v^2/(2 mu g), on a spring of the ground.
#[test]
fn a_point_slides_on_a_plane() {
    let text = "model Slide
import std.multibody
World:world -> Prismatic:x(n = [1, 0, 0], v0 = 2) -> Prismatic:z(q0 = -1.962e-4, fixed = 1) -> 1[frame]:hub -> Body:b(m = 2, J = diag([1, 1, 1]))
PointContact:foot(k = 1e5, c = 200, mu = 0.3, v_0 = 0.01 mm/s)
hub -> foot.a
";
    let done = run(text, &Run { to: 1.0, rtol: 1e-10, every: Some(0.01), ..Run::default() });
    close(last(&done, "x.way"), 4.0 / (2.0 * 0.3 * 9.81), 1e-6);
    close(last(&done, "foot.depth"), 2.0 * 9.81 / 1e5, 1e-12);
    let flight = text.replace("q0 = -1.962e-4", "q0 = 0.1");
    let done = run(&flight, &Run { to: 1.0, rtol: 1e-10, every: Some(0.01), ..Run::default() });
    let t = 0.1;
    close(column(&done, "z.way")[10], 0.1 - 4.905 * t * t, 1e-9);
    assert!(column(&done, "foot.load").iter().all(|load| *load >= 0.0));
}

/// What a sensor tells of a point that goes round.
#[test]
fn a_sensor_tells_motion_in_the_axes_of_the_world() {
    let text = "model Round
import std.multibody
World:world(g = [0, 0, 0]) -> Revolute:j(n = [0, 0, 1], w0 = 2) -> 1[frame]:hub -> Body:b(m = 1, J = diag([1, 1, 1]))
FrameSensor:sense
hub -> FixedTranslation:arm(d = [0.5, 0, 0]) -> FixedRotation:nod(n = [0, 1, 0], angle = 0.2) -> FixedRotation:lean(n = [1, 0, 0], angle = -0.3) -> sense.a
";
    let done = run(text, &Run { to: 0.7, rtol: 1e-12, ..Run::default() });
    let (sin, cos) = 1.4f64.sin_cos();
    for (name, value) in [
        ("r[1]", 0.5 * cos),
        ("r[2]", 0.5 * sin),
        ("v[1]", -sin),
        ("v[2]", cos),
        ("acceleration[1]", -2.0 * cos),
        ("acceleration[2]", -2.0 * sin),
        ("acceleration[3]", 0.0),
        ("w[1]", -2.0 * f64::sin(0.2)),
        ("w[2]", -2.0 * f64::cos(0.2) * f64::sin(0.3)),
        ("w[3]", 2.0 * f64::cos(0.2) * f64::cos(0.3)),
        ("yaw", 1.4),
        ("pitch", 0.2),
        ("roll", -0.3),
    ] {
        close(last(&done, &format!("sense.{name}")), value, 1e-9);
    }
}

/// A disc that leans rolls on a circle: Euler's equation about the direction of rolling.
#[test]
fn a_disc_rolls_on_a_circle() {
    let (lean, around, radius, m) = (0.3f64, 1.5, 0.4, 2.0);
    let (a, c) = (m * radius * radius / 4.0, m * radius * radius / 2.0);
    let (sin, cos) = lean.sin_cos();
    let spin = (a * around * around * sin * cos - m * 9.81 * radius * sin) / (around * cos * (c + m * radius * radius));
    let text = format!(
        "model Coin
import std.multibody
World:world -> RollingDisc:disc(radius = {radius}, lean0 = {lean}, yaw_speed = {around}, spin_speed = {spin} - {around}*sin({lean}))
disc -> Body:coin(m = {m}, J = diag([{a}, {c}, {a}]))
output place = coin.a.r
"
    );
    assert_eq!(states(&text).len(), 3 + 5);
    let done = run(&text, &Run { to: 6.0, rtol: 1e-12, every: Some(0.1), ..Run::default() });
    for (k, t) in times(&done).iter().enumerate() {
        let path = radius * spin / around;
        close(column(&done, "place[1]")[k], path * (around * t).sin(), 1e-8);
        close(column(&done, "place[2]")[k], path * (1.0 - (around * t).cos()), 1e-8);
        close(column(&done, "place[3]")[k], radius * cos, 1e-9);
    }
}

/// A disc on a table that turns about a slanted axis: by its own coordinates and as a body that touches the table.
#[test]
fn a_disc_rolls_alike_by_its_coordinates_and_by_its_contact() {
    let text = "model Discs
import std.multibody
World:world -> Revolute:table(n = [0.6, 0, 0.8]) -> 1[frame]:ground
Sf:turned(0.4) -> table.axis
ground -> RollingDisc:disc(radius = 0.4, lean0 = 0.3, yaw_speed = 1.5, spin_speed = 6) -> Body:one(m = 2, J = diag([0.08, 0.16, 0.08]))
ground -> Prismatic:x(n = [1, 0, 0]) -> Prismatic:y(n = [0, 1, 0]) -> Prismatic:z(q0 = 0.4*cos(0.3)) -> Revolute:yaw(w0 = 1.5) -> Revolute:lean(n = [1, 0, 0], q0 = 0.3, fixed = 1) -> Revolute:spin(n = [0, 1, 0], w0 = 6) -> 1[frame]:rim
rim -> Body:two(m = 2, J = diag([0.08, 0.16, 0.08]))
RollingContact:contact(radius = 0.4)
ground -> contact.a
rim -> contact.b
prefer yaw.rate.f, lean.rate.f, spin.rate.f
output one = one.a.r
output two = two.a.r
output low = contact.place[3]
";
    let done = run(text, &Run { to: 2.0, rtol: 1e-11, every: Some(0.1), ..Run::default() });
    for k in 0..times(&done).len() {
        for i in 1..4 {
            close(column(&done, &format!("one[{i}]"))[k], column(&done, &format!("two[{i}]"))[k], 1e-9);
        }
        close(column(&done, "low")[k], 0.0, 1e-12);
    }
}

/// A cart on one wheel: a constant torque at the axle, turned by a constant rate.
#[test]
fn a_wheel_rolls_where_it_is_steered() {
    let text = "model Cart
import std.multibody
World:world -> RollingWheel:wheel(radius = 0.3, speed0 = 2) -> Body:cart(m = 3, J = diag([1, 1, 0.2]))
Se:motor(2) -> 1:rotor -> wheel.axle
rotor -> I:rotor_inertia(0.03)
Sf:turn(0.5) -> wheel.steer
output place = cart.a.r
";
    let done = run(text, &Run { to: 4.0, rtol: 1e-12, ..Run::default() });
    let (rate, u, w, t) = (2.0 / (0.03 + 3.0 * 0.09) * 0.3, 0.6, 0.5, 4.0f64);
    let (sin, cos) = (w * t).sin_cos();
    close(last(&done, "wheel.speed"), (u + rate * t) / 0.3, 1e-9);
    close(last(&done, "place[1]"), (u + rate * t) * sin / w + rate * (cos - 1.0) / (w * w), 1e-8);
    close(last(&done, "place[2]"), u / w - (u + rate * t) * cos / w + rate * sin / (w * w), 1e-8);
}

/// Seen from the turning earth the plane of a pendulum goes round: small swings on an ellipse in the axes of the world.
#[test]
fn a_pendulum_shows_that_the_earth_turns() {
    let (turn, swing, l) = (0.2, 1e-4, 9.81);
    let text = format!(
        "model Foucault
import std.multibody
World:world -> Revolute:earth -> Revolute:east(n = [0, 1, 0], q0 = {swing}/{l}) -> Revolute:north(n = [1, 0, 0]) -> FixedTranslation:wire(d = [0, 0, -{l}]) -> Body:bob(m = 5, J = 1e-6*identity(3))
Sf:day({turn}) -> earth.axis
output place = bob.a.r
"
    );
    let done = run(&text, &Run { to: 20.0, rtol: 1e-12, every: Some(0.5), ..Run::default() });
    for (k, t) in times(&done).iter().enumerate() {
        // sqrt(g/l) is 1/s.
        close(column(&done, "place[1]")[k], -swing * t.cos(), 1e-6 * swing);
        close(column(&done, "place[2]")[k], -swing * turn * t.sin(), 1e-6 * swing);
    }
}

/// Gear and rack of `std.mechanical` stand at the axes of joints.
#[test]
fn gears_and_racks_join_axes() {
    let text = "model Axes
import std.multibody
import std.mechanical
World:world(g = [0, 0, 0]) -> 1[frame]:ground
ground -> Revolute:pinion -> Body:shaft(m = 1, J = diag([1, 1, 0.5]))
ground -> Revolute:wheel -> Body:disc(m = 1, J = diag([1, 1, 4]))
ground -> Prismatic:slide(n = [1, 0, 0]) -> Body:bar(m = 3, J = diag([1, 1, 1]))
1:fast -> pinion.axis
fast -> Gear:gear(ratio = -4) -> wheel.axis
fast -> Rack:rack(r = 0.2) -> slide.axis
Se:motor(1.74) -> fast
";
    assert_eq!(states(text).iter().filter(|name| name.ends_with(".f")).count(), 1);
    let done = run(text, &Run { to: 2.0, rtol: 1e-12, ..Run::default() });
    let speed = 1.74 / (0.5 + 4.0 / 16.0 + 3.0 * 0.04) * 2.0;
    close(last(&done, "pinion.speed"), speed, 1e-9);
    close(last(&done, "wheel.speed"), -speed / 4.0, 1e-9);
    close(last(&done, "slide.speed"), 0.2 * speed, 1e-9);
}

/// Wheels that turn in a carrier: by Willis the sun turns 1 + z_ring/z_sun times as fast as the carrier, the planets backward.
#[test]
fn an_epicyclic_gear_turns_as_willis_says() {
    let text = "model Epicyclic
import std.multibody
import std.mechanical
World:world(g = [0, 0, 0]) -> Revolute:carrier -> 1[frame]:arms -> Body:cage(m = 1, J = diag([1, 1, 0.3]))
arms -> Revolute:sun -> Body:sun_wheel(m = 1, J = diag([1, 1, 0.1]))
arms -> FixedTranslation:out(d = [0.2, 0, 0]) -> Revolute:planet -> Body:planet_wheel(m = 0.5, J = diag([1, 1, 0.02]))
1:carrier_rate -> carrier.axis
1:sun_rate -> sun.axis
1:planet_rate -> planet.axis
sun_rate -> Gear:outer(ratio = -18/30) -> planet_rate
planet_rate -> Gear:ring(ratio = -66/18) -> carrier_rate
Se:motor(2) -> carrier_rate
";
    assert_eq!(states(text).iter().filter(|name| name.ends_with(".f")).count(), 1);
    let done = run(text, &Run { to: 2.0, rtol: 1e-12, step: Some(0.01), ..Run::default() });
    let (sun, planet) = (1.0 + 66.0 / 30.0, 1.0 - 66.0 / 18.0);
    let speed = 2.0 / (0.3 + 0.5 * 0.04 + 0.1 * sun * sun + 0.02 * planet * planet) * 2.0;
    close(last(&done, "carrier.speed"), speed, 1e-9);
    close(last(&done, "sun.speed") + speed, sun * speed, 1e-9);
    close(last(&done, "planet.speed") + speed, planet * speed, 1e-9);
}

/// Of two cardan joints whose yokes stand alike the second takes away what the first does: the outer shafts turn as one.
#[test]
fn two_universal_joints_turn_evenly() {
    let text = "model Shafts
import std.multibody
param bend = 0.5235987755982988
World:world(g = [0, 0, 0]) -> 1[frame]:ground
ground -> Revolute:input(n = [1, 0, 0], w0 = 2, fixed = 1) -> 1[frame]:yoke -> Body:first(m = 1, J = diag([0.1, 1, 1]))
yoke -> Universal:cross1(n1 = [0, 1, 0], n2 = [0, 0, 1], q2 = bend) -> 1[frame]:middle
middle -> Body:second(m = 1, J = diag([0.2, 1, 1]))
ground -> FixedRotation:lean(n = [0, 0, 1], angle = bend) -> Revolute:bearing(n = [1, 0, 0]) -> held.b
CutOrientation:held
middle -> held.a
middle -> Universal:cross2(n1 = [0, 0, 1], n2 = [0, 1, 0], q1 = -bend) -> 1[frame]:shaft
shaft -> Body:third(m = 1, J = diag([0.3, 1, 1]))
ground -> Revolute:output(n = [1, 0, 0]) -> last.b
CutOrientation:last
shaft -> last.a
";
    let done = run(text, &Run { to: 5.0, rtol: 1e-11, every: Some(0.05), ..Run::default() });
    let (input, middle) = (column(&done, "input.speed"), column(&done, "bearing.speed"));
    assert!(input.iter().zip(middle).any(|(i, m)| (i / m - 1.0).abs() > 0.1));
    for of in ["speed", "angle"] {
        let [input, output] = ["input", "output"].map(|shaft| column(&done, &format!("{shaft}.{of}")));
        input.iter().zip(output).for_each(|(i, o)| close(*o, *i, 1e-9));
    }
}

/// A vector that an instance tells goes into another one, wherever both stand; entries may be read before it is given.
#[test]
fn vectors_go_from_instance_to_instance() {
    let text = "model Hand
component Taker(in n[3], m[3]) {
    let w = u[2]
    let u = n + m
    output sum = w + dot(n, m)
}
component Giver(in x; out n = [x, 2*x, 3*x]) {
    let y = x
}
Taker:to(n = from.n, m = 2*from.n)
Giver:from(x = 1 + t)
Se:push(1) -> I:mass(1)
";
    let done = run(text, &Run { to: 1.0, ..Run::default() });
    close(last(&done, "to.sum"), 3.0 * 4.0 + 2.0 * 56.0, 1e-12);
}

/// What is given to a part may read where the part is: its frames do not depend on it.
#[test]
fn a_part_may_read_its_own_frame() {
    let text = "model Own
import std.multibody
component Arm(in point[3]; in base : frame; out hub : frame) {
    let M = diag([1, 2, 1])
    base -> FixedTranslation:out(d = M*point) -> hub
}
component Corner(in height = 0; in body : frame) {
    Arm:arm(point = [0.3, 1, 0.5])
    body -> arm.base
    arm.hub -> Body:mass(m = 1 + height, J = diag([1, 1, 1]))
}
World:world -> 1[frame]:ground
Corner:corner(height = corner.arm.hub.r[1] + 10*corner.arm.hub.r[2] + 100*corner.arm.hub.r[3])
ground -> corner.body
output h = corner.height
";
    close(last(&run(text, &Run { to: 0.1, ..Run::default() }), "h"), 0.3 + 20.0 + 50.0, 1e-12);
}

/// Bodies in a row by `for`, with junctions of frames that have indices, move as the same ones written one by one.
#[test]
fn rows_of_bodies_are_repeated() {
    let head = "model Row\nimport std.multibody\nparam n = 4\nWorld:ground\n";
    let repeated = "for i in 1..n {
Revolute:hinge[i](n = if mod(i, 2) == 1 then [0, 1, 0] else [1, 0, 0], q0 = 0.3, w0 = 0.1*i, fixed = 1)
hinge[i] -> 1[frame]:link[i] -> Body:bob[i](m = 1, J = diag([0.02, 0.03, 0.01]), c = [0, 0, -0.25])
if i == 1 { ground -> hinge[i] } else { link[i - 1] -> FixedTranslation:rod[i](d = [0, 0, -0.5]) -> hinge[i] }
}
output tip = link[n].r[3] : m\n";
    let single = |i: usize| {
        let axis = if i % 2 == 1 { "[0, 1, 0]" } else { "[1, 0, 0]" };
        let before = match i {
            1 => "ground -> hinge1".to_string(),
            _ => format!("link{} -> FixedTranslation:rod{i}(d = [0, 0, -0.5]) -> hinge{i}", i - 1),
        };
        format!(
            "Revolute:hinge{i}(n = {axis}, q0 = 0.3, w0 = 0.1*{i}, fixed = 1)
hinge{i} -> 1[frame]:link{i} -> Body:bob{i}(m = 1, J = diag([0.02, 0.03, 0.01]), c = [0, 0, -0.25])\n{before}\n"
        )
    };
    let written: String = (1..=4).map(single).collect();
    let written = format!("{head}{written}output tip = link4.r[3] : m\n");
    let repeated = format!("{head}{repeated}");
    let how = Run { to: 2.0, rtol: 1e-9, ..Run::default() };
    let (row, single) = (run(&repeated, &how), run(&written, &how));
    assert_eq!(states(&repeated).len(), 8);
    close(last(&row, "tip"), last(&single, "tip"), 1e-12);
    close(last(&row, "link[4].w.y.f"), last(&single, "link4.w.y.f"), 1e-11);
    let energy = row.report.audit.energy.expect("it is balanced").value;
    assert!(energy < 1e-8, "{energy:e}");
}

/// Of an axis and a normal the direction counts.
#[test]
fn axes_of_any_length_are_the_same() {
    let text = |s: f64| {
        format!(
            "model Long\nimport std.multibody\nimport std.planar\n\
             World:world -> 1[frame]:ground\n\
             ground -> Prismatic:slide(n = [{x:?}, 0, {z:?}], q0 = 0.3) -> 1[frame]:body -> Body:b(m = 2, J = diag([1, 1, 1]))\n\
             1:way -> slide.axis\nway -> C:spring(k = 100)\n\
             LineAlong:line(n = [0, 0, {s:?}])\nground -> line.a\nbody -> line.b\n1:stretch -> line.axis\nstretch -> C:soft(k = 20)\n\
             body -> PointContact:foot(n = [0, 0, {s:?}], k = 1e3, c = 10, mu = 0.2)\n\
             PlanarWorld:flat -> PlanarPrismatic:rail(n = [0, {s:?}]) -> PlanarBody:puck(m = 1, J = 1)\n\
             1:rate -> rail.axis\nrate -> C:coil(k = 50)\n",
            x = 0.6 * s,
            z = 0.8 * s
        )
    };
    let names = ["slide.q", "line.length", "foot.load", "rail.q"];
    let [one, long] = [1.0, 2.5].map(|s| run(&text(s), &Run { to: 0.4, rtol: 1e-9, ..Run::default() }));
    names.iter().for_each(|name| close(last(&long, name), last(&one, name), 1e-7));
    assert!(last(&one, "rail.q") < -0.1 && last(&one, "slide.q") < 0.25);
}

/// Cut joints too, whether their axes are shorter or longer than 1: a body that turns, slides or swings on two of the same.
#[test]
fn axes_of_cut_joints_of_any_length_are_the_same() {
    for cut in ["CutRevolute", "CutPrismatic", "CutInline", "CutInplane"] {
        let text = |s: f64| {
            format!(
                "model Cut\nimport std.multibody\nWorld:world -> 1[frame]:ground\n\
                 ground -> Free:loose(w0 = [0.4, 0, 0], v0 = [0.3, 0, 0]) -> 1[frame]:body -> Body:b(m = 2, J = diag([1, 2, 3]))\n\
                 {cut}:cut(n = [{s:?}, 0, 0])\nground -> cut.a\nbody -> cut.b\n"
            )
        };
        let ends = [1.0, 0.5, 2.5].map(|s| {
            let done = run(&text(s), &Run { to: 0.5, rtol: 1e-10, ..Run::default() });
            ["loose.x.q", "loose.z.q", "b.inertia.x.f"].map(|name| last(&done, name))
        });
        ends.iter().for_each(|end| end.iter().zip(ends[0]).for_each(|(found, wanted)| close(*found, wanted, 1e-8)));
    }
}

/// A conical pendulum turns at `sqrt(g/(l cos(angle)))`, and one that is let go from the side falls at g.
#[test]
fn point_masses_are_pendulums_of_textbooks() {
    let cone = |w: f64| {
        format!(
            "model Cone\nimport std.multibody\nWorld:world -> Revolute:swivel(w0 = {w}) -> Revolute:pin(n = [0, 1, 0], q0 = -0.6 rad)\n\
             pin -> PointMass:bob(m = 2 kg, c = [0, 0, -0.5])\n"
        )
    };
    let steady = f64::sqrt(9.81 / (0.5 * f64::cos(0.6)));
    let done = run(&cone(steady), &Run { to: 1.0, rtol: 1e-10, ..Run::default() });
    close(last(&done, "pin.q"), -0.6, 1e-8);
    close(last(&done, "swivel.q"), steady, 1e-8);
    let side = "model Side\nimport std.multibody\nWorld:world -> Revolute:pin(n = [0, 1, 0]) -> FixedTranslation:arm(d = [0.4, 0, 0]) -> PointMass:bob(m = 3 kg)\n";
    let done = run(side, &Run { to: 1e-6, ..Run::default() });
    close(last(&done, "pin.speed") * 0.4 / 1e-6, 9.81, 1e-6);
}

/// A pendulum whose pivot is shaken, and one on a turntable, by signals and by joints that sources drive.
#[test]
fn what_a_signal_moves_has_its_velocity() {
    let end = |pivot: &str| {
        let text = format!(
            "model Led\nimport std.multibody\nWorld:world -> {pivot} -> Revolute:pin(n = [0, 1, 0], q0 = 0.2 rad) -> 1[frame]:arm\n\
             arm -> Body:bob(m = 2 kg, J = diag([0.1, 0.1, 0.01]), c = [0, 0, -1])\narm -> FrameSensor:s\n"
        );
        let driven = [
            "1:way -> slide.axis\nSf:shake(0.3*cos(3*t)) -> way\n",
            "1:way -> turn.axis\nSf:turn_it(1 + 0.5*cos(t)) -> way\n",
        ];
        let more = if pivot.contains("slide") {
            driven[0]
        } else if pivot.contains("turn(") {
            driven[1]
        } else {
            ""
        };
        let done = run(&format!("{text}{more}"), &Run { to: 2.0, rtol: 1e-10, ..Run::default() });
        ["pin.q", "pin.speed", "s.r[1]", "s.v[1]", "s.v[2]"].map(|name| last(&done, name))
    };
    for (led, joint) in [
        ("DrivenTranslation:led(d = [0.1*sin(3*t), 0, 0])", "Prismatic:slide(n = [1, 0, 0])"),
        ("DrivenRotation:led(angle = t + 0.5*sin(t))", "Revolute:turn()"),
    ] {
        for (found, expected) in end(led).into_iter().zip(end(joint)) {
            close(found, expected, 1e-7);
        }
    }
}
