//! Random machines of `std.multibody` and `std.planar`, trees and loops, against Newton and Euler in maximal coordinates:
//! `multibody/random_trees.py` draws them, and computes what is to come. What it found over many more is in docs/TESTING.md.

use std::collections::BTreeMap;

use halfarrow::{Model, Record, Run};
use serde::Deserialize;

#[derive(Deserialize)]
struct References {
    to: f64,
    #[serde(rename = "start off")]
    start_off: BTreeMap<String, f64>,
    #[serde(rename = "end off")]
    end_off: BTreeMap<String, f64>,
    machines: Vec<Machine>,
}

#[derive(Deserialize)]
struct Machine {
    seed: u32,
    kind: String,
    variant: String,
    text: String,
    /// What is recorded, with spaces between.
    names: String,
    /// For each of them the first letter of its class: position, velocity, acceleration, reaction.
    class: String,
    /// The greatest of each class at the start and at the end: errors are shares of it.
    scales: [[f64; 4]; 2],
    start: Vec<f64>,
    end: Vec<f64>,
}

const CLASSES: [&str; 4] = ["position", "velocity", "acceleration", "reaction"];

/// What is wrong with a machine; nothing if all is right.
fn faults(machine: &Machine, references: &References) -> Vec<String> {
    let names: Vec<String> = machine.names.split(' ').map(String::from).collect();
    let run = Run {
        to: references.to,
        every: Some(references.to),
        rtol: 1e-12,
        record: Record::Names(names.clone()),
        ..Run::default()
    };
    let done = match Model::from_text("machine.bond", &machine.text, &[]).and_then(|m| m.simulate(&run, &mut |_| true))
    {
        Ok(done) => done,
        Err(error) => return vec![error.render(false)],
    };
    let mut found = Vec::new();
    for (i, (name, class)) in names.iter().zip(machine.class.chars()).enumerate() {
        let k = CLASSES.iter().position(|c| c.starts_with(class)).expect("one of the four");
        let column = done.trace.columns.iter().find(|c| &c.name == name).expect("it is recorded");
        let (first, last) = (column.values[0], column.values[column.values.len() - 1]);
        for (at, value, expected, off, scale) in [
            ("start", first, machine.start[i], references.start_off[CLASSES[k]], machine.scales[0][k]),
            ("end", last, machine.end[i], references.end_off[CLASSES[k]], machine.scales[1][k]),
        ] {
            let error = (value - expected).abs() / scale;
            // What is not a number is not close.
            if error.is_nan() || error > off {
                found.push(format!(
                    "{name} at the {at}: {value} instead of {expected}, off by {error:.1e} of its class"
                ));
            }
        }
    }
    found
}

/// Places, velocities, accelerations of all bodies and reactions that are unique, at the start and after 0.3 s.
#[test]
fn random_machines_move_as_newton_and_euler_say() {
    let references: References = serde_json::from_str(include_str!("multibody/random_trees.json")).expect("it is JSON");
    assert_eq!(references.machines.len(), 47);
    let mut all = String::new();
    for machine in &references.machines {
        let found = faults(machine, &references);
        if !found.is_empty() {
            all += &format!(
                "machine {} ({}, {}):\n{}\n{}\n",
                machine.seed,
                machine.kind,
                machine.variant,
                found.join("\n"),
                machine.text
            );
        }
    }
    assert!(all.is_empty(), "{all}");
}

/// Frames are turned about axes whose squares add up to 1 exactly, whatever digits they are given with: a loop is not solved for a
/// joint outside of it by what rounding leaves, and the order of the statements tells nothing.
#[test]
fn axes_with_decimals_keep_speeds_outside_of_loops() {
    let text = include_str!("multibody/decimal_axis.bond");
    let (head, statements) = text.split_once("import std.multibody\n").expect("an import");
    let turned: String = statements.lines().rev().map(|line| format!("{line}\n")).collect();
    let names = ["out.angle", "out.speed", "j1.angle", "j1.speed"].map(String::from).to_vec();
    let ends = [text.to_string(), format!("{head}import std.multibody\n{turned}")].map(|text| {
        let model = Model::from_text("decimal_axis.bond", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
        let run =
            Run { to: 0.2, every: Some(0.2), rtol: 1e-11, record: Record::Names(names.clone()), ..Run::default() };
        let trace = model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).trace;
        let at = |i: usize| trace.columns.iter().map(|c| c.values[i]).collect::<Vec<f64>>();
        assert!((at(0)[1] - 1.0).abs() < 1e-14, "{:?}", at(0));
        at(1)
    });
    for (a, b) in ends[0].iter().zip(&ends[1]) {
        assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "{ends:?}");
    }
}

