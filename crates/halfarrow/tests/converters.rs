//! Switched converters against solutions from phase to phase, and against what they are over a period.

use std::path::Path;

use halfarrow::{FixedMethod, Method, Model, Override, Record, Run, Simulated};
use serde_json::Value;

fn buck(file: &str, set: &[(&str, &str)], run: &Run) -> Simulated {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/converters/buck").join(file);
    let set: Vec<Override> =
        set.iter().map(|(name, value)| Override { name: (*name).into(), value: (*value).into() }).collect();
    let model = Model::load(&path, &set).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let record = Record::Names(
        ["coil.f", "smoothing.e", "diode.f"][..if file == "model.bond" { 3 } else { 2 }]
            .iter()
            .map(|n| (*n).into())
            .collect(),
    );
    let run = Run { record, ..run.clone() };
    model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn reference(kind: &str) -> Vec<Value> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/converters/buck/reference.json");
    let all: Value = serde_json::from_str(&std::fs::read_to_string(path).expect("a reference")).expect("JSON");
    all[kind].as_array().expect("rows").clone()
}

fn number(value: &Value) -> f64 {
    value.as_str().and_then(|text| text.parse().ok()).expect("a number")
}

const PERIOD: f64 = 1e-5;

/// Sixty pulses at 100 kHz, in continuous and in discontinuous conduction, whatever the method: current and voltage after each.
#[test]
fn a_buck_converter_from_pulse_to_pulse() {
    for (kind, set) in [("continuous", &[][..]), ("discontinuous", &[("R", "200 ohm"), ("v0", "18 V")][..])] {
        for (method, step, part) in [
            (Method::Explicit, None, 1e-9),
            (Method::Radau, None, 1e-8),
            (Method::Fixed(FixedMethod::Rk4), Some(1e-6), 1e-6),
        ] {
            let run = Run { method, step, to: 60.0 * PERIOD, rtol: 1e-11, every: Some(PERIOD), ..Run::default() };
            let done = buck("model.bond", set, &run);
            let (times, columns) = (&done.trace.times, &done.trace.columns);
            for (k, row) in reference(kind).iter().enumerate() {
                let end = (k + 1) as f64 * PERIOD;
                let at = times.iter().position(|t| (t - end).abs() < 1e-9 * end).expect("a sample");
                for (column, name, size) in [(0, "coil.f", 5.0), (1, "smoothing.e", 20.0)] {
                    let (found, wanted) = (columns[column].values[at], number(&row[name]));
                    let off = (found - wanted).abs();
                    assert!(
                        off < part * size,
                        "{kind}, {method:?}: {name} after {} pulses is {found}, not {wanted}",
                        k + 1
                    );
                }
            }
        }
    }
}

/// The coil runs dry where the reference says, and rests there until the next pulse.
#[test]
fn a_coil_runs_dry() {
    let set = [("R", "200 ohm"), ("v0", "18 V")];
    let run = Run { to: 5.0 * PERIOD, rtol: 1e-11, every: None, ..Run::default() };
    let done = buck("model.bond", &set, &run);
    let (times, current) = (&done.trace.times, &done.trace.columns[0].values);
    for (k, row) in reference("discontinuous").iter().take(5).enumerate() {
        let (dry, begun) = (number(&row["dry"]), k as f64 * PERIOD);
        let first = (0..times.len()).find(|&i| times[i] > begun + 0.4 * PERIOD && current[i] == 0.0).expect("it rests");
        assert!((times[first] - begun - dry).abs() < 1e-9 * PERIOD, "{} for {}", times[first] - begun, dry);
    }
}

/// The averaged model is the limit of fast pulses: twice the rate, half the difference from the mean over each period, all the
/// way from the start.
#[test]
fn the_averaged_buck_converter_is_the_limit_of_fast_pulses() {
    const PARTS: usize = 100;
    let off = |rate: usize| -> [f64; 2] {
        let (period, pulses) = (1e-3 / rate as f64, rate / 5);
        let (to, rtol) = (pulses as f64 * period, 1e-9);
        let set = [("rate", format!("{rate} kHz"))];
        let set: Vec<(&str, &str)> = set.iter().map(|(name, value)| (*name, value.as_str())).collect();
        let run = Run { to, rtol, ..Run::default() };
        let switched = buck("model.bond", &set, &Run { every: Some(period / PARTS as f64), ..run.clone() });
        let averaged = buck("averaged.bond", &[], &Run { every: Some(period / 2.0), ..run });
        // Where something jumps there are two rows; both have the same current and voltage.
        let mut rows: Vec<usize> = (0..switched.trace.times.len()).collect();
        rows.dedup_by(|a, b| (switched.trace.times[*a] - switched.trace.times[*b]).abs() < 1e-6 * period);
        assert_eq!(rows.len(), pulses * PARTS + 1);
        [0, 1].map(|column| {
            let value = |k: usize| switched.trace.columns[column].values[rows[k]];
            let mean = |pulse: usize| {
                let within = (0..PARTS).map(|k| value(pulse * PARTS + k) + value(pulse * PARTS + k + 1));
                within.sum::<f64>() / (2 * PARTS) as f64
            };
            let middle = |pulse: usize| averaged.trace.columns[column].values[2 * pulse + 1];
            (0..pulses).map(|pulse| (mean(pulse) - middle(pulse)).abs()).fold(0.0, f64::max)
        })
    };
    let (slow, fast) = (off(100), off(200));
    for (slow, fast) in slow.iter().zip(fast) {
        assert!((slow / fast - 2.0).abs() < 0.06 && *slow < 0.4, "{slow} {fast}");
    }
}
