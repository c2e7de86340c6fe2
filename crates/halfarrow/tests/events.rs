//! What happens at events: closed forms, one meaning in any order of writing, impulses, what cannot be.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow::{Error, Export, Failure, FixedMethod, Form, Method, Model, Record, Run, Stopped, Target, Trace};

const FORMS: [Form; 6] = [Form::Minimal, Form::Kane, Form::Inverted, Form::Break, Form::Relaxed, Form::Lagrange];

fn model(text: &str) -> Model {
    Model::from_text("m.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn exact(to: f64) -> Run {
    Run { to, rtol: 1e-11, record: Record::All, ..Run::default() }
}

fn trace(text: &str, run: &Run) -> Trace {
    model(text).simulate(run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false))).trace
}

fn stopped(text: &str, run: &Run) -> Box<Stopped> {
    match model(text).simulate(run, &mut |_| true) {
        Err(Error::Run(stopped)) => stopped,
        Err(error) => panic!("{}", error.render(false)),
        Ok(_) => panic!("it runs to its end"),
    }
}

fn column<'t>(trace: &'t Trace, name: &str) -> &'t [f64] {
    &trace.column(name).unwrap_or_else(|| panic!("no {name}")).values
}

/// The samples that stand just after an event at which this variable changes.
fn changes(trace: &Trace, name: &str) -> Vec<usize> {
    let values = column(trace, name);
    (1..values.len()).filter(|&k| trace.times[k] == trace.times[k - 1] && values[k] != values[k - 1]).collect()
}

fn near(a: f64, b: f64, within: f64) -> bool {
    (a - b).abs() <= within
}

const BALL: &str = include_str!("../../../models/when_bouncing_ball/model.bond");

#[test]
fn a_ball_bounces_when_it_should_until_its_impacts_accumulate() {
    let first = (2.0f64 / 9.81).sqrt();
    let end = first * 1.8 / 0.2;
    for method in [Method::Explicit, Method::Bdf, Method::Radau] {
        let run = Run { method, ..exact(10.0) };
        let stopped = stopped(BALL, &run);
        let trace = &stopped.trace;
        let impacts = changes(trace, "n");
        assert!(impacts.len() > 80, "{method:?}: {} impacts, {}", impacts.len(), stopped.failure);
        // Low orders lose the digits of flights that take less than tolerances allow.
        let most = if method == Method::Bdf { 40 } else { impacts.len() };
        for (k, &at) in impacts.iter().enumerate().take(most) {
            let wanted = first * (1.0 + 2.0 * 0.8 * (1.0 - 0.8f64.powi(k as i32)) / 0.2);
            assert!(near(trace.times[at], wanted, 1e-10), "{method:?} impact {k}: {} {wanted}", trace.times[at]);
            let speed = column(trace, "ball.f");
            assert!(speed[at] == -0.8 * speed[at - 1], "both values stand at the time of the impact");
            let impulse = column(trace, "ball.impulse")[at];
            assert!(near(impulse, speed[at] - speed[at - 1], 1e-15 + 1e-12 * impulse.abs()));
        }
        let Failure::Accumulation { what, end: told, .. } = &stopped.failure else { panic!("{}", stopped.failure) };
        assert_eq!(what, "when h < 0 m");
        assert!(near(*told, end, if method == Method::Bdf { 1e-6 } else { 1e-9 }), "{method:?}: {told} {end}");
        // All that the ball has had is gone.
        let lost = stopped.report.audit.events["ball"];
        assert!(near(lost, -9.81, 1e-6), "{lost}");
    }
}

/// No method falls through the floor without a word, however short the last flights are beside what it is to be exact to.
#[test]
fn no_flight_is_lost_without_a_word() {
    for e in [0.05f64, 0.3, 0.8, 0.95] {
        let text = BALL.replace("e = 0.8", &format!("e = {e}"));
        for rtol in [1e-4f64, 1e-6, 1e-8, 1e-10] {
            for method in [Method::Explicit, Method::Bdf, Method::Radau, Method::Fixed(FixedMethod::Heun)] {
                let step = matches!(method, Method::Fixed(_)).then_some(0.1 * rtol.sqrt());
                if step.is_some_and(|step| step < 1e-3) {
                    continue;
                }
                let record = Record::Names(vec!["h".to_string()]);
                let run = Run { method, rtol, step, record, ..exact(60.0) };
                let stopped = match model(&text).simulate(&run, &mut |_| true) {
                    Err(Error::Run(stopped)) => stopped,
                    other => panic!("{e} {rtol} {method:?}: {:?}", other.map(|done| done.report)),
                };
                let told = matches!(stopped.failure, Failure::Accumulation { .. } | Failure::Lost { .. });
                assert!(told, "{e} {rtol} {method:?}: {}", stopped.failure);
                let lowest = column(&stopped.trace, "h").iter().copied().fold(0.0, f64::min);
                assert!(lowest > -0.01, "{e} {rtol} {method:?}: it is at {lowest}");
            }
        }
    }
}

