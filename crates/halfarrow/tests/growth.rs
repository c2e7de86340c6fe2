//! How the work of one evaluation grows with the size of a model: counts, not seconds.

use std::fmt::Write;
use std::path::Path;

use halfarrow::{Family, Form, Model};

/// A family, its sizes, how many cells it has at each, and how the operations of the largest two may grow with the cells.
struct Growing {
    family: Family,
    sizes: [usize; 3],
    cells: fn(usize) -> usize,
    /// Exponent between the last two sizes.
    most: f64,
}

const LINE: fn(usize) -> usize = |n| n;
const SQUARE: fn(usize) -> usize = |n| n * n;

const FAMILIES: [Growing; 6] = [
    Growing { family: Family::Ladder, sizes: [10, 100, 1000], cells: LINE, most: 1.01 },
    // Its loops lie along diagonals, each a band.
    Growing { family: Family::Mesh, sizes: [10, 20, 40], cells: SQUARE, most: 1.1 },
    Growing { family: Family::Grid, sizes: [5, 10, 20], cells: SQUARE, most: 1.1 },
    Growing { family: Family::Chain, sizes: [5, 40, 80], cells: LINE, most: 1.1 },
    Growing { family: Family::Beam, sizes: [5, 20, 80], cells: LINE, most: 1.1 },
    Growing { family: Family::FourBars, sizes: [5, 20, 80], cells: LINE, most: 1.1 },
];

/// Bodies on hinges across each other, one hung from the other, which move in space.
const HINGES: &str = r#"model Hinges
import std.multibody
World:ground()
ground -> 1[frame]:base
for i in 1..SIZE {
    Revolute:hinge[i](n = if mod(i, 2) == 1 then [0, 1, 0] else [1, 0, 0], q0 = 0.1, fixed = 1)
    hinge[i] -> 1[frame]:link[i]
    link[i] -> Body:body[i](m = 1, J = diag([0.02, 0.02, 0.01]), c = [0, 0, -0.25])
    if i == 1 {
        base -> hinge[i]
    } else {
        link[i - 1] -> FixedTranslation:arm[i](d = [0, 0, -0.5]) -> hinge[i]
    }
}
"#;
/// A second body on each of the first ones, tied to the next of these by a rod: a chain of closed loops in space.
const RODS: &str = r#"
for i in 2..SIZE {
    link[i - 1] -> Revolute:knee[i](n = if mod(i, 2) == 1 then [0, 1, 0] else [1, 0, 0], q0 = 1) -> 1[frame]:side[i]
    side[i] -> Body:weight[i](m = 0.2, J = diag([0.01, 0.012, 0.008]), c = [0, 0, 0.1])
    side[i] -> FixedTranslation:eye[i](d = [0.1, 0.1, 0.2]) -> 1[frame]:pin[i]
    Rod:rod[i](l = 0.7)
    link[i] -> rod[i].a
    pin[i] -> rod[i].b
}
"#;
/// Springs with dampers from the last of them back to the ground, one to a point on the axis of the first hinge, whose motion
/// cancels in it.
const BACK_TO_THE_ROOT: &str = r#"
SpringDamper:aside(k = 100, l0 = 1, c = 1)
SpringDamper:along(k = 100, l0 = 1, c = 1)
base -> FixedTranslation:p(d = [1, 0, 0]) -> aside.a
base -> FixedTranslation:q(d = [0, 1, 0]) -> along.a
link[SIZE] -> FixedTranslation:tip(d = [0, 0, -0.5]) -> 1[frame]:end
end -> aside.b
end -> along.b
"#;
/// Masses in a row, each on a rope and tied to the next by a string, in a shape of one frequency: the lengths of ropes tell
/// those of strings, and each length of a rope would be a sum of lengths of strings.
const ROPES: &str = r#"model Ropes
param n = SIZE, m = 1 kg, k = 3 N/m, s = 50 N/m
for i in 1..n {
    1:v[i] -> I:mass[i](m)
    if i > 1 {
        v[i - 1] -> 0:tie[i] -> v[i]
        tie[i] -> C:string[i](k = s, q0 = 1 m*(cos(pi*(i - 1.5)/n) - cos(pi*(i - 0.5)/n)))
    }
    v[i] -> C:rope[i](k = k, q0 = 1 m*cos(pi*(i - 0.5)/n))
}
"#;
/// How the operations of the largest two rows of masses may grow.
const ROPES_GROW: f64 = 1.01;
/// How the operations of the largest two chains of hinges may grow.
const HINGES_GROW: f64 = 1.08;
/// And of those with loops.
const RODS_GROW: f64 = 1.1;

/// Operations of one evaluation, and expressions of the bond graph.
fn work(text: &str) -> (usize, usize) {
    let model = Model::from_text("growing.bond", text, &[]).expect("a model");
    (model.compile(Form::Minimal).expect("equations").operations(), model.expressions())
}

