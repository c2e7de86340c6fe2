//! What takes how long, as JSON: the side of halfarrow in `bench/run.py`.
//!
//! `timing rates FILE COUNT`: one evaluation of the rates. `timing simulate FILE TO RTOL ATOL`: a run. `timing compile
//! FILE`: from text to machine code.

use std::time::Instant;

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::program::Program;
use halfarrow_exec::Model;
use halfarrow_sim::{AbsoluteTolerance, Events, Method, Options, Sink, System, simulate};
use serde_json::json;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|w| !w.starts_with("--")).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let found = match words[..] {
        ["rates", file, count] => rates(file, count.parse().expect("a number")),
        ["simulate", file, to, rtol, atol] => run(file, [to, rtol, atol].map(|w| w.parse().expect("a number"))),
        ["compile", file] => compiling(file),
        _ => return,
    };
    println!("{found}");
}

fn program(file: &str) -> Program {
    let text = std::fs::read_to_string(file).expect("a model");
    let text = Text { name: file, text: &text, files: &NoFiles, overrides: &[] };
    compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir
}

fn rates(file: &str, count: usize) -> serde_json::Value {
    let mut bytecode = Model::new(program(file)).expect("parameters that fit");
    let mut start = bytecode.initialise(0.0).expect("a start");
    bytecode.handle_event(0.0, &mut start).expect("a start");
    let mut machine = bytecode.clone();
    machine.compile_machine().expect("machine code");
    let (machine_ns, dx) = evaluate(&mut machine, &start, count);
    let (bytecode_ns, _) = evaluate(&mut bytecode, &start, (count / 4).max(1));
    let states: Vec<&String> = machine.program().states.iter().map(|s| &s.name).collect();
    let instructions = instructions(machine.program());
    json!({ "machine_ns": machine_ns, "bytecode_ns": bytecode_ns, "states": states, "rates": dx,
        "instructions": instructions })
}

/// Batches, short enough to run undisturbed.
const BATCHES: usize = 301;

/// Nanoseconds of one, the median of the batches, and the last rates.
fn evaluate(model: &mut Model, start: &[f64], count: usize) -> (f64, Vec<f64>) {
    let (mut x, mut dx) = (start.to_vec(), vec![0.0; start.len()]);
    let mut times = Vec::with_capacity(BATCHES);
    for _ in 0..BATCHES {
        x.copy_from_slice(start);
        let (from, mut t) = (Instant::now(), 0.0);
        for _ in 0..count {
            model.rates(t, &x, &mut dx).expect("rates");
            x.iter_mut().zip(&dx).for_each(|(x, dx)| *x += 1e-9 * dx);
            t += 1e-9;
        }
        times.push(from.elapsed().as_nanos() as f64 / count as f64);
    }
    times.sort_by(f64::total_cmp);
    (times[BATCHES / 2], dx)
}

fn instructions(program: &Program) -> usize {
    let rates: Vec<_> = program.states.iter().map(|s| s.rate).collect();
    program.guarded_routine(&rates).code.steps.len()
}

struct Nothing;

impl Sink for Nothing {
    fn sample(&mut self, _: f64, _: &[f64]) {}
}

/// Runs of one kind, of which the median counts: the peer's are in one process too.
const RUNS: usize = 5;

/// The same where there are more states than so many.
const RUNS_OF_LARGE: (usize, usize) = (5000, 3);

/// Runs by bytecode and by machine code, which takes some time to make.
fn run(file: &str, [to, rtol, atol]: [f64; 3]) -> serde_json::Value {
    let mut bytecode = Model::new(program(file)).expect("parameters that fit");
    bytecode.prepare_derivatives().expect("parameters that fit");
    let start = bytecode.initialise(0.0).expect("a start");
    let mut machine = bytecode.clone();
    let from = Instant::now();
    machine.compile_machine().and_then(|()| machine.compile_directional()).expect("machine code");
    let made = from.elapsed().as_secs_f64();
    let options = Options {
        method: Method::Auto,
        to,
        rtol,
        atol: if atol > 0.0 { AbsoluteTolerance::Same(atol) } else { AbsoluteTolerance::Scaled },
        every: Some(to),
        ..Options::default()
    };
    let mut x = Vec::new();
    let mut runs = |model: &mut Model| {
        let mut once = || {
            x.clone_from(&start);
            model.restart();
            let from = Instant::now();
            let done = simulate(model, &options, &mut x, &mut Nothing).expect("a run to its end");
            (from.elapsed().as_secs_f64(), done)
        };
        let (large, few) = RUNS_OF_LARGE;
        let count = if start.len() > large { few } else { RUNS };
        let mut all: Vec<_> = (0..count).map(|_| once()).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.swap_remove(count / 2)
    };
    let (seconds, work) = runs(&mut bytecode);
    let (machine_seconds, _) = runs(&mut machine);
    let names: Vec<&str> = bytecode.program().states.iter().map(|state| state.name.as_str()).collect();
    json!({ "seconds": seconds, "machine_seconds": machine_seconds, "made": made, "states": x, "names": names,
        "work": format!("{work:?}") })
}

fn compiling(file: &str) -> serde_json::Value {
    let text = std::fs::read_to_string(file).expect("a model");
    let mut times = [f64::INFINITY; 3];
    let mut sizes = (0, 0);
    for _ in 0..10 {
        let from = Instant::now();
        let text = Text { name: file, text: &text, files: &NoFiles, overrides: &[] };
        let program = compile(text, Form::Minimal).expect("a model without errors").ir;
        let to_program = from.elapsed().as_secs_f64();
        let model = Model::new(program).expect("parameters that fit");
        let to_model = from.elapsed().as_secs_f64();
        let mut machine = model.clone();
        let before = Instant::now();
        machine.compile_rates().expect("machine code");
        let parts = [to_program, to_model - to_program, before.elapsed().as_secs_f64()];
        times.iter_mut().zip(parts).for_each(|(least, part)| *least = least.min(part));
        sizes = (instructions(machine.program()), machine.program().values.len());
    }
    json!({ "program": times[0], "model": times[1], "machine": times[2], "instructions": sizes.0, "values": sizes.1 })
}