/// Nor where friction turns round, or ends, before it is back.
#[test]
fn no_flight_is_lost_where_friction_changes_its_branch() {
    let text = "model M\nSe:push(10) -> 1:v -> I:mass(2)\nv -> R:pad(friction = 5)\nstate x' = v.f from 0\n\
                when x > 0.1 { reset mass.f = -0.5*mass.f }\n";
    for (method, step) in [
        (Method::Explicit, None),
        (Method::Radau, None),
        (Method::Fixed(FixedMethod::Rk4), Some(1e-3)),
        (Method::Fixed(FixedMethod::LinearlyImplicitBdf2), Some(1e-3)),
    ] {
        let stopped = stopped(text, &Run { method, step, ..exact(2.0) });
        let told = matches!(stopped.failure, Failure::Accumulation { .. } | Failure::Lost { .. });
        assert!(told, "{method:?}: {}", stopped.failure);
        let most = column(&stopped.trace, "x").iter().copied().fold(0.0, f64::max);
        assert!(near(most, 0.1, 1e-6), "{method:?}: it is at {most}");
    }
}

/// What an impact leaves far beyond a border may turn round on its way back to it.
#[test]
fn what_turns_round_far_from_the_border_is_not_lost() {
    let text = "model M\n1:v -> I:m(1, f0 = 1)\nSe:u(if t < 0.6 then 1 else -1) -> v\nstate x' = v.f from 0\ndiscrete n = 0\n\
                when x > 0.4 { reset m.f = -1 }\nwhen v.f < -0.2 { n = n + 1 }\n";
    for (method, step) in [(Method::Explicit, None), (Method::Fixed(FixedMethod::Rk4), Some(1e-2))] {
        let found = trace(text, &Run { method, step, ..exact(2.0) });
        assert_eq!(column(&found, "n").last(), Some(&1.0), "{method:?}");
    }
}

#[test]
fn steps_of_fixed_length_are_cut_short_at_impacts() {
    let first = (2.0f64 / 9.81).sqrt();
    for e in [0.01f64, 0.1, 0.5, 0.8, 0.9] {
        let text = BALL.replace("e = 0.8", &format!("e = {e}"));
        let end = first * (1.0 + e) / (1.0 - e);
        // A parabola is exact for both.
        for method in [FixedMethod::Heun, FixedMethod::Rk4] {
            let run = Run { method: Method::Fixed(method), step: Some(1e-3), ..exact(20.0) };
            let stopped = stopped(&text, &run);
            let trace = &stopped.trace;
            let Failure::Accumulation { end: told, .. } = &stopped.failure else { panic!("{e}: {}", stopped.failure) };
            assert!(near(*told, end, 1e-9), "{e}: {told} {end}");
            let lowest = column(trace, "h").iter().copied().fold(0.0, f64::min);
            assert!(lowest > -1e-9, "{e}: it is at {lowest}");
            for (k, &at) in changes(trace, "n").iter().enumerate() {
                let wanted = first * (1.0 + 2.0 * e * (1.0 - e.powi(k as i32)) / (1.0 - e));
                assert!(near(trace.times[at], wanted, 1e-10), "{e}, impact {k}: {} {wanted}", trace.times[at]);
            }
        }
    }
}

#[test]
fn a_rimless_wheel_comes_to_its_fixed_point() {
    let text = include_str!("../../../models/when_rimless_wheel/model.bond");
    let (alpha, gamma, g) = (0.4f64, 0.08f64, 9.81f64);
    let kept = (2.0 * alpha).cos();
    let fixed = kept * (4.0 * g * gamma.sin() * alpha.sin() / (1.0 - kept * kept)).sqrt();
    let trace = trace(text, &exact(60.0));
    let steps = changes(&trace, "steps");
    let speed: Vec<f64> = steps.iter().map(|&k| column(&trace, "leg.f")[k]).collect();
    assert!(speed.len() > 30 && near(speed[speed.len() - 1], fixed, 1e-9), "{:?} {fixed}", speed.last());
    for pair in speed.windows(2).take(8) {
        let away = |w: f64| w * w - fixed * fixed;
        assert!(near(away(pair[1]) / away(pair[0]), kept * kept, 1e-5), "{pair:?}");
    }
    let theta = column(&trace, "theta");
    assert!(steps.iter().all(|&k| near(theta[k], gamma - alpha, 1e-12)));
}

