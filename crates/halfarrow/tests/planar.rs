//! `std.planar` against the frames of space and against closed forms.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow::{Model, Record, Run};

/// The values of variables over a run of a model, whose text begins after its first line, every tenth of its time.
fn over(to: f64, text: &str, names: &[&str]) -> Vec<Vec<f64>> {
    let text = format!("model Machine\n{text}");
    let model = Model::from_text("machine.bond", &text, &[]).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)));
    let record = Record::Names(names.iter().map(|n| (*n).to_string()).collect());
    let run = Run { to, rtol: 1e-12, every: Some(to / 10.0), record, ..Run::default() };
    let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)));
    done.trace.columns.iter().map(|c| c.values.clone()).collect()
}

#[track_caller]
fn close(found: f64, expected: f64, off: f64) {
    assert!((found - expected).abs() <= off, "{found} instead of {expected}: off by {:.1e}", (found - expected).abs());
}

#[track_caller]
fn alike(plane: &[Vec<f64>], space: &[Vec<f64>], off: f64) {
    for (p, s) in plane.iter().zip(space) {
        assert_eq!(p.len(), s.len());
        p.iter().zip(s).for_each(|(p, s)| close(*p, *s, off));
    }
}

#[test]
fn a_double_pendulum_is_that_of_space() {
    let plane = "import std.planar
PlanarWorld:world -> PlanarRevolute:one(q0 = 0.7) -> 1[plane]:h1 -> PlanarBody:b1(m = 1.2, J = 0.02, c = [0.3, 0.02])
h1 -> PlanarTranslation:rod(d = [0.6, 0.05]) -> PlanarRevolute:two(q0 = 1.3, w0 = 1) -> PlanarBody:b2(m = 0.8, J = 0.03, c = [0.5, 0])
";
    let space = "import std.multibody
World:world(g = [0, -9.81, 0]) -> Revolute:one(q0 = 0.7) -> 1[frame]:h1 -> Body:b1(m = 1.2, J = diag([1, 1, 0.02]), c = [0.3, 0.02, 0])
h1 -> FixedTranslation:rod(d = [0.6, 0.05, 0]) -> Revolute:two(q0 = 1.3, w0 = 1) -> Body:b2(m = 0.8, J = diag([1, 1, 0.03]), c = [0.5, 0, 0])
";
    let names = ["one.angle", "two.angle", "one.speed", "two.speed"];
    alike(&over(3.0, plane, &names), &over(3.0, space, &names), 1e-9);
}

#[test]
fn a_four_bar_is_that_of_space() {
    let plane = "import std.planar
PlanarWorld:world -> 1[plane]:ground -> PlanarRevolute:a1(q0 = 0.3, w0 = 25, fixed = 1) -> 1[plane]:crank
crank -> PlanarTranslation:c1(d = [0.2, 0]) -> PlanarRevolute:a2 -> 1[plane]:coupler
crank -> PlanarBody:crank_body(m = 1, J = 0.01, c = [0.1, 0])
coupler -> PlanarBody:coupler_body(m = 1, J = 0.03, c = [0.25, 0])
coupler -> PlanarTranslation:c2(d = [0.5, 0])
ground -> PlanarTranslation:g(d = [0.5, 0]) -> PlanarRevolute:a3(q0 = 1.2) -> 1[plane]:rocker
rocker -> PlanarBody:rocker_body(m = 1, J = 0.02, c = [0.2, 0])
rocker -> PlanarTranslation:c3(d = [0.4, 0])
PlanarCutRevolute:close
c2 -> close.a
c3 -> close.b
";
    let space = "import std.multibody
World:world(g = [0, -9.81, 0]) -> 1[frame]:ground -> Revolute:a1(q0 = 0.3, w0 = 25, fixed = 1) -> 1[frame]:crank
crank -> FixedTranslation:c1(d = [0.2, 0, 0]) -> Revolute:a2 -> 1[frame]:coupler
crank -> Body:crank_body(m = 1, J = diag([1, 1, 0.01]), c = [0.1, 0, 0])
coupler -> Body:coupler_body(m = 1, J = diag([1, 1, 0.03]), c = [0.25, 0, 0])
coupler -> FixedTranslation:c2(d = [0.5, 0, 0])
ground -> FixedTranslation:g(d = [0.5, 0, 0]) -> Revolute:a3(q0 = 1.2) -> 1[frame]:rocker
rocker -> Body:rocker_body(m = 1, J = diag([1, 1, 0.02]), c = [0.2, 0, 0])
rocker -> FixedTranslation:c3(d = [0.4, 0, 0])
CutRevolute:close
c2 -> close.a
c3 -> close.b
";
    let names = ["a1.angle", "a2.angle", "a3.angle"];
    let turned = over(1.0, plane, &names);
    assert!(turned[0][10] > 12.0);
    alike(&turned, &over(1.0, space, &names), 1e-9);
}

/// A mass that slides both ways at the end of a rod is a pendulum.
#[test]
fn a_rod_holds_a_mass_as_a_hinge_does() {
    let text = "import std.planar
PlanarWorld:world -> 1[plane]:ground -> PlanarPrismatic:x(q0 = 0.6) -> PlanarPrismatic:y(n = [0, 1], q0 = -0.8, fixed = 1) -> 1[plane]:hub
hub -> PlanarBody:bob(m = 2, J = 1)
PlanarRod:rod(l = 1)
ground -> rod.a
hub -> rod.b
ground -> PlanarRevolute:hinge(q0 = atan2(-0.8, 0.6), fixed = 1) -> PlanarTranslation:arm(d = [1, 0]) -> PlanarBody:point(m = 2, J = 1e-12)
output off_x = x.way/(1 m) - cos(hinge.angle)
output off_y = y.way/(1 m) - sin(hinge.angle)
";
    for column in over(2.0, text, &["off_x", "off_y"]) {
        column.iter().for_each(|off| close(*off, 0.0, 1e-9));
    }
}

/// Two masses on a spring, and a body that a force along its own axes pushes in a circle.
#[test]
fn springs_and_forces() {
    let text = "import std.planar
PlanarWorld:world(g = [0, 0]) -> 1[plane]:ground
ground -> PlanarPrismatic:left(n = [0.6, 0.8]) -> 1[plane]:a -> PlanarBody:one(m = 1, J = 1)
ground -> PlanarPrismatic:right(n = [0.6, 0.8], q0 = 1.5) -> 1[plane]:b -> PlanarBody:two(m = 3, J = 1)
PlanarSpringDamper:spring(k = 12, l0 = 1)
a -> spring.a
b -> spring.b
PlanarForce:push(force = [0, 2], torque = 3)
ground -> PlanarRevolute:j -> 1[plane]:arm -> PlanarBody:wheel(m = 1, J = 2)
arm -> PlanarTranslation:out(d = [0.5, 0]) -> push.a
PlanarForce:steady(world = 1, force = [0, 4])
ground -> PlanarPrismatic:lift(n = [0, 1]) -> 1[plane]:c -> PlanarBody:load(m = 2, J = 1)
c -> steady.a
";
    let found = over(2.0, text, &["spring.length", "j.speed", "lift.way"]);
    let [spring, wheel, load] = found.as_slice() else { panic!() };
    for (k, ((length, speed), way)) in spring.iter().zip(wheel).zip(load).enumerate() {
        let t = 0.2 * k as f64;
        close(*length, 1.0 + 0.5 * (4.0 * t).cos(), 1e-9);
        close(*speed, (0.5 * 2.0 + 3.0) / 2.0 * t, 1e-9);
        close(*way, t * t, 1e-9);
    }
}
