//! Are rates as fast as minimal C written by hand? Machine code, bytecode and exported C beside it, in one run.
//!
//! `cargo bench -p halfarrow --bench rates`, with a C compiler named `cc`.
//!
//! Each runs batches of steps of 1 ns by Euler's method, so that a step waits for the one before as in a simulation. The
//! batches take turns; what is shown are medians and ratios to C written by hand.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Instant;

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_exec::Model;
use halfarrow_sim::{Events, System};

const MODELS: [&str; 5] = ["pendulum", "double_pendulum", "slider_crank", "quarter_car", "dc_motor_pid"];
/// Batches of each, short enough to run undisturbed.
const BATCHES: usize = 1001;
/// Evaluations of a batch.
const COUNT: usize = 2_000;

fn main() {
    // `cargo test --benches` only wants to know that it builds.
    if !std::env::args().any(|a| a == "--bench") {
        return;
    }
    println!("{:16} {:>9} {:>16} {:>16} {:>16}", "", "C by hand", "machine code", "exported C", "bytecode");
    for name in MODELS {
        compare(name);
    }
}

fn compare(name: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(folder.join("../../models").join(name).join("model.bond")).expect("a model");
    let text = Text { name, text: &text, files: &NoFiles, overrides: &[] };
    let program = compile(text, Form::Minimal).expect("a model without errors").ir;
    let states = program.states.len();
    let mut hand = Peer::by_hand(&folder.join("benches/hand"), name, states);
    let mut bytecode = Model::new(program).expect("parameters that fit");
    bytecode.initialise(0.0).expect("a start");
    let mut exported = Peer::exported(&folder.join("benches/hand"), name, states);
    let mut machine = bytecode.clone();
    machine.compile_machine().expect("machine code");
    let start = hand.run(0).1;
    for model in [&mut bytecode, &mut machine] {
        model.restart();
        model.handle_event(0.0, &mut start.clone()).expect("a start");
    }
    let there = hand.run(COUNT).1;
    for (a, b) in ours(&mut machine, &start, COUNT).1.iter().zip(&there) {
        let size = there.iter().fold(1.0f64, |most, x| most.max(x.abs()));
        assert!((a - b).abs() <= 1e-12 * size, "{name}: {a} {b}: not the same model");
    }
    let mut times: [Vec<f64>; 4] = Default::default();
    for _ in 0..BATCHES {
        times[0].push(hand.run(COUNT).0);
        times[1].push(ours(&mut machine, &start, COUNT).0);
        times[2].push(exported.run(COUNT).0);
        times[3].push(ours(&mut bytecode, &start, COUNT).0);
    }
    let median = |all: &mut Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).map_or(f64::NAN, |t| t / COUNT as f64)
    };
    let [hand, rest @ ..] = times.each_mut().map(median);
    let shown: Vec<String> = rest.iter().map(|t| format!("{t:7.2} ns {:5.2}", t / hand)).collect();
    println!("{name:16} {hand:6.2} ns {:>16} {:>16} {:>16}", shown[0], shown[1], shown[2]);
}

/// Nanoseconds of a batch, and where it ends.
fn ours(model: &mut Model, start: &[f64], count: usize) -> (f64, Vec<f64>) {
    let (mut x, mut dx, mut t) = (start.to_vec(), vec![0.0; start.len()], 0.0);
    let from = Instant::now();
    for _ in 0..count {
        model.rates(t, &x, &mut dx).expect("rates");
        x.iter_mut().zip(&dx).for_each(|(x, dx)| *x += 1e-9 * dx);
        t += 1e-9;
    }
    (from.elapsed().as_nanos() as f64, x)
}

/// A program that runs batches as it is asked to.
struct Peer {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

impl Peer {
    fn by_hand(folder: &Path, name: &str, states: usize) -> Peer {
        let sources = [folder.join("timing.c"), folder.join(format!("{name}.c"))];
        Peer::compiled(&format!("by_hand_{name}"), folder, &sources, &[format!("-DSTATES={states}")])
    }

    /// C as it is exported.
    fn exported(folder: &Path, name: &str, states: usize) -> Peer {
        let file = folder.join("../../../../models").join(name).join("model.bond");
        let model = halfarrow::Model::load(&file, &[]).expect("a model without errors");
        let exported = model.export(&halfarrow::Export::default()).expect("an explicit model");
        let place = std::env::temp_dir().join(format!("halfarrow_bench_c_{name}_{}", std::process::id()));
        std::fs::create_dir_all(&place).expect("a folder to work in");
        for file in &exported.files {
            std::fs::write(place.join(&file.path), &file.bytes).expect("a file");
        }
        let c = &exported.report.name;
        let sources = [folder.join("timing.c"), folder.join("exported.c"), place.join(format!("{c}.c"))];
        let header = place.join(format!("{c}.h"));
        let words =
            [format!("-DSTATES={states}"), format!("-DMODEL={c}"), format!("-DHEADER=\"{}\"", header.display())];
        let peer = Peer::compiled(&format!("exported_{name}"), folder, &sources, &words);
        let _ = std::fs::remove_dir_all(&place);
        peer
    }

    fn compiled(name: &str, include: &Path, sources: &[PathBuf], words: &[String]) -> Peer {
        let program = std::env::temp_dir().join(format!("halfarrow_bench_{name}_{}", std::process::id()));
        let mut compiler = Command::new("cc");
        compiler.args(["-std=c99", "-O2", "-o"]).arg(&program).args(words);
        let status = compiler.arg("-I").arg(include).args(sources).arg("-lm").status();
        assert!(status.expect("a C compiler named cc is needed").success(), "{name} does not compile");
        let mut child = Command::new(&program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it runs");
        let (to, from) = (child.stdin.take().expect("piped"), child.stdout.take().expect("piped"));
        let _ = std::fs::remove_file(&program);
        Peer { child, to, from: BufReader::new(from) }
    }

    /// Nanoseconds of a batch, and where it ends.
    fn run(&mut self, count: usize) -> (f64, Vec<f64>) {
        writeln!(self.to, "{count}").and_then(|()| self.to.flush()).expect("it still runs");
        let mut line = String::new();
        self.from.read_line(&mut line).expect("it still runs");
        let mut numbers = line.split_whitespace().map(|n| n.parse::<f64>().expect("a number"));
        (numbers.next().expect("a time"), numbers.collect())
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