#[test]
fn a_relay_with_hysteresis_has_its_period() {
    let text = "model Relay
discrete on = 1
Sf:heater(40*on) -> 0:room -> C:walls(c = 2, e0 = 20)
room -> R:loss(1)
when walls.e > 22 { on = 0 }
when walls.e < 19 { on = 1 }
";
    for form in [Form::Minimal, Form::Break] {
        let trace = trace(text, &Run { form, ..exact(12.0) });
        let at: Vec<f64> = changes(&trace, "on").iter().map(|&k| trace.times[k]).collect();
        let (warm, cool) = (2.0 * (21.0f64 / 18.0).ln(), 2.0 * (22.0f64 / 19.0).ln());
        assert!(at.len() > 15);
        assert!(near(at[0], 2.0 * (20.0f64 / 18.0).ln(), 1e-9));
        for (k, pair) in at.windows(2).enumerate() {
            assert!(near(pair[1] - pair[0], if k % 2 == 0 { cool } else { warm }, 1e-9), "{pair:?}");
        }
    }
}

const SAMPLED: &str = "model Sampled
discrete u = 0 : N, k = 0
Se:force(u) -> 1:v -> I:mass(1 kg)
state x' = v.f from 1 m
when every 0.1 s { u = -2*x - 1*mass.f; k = k + 1 }
";

#[test]
fn a_sampled_controller_is_its_recurrence() {
    let methods = [
        (Method::Explicit, None),
        (Method::Radau, None),
        (Method::Fixed(FixedMethod::Rk4), Some(0.03)),
        (Method::Fixed(FixedMethod::Rk4), Some(0.025)),
    ];
    for (method, step) in methods {
        for form in [Form::Minimal, Form::Lagrange] {
            let text = match form {
                // A second mass on the same shaft keeps a constraint in the form.
                Form::Lagrange => SAMPLED.replace("I:mass(1 kg)", "I:mass(0.4 kg)\nv -> I:more(0.6 kg)"),
                _ => SAMPLED.to_string(),
            };
            if form == Form::Lagrange && !matches!(method, Method::Radau) {
                continue;
            }
            let run = Run { method, step, form, every: Some(0.1), ..exact(5.0) };
            let trace = trace(&text, &run);
            let (mut x, mut v) = (1.0, 0.0);
            for k in 0..50 {
                let u = -2.0 * x - v;
                let found = |name| column(&trace, name)[k];
                assert!(near(found("u"), u, 1e-11), "{method:?} {k}: {} {u}", found("u"));
                assert!(near(found("x"), x, 1e-11) && near(found("mass.f"), v, 1e-11), "{method:?} {k}");
                assert_eq!(found("k"), (k + 1) as f64);
                (x, v) = (x + 0.1 * v + 0.005 * u, v + 0.1 * u);
            }
        }
    }
    let run = Run { method: Method::Fixed(FixedMethod::Rk4), step: Some(0.03), ..exact(1.0) };
    let notes = model(SAMPLED).simulate(&run, &mut |_| true).expect("a run").report.notes.join("\n");
    assert!(notes.contains("`when every 0.1 s` is 3.33") && notes.contains("a shorter one"), "{notes}");
}

/// The clauses of a model in all orders of writing have one meaning, to the last bit.
#[test]
fn events_at_one_instant_have_one_meaning_in_any_order() {
    let head = "model Same
1:v -> I:m(1, f0 = 1)
v -> C:c(k = 3)
state x' = v.f from 0
discrete a = 1
discrete b = 2
discrete n = 0
";
    let clauses = [
        "when x > 0.25 { a = b }",
        "when x > 0.25 { b = a; reset c.q = 2*x }",
        "when a > 1.5 { reset m.f = 2*m.f; n = n + 1 }",
        "when m.f > 1.5 { reset x = x + 1; a = 0.5 }",
        "when t > 0.3 { n = n + 10 }",
        "when every 0.3 { b = b + a }",
    ];
    let forward = trace(&format!("{head}{}\n", clauses.join("\n")), &exact(2.0));
    for turn in 1..clauses.len() {
        let mut other = clauses.to_vec();
        other.rotate_left(turn);
        other.swap(0, 3);
        let trace = trace(&format!("{head}{}\n", other.join("\n")), &exact(2.0));
        assert_eq!(forward.times, trace.times, "{other:?}");
        for own in &forward.columns {
            assert_eq!(own.values, column(&trace, &own.name), "{} {other:?}", own.name);
        }
    }
    assert!(*column(&forward, "n").last().unwrap() >= 11.0);
    for clauses in [["a = b", "b = a"], ["b = a", "a = b"]] {
        let both = clauses.map(|set| format!("when x > 0.25 {{ {set} }}\n")).concat();
        let swapped = trace(&format!("{head}{both}"), &exact(0.5));
        let end = |name| *column(&swapped, name).last().unwrap();
        assert_eq!((end("a"), end("b")), (2.0, 1.0));
    }
}

