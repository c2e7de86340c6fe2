//! How long from model text to a program that runs?
//!
//! `cargo bench -p halfarrow --bench compile`

mod shapes;

use std::path::Path;

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_exec::Model;

/// The examples of the paper.
const PAPER: [&str; 11] = [
    "pendulum",
    "class2",
    "class3",
    "class4",
    "unity_gain",
    "two_class3_C",
    "two_class3_CI",
    "class2_class4_one_I",
    "class2_class4_one_I_variant_B",
    "class2_class4_two_I",
    "class2_class4_two_I_variant_B",
];

/// Rings, nets with and without algebraic loops, dependent storages, a mechanism.
const SHAPES: [&str; 6] =
    ["ring_1000", "junction_ring_1000", "mesh_30_class_1", "mesh_30_class_2", "gear_train_200", "pendulum_20"];

/// As in the program.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

/// A ladder of 1,000 resistors and capacitors: below 50 ms.
#[divan::bench(sample_count = 20)]
fn ladder_1000(bencher: divan::Bencher) {
    let text = shapes::ladder(1000);
    bencher.bench(|| runnable(&text));
}

/// A ladder of 10,000 resistors and capacitors: below 0.7 s.
#[divan::bench(sample_count = 5)]
fn ladder_10000(bencher: divan::Bencher) {
    let text = shapes::ladder(10_000);
    bencher.bench(|| runnable(&text));
}

/// Ten times as much, ten times as long.
#[divan::bench(sample_count = 2)]
fn ladder_100000(bencher: divan::Bencher) {
    let text = shapes::ladder(100_000);
    bencher.bench(|| runnable(&text));
}

/// Other shapes than a chain.
#[divan::bench(args = SHAPES, sample_count = 5)]
fn shape(bencher: divan::Bencher, name: &str) {
    let text = match name {
        "ring_1000" => shapes::ring(1000),
        "junction_ring_1000" => shapes::junction_ring(1000),
        "mesh_30_class_1" => shapes::mesh(30, 1),
        "mesh_30_class_2" => shapes::mesh(30, 3),
        "gear_train_200" => shapes::gear_train(200),
        "pendulum_20" => shapes::pendulum(20),
        _ => unreachable!("all shapes are listed"),
    };
    bencher.bench(|| runnable(&text));
}

/// The examples of the paper: each below 5 ms.
#[divan::bench(args = PAPER)]
fn paper(bencher: divan::Bencher, name: &str) {
    let text = model(name);
    bencher.bench(|| runnable(&text));
}

/// From text to a program with registers and parameters in place.
fn runnable(text: &str) -> Model {
    let text = Text { name: "bench.bond", text, files: &NoFiles, overrides: &[] };
    Model::new(compile(text, Form::Minimal).expect("a model without errors").ir).expect("parameters that fit")
}

fn model(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name).join("model.bond");
    std::fs::read_to_string(path).expect("a model")
}
