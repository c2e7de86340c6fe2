//! How long does one simulated second take?
//!
//! `cargo bench -p halfarrow --bench step`

use std::path::Path;

use halfarrow::{FixedMethod, Method, Model, Run};

const MODELS: [&str; 4] = ["class4", "pendulum", "quarter_car", "rc_bridge_diode"];

fn main() {
    divan::main();
}

/// 1,000 steps of `rk4` of 1 ms, recording the last one.
#[divan::bench(args = MODELS, sample_count = 20)]
fn rk4_1khz(bencher: divan::Bencher, name: &str) {
    let run = Run { method: Method::Fixed(FixedMethod::Rk4), step: Some(1e-3), ..one_second() };
    simulate(bencher, name, run);
}

/// The default method at the default tolerance.
#[divan::bench(args = MODELS, sample_count = 20)]
fn auto(bencher: divan::Bencher, name: &str) {
    simulate(bencher, name, one_second());
}

fn one_second() -> Run {
    Run { to: 1.0, every: Some(1.0), ..Run::default() }
}

fn simulate(bencher: divan::Bencher, name: &str, run: Run) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name).join("model.bond");
    let model = Model::load(&path, &[]).expect("a model without errors");
    bencher.bench_local(|| model.simulate(&run, &mut |_| true).expect("a run to its end"));
}