const BEAM: &str = "model Beam
1:l -> I:left(2, f0 = 1)
1:r -> I:right(1)
l -> TF:hl(f_out = 0.25) -> 0:sum -> 1:c -> I:middle(3)
r -> TF:hr(f_out = 0.75) -> sum
l -> C:spring(k = 2)
when t > 0.5 { reset left.f = -2 }
when t > 0.7 { reset middle.p = 6 }
when t > 0.9 { reset c.f = -1; reset right.p = 0.5 }
";

#[test]
fn an_impulse_goes_through_the_structure() {
    let wanted = trace(BEAM, &exact(1.0));
    // The momenta that belong to the speeds of the two ends.
    let sums = |trace: &Trace, k: usize| {
        let of = |name: &str| column(trace, name)[k];
        [of("left.p") + 0.25 * of("middle.p"), of("right.p") + 0.75 * of("middle.p")]
    };
    let check = |trace: &Trace, form: Form| {
        let at: Vec<usize> = (1..trace.times.len()).filter(|&k| trace.times[k] == trace.times[k - 1]).collect();
        assert_eq!(at.len(), 3, "{form:?}");
        for (event, k) in at.into_iter().enumerate() {
            let of = |name: &str| column(trace, name)[k];
            let (before, after) = (sums(trace, k - 1), sums(trace, k));
            let along = match event {
                0 => [of("left.impulse"), 0.0],
                1 => [0.25 * of("middle.impulse"), 0.75 * of("middle.impulse")],
                _ => [0.25 * of("c.impulse"), 0.75 * of("c.impulse") + of("right.impulse")],
            };
            for i in 0..2 {
                assert!(
                    near(after[i] - before[i], along[i], 1e-12),
                    "{form:?} {event}: {before:?} {after:?} {along:?}"
                );
            }
            assert!(near(of("middle.f"), 0.25 * of("left.f") + 0.75 * of("right.f"), 1e-13));
            assert_eq!(column(trace, "spring.q")[k], column(trace, "spring.q")[k - 1]);
            let met = match event {
                0 => [(of("left.f"), -2.0), (of("left.f"), -2.0)],
                1 => [(of("middle.p"), 6.0), (of("middle.f"), 2.0)],
                _ => [(of("middle.f"), -1.0), (of("right.f"), 0.5)],
            };
            assert!(met.iter().all(|(found, asked)| near(*found, *asked, 1e-12)), "{form:?} {event}: {met:?}");
        }
    };
    check(&wanted, Form::Minimal);
    for form in FORMS {
        let trace = trace(BEAM, &Run { form, ..exact(1.0) });
        check(&trace, form);
        for name in ["left.f", "right.f", "middle.f", "spring.q"] {
            let [a, b] = [&trace, &wanted].map(|t| *column(t, name).last().unwrap());
            assert!(near(a, b, 1e-7), "{form:?} {name}: {a} {b}");
        }
    }
    let refused = model(BEAM).simulate(&Run { form: Form::Stiff, ..exact(1.0) }, &mut |_| true);
    let refused = refused.expect_err("refused").render(false);
    assert!(refused.contains("left.f cannot be reset in the form stiff"), "{refused}");
}

const FOUR_BAR: &str = "model FourBar
param a = 0.2, b = 0.5, c = 0.4, d = 0.5
1:crank -> I:one(1)
1:coupler -> I:two(1)
1:rocker -> I:three(1)
coupler -> C:spring(k = 1)
state th1' = crank.f from 0.6
state th2' = coupler.f
state th3' = rocker.f
constraint along: a*cos(th1) + b*cos(th2) = d + c*cos(th3)
constraint across: a*sin(th1) + b*sin(th2) = c*sin(th3)
guess th2 = -1.2, th3 = -2
Se:push(0.3) -> crank
";

