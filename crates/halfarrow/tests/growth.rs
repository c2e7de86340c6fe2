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

fn operations(family: Family, size: usize) -> usize {
    let model = Model::from_text("growing.bond", &family.model("Growing", size), &[]).expect("a model");
    model.compile(Form::Minimal).expect("equations").operations()
}

/// Golden counts; `UPDATE=1` writes them anew.
#[test]
fn work_grows_with_the_cells() {
    let mut table = String::new();
    for Growing { family, sizes, cells, most } in FAMILIES {
        let counted = sizes.map(|size| operations(family, size));
        for (size, count) in sizes.iter().zip(counted) {
            _ = writeln!(table, "{} {size}: {count}", family.name());
        }
        let [_, middle, large] = counted.map(|count| count as f64);
        let [_, fewer, more] = sizes.map(|size| cells(size) as f64);
        let exponent = libm::log(large / middle) / libm::log(more / fewer);
        assert!(exponent <= most, "{} grows as the power {exponent:.3} of its cells", family.name());
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
