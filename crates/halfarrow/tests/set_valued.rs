//! Set-valued laws against closed forms.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::f64::consts::PI;

use halfarrow::{FixedMethod, Form, Method, Model, Record, Run, Simulated};

fn model(text: &str) -> Model {
    let model = Model::from_text("machine.bond", &format!("model Machine\n{text}"), &[]);
    model.unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn run(text: &str, run: &Run) -> Simulated {
    model(text).simulate(run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn to(end: f64, names: &[&str]) -> Run {
    Run { to: end, rtol: 1e-11, record: names_of(names), ..Run::default() }
}

fn names_of(names: &[&str]) -> Record {
    Record::Names(names.iter().map(|n| (*n).to_string()).collect())
}

fn last(result: &Simulated) -> Vec<f64> {
    result.trace.columns.iter().map(|c| *c.values.last().expect("a value")).collect()
}

#[track_caller]
fn close(found: f64, expected: f64, part: f64) {
    let off = (found - expected).abs() / expected.abs();
    assert!(off <= part, "{found} instead of {expected}: off by {off:.1e}");
}

/// A coil behind a diode: the current is that of the switched-on circuit until it would turn round.
#[test]
fn rectifier_with_a_coil() {
    let text = "Se:src(10*sin(300*t)) -> 1:loop
loop -> R:d(0 <= f, 0 <= -e)
loop -> I:coil(0.1)
loop -> R:load(20)
";
    let (w, l, r): (f64, f64, f64) = (300.0, 0.1, 20.0);
    let (z, phase) = ((r * r + w * w * l * l).sqrt(), (w * l / r).atan());
    let current = |t: f64| 10.0 / z * ((w * t - phase).sin() + phase.sin() * (-r / l * t).exp());
    // Where it ends, between half a period and a whole one.
    let (mut low, mut high) = (PI / w, 2.0 * PI / w);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if current(middle) > 0.0 { low = middle } else { high = middle }
    }
    let result = run(text, &Run { every: None, ..to(0.02, &["coil.f", "d.e"]) });
    let (times, columns) = (&result.trace.times, &result.trace.columns);
    let mut ends = f64::NAN;
    for (k, &t) in times.iter().enumerate() {
        let i = columns[0].values[k];
        if t <= low {
            assert!((i - current(t)).abs() < 1e-10, "at {t}: {i}, not {}", current(t));
        } else {
            ends = if ends.is_nan() { times[k - 1] } else { ends };
            assert!(i.abs() < 1e-12 && columns[1].values[k] <= 1e-9, "at {t}: {i}");
        }
    }
    assert!((ends - low).abs() < 1e-10 * 0.02, "{ends} for {low}");
}

/// Diodes with an exponential law come to the same as ideal ones when their thermal voltage goes to zero.
#[test]
fn ideal_and_exponential_bridges_come_together() {
    let bridge = |diode: &str| {
        let mut text = String::from("import std.electrical\nSe:gnd(0) -> 0:n\n0:a\n0:b\n0:p\n1:source\n");
        text += "Se:src(10*sin(300*t)) -> source\nb -> source -> a\nsource -> R:rs(1)\n";
        for (k, ends) in [("a", "p"), ("b", "p"), ("n", "a"), ("n", "b")].iter().enumerate() {
            text += &format!("{} -> {diode}:d{k} -> {}\n", ends.0, ends.1);
        }
        // A leakage keeps the exponential one from floating.
        text + "p -> 1:out -> n\nout -> 0:load\nload -> R:rl(50)\nload -> C:cap(1e-3)\na -> R:leak(1e7)\n"
    };
    let at_end = |text: &str| last(&run(text, &to(0.05, &["cap.e"])))[0];
    let ideal = at_end(&bridge("IdealDiode"));
    let off = |v_t: f64| {
        // The thermal voltage times the logarithm of the current over the saturation current stays small.
        let text = (0..4)
            .fold(bridge("Diode"), |t, k| t.replace(&format!(":d{k} "), &format!(":d{k}(v_t = {v_t}, i_s = 1e-9) ")));
        (at_end(&text) - ideal).abs()
    };
    let (coarse, fine) = (off(2e-3), off(1e-3));
    assert!(coarse < 0.1 && fine < 0.55 * coarse && fine > 0.45 * coarse, "{coarse} {fine}");
}

/// Three phases, six diodes, a resistance: the greatest voltage between two phases, at any time.
#[test]
fn three_phases() {
    let mut text = String::from("Se:ground(0) -> 0:star\n0:p\n0:n\n");
    for k in 0..3 {
        text += &format!("star -> 1:phase{k} -> 0:line{k}\nSe:u{k}(100*sin(300*t - {k}*2*pi/3)) -> phase{k}\n");
        text += &format!("line{k} -> 1:up{k} -> p\nup{k} -> R:du{k}(0 <= f, 0 <= -e)\n");
        text += &format!("n -> 1:down{k} -> line{k}\ndown{k} -> R:dd{k}(0 <= f, 0 <= -e)\n");
    }
    text += "p -> 1:out -> n\nout -> R:load(10)\n";
    let result = run(&text, &Run { every: Some(1e-4), ..to(0.0213, &["load.e"]) });
    for (&t, &found) in result.trace.times.iter().zip(&result.trace.columns[0].values) {
        let phase = |k: f64| 100.0 * (300.0 * t - k * 2.0 * PI / 3.0).sin();
        let all = [phase(0.0), phase(1.0), phase(2.0)];
        let spread = all.iter().fold(f64::MIN, |m, v| m.max(*v)) - all.iter().fold(f64::MAX, |m, v| m.min(*v));
        assert!((found - spread).abs() < 1e-9, "at {t}: {found}, not {spread}");
    }
}

/// A buck converter at 100 kHz: in continuous conduction the output is the duty times the input, and with a small load it is
/// that of the averaged model of discontinuous conduction.
#[test]
fn buck_converter() {
    let text = |r: f64| {
        format!(
            "Se:src(24) -> 1:in -> 0:sw\nin -> Sw:s(on = mod(t, 1e-5) < 0.4e-5)\nsw -> 1:free\nfree -> R:d(0 <= -f, 0 <= e)\n\
             sw -> 1:coil -> 0:out\ncoil -> I:l(1e-4)\nout -> C:c(1e-5)\nout -> R:load({r})\n"
        )
    };
    let mean = |r: f64| {
        let result = run(&text(r), &Run { rtol: 1e-9, every: Some(1e-8), ..to(1.2e-2 + 1e-5, &["c.e"]) });
        let values = &result.trace.columns[0].values;
        values[values.len() - 1000..].iter().sum::<f64>() / 1000.0
    };
    close(mean(2.0), 0.4 * 24.0, 1e-4);
    let (r, d): (f64, f64) = (200.0, 0.4);
    let k = 2.0 * 1e-4 / (r * 1e-5);
    close(mean(r), 24.0 * 2.0 / (1.0 + (1.0 + 4.0 * k / (d * d)).sqrt()), 2e-3);
}

/// A block on a belt: it sticks until the spring breaks it loose, and slides through somewhat more than half a period.
#[test]
fn stick_slip() {
    let text = "Sf:belt(0.1) -> 0:contact
contact -> 1:rub -> R:pad(friction = 1, stiction = 1.5)
contact -> 1:block
block -> I:mass(1)
block -> C:spring(k = 10)
discrete n = 0, t1 = 0, t2 = 0
when spring.e > 1.5 - 1e-9 { n = n + 1; t1 = if n == 3 then t else t1; t2 = if n == 4 then t else t2 }
";
    let (w, over): (f64, f64) = (10f64.sqrt(), 0.5 / 10.0);
    let speed = 0.1;
    let period = 2.0 * over / speed + (PI + 2.0 * (speed / (w * over)).atan()) / w;
    let ends = last(&run(text, &to(12.0, &["t1", "t2", "spring.q"])));
    assert!((ends[1] - ends[0] - period).abs() < 1e-7, "{} for {period}", ends[1] - ends[0]);
    let result = run(text, &to(12.0, &["spring.q"]));
    let least = result.trace.columns[0].values[result.trace.times.iter().position(|t| *t > 3.0).unwrap()..]
        .iter()
        .fold(f64::MAX, |m, v| m.min(*v));
    let amplitude = (over * over + speed * speed / 10.0).sqrt();
    close(least, 0.1 - amplitude, 1e-4);
}

/// What the discs of a clutch have together stays to the last digits, and they turn as one from the time on that the torque
/// needs.
/// What sticks is let go by the impulse of a reset, and slides the way that it is pushed.
#[test]
fn a_reset_lets_go_what_sticks() {
    let machine = |speed: f64| {
        format!(
            "Se:push(3) -> 1:v -> I:mass(2)\nv -> R:pad(friction = 5)\nstate x' = v.f from 0\n\
             when t > 1 {{ reset mass.f = {speed} }}\n"
        )
    };
    let ends = last(&run(&machine(2.0), &to(2.0, &["mass.f", "x", "mass.impulse"])));
    close(ends[0], 1.0, 1e-12);
    close(ends[1], 1.5, 1e-12);
    close(ends[2], 4.0, 1e-12);
    // It comes to rest at 1.5 s, and sticks again.
    let ends = last(&run(&machine(-2.0), &to(2.0, &["mass.f", "x", "pad.e"])));
    assert_eq!(ends[0], 0.0);
    close(ends[1], -0.5, 1e-12);
    close(ends[2], 3.0, 1e-12);
}

#[test]
fn clutch() {
    let text = "1:a -> I:j1(1, f0 = 30)\n1:b -> I:j2(2)\na -> 0:slip -> b\nslip -> R:pad(friction = 10)\n";
    let ends = last(&run(text, &to(5.0, &["j1.p", "j2.p", "j1.f", "j2.f", "pad.e"])));
    close(ends[0] + ends[1], 30.0, 1e-12);
    close(ends[2], 10.0, 1e-12);
    assert!(ends[2] == ends[3] && ends[4].abs() < 1e-12, "{ends:?}");
    let slipping = last(&run(text, &to(1.5, &["j1.f", "j2.f"])));
    close(slipping[0], 15.0, 1e-12);
    close(slipping[1], 7.5, 1e-12);
}

/// A ball: its impacts to the last digits until they accumulate, then rest.
#[test]
fn bouncing_ball_comes_to_rest() {
    let text = "Se:weight(-9.81) -> 1:v -> I:m(1)
state x' = v.f from 1
constraint floor: x >= 0 (restitution = 0.8)
";
    let result = run(text, &Run { every: None, ..to(5.0, &["m.f", "x", "floor.e"]) });
    let first = (2.0f64 / 9.81).sqrt();
    let speed = &result.trace.columns[0].values;
    let times = &result.trace.times;
    let mut impacts = (1..times.len()).filter(|&k| times[k] == times[k - 1] && speed[k] > speed[k - 1] + 1e-14);
    let (mut expected, mut flight) = (first, 2.0 * 0.8 * first);
    for _ in 0..60 {
        let k = impacts.next().expect("an impact");
        assert!((times[k] - expected).abs() < 1e-10 * 5.0, "{} for {expected}", times[k]);
        (expected, flight) = (expected + flight, flight * 0.8);
    }
    assert_eq!(last(&result), [0.0, 0.0, 9.81]);
    let end = first + 2.0 * first * 0.8 / (1.0 - 0.8);
    let at_rest = times.iter().zip(&result.trace.columns[2].values).find(|(_, force)| **force > 0.0).unwrap();
    assert!((at_rest.0 - end).abs() < 1e-8, "{} for {end}", at_rest.0);
}

/// A ball that lies still is lifted where the pull is greater than its weight; nothing sticks to the floor.
#[test]
fn a_contact_opens() {
    let text = "Se:weight(-10) -> 1:v -> I:m(1)
Se:pull(5*t) -> v
state x' = v.f from 0
constraint floor: x >= 0
";
    let ends = last(&run(text, &to(4.0, &["m.f", "x", "floor.e"])));
    close(ends[0], 2.5 * 4.0, 1e-10);
    close(ends[1], 5.0 * 8.0 / 6.0, 1e-10);
    assert_eq!(ends[2], 0.0);
}

/// Three balls in a row by Newton's law for each pair: momentum and energy stay, and no pair comes closer.
#[test]
fn three_balls() {
    let text = "1:a -> I:ma(1, f0 = 1)
1:b -> I:mb(1)
1:c -> I:mc(1)
state xa' = a.f from -1
state xb' = b.f from 0
state xc' = c.f from 0
constraint ab: xb - xa >= 0 (restitution = 1)
constraint bc: xc - xb >= 0 (restitution = 1)
";
    let ends = last(&run(text, &to(2.0, &["ma.f", "mb.f", "mc.f"])));
    for (found, expected) in ends.iter().zip([-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]) {
        close(*found, expected, 1e-14);
    }
}

/// Newton's cradle, its balls a little apart: one after the other hands its speed on, and the last one leaves with all of it.
#[test]
fn a_cradle() {
    let mut text = String::new();
    for k in 0..5 {
        text += &format!("1:v{k} -> I:m{k}(2, f0 = {})\nstate x{k}' = v{k}.f from {k}\n", u8::from(k == 0));
    }
    for k in 0..4 {
        text += &format!("constraint c{k}: x{} - x{k} >= 0.9 (restitution = 1)\n", k + 1);
    }
    for method in [Method::Explicit, Method::Radau, Method::Fixed(FixedMethod::Heun)] {
        let step = matches!(method, Method::Fixed(_)).then_some(0.07);
        let ends = last(&run(&text, &Run { method, step, ..to(3.0, &["x0", "x3", "x4", "m0.f", "m3.f", "m4.f"]) }));
        for (found, expected) in ends.iter().zip([0.1, 3.1, 6.6, 0.0, 0.0, 1.0]) {
            assert!((found - expected).abs() < 1e-12, "{method:?}: {ends:?}");
        }
    }
}

/// A rod on a pin meets a stop: the pin takes nothing where the stop stands at two thirds of its length.
#[test]
fn centre_of_percussion() {
    let pin = |part: f64| {
        let text = format!(
            "1:turn -> I:j(3*2^2/12)\n1:v -> I:m(3)\nSe:push(-1) -> turn\nstate th' = turn.f from 1\nstate y' = v.f\n\
             constraint pin: y - th = 0\nconstraint stop: {part}*2*th >= 0 (restitution = 0.5)\n"
        );
        let result = run(&text, &to(4.0, &["m.p", "stop.impulse", "th"]));
        let (times, columns) = (&result.trace.times, &result.trace.columns);
        let k = (1..times.len()).find(|&k| times[k] == times[k - 1] && columns[1].values[k] > 0.0).expect("an impact");
        let kept = columns[0].values[k] - columns[0].values[k - 1];
        assert!(kept > 1.0, "{kept}");
        // The stop pushes the rod by `impulse` at its place, the pin adds the rest of what the mass has got.
        (kept - columns[1].values[k]) / kept
    };
    assert!(pin(2.0 / 3.0).abs() < 1e-12, "{}", pin(2.0 / 3.0));
    close(pin(1.0), 1.0 - 2.0 / 3.0, 1e-12);
}

/// Capacitors that a switch joins share their charge; a coil that a switch cuts off goes on through its diode.
#[test]
fn switches() {
    let text = "0:a -> C:c1(1e-6, e0 = 10)\n0:b -> C:c2(3e-6)\na -> 1:s -> b\ns -> Sw:key(on = t > 1)\n";
    let ends = last(&run(text, &to(2.0, &["c1.e", "c2.e"])));
    close(ends[0], 2.5, 1e-12);
    close(ends[1], 2.5, 1e-12);
    let text = "Se:src(10) -> 1:in -> 0:n\nin -> Sw:key(on = t < 1)\nn -> 1:free\nfree -> R:d(0 <= -f, 0 <= e)\n\
                n -> 1:coil\ncoil -> I:l(2)\ncoil -> R:r(4)\n";
    let ends = last(&run(text, &to(1.5, &["l.f", "d.f"])));
    let before = 2.5 * (1.0 - (-2.0f64).exp());
    close(ends[0], before * (-1.0f64).exp(), 1e-9);
    close(ends[1], -ends[0], 1e-12);
}

/// Methods of fixed step come to the branches in the same order, with errors of their own.
#[test]
fn fixed_steps() {
    let text = "Se:pull(3*sin(2*t)) -> 1:v -> I:m(1)\nv -> R:pad(friction = 1)\nv -> C:k(k = 2)\n";
    let reference = last(&run(text, &to(10.0, &["m.f", "k.q"])));
    let methods =
        [(FixedMethod::Rk4, 1e-3, 1e-9), (FixedMethod::Heun, 1e-4, 1e-6), (FixedMethod::Rosenbrock, 1e-3, 1e-6)];
    for (method, step, within) in methods {
        let fixed = Run { method: Method::Fixed(method), step: Some(step), ..to(10.0, &["m.f", "k.q"]) };
        for (found, expected) in last(&run(text, &fixed)).iter().zip(&reference) {
            assert!((found - expected).abs() < within, "{method:?}: {found} for {expected}");
        }
    }
}

/// A diode behind forty cells that a wave has not reached yet keeps its branch, whatever rounding makes of it there; then the
/// wave is that of the line without it, as long as it conducts.
#[test]
fn a_diode_far_from_the_wave() {
    let line = |end: &str| {
        let mut text = String::from("Se:src(10*sin(3*t)) -> 1:l0\n");
        for k in 0..40 {
            text += &format!("l{k} -> I:i{k}(0.05)\nl{k} -> 0:n{k}\nn{k} -> C:c{k}(0.05)\n");
            text += &if k < 39 { format!("n{k} -> 1:l{}\n", k + 1) } else { format!("n{k} -> 1:end\nend -> R:r(1)\n") };
        }
        text + end
    };
    for method in [Method::Explicit, Method::Radau] {
        let names = ["c39.e", "r.f"];
        let options = Run { every: None, method, rtol: 1e-9, ..to(2.4, &names) };
        let with = run(&line("end -> R:d(0 <= f, 0 <= -e)\n"), &options);
        let without = run(&line(""), &options);
        assert!(with.report.switches <= 100 && with.report.steps < 4 * without.report.steps, "{:?}", with.report);
        let (with, without) = (last(&with), last(&without));
        assert!(with[1] > 0.1, "the wave has come: {with:?}");
        for (with, without) in with.iter().zip(&without) {
            close(*with, *without, 1e-6);
        }
    }
}

/// A block slides against a wall and stops there: it touches and stays, sticks, and comes away where it is pulled hard enough.
#[test]
fn a_block_that_sticks_at_a_wall() {
    // It stops at 2 m after 2 s, where the wall stands to rounding; the pull needs 2 N.
    for wall in ["2", "2 - 1e-15", "2 + 1e-15", "1.9"] {
        let text = format!(
            "1:v -> I:m(2, f0 = 2)\nv -> R:pad(friction = 2)\nSe:pull(if t < 3 then 0 else -(t - 3)) -> v\n\
             state x' = v.f from 0\nconstraint wall: x <= {wall} (restitution = 0)\n"
        );
        for method in [Method::Explicit, Method::Radau] {
            let ends = last(&run(&text, &Run { method, ..to(4.5, &["x", "m.f", "wall.e"]) }));
            close(ends[0], if wall == "1.9" { 1.9 } else { 2.0 }, 1e-9);
            assert!(ends[1].abs() < 1e-12 && ends[2].abs() < 1e-9, "{ends:?}");
            // From 5 s on a force of t - 5 pulls beyond friction.
            let ends = last(&run(&text, &Run { method, ..to(7.0, &["m.f", "wall.e"]) }));
            close(ends[0], -2.0 * 2.0 / 2.0 / 2.0, 1e-9);
            assert_eq!(ends[1], 0.0);
        }
    }
}

/// Two balls, one above the other, come to rest together: then the floor carries both and the lower one the upper one.
#[test]
fn a_stack_comes_to_rest() {
    for e in ["0.3", "0.5", "0.8"] {
        let text = format!(
            "Se:w1(-10) -> 1:v1 -> I:m1(1)\nSe:w2(-20) -> 1:v2 -> I:m2(2)\nstate x1' = v1.f from 0.5\n\
             state x2' = v2.f from 1\nconstraint floor: x1 >= 0 (restitution = {e})\n\
             constraint between: x2 - x1 >= 0.25 (restitution = {e})\n"
        );
        for method in [Method::Explicit, Method::Radau] {
            let names = ["x1", "x2", "m1.f", "m2.f", "floor.e", "between.e"];
            let result = run(&text, &Run { method, rtol: 1e-10, ..to(12.0, &names) });
            assert!(result.report.steps < 20_000, "{}", result.report.steps);
            let ends = last(&result);
            assert!(ends[0].abs() < 1e-11 && (ends[1] - 0.25).abs() < 1e-11, "{e}: {ends:?}");
            assert!(ends[2].abs() < 1e-11 && ends[3].abs() < 1e-11, "{e}: {ends:?}");
            close(ends[4], 30.0, 1e-11);
            close(ends[5], 20.0, 1e-11);
        }
    }
}

/// A row that fits exactly between two walls is hit: more contacts close than there are speeds, and no one moves.
#[test]
fn more_contacts_than_speeds() {
    let text = "1:a -> I:ma(1, f0 = 3)\n1:b -> I:mb(2)\n1:c -> I:mc(1)\nstate xa' = a.f from 0\nstate xb' = b.f from 1\n\
                state xc' = c.f from 2\nconstraint ab: xb - xa >= 1\nconstraint bc: xc - xb >= 1\n\
                constraint left: xa >= 0\nconstraint right: xc <= 2\n";
    let ends = last(&run(text, &to(1.0, &["ma.f", "mb.f", "mc.f", "ab.impulse", "bc.impulse", "right.impulse"])));
    assert!(ends[..3].iter().all(|f| f.abs() < 1e-14), "{ends:?}");
    for impulse in &ends[3..] {
        close(*impulse, 3.0, 1e-12);
    }
}

/// A contact that is touched at one instant and left again, to rounding: the motion goes on as if nothing stood there.
#[test]
fn a_contact_that_is_grazed() {
    let text = "1:v -> I:m(3, f0 = -1)\nSe:p(3*sin(t)) -> v\nstate x' = v.f from 0\nconstraint left: x >= -1\n";
    for method in [Method::Explicit, Method::Radau] {
        let result = run(text, &Run { method, rtol: 1e-9, ..to(3.0, &["m.f", "x"]) });
        assert!(result.report.steps < 2000, "{}", result.report.steps);
        let ends = last(&result);
        assert!((ends[0] + 3f64.cos()).abs() < 1e-6 && (ends[1] + 3f64.sin()).abs() < 1e-6, "{ends:?}");
    }
}

/// A body at rest of which nothing is known is hit.
#[test]
fn a_body_at_rest_is_hit() {
    let text = "1:a -> I:ma(3, f0 = -1)\n1:b -> I:mb(2)\nb -> C:spring(k = 8)\nstate xa' = a.f from 0.5\n\
                state xb' = b.f from 0\n1:u -> I:mu(1, f0 = -1)\nu -> R:pad(friction = 0.5)\n\
                constraint gap: xa - xb >= 0 (restitution = 0.5)\n";
    for method in [Method::Explicit, Method::Radau] {
        let ends = last(&run(text, &Run { method, ..to(1.0, &["ma.f", "mb.f", "xb"]) }));
        // By momentum and Newton's law, then half a second of its own oscillation.
        let (va, vb) = (-1.0 + 2.0 / 5.0 * 1.5, -3.0 / 5.0 * 1.5);
        close(ends[0], va, 1e-9);
        close(ends[1], vb * 1f64.cos(), 1e-8);
        close(ends[2], vb / 2.0 * 1f64.sin(), 1e-8);
    }
}

/// A contact that closes for a part of a step of fixed length only: the way back begins there, as if time had gone on.
#[test]
fn a_contact_within_a_fixed_step() {
    let text = "1:v -> I:m(1)\nv -> C:spring(k = 1, q0 = 1)\nstate x' = v.f from 1\n\
                constraint wall: x >= -0.9999 (restitution = 1)\n";
    for step in [0.05, 0.043, 0.037] {
        let options = Run { method: Method::Fixed(FixedMethod::Rk4), step: Some(step), ..to(5.0, &["x", "m.f"]) };
        let ends = last(&run(text, &options));
        // The way down and up again beyond the wall is left out.
        let phase = 5.0 + 2.0 * (PI - (-0.9999f64).acos());
        assert!((ends[0] - phase.cos()).abs() < 1e-5, "{step}: {ends:?} for {}", phase.cos());
        assert!((ends[1] + phase.sin()).abs() < 1e-5, "{step}: {ends:?} for {}", -phase.sin());
    }
}

/// A pendulum by `x` and `y` whose slot along `x` rubs.
pub(super) const DEAD_CENTRE: &str = "model DeadCentre\n1:x -> I:mx(1)\n1:y -> I:my(1)\nstate px' = x.f from 0.98\n\
    state py' = y.f\nguess py = 0.19\nSe:w(-9.81) -> y\nconstraint rod: px^2 + py^2 = 1\nx -> R:fx(friction = 0.5)\n";

/// Friction turns round where its speed is 0, which is where that speed tells nothing of the motion: the other variables that
/// have taken over there stay independent in the next mode. Against the same with the other speed from the beginning on.
#[test]
fn friction_turns_round_at_a_dead_centre() {
    let text = DEAD_CENTRE.split_once('\n').expect("a head").1;
    let names = ["px", "py", "mx.f", "my.f"];
    let expected = last(&run(&format!("{text}prefer y.f\n"), &to(0.4, &names)));
    for method in [Method::Explicit, Method::Radau] {
        let found = last(&run(text, &Run { method, ..to(0.4, &names) }));
        for (found, expected) in found.iter().zip(&expected) {
            // Half of the digits are lost where one speed tells nothing.
            close(*found, *expected, 1e-6);
        }
    }
}

/// What cannot be is refused, with the element and the remedy.
#[test]
fn refusals() {
    let told = |text: &str, to: f64| {
        let model = Model::from_text("machine.bond", &format!("model Machine\n{text}"), &[]);
        let result = model.and_then(|m| m.simulate(&Run { to, ..Run::default() }, &mut |_| true).map(|_| ()));
        result.expect_err("a refusal").render(false)
    };
    let joined = "Se:a(1) -> 1:s\nSe:b(2) -> 0:n -> s\ns -> Sw:key(on = t > 1)\nn -> R:r(1)\n";
    assert!(told(joined, 2.0).contains("no branches of the set-valued laws hold together"), "{}", told(joined, 2.0));
    for (text, why) in [
        ("Se:a(1) -> 1:s -> R:d(0 <= f)\ns -> R:r(1)\n", "two sides"),
        ("Se:a(1) -> 1:s -> R:d(0 <= t, 0 <= -e)\ns -> R:r(1)\n", "neither the effort nor the flow"),
        ("Se:a(1) -> 1:s -> R:d(friction = 1, friction = 2)\ns -> R:r(1)\n", "given twice"),
        ("Se:a(1) -> 1:s -> Sw:d(1)\ns -> R:r(1)\n", "condition"),
        ("Se:a(1) -> 1:v -> I:m(1)\nstate x' = v.f\nconstraint c: x >= 0 (restitution = 2)\n", "between 0 and 1"),
        ("Se:a(1) -> 1:v -> I:m(1)\nstate x' = v.f\nconstraint c: x >= 0 (bounce = 1)\n", "takes no such value"),
    ] {
        assert!(told(text, 1.0).contains(why), "{}", told(text, 1.0));
    }
}

/// Equations are told with the values of their unknowns at the start also where dry friction acts on one of two storages that move
/// together, in both forms that choose branches themselves.
#[test]
fn unknowns_of_friction_have_values_at_the_start() {
    let model = model("1:a -> I:m(1, f0 = 2)\na -> R:fr(friction = 0.5)\na -> TF:g(2) -> 1:b -> I:n(2)\n");
    for form in [Form::Minimal, Form::Kane] {
        let report = model.equations(form).unwrap_or_else(|error| panic!("{error}"));
        let found: Vec<(&str, Option<f64>)> = report.states.iter().map(|s| (s.name.as_str(), s.initial)).collect();
        assert_eq!(found, [("m.f", Some(2.0))], "{form:?}");
    }
}