#[test]
fn an_impulse_goes_through_a_closed_loop() {
    let text = format!("{FOUR_BAR}when t > 2 {{ reset three.f = 0.1 }}\n");
    let wanted = trace(&text, &exact(3.0));
    for form in FORMS {
        let trace = trace(&text, &Run { form, ..exact(3.0) });
        let k = (1..trace.times.len()).find(|&k| trace.times[k] == trace.times[k - 1]).expect("an event");
        let of = |name: &str, k: usize| column(&trace, name)[k];
        let speeds = ["one.f", "two.f", "three.f"];
        // Along the only motion there is: speeds are in the same proportions before and after.
        let ratio = of("three.f", k) / of("three.f", k - 1);
        for name in speeds {
            assert!(near(of(name, k), ratio * of(name, k - 1), 1e-11), "{form:?} {name}");
        }
        let jump = |i: usize| of(speeds[i], k) - of(speeds[i], k - 1);
        let done: f64 = (0..3).map(|i| jump(i) * of(speeds[i], k)).sum();
        assert!(near(done, of("three.impulse", k) * of("three.f", k), 1e-12), "{form:?}");
        assert!(near(of("three.f", k), 0.1, 1e-12));
        for name in ["th1", "th2", "th3", "one.f"] {
            let [a, b] = [&trace, &wanted].map(|t| *column(t, name).last().unwrap());
            assert!(near(a, b, 1e-7), "{form:?} {name}: {a} {b}");
        }
    }
    // Positions that follow do so at once.
    let moved = trace(&format!("{FOUR_BAR}when t > 2 {{ reset th1 = 1.2 }}\n"), &exact(3.0));
    let k = (1..moved.times.len()).find(|&k| moved.times[k] == moved.times[k - 1]).expect("an event");
    assert!(near(column(&moved, "th1")[k], 1.2, 1e-15));
    for drift in ["along.drift", "across.drift"] {
        assert!(column(&moved, drift).iter().all(|d| d.abs() < 1e-13), "{drift}");
    }
    // Where all of them are set they have to fit.
    let apart =
        stopped(&format!("{FOUR_BAR}when t > 2 {{ reset th1 = 3; reset th2 = 1; reset th3 = 1 }}\n"), &exact(3.0));
    let Failure::Reset { reason, .. } = &apart.failure else { panic!("{}", apart.failure) };
    assert!(reason.contains("a constraint stands against them"), "{}", apart.failure);
}

#[test]
fn what_is_kept_all_along_may_change_at_an_event() {
    // Both springs go with one speed: what they differ by is a constant of the motion.
    let text = "model Springs
1:v -> I:m(1, f0 = 1)
v -> C:one(k = 2, q0 = 0.1)
v -> C:two(k = 3, q0 = -0.2)
state x' = v.f from 0.1
when t > 0.4 { reset one.q = 0.5 }
when t > 0.8 { reset x = 0 }
";
    let trace = trace(text, &exact(1.0));
    let at: Vec<usize> = (1..trace.times.len()).filter(|&k| trace.times[k] == trace.times[k - 1]).collect();
    let jump = |name: &str, k: usize| column(&trace, name)[k] - column(&trace, name)[k - 1];
    let [first, second] = at[..] else { panic!("{at:?}") };
    assert!(near(column(&trace, "one.q")[first], 0.5, 1e-15));
    assert!(["two.q", "x", "m.f"].iter().all(|name| near(jump(name, first), 0.0, 1e-15)));
    assert!(near(jump("one.q", first), column(&trace, "one.impulse")[first], 1e-15));
    assert_eq!(column(&trace, "x")[second], 0.0);
    assert!(["one.q", "two.q", "m.f"].iter().all(|name| near(jump(name, second), 0.0, 1e-15)));
    let end = trace.times.len() - 1;
    let kept = |k: usize| column(&trace, "one.q")[k] - column(&trace, "two.q")[k];
    assert!(near(kept(end), kept(first), 1e-12));
}

#[test]
fn a_gear_is_changed_and_all_bodies_keep_their_momentum_but_for_the_teeth() {
    // The ratio jumps: N^T (p+ - p-) = 0 with the ratio after it.
    let text = "model Gears
discrete n = 2
1:a -> I:motor(1, f0 = 3)
a -> TF:gear(f_out = 1/n) -> 1:b -> I:car(10)
when t > 0.5 { n = 1 }
";
    for form in [Form::Minimal, Form::Kane, Form::Lagrange] {
        let trace = trace(text, &Run { form, ..exact(1.0) });
        let k = changes(&trace, "n")[0];
        let of = |name: &str, k: usize| column(&trace, name)[k];
        assert!(near(of("motor.f", k), of("car.f", k), 1e-13), "{form:?}");
        let sum = |k: usize| of("motor.p", k) + of("car.p", k);
        assert!(near(sum(k), sum(k - 1), 1e-12), "{form:?}: {} {}", sum(k), sum(k - 1));
    }
}