/// Adds what is counted of a family at three sizes to the table; the operations.
fn note(table: &mut String, name: &str, sizes: [usize; 3], text: impl Fn(usize) -> String) -> [usize; 3] {
    sizes.map(|size| {
        let (operations, expressions) = work(&text(size));
        _ = writeln!(table, "{name} {size}: {operations} operations, {expressions} expressions");
        operations
    })
}

/// The power with which the last of these counts grow with the cells.
fn exponent([_, middle, large]: [usize; 3], [_, fewer, more]: [usize; 3]) -> f64 {
    libm::log(large as f64 / middle as f64) / libm::log(more as f64 / fewer as f64)
}

/// Golden counts; `UPDATE=1` writes them anew.
#[test]
fn work_grows_with_the_cells() {
    let mut table = String::new();
    for Growing { family, sizes, cells, most } in FAMILIES {
        let counted = note(&mut table, family.name(), sizes, |size| family.model("Growing", size));
        let exponent = exponent(counted, sizes.map(cells));
        assert!(exponent <= most, "{} grows as the power {exponent:.3} of its cells", family.name());
    }
    let whip = format!("{HINGES}{BACK_TO_THE_ROOT}");
    let loops = format!("{HINGES}{RODS}");
    for (name, text, sizes, most) in [
        ("hinges", HINGES, [10, 40, 80], HINGES_GROW),
        ("whip", &whip, [10, 40, 80], HINGES_GROW),
        ("loops", &loops, [10, 40, 80], RODS_GROW),
        ("ropes", ROPES, [10, 100, 1000], ROPES_GROW),
    ] {
        let counted = note(&mut table, name, sizes, |size| text.replace("SIZE", &size.to_string()));
        let exponent = exponent(counted, sizes);
        assert!(exponent <= most, "{name} grows as the power {exponent:.3} of its cells");
    }
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/growth.txt");
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(&golden, &table).expect("written");
    }
    assert_eq!(table, std::fs::read_to_string(golden).expect("the golden counts"));
}

/// Linkages that are parallelograms turn as one: all cranks by the same angle, couplers not at all. The angle then obeys
/// `(n + 1) J angle'' = torque`, whose solution is a parabola.
#[test]
fn a_chain_of_parallelograms_turns_as_one_wheel() {
    for size in [1, 8, 40] {
        let text = Family::FourBars.model("Wheel", size);
        let set = ["rocker=1 m", "ground=2 m"].map(|text| {
            let (name, value) = text.split_once('=').expect("a pair");
            halfarrow::Override { name: name.into(), value: value.into() }
        });
        let model = Model::from_text("wheel.bond", &text, &set).expect("a model");
        let record = halfarrow::Record::Names(vec!["angle[0]".into(), format!("angle[{size}]"), "tilt[1]".into()]);
        let run = halfarrow::Run { to: 1.0, rtol: 1e-10, record, ..halfarrow::Run::default() };
        let done = model.simulate(&run, &mut |_| true).expect("it runs");
        let end = |column: usize| *done.trace.columns[column].values.last().expect("an end");
        let angle = 1.0 + 0.5 * 0.3 / (0.1 * (size as f64 + 1.0));
        for (column, exact) in [(0, angle), (1, angle), (2, 0.0)] {
            assert!(
                (end(column) - exact).abs() < 1e-8,
                "{size}: {} is {}, not {exact}",
                done.trace.columns[column].name,
                end(column)
            );
        }
    }
}

/// Few and many masses on ropes, by the lengths of strings or of ropes: all swing at the frequency of their shape,
/// `omega² = (k + 4 s sin²(pi/2n))/m`, and the strings go with them.
#[test]
fn masses_on_ropes_keep_the_shape_that_they_start_in() {
    for size in [5, 80] {
        let model = Model::from_text("ropes.bond", &ROPES.replace("SIZE", &size.to_string()), &[]).expect("a model");
        let record = ["rope[1].q", "string[2].q", &format!("rope[{size}].q"), &format!("string[{size}].q")];
        let record = halfarrow::Record::Names(record.map(String::from).to_vec());
        let run = halfarrow::Run { to: 7.0, rtol: 1e-11, record, ..halfarrow::Run::default() };
        let done = model.simulate(&run, &mut |_| true).expect("it runs");
        let n = size as f64;
        let shape = |i: f64| libm::cos(std::f64::consts::PI * (i - 0.5) / n);
        let half = libm::sin(std::f64::consts::PI / (2.0 * n));
        let now = libm::cos(libm::sqrt(3.0 + 200.0 * half * half) * 7.0);
        for (column, start) in
            [shape(1.0), shape(1.0) - shape(2.0), shape(n), shape(n - 1.0) - shape(n)].iter().enumerate()
        {
            let end = *done.trace.columns[column].values.last().expect("an end");
            assert!(
                (end - start * now).abs() < 1e-9,
                "{size}: {} is {end}, not {}",
                done.trace.columns[column].name,
                start * now
            );
        }
    }
}