/// Positions that are guessed and fit stay: a guess of an unknown itself goes before what others have it follow from.
#[test]
fn guesses_that_fit_are_left() {
    let planar =
        (include_str!("multibody/moved.bond"), [("j2.q", 0.12251020742408691), ("j3t.q", -1.0217660320656292)]);
    let ball = (
        include_str!("multibody/moved_ball.bond"),
        [("j0.pitch.q", -0.43398542040230526), ("j0.yaw.q", 1.3581832991817564)],
    );
    for (text, guessed) in [planar, ball] {
        let model = Model::from_text("moved.bond", text, &[]).unwrap_or_else(|error| panic!("{error}"));
        let record = Record::Names(guessed.iter().map(|g| g.0.to_string()).collect());
        let run = Run { to: 1e-4, every: Some(1e-4), record, ..Run::default() };
        let trace = model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).trace;
        for (column, (name, guess)) in trace.columns.iter().zip(guessed) {
            assert!((column.values[0] - guess).abs() < 1e-13, "{name} is {} for {guess}", column.values[0]);
        }
    }
}

/// What a rod holds goes through the joints between its ends, by the balance of forces: where its bonds are drawn, and where it
/// acts at the rates and its sources say what they carry.
#[test]
fn joints_carry_what_closes_their_loop() {
    let drawn = include_str!("multibody/reaction.bond").to_owned() + "output rail = 2*slide.sum.z.e\n";
    let at_the_rates = drawn.replace("DrawnRod:rod", "Rod:rod");
    assert_ne!(drawn, at_the_rates);
    for text in [drawn, at_the_rates] {
        let model = Model::from_text("reaction.bond", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
        let names =
            ["slide.sum.x.e", "slide.sum.y.e", "slide.sum.z.e", "rod.length.e", "rail"].map(String::from).to_vec();
        let run = Run { to: 0.1, every: Some(0.1), record: Record::Names(names), ..Run::default() };
        let trace = model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).trace;
        // The multiplier of |d|² pulls with twice itself times the length, 50/3 N.
        let rail = 2.0 * 9.81 - 40.0 / 3.0;
        for (column, expected) in trace.columns.iter().zip([0.0, 0.0, rail, -5.0 / 3.0, 2.0 * rail]) {
            let off = column.values.iter().fold(0.0f64, |most, v| most.max((v - expected).abs()));
            assert!(off < 1e-13, "{}: {:?} instead of {expected}", column.name, column.values);
        }
    }
}

/// What a source carries may read a signal that repeats what a storage keeps.
#[test]
fn what_is_carried_reads_what_a_spring_keeps() {
    let text = "model M\nSe:push(1) -> 1:va -> I:a(1)\nva -> C:spring(k = 3, q0 = 0.1)\n1:vb -> I:b(1)\n\
                state x' = va.f from 0.1\nstate y' = vb.f from 0.05\nconstraint pin: x = 2*y\n\
                va -> Se:end(0, carries = 2*x*pin.e)\n";
    let model = Model::from_text("carried.bond", text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let names = ["end.e", "pin.e", "x"].map(String::from).to_vec();
    let run = Run { to: 1.0, every: Some(0.1), record: Record::Names(names), ..Run::default() };
    let trace = model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).trace;
    let [end, pin, x] = &trace.columns[..] else { panic!("three columns") };
    for ((end, pin), x) in end.values.iter().zip(&pin.values).zip(&x.values) {
        assert!(*pin != 0.0 && (end - 2.0 * x * pin).abs() < 1e-15, "{end} instead of 2 * {x} * {pin}");
    }
}