/// The same where the ratio is chosen by a condition on a discrete variable.
#[test]
fn a_gear_chosen_by_a_condition_is_changed_alike() {
    let text = "model Gear
discrete gear = 1
when t > 1 { gear = 3 }
1:from -> I:rotor(0.5, f0 = 36)
from -> TF:wheels(e_out = if gear > 2 then 1.4 else 3.6) -> 1:to -> I:load(2)
";
    // N^T (p+ - p-) = 0 with the ratio after it: 18 + 20/1.4 = (0.5 + 2/1.4^2) rotor.f.
    let wanted = (18.0 + 20.0 / 1.4) / (0.5 + 2.0 / 1.96);
    for form in [Form::Minimal, Form::Kane, Form::Inverted] {
        let done = trace(text, &Run { form, ..exact(2.0) });
        let found = *column(&done, "rotor.f").last().expect("there are samples");
        assert!(near(found, wanted, 1e-9), "{form:?} {found} {wanted}");
    }
}

/// Between the gears a ratio leads through others, which no gear change meets: momenta are shared out by the new one at once,
/// also while the motor pulls.
#[test]
fn a_gear_change_knows_no_gears_between() {
    for pull in [0.0, 0.5] {
        let text = format!(
            "model Gearbox\ndiscrete gear = 1\nwhen t > 1 {{ gear = 3 }}\n\
             let second = if gear > 2 then 1 else (if gear < 1 then 0 else gear - 1)\n\
             let third = if gear > 3 then 1 else (if gear < 2 then 0 else gear - 2)\n\
             1:from -> I:rotor(0.5, f0 = 36)\nSe:pull({pull}) -> from\n\
             from -> TF:wheels(e_out = 3.6 - 1.5*second - 0.7*third) -> 1:to -> I:load(2)\n"
        );
        // N^T (p+ - p-) = 0 with the ratio after it, between times in which the motor pulls both.
        let before = 36.0 + pull / (0.5 + 2.0 / (3.6 * 3.6));
        let after = (0.5 * before + 2.0 * before / 3.6 / 1.4) / (0.5 + 2.0 / 1.96);
        let wanted = after + pull / (0.5 + 2.0 / 1.96);
        for form in FORMS {
            let found = *column(&trace(&text, &Run { form, ..exact(2.0) }), "rotor.f").last().expect("samples");
            assert!(near(found, wanted, 1e-8), "{form:?} {pull}: {found} {wanted}");
        }
    }
}

#[test]
fn events_stand_in_instances_and_repetitions() {
    let text = "model Many
param count = 3
component Ball(param e = 0.5, h0; port p) {
    p -> 1:v -> I:ball(1)
    state h' = v.f from h0
    discrete n = 0
    when h < 0 { reset v.f = -e*v.f; n = n + 1 }
}
for i in 1..count {
    Se:weight[i](-9.81) -> b[i].p
    Ball:b[i](h0 = i, e = 0.6 + 0.1*i)
    discrete k[i] = i
    when every 0.25*i { k[i] = k[i] + 1 }
}
output all = sum(i in 1..count, b[i].n + k[i])
";
    let trace = trace(text, &exact(1.2));
    for i in 1..=3usize {
        let impacts = changes(&trace, &format!("b[{i}].n"));
        let (first, e) = ((2.0 * i as f64 / 9.81).sqrt(), 0.6 + 0.1 * i as f64);
        let wanted: Vec<f64> = [first, first * (1.0 + 2.0 * e)].into_iter().filter(|t| *t < 1.2).collect();
        assert!(impacts.len() >= wanted.len());
        for (k, at) in wanted.iter().zip(&impacts) {
            assert!(near(trace.times[*at], *k, 1e-10), "{i}: {} {k}", trace.times[*at]);
        }
        let counted = *column(&trace, &format!("k[{i}]")).last().unwrap();
        assert_eq!(counted, (i + 1) as f64 + (1.2 / (0.25 * i as f64)).floor());
    }
}

#[test]
fn what_an_event_sets_counts_at_the_start_and_is_read_by_laws() {
    let text = "model Start
discrete n = 4
Se:push(8) -> 1:v -> R:r(n)
v -> C:c(c = 1/n)
when t > 1 { n = 2 }
";
    let trace = trace(text, &Run { record: Record::All, ..exact(2.0) });
    assert_eq!(column(&trace, "r.e")[0], 8.0);
    assert_eq!(column(&trace, "r.f")[0], 2.0);
    let k = changes(&trace, "n")[0];
    let of = |name: &str, k: usize| column(&trace, name)[k];
    assert!(near(of("c.q", k), of("c.q", k - 1), 1e-15) && near(of("c.e", k), 2.0 * of("c.q", k), 1e-14));
}

