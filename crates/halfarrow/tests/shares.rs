//! Reactions that are not unique, as those of least norm.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow::{Form, Method, Model, Record, Run, Simulated};

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

fn least(to: f64) -> Run {
    Run { to, minimum_norm: true, rtol: 1e-10, every: Some(to / 50.0), ..Run::default() }
}

/// Rods in parallel carry the same each, on levers in proportion to their arms.
#[test]
fn parallel_rods_share_the_load() {
    let mut text = String::from("model Rods\nSe:weight(-12 N) -> 1:v -> I:mass(2 kg)\n");
    for (rods, share) in [(2, -6.0), (3, -4.0), (4, -3.0)] {
        if rods == 2 {
            text += "v -> ZC:rod1\nv -> ZC:rod2\n";
        } else {
            text += &format!("v -> ZC:rod{rods}\n");
        }
        let done = run(&text, &least(1.0));
        for rod in 1..=rods {
            assert!(column(&done, &format!("rod{rod}.e")).iter().all(|e| (e - share).abs() < 1e-14), "{rods} {rod}");
        }
    }
    let levers = "model Levers\nSe:weight(-12 N) -> 1:v -> I:mass(2 kg)\n\
        v -> TF:near(f_out = 0.5) -> ZC:rod1\nv -> TF:far(f_out = 2) -> ZC:rod2\n";
    let done = run(levers, &least(1.0));
    for (rod, arm) in [("rod1.e", 0.5), ("rod2.e", 2.0)] {
        let wanted = -12.0 * arm / (0.25 + 4.0);
        assert!(column(&done, rod).iter().all(|e| (e - wanted).abs() < 1e-13), "{rod} {wanted}");
    }
}

/// Of two batteries of one voltage each gives half of the current.
#[test]
fn parallel_batteries_share_the_current() {
    let text = "model Batteries\nSe:first(12 V) -> 0:n -> R:load(3 ohm)\nSe:second(12 V) -> n\n";
    let done = run(text, &least(1.0));
    for battery in ["first.f", "second.f"] {
        assert!(column(&done, battery).iter().all(|f| (f - 2.0).abs() < 1e-14), "{battery}");
    }
}

/// What moves, and is pulled together by two pins: motion and audit are those without the option.
#[test]
fn pins_share_what_they_carry_together() {
    let text = "model Pins\nSe:push(10 N) -> 1:front -> I:cart(2 kg, f0 = 0.5 m/s)\nfront -> 0:joint -> 1:back -> I:trailer(3 kg)\n\
        joint -> 1:gap\nZC:pin -> gap\nZC:bolt -> gap\nback -> C:spring(k = 50 N/m)\nback -> R:damper(4 N.s/m)\n";
    let (plain, shared) = (run(text, &Run { minimum_norm: false, ..least(5.0) }), run(text, &least(5.0)));
    assert_eq!(column(&plain, "spring.q"), column(&shared, "spring.q"));
    for k in 0..shared.trace.samples() {
        let [pin, bolt, all] = ["pin.e", "bolt.e", "joint.e"].map(|name| column(&shared, name)[k]);
        assert!(
            (pin - bolt).abs() < 1e-13 && (pin + bolt).abs() - all.abs() < 1e-13 && all != 0.0,
            "{pin} {bolt} {all}"
        );
    }
}

/// A parallelogram with cranks below its bar at these parts of its length.
fn parallelogram(cranks: &[f64]) -> String {
    let mut text = String::from(
        "model Parallelogram\nparam a = 0.2 m, d = 0.5 m\nstate th0' = c0.f from 0.7 rad\nstate ph' = bar.f from 0 rad\n\
         1:c0 -> I:I0(0.01 kg.m2, f0 = 3)\n1:bar -> I:Ib(0.02 kg.m2)\nSe:push(0.02*sin(t)) -> c0\nSe:tilt(0.3) -> bar\n",
    );
    for (k, part) in cranks.iter().enumerate().map(|(k, part)| (k + 1, part)) {
        text += &format!(
            "state th{k}' = c{k}.f from 0.7 rad\n1:c{k} -> I:I{k}(0.01 kg.m2)\nSe:load{k}(0.1*{k}) -> c{k}\n\
             constraint x{k}: a*cos(th0) + {part}*d*cos(ph) = {part}*d + a*cos(th{k})\n\
             constraint y{k}: a*sin(th0) + {part}*d*sin(ph) = a*sin(th{k})\n"
        );
    }
    text
}

/// Each crank more has one reaction too many. Those of least norm turn the cranks as the others do, and have no part along
/// the combinations that do nothing: forces along the cranks, balanced about the first one.
#[test]
fn cranks_of_a_parallelogram_share_the_load() {
    let (a, d) = (0.2f64, 0.5f64);
    for parts in [vec![1.0, 0.5], vec![1.0, 0.5, 0.75]] {
        let text = parallelogram(&parts);
        for method in [Method::Explicit, Method::Radau] {
            let plain = run(&text, &Run { minimum_norm: false, method, ..least(3.0) });
            let shared = run(&text, &Run { method, ..least(3.0) });
            assert_eq!(plain.trace.times, shared.trace.times);
            for k in 0..shared.trace.samples() {
                let (th, ph) = (column(&shared, "th0")[k], column(&shared, "ph")[k]);
                let of = |done: &Simulated| -> Vec<[f64; 2]> {
                    let at = |n: usize| ["x", "y"].map(|axis| column(done, &format!("{axis}{n}.e"))[k]);
                    (1..=parts.len()).map(at).collect()
                };
                let (alone, least) = (of(&plain), of(&shared));
                // What they do to the bar, the first crank and each other one.
                let torques = |all: &[[f64; 2]]| -> Vec<f64> {
                    let bar =
                        all.iter().zip(&parts).map(|([x, y], part)| part * d * (y * ph.cos() - x * ph.sin())).sum();
                    let first = all.iter().map(|[x, y]| a * (y * th.cos() - x * th.sin())).sum();
                    let others = all.iter().map(|[x, y]| a * (y * th.cos() - x * th.sin()));
                    [bar, first].into_iter().chain(others).collect()
                };
                for (one, other) in torques(&alone).iter().zip(torques(&least)) {
                    assert!((one - other).abs() < 1e-8, "{method:?} {k}: {one} {other}");
                }
                let along: Vec<f64> = least.iter().map(|[x, y]| x * th.cos() + y * th.sin()).collect();
                for other in 1..parts.len() {
                    let nothing = along[0] * parts[other] - along[other] * parts[0];
                    assert!(nothing.abs() < 1e-7, "{method:?} {k} {other}: {nothing:e} {along:?}");
                }
                let norm = |all: &[[f64; 2]]| all.iter().flatten().map(|v| v * v).sum::<f64>();
                assert!(norm(&least) <= norm(&alone) + 1e-9);
            }
        }
    }
}

#[test]
fn what_is_unique_is_said_to_be() {
    let refused = |text: &str, run: Run| match model(text).simulate(&run, &mut |_| true) {
        Ok(_) => panic!("it is not refused"),
        Err(error) => error.render(false),
    };
    let said = refused("model Mass\n1:v -> I:m(1)\n", least(1.0));
    assert!(said.contains("unique"), "{said}");
    let rods = "model Rods\nSe:weight(-12 N) -> 1:v -> I:mass(2 kg)\nv -> ZC:rod1\nv -> ZC:rod2\n";
    let said = refused(rods, Run { form: Form::Kane, ..least(1.0) });
    assert!(said.contains("kane") && said.contains("minimal"), "{said}");
    let warned = model(rods).check().unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert!(warned.render(false).contains("--minimum-norm"));
}
