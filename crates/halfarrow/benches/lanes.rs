//! Does a sweep on lanes beat a loop over single runs of machine code, on one core?
//!
//! `cargo bench -p halfarrow --bench lanes`: time of a set, median of rounds in which both take turns, and the ratio, for
//! the quarter car and for four and forty of them on a chassis; `-- four` takes those whose name has it.

use std::fmt::Write;
use std::time::Instant;

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_exec::{Model, WideModel};
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::wide::{LANES, simulate_wide};
use halfarrow_sim::{Method, Options, Sink, simulate};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

const ROUNDS: usize = 9;

struct Last(f64);

impl Sink for Last {
    fn sample(&mut self, _: f64, values: &[f64]) {
        self.0 = values[0];
    }
}

fn main() {
    let quarter = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/quarter_car/model.bond"));
    let wanted: Option<String> = std::env::args().skip(1).find(|word| !word.starts_with("--"));
    let models = [
        ("quarter car", quarter.expect("a model")),
        ("four on a chassis", chassis(4)),
        ("forty on a chassis", chassis(40)),
    ];
    for (name, text) in models.iter().filter(|(name, _)| wanted.as_ref().is_none_or(|w| name.contains(w.as_str()))) {
        compare(name, text, 10.0);
    }
}

fn compare(name: &str, text: &str, to: f64) {
    let program = compile(Text { name, text, files: &NoFiles, overrides: &[] }, Form::Minimal);
    let program = program.unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
    let rates: Vec<_> = program.states.iter().map(|s| s.rate).collect();
    let instructions = program.guarded_routine(&rates).code.steps.len();
    let model = Model::new(program).expect("parameters that fit");
    let method = Method::Fixed(FixedMethod::Rk4);
    let options = Options { method, step: Some(1e-3), to, every: Some(to), ..Options::default() };
    let mut machine = model.clone();
    machine.compile_machine().expect("machine code");
    let mut wide = WideModel::new(&model);
    let (mut alone, mut lanes) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let from = Instant::now();
        let single: Vec<f64> = (0..LANES).map(|set| one(&mut machine, set, &options)).collect();
        alone.push(from.elapsed().as_secs_f64() / LANES as f64);
        let from = Instant::now();
        let at_once = together(&mut wide, &options);
        lanes.push(from.elapsed().as_secs_f64() / LANES as f64);
        assert_eq!(single, at_once, "the same bits");
    }
    let [alone, lanes] = [alone, lanes].map(|mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2]
    });
    println!(
        "{name}: {instructions} instructions; a set takes {:.3} ms alone, {:.3} ms on lanes: {:.2} times the throughput",
        alone * 1e3,
        lanes * 1e3,
        alone / lanes
    );
}

fn set(model: &mut Model, set: usize) -> Vec<f64> {
    model.set_parameter("ks", 15e3 + 1e3 * set as f64).expect("a parameter");
    model.initialise(0.0).expect("a start")
}

fn one(model: &mut Model, number: usize, options: &Options) -> f64 {
    let (mut x, mut last) = (set(model, number), Last(0.0));
    simulate(model, options, &mut x, &mut last).expect("a run");
    last.0
}

fn together(wide: &mut WideModel, options: &Options) -> Vec<f64> {
    let starts: Vec<Vec<f64>> = (0..LANES).map(|lane| set(wide.model(lane), lane)).collect();
    wide.begin();
    let mut x: Vec<[f64; LANES]> = (0..starts[0].len()).map(|i| std::array::from_fn(|l| starts[l][i])).collect();
    let mut sinks: [Last; LANES] = std::array::from_fn(|_| Last(0.0));
    let ends = simulate_wide(wide, options, &mut x, &mut sinks, [true; LANES]);
    ends.into_iter().for_each(|end| _ = end.expect("a run"));
    sinks.iter().map(|last| last.0).collect()
}

/// Quarter cars with progressive springs and dampers, on a chassis that heaves, pitches and rolls, over a wavy road.
fn chassis(corners: usize) -> String {
    let mut text = "model Chassis\nparam ms = 1280, mu = 40, ks = 18e3, kt = 190e3, b = 900, jp = 2400, jr = 500, g = 9.81\n\
        1:heave -> I:body(ms)\n1:pitch -> I:ip(jp)\n1:roll -> I:ir(jr)\nSe:weight(-ms*g) -> heave\noutput speed = body.f\n"
        .to_string();
    for i in 0..corners {
        let (along, across) = (1.3 - 2.6 * (i % 2) as f64, 0.7 - 1.4 * (i / 2 % 2) as f64);
        let _ = write!(
            text,
            "Sf:ground{i}(0.05*cos({}*t)) -> 0:tyre{i} -> 1:hub{i} -> I:wheel{i}(mu)\n\
             tyre{i} -> C:tread{i}(k = kt, q0 = 0.0186)\n\
             hub{i} -> 0:strut{i} -> 1:gap{i} -> C:spring{i}(e = ks*q*(1 + 4*q^2), q0 = 0.17)\n\
             gap{i} -> R:damper{i}(e = b*f*(1 + f^2))\n\
             Se:wheel_weight{i}(-mu*g) -> hub{i}\n\
             strut{i} -> 1:corner{i} -> 0:sum{i} -> heave\n\
             sum{i} -> TF:tp{i}({along}) -> pitch\nsum{i} -> TF:tr{i}({across}) -> roll\n",
            10 + i
        );
    }
    text
}