#[test]
fn what_cannot_be_is_said() {
    let head = "model Odd\n1:v -> I:m(1, f0 = 1)\nv -> R:r(0.1)\nstate x' = v.f from 0\ndiscrete n = 0\n";
    let with = |clauses: &str| format!("{head}{clauses}\n");
    let run = exact(5.0);
    let twice = stopped(&with("when x > 1 { n = 1 }\nwhen x > 1 { n = 2 }"), &run);
    assert!(matches!(&twice.failure, Failure::Conflict { what, .. } if what == "n"), "{}", twice.failure);
    let same = "when x > 1 { n = 2 }\nwhen x > 1 { n = 2 }";
    assert_eq!(column(&trace(&with(same), &run), "n").last(), Some(&2.0));

    let circle = "when x > 1 { n = 1 }\nwhen n > 0.5 { n = 0 }\nwhen n < 0.5 and x > 1 { n = 1 }";
    let circle = stopped(&with(circle), &run);
    let Failure::Livelock { what, time } = &circle.failure else { panic!("{}", circle.failure) };
    assert!(what.contains("when n") && near(*time, -10.0 * 0.9f64.ln(), 1e-8), "{}", circle.failure);

    let geared = "v -> TF:gear(2) -> 1:w -> I:big(5)\nwhen x > 1 { reset m.f = 1; reset big.f = 7 }";
    let geared = stopped(&with(geared), &run);
    assert!(matches!(&geared.failure, Failure::Reset { what, .. } if what == "m.f, big.f"), "{}", geared.failure);
    let nowhere = stopped(&with("when x > 1 { reset m.f = log(x - 3) }"), &run);
    assert!(nowhere.failure.to_string().contains("the value that `when x > 1` gives m.f"), "{}", nowhere.failure);

    let driven = with("Sf:drive(t) -> 1:w -> I:big(5)\nwhen x > 1 { reset big.f = 7 }");
    for form in FORMS {
        let refused = model(&driven).equations(form).expect_err("it is refused").render(false);
        assert!(refused.contains("E003") && refused.contains("big.f cannot be reset"), "{form:?}: {refused}");
    }
    let of_a_law = model(&with("when x > 1 { reset r.e = 7; n = 1 }")).simulate(&run, &mut |_| true);
    // On its junction the effort of a resistor follows from the speed of the mass by its law alone.
    assert!(of_a_law.expect_err("refused").render(false).contains("r.e cannot be reset"));
}

#[test]
fn what_happens_at_events_is_exported() {
    for target in [Target::C, Target::Fmu2, Target::Fmu3] {
        let export = Export { target, binary: false, ..Export::default() };
        let exported = model(BALL).export(&export).unwrap_or_else(|e| panic!("{}", e.render(false)));
        let outputs = &exported.report.outputs;
        assert!(["n", "ball.impulse"].iter().all(|name| outputs.iter().any(|o| o == name)), "{outputs:?}");
    }
}