/// Friction by the load of a guide reads the load with what closes the loop, whether its bonds are drawn or it acts at the
/// rates; so do friction that is set-valued and events.
#[test]
fn laws_read_what_closes_their_loop() {
    let text = |cut: &str, law: &str| {
        format!(
            "model Crank\nimport std.planar\n\
             component Drawn(in a : plane, b : plane \"the two frames\") \"Hinge whose forces go through the bonds of the loop\" {{\n\
             [a.x, a.y] -> TF[2]:apart([[-1, 0], [0, -1]]) -> 0[2]:push\n[b.x, b.y] -> push\n\
             for i in 1..2 {{\nZC:meet[i](q = a.place[i] - b.place[i]) -> push[i]\n}}\n\
             a.w -> Se:free_w(0)\nb.w -> Se:loose_w(0)\n}}\n\
             Se:motor(2) -> drive.axis\n\
             PlanarWorld:world -> 1[plane]:ground -> PlanarRevolute:drive(q0 = 0.9, fixed = 1) -> 1[plane]:crank\n\
             crank -> PlanarBody:disc(m = 1, J = 0.02)\n\
             crank -> PlanarTranslation:throw(d = [0.1, 0]) -> PlanarRevolute:pin(q0 = -1.2) -> 1[plane]:rod\n\
             rod -> PlanarBody:bar(m = 0.4, J = 0.003, c = [0.15, 0])\nrod -> PlanarTranslation:length(d = [0.3, 0])\n\
             ground -> PlanarPrismatic:slide(q0 = 0.35) -> 1[plane]:slider -> PlanarBody:piston(m = 0.5, J = 0.001)\n\
             {cut}:wrist\nlength -> wrist.a\nslider -> wrist.b\n\
             Se:zero(0) -> 1:glide -> slide.axis\nglide -> R:rub({law})\n\
             discrete n = 0\nwhen slide.sum_y.e < 2 {{ n = n + 1 }}\nstate push' = slide.sum_y.e from 0\n"
        )
    };
    for law in [
        "e = 0.2*abs(slide.sum_y.e)*tanh(f/(0.01 m/s))",
        "friction = 0.2*abs(slide.sum_y.e)",
        "e = (1 N + slide.sum_y.e)*(f/(1 m/s))",
    ] {
        let ends = ["PlanarCutRevolute", "Drawn"].map(|cut| {
            let text = text(cut, law);
            let model = Model::from_text("crank.bond", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
            let names = ["drive.rate.f", "rub.e", "slide.sum_y.e", "n", "push"].map(String::from).to_vec();
            let run = Run { to: 0.5, every: Some(0.05), rtol: 1e-10, record: Record::Names(names), ..Run::default() };
            let trace = model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).trace;
            trace.columns.into_iter().map(|c| c.values).collect::<Vec<_>>()
        });
        let [rates, drawn] = ends;
        assert!(*drawn[3].last().expect("a row") >= 2.0, "{law}: the event is met");
        for (at, (a, b)) in rates.iter().zip(&drawn).enumerate() {
            let size = b.iter().fold(0.0f64, |most, v| most.max(v.abs()));
            let off = a.iter().zip(b).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
            assert!(off < 1e-7 * size, "{law}, column {at}: {off:e} of {size}");
        }
    }
}

/// A cart that a plane holds puts no load on the slide that it moves along: friction by that load takes nothing from it.
#[test]
fn what_a_plane_holds_loads_no_slide() {
    let text = "model Cart\nimport std.multibody\n\
        World:world -> 1[frame]:ground -> Prismatic:slide(n = [1, 0, 0], v0 = 1) -> 1[frame]:mid\n\
        mid -> Prismatic:lift(n = [0, 0, 1]) -> 1[frame]:cart -> Body:b(m = 2, J = diag([1, 1, 1]))\n\
        CutInplane:plane(n = [0, 0, 1])\nground -> plane.a\ncart -> plane.b\n\
        Se:push(0) -> 1:glide -> slide.axis\nglide -> R:rub(e = 0.3*(5 + abs(slide.sum.z.e))*tanh(f/(0.01 m/s)))\n";
    let model = Model::from_text("cart.bond", text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let names = ["slide.rate.f", "slide.sum.z.e", "plane.above.e"].map(String::from).to_vec();
    let run = Run { to: 0.5, every: Some(0.5), record: Record::Names(names), ..Run::default() };
    let trace = model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).trace;
    // The speed falls by 1.5 N / 2 kg.
    for (column, expected) in trace.columns.iter().zip([1.0 - 0.75 * 0.5, 0.0, 2.0 * 9.81]) {
        let end = column.values[1];
        assert!((end - expected).abs() < 1e-6, "{}: {end} instead of {expected}", column.name);
    }
}

/// Independent variables that are exchanged while a machine falls keep the accuracy that is asked for: there is no place of rest, and
/// a way to one tells nothing of how great its states are. The end is that of `rk4` by steps of 0.1 ms.
#[test]
fn a_falling_machine_keeps_its_accuracy() {
    let model = Model::from_text("falling.bond", include_str!("multibody/falling.bond"), &[]).expect("a model");
    let names = ["s2.w[1]", "s4.r[1]"].map(String::from).to_vec();
    let run = Run { to: 1.0, every: Some(1.0), rtol: 1e-8, record: Record::Names(names), ..Run::default() };
    let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{error}"));
    assert!(done.report.exchanges > 2, "{}", done.report.exchanges);
    for (column, expected) in done.trace.columns.iter().zip([-4.30816353889, -5.15776504121]) {
        let off = (column.values[1] - expected).abs();
        assert!(off < 1e-6, "{}: off by {off:.1e}", column.name);
    }
}
