//! Lanes do what their models do alone, to the last bit.

use std::path::PathBuf;

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_exec::{Model, WideModel};
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::wide::{LANES, simulate_wide};
use halfarrow_sim::{Failure, Method, Options, Sink, Stopped, Summary, simulate};

/// What was sampled, and what was seen at the ends of steps, if anybody looks there.
#[derive(Default, PartialEq, Debug, Clone)]
struct Bits {
    samples: Vec<(u64, Vec<u64>)>,
    seen: Vec<(u64, Vec<u64>)>,
    watches: bool,
}

fn bits(t: f64, values: &[f64]) -> (u64, Vec<u64>) {
    (t.to_bits(), values.iter().map(|v| v.to_bits()).collect())
}

impl Sink for Bits {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.samples.push(bits(t, values));
    }
    fn watches(&self) -> bool {
        self.watches
    }
    fn watch(&mut self, t: f64, values: &[f64]) -> Result<(), Failure> {
        self.seen.push(bits(t, values));
        Ok(())
    }
}

fn models() -> Vec<(String, Model)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let mut folders: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("models/").map(|e| e.expect("a folder").path()).collect();
    folders.sort();
    let mut found = Vec::new();
    for folder in folders {
        let Ok(text) = std::fs::read_to_string(folder.join("model.bond")) else { continue };
        let name = folder.file_name().expect("a name").to_string_lossy().into_owned();
        let text = Text { name: &name, text: &text, files: &NoFiles, overrides: &[] };
        let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
        found.push((name, Model::new(program).expect("parameters that fit")));
    }
    found
}

/// The first parameters that can be set, made a little larger from lane to lane.
fn set(model: &mut Model, lane: usize) {
    let free: Vec<String> = model.program().parameters.iter().filter(|p| !p.constant).map(|p| p.name.clone()).collect();
    for (i, name) in free.iter().take(3).enumerate() {
        let value = model.parameter(name).expect("it has a value");
        let _ = model.set_parameter(name, value * (1.0 + 0.01 * (lane * (i + 1)) as f64));
    }
}

fn outcome(end: Result<Summary, Stopped>) -> Result<(usize, usize, usize), String> {
    end.map(|s| (s.steps, s.jumps, s.crossings)).map_err(|s| format!("{} {}", s.time, s.failure))
}

fn compare(name: &str, model: &Model, options: &Options, watches: bool) -> usize {
    let mut wide = WideModel::new(model);
    let (mut wanted, mut starts, mut alone) = ([true; LANES], Vec::new(), Vec::new());
    for (lane, wanted) in wanted.iter_mut().enumerate() {
        set(wide.model(lane), lane);
        let mut own = model.clone();
        set(&mut own, lane);
        let x = wide.model(lane).initialise(0.0);
        *wanted = x.is_ok() && lane != 5;
        starts.push(x.unwrap_or_else(|_| vec![0.0; model.program().states.len()]));
        let mut bits = Bits { watches, ..Bits::default() };
        if *wanted {
            let mut x = own.initialise(0.0).expect("as in the lane");
            let end = simulate(&mut own, options, &mut x, &mut bits);
            alone.push(Some((bits, outcome(end), x)));
        } else {
            alone.push(None);
        }
    }
    wide.begin();
    let mut x: Vec<[f64; LANES]> = (0..starts[0].len()).map(|i| std::array::from_fn(|lane| starts[lane][i])).collect();
    let mut sinks: [Bits; LANES] = std::array::from_fn(|_| Bits { watches, ..Bits::default() });
    let ends = simulate_wide(&mut wide, options, &mut x, &mut sinks, wanted);
    for (lane, (end, alone)) in ends.into_iter().zip(alone).enumerate() {
        let Some((bits, end_alone, x_alone)) = alone else {
            assert!(sinks[lane].samples.is_empty(), "{name}: lane {lane} was not wanted");
            continue;
        };
        assert_eq!(outcome(end), end_alone, "{name}, lane {lane}");
        assert_eq!(sinks[lane].samples.len(), bits.samples.len(), "{name}, lane {lane}: samples");
        assert_eq!(sinks[lane], bits, "{name}, lane {lane}");
        let x: Vec<u64> = x.iter().map(|x| x[lane].to_bits()).collect();
        assert_eq!(x, x_alone.iter().map(|x| x.to_bits()).collect::<Vec<_>>(), "{name}, lane {lane}: the end");
    }
    wanted.iter().filter(|wanted| **wanted).count()
}

#[test]
fn every_lane_is_a_run_of_its_own() {
    let mut lanes = 0;
    for (i, (name, model)) in models().iter().enumerate() {
        let method = [FixedMethod::Euler, FixedMethod::Heun, FixedMethod::Rk4][i % 3];
        let fast = ["electrostatic", "rectifier"].contains(&name.as_str());
        let (step, to) = if fast { (1e-6, 1e-4) } else { (1e-3, 0.2) };
        let options = Options { method: Method::Fixed(method), step: Some(step), to, ..Options::default() };
        lanes += compare(name, model, &Options { every: Some(to / 7.0), ..options.clone() }, i % 2 == 0);
        lanes += compare(name, model, &options, false);
    }
    assert!(lanes > 400, "only {lanes} lanes ran");
}

const SWITCHING: &str = "model S\nparam k = 4, stop = 0.3, T = 0.013\nSe:pull(if t < T then 2 else sin(40*t)) -> 1:a -> I:m(0.1)\na -> C:spring(k = k)\na -> R:wall(e = if spring.q > stop then 50*f else 0.2*f)\nlet late = delay(m.f, 5*T)\nlet seen = sample(m.f, T)\na -> Se:control(0.5*late + 0.1*seen)\noutput q = spring.q\n";

#[test]
fn jumps_switches_delays_and_samples_are_each_lanes_own() {
    let text = Text { name: "s.bond", text: SWITCHING, files: &NoFiles, overrides: &[] };
    let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
    let model = Model::new(program).expect("parameters that fit");
    for every in [None, Some(0.01)] {
        let options =
            Options { method: Method::Fixed(FixedMethod::Rk4), step: Some(2e-3), to: 0.7, every, ..Options::default() };
        assert_eq!(compare("switching", &model, &options, every.is_none()), LANES - 1);
    }
}

/// Conditions of the state that change states or variables are met inside a step, by each lane where it comes to them.
#[test]
fn crossings_are_located_by_each_lane() {
    let text = "model B\nparam g = 9.81, e = 0.8, d = 0.01\nSe:weight(-g) -> 1:fall -> I:ball(1)\nfall -> R:air(d)\n\
        state h' = fall.f from 1\ndiscrete n = 0\nwhen h < 0 {\n    reset ball.f = -e*ball.f\n    n = n + 1\n}\n";
    let text = Text { name: "b.bond", text, files: &NoFiles, overrides: &[] };
    let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
    let model = Model::new(program).expect("parameters that fit");
    for (method, every) in [(FixedMethod::Rk4, None), (FixedMethod::Heun, Some(0.03)), (FixedMethod::Euler, None)] {
        let options = Options { method: Method::Fixed(method), step: Some(7e-3), to: 1.5, every, ..Options::default() };
        assert_eq!(compare("bouncing", &model, &options, every.is_none()), LANES - 1);
    }
}