#[test]
fn events_are_printed_as_a_textbook_would() {
    let report = model(BALL).equations(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert_eq!(report.events, ["when h < 0: ball.f+ = -e*ball.f, n+ = 1 + n"]);
    assert_eq!(report.events_text, ["when h < 0: f_ball⁺ = -e f_ball, n⁺ = 1 + n"]);
    let sampled = model(SAMPLED).equations(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert!(sampled.events[0].starts_with("every 0.1: u+ = "), "{:?}", sampled.events);
}

#[test]
fn a_run_by_steps_is_saved_between_events() {
    let compiled = model(BALL).compile(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let mut steps = compiled.stepper(FixedMethod::Rk4, 1e-3, halfarrow::Start::Given).expect("a start");
    steps.advance(700).expect("steps");
    let saved = steps.save();
    let [once, twice] = [0, 1].map(|_| {
        steps.restore(&saved).expect("its own");
        steps.advance(1500).expect("steps");
        ["h", "ball.f", "n", "ball.impulse"].map(|name| steps.read(name).expect("a value").to_bits())
    });
    assert_eq!(once, twice);
    assert_eq!(steps.read("n").expect("a value"), 3.0);
}

/// Where a ratio leaps or a cam has a corner bodies meet as in an impact without restitution: what each keeps changes by
/// what the new ratios let through, `Nᵀ (X⁺ - X⁻) = 0`, in every form.
#[test]
fn ratios_that_leap_keep_momentum() {
    let lever = |when: &str| {
        format!(
            "model Lever\n1:a -> I:one(1, f0 = 2)\nstate th' = a.f from -1\n\
             a -> TF:lever(m = if {when} then 1/0.3 else 1/0.1) -> 1:b -> I:two(0.5)\n"
        )
    };
    let cam = "model Cam\n1:a -> I:one(1, f0 = 2)\n1:b -> I:two(0.5)\nstate th' = a.f from -1\nstate x' = b.f\n\
               constraint contact: x = 0.3*max(th, 0)\n";
    // Two speeds in the ratio r from then on: one.f = (p one + r p two)/(1 + 0.5 r^2) with what they kept before.
    let after = |ratio: f64, kept: f64| (2.0 + ratio * kept) / (1.0 + 0.5 * ratio * ratio);
    let forms = [Form::Minimal, Form::Kane, Form::Break, Form::Lagrange];
    for (text, ratio, kept, forms) in [
        (lever("t > 0.5"), 1.0 / 0.3, 10.0, &forms[..]),
        (lever("th > 0"), 1.0 / 0.3, 10.0, &forms[..]),
        (cam.to_string(), 0.3, 0.0, &forms[..2]),
    ] {
        for &form in forms {
            let trace = trace(&text, &Run { form, ..exact(1.0) });
            let last = |name: &str| *column(&trace, name).last().expect("samples");
            let wanted = after(ratio, kept);
            assert!((last("one.f") / wanted - 1.0).abs() < 1e-9, "{form:?} {}: {wanted}\n{text}", last("one.f"));
            assert!((last("two.f") / (ratio * wanted) - 1.0).abs() < 1e-9, "{form:?} {}\n{text}", last("two.f"));
        }
    }
}

/// A source that jumps by a condition of the state, on storages that it fixes: an event, though no rate reads it.
#[test]
fn sources_that_jump_by_a_state_move_what_they_fix() {
    let fixed = "model Fixed\nstate x' = 1 from 0\nSe:s(if x > 0.7 then 2 else 1) -> 0:n -> C:c(1)\nn -> R:r(1)\n";
    let between = "model Between\n1:a -> I:ma(1, f0 = 1)\n1:b -> I:mb(3)\nstate x' = a.f from 0\na -> 0:j -> b\n\
                   Sf:s(if x > 1 then 2 else 1) -> j\n";
    for form in FORMS {
        let at_end =
            |text: &str, name: &str| *column(&trace(text, &Run { form, ..exact(1.6) }), name).last().expect("samples");
        assert!(near(at_end(fixed, "c.q"), 2.0, 1e-12), "{form:?}");
        // The difference of speeds grows by 1, the momentum stays.
        assert!(near(at_end(between, "ma.f"), 0.25, 1e-9) && near(at_end(between, "mb.f"), 2.25, 1e-9), "{form:?}");
    }
}

/// Where the law of a storage jumps, nothing pushes: what it stores is kept, with what is stored in those that move with it,
/// in every form, in whatever order they are written, whatever makes it jump.
#[test]
fn laws_that_jump_keep_what_is_stored() {
    let shaft = |own: &str, other: &str| format!("model Shaft\n1:v -> {own}\nv -> {other}\nv -> R:r(0.1)\n");
    let one = "I:a(1, f0 = 1)";
    let until = (-0.1f64 / 2.0).exp();
    // One unit of mass beside another that is 1 and then 3, after a second that slows both: two units share what four have.
    let after = until / 2.0 * (-0.1f64 / 4.0).exp();
    for jump in [
        "I:b(if t > 1 then 3 else 1)",
        "I:b(2 + sign(t - 1))",
        "I:b(if floor(t) >= 1 then 3 else 1)",
        "I:b(f = p/(if t > 1 then 3 else 1))",
        "I:b(p = (if t > 1 then 3 else 1)*f)",
        "I:b(if 2*t > 2 then 3 + 0*t else 1)",
    ] {
        for text in [shaft(one, jump), shaft(jump, one)] {
            for form in FORMS {
                let trace = trace(&text, &Run { form, ..exact(2.0) });
                let last = *column(&trace, "a.f").last().expect("samples");
                assert!(near(last, after, 1e-9), "{form:?}: {last} is not {after}\n{text}");
            }
        }
    }
    // Charge alike, also where a state decides; and a storage alone whose law nothing inverts.
    let plates =
        "model Plates\n0:n -> C:a(1, e0 = 1)\nn -> C:b(if x > 0.5 then 3 else 1)\nn -> R:r(1e9)\nstate x' = 1 from 0\n";
    let lone = "model Lone\n1:v -> I:b(p = (if t > 0.5 then 3 else 1)*(f + f^5), f0 = 1)\nv -> R:r(1e-12)\n";
    for form in FORMS {
        let at_end =
            |text: &str, name: &str| *column(&trace(text, &Run { form, ..exact(1.0) }), name).last().expect("samples");
        assert!(near(at_end(plates, "a.e"), 0.5, 1e-8), "{form:?}");
        let f = at_end(lone, "b.f");
        assert!(near(f + f.powi(5), 2.0 / 3.0, 1e-9), "{form:?}: {f}");
    }
}
