//! How long from model text to a program that runs?
//!
//! `cargo bench -p halfarrow --bench compile`

use std::fmt::Write;
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

fn main() {
    divan::main();
}

/// A ladder of 1,000 resistors and capacitors: below 50 ms.
#[divan::bench(sample_count = 20)]
fn ladder_1000(bencher: divan::Bencher) {
    let text = ladder(1000);
    bencher.bench(|| runnable(&text));
}

/// A ladder of 10,000 resistors and capacitors: below 0.7 s.
#[divan::bench(sample_count = 5)]
fn ladder_10000(bencher: divan::Bencher) {
    let text = ladder(10_000);
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

/// An RC ladder of `n` sections, fed by a voltage.
fn ladder(n: usize) -> String {
    let mut text = "model Ladder\nparam r = 1 ohm, c = 1 mF\nSe:source(1 V) -> 1:s1\n".to_string();
    for i in 1..=n {
        _ = writeln!(text, "s{i} -> R:R{i}(r)\ns{i} -> 0:n{i}\nn{i} -> C:C{i}(c)");
        if i < n {
            _ = writeln!(text, "n{i} -> 1:s{}", i + 1);
        }
    }
    text
}

fn model(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name).join("model.bond");
    std::fs::read_to_string(path).expect("a model")
}
