//! How long does one simulated second take?
//!
//! `cargo bench -p halfarrow --bench step`

use std::path::Path;

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_exec::Model;
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::{Method, Options, Sink, simulate};

const MODELS: [&str; 4] = ["class4", "pendulum", "quarter_car", "rc_bridge_diode"];

fn main() {
    divan::main();
}

/// 1,000 steps of `rk4` of 1 ms.
#[divan::bench(args = MODELS, sample_count = 20)]
fn rk4_1khz(bencher: divan::Bencher, name: &str) {
    one_second(bencher, name, Method::Fixed(FixedMethod::Rk4));
}

/// 1,000 steps of `implicit_midpoint` of 1 ms.
#[divan::bench(args = MODELS, sample_count = 20)]
fn implicit_midpoint_1khz(bencher: divan::Bencher, name: &str) {
    one_second(bencher, name, Method::Fixed(FixedMethod::ImplicitMidpoint));
}

/// The default method at the default tolerance.
#[divan::bench(args = MODELS, sample_count = 20)]
fn auto(bencher: divan::Bencher, name: &str) {
    one_second(bencher, name, Method::Auto);
}

/// Takes no notice.
struct Nothing;

impl Sink for Nothing {
    fn sample(&mut self, _: f64, _: &[f64]) {}
}

fn one_second(bencher: divan::Bencher, name: &str, method: Method) {
    let mut model = model(name);
    let start = model.initialise(0.0).expect("a start");
    let step = matches!(method, Method::Fixed(_)).then_some(1e-3);
    let options = Options { method, step, to: 1.0, every: Some(1.0), ..Options::default() };
    bencher.bench_local(|| {
        model.restart();
        simulate(&mut model, &options, &mut start.clone(), &mut Nothing).expect("a run to its end")
    });
}

fn model(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name).join("model.bond");
    let text = std::fs::read_to_string(path).expect("a model");
    let text = Text { name, text: &text, files: &NoFiles, overrides: &[] };
    Model::new(compile(text, Form::Minimal).expect("a model without errors").ir).expect("parameters that fit")
}
